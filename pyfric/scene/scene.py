"""Scenes: what is simulated, checked on construction, in SI units.

A scene is a slider on a frictional interface, loaded from above and pushed from one side.
Source of the model, the symbols and the presets: J. Trømborg, J. Scheibert, D. S. Amundsen,
K. Thøgersen, A. Malthe-Sørenssen, Phys. Rev. Lett. 107, 074301 (2011), "the paper" below.

Scene files are TOML. Every number that has a unit is written with it::

    name = "fig1"

    [slider]
    L = "140 mm"
    H = "75 mm"
    l = "2.5 mm"
    k = "13.5 MN/m"
    M = "75.6 g"

    [top]
    kind = "rod"            # or "distributed", or "prescribed" (a chain)
    F_N = "3500 N"

    [driver]
    K = "4 MN/m"
    V = "0.7875 mm/s"
    h = "5 mm"

    [interface]
    mu_s = 0.7
    mu_k = 0.45

Every refusal, whatever its origin, is a `SceneError`.
"""

import dataclasses
import functools
import math
import os
import tomllib
import typing
from collections.abc import Callable, Sequence
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import pydantic
import tomli_w
from pydantic_core import core_schema

from pyfric.scene.files import written
from pyfric.scene.units import SceneError, check_number, parse_quantity, range_text, unknown

__all__ = [
    "MAX_BLOCKS",
    "PRESETS",
    "DistributedLoad",
    "Driver",
    "Interface",
    "PrescribedLoad",
    "Rod",
    "Scene",
    "SceneError",
    "Slider",
    "chain",
    "check_number",
    "fig1",
    "parse_quantity",
    "preset",
    "run1",
    "run2",
    "run3",
    "run4",
    "setup1",
    "setup2",
    "setup2_minus",
    "setup2_plus",
]

MAX_BLOCKS = 20_000_000
"""Largest number of blocks N_x N_z accepted, so that a mistyped l does not exhaust the memory."""
MAX_LISTED = 10_000
"""Largest number of blocks whose forces can be listed one by one."""
MAX_FILE = 1_048_576
"""Largest scene file accepted, in bytes; two lists of `MAX_LISTED` forces fit."""
MAX_NAME = 200
"""Largest number of characters in the name of a scene."""
MULTIPLE_RTOL = 1e-9
"""Relative tolerance of "L, H and h are multiples of l"."""


@dataclasses.dataclass(frozen=True)
class _Written:
    """A value as it stands in a scene file, where quantities are text with a unit."""

    value: Any


@dataclasses.dataclass(frozen=True)
class _Quantity:
    """Annotation of a number: its SI unit and limits; also its validator."""

    unit: str = ""
    gt: float | None = None
    ge: float | None = None
    le: float | None = None
    optional: bool = False
    listed: bool = False  # or a sequence of numbers, which becomes a tuple
    note: str = ""

    @property
    def _limits(self) -> dict[str, float | None]:
        return {"gt": self.gt, "ge": self.ge, "le": self.le}

    @property
    def allowed(self) -> str:
        return range_text(self.unit, **self._limits) + self.note

    def check(self, value: Any) -> float | tuple[float, ...] | None:
        if value is None and self.optional:
            return None
        written = isinstance(value, _Written)
        if written:
            value = value.value
        several = isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.ndim)
        if self.listed and several:
            return self._each([_Written(one) for one in value] if written else value)
        if written and self.unit:
            value = parse_quantity("", value, self.unit, allowed=self.allowed)
        try:
            return check_number("", value, self.unit, **self._limits)
        except SceneError as error:
            allowed = error.allowed + self.note
            raise SceneError("", error.value, self.unit, allowed, error.reason) from None

    def _each(self, values: Sequence[Any]) -> tuple[float, ...]:
        if len(values) > MAX_LISTED:
            raise SceneError("", values, "", f"at most {MAX_LISTED} numbers", "too many")
        found, one = [], dataclasses.replace(self, listed=False, note="")
        for n, value in enumerate(values, 1):
            try:
                found.append(one.check(value))
            except SceneError as error:
                reason = f"block {n}: {error.reason}"
                raise SceneError("", error.value, self.unit, error.allowed, reason) from None
        return tuple(found)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.check)


def _quantities(cls: type) -> dict[str, _Quantity]:
    """Return the `_Quantity` of each numeric field of a part."""
    return {
        name: mark
        for name, hint in typing.get_type_hints(cls, include_extras=True).items()
        for mark in getattr(hint, "__metadata__", ())
        if isinstance(mark, _Quantity)
    }


