"""Runs compared with stored full dynamics, event by event.

A stored reference (`reference_data/make.py`) holds a scene of the paper, solved with full dynamics
and located switching up to its first event over the whole interface. Three comparisons give
`Check`s:

    loading_curve   when events start and stop, at which static forces, and which blocks slip
    stresses        tau and p at first slip and last stick of the main events, tau/p behind the tip
    crack_speeds    rupture times, v_c, and the collapse of v_c on the scaled prestress

The quasi-static sequence is compared by the lengths and forces of its precursors (`ladder`).

Events are compared by forces over F_N, stresses over F_N/N_x, and lengths in blocks. `HYBRID`,
`DYNAMIC` and `STEP_END` are the tolerances, with their reasons.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections import namedtuple
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from pyfric.core import Switching
from pyfric.planning import simulate
from pyfric.record import Record, collapse_spread, fronts, paired
from pyfric.scene import Scene

INSTALLED = Path(__file__).parent / "reference"
"""Folder of the stored references of the package."""
COMPARED = ("F_T_start", "F_T_arrest", "t_start", "first_block", "last_block")
STATES = ("tau_before", "p_before", "tau_after", "p_after")
TABLES = ("events", "curve", "stresses", "fronts")
BINS = 10
"""Number of bins of the scaled prestress. Run 1, with 6 main events, has at least 5 points in
each."""
MANY = 100
"""Fewest blocks in fronts for which the collapse of v_c is compared."""
LEAST = 0.02
"""Smallest p, over F_N/N_x, of blocks whose tau/p is compared."""
BEFORE, AFTER = 2e-4, 5e-3
"""Times in s: a run of one event begins `BEFORE` its first slip and ends `AFTER` its last stick."""

LADDER = 0.03
"""Tolerance of forces of the quasi-static sequence, over F_N. The sequence lacks inertia, which
makes slip overshoot."""
NO_INERTIA = "no inertia: nothing overshoots, and steps are a little shorter"


# --- checks and tolerances ------------------------------------------------------------------------


@dataclass(frozen=True)
class Check:
    """A value with its tolerance.

    Attributes:
        name: name of the measured value.
        value: the value, >= 0; NaN if there was nothing to measure.
        tolerance: largest value with which the check holds.
        unit: unit of value and tolerance; "" for pure numbers.
        why: reason for the tolerance.
    """

    name: str
    value: float
    tolerance: float
    unit: str = ""
    why: str = ""

    @property
    def holds(self) -> bool:
        """Whether the value is within the tolerance; NaN never is."""
        return bool(self.value <= self.tolerance)


def largest(error: np.ndarray | list[float]) -> float:
    """Return the largest magnitude; NaN if a value is missing or no value is given."""
    return float(np.max(np.abs(error))) if len(error) else math.nan


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(error)))) if len(error) else math.nan


# fmt: off
_TABLE = {
    # hybrid engine, linear and finite geometry; hybrid engine with switching at step ends
    "start": (5e-6, 3e-5, 2.5e-3),  # static force of main events at first slip, over F_N
    "arrest": (5e-6, 3e-5, 0.01),   # static force of main events at last stick
    "time": (1e-5, 5e-5, 4e-3),     # start of main events, s
    "small": (5e-6, 1e-3, None),    # static forces of the other events, over F_N
    "blocks": (0, 0, 2),            # first and last block of events; blocks in one of two fronts
    "stress": (1e-4, 2e-4, 0.1),    # tau and p, RMS over the interface, over F_N/N_x
    "behind": (5e-5, 3e-4, 0.2),    # RMS of the scaled tau/p behind the tip after an event
    "rupture": (5e-7, 2e-6, None),  # rupture times after the start of the event, s
    "speed": (3e-4, 1e-3, 0.25),    # RMS of the ln of the ratio of v_c, over all blocks
    "spread": (3e-4, 5e-3, 0.1),    # RMS of ln v_c about the stored binned median
    "curve": (5e-6, 2e-4, None),    # F_T(t) where nothing slips, over F_N
    "why": (
        "same steps and switches; the truncated part of jumps, and amplified rounding",
        "as in linear geometry; in addition, jumps use the modes of the loaded state",
        "switches wait for step ends: a first-order error, which is largest for rupture times one "
        "or two steps apart",
    ),
}
# fmt: on
Tolerances = namedtuple("Tolerances", _TABLE)
"""Tolerances against full dynamics with located switching, and their reason; None means no
limit."""
_LINEAR, _FINITE, STEP_END = map(Tolerances, *_TABLE.values())
"""Hybrid with switching at step ends. Measured: start 1.2e-3, arrest 5.1e-3, 1.9 ms, 2 blocks,
stresses 0.06, behind the tip 0.12 (run 3), v_c 0.13, spread 0.07. Slow nucleation takes up to 0.8
ms longer or shorter. Rupture times are therefore not compared."""
HYBRID = {"linear": _LINEAR, "finite": _FINITE}
"""Hybrid with located switching, geometry -> tolerances. Measured in seven scenes: in linear
geometry forces 3.5e-7, stresses 2e-6, rupture times 2e-8 s, v_c 5e-5; in finite geometry forces
3e-6 (2.3e-4 for a single-block event of run 3), stresses 1.2e-5, rupture times 2.3e-7 s, v_c 6e-5.
Both runs have the same slipping blocks."""
DYNAMIC = {geometry: within._replace(curve=None) for geometry, within in HYBRID.items()}
"""Tolerances of full dynamics of one event, from a hybrid state."""


# --- stored references ---------------------------------------------------------------------------


class Reference(NamedTuple):
    """One stored reference. Events are counted from 1; `whole` is the first system-size event."""

    name: str
    scene: Scene
    about: dict
    events: pd.DataFrame
    curve: pd.DataFrame
    stresses: pd.DataFrame
    fronts: pd.DataFrame
    whole: pd.Series


def load(name: str, folder: str | os.PathLike[str] = INSTALLED) -> Reference:
    """Return a stored reference, such as "fig1_linear".

    Raises:
        FileNotFoundError: the reference is not in the folder.
        SceneError: its scene is refused.
    """
    source = Path(folder) / name
    about = tomllib.loads((source / "provenance.toml").read_text(encoding="utf-8"))
    tables = {table: pd.read_csv(source / f"{table}.csv") for table in TABLES}
    events = tables["events"] = tables["events"].set_index("event")
    whole = events[events["is_main"] & (events["L_p_over_L"] == 1)].iloc[0]
    return Reference(name, Scene.from_toml(about["scene"]), about, **tables, whole=whole)


# --- runs ----------------------------------------------------------------------------------------


def _run(known: Reference, t_end: float, **how: Any) -> Record:
    """Return a run of a stored scene, with the stored geometry, stepper, steps and pauses."""
    about = known.about
    how = {name: about[name] for name in ("stepper", "dt", "t_gap", "geometry")} | how
    sample = about["sample"] * about["dt"]
    return simulate(known.scene, t_end, sample=sample, progress=False, **how)


def hybrid(
    known: Reference, t_end: float | None = None, switching: Switching = "located"
) -> Record:
    """Return a hybrid run of a stored scene, up to its first system-size event or t_end (s)."""
    t_end = known.whole["t_stop"] + AFTER if t_end is None else t_end
    return _run(known, t_end, fidelity="hybrid", switching=switching)


def dynamic(known: Reference, event: int) -> Record:
    """Return full dynamics of one stored event, from a hybrid state shortly before it."""
    about = known.events.loc[event]
    before = hybrid(known, about["t_start"] - BEFORE).final_state
    how = {"fidelity": "dynamic", "switching": "located", "energies": False, "threads": 1}
    return _run(known, about["t_stop"] + AFTER, initial=before, **how)


def quasistatic(known: Reference) -> Record:
    """Return a quasi-static run of a stored scene, longer than the stored run."""
    how = {"fidelity": "quasistatic", "t_gap": known.about["t_gap"], "progress": False}
    return simulate(known.scene, 1.2 * known.about["t_end"], **how)


# --- the three comparisons -----------------------------------------------------------------------


def compare(known: Reference, made: Record, within: Tolerances) -> list[Check]:
    """Return all checks of a run of a stored scene, or of a part of such a run."""
    each = (loading_curve, stresses, crack_speeds)
    return [check for comparison in each for check in comparison(known, made, within)]


def loading_curve(known: Reference, made: Record, within: Tolerances) -> list[Check]:
    """Compare the events of a run, and F_T(t) between events, with the reference."""
    a, b = _events(known, made, within)
    n, F_N = min(len(a), len(b)), known.scene.F_N
    missing = abs(len(a) - len(b))
    a, b = a.iloc[:n], b.iloc[:n]
    error = pd.DataFrame({name: b[name].to_numpy() - a[name].to_numpy() for name in COMPARED})
    forces, blocks = error[["F_T_start", "F_T_arrest"]] / F_N, error[["first_block", "last_block"]]
    main = a["is_main"].to_numpy(dtype=bool)
    small, first, last = (
        largest(group.to_numpy().ravel())
        for group in (forces[~main], forces["F_T_start"][main], forces["F_T_arrest"][main])
    )
    _, i, j = np.intersect1d(known.curve["t"], made.curve["t"], return_indices=True)
    still = _still(known, known.curve["t"].to_numpy()[i])
    curve = (made.curve["F_T"].to_numpy()[j] - known.curve["F_T"].to_numpy()[i])[still] / F_N
    which = "main events" if within.small is None else "events"
    return _checks(
        within,
        (f"{which} that are missing or new", missing, 0),
        ("main events: static force at first slip, over F_N", first, within.start),
        ("main events: static force at last stick, over F_N", last, within.arrest),
        ("main events: start", largest(error["t_start"][main]), within.time, "s"),
        ("small events: static forces, over F_N", small, None if main.all() else within.small),
        (f"{which}: first and last block", largest(blocks.to_numpy().ravel()), within.blocks),
        ("F_T(t) where nothing slips, over F_N", largest(curve), within.curve),
    )


def stresses(known: Reference, made: Record, within: Tolerances) -> list[Check]:
    """Compare tau and p of the main events of a run with the reference."""
    unit, order = known.scene.F_N / known.scene.N_x, np.argsort(known.scene.n_of_i)
    law = known.scene.law.static.mean
    errors: dict[str, list[float]] = {"before": [], "after": []}
    behind = []
    for event, other in _main(known, made, within):
        table = known.stresses[known.stresses["event"] == event].sort_values("n")
        row, about = made.row(other), known.events.loc[event]
        ours = {name: made.arrays[name][row][order] for name in STATES}
        for name in STATES:
            error = ours[name] - table[name].to_numpy()
            errors[name.partition("_")[2]].append(rms(error) / unit)
        n, p = table["n"].to_numpy(), table["p_after"].to_numpy()
        slid = (n >= about["first_block"]) & (n < about["last_block"]) & (p > LEAST * unit)
        stored, own = (
            rms(law.scaled(np.asarray(now["tau_after"])[slid] / np.asarray(now["p_after"])[slid]))
            for now in (table, ours)
        )
        behind.append(own - stored)
    about = "main events, RMS, over F_N/N_x"
    return _checks(
        within,
        (f"tau and p before {about}", largest(errors["before"]), within.stress),
        (f"tau and p after {about}", largest(errors["after"]), within.stress),
        ("scaled tau/p behind the tip, RMS", largest(behind), within.behind),
    )


def crack_speeds(known: Reference, made: Record, within: Tolerances) -> list[Check]:
    """Compare the fronts of the main events of a run with the reference.

    The stored points have a binned median over the scaled prestress. The spreads of the run's and
    of the stored points about this median are compared, if each bin has at least 5 points.
    """
    table, ours, theirs = fronts(made), [], []
    times, alone, ratios = [], [], []
    for event, other in _main(known, made, within):
        a = known.fronts[known.fronts["event"] == event].set_index("n")
        b = table[table["event"] == other].set_index("n")
        both = a.add_suffix("_a").join(b.add_suffix("_b"), how="inner")
        since = known.events.loc[event, "t_start"], made.events.loc[other, "t_start"]
        times.append((both["t_b"] - since[1]) - (both["t_a"] - since[0]))
        alone.append(len(a) + len(b) - 2 * len(both))
        ratios.append(np.log(both["v_c_b"] / both["v_c_a"]).dropna())
        theirs.append(a)
        ours.append(b)
    checks = _checks(
        within,
        ("blocks in only one of two fronts", largest(alone), within.blocks),
        ("v_c of blocks, RMS of its ln", rms(np.concatenate([*ratios, []])), within.speed),
        ("rupture times in events", largest(np.concatenate([*times, []])), within.rupture, "s"),
    )
    if sum(map(len, theirs)) >= MANY:
        law = known.scene.law.static.mean
        stored = pd.concat(theirs)
        scaled = law.scaled(stored["tau_over_p"])
        curve = collapse_spread(scaled, stored["v_c"], bins=BINS)
        points = pd.concat(ours)[["scaled", "v_c"]]
        points = points[np.isfinite(points).all(axis=1)]
        in_bin = np.searchsorted(curve.edges, points["scaled"].to_numpy(), side="right") - 1
        median = curve.median[np.clip(in_bin, 0, len(curve.median) - 1)]
        difference = abs(rms(np.log(points["v_c"].to_numpy() / median)) - curve.rms)
        name = f"collapse of v_c: spread less the stored {curve.rms:.3f}"
        checks += _checks(within, (name, difference, within.spread))
    return checks


# --- the quasi-static sequence: precursors by length and force -----------------------------------


def precursors(events: pd.DataFrame, scene: Scene) -> pd.DataFrame:
    """Return the main precursors from the trailing edge before the first system-size event.

    Lengths are compared by the farthest block, because L_p is 0 if a corner block with little load
    did not move.
    """
    main = events[events["is_main"] & events["at_trailing_edge"]]
    return main[(main["last_block"] == scene.N_x).cumsum() == 0]


def ladder(known: Reference, made: Record, blocks: int, last: int | None = None) -> list[Check]:
    """Compare stored precursors with precursors of a quasi-static run, which may have one more.

    Args:
        known: the stored reference, which has the geometry of the run.
        made: the run.
        blocks: tolerance of lengths.
        last: tolerance of the last, longest precursor; None means `blocks`.
    """
    a, b = (precursors(run.events, known.scene) for run in (known, made))
    more = len(b) - len(a)
    if more < 0:
        return [Check("quasi-static: missing precursors", math.nan, 0, why=NO_INERTIA)]
    b = b.iloc[paired(a, b, known.scene)[1]]
    off = np.abs(b["last_block"].to_numpy() - a["last_block"].to_numpy())
    start, arrest = (
        largest(b[name].to_numpy() - a[name].to_numpy()) / known.scene.F_N
        for name in ("F_T_start", "F_T_arrest")
    )
    return [
        Check(f"quasi-static: {what}", value, tolerance, why=NO_INERTIA)
        for what, value, tolerance in (
            ("precursors more", more, 1),
            ("lengths, blocks", largest(off[:-1]), blocks),
            ("longest precursor, blocks", off[-1], last or blocks),
            ("start, over F_N", start, LADDER),
            ("arrest, over F_N", arrest, LADDER),
        )
    ]


# --- parts ---------------------------------------------------------------------------------------


def _checks(within: Tolerances, *measured: tuple[Any, ...]) -> list[Check]:
    """Return checks from tuples: name, value, tolerance and, optionally, unit."""
    return [
        Check(name, float(value), limit, *unit, why=within.why)
        for name, value, limit, *unit in measured
        if limit is not None
    ]


def _events(
    known: Reference, made: Record, within: Tolerances
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the stored events that a run covers, and the events of the run in this time."""
    begin, end = made.curve["t"].iloc[[0, -1]]
    a, b = known.events, made.events
    a = a[(a["t_start"] >= begin) & (a["t_stop"] + made.method.t_gap <= end)]
    a = a[a["t_start"] <= known.whole["t_start"]]
    b = b[b["t_start"] <= a["t_start"].max() + within.time + 1e-4]
    return (a[a["is_main"]], b[b["is_main"]]) if within.small is None else (a, b)


def _main(known: Reference, made: Record, within: Tolerances) -> list[tuple[int, int]]:
    """Return pairs of numbers: a stored main event, and the matching event of the run."""
    a, b = _events(known, made, within)
    pairs = zip(a.index, b.index, strict=False)
    return [(event, other) for event, other in pairs if known.events.loc[event, "is_main"]]


def _still(known: Reference, t: np.ndarray) -> np.ndarray:
    """Return the times (s) at which nothing slips and the ring-down is nearly over."""
    quiet = t < known.whole["t_start"]
    for start, stop in known.events[["t_start", "t_stop"]].to_numpy():
        quiet &= ~((t > start - 1e-5) & (t < stop + 2e-4))
    return quiet
