"""Runs against stored full dynamics, event by event.

A stored set (`reference_data/make.py`) holds a scene of the paper, solved with full dynamics and
located switching up to its first event over the whole interface. Three comparisons give `Check`s:

    loading_curve   when events start and stop, at which static forces, and which blocks slip
    stresses        tau and p at first slip and last stick of the main events, tau/p behind the tip
    crack_speeds    rupture times, v_c, and the collapse of v_c on the scaled prestress

Events are compared, not trajectories: forces over F_N, stresses over F_N/N_x, lengths in blocks.
What a run may differ by is in `Tolerances`: one for each engine, with its reason.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from pyfric.checks.pairing import paired
from pyfric.engines import simulate
from pyfric.record import Collapse, collapse_spread, fronts
from pyfric.scene import Scene

if TYPE_CHECKING:
    import os

    from pyfric.core import Switching
    from pyfric.record import Record

__all__ = [
    "DYNAMIC",
    "HYBRID",
    "INSTALLED",
    "LADDER",
    "STEP_END",
    "Check",
    "Ladder",
    "Reference",
    "Tolerances",
    "compare",
    "crack_speeds",
    "dynamic",
    "hybrid",
    "ladder_at_given_length",
    "ladder_event_by_event",
    "load",
    "loading_curve",
    "quasistatic",
    "stresses",
]

INSTALLED = Path(__file__).parent / "reference"
"""Sets that come with the package."""
COMPARED = ("F_T_start", "F_T_arrest", "t_start", "first_block", "last_block")
TABLES = ("events", "curve", "stresses", "fronts")
BINS = 10
"""Bins of the scaled prestress: at least 5 points in each, for run 1 with its 6 main events."""
MANY = 100
"""Fewest blocks in fronts for a collapse."""
LEAST = 0.02
"""Blocks that carry less than this share of F_N/N_x have no tau/p worth comparing."""
BEFORE, AFTER = 2e-4, 5e-3
"""Times that a run of one event begins before its first slip, and ends after its last stick, s."""


@dataclass(frozen=True)
class Check:
    """A value that has to stay within a tolerance.

    Attributes:
        name: what was measured.
        value: not negative; NaN where there was nothing to measure.
        tolerance: largest value that holds.
        unit: of both; "" for pure numbers.
        why: the reason of the tolerance.
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

    def __str__(self) -> str:
        verdict = "holds" if self.holds else "FAILS"
        number = f"{self.value:.3g} {self.unit}".strip()
        return f"{verdict}: {self.name}: {number} (up to {self.tolerance:.3g})"


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """What a run may differ by from full dynamics with located switching.

    Attributes:
        start, arrest: static forces of main events, over F_N.
        time: start of main events, s.
        small: static forces of the other events, over F_N; None where only main events are
            compared.
        blocks: first and last block of events, and blocks in only one of two fronts.
        stress: tau and p, RMS over the interface, over F_N/N_x.
        behind: RMS of the scaled tau/p behind the tip after an event.
        rupture: rupture times after the start of the event, s; None where they are not compared.
        speed: RMS of the ln of the ratio of v_c, over all blocks.
        spread: RMS of ln v_c about the stored binned median.
        curve: F_T(t) where nothing slips, over F_N; None where it is not compared.
        why: where the values come from.
    """

    start: float
    arrest: float
    time: float
    small: float | None
    blocks: int
    stress: float
    behind: float
    rupture: float | None
    speed: float
    spread: float
    curve: float | None
    why: str


HYBRID = {
    "linear": Tolerances(
        start=5e-6,
        arrest=5e-6,
        time=1e-5,
        small=5e-6,
        blocks=0,
        stress=1e-4,
        behind=5e-5,
        rupture=5e-7,
        speed=3e-4,
        spread=3e-4,
        curve=5e-6,
        why="the same steps and switches; what jumps drop, and how rounding grows in events",
    ),
    "finite": Tolerances(
        start=3e-5,
        arrest=3e-5,
        time=5e-5,
        small=1e-3,
        blocks=0,
        stress=2e-4,
        behind=3e-4,
        rupture=2e-6,
        speed=1e-3,
        spread=5e-3,
        curve=2e-4,
        why="as in linear geometry; besides, jumps take the modes of the loaded state",
    ),
}
"""Hybrid with located switching, geometry -> tolerances. Measured in seven scenes: in linear
geometry forces 3.5e-7, stresses 2e-6, rupture times 2e-8 s, v_c 5e-5; in finite geometry forces
3e-6 (2.3e-4 for a single-block event of run 3), stresses 1.2e-5, rupture times 2.3e-7 s, v_c 6e-5;
no block more or less."""
DYNAMIC = {geometry: replace(within, curve=None) for geometry, within in HYBRID.items()}
"""Full dynamics of one event, from a hybrid state."""
STEP_END = Tolerances(
    start=2.5e-3,
    arrest=0.01,
    time=4e-3,
    small=None,
    blocks=2,
    stress=0.1,
    behind=0.2,
    rupture=None,
    speed=0.25,
    spread=0.1,
    curve=None,
    why="switches wait for step ends: an error of order 1 in the step, which is felt most by "
    "rupture times one or two steps apart",
)
"""Hybrid with switching at step ends. Measured: start 1.2e-3, arrest 5.1e-3, 1.9 ms, 2 blocks,
stresses 0.06, behind the tip 0.12 (run 3), v_c 0.13, spread 0.07. Slow nucleation takes up to
0.8 ms longer or shorter, so that rupture times say nothing."""