def _names(cls: type) -> list[str]:
    return [field.name for field in dataclasses.fields(cls)]


def _translated(cls: type, error: pydantic.ValidationError) -> SceneError:
    """Return the `SceneError` that says what a pydantic error says."""
    prefix = f"{cls._section}." if cls._section else ""
    marks, found = _quantities(cls), {}
    for line in error.errors(include_url=False):
        key = str(line["loc"][0]) if line["loc"] else ""
        cause = line.get("ctx", {}).get("error")
        if isinstance(cause, SceneError):
            one = cause.at(prefix + key) if key else cause
        elif line["type"] == "unexpected_keyword_argument":
            one = unknown(prefix + key, line["input"], key, _names(cls))
        else:
            mark = marks.get(key, _Quantity())
            allowed = mark.allowed if key in marks else cls._allowed.get(key, "keyword arguments")
            missing = line["type"] == "missing"
            value, reason = (None, "missing") if missing else (line["input"], line["msg"])
            one = SceneError(prefix + key, value, mark.unit, allowed, reason)
        found.setdefault(key, one)
    return SceneError.joined(found.values())


@typing.dataclass_transform(frozen_default=True, kw_only_default=True)
def _part(cls: type) -> type:
    """Make a frozen keyword-only pydantic dataclass whose refusals are `SceneError`."""
    config = pydantic.ConfigDict(extra="forbid", strict=True)
    cls = pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=config)(cls)
    checked = cls.__init__

    @functools.wraps(checked)
    def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
        try:
            checked(self, *args, **kwargs)
        except pydantic.ValidationError as error:
            raise _translated(cls, error) from None

    cls.__init__ = __init__
    return cls


def _steps(length: float, l: float) -> int | None:
    """Return length / l if it is a whole number within `MULTIPLE_RTOL`, else None."""
    n = round(length / l)
    return n if abs(length / l - n) <= MULTIPLE_RTOL * n else None


LIST_NOTE = ", or a list of N_x of them"
CHAIN_NOTE = ", or 0 for a chain under a prescribed load"

_Positive = functools.partial(_Quantity, gt=0.0)
_NotNegative = functools.partial(_Quantity, ge=0.0)


@_part
class Slider:
    """The slider: a square lattice of N_x by N_z blocks, or a chain (N_z = 1).

    Args:
        L: length along the interface, m; a multiple of l, at least 2 l.
        H: height, m; a multiple of l, at least l, or 0 for a chain under a `PrescribedLoad`.
        l: lattice constant, m; N_x N_z may not exceed `MAX_BLOCKS`.
        k: stiffness of the nearest-neighbour springs, N/m (3 B E / 4; it does not depend on l).
        M: mass, kg.
        eta: viscosity of every bond, N s/m, >= 0; None means sqrt(0.1 k m).

    Raises:
        SceneError: a value is missing, unknown, of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), model section.
    """

    L: Annotated[float, _Positive("m")]
    H: Annotated[float, _NotNegative("m")]
    l: Annotated[float, _Positive("m")]
    k: Annotated[float, _Positive("N/m")]
    M: Annotated[float, _Positive("kg")]
    eta: Annotated[float | None, _NotNegative("N s/m", optional=True)] = None

    _section: ClassVar[str] = "slider"
    _allowed: ClassVar[dict[str, str]] = {}

    def __post_init__(self) -> None:
        errors = []
        blocks = (round(self.L / self.l) + 1) * (round(self.H / self.l) + 1)
        if blocks > MAX_BLOCKS:
            allowed = f"a length in m that gives at most {MAX_BLOCKS} blocks"
            raise SceneError("slider.l", self.l, "m", allowed, f"{blocks:.3g} blocks")
        for name, length, least, note in (("L", self.L, 2, ""), ("H", self.H, 0, CHAIN_NOTE)):
            steps = _steps(length, self.l)
            if steps is None or steps < least:
                few = least or 1
                allowed = f"a multiple of l = {self.l!r} m, >= {few} l = {few * self.l!r} m{note}"
                reason = "too small" if steps is not None else "not a multiple of l"
                errors.append(SceneError(f"slider.{name}", length, "m", allowed, reason))
        if errors:
            raise SceneError.joined(errors)

    @property
    def N_x(self) -> int:
        """Number of columns, L/l + 1."""
        return round(self.L / self.l) + 1

    @property
    def N_z(self) -> int:
        """Number of rows, H/l + 1."""
        return round(self.H / self.l) + 1

    @property
    def m(self) -> float:
        """Mass of one block, M / (N_x N_z), in kg."""
        return self.M / (self.N_x * self.N_z)


