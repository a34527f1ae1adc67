"""Fronts study: when is a front speed of this model physical.

Three questions, each answered by runs beside theory:

crack      A two-sided crack under a uniform stress drop at S = 3, where a continuum allows no
           supershear: its speed beside fracture mechanics, for few and many blocks in the cohesive
           zone X_c0. Half of it is run, mirrored in its middle; sides and top absorb. It starts as
           a crack just longer than the critical one, released at once.
length     Precursors of the Fig. 1 scene with d_c = 1 um: their lengths beside the length at which
           the energy release of static states no longer pays for the fracture energy, and beside
           the ladder without weakening.
Fig. 4     Front speeds of these precursors, and their collapse over runs 1 to 4, as the lattice
           becomes finer: what stays, what was the lattice's. A fine lattice may start from the
           state of one twice as coarse just before an event (`finer`); where both are run, the
           difference is a number of the study.

Runs are kept in a folder; those of the Fig. 1 scene go on from there where they were stopped.

Source: PRL 107, 074301 (2011), Fig. 4; L. B. Freund, Dynamic Fracture Mechanics (1990);
D. J. Andrews, J. Geophys. Res. 81, 5679 (1976).
"""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from finer import refined
from matplotlib.backends.backend_agg import FigureCanvasAgg

from pyfric import theory
from pyfric.core import STEPPERS
from pyfric.engines import simulate, step_size
from pyfric.figures import DataFigure
from pyfric.record import PER_BIN, Record, analysis
from pyfric.scene import Walls, at_once, preset, slab, write
from pyfric.statics import loaded_state

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pyfric.scene import Scene

__all__ = ["BLOCKS", "SPACINGS", "Crack", "crack", "figure", "planned", "study", "summary"]

BLOCKS = (2.0, 4.0, 6.0, 8.0)
"""Blocks in X_c0 of the cracks."""
SPACINGS = (2.5e-3, 1.25e-3, 0.625e-3)
"""Lattice constants of the Fig. 1 scene, m."""
T_END = 0.745
"""End of its runs, s: the precursor of half the slider's length is over."""
COLLAPSE = {"run1": 0.56, "run2": 0.63, "run3": 0.7, "run4": 0.77}
"""Runs of Fig. 4(b) and their ends, s: seven tenths of the time to the first event over all."""
D_C = 1e-6
"""Slip of weakening, m."""
COARSE = 1.2e-3
"""Least lattice constant of runs without weakening, m: no lattice resolves those."""
WINDOW = 250.0
"""Speeds of a crack are means over twice this length, m."""
FROM, TO = 3e3, 12e3
"""Half lengths of a crack at which speeds are compared, m."""
PACE = 5e-9
"""Processor time of a block evaluation in such runs, all else included, s."""
LAST = 2
"""Precursors of runs 1 to 4, the last ones, that are started from a coarser lattice."""
AFTER = 3e-3
"""Time after the end of an event on the coarse lattice to which the fine one is run first, s."""
MIDDLE = 0.06, 0.4
"""Where a front of half the slider's length neither starts nor stops, x/L."""
LATE = 0.5
"""L_p/L of the precursor whose speeds are shown."""


ROCK = theory.Material(c_P=3464 * math.sqrt(3), c_S=3464.0, rho=2670.0)
"""The material of the cracks: lambda = mu."""


