"""Fronts study: when is a front speed of this model physical?

Three questions, each answered by runs and theory:

crack      A two-sided crack under a uniform stress drop at S = 3, where a continuum allows no
           supershear. Its speed is compared with fracture mechanics, for few and many blocks in the
           cohesive zone X_c0. One half is run, mirrored in the middle; the other side and the top
           absorb. A crack just longer than the critical length is released at once.
length     Precursors of the Fig. 1 scene with d_c = 1 um. Their lengths are compared with the
           length at which the energy release of static states falls to the fracture energy, and
           with the quasi-static sequence without weakening.
Fig. 4     Front speeds of these precursors, and their collapse over runs 1 to 4: which results are
           the same on finer and finer lattices? A fine lattice may start from a state of a lattice
           twice as coarse just before an event (`finer`). If the fine lattice also has a whole run,
           the study gives the difference of the two.

Runs are kept in a folder; stopped runs of the Fig. 1 scene continue from there.

Source: PRL 107, 074301 (2011), Fig. 4; L. B. Freund, Dynamic Fracture Mechanics (1990);
D. J. Andrews, J. Geophys. Res. 81, 5679 (1976).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from cracks import Crack, kept_crack, viscous
from finer import refined
from sizes import size

from pyfric.core import STEPPERS
from pyfric.engines import step_size
from pyfric.planning import simulate
from pyfric.record import Record, analysis
from pyfric.scene import preset
from pyfric.signals import at_once
from pyfric.values import write

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pyfric.scene import Scene

__all__ = ["BLOCKS", "SPACINGS", "begun", "kept", "main_events", "planned", "study"]

BLOCKS = size((2.0, 4.0, 6.0, 8.0), (2.0, 2.0, 2.0))
"""Numbers of blocks in X_c0 of the cracks."""
SPACINGS = size((2.5e-3, 1.25e-3, 0.625e-3), (5e-3,))
"""Lattice constants of the Fig. 1 scene, m."""
T_END = size(0.745, 0.4)
"""End of runs of the Fig. 1 scene, s, after the precursor of half the slider's length."""
COLLAPSE = size({"run1": 0.56, "run2": 0.63, "run3": 0.7, "run4": 0.77}, {"run1": 0.56})
"""Runs of Fig. 4(b) and their ends, s: 0.7 of the time to the first event over all blocks."""
D_C = 1e-6
"""Slip of weakening in the Fig. 1 scene, m."""
COARSE = 1.2e-3
"""Least lattice constant of runs without weakening, m; no lattice resolves their zone."""
PACE = 5e-9
"""Processor time of runs of the Fig. 1 scene per block and force evaluation, s."""
LAST = 2
"""Number of precursors, the last of each of runs 1 to 4, that start from a coarser lattice."""
AFTER = 3e-3
"""Time by which a fine run exceeds the end of the event on the coarse lattice, s."""
TRIES = 8
"""Largest number of runs, each longer by `AFTER`."""
MIDDLE = 0.06, 0.4
"""Range of x/L inside a front of half the slider's length, away from its start and end."""
LATE = 0.5
"""L_p/L of the precursor whose speeds are shown."""


# --- the Fig. 1 scene ----------------------------------------------------------------------------


def planned(scene: Scene, t_end: float, coarser: Record | None) -> tuple[float, float]:
    """Return the block evaluations and the seconds that a run is expected to take.

    A run at half the lattice constant takes 8 times the evaluations of the coarser run. The first
    run takes the evaluations of full dynamics without located transitions. Each evaluation takes
    `PACE`.
    """
    if coarser is None:
        evaluations = STEPPERS["rk4"].evaluations * t_end / step_size(scene)
        return (all_ := evaluations * scene.N_x * scene.N_z), all_ * PACE
    times = (coarser.scene.slider.l / scene.slider.l) ** 3
    made = coarser.counts["block_evaluations"]
    return times * made, times * _seconds(coarser)


def _seconds(record: Record) -> float:
    return PACE * record.counts["block_evaluations"]