@_part
class Rod:
    """Top boundary of setup 1: the top row is glued to a rigid rod that can tilt.

    Args:
        F_N: normal force at the centre of the rod, N, > 0.
        mass: mass of the rod, kg, >= 0 (the top blocks add theirs).
        mattress: total stiffness of the spring mattress that resists the tilt, N/m, >= 0.

    F_N = 0 is refused: nothing would touch the interface, and forces are compared with F_N.

    Raises:
        SceneError: a value is missing, unknown, of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), setup 1.
    """

    F_N: Annotated[float, _Positive("N")]
    mass: Annotated[float, _NotNegative("kg")] = 0.0756
    mattress: Annotated[float, _NotNegative("N/m")] = 0.4e6

    kind: ClassVar[str] = "rod"
    _section: ClassVar[str] = "top"
    _allowed: ClassVar[dict[str, str]] = {}


@_part
class DistributedLoad:
    """Top boundary of setup 2: a free top row under vertical forces.

    The block with number n from the trailing edge carries
    (F_N/N_x) (1 + theta (2n - N_x - 1)/(N_x - 1)), downward.

    Args:
        F_N: total normal force, N, > 0.
        theta: slope of the load, in [-1, 1]; positive means little load on the trailing edge.

    F_N = 0 is refused: nothing would touch the interface, and forces are compared with F_N.

    Raises:
        SceneError: a value is missing, unknown, of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), setup 2.
    """

    F_N: Annotated[float, _Positive("N")]
    theta: Annotated[float, _Quantity("", ge=-1.0, le=1.0)] = 0.0

    kind: ClassVar[str] = "distributed"
    _section: ClassVar[str] = "top"
    _allowed: ClassVar[dict[str, str]] = {}


@_part
class PrescribedLoad:
    """Top boundary of a chain (N_z = 1): the forces on its blocks.

    Sequences have N_x numbers, from the trailing edge on; they become tuples. A block is pressed
    down with p_i, pushed along the driving with the constant force tau_i, which its friction
    balances at t = 0, and pulled back with k_top times its displacement since then.

    Args:
        p: normal force on each block, N, > 0; one number or a sequence of N_x.
        tau: friction force on each block at t = 0, N, positive against driving,
            |tau_i| <= mu_s p_i; one number or a sequence of N_x.
        k_top: shear stiffness between each block and a rigid top, N/m, >= 0.

    Raises:
        SceneError: a value is missing, unknown, of the wrong type or out of range.

    Source: D. S. Amundsen et al., Phys. Rev. E 92, 032406 (2015), fronts in a chain with
    prescribed stresses.
    """

    p: Annotated[float | tuple[float, ...], _Positive("N", listed=True, note=LIST_NOTE)]
    tau: Annotated[float | tuple[float, ...], _Quantity("N", listed=True, note=LIST_NOTE)] = 0.0
    k_top: Annotated[float, _NotNegative("N/m")] = 0.0

    kind: ClassVar[str] = "prescribed"
    _section: ClassVar[str] = "top"
    _allowed: ClassVar[dict[str, str]] = {}


@_part
class Driver:
    """The spring that pushes one side of the slider; its far end moves at constant speed.

    Args:
        K: stiffness, N/m, > 0.
        V: speed of the far end towards the slider, m/s, >= 0 (0 holds the driver).
        h: height of the driven block above the interface, m; a multiple of l, l <= h <= H; 0 in a
            chain.
        side: "left" or "right", the side that is pushed (the trailing edge).

    Raises:
        SceneError: a value is missing, unknown, of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), F_T = K (V t - x_h).
    """

    K: Annotated[float, _Positive("N/m")]
    V: Annotated[float, _NotNegative("m/s")]
    h: Annotated[float, _NotNegative("m", note=", a multiple of l up to H")]
    side: Literal["left", "right"] = "left"

    _section: ClassVar[str] = "driver"
    _allowed: ClassVar[dict[str, str]] = {"side": "'left' or 'right'"}


