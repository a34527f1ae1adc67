"""Do precursors lengthen with rate-and-state friction as with Amontons-Coulomb friction?

The slider of the preset `rate_and_state` is pushed from the side up to its first event of the whole
interface. Runs cover three decades of the driver's speed, the slip law, and a lattice of half the
spacing. The first run is repeated with half the step and a hundredth of the accuracy. Its first two
precursors are repeated by full dynamics.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd
from sizes import size

import pyfric
from pyfric.figures import DataFigure

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

V, PUSHED = 0.4e-3, size(0.92e-3, 0.4e-3)
"""Speed and displacement of the driver (m/s, m)."""
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "V = 0.4 mm/s": ({}, {}),
    "half the step, accuracy 1e-6": ({}, {"dt": 0.3e-6, "accuracy": 1e-6}),
    "V = 4 mm/s": ({"V": 10 * V}, {}),
    "V = 0.04 mm/s": ({"V": V / 10}, {}),
    "slip law": ({"evolution": "slip"}, {}),
    "l = 1.25 mm": ({"l": 1.25e-3}, {}),
    "full dynamics": ({}, {"fidelity": "dynamic", "accuracy": None, "energies": False}),
}
CASES = size(CASES, {"V = 4 mm/s": ({"V": 10 * V, "l": 5e-3}, {"accuracy": 1e-3})})
"""Name of a case -> changes of the preset, and options."""
OPTIONS = {"fidelity": "hybrid", "geometry": "linear", "accuracy": 1e-4, "progress": False}
"""Default options of runs."""
SHORT = {"full dynamics": 0.48e-3}
"""Cases that end earlier -> displacement of the driver, m."""
SHOWN = ("V = 0.4 mm/s", "V = 4 mm/s", "V = 0.04 mm/s", "slip law", "l = 1.25 mm")
COLUMNS = {"t_start": "t_s", "L_p_over_L": "L_p_over_L", "n_blocks": "n_blocks"}


def run(changes: Mapping[str, Any], options: Mapping[str, Any], pushed: float = PUSHED) -> Any:
    """Return the record of a case, up to `pushed` (m)."""
    scene = pyfric.preset("rate_and_state", dict(changes))
    t_end = pushed / scene.driver.V
    return pyfric.simulate(scene, t_end, **OPTIONS | dict(options), stop_when="system_size")


def study(
    names: tuple[str, ...] = tuple(CASES),
    pushed: float = PUSHED,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Return one row for each main event of each case."""
    parts = []
    for name in names:
        record = run(*CASES[name], min(pushed, SHORT.get(name, pushed)))
        events = record.events[record.events["is_main"]]
        part = events[list(COLUMNS)].rename(columns=COLUMNS)
        part["F_T_over_F_N"] = events["F_T_start"] / record.scene.F_N
        part["arrest_over_F_N"] = events["F_T_arrest"] / record.scene.F_N
        part.insert(0, "case", name)
        parts.append(part)
        say(f"{name}: {len(part)} events in {record.timings['stepping']:.0f} s")
    return pd.concat(parts, ignore_index=True)


def report(frame: pd.DataFrame) -> str:
    """Return a line for each case."""
    lines = ["case, events that start at the trailing edge, first and last L_p/L, F_T/F_N of them"]
    for name, part in frame.groupby("case", sort=False):
        own = part[part["L_p_over_L"] > 0]
        first, last = own.iloc[0], own.iloc[-1]
        lines.append(
            f"{name}: {len(own)}, {first['L_p_over_L']:.2f} to {last['L_p_over_L']:.2f}, "
            f"{first['F_T_over_F_N']:.3f} to {last['F_T_over_F_N']:.3f}"
        )
    return "\n".join(lines)


def draw(frame: pd.DataFrame) -> DataFigure:
    """Draw lengths over force, and those of quasi-static runs with Amontons-Coulomb friction."""
    figure = DataFigure(figsize=(6.4, 4.4))
    axes = figure.add_subplot()
    known = pyfric.simulate("fig1", 0.9, fidelity="quasistatic", progress=False)
    coulomb = known.events[known.events["is_main"]]
    axes.plot(
        coulomb["F_T_start"] / known.scene.F_N,
        coulomb["L_p_over_L"],
        "k--",
        label="Amontons–Coulomb (Fig. 1 scene)",
    )
    for name, marker in zip(SHOWN, "os^Dx", strict=True):
        part = frame[(frame["case"] == name) & (frame["L_p_over_L"] > 0)]
        axes.plot(part["F_T_over_F_N"], part["L_p_over_L"], marker + "-", ms=4, lw=0.8, label=name)
    axes.set_xlabel(r"driver force at the start of the event $F_T/F_N$")
    axes.set_ylabel(r"length of the precursor $L_p/L$")
    axes.legend(fontsize="small", frameon=False)
    figure.tables = {"precursors": frame}
    figure.caption = (
        "Precursors of the preset rate_and_state (D_c = 0.2 um, l = 2.5 mm, V = 0.4 mm/s if not "
        "said), hybrid engine, linear geometry, and the quasi-static sequence of the Fig. 1 scene."
    )
    return figure