def kept(path: Path, scene: Scene, t_end: float) -> Record:
    """Return the run in a file, or make it; a stopped run is continued."""
    part = path.with_name(path.name + ".part")
    if path.is_file():
        record = Record.load(path)
        if record.scene == scene and record.curve["t"].iloc[-1] >= t_end * (1 - 1e-9):
            return record
    how: dict[str, Any] = {"fidelity": "hybrid", "geometry": "linear", "switching": "located"}
    if part.is_file() and (before := Record.load(part)).scene == scene:
        how["initial"] = before
    record = simulate(scene, t_end, checkpoint=part, progress=False, **how)
    if record.done:
        record.save(path, overwrite=True)
        part.unlink(missing_ok=True)
    return record


def _runs_of(
    name: str, runs: Path, spacings: Sequence[float], t_end: float, say: Callable[[str], None]
) -> dict[tuple[float, float], Record]:
    """Return the runs of a preset by l and d_c."""
    records = {}
    for d_c in (D_C, 0.0):
        coarser = None
        for l in sorted(spacings, reverse=True):
            if not d_c and l < COARSE:
                continue
            scene = preset(name, l=l, d_c=d_c)
            evaluations, seconds = planned(scene, t_end, coarser)
            say(
                f"{name}, l = {l * 1e3:g} mm, d_c = {d_c * 1e6:g} um: planned {evaluations:.2g} "
                f"block evaluations, {seconds / 60:.2g} min of one core; if nothing rests "
                f"{planned(scene, t_end, None)[1] / 60:.2g} min"
            )
            file = f"{name}_{l * 1e3:g}_{d_c * 1e6:g}.nc"
            records[l, d_c] = coarser = kept(runs / file, scene, t_end)
    return records


def begun(path: Path, coarse: Record, event: int, scene: Scene) -> Record:
    """Return an event on another lattice, run from the state before it, or read from its file.

    Args:
        path: the file of the run.
        coarse: the run on a coarser lattice, or on the same lattice.
        event: number of the event in this run.
        scene: the scene on the other lattice.
    """
    if path.is_file() and (record := Record.load(path)).scene == scene:
        return record
    before: Any = refined(coarse, event, scene)
    t_end, dt = float(coarse.events["t_stop"].loc[event]), before.dt
    how: dict[str, Any] = {"fidelity": "hybrid", "geometry": "linear", "switching": "located"}
    for _ in range(TRIES):
        t_end += AFTER
        before = simulate(scene, t_end, initial=before, dt=dt, progress=False, **how)
        if len(main_events(before)):
            break
    before.save(path, overwrite=True)
    return before


def _begun_runs(
    name: str,
    runs: Path,
    records: dict[tuple[float, float], Record],
    finer: Sequence[float],
    count: int,
    say: Callable[[str], None],
) -> tuple[dict[tuple[float, int], Record], dict[tuple[float, int], tuple[float, float]]]:
    """Return events of a preset that began from a coarser lattice, by l and event there, and plans.

    Each lattice starts from the lattice twice as coarse: at its late precursor, or at its last
    `count` precursors. Where no whole run exists, the late precursor may start from an event that
    itself started from a coarser lattice.
    """
    found: dict[tuple[float, int], Record] = {}
    plans: dict[tuple[float, int], tuple[float, float]] = {}
    for l in sorted(finer, reverse=True):
        scene, whole = preset(name, l=l, d_c=D_C), records.get((2 * l, D_C))
        chain = {event: one for (at, event), one in found.items() if at == 2 * l}
        if count == 1 and chain and (l, D_C) not in records:
            sources = {event: (one, _widest(one)) for event, one in chain.items()}
        elif whole is not None:
            events = [_late(whole)] if count == 1 else main_events(whole)[-count:].tolist()
            sources = {event: (whole, event) for event in events}
        else:
            continue
        for event, (coarse, own) in sources.items():
            about = coarse.events.loc[own]
            plan = planned(scene, about["t_stop"] - about["t_start"] + AFTER, None)
            say(
                f"{name}, l = {l * 1e3:g} mm, from event {event} at {2e3 * l:g} mm: planned "
                f"{plan[0]:.2g} block evaluations, {plan[1] / 60:.2g} min of one core"
            )
            path = runs / f"{name}_{l * 1e3:g}_{D_C * 1e6:g}_from_{event}.nc"
            found[l, event], plans[l, event] = begun(path, coarse, own, scene), plan
    return found, plans


