"""Meanings of measured columns: names that laboratories use, and units."""

from __future__ import annotations

import re
from typing import NamedTuple

from pyfric.values import SceneError, fits, parse_quantity, unit_in


class Meaning(NamedTuple):
    """A meaning of columns: SI unit, text, and names for it, in lower case letters and digits.

    If `sums` is given, the cumulative sum of such a column has the meaning `sums`.
    """

    unit: str
    text: str
    names: frozenset[str]
    sums: str = ""


def _meaning(unit: str, text: str, names: str, sums: str = "") -> Meaning:
    return Meaning(unit, text, frozenset(names.split()), sums)


MEANINGS = {
    "t": _meaning(
        "s", "time", "t time times elapsedtime timeelapsed testtime timestamp runtime runningtime"
    ),
    "step": _meaning(
        "s",
        "time since the sample before",
        "dt deltat step timestep sampperiod sampleperiod samplingperiod sampleinterval "
        "samplinginterval",
        sums="t",
    ),
    "F_T": _meaning(
        "N",
        "tangential force of the driver",
        "ft fs shearforce tangentialforce frictionforce frictionalforce horizontalforce",
    ),
    "F_N": _meaning("N", "normal force", "fn normalforce verticalforce normalload"),
    "tau": _meaning(
        "Pa", "shear stress: F_T over the area", "tau shearstress shearstres shrstress shstress"
    ),
    "sigma_n": _meaning(
        "Pa",
        "normal stress: F_N over the area",
        "sigman sign normalstress norstress nstress effns effnormalstress effectivenormalstress ns",
    ),
    "mu": _meaning(
        "",
        "F_T/F_N",
        "mu friction frictioncoefficient coefficientoffriction frictioncoeff cof ftf ftfn fsfn",
    ),
    "load_point": _meaning(
        "m",
        "displacement of the load point",
        "lpdisp lpdisplacement loadpoint loadpointdisp loadpointdisplacement vdcdt verdcdt",
    ),
    "slip": _meaning("m", "slip of the interface", "slip obslip sliderdisplacement"),
    "normal_displacement": _meaning(
        "m", "displacement normal to the interface", "hdcdt hordcdt normaldisplacement dilation"
    ),
}
"""Name of a meaning of columns -> the meaning. In a biaxial apparatus the vertical DCDT measures
the load point, and the horizontal DCDT the thickness of the layer."""
AMBIGUOUS = {
    **dict.fromkeys(("force", "load", "loadcell", "f"), "F_T or F_N"),
    **dict.fromkeys(("stress", "sigma"), "tau or sigma_n"),
    **dict.fromkeys(("displacement", "disp", "position", "x", "d"), "load_point or slip"),
}
"""Names with two possible meanings."""
SPELLED = {
    **{"mpa": "MPa", "kpa": "kPa", "gpa": "GPa", "kn": "kN", "n": "N", "pa": "Pa"},
    **{"microns": "um", "mic": "um", "mics": "um", "sec": "s", "secs": "s", "seconds": "s"},
    **{"mm.": "mm", "s.": "s", "msec": "ms", "newtons": "N"},
}
"""Spellings of units in laboratories. No spelling is also another unit of the same dimension."""
SYMBOLS = frozenset(re.sub("[^a-z]", "", name.lower()) for name in MEANINGS)
"""Names, such as F_N and sigma_n, whose last letter is no unit."""
GREEK = {"µ": "mu", "μ": "mu", "σ": "sigma", "τ": "tau", "δ": "delta"}
_SINCE = re.compile(r"\s+since\s.*$")
"""Reference time in netCDF units of time, which is ignored."""
_BRACKET = re.compile(r"\s*[(\[<{](?P<unit>[^()\[\]<>{}]*)[)\]>}]\s*$")


def bare(name: str) -> str:
    """Return the name of a column without its unit, in lower case letters and digits."""
    name = _BRACKET.sub("", name)
    if _word(name) in SYMBOLS:  # the N of F_N is no unit
        return _word(name)
    for apart in "_/,":
        stem, _, unit = name.rpartition(apart)
        unit = unit.strip()
        if stem and (unit.lower() in SPELLED or _is_unit(unit)):
            name = stem
    return _word(name)


def _word(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", "".join(GREEK.get(c, c) for c in name.lower()))


def _is_unit(text: str) -> bool:
    return text == "s" or (len(text) > 1 and any(fits(text, m.unit) for m in MEANINGS.values()))


def meaning_of(name: str) -> str:
    """Return the meaning of a column by its name, "" if it is unknown."""
    word = bare(name)
    return next((key for key, meaning in MEANINGS.items() if word in meaning.names), "")


def factor(field: str, unit: str, si: str) -> tuple[float, str]:
    """Return the factor from a unit to SI, and the unit as it was understood.

    Raises:
        SceneError: the unit is unknown.
    """
    unit = _SINCE.sub("", unit.strip())
    if unit in ("", "-", "1", ".") and not si:
        return 1.0, ""
    if not si:
        if fits(unit, si):
            return 0.01, unit
        raise SceneError(field, unit, "", "a ratio of forces, in % or without a unit", "a unit")
    if unit == "mPa":  # mPa most probably means MPa
        raise SceneError(field, unit, si, "MPa or Pa", "millipascal, or a spelling of MPa")
    if not fits(unit, si):
        unit = SPELLED.get(unit.lower(), unit)
    return parse_quantity(field, f"1 {unit}", si), unit


def unit_stated(name: str) -> str:
    """Return the unit in brackets at the end of the name of a column, "" if there is none."""
    bracket = _BRACKET.search(name)
    return bracket["unit"].strip() if bracket else ""


def unit_of_name(name: str, si: str) -> str:
    """Return the unit in the name of a column, "" if there is none.

    Raises:
        ValueError: the unit is unknown.
    """
    if stated := unit_stated(name):
        return stated
    if _word(name) in SYMBOLS:
        return ""
    stem, _, last = name.rpartition("_")
    if stem and not fits(last, si) and last.lower() in SPELLED and si:
        last = SPELLED[last.lower()]
        if fits(last, si):
            return last
    return unit_in(name, si)
