"""Do precursors lengthen with rate-and-state friction as with Amontons-Coulomb friction?

The slider of the preset `rate_and_state`, pushed from the side up to its first event of the whole
interface, for three decades of the driver's speed, with the slip law, and on a lattice of half the
spacing. The first run is also made with half the step and a hundredth of the accuracy, and its
first two precursors by full dynamics. Then a/b and D_c are varied: where are fronts slow?

Of each precursor the table has the mean slip speed v of its blocks, their tau/p before and after
it, the friction f* + (a - b) ln(v/V*) of steady slip at v, and the median speed of its front.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

import pyfric
from pyfric.figures import DataFigure

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

V, PUSHED = 0.4e-3, 0.92e-3
"""Speed of the driver (m/s), and how far it goes (m)."""
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "V = 0.4 mm/s": ({}, {}),
    "half the step, accuracy 1e-6": ({}, {"dt": 0.3e-6, "accuracy": 1e-6}),
    "V = 4 mm/s": ({"V": 10 * V}, {}),
    "V = 0.04 mm/s": ({"V": V / 10}, {}),
    "slip law": ({"evolution": "slip"}, {}),
    "l = 1.25 mm": ({"l": 1.25e-3}, {}),
    "full dynamics": ({}, {"fidelity": "dynamic", "accuracy": None, "energies": False}),
}
"""Name of a case -> changes of the preset, and options."""
SHORT = {"full dynamics": 0.48e-3}
"""Cases that end earlier: how far the driver goes, m."""
RATIOS, LENGTHS = (1 / 3, 1 / 2, 2 / 3, 4 / 5), (2e-7, 4e-7, 8e-7)
"""a/b, and D_c (m), of the runs that look for slow fronts; b is that of the preset."""
SHOWN = ("V = 0.4 mm/s", "V = 4 mm/s", "V = 0.04 mm/s", "slip law", "l = 1.25 mm")
COLUMNS = {"t_start": "t_s", "L_p_over_L": "L_p_over_L", "n_blocks": "n_blocks"}


def run(changes: Mapping[str, Any], options: Mapping[str, Any], pushed: float = PUSHED) -> Any:
    """Return the record of a case, up to `pushed` (m)."""
    scene = pyfric.preset("rate_and_state", dict(changes))
    how = {"fidelity": "hybrid", "geometry": "linear", "accuracy": 1e-4, "progress": False}
    t_end = pushed / scene.driver.V
    return pyfric.simulate(scene, t_end, **how | dict(options), stop_when="system_size")


def ruptures(record: Any) -> pd.DataFrame:
    """Return one row for each main event: slip speed, tau/p, steady friction, front speed."""
    scene, rows = record.scene, []
    law, l = scene.interface.law, scene.slider.l
    for event in record.events.index[record.events["is_main"]]:
        at, own = record.row(event), record.episodes["event"] == event
        parts = record.episodes[own].dropna(subset=["t_stop"])
        speed = float(parts["slip"].abs().sum() / (parts["t_stop"] - parts["t_start"]).sum())
        inside = record.region[at].astype(bool)
        before, after = (
            float(tau[at][inside].sum() / p[at][inside].sum())
            for tau, p in (
                (record.tau_before, record.p_before),
                (record.tau_after, record.p_after),
            )
        )
        front = pyfric.front_speed(record.rupture_times[at], l)
        front = np.abs(front[np.isfinite(front)])
        steady = law.f_star + (law.a - law.b) * np.log(speed / law.V_star)
        front_speed = float(np.median(front)) if len(front) else np.nan
        rows.append((speed, before, after, steady, front_speed))
    names = ["slip_speed_m_s", "tau_over_p_before", "tau_over_p_after", "steady", "front_m_s"]
    return pd.DataFrame(rows, columns=names, index=record.events.index[record.events["is_main"]])


def regimes(say: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """Return one row for each a/b and D_c: precursors at the trailing edge and their fronts."""
    rows = []
    for ratio in RATIOS:
        for D_c in LENGTHS:
            law = pyfric.preset("rate_and_state").interface.law
            record = run({"a": ratio * law.b, "D_c": D_c}, {})
            events = record.events[record.events["is_main"]]
            own = ruptures(record)[events["is_precursor"]]
            first = events["F_T_start"].iloc[0] / record.scene.F_N if len(events) else np.nan
            fronts = own["front_m_s"].dropna()
            scale = wave_speed(record.scene)
            middle, fastest = fronts.median() / scale, fronts.max() / scale
            rows.append((ratio, D_c / record.scene.driver.h, len(own), first, middle, fastest))
            say(f"a/b = {ratio:.2f}, D_c = {D_c * 1e6:g} um: {len(own)} precursors")
    names = ["a_over_b", "D_c_over_h", "precursors", "first_over_F_N"]
    return pd.DataFrame(rows, columns=[*names, "front_over_c_S", "fastest_over_c_S"])


def wave_speed(scene: Any) -> float:
    """Return the speed of long shear waves, in m/s."""
    return float(scene.slider.l * np.sqrt(scene.slider.k / (2 * scene.m)))


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
        part = part.join(ruptures(record))
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


def draw(frame: pd.DataFrame, found: pd.DataFrame | None = None) -> DataFigure:
    """Draw lengths over force, tau/p after ruptures, and front speeds over tau/p before them."""
    figure = DataFigure(figsize=(11, 4.0), layout="constrained")
    axes, arrests, fronts = figure.subplots(1, 3)
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
        arrests.plot(part["steady"], part["tau_over_p_after"], marker, ms=4)
        scale = wave_speed(pyfric.preset("rate_and_state"))
        fronts.semilogy(part["tau_over_p_before"], part["front_m_s"] / scale, marker, ms=4)
    ends = [frame["steady"].min(), frame["steady"].max()]
    arrests.plot(ends, ends, "k--")
    axes.set_xlabel(r"driver force at the start of the event $F_T/F_N$")
    axes.set_ylabel(r"length of the precursor $L_p/L$")
    arrests.set_xlabel("steady friction at the slip speed")
    arrests.set_ylabel(r"$\tau/p$ of its blocks after the precursor")
    fronts.set_xlabel(r"$\tau/p$ of its blocks before the precursor")
    fronts.set_ylabel("median front speed over that of shear waves")
    axes.legend(fontsize="small", frameon=False)
    figure.tables = {"precursors": frame} | ({} if found is None else {"regimes": found})
    figure.caption = (
        "Precursors of the preset rate_and_state (D_c = 0.2 um, l = 2.5 mm, V = 0.4 mm/s if not "
        "said), hybrid engine, linear geometry. Left: with the quasi-static sequence of the Fig. 1 "
        "scene. Middle: the line is equality."
    )
    return figure