class Reference(NamedTuple):
    """One stored set; `whole` is its first system-size event."""

    name: str
    scene: Scene
    about: dict
    events: pd.DataFrame
    curve: pd.DataFrame
    stresses: pd.DataFrame
    fronts: pd.DataFrame
    whole: pd.Series


def load(name: str, folder: str | os.PathLike[str] = INSTALLED) -> Reference:
    """Return a stored set, such as "fig1_linear".

    Raises:
        FileNotFoundError: it is not in the folder.
        SceneError: its scene is refused.
    """
    here = Path(folder) / name
    about = tomllib.loads((here / "provenance.toml").read_text(encoding="utf-8"))
    tables = {table: pd.read_csv(here / f"{table}.csv") for table in TABLES}
    events = tables["events"]
    whole = events[events["is_main"] & (events["L_p_over_L"] == 1)].iloc[0]
    return Reference(name, Scene.from_toml(about["scene"]), about, **tables, whole=whole)


# --- runs ----------------------------------------------------------------------------------------


def hybrid(
    known: Reference, t_end: float | None = None, switching: Switching = "located"
) -> Record:
    """Return the hybrid run of a set, up to its first system-size event or t_end (s)."""
    return simulate(
        known.scene,
        known.whole["t_stop"] + AFTER if t_end is None else t_end,
        fidelity="hybrid",
        geometry=known.about["geometry"],
        switching=switching,
        sample=known.about["sample"] * known.about["dt"],
        progress=False,
    )


def dynamic(known: Reference, row: int) -> Record:
    """Return full dynamics of one event of a set, from a hybrid state shortly before it."""
    event = known.events.loc[row]
    before = hybrid(known, event["t_start"] - BEFORE)
    return simulate(
        known.scene,
        event["t_stop"] + AFTER,
        fidelity="dynamic",
        geometry=known.about["geometry"],
        switching="located",
        initial=before.final_state,
        dt=known.about["dt"],
        sample=known.about["sample"] * known.about["dt"],
        budget=False,
        threads=1,
        progress=False,
    )


def quasistatic(known: Reference) -> Record:
    """Return the quasi-static run of a set, whose system-size event may come later."""
    return simulate(known.scene, 1.2 * known.about["t_end"], fidelity="quasistatic", progress=False)


# --- the three comparisons -----------------------------------------------------------------------


def compare(known: Reference, made: Record, within: Tolerances) -> list[Check]:
    """Return all checks of a run: loading curve and events, stresses, crack speeds.

    Args:
        known: the stored set.
        made: a run of its scene; it may be a part of it.
        within: the tolerances of the engine that made the run.
    """
    return [
        *loading_curve(known, made, within),
        *stresses(known, made, within),
        *crack_speeds(known, made, within),
    ]


def loading_curve(known: Reference, made: Record, within: Tolerances) -> list[Check]:
    """Compare the events of a run, and F_T(t) between them, with those of a set."""
    a, b = _events(known, made, within)
    which = "main events" if within.small is None else "events"
    checks = [_check(f"{which} that are missing or new", abs(len(a) - len(b)), 0, within)]
    n, F_N = min(len(a), len(b)), known.scene.F_N
    a, b = a.iloc[:n], b.iloc[:n]
    error = pd.DataFrame({name: b[name].to_numpy() - a[name].to_numpy() for name in COMPARED})
    main = a["is_main"].to_numpy(dtype=bool)
    for name, column, unit, limit in (
        ("static force at first slip, over F_N", "F_T_start", F_N, within.start),
        ("static force at last stick, over F_N", "F_T_arrest", F_N, within.arrest),
        ("start", "t_start", 1.0, within.time),
    ):
        value = _largest(error[column][main] / unit)
        of = "s" if column == "t_start" else ""
        checks.append(_check(f"main events: {name}", value, limit, within, of))
    if within.small is not None and not main.all():
        value = _largest(error.loc[~main, ["F_T_start", "F_T_arrest"]].to_numpy().ravel() / F_N)
        checks.append(_check("small events: static forces, over F_N", value, within.small, within))
    value = _largest(error[["first_block", "last_block"]].to_numpy().ravel())
    checks.append(_check(f"{which}: first and last block", value, within.blocks, within))
    if within.curve is not None:
        _, i, j = np.intersect1d(known.curve["t"], made.curve["t"], return_indices=True)
        t = known.curve["t"].to_numpy()[i]
        error = made.curve["F_T"].to_numpy()[j] - known.curve["F_T"].to_numpy()[i]
        error = error[_still(known, t)] / F_N
        checks.append(
            _check("F_T(t) where nothing slips, over F_N", _largest(error), within.curve, within)
        )
    return checks


