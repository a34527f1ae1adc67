"""Precursors with rate-and-state friction: slip speeds, stress after precursors, and slow fronts.

The runs are those of `rated` over three decades of the driver's speed and with the slip law, and
runs with other a/b, D_c and speeds. All runs end at the first event of the whole interface. For
each precursor the table has the mean slip speed v of its blocks, their tau/p before and after it,
the friction of steady slip f_d = f* + (a - b) ln(v/V*), and the median speed of its front. The
friction at v with the state theta before the precursor is f_s = f_d + b ln(v theta/D_c). The scaled
prestress is (tau/p - f_d)/(f_s - f_d).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import rated
from sizes import size

import pyfric
from pyfric.figures import DataFigure
from pyfric.record import SLOW, material_of

if TYPE_CHECKING:
    from collections.abc import Callable

CASES = size(("V = 0.4 mm/s", "V = 4 mm/s", "V = 0.04 mm/s", "slip law"), ("V = 4 mm/s",))
"""Names of the cases of `rated` whose precursors are measured."""
RATIOS, LENGTHS, FASTER = size(
    ((1 / 3, 1 / 2, 2 / 3, 4 / 5), (2e-7, 4e-7, 8e-7), (0.1, 1.0, 10.0)),
    ((1 / 2, 4 / 5), (8e-7, 16e-7), (20.0,)),
)
"""a/b, D_c (m), and V (in units of the preset's) of the other runs; b is that of the preset."""
PUSHED = size(0.7e-3, 0.2e-3)
"""Displacement of the driver in the other runs, m."""
CHECK = size({"half the step": {"dt": 0.3e-6}, "accuracy 1e-5": {"accuracy": 1e-5}}, {})
"""Options with which the first case is repeated."""
BEFORE = 2e-5
"""Time before an event at which the state of blocks is taken, s: a hundredth of a pause."""


def precursors(record: pyfric.Record) -> pd.Index:
    """Return the events at the trailing edge that the study measures."""
    events = record.events
    return events.index[events["is_precursor"] & events["is_main"] & events["finished"]]


def fronts(record: pyfric.Record, event: int) -> float:
    """Return the median front speed of an event in units of the shear-wave speed, or NaN."""
    speeds = pyfric.front_speed(record.rupture_times[record.row(event)], record.scene.slider.l)
    speeds = np.abs(speeds[np.isfinite(speeds)])
    return float(np.median(speeds)) / material_of(record.scene).c_S if len(speeds) else np.nan


def mean_ratio(record: pyfric.Record, event: int, when: str) -> float:
    """Return the mean tau/p of the blocks of an event, "before" or "after" it."""
    at = record.row(event)
    inside = record.region[at].astype(bool)
    tau, p = (record.arrays[f"{name}_{when}"][at][inside] for name in ("tau", "p"))
    return float(tau.sum() / p.sum())


def ruptures(record: pyfric.Record, options: dict[str, Any]) -> pd.DataFrame:
    """Return one row for each precursor at the trailing edge.

    The states before precursors are those of the same run, repeated with stops.
    """
    scene, events, rows, stopped = record.scene, record.events, [], None
    law = scene.interface.law
    for event in precursors(record):
        at, parts = record.row(event), record.episodes[record.episodes["event"] == event]
        speed = float(parts["slip"].abs().sum() / (parts["t_stop"] - parts["t_start"]).sum())
        before, after = (mean_ratio(record, event, when) for when in ("before", "after"))
        steady = law.f_star + (law.a - law.b) * np.log(speed / law.V_star)
        t = float(events.loc[event, "t_start"]) - BEFORE
        stopped = pyfric.simulate(scene, t, initial=stopped, **options)
        theta = stopped.final_state.memory["theta"][record.region[at].astype(bool)]
        excess = law.b * float(np.log(speed * theta / law.D_c).mean())
        row = events.loc[event, ["t_start", "F_T_start", "L_p_over_L"]].to_list()
        row += [speed, before, after, steady, steady + excess, (before - steady) / excess]
        rows.append((*row, fronts(record, event)))
    names = ["t_s", "F_T_N", "L_p_over_L", "slip_speed_m_s", "tau_over_p_before"]
    names += ["tau_over_p_after", "steady_friction", "friction_of_onset", "scaled_prestress"]
    return pd.DataFrame(rows, columns=[*names, "front_over_c_S"]).astype(float)


def study(
    names: tuple[str, ...] = (*CASES, *CHECK),
    pushed: float = rated.PUSHED,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Return one row for each precursor of each case."""
    parts = []
    for name in names:
        changes, options = rated.CASES.get(name, ({}, CHECK.get(name, {})))
        part = ruptures(rated.run(changes, options, pushed), rated.OPTIONS | options)
        part.insert(0, "case", name)
        parts.append(part)
        say(f"{name}: {len(part)} precursors")
    return pd.concat(parts, ignore_index=True)


def coulomb() -> pd.DataFrame:
    """Return scaled prestress and front speed of the precursors of the Fig. 1 scene."""
    scene = pyfric.preset("fig1", **size({}, {"l": 5e-3}))
    record = pyfric.simulate(scene, size(0.9, 0.4), **rated.OPTIONS | {"accuracy": None})
    mu_k, mu_s = record.scene.interface.mu_k, record.scene.interface.mu_s
    rows = [
        (event, (mean_ratio(record, event, "before") - mu_k) / (mu_s - mu_k), fronts(record, event))
        for event in precursors(record)
    ]
    return pd.DataFrame(rows, columns=["event", "scaled_prestress", "front_over_c_S"])


def count(record: pyfric.Record) -> int:
    """Return the number of precursors."""
    return len(precursors(record))


def middle(record: pyfric.Record) -> float:
    """Return the median front speed of precursors, in units of the shear-wave speed."""
    speeds = [fronts(record, event) for event in precursors(record)]
    return float(np.nanmedian(speeds)) if np.isfinite(speeds).any() else np.nan


def regime(record: pyfric.Record) -> str:
    """Return whether there are precursors, and whether their fronts are slow."""
    if not count(record):
        return "none"
    speed = middle(record)
    if np.isnan(speed):
        return "too short for a speed"
    return "slow fronts" if speed < SLOW else "fast fronts"


def first(record: pyfric.Record) -> float:
    """Return the force at the first event, in units of F_N."""
    return float(record.events["F_T_start"].min()) / record.scene.F_N


def blocks(record: pyfric.Record) -> float:
    """Return the number of blocks in L_b."""
    scene = record.scene
    return scene.law.blocks_in_L_b(scene.F_N / scene.N_x, scene.slider.k)


LABELS = {
    "regime": regime,
    "precursors": count,
    "front_over_c_S": middle,
    "first_event_over_F_N": first,
    "blocks_in_L_b": blocks,
}


def job(a_over_b: float, D_c: float, V: float) -> pyfric.Job:
    """Return the run at a point of the phase diagram."""
    b = pyfric.preset("rate_and_state").interface.law.b
    changes = size({}, {"l": 5e-3}) | {"a": a_over_b * b, "D_c": D_c, "V": V}
    scene = pyfric.preset("rate_and_state", changes)
    how = {name: value for name, value in rated.OPTIONS.items() if name != "progress"}
    return pyfric.Job(scene=scene, t_end=PUSHED / V, options=how | {"stop_when": "system_size"})


def regimes(
    faster: tuple[float, ...] = FASTER,
    ratios: tuple[float, ...] = RATIOS,
    lengths: tuple[float, ...] = LENGTHS,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Return one row for each V, a/b and D_c: precursors at the trailing edge and their fronts."""
    parts, h = [], pyfric.preset("rate_and_state").driver.h
    for factor in faster:
        V = factor * rated.V
        found = pyfric.phase_diagram(
            lambda a_over_b, D_c, V=V: job(a_over_b, D_c, V),
            x=("a_over_b", ratios),
            y=("D_c", lengths),
            label=LABELS,
            lines=False,
        )
        part = found.table[["a_over_b", "D_c", *LABELS]].assign(D_c_over_h=lambda t: t["D_c"] / h)
        part.insert(0, "V_m_s", V)
        parts.append(part)
        say(f"V = {V * 1e3:g} mm/s: {dict(part['regime'].value_counts())}")
    return pd.concat(parts, ignore_index=True)


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


def draw(frame: pd.DataFrame, found: pd.DataFrame, known: pd.DataFrame) -> DataFigure:
    """Draw tau/p after precursors, front speeds over tau/p and scaled prestress, and regimes.

    Args:
        frame, found, known: tables of `study`, `regimes` and `coulomb`.
    """
    figure = DataFigure(figsize=(8.4, 7.2), layout="constrained")
    (arrests, plain), (scaled, phases) = figure.subplots(2, 2)
    for name, marker in zip(CASES, "os^D", strict=False):
        part = frame[frame["case"] == name]
        arrests.plot(part["steady_friction"], part["tau_over_p_after"], marker, ms=4, label=name)
        plain.semilogy(part["tau_over_p_before"], part["front_over_c_S"], marker, ms=4)
        scaled.semilogy(part["scaled_prestress"], part["front_over_c_S"], marker, ms=4)
    ends = [frame["steady_friction"].min(), frame["steady_friction"].max()]
    arrests.plot(ends, ends, "k--", label="equal")
    arrests.locator_params("x", nbins=4)
    arrests.set_xlabel("steady friction at the slip speed $f_d$")
    arrests.set_ylabel(r"$\tau/p$ after the precursor")
    arrests.legend(fontsize="small", frameon=False)
    plain.set_xlabel(r"$\tau/p$ before the precursor")
    scaled.semilogy(known["scaled_prestress"], known["front_over_c_S"], "kx", ms=5)
    scaled.plot([], [], "kx", label="Amontons–Coulomb (Fig. 1 scene)")
    scaled.set_xlabel(r"scaled prestress $(\tau/p - f_d)/(f_s - f_d)$")
    scaled.legend(fontsize="small", frameon=False)
    for axes in (plain, scaled):
        axes.set_ylabel("front speed over that of shear waves")
    _draw_regimes(phases, found)
    figure.tables = {"ruptures": frame, "regimes": found, "coulomb": known}
    figure.caption = (
        "Precursors of the preset rate_and_state, hybrid engine, linear geometry: mean tau/p of "
        "their blocks after them over f_d = f* + (a - b) ln(v/V*) at their mean slip speed v; the "
        "median speed of their fronts over mean tau/p before them, and over the same scaled with "
        "f_d and f_s = f_d + b ln(v theta/D_c), theta being the state before them, beside those "
        "of the Fig. 1 scene with mu_k and mu_s; and what precursors there are over a/b and D_c, "
        f"for three speeds of the driver. Fronts below {SLOW:g} of the shear-wave speed are slow."
    )
    return figure


def _draw_regimes(axes: Any, found: pd.DataFrame) -> None:
    """Draw a symbol for each run; runs at other speeds of the driver stand beside each other."""
    looks = {
        "none": ("x", "0.6"),
        "too short for a speed": (".", "0.6"),
        "slow fronts": ("v", "C0"),
        "fast fronts": ("^", "C1"),
    }
    speeds = sorted(found["V_m_s"].unique())
    for name, (marker, colour) in looks.items():
        part = found[found["regime"] == name]
        beside = part["V_m_s"].map({V: 0.02 * (k - 1) for k, V in enumerate(speeds)})
        at = part["a_over_b"] + beside, part["D_c_over_h"]
        axes.semilogy(*at, marker, color=colour, ms=6, ls="none", label=name)
    axes.set_xlabel("$a/b$; from left to right V = 0.04, 0.4, 4 mm/s")
    axes.set_ylabel("$D_c/h$")
    axes.set_ylim(top=3 * found["D_c_over_h"].max())
    axes.legend(fontsize="small", frameon=False, ncols=2, loc="upper center")