def _widest(record: Record) -> int:
    """Return the event with the longest front."""
    return int(record.events["n_front"].idxmax())


def _lengths(records: dict[tuple[float, float], Record], runs: Path) -> pd.DataFrame:
    """Return lengths of precursors with weakening, from files if these exist."""
    tables = []
    for (l, d_c), record in records.items():
        if not d_c:
            continue
        name = f"{l * 1e3:g}_{d_c * 1e6:g}"
        path, run = runs / f"lengths_{name}.csv", runs / f"fig1_{name}.nc"
        if not path.is_file() or path.stat().st_mtime < run.stat().st_mtime:
            write(path, _lengths_of(record).to_csv(index=False).encode())
        tables.append(pd.read_csv(path))
    return pd.concat(tables, ignore_index=True)


def _lengths_of(record: Record) -> pd.DataFrame:
    """Return lengths of precursors: dynamics, Griffith, and quasi-static without weakening."""
    l, rows = record.scene.slider.l, []
    ladder = simulate(preset("fig1", l=l), 1.2, fidelity="quasistatic", progress=False)
    steps = analysis.precursor_lengths(ladder)
    longest = np.maximum.accumulate(steps["L_p_over_L"].to_numpy())
    for _, row in analysis.precursors(record).iterrows():
        found = analysis.energy_release(record, int(row["event"]))
        rows.append(
            {
                "l": l,
                "event": int(row["event"]),
                "force_arrest": row["force_arrest"],
                "dynamics": row["L_p_over_L"],
                "griffith": analysis.griffith_length(found),
                "ladder": float(np.interp(row["force_arrest"], steps["force"], longest)),
            }
        )
    return pd.DataFrame(rows)


@at_once()
def study(
    runs: str | Path,
    blocks: Sequence[float] = BLOCKS,
    spacings: Sequence[float] = SPACINGS,
    t_end: float = T_END,
    collapse: Sequence[float] = (),
    finer: Sequence[float] = (),
    say: Callable[[str], None] = lambda _: None,
) -> dict[str, pd.DataFrame]:
    """Run the study.

    Args:
        runs: folder in which runs are kept; it is made if missing.
        blocks: blocks in X_c0 of the cracks, with eta^2 = 0.001 k m along the bonds; the third
            crack also with dashpots that resist rotation, and with the paper's viscosity.
        spacings: lattice constants of the Fig. 1 scene, m.
        t_end: end of the runs of the Fig. 1 scene, s.
        collapse: lattice constants of runs 1 to 4, m.
        finer: lattice constants on which precursors start from the run with twice the constant, m:
            the late precursor of the Fig. 1 scene, and the last `LAST` of runs 1 to 4.
        say: called with the name and the expected time of each run before it starts.

    Returns:
        Tables. "crack": blocks, eta2, dashpots, a, v, v_theory. "cost": run, expected and true
        evaluations and seconds, and seconds of full dynamics. "lengths": l, event, force_arrest,
        dynamics, griffith, ladder (L_p/L, the last from the quasi-static sequence).
        "fronts": scene, l, d_c, begun (0, or the l of the run from which the state came), event,
        n, x_over_L, v_c, scaled, X_c0_over_l, and others of `pyfric.analysis.fronts`; late, whether
        it is the precursor of half the length.
    """
    Path(runs).mkdir(parents=True, exist_ok=True)
    cracks, fronts, cost = [], [], []
    others: list[tuple[float, Literal["along", "full"]]] = [(1e-3, "full"), (0.1, "full")]
    which = [Crack(blocks=n) for n in blocks]
    which += [Crack(blocks=n, eta2=e, dashpots=d) for n in blocks[2:3] for e, d in others]
    for one in which:
        case = f"{one.blocks:g}_{one.eta2:g}_{one.dashpots}"
        say(f"crack with {viscous(one.blocks, one.eta2, one.dashpots)}")
        table = kept_crack(Path(runs) / f"crack_{case}.csv", one)
        about = table[["evaluations", "seconds"]].iloc[0].to_dict()
        cost.append({"run": f"crack {case.replace('_', ', ')}"} | about)
        said = {"blocks": one.blocks, "eta2": one.eta2, "dashpots": one.dashpots}
        cracks.append(table.drop(columns=list(about)).assign(**said))
    records = {"fig1": _runs_of("fig1", Path(runs), spacings, t_end, say)}
    for name, end in COLLAPSE.items() if collapse else ():
        records[name] = _runs_of(name, Path(runs), collapse, end, say)
    for name, found in records.items():
        count = LAST if name in COLLAPSE else 1
        only = [l for l in finer if name == "fig1" or (l, D_C) not in found]
        begun, plans = _begun_runs(name, Path(runs), found, only, count, say)
        tables, rows = _shown(name, found, begun, plans, COLLAPSE.get(name, t_end))
        fronts += tables
        cost += rows
    return {
        "crack": pd.concat(cracks, ignore_index=True),
        "lengths": _lengths(records["fig1"], Path(runs)),
        "fronts": pd.concat(fronts, ignore_index=True),
        "cost": pd.DataFrame(cost),
    }


