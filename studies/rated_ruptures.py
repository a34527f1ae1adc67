"""Precursors with rate-and-state friction: slip speeds, stress after them, and slow fronts.

The runs of `rated` over three decades of the driver's speed and with the slip law, and runs with
other a/b and D_c, up to the first event of the whole interface. Of each precursor the table has
the mean slip speed v of its blocks, their tau/p before and after it, the friction
f* + (a - b) ln(v/V*) of steady slip at v, and the median speed of its front.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import rated

import pyfric
from pyfric.figures import DataFigure
from pyfric.record import material_of

if TYPE_CHECKING:
    from collections.abc import Callable

CASES = ("V = 0.4 mm/s", "V = 4 mm/s", "V = 0.04 mm/s", "slip law")
"""Those of `rated`."""
RATIOS, LENGTHS = (1 / 3, 1 / 2, 2 / 3, 4 / 5), (2e-7, 4e-7, 8e-7)
"""a/b, and D_c (m), of the other runs; b is that of the preset."""
PUSHED = 0.7e-3
"""How far the driver goes in the other runs, m."""
CHECK = {"half the step": {"dt": 0.3e-6}, "accuracy 1e-5": {"accuracy": 1e-5}}
"""Options with which the first case is made again."""


def ruptures(record: Any) -> pd.DataFrame:
    """Return one row for each precursor at the trailing edge."""
    scene, events, rows = record.scene, record.events, []
    law = scene.interface.law
    for event in events.index[events["is_precursor"] & events["is_main"] & events["finished"]]:
        at, parts = record.row(event), record.episodes[record.episodes["event"] == event]
        speed = float(parts["slip"].abs().sum() / (parts["t_stop"] - parts["t_start"]).sum())
        inside = record.region[at].astype(bool)
        stresses = (record.tau_before, record.p_before), (record.tau_after, record.p_after)
        before, after = (float(tau[at][inside].sum() / p[at][inside].sum()) for tau, p in stresses)
        front = pyfric.front_speed(record.rupture_times[at], scene.slider.l)
        front = np.abs(front[np.isfinite(front)]) / material_of(scene).c_S
        steady = law.f_star + (law.a - law.b) * np.log(speed / law.V_star)
        row = events.loc[event, ["t_start", "F_T_start", "L_p_over_L"]].to_list()
        rows.append((*row, speed, before, after, steady, np.median(front) if len(front) else None))
    names = ["t_s", "F_T_N", "L_p_over_L", "slip_speed_m_s", "tau_over_p_before"]
    names += ["tau_over_p_after", "steady_friction", "front_over_c_S"]
    return pd.DataFrame(rows, columns=names).astype(float)


def study(
    names: tuple[str, ...] = (*CASES, *CHECK),
    pushed: float = rated.PUSHED,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Return one row for each precursor of each case."""
    parts = []
    for name in names:
        changes, options = rated.CASES.get(name, ({}, CHECK.get(name, {})))
        part = ruptures(rated.run(changes, options, pushed))
        part.insert(0, "case", name)
        parts.append(part)
        say(f"{name}: {len(part)} precursors")
    return pd.concat(parts, ignore_index=True)


def regimes(say: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """Return one row for each a/b and D_c: precursors at the trailing edge and their fronts."""
    rows, b = [], pyfric.preset("rate_and_state").interface.law.b
    for ratio in RATIOS:
        for D_c in LENGTHS:
            record = rated.run({"a": ratio * b, "D_c": D_c}, {}, PUSHED)
            own, scene = ruptures(record), record.scene
            fronts = own["front_over_c_S"]
            blocks = scene.law.blocks_in_L_b(scene.F_N / scene.N_x, scene.slider.k)
            first = record.events["F_T_start"].min() / scene.F_N
            middle, fastest = fronts.median(), fronts.max()
            rows.append((ratio, D_c / scene.driver.h, blocks, len(own), first, middle, fastest))
            say(f"a/b = {ratio:.2f}, D_c = {D_c * 1e6:g} um: {len(own)} precursors")
    names = ["a_over_b", "D_c_over_h", "blocks_in_L_b", "precursors", "first_event_over_F_N"]
    return pd.DataFrame(rows, columns=[*names, "front_over_c_S", "fastest_over_c_S"])


def report(frame: pd.DataFrame) -> str:
    """Return a line for each case."""
    lines = ["case, precursors, tau/p after them beyond steady friction, front over c_S"]
    for name, part in frame.groupby("case", sort=False):
        off, front = part["tau_over_p_after"] - part["steady_friction"], part["front_over_c_S"]
        lines.append(
            f"{name}: {len(part)}, {off.min():+.4f} to {off.max():+.4f}, "
            f"{front.min():.3f} to {front.max():.3f}"
        )
    return "\n".join(lines)


def draw(frame: pd.DataFrame, found: pd.DataFrame) -> DataFigure:
    """Draw tau/p after precursors over friction at their speed, and fronts over tau/p before."""
    figure = DataFigure(figsize=(8.4, 3.8), layout="constrained")
    arrests, fronts = figure.subplots(1, 2)
    for name, marker in zip(CASES, "os^D", strict=True):
        part = frame[frame["case"] == name]
        arrests.plot(part["steady_friction"], part["tau_over_p_after"], marker, ms=4, label=name)
        fronts.semilogy(part["tau_over_p_before"], part["front_over_c_S"], marker, ms=4)
    ends = [frame["steady_friction"].min(), frame["steady_friction"].max()]
    arrests.plot(ends, ends, "k--", label="equal")
    arrests.locator_params("x", nbins=4)
    arrests.set_xlabel("steady friction at the slip speed")
    arrests.set_ylabel(r"$\tau/p$ after the precursor")
    fronts.set_xlabel(r"$\tau/p$ before the precursor")
    fronts.set_ylabel("front speed over that of shear waves")
    arrests.legend(fontsize="small", frameon=False)
    figure.tables = {"ruptures": frame, "regimes": found}
    figure.caption = (
        "Precursors of the preset rate_and_state, hybrid engine, linear geometry: mean tau/p of "
        "their blocks after them over f* + (a - b) ln(v/V*) at their mean slip speed v, and the "
        "median speed of their fronts over mean tau/p before them."
    )
    return figure