@dataclass(frozen=True, kw_only=True)
class Crack:
    """A two-sided crack under a uniform stress drop; one body, per m of thickness.

    Attributes:
        blocks: X_c0/l.
        eta2: (bond viscosity)^2/(k m): 0.1 in the paper.
        dashpots: whether it resists rotation, "full", as the paper's does.
        S: strength excess.
        X_c0: cohesive zone at rest, m.
        a_end, H: half width and height of the slab, m.
        begin: half length that is released at once, over the critical one.
    """

    blocks: float
    eta2: float = 1e-3
    dashpots: Literal["along", "full"] = "along"
    S: float = 3.0
    X_c0: float = 207.0
    a_end: float = 13e3
    H: float = 8e3
    begin: float = 1.02
    material: theory.Material = ROCK
    mu_s: float = 0.677
    mu_k: float = 0.525
    p: float = 120e6

    @property
    def spacing(self) -> float:
        """Lattice constant l, m."""
        return self.X_c0 / self.blocks

    @property
    def dtau(self) -> float:
        """Stress drop, Pa."""
        return (self.mu_s - self.mu_k) * self.p / (1 + self.S)

    @property
    def d_c(self) -> float:
        """Slip of weakening of one body, m."""
        return self.X_c0 / theory.cohesive_zone(self.material, self.mu_s, self.mu_k, self.p, 1.0)

    @property
    def Gamma(self) -> float:
        """Fracture energy of one body, J/m^2."""
        return theory.fracture_energy(self.mu_s, self.mu_k, self.p, self.d_c)

    def scene(self) -> Scene:
        """Return half of the crack's surroundings."""
        l, k = self.spacing, 0.75 * self.material.E_prime
        m, N_x, N_z = self.material.rho * l**2, round(self.a_end / l), round(self.H / l) + 1
        return slab(
            p=self.p * l,
            tau=(self.mu_k * self.p + self.dtau) * l,
            L=(N_x - 1) * l,
            H=(N_z - 1) * l,
            l=l,
            k=k,
            M=m * N_x * N_z,
            mu_s=self.mu_s,
            mu_k=self.mu_k,
            d_c=self.d_c,
            eta=math.sqrt(self.eta2 * k * m),
            dashpots=self.dashpots,
            walls=Walls(left="mirrored", right="absorbing", top="absorbing"),
            name="crack",
        )

    def speed(self, a: np.ndarray) -> np.ndarray:
        """Return the speed that fracture mechanics gives at the half length a (m), m/s."""
        return theory.crack_speed(self.material, a, self.dtau, self.Gamma, bodies=1)


def crack(which: Crack, **options: Any) -> tuple[pd.DataFrame, Record]:
    """Run a crack.

    Returns:
        A table: a (m), v and v_theory (m/s) from `FROM` to `TO`, as far as the crack came; and the
        record.
    """
    scene, material = which.scene(), which.material
    critical = theory.crack_length(material, 0.0, which.dtau, which.Gamma, bodies=1)
    first = int(which.begin * critical / which.spacing)
    state = loaded_state(scene).state(scene, step_size(scene))
    state.mode[:first], state.s_0[:first] = 1, which.d_c
    t_end = which.a_end / (0.75 * material.c_S) + 1.5
    how = {"fidelity": "dynamic", "switching": "located", "budget": False, "t_gap": 1e3}
    how |= {"initial": state, "dt": state.dt, "progress": False, "threads": 1}
    record = simulate(scene, t_end, **how | options)
    t = record.rupture_times[0]
    known, at = np.isfinite(t), (np.arange(scene.N_x) + 0.5) * which.spacing
    a = np.arange(FROM, min(TO, at[known].max() - WINDOW) + 1, 2 * WINDOW)
    late, early = (np.interp(a + d, at[known], t[known]) for d in (WINDOW, -WINDOW))
    v = 2 * WINDOW / (late - early)
    return pd.DataFrame({"a": a, "v": v, "v_theory": which.speed(a)}), record


def _kept_crack(path: Path, which: Crack) -> pd.DataFrame:
    """Return the table of a crack with its cost, from a file or made."""
    if path.is_file():
        return pd.read_csv(path)
    begin = time.process_time()
    table, record = crack(which)
    table["evaluations"] = record.counts["block_evaluations"]
    table["seconds"] = time.process_time() - begin
    write(path, table.to_csv(index=False).encode())
    return table


# --- the Fig. 1 scene ----------------------------------------------------------------------------


def planned(scene: Scene, t_end: float, coarser: Record | None) -> tuple[float, float]:
    """Return the block evaluations and the seconds that a run is expected to take.

    Half the lattice constant takes 8 times what the coarser run took, where it rests as often; the
    first one at most what full dynamics takes; at `PACE` each.
    """
    if coarser is None:
        evaluations = STEPPERS["rk4"].evaluations * t_end / step_size(scene)
        return (all_ := evaluations * scene.N_x * scene.N_z), all_ * PACE
    times = (coarser.scene.slider.l / scene.slider.l) ** 3
    made = coarser.counts["block_evaluations"]
    return times * made, times * _seconds(coarser)


def _seconds(record: Record) -> float:
    return PACE * record.counts["block_evaluations"]


def _kept(path: Path, scene: Scene, t_end: float) -> Record:
    """Return the run in a file, or make it; one that was stopped goes on."""
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
        record.save(path)
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
            records[l, d_c] = coarser = _kept(runs / file, scene, t_end)
    return records