def stresses(known: Reference, made: Record, within: Tolerances) -> list[Check]:
    """Compare tau and p of the main events of a run with those of a set."""
    unit, order = known.scene.F_N / known.scene.N_x, np.argsort(known.scene.n_of_i)
    law = known.scene.interface.law
    errors: dict[str, list[float]] = {"before": [], "after": []}
    behind = []
    for row, other in _main(known, made, within):
        table = known.stresses[known.stresses["event"] == row].sort_values("n")
        for when, found in errors.items():
            for name in (f"tau_{when}", f"p_{when}"):
                error = getattr(made, name)[other][order] - table[name].to_numpy()
                found.append(_rms(error) / unit)
        n, p = table["n"].to_numpy(), table["p_after"].to_numpy()
        event = known.events.loc[row]
        slid = (n >= event["first_block"]) & (n < event["last_block"]) & (p > LEAST * unit)
        scaled = [
            _rms(law.scaled(tau[slid] / p[slid]))
            for tau, p in (
                (table["tau_after"].to_numpy(), p),
                (made.tau_after[other][order], made.p_after[other][order]),
            )
        ]
        behind.append(scaled[1] - scaled[0])
    return [
        *(
            _check(
                f"tau and p {when} main events, RMS, over F_N/N_x",
                _largest(found),
                within.stress,
                within,
            )
            for when, found in errors.items()
        ),
        _check("scaled tau/p behind the tip, RMS", _largest(behind), within.behind, within),
    ]


def crack_speeds(known: Reference, made: Record, within: Tolerances) -> list[Check]:
    """Compare fronts of the main events of a run with those of a set.

    The spread is that about the stored points' binned median on the scaled prestress, of the run's
    points less that of the stored ones; it is left out with fewer than 5 points for each bin.
    """
    table, ours, theirs = fronts(made), [], []
    times, alone, ratios = [], [], []
    for row, other in _main(known, made, within):
        a = known.fronts[known.fronts["event"] == row].set_index("n")
        b = table[table["event"] == other].set_index("n")
        both = a.add_suffix("_a").join(b.add_suffix("_b"), how="inner")
        since = known.events.loc[row, "t_start"], made.events.loc[other, "t_start"]
        times.append((both["t_b"] - since[1]) - (both["t_a"] - since[0]))
        alone.append(len(a) + len(b) - 2 * len(both))
        ratios.append(np.log(both["v_c_b"] / both["v_c_a"]).dropna())
        theirs.append(a)
        ours.append(b)
    checks = [
        _check("blocks in only one of two fronts", _largest(alone), within.blocks, within),
        _check("v_c of blocks, RMS of its ln", _rms(_joined(ratios)), within.speed, within),
    ]
    if within.rupture is not None:
        error = _largest(_joined(times))
        checks.append(_check("rupture times in events", error, within.rupture, within, "s"))
    if sum(map(len, theirs)) >= MANY:
        law = known.scene.interface.law
        stored = pd.concat(theirs)
        scaled = law.scaled(stored["tau_over_p"])
        curve = collapse_spread(scaled, stored["v_c"], bins=BINS)
        points = pd.concat(ours)
        difference = abs(_spread(curve, points["scaled"], points["v_c"]) - curve.rms)
        name = f"collapse of v_c: spread less the stored {curve.rms:.3f}"
        checks.append(_check(name, difference, within.spread, within))
    return checks


def _spread(curve: Collapse, x: pd.Series, v_c: pd.Series) -> float:
    """RMS of ln v_c about a binned median."""
    kept = (np.isfinite(x) & np.isfinite(v_c)).to_numpy()
    last = len(curve.median) - 1
    in_bin = np.clip(np.searchsorted(curve.edges, x.to_numpy()[kept], side="right") - 1, 0, last)
    return _rms(np.log(v_c.to_numpy()[kept] / curve.median[in_bin]))


# --- the ladder ----------------------------------------------------------------------------------


LADDER = 0.03
"""Forces of the quasi-static ladder, over F_N: it has no inertia, so that nothing overshoots."""
NO_INERTIA = "no inertia: nothing overshoots, and steps are a little shorter"