@_part
class Interface:
    """The frictional interface under the bottom row.

    Args:
        mu_s: static friction coefficient, >= 0.
        mu_k: kinetic friction coefficient, 0 <= mu_k <= mu_s.
        k_f: stiffness of the elastic foundation per block, N/m, > 0; None means k.
        d_c: slip over which friction weakens, m, >= 0; 0 is Amontons-Coulomb friction.

    A block that has slipped by s since it last stuck resists with mu(s) p,
    mu(s) = mu_s - (mu_s - mu_k) min(s/d_c, 1). A direct reversal does not end its slip; sticking
    does. Weakening is a negative stiffness (mu_s - mu_k) p/d_c. A slider that is stiffer slips
    stably, at the pace of the driver, until the slipping zone is too long for that. Steps resolve
    it if dt sqrt((mu_s - mu_k) p/(m d_c)) is below 1, p being F_N/N_x; the notes of a record say
    where they do not.

    Raises:
        SceneError: a value is missing, unknown, of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), interface law, and its remark on slip weakening.
    """

    mu_s: Annotated[float, _NotNegative("")]
    mu_k: Annotated[float, _NotNegative("")]
    k_f: Annotated[float | None, _Positive("N/m", optional=True)] = None
    d_c: Annotated[float, _NotNegative("m")] = 0.0

    _section: ClassVar[str] = "interface"
    _allowed: ClassVar[dict[str, str]] = {}

    def __post_init__(self) -> None:
        if self.mu_k > self.mu_s:
            allowed = f"0 <= mu_k <= mu_s = {self.mu_s!r}"
            raise SceneError("interface.mu_k", self.mu_k, "", allowed, "mu_k exceeds mu_s")

    @property
    def weakens(self) -> bool:
        """True if friction depends on slip."""
        return self.d_c > 0 and self.mu_s > self.mu_k