def _begun(path: Path, coarse: Record, event: int, scene: Scene) -> Record:
    """Return the event on a finer lattice, from the state before it, from a file or made."""
    if path.is_file() and (record := Record.load(path)).scene == scene:
        return record
    before: Any = refined(coarse, event, scene)
    t_end, dt = float(coarse.events["t_stop"].iloc[event]), before.dt
    how: dict[str, Any] = {"fidelity": "hybrid", "geometry": "linear", "switching": "located"}
    for _ in range(8):
        t_end += AFTER
        before = simulate(scene, t_end, initial=before, dt=dt, progress=False, **how)
        if (before.events["is_main"] & before.events["finished"]).any():
            break
    before.save(path)
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

    Each lattice begins from the one twice as coarse: from its late precursor, or its last `count`.
    The late one may begin from one that began so itself, where there is no whole run to compare.
    """
    found: dict[tuple[float, int], Record] = {}
    plans: dict[tuple[float, int], tuple[float, float]] = {}
    for l in sorted(finer, reverse=True):
        scene, whole = preset(name, l=l, d_c=D_C), records.get((2 * l, D_C))
        chain = {event: one for (at, event), one in found.items() if at == 2 * l}
        if count == 1 and chain and (l, D_C) not in records:
            sources = {event: (one, _widest(one)) for event, one in chain.items()}
        elif whole is not None:
            events = [_late(whole)] if count == 1 else _main(whole)[-count:].tolist()
            sources = {event: (whole, event) for event in events}
        else:
            continue
        for event, (coarse, row) in sources.items():
            about = coarse.events.iloc[row]
            plan = planned(scene, about["t_stop"] - about["t_start"] + AFTER, None)
            say(
                f"{name}, l = {l * 1e3:g} mm, from event {event} at {2e3 * l:g} mm: planned "
                f"{plan[0]:.2g} block evaluations, {plan[1] / 60:.2g} min of one core"
            )
            path = runs / f"{name}_{l * 1e3:g}_{D_C * 1e6:g}_from_{event}.nc"
            found[l, event], plans[l, event] = _begun(path, coarse, row, scene), plan
    return found, plans


def _widest(record: Record) -> int:
    """Return the event with the longest front."""
    return int(record.events["n_front"].argmax())


def _lengths(records: dict[tuple[float, float], Record], runs: Path) -> pd.DataFrame:
    """Return lengths of precursors with weakening, from files or made."""
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
    """Return lengths of precursors: dynamics, Griffith, and the ladder without weakening."""
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
        blocks: blocks in X_c0 of the cracks, with eta^2 = 0.001 k m along the bonds; the third one
            also with dashpots that resist rotation, and with the paper's viscosity.
        spacings: lattice constants of the Fig. 1 scene, m.
        t_end: end of its runs, s.
        collapse: lattice constants of runs 1 to 4, m.
        finer: lattice constants on which precursors start from the run with twice of it, m: the
            late one of the Fig. 1 scene, and the last `LAST` of runs 1 to 4.
        say: called with what is done, and what it is planned to take, before it is.

    Returns:
        Tables. "crack": blocks, eta2, dashpots, a, v, v_theory. "cost": run, planned and made
        evaluations and seconds, and seconds of full dynamics. "lengths": l, event, force_arrest,
        dynamics, griffith, ladder (L_p/L).
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
        say(f"crack with {_viscous(one.blocks, one.eta2, one.dashpots)}")
        table = _kept_crack(Path(runs) / f"crack_{case}.csv", one)
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
    """Return what a run was planned to take, and took."""
    plan = dict(zip(("planned_evaluations", "planned_seconds"), expected, strict=True))
    span = float(record.curve["t"].iloc[-1] - record.curve["t"].iloc[0])
    plan["most_seconds"] = planned(record.scene, span, None)[1]
    made = {"evaluations": record.counts["block_evaluations"], "seconds": _seconds(record)}
    return {"run": run} | plan | made


def _main(record: Record) -> np.ndarray:
    """Return the finished precursors and larger events, shape (n,)."""
    return np.flatnonzero(record.events["is_main"] & record.events["finished"])


def _late(record: Record) -> int:
    """Return the main event that is nearest to half the slider's length."""
    main = _main(record)
    return int(main[np.abs(record.events["L_p_over_L"].to_numpy()[main] - LATE).argmin()])