class Ladder(NamedTuple):
    """Main precursors from the trailing edge: lengths in blocks, forces over F_N."""

    length: np.ndarray
    start: np.ndarray
    arrest: np.ndarray

    @classmethod
    def of(cls, events: pd.DataFrame, scene: Scene) -> Ladder:
        """Return the precursors before the first system-size event.

        The length is the farthest block: L_p is 0 where a corner block that hardly carries load did
        not move.
        """
        main = events[events["is_main"] & events["at_trailing_edge"]]
        main = main[(main["last_block"] == scene.N_x).cumsum() == 0]
        forces = main[["F_T_start", "F_T_arrest"]].to_numpy().T / scene.F_N
        return cls(main["last_block"].to_numpy(), *forces)


def ladder_event_by_event(
    a: Ladder, b: Ladder, blocks: int, last: int | None = None
) -> list[Check]:
    """Compare a ladder b with a, each event of a with one of b; b may have one more.

    Args:
        a: of full dynamics.
        b: of the quasi-static engine, in the same geometry.
        blocks: tolerance of lengths.
        last: tolerance of the last, longest one; None means the same.
    """
    if len(b.length) < len(a.length):
        return [Check("ladder: precursors that are missing", math.nan, 0, "", NO_INERTIA)]
    length = np.abs(np.subtract.outer(a.length, b.length)) / 2
    _, k = paired(np.maximum(length, np.abs(np.subtract.outer(a.start, b.start)) / LADDER))
    off = np.abs(b.length[k] - a.length)
    return [
        Check("ladder: precursors more", abs(len(b.length) - len(a.length)), 1, "", NO_INERTIA),
        Check("ladder: lengths, blocks", _largest(off[:-1]), blocks, "", NO_INERTIA),
        Check("ladder: longest precursor, blocks", off[-1], last or blocks, "", NO_INERTIA),
        Check("ladder: start, over F_N", _largest(b.start[k] - a.start), LADDER, "", NO_INERTIA),
        Check("ladder: arrest, over F_N", _largest(b.arrest[k] - a.arrest), LADDER, "", NO_INERTIA),
    ]


def ladder_at_given_length(a: Ladder, b: Ladder) -> list[Check]:
    """Compare the forces at which precursors of a length start and stop, where both have some."""
    common = (a.length >= b.length[0]) & (a.length <= b.length[-1])
    checks = [Check("ladder: lengths that do not grow", (np.diff(b.length) <= 0).sum(), 0)]
    checks.append(Check("ladder: precursors out of range", (~common).sum(), 2, "", NO_INERTIA))
    for force in ("start", "arrest"):
        at_length = np.interp(a.length[common], b.length, getattr(b, force))
        error = _largest(at_length - getattr(a, force)[common])
        checks.append(
            Check(f"ladder: {force} at given length, over F_N", error, LADDER, "", NO_INERTIA)
        )
    return checks


# --- parts ---------------------------------------------------------------------------------------


def _events(
    known: Reference, made: Record, within: Tolerances
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Events of the set that a run covers, and those of the run up to the last of them."""
    begin, end = made.curve["t"].iloc[[0, -1]]
    a, b = known.events, made.events
    a = a[(a["t_start"] >= begin) & (a["t_stop"] + made.method.t_gap <= end)]
    a = a[a["t_start"] <= known.whole["t_start"]]
    b = b[b["t_start"] <= a["t_start"].max() + within.time + 1e-4]
    return (a[a["is_main"]], b[b["is_main"]]) if within.small is None else (a, b)


def _main(known: Reference, made: Record, within: Tolerances) -> list[tuple[int, int]]:
    """Rows of main events in the set, and of the same events in the run."""
    a, b = _events(known, made, within)
    pairs = zip(a.index, b.index, strict=False)
    return [(row, other) for row, other in pairs if known.events.loc[row, "is_main"]]


def _still(known: Reference, t: np.ndarray) -> np.ndarray:
    """Where nothing slips, a bit of ring-down aside."""
    quiet = t < known.whole["t_start"]
    for start, stop in known.events[["t_start", "t_stop"]].to_numpy():
        quiet &= ~((t > start - 1e-5) & (t < stop + 2e-4))
    return quiet


def _check(name: str, value: float, limit: float, within: Tolerances, unit: str = "") -> Check:
    return Check(name, float(value), limit, unit, within.why)


def _joined(parts: list[pd.Series]) -> np.ndarray:
    return np.concatenate([*parts, []])


def _largest(error: np.ndarray | list[float]) -> float:
    """Largest size, NaN if one is missing or there are none."""
    return float(np.max(np.abs(error))) if len(error) else math.nan


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(error)))) if len(error) else math.nan