@_part
class Scene:
    """What is simulated: slider, top boundary, driver and interface. Immutable and hashable.

    Args:
        slider: a `Slider`.
        top: a `Rod` (setup 1), a `DistributedLoad` (setup 2) or a `PrescribedLoad` (a chain).
        driver: a `Driver`; its h must be on a row of the slider above the bottom one, or 0 for a
            chain.
        interface: an `Interface`.
        name: free text of at most `MAX_NAME` characters.

    Raises:
        SceneError: a part is missing, unknown or of the wrong type, h is not on a row, or the
            forces on a chain do not fit its blocks.

    Use `dataclasses.replace` on a scene and its parts to change values; all checks are repeated.
    Arrays run along the interface from the leftmost block to the rightmost one.

    Source: PRL 107, 074301 (2011).
    """

    slider: Slider
    top: Rod | DistributedLoad | PrescribedLoad
    driver: Driver
    interface: Interface
    name: str = ""

    _section: ClassVar[str] = ""
    _allowed: ClassVar[dict[str, str]] = {
        "slider": "a Slider",
        "top": "a Rod, a DistributedLoad or a PrescribedLoad",
        "driver": "a Driver",
        "interface": "an Interface",
        "name": f"text of at most {MAX_NAME} characters",
    }

    def __post_init__(self) -> None:
        encodable = self.name.encode("utf-8", "replace").decode() == self.name
        if len(self.name) > MAX_NAME or not encodable:
            allowed = self._allowed["name"]
            raise SceneError("name", self.name, "", allowed, "too long or not UTF-8")
        h, l, H = self.driver.h, self.slider.l, self.slider.H
        if isinstance(self.top, PrescribedLoad):
            self._check_chain()
            return
        if self.N_z == 1:
            allowed = f"a multiple of l = {l!r} m, >= l{CHAIN_NOTE}"
            reason = f"too small where top.kind = {self.top.kind!r}"
            raise SceneError("slider.H", H, "m", allowed, reason)
        steps = _steps(h, l)
        if steps is None or not 1 <= steps < self.slider.N_z:
            allowed = f"a multiple of l = {l!r} m, from l to H = {H!r} m"
            reason = "not on a row" if steps is None else "not on a row that can be driven"
            raise SceneError("driver.h", h, "m", allowed, reason)

    def _check_chain(self) -> None:
        slider, top = self.slider, self.top
        for name, length in (("slider.H", slider.H), ("driver.h", self.driver.h)):
            if length:
                raise SceneError(name, length, "m", "0 m", "a prescribed load needs a chain")
        for name in ("p", "tau"):
            value = getattr(top, name)
            if isinstance(value, tuple) and len(value) != self.N_x:
                allowed = f"one number in N, or {self.N_x} of them, one for each block"
                raise SceneError(f"top.{name}", value, "N", allowed, f"{len(value)} numbers")
        p, tau = np.atleast_1d(top.p), np.atleast_1d(top.tau)
        most, tau = np.broadcast_arrays(self.interface.mu_s * p, tau)
        over = np.abs(tau) > most
        if over.any():
            i = int(np.argmax(over))
            allowed = f"|tau| <= mu_s p = {float(most[i])!r} N"
            reason = f"block {i + 1} from the trailing edge would slip"
            raise SceneError("top.tau", float(tau[i]), "N", allowed, reason)

    @property
    def N_x(self) -> int:
        """Number of columns, L/l + 1."""
        return self.slider.N_x

    @property
    def N_z(self) -> int:
        """Number of rows, H/l + 1."""
        return self.slider.N_z

    @property
    def m(self) -> float:
        """Mass of one block, M / (N_x N_z), in kg."""
        return self.slider.m

    @property
    def eta(self) -> float:
        """Viscosity of every bond in N s/m; sqrt(0.1 k m) unless the slider sets it."""
        given = self.slider.eta
        return math.sqrt(0.1 * self.slider.k * self.m) if given is None else given

    @property
    def k_f(self) -> float:
        """Stiffness of the foundation per block in N/m; k unless the interface sets it."""
        given = self.interface.k_f
        return self.slider.k if given is None else given

    @property
    def F_N(self) -> float:
        """Total normal force in N."""
        if isinstance(self.top, PrescribedLoad):
            p = self.top.p
            return math.fsum(p) if isinstance(p, tuple) else self.N_x * p
        return self.top.F_N

    @property
    def d(self) -> int:
        """Direction of driving: +1 (pushed from the left) or -1 (from the right)."""
        return 1 if self.driver.side == "left" else -1

    @property
    def i_h(self) -> int:
        """Column of the driven block, counted from 0: 0 or N_x - 1."""
        return 0 if self.driver.side == "left" else self.N_x - 1

    @property
    def j_h(self) -> int:
        """Row of the driven block, counted from 0 at the bottom: h / l."""
        return round(self.driver.h / self.slider.l)

    @property
    def x(self) -> np.ndarray:
        """Reference positions of the columns from the centre, shape (N_x,), in m."""
        return (np.arange(self.N_x) - (self.N_x - 1) / 2) * self.slider.l

    @property
    def n_of_i(self) -> np.ndarray:
        """Block numbers from the trailing edge (1 … N_x), left to right, shape (N_x,), int."""
        n = np.arange(1, self.N_x + 1)
        return n if self.driver.side == "left" else n[::-1].copy()

    @property
    def load(self) -> np.ndarray:
        """Downward forces on the top blocks, left to right, shape (N_x,), in N; 0 for a rod."""
        if isinstance(self.top, Rod):
            return np.zeros(self.N_x)
        if isinstance(self.top, PrescribedLoad):
            return self._by_column(self.top.p)
        slope = (2 * self.n_of_i - self.N_x - 1) / (self.N_x - 1)
        return self.F_N / self.N_x * (1 + self.top.theta * slope)

    @property
    def shear(self) -> np.ndarray:
        """Constant forces in +x on the top blocks, left to right, shape (N_x,), in N: d tau_i."""
        if not isinstance(self.top, PrescribedLoad):
            return np.zeros(self.N_x)
        return self.d * self._by_column(self.top.tau) + 0.0  # no -0.0

    def _by_column(self, values: float | tuple[float, ...]) -> np.ndarray:
        """Return numbers that run from the trailing edge as an array from left to right."""
        if isinstance(values, tuple):
            return np.array(values)[self.n_of_i - 1]
        return np.full(self.N_x, values)

    @property
    def k_top(self) -> float:
        """Stiffness that holds each top block of a chain at u_x = 0, its place at t = 0, in N/m."""
        return self.top.k_top if isinstance(self.top, PrescribedLoad) else 0.0

    @property
    def rigid(self) -> bool:
        """True if the top row is glued to a rod (setup 1)."""
        return isinstance(self.top, Rod)

    @property
    def M_rod(self) -> float:
        """Mass of the rod in kg; 0 without a rod."""
        return self.top.mass if isinstance(self.top, Rod) else 0.0

    @property
    def kappa(self) -> float:
        """Torque of the mattress per tilt, mattress L^2 / 12, in N m; 0 without a rod."""
        return self.top.mattress * self.slider.L**2 / 12 if isinstance(self.top, Rod) else 0.0

    def to_toml(self, path: str | os.PathLike[str] | None = None) -> str:
        """Return the scene as TOML; with `path`, also write it to that file in one step.

        Quantities are written in SI units with all digits: `from_toml` gives an equal scene,
        bit for bit. Values left at None are left out.

        Raises:
            OSError: the file cannot be written; an existing file is then unchanged.
        """
        document: dict[str, Any] = {"name": self.name} if self.name else {}
        for part in (self.slider, self.top, self.driver, self.interface):
            table = {"kind": part.kind} if part is self.top else {}
            marks = _quantities(type(part))
            for key in _names(type(part)):
                value = getattr(part, key)
                if value is not None:
                    unit = marks[key].unit if key in marks else ""
                    table[key] = _as_written(value, unit)
            document[part._section] = table
        text = tomli_w.dumps(document)
        if path is not None:
            with written(path) as draft:
                draft.write_text(text, encoding="utf-8", newline="\n")
        return text

    @classmethod
    def from_toml(cls, source: str | os.PathLike[str]) -> Self:
        """Return the scene in a TOML file or text.

        Args:
            source: path of a file, or the TOML text itself. A string with a line break is
                taken as text, any other one as a path.

        Quantities are text with a unit, such as "5 mm"; any unit of the right dimension will
        do. Pure numbers (mu_s, mu_k, theta) are bare numbers. A table `[top]` has
        kind = "rod", "distributed" or "prescribed"; in the last one, p and tau may be lists.

        Raises:
            SceneError: the file cannot be read, is not TOML or larger than `MAX_FILE` bytes,
                or anything in it is missing, unknown, without or with a wrong unit, or out of
                range. All problems found are listed.
        """
        document = _parsed(source)
        known = ["name", *_PARTS]
        errors = [
            unknown(key, value, key, known) for key, value in document.items() if key not in known
        ]
        parts: dict[str, Any] = {"name": document.get("name", "")}
        for section in _PARTS:
            try:
                parts[section] = _part_from(section, document.get(section))
            except SceneError as error:
                errors.append(error)
        if not errors:
            return cls(**parts)
        if not isinstance(parts["name"], str):
            errors.append(SceneError("name", parts["name"], "", cls._allowed["name"], "not text"))
        raise SceneError.joined(errors)