def _shown(
    name: str,
    found: dict[tuple[float, float], Record],
    begun: dict[tuple[float, int], Record],
    plans: dict[tuple[float, int], tuple[float, float]],
    t_end: float,
) -> tuple[list[pd.DataFrame], list[dict[str, Any]]]:
    """Return the fronts and the cost of the runs of a preset."""
    fronts, cost = [], []
    for (l, d_c), record in found.items():
        about = {"scene": name, "l": l, "d_c": d_c, "begun": 0.0}
        fronts.append(_speeds_of(record).assign(**about))
        expected = planned(record.scene, t_end, found.get((2 * l, d_c)))
        cost.append(_cost(f"{name} {l * 1e3:g} mm, {d_c * 1e6:g} um", expected, record))
    for (l, event), record in begun.items():
        about = {"scene": name, "l": l, "d_c": D_C, "begun": 2 * l}
        fronts.append(_speeds_of(record).assign(**about))
        what = f"{name} {l * 1e3:g} mm, {D_C * 1e6:g} um, event {event} of {2e3 * l:g} mm"
        cost.append(_cost(what, plans[l, event], record))
    return fronts, cost


def _cost(run: str, expected: tuple[float, float], record: Record) -> dict[str, Any]:
    """Return the expected and the true cost of a run."""
    plan = dict(zip(("planned_evaluations", "planned_seconds"), expected, strict=True))
    span = float(record.curve["t"].iloc[-1] - record.curve["t"].iloc[0])
    plan["most_seconds"] = planned(record.scene, span, None)[1]
    made = {"evaluations": record.counts["block_evaluations"], "seconds": _seconds(record)}
    return {"run": run} | plan | made


def main_events(record: Record) -> np.ndarray:
    """Return the numbers of the finished precursors and larger events, shape (n,)."""
    events = record.events
    return events.index[events["is_main"] & events["finished"]].to_numpy()


def _late(record: Record) -> int:
    """Return the main event whose length is nearest to half of the slider's."""
    return int((record.events["L_p_over_L"].loc[main_events(record)] - LATE).abs().idxmin())


def _speeds_of(record: Record) -> pd.DataFrame:
    """Return the speeds of all fronts, and which front is the precursor of half the length."""
    table = analysis.fronts(record)
    return table.assign(late=table["event"] == _late(record))