def _speeds_of(record: Record) -> pd.DataFrame:
    """Return the speeds of all fronts, and which front is the precursor of half the length."""
    table = analysis.fronts(record)
    return table.assign(late=table["event"] == _late(record))


# --- what it comes to ----------------------------------------------------------------------------


def summary(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Return the numbers of the study: what, case, value."""
    c_R = Crack(blocks=1).material.c_R
    rows: list[tuple[str, str, float]] = []
    for about, table in tables["crack"].groupby(["blocks", "eta2", "dashpots"]):
        case, off = _viscous(*about), table["v"] / table["v_theory"]
        rows += [
            ("crack: mean of v/v_theory - 1, 3 to 12 km", case, float(off.mean() - 1)),
            ("crack: largest |v/v_theory - 1|", case, float((off - 1).abs().max())),
            ("crack: highest speed over c_R", case, float(table["v"].max() / c_R)),
        ]
    for l, table in tables["lengths"].groupby("l", sort=False):
        for name in ("griffith", "ladder"):
            off = (table[name] - table["dynamics"]).abs()
            rows += [
                (f"L_p/L: largest |{name} - dynamics|", _case(l, D_C), float(off.max())),
                (f"L_p/L: median |{name} - dynamics|", _case(l, D_C), float(off.median())),
            ]
    material = theory.Material.of_lattice(*_lattice(preset("fig1")), 1.0)
    fronts = tables["fronts"][tables["fronts"]["v_c"].notna()]
    fig1, others = fronts[fronts["scene"] == "fig1"], fronts[fronts["scene"] != "fig1"]
    for (l, d_c, begun), table in fig1.groupby(["l", "d_c", "begun"], sort=False):
        rows += _speeds(table, _case(l, d_c, begun), material)
    for (l, d_c, begun), table in others.groupby(["l", "d_c", "begun"], sort=False):
        rows += _speeds(table, f"runs 1 to 4, {_case(l, d_c, begun)}", material)
    rows += _changes(fig1)
    return pd.DataFrame(rows, columns=["what", "case", "value"])


def _viscous(n: float, eta2: float, dashpots: str) -> str:
    return f"{n:g} blocks in X_c0, eta^2 = {eta2:g} k m, {dashpots}"


def _case(l: float, d_c: float, begun: float = 0.0) -> str:
    case = f"l = {l * 1e3:g} mm, d_c = {d_c * 1e6:g} um"
    return f"{case}, from l = {begun * 1e3:g} mm" if begun else case


def _lattice(scene: Scene) -> tuple[float, float, float]:
    return scene.slider.k, scene.m, scene.slider.l


def _speeds(
    table: pd.DataFrame, case: str, material: theory.Material
) -> list[tuple[str, str, float]]:
    v = table["v_c"].to_numpy()
    if not v.size:
        return []
    rows = [
        ("least and", case, float(table["X_c0_over_l"].min())),
        ("most blocks in X_c0", case, float(table["X_c0_over_l"].max())),
        ("share of blocks with 6 or more in X_c0", case, float((table["X_c0_over_l"] >= 6).mean())),
        ("highest v_c over c_L", case, float(v.max() / material.c_P)),
        ("highest v_c over c_R", case, float(v.max() / material.c_R)),
        ("share of v_c above c_L", case, float(np.mean(v > material.c_P))),
        ("share of v_c above c_R", case, float(np.mean(v > material.c_R))),
        ("median v_c over c_R", case, float(np.median(v) / material.c_R)),
    ]
    known = table["scaled"].notna()
    if known.sum() >= 20 * PER_BIN:
        spread = analysis.collapse_spread(table["scaled"][known], table["v_c"][known])
        share = 1 - spread.rms**2 / float(np.var(np.log(v[known])))
        rows += [
            ("rms of ln v_c about one curve of the scaled prestress", case, spread.rms),
            ("share of the variance of ln v_c that it explains", case, share),
        ]
    return rows


def _changes(fronts: pd.DataFrame) -> list[tuple[str, str, float]]:
    """Return how v_c(x) of the late precursor changes from one lattice to the next.

    And how it changes where the run on the same lattice began from the state of a coarser one.
    """
    late = fronts[fronts["late"]]
    rows, whole, begun = [], late[late["begun"] == 0], late[late["begun"] > 0]
    for d_c, tables in whole.groupby("d_c"):
        spacings = sorted(tables["l"].unique(), reverse=True)
        for coarse, fine in itertools.pairwise(spacings):
            one, two = (tables[tables["l"] == l] for l in (coarse, fine))
            rows += _change(one, two, f"{_case(coarse, d_c)}, to l = {fine * 1e3:g} mm")
    for (l, d_c), two in begun.groupby(["l", "d_c"], sort=False):
        same = whole[whole["d_c"] == d_c]
        for one in (same[same["l"] == 2 * l], same[same["l"] == l]):
            if len(one):
                case = _case(one["l"].iloc[0], d_c)
                rows += _change(one, two, f"{case}, to {_case(l, d_c, 2 * l)}")
    return rows


def _change(one: pd.DataFrame, two: pd.DataFrame, case: str) -> list[tuple[str, str, float]]:
    """Return the rms of ln v_c(x) of a front over another, where both have speeds."""
    inside = one["x_over_L"].between(two["x_over_L"].min(), two["x_over_L"].max())
    other = np.interp(one["x_over_L"][inside], two["x_over_L"], two["v_c"])
    change = np.log(other / one["v_c"][inside])
    rows = [
        ("rms change of ln v_c(x), late precursor", case, float(np.sqrt(np.mean(change**2)))),
        ("median |change| of ln v_c(x), late precursor", case, float(np.median(np.abs(change)))),
    ]
    middle = change[one["x_over_L"][inside].between(*MIDDLE)]
    if len(middle):
        what = f"rms change of ln v_c(x), late precursor, x/L = {MIDDLE[0]:g} to {MIDDLE[1]:g}"
        rows.append((what, case, float(np.sqrt(np.mean(middle**2)))))
    return rows


COLOURS = ("#E69F00", "#009E73", "#0072B2", "#CC79A7", "#56B4E9", "#D55E00")


def figure(tables: dict[str, pd.DataFrame]) -> DataFigure:
    """Return the study as a figure: cracks, lengths, speeds of the late precursor, all speeds."""
    fig = DataFigure(figsize=(7.2, 5.8), layout="constrained")
    FigureCanvasAgg(fig)
    (cracks, lengths), (late, every) = fig.subplots(2, 2)
    _draw_cracks(cracks, tables["crack"])
    _draw_lengths(lengths, tables["lengths"])
    _draw_fronts(late, every, tables["fronts"])
    several = (tables["fronts"]["scene"] != "fig1").any()
    titles = (
        "(a) crack at S = 3",
        r"(b) precursors, $d_\mathrm{c}$ = 1 $\mu$m",
        rf"(c) precursor with $L_\mathrm{{p}}/L$ near {LATE:g}",
        "(d) main events, runs 1 to 4" if several else "(d) main events",
    )
    for axes, title in zip((cracks, lengths, late, every), titles, strict=True):
        axes.set_title(title, fontsize=8, loc="left")
        axes.tick_params(labelsize=7, direction="in", which="both")
        axes.legend(fontsize=6, frameon=False)
    fig.caption = (
        "(a) Two-sided crack under a uniform stress drop, S = 3: front speed against half length "
        "for several numbers of blocks in X_c0, and the equation of motion of fracture mechanics. "
        "(b) Fig. 1 scene with d_c = 1 um: lengths in dynamics against the length at which the "
        "energy release of static states no longer exceeds the fracture energy. (c) Its front "
        "speeds, with d_c = 1 um (points) and 0 (thin lines), at several l; dashed: c_R, c_S, c_L "
        "of the lattice. (d) Speeds of main events against the scaled prestress, with d_c = 1 um "
        "(points) and 0 (faint crosses), of "
        + ("runs 1 to 4" if several else "the Fig. 1 scene")
        + "; grey: the exact speed in a chain with the paper's viscosity. Lattices that are not "
        "run as a whole begin from the tractions of one twice as coarse, just before the event. "
        + "Hybrid engine, linear geometry, located switching; the crack in full dynamics."
    )
    fig.tables = {**tables, "summary": summary(tables)}
    return fig


def _draw_cracks(axes: Any, table: pd.DataFrame) -> None:
    material = Crack(blocks=1).material
    groups = table.groupby(["blocks", "eta2", "dashpots"])
    for ((n, eta2, dashpots), rows), colour in zip(groups, COLOURS, strict=False):
        text = f"{n:g} blocks" + (", resists rotation" if dashpots == "full" else "")
        text += ", paper's viscosity" if eta2 == 0.1 else ""
        axes.plot(rows["a"] / 1e3, rows["v"] / material.c_R, "o", color=colour, ms=2.5, label=text)
    a = np.linspace(FROM, TO, 100)
    v = Crack(blocks=1).speed(a)
    axes.plot(a / 1e3, v / material.c_R, "k", lw=0.8, label="fracture mechanics")
    axes.fill_between(a / 1e3, 0.95 * v / material.c_R, 1.05 * v / material.c_R, color="0.92", lw=0)
    axes.set_xlabel("half length $a$ (km)", fontsize=8)
    axes.set_ylabel(r"front speed $v/c_\mathrm{R}$", fontsize=8)


def _draw_lengths(axes: Any, table: pd.DataFrame) -> None:
    for (l, rows), colour in zip(table.groupby("l", sort=False), COLOURS, strict=False):
        text = f"l = {l * 1e3:g} mm"
        axes.plot(rows["griffith"], rows["dynamics"], "o", color=colour, ms=3, label=text)
    axes.plot([0, 1], [0, 1], color="0.6", lw=0.7)
    top = 1.15 * table["dynamics"].max()
    axes.set_xlim(0, top)
    axes.set_ylim(0, top)
    axes.set_xlabel(r"$L_\mathrm{p}/L$ where $G=\Gamma$, static states", fontsize=8)
    axes.set_ylabel(r"$L_\mathrm{p}/L$ in dynamics", fontsize=8)


def _chain(most: float) -> tuple[np.ndarray, np.ndarray]:
    """Return scaled prestress up to the largest, and the front speed of a chain there, m/s."""
    k, m, l = _lattice(preset("fig1"))
    eta = preset("fig1").eta / math.sqrt(k * m)
    scaled = np.linspace(0.02, min(most, 0.8), 40)
    v = [theory.chain_speed(float(one), 0.0, eta) for one in scaled]
    return scaled, l * math.sqrt(k / m) * np.array(v)


def _draw_fronts(late: Any, every: Any, table: pd.DataFrame) -> None:
    d_cs, spacings = sorted(table["d_c"].unique()), sorted(table["l"].unique(), reverse=True)
    fig1, others = table[table["scene"] == "fig1"], table[table["scene"] != "fig1"]
    chosen = others if len(others) else fig1
    lattices = list(zip(spacings, COLOURS, strict=False))
    for (l, colour), d_c in itertools.product(lattices, d_cs):
        label = f"l = {l * 1e3:g} mm"
        if l in set(fig1["l"]):
            rows = fig1[(fig1["l"] == l) & (fig1["d_c"] == d_c) & fig1["late"]]
            rows = rows[rows["begun"] == rows["begun"].min()]
            how = {"marker": "o", "ls": "", "ms": 2.5, "label": label} if d_c else {"lw": 0.6}
            late.plot(rows["x_over_L"], rows["v_c"], color=colour, **how)
        if l in set(chosen["l"]):
            rows = chosen[(chosen["l"] == l) & (chosen["d_c"] == d_c)]
            how = {"marker": "o", "ms": 2, "label": label} if d_c else {"marker": "x", "ms": 1.5}
            how |= {"alpha": 1.0 if d_c else 0.3, "zorder": 3 if d_c else 1, "mew": 0.5}
            every.plot(rows["scaled"], rows["v_c"], ls="", color=colour, **how)
    every.plot(*_chain(chosen["scaled"].max()), color="0.3", lw=0.8, label="chain, exact")
    material = theory.Material.of_lattice(*_lattice(preset("fig1")), 1.0)
    for axes in (late, every):
        for speed in (material.c_R, material.c_S, material.c_P):
            axes.axhline(speed, color="0.5", lw=0.7, ls=(0, (4, 3)), zorder=0)
        axes.set_yscale("log")
        axes.set_ylabel(r"front speed $v_\mathrm{c}$ (m/s)", fontsize=8)
    every.set_ylim(top=9e3)  # room for the legend
    late.set_xlabel("position $x/L$", fontsize=8)
    scaled = r"(\tau/p-\mu_\mathrm{k})/(\mu_\mathrm{s}-\mu_\mathrm{k})"
    every.set_xlabel(rf"scaled prestress ${scaled}$", fontsize=8)