def _as_written(value: Any, unit: str) -> Any:
    """Return a value of a part as it stands in a scene file."""
    if isinstance(value, tuple):
        return [_as_written(one, unit) for one in value]
    return f"{value!r} {unit}" if unit else value


_PARTS: dict[str, tuple[type, ...]] = {
    "slider": (Slider,),
    "top": (Rod, DistributedLoad, PrescribedLoad),
    "driver": (Driver,),
    "interface": (Interface,),
}


def _parsed(source: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the TOML document in a file or text."""
    if isinstance(source, str) and "\n" in source:
        name, data = None, source.encode("utf-8", "replace")
    else:
        name = str(source)
        try:
            with open(source, "rb") as file:
                data = file.read(MAX_FILE + 1)
        except (OSError, ValueError) as error:
            reason = f"cannot be read ({getattr(error, 'strerror', None) or error})"
            raise SceneError("scene", name, "", "a readable scene file", reason) from None
    if len(data) > MAX_FILE:
        raise SceneError("scene", name, "", f"at most {MAX_FILE} bytes of TOML", "too large")
    try:
        return tomllib.loads(data.decode())
    except RecursionError:
        raise SceneError("scene", name, "", "a TOML document", "nested too deeply") from None
    except ValueError as error:
        raise SceneError("scene", name, "", "a TOML document", f"not TOML ({error})") from None


def _part_from(section: str, table: Any) -> Any:
    """Return the part that a table of a scene file describes."""
    classes = _PARTS[section]
    if not isinstance(table, dict):
        reason = "missing" if table is None else "not a table"
        raise SceneError(section, table, "", f"a table [{section}]", reason)
    table = dict(table)
    cls = classes[0]
    if len(classes) > 1:
        kinds = {one.kind: one for one in classes}
        kind = table.pop("kind", None)
        if not isinstance(kind, str):
            allowed = " or ".join(repr(one) for one in kinds)
            reason = "missing" if kind is None else "not text"
            raise SceneError(f"{section}.kind", kind, "", allowed, reason)
        if kind not in kinds:
            raise unknown(f"{section}.kind", kind, kind, kinds)
        cls = kinds[kind]
    known, marks = _names(cls), _quantities(cls)
    listed = [*(["kind"] if len(classes) > 1 else []), *known]
    errors = [
        unknown(f"{section}.{key}", value, key, listed)
        for key, value in table.items()
        if key not in known
    ]
    values = {
        key: _Written(value) if key in marks else value
        for key, value in table.items()
        if key in known
    }
    try:
        part = cls(**values)
    except SceneError as error:
        errors.append(error)
    if errors:
        raise SceneError.joined(errors)
    return part


def setup1(
    *,
    L: float = 0.14,
    h: float = 5e-3,
    F_N: float = 3500.0,
    mu_s: float = 0.7,
    mu_k: float = 0.45,
    M: float | None = None,
    l: float = 2.5e-3,
    H: float = 0.075,
    k: float = 13.5e6,
    K: float = 4e6,
    V: float = 0.7875e-3,
    side: Literal["left", "right"] = "left",
    mass: float = 0.0756,
    mattress: float = 0.4e6,
    eta: float | None = None,
    k_f: float | None = None,
    d_c: float = 0.0,
    name: str = "setup1",
) -> Scene:
    """Return setup 1 of the paper: the top row glued to a rigid rod.

    Arguments are the fields of the parts, in SI units. Where l is changed, k stays
    (k = 3 B E / 4 does not depend on l) and the block mass follows from M / (N_x N_z).

    M = None means 0.54 kg/m times L: 75.6 g at L = 140 mm, 108 g at L = 200 mm. The paper's
    caption gives 75.6 g; only at L = 140 mm does this lead to its wave speeds (1677 and
    968 m/s), so the density is kept. Pass M=0.0756 for the literal mass at every L.

    Raises:
        SceneError: a value is of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), Fig. 1 and its caption.
    """
    if M is None:
        M = 0.0756 * (check_number("slider.L", L, "m", gt=0.0) / 0.14)  # 0.54 kg/m
    return Scene(
        slider=Slider(L=L, H=H, l=l, k=k, M=M, eta=eta),
        top=Rod(F_N=F_N, mass=mass, mattress=mattress),
        driver=Driver(K=K, V=V, h=h, side=side),
        interface=Interface(mu_s=mu_s, mu_k=mu_k, k_f=k_f, d_c=d_c),
        name=name,
    )


def setup2(
    *,
    theta: float = 0.0,
    h: float = 2e-3,
    F_N: float = 400.0,
    mu_s: float = 0.7,
    mu_k: float = 0.45,
    L: float = 0.1,
    H: float = 0.02,
    l: float = 1e-3,
    k: float = 9.375e6,
    M: float = 0.012,
    K: float = 0.8e6,
    V: float = 0.45e-3,
    side: Literal["left", "right"] = "left",
    eta: float | None = None,
    k_f: float | None = None,
    d_c: float = 0.0,
    name: str = "setup2",
) -> Scene:
    """Return setup 2 of the paper: a free top row under a distributed load with slope theta.

    Arguments are the fields of the parts, in SI units; theta in [-1, 1] (the paper uses 0.833,
    0 and -0.833). Where l is changed, k stays and the block mass follows from M / (N_x N_z).

    Raises:
        SceneError: a value is of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), setup 2.
    """
    return Scene(
        slider=Slider(L=L, H=H, l=l, k=k, M=M, eta=eta),
        top=DistributedLoad(F_N=F_N, theta=theta),
        driver=Driver(K=K, V=V, h=h, side=side),
        interface=Interface(mu_s=mu_s, mu_k=mu_k, k_f=k_f, d_c=d_c),
        name=name,
    )


def chain(
    *,
    p: float | Sequence[float] | None = None,
    tau: float | Sequence[float] = 0.0,
    k_top: float = 0.0,
    mu_s: float = 0.7,
    mu_k: float = 0.45,
    L: float = 0.14,
    l: float = 2.5e-3,
    k: float | None = None,
    M: float | None = None,
    K: float = 4e6,
    V: float = 0.7875e-3,
    side: Literal["left", "right"] = "left",
    eta: float | None = None,
    k_f: float | None = None,
    d_c: float = 0.0,
    name: str = "chain",
) -> Scene:
    """Return a chain (N_z = 1): by default setup 1 of the paper, lumped into one row.

    Arguments are the fields of the parts, in SI units; p and tau are numbers or sequences of N_x
    numbers from the trailing edge on. Each block stands for a column of setup 1:

    - p = None means 3500 N / N_x, the normal force of setup 1, spread evenly;
    - k = None means E B H / l = 1.35 MN / l, 540 MN/m at l = 2.5 mm, so that a uniform stretch
      takes the same force; E B = 4 k/3 with k = 13.5 MN/m, H = 75 mm;
    - M = None means 0.54 kg/m times L, as in `setup1`.

    Waves then travel at l sqrt(k/m) = 1595 m/s, the speed of long waves in a rod, sqrt(E/rho).
    Driver and friction are those of setup 1; tau = 0 and k_top = 0 leave a plain chain.

    Raises:
        SceneError: a value is of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), setup 1.
    """
    L = check_number("slider.L", L, "m", gt=0.0)
    l = check_number("slider.l", l, "m", gt=0.0)
    slider = Slider(
        L=L,
        H=0.0,
        l=l,
        k=1.35e6 / l if k is None else k,
        M=0.0756 * (L / 0.14) if M is None else M,  # 0.54 kg/m
        eta=eta,
    )
    return Scene(
        slider=slider,
        top=PrescribedLoad(p=3500.0 / slider.N_x if p is None else p, tau=tau, k_top=k_top),
        driver=Driver(K=K, V=V, h=0.0, side=side),
        interface=Interface(mu_s=mu_s, mu_k=mu_k, k_f=k_f, d_c=d_c),
        name=name,
    )


def fig1(**changes: Any) -> Scene:
    """Return the scene of Figs 1, 3 and 4(a): setup 1 as it stands.

    Keyword arguments replace those of `setup1`, here and in the other named scenes.
    """
    return setup1(**{"name": "fig1"} | changes)


def run1(**changes: Any) -> Scene:
    """Return run 1 of Fig. 4(b): setup 1 with mu_s = 0.5, mu_k = 0.2."""
    return setup1(**{"mu_s": 0.5, "mu_k": 0.2, "name": "run1"} | changes)


def run2(**changes: Any) -> Scene:
    """Return run 2 of Fig. 4(b): setup 1 with mu_s = 0.55, mu_k = 0.3."""
    return setup1(**{"mu_s": 0.55, "mu_k": 0.3, "name": "run2"} | changes)


def run3(**changes: Any) -> Scene:
    """Return run 3 of Fig. 4(b): setup 1 with h = 7.5 mm."""
    return setup1(**{"h": 7.5e-3, "name": "run3"} | changes)


def run4(**changes: Any) -> Scene:
    """Return run 4 of Fig. 4(b): setup 1 with L = 200 mm, F_N = 2700 N, h = 10 mm.

    The mass is 108 g (constant density); M=0.0756 gives the literal value of the caption.
    """
    return setup1(**{"L": 0.2, "F_N": 2700.0, "h": 10e-3, "name": "run4"} | changes)


def setup2_plus(**changes: Any) -> Scene:
    """Return setup 2 with theta = 0.833: little load on the trailing edge."""
    return setup2(**{"theta": 0.833, "name": "setup2+"} | changes)


def setup2_minus(**changes: Any) -> Scene:
    """Return setup 2 with theta = -0.833: much load on the trailing edge."""
    return setup2(**{"theta": -0.833, "name": "setup2-"} | changes)


PRESETS: MappingProxyType[str, Callable[..., Scene]] = MappingProxyType(
    {
        "fig1": fig1,
        "run1": run1,
        "run2": run2,
        "run3": run3,
        "run4": run4,
        "setup1": setup1,
        "setup2": setup2,
        "setup2+": setup2_plus,
        "setup2-": setup2_minus,
        "chain": chain,
    }
)
"""The paper's scenes and `chain` by name; functions take the keyword arguments of their setup."""


def preset(name: str, **changes: Any) -> Scene:
    """Return the named scene, with changes.

    Args:
        name: a key of `PRESETS`.
        changes: keyword arguments of `setup1`, `setup2` or `chain`.

    Raises:
        SceneError: an unknown name or keyword (the nearest known one is given), or a value
            that is refused.
    """
    if name not in PRESETS:
        raise unknown("preset", name, str(name), PRESETS)
    setup = chain if name == "chain" else setup2 if name.startswith("setup2") else setup1
    known = list(setup.__kwdefaults__)
    for key, value in changes.items():
        if key not in known:
            raise unknown(key, value, key, known)
    return PRESETS[name](**changes)
