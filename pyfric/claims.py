"""The paper's claims, measured: value, band, verdict.

    for claim in pyfric.claims.measure():
        print(claim.number, claim.verdict, claim.value, claim.text)

Claims 1 to 16 are statements of the paper; E1 to E10 have exact answers. A claim that says several
things is measured in several parts (1a, 1b ...). Each `Claim` says how its value was measured and
where its band comes from: the paper's words, a convergence study, or the resolution of what is
compared. A value outside its band is a miss, and stays one.

Runs are those behind the paper's figures (`pyfric.paper`) and variations of the Fig. 1 scene.

Source: PRL 107, 074301 (2011).
"""

from __future__ import annotations

import dataclasses
import functools
import io
import json
import math
import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.sparse.linalg import spsolve

from pyfric import analysis, core, paper
from pyfric.equilibrium import loaded_state, solve_static
from pyfric.files import written
from pyfric.operators import bonds, dispersion, spring_stiffness, stability_limit
from pyfric.planner import decay_times
from pyfric.quasistatic import prediction_curve
from pyfric.scene import Scene, chain, preset, setup1, setup2
from pyfric.simulation import simulate
from pyfric.state import OPEN, State
from pyfric.sweep import Job, run_all
from pyfric.units import SceneError, nearest
from pyfric.version import __version__

if TYPE_CHECKING:
    from pyfric.record import Record

__all__ = ["NUMBERS", "Claim", "jobs", "measure", "report", "save", "table"]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim, or a part of one, as measured.

    Attributes:
        number: "1" to "16" or "E1" to "E10", with a letter where a claim has several parts.
        text: the claim in short.
        value: what was measured.
        unit: its unit, "" for a pure number.
        low, high: the band; None where it has no end.
        how: how the value was measured.
        source: where the band comes from.
        note: what a reader has to know, such as why it misses.
        seconds: processor time of the claim, its runs included (shared by its parts, and with
            other claims that need the same runs), s.
    """

    number: str
    text: str
    value: float
    unit: str = ""
    low: float | None = None
    high: float | None = None
    how: str
    source: str
    note: str = ""
    seconds: float = 0.0

    @property
    def holds(self) -> bool:
        """Whether the value is in the band, ends included; NaN never is."""
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        return bool(low <= self.value <= high)

    @property
    def verdict(self) -> str:
        return "holds" if self.holds else "misses"

    @property
    def band(self) -> str:
        """The band as text."""
        if self.low is None and self.high is None:
            return "any"
        if self.low is None:
            return f"<= {self.high:.6g}"
        if self.high is None:
            return f">= {self.low:.6g}"
        return f"{self.low:.6g} to {self.high:.6g}"

    def as_dict(self) -> dict[str, Any]:
        """Attributes, with band and verdict."""
        return dataclasses.asdict(self) | {"band": self.band, "verdict": self.verdict}


Runs = Mapping[str, "Record"]


class Row(NamedTuple):
    """A claim: the names of its runs, and the function that measures them."""

    runs: tuple[str, ...]
    measure: Callable[[Runs], list[Claim]]


ROWS: dict[str, Row] = {}
"""Number -> row."""


def _row(number: str, *runs: str) -> Callable[[Callable[..., list[Claim]]], Any]:
    def add(function: Callable[[Runs], list[Claim]]) -> Callable[[Runs], list[Claim]]:
        ROWS[number] = Row(runs, function)
        return function

    return add


# --- runs ----------------------------------------------------------------------------------------

LENGTHS = paper.LENGTHS
T_END = 1.02
"""End of variations of the Fig. 1 scene, s: just after it slides as a whole."""
MU_S = (0.5, 0.6, 0.8, 0.9)
D_C = (0.0, 0.5e-6, 1e-6, 2e-6, 5e-6, 10e-6)
ETA = (0.15, 0.22, 0.42)  # over sqrt(k m); 0.316 is the default
K_F = (2.0, 5.0, 10.0)  # over k
SPEEDS_V = (0.5, 2.0)  # over V
H_2A = (2.5, 5.0, 7.5, 10.0, 12.5, 15.0)  # mm


def _name_2a(scene: Scene) -> str:
    return f"{scene.slider.L * 1e3:g}/{scene.driver.h * 1e3:g}/{scene.F_N:g}"


GRID = tuple(_name_2a(job.scene) for job in paper.FIG2A)
AT_2700 = {L: tuple(f"{L}/{h:g}/2700" for h in H_2A) for L in (140, 200)}
BASE = "140/5/3500"
"""The Fig. 1 scene among the runs of Fig. 2(a)."""
SETUP2 = ("setup2-", "setup2", "setup2+")
FRONTS = ("fig4a", "run1", "run2", "run3", "run4")


@functools.cache
def jobs() -> dict[str, Job]:
    """Return all runs behind the claims by name."""
    fig1 = preset("fig1")
    unit = math.sqrt(fig1.slider.k * fig1.m)

    def fig(t_end: float = T_END, **changes: Any) -> Job:
        return Job(scene=preset("fig1", **changes), t_end=t_end, options=LENGTHS)

    found = {"fig1": paper.FIG1, "fig4a": paper.FIG4A}
    found |= dict(zip(GRID, paper.FIG2A, strict=True))
    found |= {job.scene.name: job for job in (*paper.FIG2B, *paper.FIG4B)}
    finite = LENGTHS | {"geometry": "finite"}
    for F_N in (1750.0, 2700.0):
        job = Job(scene=preset("fig1", F_N=F_N), t_end=0.95 * F_N / 3500, options=finite)
        found[f"F_N {F_N:g}"] = job
    found |= {f"mu_s {mu_s:g}": fig(mu_s=mu_s) for mu_s in MU_S}
    found |= {f"d_c {d_c * 1e6:g}": fig(0.92, d_c=d_c) for d_c in D_C}
    found |= {f"eta {share:g}": fig(0.92, eta=share * unit) for share in ETA}
    found |= {f"k_f {share:g}": fig(0.92, k_f=share * fig1.slider.k) for share in K_F}
    V = fig1.driver.V
    found |= {f"V {share:g}": fig(T_END / share, V=share * V) for share in SPEEDS_V}
    found["chain"] = Job(scene=preset("chain"), t_end=0.55, options={"fidelity": "hybrid"})
    return found


# --- parts of measurements -----------------------------------------------------------------------


def _growing(record: Record) -> pd.DataFrame:
    """Precursors of the first loading that reach further than all before."""
    table = analysis.precursor_lengths(record)
    before = table["L_p_over_L"].cummax().shift(fill_value=0.0)
    return table[table["L_p_over_L"] > before].reset_index(drop=True)


def _force_step(table: pd.DataFrame) -> float:
    """Mean step of the force between precursors, over F_N; NaN with fewer than two."""
    force = table["force"].to_numpy()
    return float((force[-1] - force[0]) / (len(force) - 1)) if len(force) > 1 else np.nan


def _force_at(table: pd.DataFrame, lengths: Iterable[float]) -> np.ndarray:
    """Force at given L_p/L, between precursors by interpolation; NaN outside."""
    L_p, force = table["L_p_over_L"].to_numpy(), table["force"].to_numpy()
    return np.interp(list(lengths), L_p, force, left=np.nan, right=np.nan)


def _apart(table: pd.DataFrame, reference: pd.DataFrame) -> np.ndarray:
    """Force of each precursor minus that of the reference at equal length, over F_N."""
    there = _force_at(reference, table["L_p_over_L"])
    return (table["force"].to_numpy() - there)[np.isfinite(there)]


def _blocks(record: Record, event: int) -> int:
    """L_p in blocks."""
    return round(record.events["L_p_over_L"].iloc[event] * record.scene.N_x)


def _arrested(record: Record, event: int) -> pd.DataFrame:
    """Profile after a precursor over its slipped, closed blocks, tip block excluded."""
    table = analysis.stress_profile(record, event, "after")
    return table[(table["n"] < _blocks(record, event)) & (table["p"] > 0)]


def _left(record: Record, column: str = "scaled") -> np.ndarray:
    """What the precursors of the first loading leave, all together; NaN where there are none."""
    events = analysis.precursor_lengths(record)["event"]
    left = [_arrested(record, event)[column].to_numpy() for event in events]
    return np.concatenate(left) if left else np.array([np.nan])


def _prediction_error(record: Record) -> np.ndarray:
    """Force after each precursor minus that at which its last block slips with mu_s = mu_k."""
    curve = prediction_curve(record.scene).curve
    L_p, F_T = curve["L_p_over_L"].to_numpy(), curve["F_T"].to_numpy() / record.scene.F_N
    table = _growing(record)
    at = np.searchsorted(L_p, table["L_p_over_L"].to_numpy() - 0.5 / record.scene.N_x)
    return table["force"].to_numpy()[at < L_p.size] - F_T[at[at < L_p.size]]


def _straight(table: pd.DataFrame, N_x: int) -> float:
    """RMS distance in blocks of the lengths from a straight line over the force."""
    force, L_p = table["force"].to_numpy(), table["L_p_over_L"].to_numpy()
    return _rms(L_p - np.polyval(np.polyfit(force, L_p, 1), force)) * N_x


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _exponent(x: Iterable[float], y: Iterable[float]) -> float:
    """Slope of ln y over ln x."""
    return float(np.polyfit(np.log(list(x)), np.log(list(y)), 1)[0])


def _each(record: Record, below: float = 1.0) -> pd.DataFrame:
    table = _growing(record)
    return table[table["L_p_over_L"] < below]


WORDS = "the paper's words"


# --- loading curve and lengths -------------------------------------------------------------------


@_row("1", "fig1")
def _claim_1(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    table = analysis.precursors(record)
    table = table[table["event"].isin(analysis.precursor_lengths(record)["event"])]
    part = functools.partial(Claim, source=WORDS)
    drops = table["force_start"] - table["force_arrest"]
    return [
        part(
            number="1a",
            text="at least 11 precursors before sliding",
            value=float(len(table)),
            low=11.0,
            how="main events with 0 < L_p < L before the first event over the whole interface",
        ),
        part(
            number="1b",
            text="all of them nucleate at the trailing edge",
            value=float(table["at_trailing_edge"].mean()),
            low=1.0,
            how="share with first slip at x <= h + l",
        ),
        part(
            number="1c",
            text="their lengths increase",
            value=float(np.diff(table["L_p_over_L"]).min() * record.scene.N_x),
            unit="blocks",
            low=1.0,
            how="smallest step of L_p from one precursor to the next",
        ),
        part(
            number="1d",
            text="the force drops at each of them",
            value=float((drops > 0).mean()),
            low=1.0,
            how="share of precursors with a static force at last stick below that at first slip; "
            f"the drops are {drops.min():.4f} to {drops.max():.4f} F_N",
        ),
    ]


@_row("2", *GRID, "F_N 1750", "F_N 2700", "fig1")
def _claim_2(runs: Runs) -> list[Claim]:
    tables = [_growing(runs[name]) for name in GRID]
    both = pd.concat(tables, ignore_index=True)
    spread = analysis.collapse_spread(both["L_p_over_L"], both["force"], log=False)
    step = float(np.mean([_force_step(table) for table in tables]))
    low, high = both[both["L_p_over_L"] < 0.5], both[both["L_p_over_L"] >= 0.5]
    slopes = [np.polyfit(one["force"], one["L_p_over_L"], 1)[0] for one in (low, high)]
    bent = [  # distance in blocks, scene
        (_straight(_each(runs[name], 0.5), runs[name].scene.N_x), name)
        for name in GRID
        if len(_each(runs[name], 0.5)) > 2
    ]
    base = _growing(runs["fig1"])
    loads = [np.abs(_apart(_growing(runs[f"F_N {F_N}"]), base)) for F_N in (1750, 2700)]
    half = "half a step between precursors, which the curve is made of; the paper has no number"
    return [
        Claim(
            number="2a",
            text="length against force is one curve for all L, h and F_N",
            value=spread.rms / step,
            unit="steps",
            high=0.5,
            how=f"RMS of F_T/F_N about its median in bins of L_p/L ({spread.rms:.4f}) over the "
            f"mean step between precursors ({step:.4f}); {spread.n} precursors, {len(GRID)} scenes",
            source=half,
        ),
        Claim(
            number="2b",
            text="the same with F_N alone, in finite geometry",
            value=float(np.concatenate(loads).max() / _force_step(base)),
            unit="steps",
            high=0.5,
            how="largest distance in force, at equal length, of the Fig. 1 scene at 1750 and "
            "2700 N from 3500 N",
            source=half,
        ),
        Claim(
            number="2c",
            text="near linear up to half the length",
            value=max(bent)[0],
            unit="blocks",
            high=1.0,
            how="RMS distance of L_p < L/2 from a straight line over the force, worst scene "
            f"({max(bent)[1]}, as L (mm)/h (mm)/F_N (N)), of {len(bent)}; in the middle "
            f"{sorted(bent)[len(bent) // 2][0]:.2f}",
            source="resolution: lengths are whole blocks",
        ),
        Claim(
            number="2d",
            text="faster beyond half the length",
            value=float(slopes[1] / slopes[0]),
            low=1.0,
            how=f"slope dL_p/dF_T above L/2 ({slopes[1]:.2f} L/F_N) over that below "
            f"({slopes[0]:.2f} L/F_N), all scenes",
            source=WORDS,
        ),
    ]


@_row("3", *GRID)
def _claim_3(runs: Runs) -> list[Claim]:
    found: dict[str, list[float]] = {"L_p": [], "F_T": []}
    for L in (140, 200):
        h, steps = [], []
        for name in AT_2700[L][:3]:
            table, scene = _each(runs[name], 0.5), runs[name].scene
            span = table["L_p_over_L"].iloc[-1] - table["L_p_over_L"].iloc[0]
            h.append(scene.driver.h)
            steps.append((span / (len(table) - 1), _force_step(table)))
        for i, name in enumerate(found):
            found[name].append(_exponent(h, [step[i] for step in steps]))
    counts = np.array([[len(_growing(runs[name])) for name in AT_2700[L]] for L in (140, 200)])
    note = (
        "steps grow with h, but slower than h. A finer lattice does not mend that: with "
        "l = 1.25 mm the steps at L = 140 mm are 4.0, 5.5, 5.3 mm instead of 4.5, 6.3, 7.4 mm"
    )
    return [
        *(
            Claim(
                number=number,
                text=f"steps of {name} between precursors are almost linear in h, for small h",
                value=float(np.mean(found[name])),
                low=0.75,
                high=1.25,
                how="exponent of the mean step below L/2 over h = 2.5, 5, 7.5 mm; "
                f"L = 140 mm: {found[name][0]:.3f}, 200 mm: {found[name][1]:.3f}",
                source="linear is 1; almost, read as nearer to 1 than to 1/2 or 3/2",
                note=note,
            )
            for number, name in (("3a", "L_p"), ("3b", "F_T"))
        ),
        Claim(
            number="3c",
            text="larger L gives more precursors",
            value=float((counts[1] - counts[0]).min()),
            low=1.0,
            how="smallest difference of their numbers between L = 200 and 140 mm, of six h: "
            f"{counts[1].tolist()} and {counts[0].tolist()}",
            source=WORDS,
        ),
        Claim(
            number="3d",
            text="smaller h gives more precursors",
            value=float((counts[:, :3] - counts[:, 1:4]).min()),
            low=1.0,
            how="smallest difference of their numbers between h = 2.5, 5, 7.5, 10 mm and the next",
            source=WORDS,
            note="beyond h = 10 mm their number no longer falls",
        ),
    ]


@_row("4", *SETUP2)
def _claim_4(runs: Runs) -> list[Claim]:
    lengths = np.arange(0.1, 1.0, 0.1)
    minus, zero, plus = (_force_at(_growing(runs[name]), lengths) for name in SETUP2)
    gaps = np.array([minus - zero, zero - plus])
    text = "less load on the trailing edge, less force for the same length: "
    how = "smallest distance between neighbouring curves, theta = 0.833, 0, -0.833, at L_p/L = 0.1"
    return [
        Claim(
            number="4a",
            text=text + "order of the three curves",
            value=float(np.nanmin(gaps)),
            unit="F_N",
            low=0.0,
            how=f"{how}, 0.2 ... as far as they go ({np.isfinite(gaps).sum()} distances)",
            source=WORDS,
            note="the curves meet at L_p = L, where the force is about mu_k F_N",
        ),
        Claim(
            number="4b",
            text=text + "the curves are apart",
            value=float(np.nanmin(gaps[:, lengths < 0.55])),
            unit="F_N",
            low=0.02,
            how=f"{how} ... 0.5",
            source="the accepted error of these runs; the paper has no number",
        ),
    ]


@_row("5", "fig1", *GRID, *SETUP2, *(f"V {share:g}" for share in SPEEDS_V))
def _claim_5(runs: Runs) -> list[Claim]:
    source = (
        "half a step: the curve belongs to a precursor if it is nearer to it than to the next one; "
        "the paper has no number"
    )

    def part(number: str, what: str, names: Iterable[str]) -> Claim:
        names = list(names)
        errors = [_prediction_error(runs[name]) for name in names]
        steps = [_force_step(_growing(runs[name])) for name in names]
        every = np.concatenate(errors)
        shares = [_rms(error) / step for error, step in zip(errors, steps, strict=True)]
        return Claim(
            number=number,
            text=f"with mu_s = mu_k, equilibrium gives the lengths at arrest: {what}",
            value=max(shares),
            unit="steps",
            high=0.5,
            how="RMS of F_arrest - F_pred(n) over the mean step between precursors, worst of "
            f"{len(names)} scenes ({names[int(np.argmax(shares))]}); the Fig. 1 scene or the first "
            f"one {shares[0]:.3f}; over F_N, all together: RMS {_rms(every):.4f}, largest "
            f"{np.abs(every).max():.4f}",
            source=source,
        )

    base = _growing(runs[BASE])
    speed = [np.abs(_apart(_growing(runs[f"V {share:g}"]), base)) for share in SPEEDS_V]
    return [
        part("5a", "setup 1", ["fig1", *GRID]),
        part("5b", "setup 2", SETUP2),
        Claim(
            number="5c",
            text="whatever the driving speed",
            value=float(np.concatenate(speed).max() / _force_step(base)),
            unit="steps",
            high=0.5,
            how="largest distance in force, at equal length, of V/2 and 2 V from V; the prediction "
            "has no V",
            source=source,
        ),
    ]


@_row("6", "chain", "fig1")
def _claim_6(runs: Runs) -> list[Claim]:
    one, two = (_straight(_growing(runs[name]), runs[name].scene.N_x) for name in ("chain", "fig1"))
    curve = prediction_curve(runs["chain"].scene).curve
    table = curve.rename(columns={"F_T": "force"}).iloc[1:]
    exact = _straight(table, runs["chain"].scene.N_x)
    return [
        Claim(
            number="6a",
            text="one dimension, homogeneous load: length is linear in force",
            value=one,
            unit="blocks",
            high=1.0,
            how="RMS distance of the lengths from a straight line over the force, 57 blocks; the "
            f"prediction curve: {exact:.1e}",
            source="resolution: lengths are whole blocks",
        ),
        Claim(
            number="6b",
            text="two dimensions: it is not",
            value=two / one,
            low=1.0,
            how=f"the same distance in the Fig. 1 scene ({two:.2f} blocks) over that of the chain",
            source=WORDS,
        ),
    ]


# --- stresses ------------------------------------------------------------------------------------


def _decay_length(record: Record) -> float:
    """Distance over which loading's tau falls to 1/e behind its peak, over h."""
    scene = record.scene
    rise = analysis.stress_profile(record, 0)["tau"] - analysis.stress_profile(record)["tau"]
    rise = rise.to_numpy() / rise.max()
    peak = int(rise.argmax())
    i = peak + int(np.argmax(rise[peak:] < 1 / np.e))
    blocks = i - (1 / np.e - rise[i]) / (rise[i - 1] - rise[i]) - peak
    return blocks * scene.slider.l / scene.driver.h


@_row("7", "fig1", *AT_2700[140], *AT_2700[200])
def _claim_7(runs: Runs) -> list[Claim]:
    start = analysis.stress_profile(runs["fig1"])
    lengths = [_decay_length(runs[name]) for L in AT_2700 for name in AT_2700[L]]
    worst = max(lengths, key=lambda x: abs(math.log(x)))
    rounding = "1e-9: the rounding at which static states are accepted"
    return [
        Claim(
            number=number,
            text=f"at F_T = 0, {name} is {what}",
            value=float(np.abs(start[name] + sign * start[name].to_numpy()[::-1]).max()),
            unit="F_N/N_x",
            high=1e-9,
            how=f"largest |{name}(n) {'+' if sign > 0 else '-'} {name}(N_x + 1 - n)|",
            source=rounding,
        )
        for number, name, what, sign in (
            ("7a", "p", "symmetric", -1),
            ("7b", "tau", "antisymmetric", 1),
        )
    ] + [
        Claim(
            number="7c",
            text="loading raises tau near the trailing edge over a distance of about h",
            value=worst,
            unit="h",
            low=0.5,
            high=2.0,
            how="distance from the peak of the rise before the first slip to 1/e of it, the one "
            f"furthest from h of 12 scenes ({min(lengths):.2f} to {max(lengths):.2f} h, h = 2.5 to "
            "15 mm)",
            source="about, read as within a factor of two",
        )
    ]


TENTH = "a tenth of mu_s - mu_k, our reading of 'about': the paper has no number"


@_row("8", "fig1")
def _claim_8(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    events = analysis.precursor_lengths(record)["event"].to_numpy()
    left = [_arrested(record, event)["scaled"].to_numpy() for event in events]
    each, but_last = [_rms(one) for one in left], _rms(np.concatenate(left[:-1] or [[np.nan]]))
    return [
        Claim(
            number="8",
            text="a precursor leaves tau = mu_k p behind it",
            value=_rms(_left(record)),
            unit="mu_s - mu_k",
            high=0.1,
            how="RMS of (tau/p - mu_k)/(mu_s - mu_k) after arrest over the slipped, closed blocks "
            f"of {len(events)} precursors, tip block left out; one by one: "
            + ", ".join(f"{one:.3f}" for one in each),
            source=TENTH,
            note=f"without the last precursor {but_last:.3f}; the last one "
            "nearly spans the interface and leaves blocks above and below mu_k p. Of the first 11 "
            "together it is 0.075 here, 0.085 at a fifth of the step, 0.082 in linear geometry",
        )
    ]


@_row("9", BASE, *(f"mu_s {mu_s:g}" for mu_s in MU_S), *(f"d_c {d_c * 1e6:g}" for d_c in D_C))
def _claim_9(runs: Runs) -> list[Claim]:
    base = runs[BASE]
    by_mu_s = {base.scene.interface.mu_s: base} | {mu_s: runs[f"mu_s {mu_s:g}"] for mu_s in MU_S}
    mean, spread, apart = {}, {}, {}
    for mu_s, record in sorted(by_mu_s.items()):
        ratio = _left(record, "tau_over_p") - record.scene.interface.mu_k
        mean[mu_s], spread[mu_s] = float(np.mean(ratio)), _rms(ratio)
        apart[mu_s] = float(np.mean(_prediction_error(record)))
    slope = np.polyfit(list(mean), list(mean.values()), 1)[0]
    shift = np.polyfit(list(apart), list(apart.values()), 1)[0]
    weak = {d_c: _rms(_left(runs[f"d_c {d_c * 1e6:g}"])) for d_c in D_C}
    first = {d_c: len(_growing(runs[f"d_c {d_c * 1e6:g}"])) for d_c in D_C}
    small = max(value for d_c, value in weak.items() if 0 < d_c <= 2e-6)
    without = weak[0.0]
    listed = ", ".join(f"{d_c * 1e6:g}: {value:.3f} ({first[d_c]})" for d_c, value in weak.items())
    return [
        Claim(
            number="9a",
            text="the state at arrest depends only weakly on mu_s: tau/p",
            value=float(abs(slope)),
            high=0.1,
            how="slope over mu_s = 0.5 ... 0.9 of the mean tau/p that precursors leave; its RMS "
            "distance from mu_k is "
            + ", ".join(f"{value:.3f} at {mu_s:g}" for mu_s, value in spread.items()),
            source="0 is no dependence, 1 is tau = mu_s p; a tenth: the paper has no number",
        ),
        Claim(
            number="9b",
            text="the state at arrest depends only weakly on mu_s: force at equal length",
            value=float(abs(shift)),
            high=0.1,
            how="slope over mu_s of the mean F_arrest - F_pred(n), over F_N: "
            + ", ".join(f"{value:.4f} at {mu_s:g}" for mu_s, value in apart.items()),
            source="0 is no dependence, 1 is F_T = mu_s F_N; a tenth: the paper has no number",
        ),
        Claim(
            number="9c",
            text="it holds with slip weakening over less than a few um",
            value=small,
            unit="mu_s - mu_k",
            high=0.1,
            how="claim 8's RMS, worst of d_c = 0.5, 1, 2 um; at d_c in um (with the number of "
            f"precursors): {listed}",
            source=TENTH,
            note=f"without weakening it is {without:.3f} in these runs (linear geometry), because "
            "of the last precursor, as in claim 8. From about 5 um on, slip grows stably at the "
            "driver's pace before it breaks out, and at 10 um no event has ended by 0.92 s",
        ),
        Claim(
            number="9d",
            text="and is no further from mu_k p than without weakening",
            value=small / without,
            high=1.1,
            how="the same, over that at d_c = 0",
            source="1 is as far as without; a tenth more: the paper has no number",
        ),
    ]


@_row("10", "fig1", BASE, *(f"mu_s {mu_s:g}" for mu_s in MU_S))
def _claim_10(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    last = analysis.precursor_lengths(record).iloc[-1]
    friction = record.scene.interface
    left = (last["force"] - friction.mu_k) / (friction.mu_s - friction.mu_k)
    by_mu_s = {0.7: runs[BASE]} | {mu_s: runs[f"mu_s {mu_s:g}"] for mu_s in MU_S}
    found = {mu_s: _largest(one) for mu_s, one in sorted(by_mu_s.items())}
    R = {mu_s: (F_max - friction.mu_k) / (mu_s - friction.mu_k) for mu_s, F_max in found.items()}
    slope = np.polyfit(list(found), list(found.values()), 1)[0]
    listed = ", ".join(f"{value:.3f} at {mu_s:g}" for mu_s, value in R.items())
    long = analysis.friction_coefficients(record)
    return [
        Claim(
            number="10a",
            text="the last precursor nearly spans the interface",
            value=float(last["L_p_over_L"]),
            unit="L",
            low=0.9,
            how="largest L_p/L before the first event over the whole interface, Fig. 1 scene",
            source="nearly, read as nine tenths: the paper has no number",
        ),
        Claim(
            number="10b",
            text="it leaves a force of about mu_k F_N",
            value=float(left),
            unit="mu_s - mu_k",
            low=-0.1,
            high=0.1,
            how=f"(F_arrest/F_N - mu_k)/(mu_s - mu_k), F_arrest = {last['force']:.4f} F_N",
            source=TENTH,
        ),
        Claim(
            number="10c",
            text="the largest force is only slightly above mu_k F_N, whatever mu_s",
            value=max(R.values()),
            low=0.0,
            high=0.5,
            how="largest R = (F_max/F_N - mu_k)/(mu_s - mu_k) up to the first event over the "
            f"whole interface, over mu_s: {listed}; Fig. 1 scene up to 2 s: {long.R:.3f}",
            source="0 where mu_k sets the force, 1 where mu_s does; nearer to 0",
        ),
        Claim(
            number="10d",
            text="and hardly depends on mu_s",
            value=float(abs(slope)),
            high=0.1,
            how="slope of F_max/F_N over mu_s: "
            + ", ".join(f"{value:.4f} at {mu_s:g}" for mu_s, value in found.items()),
            source="0 is no dependence, 1 is F_max = mu_s F_N; a tenth: the paper has no number",
            note="an event has to nucleate at the trailing edge, where tau reaches mu_s p: the "
            "force at which the whole interface goes feels mu_s a little",
        ),
    ]


def _largest(record: Record) -> float:
    """Largest static force at the start of an event up to the first system-size event, over F_N."""
    sliding = analysis.system_size_events(record)["event"]
    if not len(sliding):
        return np.nan
    return float(record.events["F_T_start"].iloc[: sliding.iloc[0] + 1].max() / record.scene.F_N)


@_row("11", "fig1")
def _claim_11(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    scene = record.scene
    events = analysis.precursor_lengths(record)["event"].to_numpy()
    falls, ahead = [], []
    corner = scene.j_h + 2  # blocks at x <= h + l
    for event in events:
        table, reach = analysis.stress_profile(record, event, "after"), _blocks(record, event)
        ratio, n = table["p_over_p_initial"].to_numpy(), table["n"].to_numpy()
        behind = ratio[(n > corner) & (n < reach)]
        falls.append(1 - behind.min() if behind.size else 0.0)
        ahead.append(ratio[n > reach + scene.j_h] - 1)
    sliding = analysis.system_size_events(record)["event"]
    after = [analysis.stress_profile(record, e, "after")["p_over_p_initial"] for e in sliding]
    spread = np.nan
    if len(after) >= 4:
        spread = float(np.std(np.array(after)[:, corner:], axis=0).max())
    return [
        Claim(
            number="11a",
            text="p falls behind a precursor, by up to 30 %",
            value=float(max(falls)),
            low=0.25,
            high=0.35,
            how="largest 1 - p/p_initial after arrest over h + l < x < L_p, of all precursors; in "
            "order: " + ", ".join(f"{fall:.3f}" for fall in falls),
            source="30 % to the nearest ten per cent",
            note="the largest is that of the last precursor; the 11th, in the paper's Fig. 4(a), "
            f"has {falls[10]:.3f}"
            if len(falls) > 10
            else "",
        ),
        Claim(
            number="11b",
            text="p is unchanged ahead of it",
            value=_rms(np.concatenate(ahead)),
            high=0.1,
            how="RMS of p/p_initial - 1 over x > L_p + h, all precursors; in order: "
            + ", ".join(f"{_rms(one):.3f}" for one in ahead),
            source="a third of the 30 % behind: the paper has no number",
            note="p rises towards the leading edge, which takes up the moment F_T h: most after "
            "the last precursors",
        ),
        Claim(
            number="11c",
            text="p(x) is reproducible between events over the whole interface",
            value=spread,
            high=0.03,
            how=f"largest standard deviation of p/p_initial at x > h + l just after {len(sliding)} "
            "such events",
            source="a tenth of the 30 %: the paper has no number",
        ),
    ]


# --- fronts --------------------------------------------------------------------------------------


def _shear_speed(scene: Scene) -> float:
    return float(scene.slider.l * np.sqrt(scene.slider.k / (2 * scene.m)))


@_row("12", "fig4a")
def _claim_12(runs: Runs) -> list[Claim]:
    record = runs["fig4a"]
    table = analysis.front(record, int(analysis.precursors(record)["event"].iloc[10]))
    speed = table["v_c"].dropna()
    step = record.method.dt * 1e6
    how = f"v_c of the 11th main precursor, Fig. 1 scene, steps of {step:g} us: "
    return [
        Claim(
            number="12a",
            text="fronts start at about 2400 m/s near the trailing edge",
            value=float(speed[table["x_over_L"] < 0.25].max()),
            unit="m/s",
            low=2264.0,
            high=2536.0,
            how=how + "largest at x < L/4",
            source="2400 m/s, give or take half the range over steps of 0.4, 0.2, 0.1, 0.05 us: "
            "2297, 2478, 2521, 2570 m/s",
            note="the paper's step is 0.2 us; with smaller steps the speed goes on rising",
        ),
        Claim(
            number="12b",
            text="and come down to about 400 m/s before arrest",
            value=float(speed.iloc[-1]),
            unit="m/s",
            low=332.0,
            high=468.0,
            how=how + "the last one",
            source="400 m/s, give or take half the range over steps of 0.4 to 0.05 us in finite "
            "and linear geometry: 350 to 486 m/s",
        ),
        Claim(
            number="12c",
            text="following tau/p",
            value=float(table["v_c"].corr(table["tau_over_p"], method="spearman")),
            low=0.5,
            how="rank correlation of v_c with tau/p at initiation, block by block",
            source="1 is exact, 0 is none; nearer to 1",
        ),
    ]


@_row("13", *FRONTS)
def _claim_13(runs: Runs) -> list[Claim]:
    every = []
    for name in FRONTS:
        friction = runs[name].scene.interface
        table = analysis.fronts(runs[name])
        every.append(table.assign(pair=f"{friction.mu_s:g}/{friction.mu_k:g}", run=name))
    table = pd.concat(every, ignore_index=True)

    def spread(rows: pd.DataFrame, axis: str) -> analysis.Collapse:
        return analysis.collapse_spread(rows[axis], rows["v_c"])

    def within(by: str) -> tuple[float, str]:
        parts = {name: spread(rows, "tau_over_p") for name, rows in table.groupby(by)}
        n = sum(part.n for part in parts.values())
        rms = math.sqrt(sum(part.n * part.rms**2 for part in parts.values()) / n)
        return rms, ", ".join(f"{name}: {part.rms:.3f}" for name, part in parts.items())

    pairs, listed = within("pair")
    single, listed_runs = within("run")
    one, scaled = spread(table, "tau_over_p"), spread(table, "scaled")
    return [
        Claim(
            number="13a",
            text="v_c against tau/p is one curve per friction pair, for all events and geometries",
            value=pairs / single,
            high=1.1,
            how=f"RMS of ln v_c about a binned median, one for each pair ({pairs:.3f}; {listed}), "
            f"over that with one for each run ({single:.3f}; {listed_runs}); {one.n} points",
            source="1 if geometry does not matter; a tenth more: the paper has no number",
        ),
        Claim(
            number="13b",
            text="against tau/p, the pairs have different curves",
            value=one.rms / pairs,
            low=1.1,
            how=f"RMS about one median for all ({one.rms:.3f}) over that with one for each pair",
            source="as in 13a",
        ),
        Claim(
            number="13c",
            text="against the scaled prestress, all fall on one curve",
            value=scaled.rms / pairs,
            high=1.1,
            how=f"RMS about one median for all against (tau/p - mu_k)/(mu_s - mu_k) "
            f"({scaled.rms:.3f}) over that with one for each pair",
            source="as in 13a",
        ),
    ]


@_row("14")
def _claim_14(runs: Runs) -> list[Claim]:
    scene = preset("fig1")
    q = np.array([1e-3 / scene.slider.l, 0.0])
    N_x, N_z = scene.N_x, scene.N_z
    factor = math.sqrt((N_x - 1) * (N_z - 1) / (N_x * N_z))
    shear, long = dispersion(scene, q)[0] / q[0]
    return [
        Claim(
            number=number,
            text=f"{name} waves travel at {expected} m/s",
            value=float(speed * factor),
            unit="m/s",
            low=expected - 0.5,
            high=expected + 0.5,
            how=f"plane wave of 2 pi 1000 l in the lattice: {speed:.1f} m/s with m = M/N, times "
            f"sqrt((N_x-1)(N_z-1)/(N_x N_z)) = {factor:.4f} for the mass per area",
            source="the paper's digits",
        )
        for number, name, speed, expected in (
            ("14a", "longitudinal", long, 1677),
            ("14b", "shear", shear, 968),
        )
    ]


@_row("15", BASE, *(f"eta {share:g}" for share in ETA), *(f"k_f {share:g}" for share in K_F))
def _claim_15(runs: Runs) -> list[Claim]:
    base = _growing(runs[BASE])
    changed = [*(f"eta {share:g}" for share in ETA), *(f"k_f {share:g}" for share in K_F)]

    def part(number: str, text: str, names: list[str], more: str) -> Claim:
        apart = {name: np.abs(_apart(_growing(runs[name]), base)) for name in names}
        listed = ", ".join(
            f"{name}: {d.max():.4f} F_N ({len(_growing(runs[name]))})" for name, d in apart.items()
        )
        return Claim(
            number=number,
            text=text,
            value=float(max(d.max() for d in apart.values()) / _force_step(base)),
            unit="steps",
            high=0.5,
            how="largest distance in force, at equal length, from the default, over the mean step "
            f"between precursors; with their number, {len(base)} at the default: {listed}{more}",
            source="half a step between precursors: the paper says similar, without a number",
        )

    waits = []
    for share in ETA:
        record = runs[f"eta {share:g}"]
        interval = float(np.median(np.diff(analysis.precursors(record)["t_start"])))
        waits.append(f"{decay_times(record.scene).slow / interval:.2f}")
    return [
        part(
            "15a",
            "any viscosity with underdamped blocks and calm between events gives similar results",
            changed[: len(ETA)],
            f"; eta in sqrt(k m), below 0.433; slowest decay over the interval: "
            f"{', '.join(waits)}, below 0.25",
        ),
        part(
            "15b",
            "any foundation stiffer than the bonds gives similar results",
            changed[len(ETA) :],
            "; k_f in k",
        ),
        Claim(
            number="15c",
            text="viscosity and foundation leave the number of precursors",
            value=float(max(abs(len(_growing(runs[name])) - len(base)) for name in changed)),
            unit="precursors",
            high=1.0,
            how=f"largest difference from {len(base)}, of all these runs; by viscosity alone "
            f"{max(abs(len(_growing(runs[name])) - len(base)) for name in changed[: len(ETA)])}",
            source="one more or less may end before sliding; the paper says similar",
            note="on a stiffer foundation precursors follow the same curve in longer steps",
        ),
    ]


@_row("16", *FRONTS)
def _claim_16(runs: Runs) -> list[Claim]:
    slowest = {
        name: float(analysis.fronts(runs[name])["v_c"].min() / _shear_speed(runs[name].scene))
        for name in FRONTS
    }
    return [
        Claim(
            number="16",
            text="no very slow fronts with Amontons-Coulomb friction",
            value=min(slowest.values()),
            unit="c_s",
            low=0.05,
            how="smallest v_c within the fronts of all main events: "
            + ", ".join(f"{name}: {value:.3f}" for name, value in slowest.items()),
            source="slow fronts are those below 0.05 c_s; fronts are followed down to 0.025 c_s",
        )
    ]


# --- exact checks --------------------------------------------------------------------------------


def _small(**changes: Any) -> Scene:
    """A small setup 1 that slips after about a millisecond."""
    return setup1(**{"L": 0.02, "H": 0.0125, "V": 0.5} | changes)


def _exact(number: str, text: str, value: float, high: float, how: str, source: str) -> Claim:
    return Claim(number=number, text=text, value=float(value), high=high, how=how, source=source)


@_row("E1")
def _check_elasticity(runs: Runs) -> list[Claim]:
    """A strip between rollers, pulled along z."""
    scene = setup2(L=8e-3, H=64e-3)
    N_x, N_z, l, k = scene.N_x, scene.N_z, scene.slider.l, scene.slider.k
    dof = np.arange(2 * N_x * N_z).reshape(N_z, 2, N_x)
    u, given = np.zeros(dof.shape), np.zeros(dof.shape, dtype=bool)
    u[-1, 1] = 1e-3 * l
    given[0, 1] = given[-1, 1] = given[0, 0, N_x // 2] = True
    K = spring_stiffness(bonds(scene)).tocsc()
    inner, outer, flat = dof[~given], dof[given], u.reshape(-1)
    flat[inner] = spsolve(K[np.ix_(inner, inner)], -K[np.ix_(inner, outer)] @ flat[outer])
    middle = N_z // 2
    along = float(np.mean(u[middle + 1, 1] - u[middle - 1, 1]) / (2 * l))
    across = float((u[middle, 0, -1] - u[middle, 0, 0]) / ((N_x - 1) * l))
    force = float((K @ flat)[dof[-1, 1]].sum())
    EB = (force / along - k * l) / ((N_x - 1) * l)
    how = "strip of 9 x 65 blocks pulled between rollers, "
    source = "exact; 1e-5 is what its ends leave in the middle of the strip"
    return [
        _exact(
            "E1a",
            "Young's modulus E B = 4 k/3",
            abs(EB / (4 * k / 3) - 1),
            1e-5,
            how + "less the share of its edge springs, k l: relative error",
            source,
        ),
        _exact(
            "E1b",
            "Poisson's ratio 1/3",
            abs(-across / along - 1 / 3),
            1e-5,
            how + "error",
            source,
        ),
    ]


@_row("E2", "fig1")
def _check_load(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    done = record.events["finished"].to_numpy(dtype=bool)
    p = np.concatenate([[record.p_initial], record.p_before[done], record.p_after[done]])
    F_T = [[0.0], *(record.events[f"F_T_{at}"][done] for at in ("start", "arrest"))]
    tau = np.concatenate([[record.tau_initial], record.tau_before[done], record.tau_after[done]])
    F_N = record.scene.F_N
    how = f"largest error over F_N in {len(p)} static states of the Fig. 1 scene"
    source = "1e-9: the residual of the static solver, over F_N/N_x"
    return [
        _exact("E2a", "sum of p = F_N", np.abs(p.sum(axis=1) / F_N - 1).max(), 1e-9, how, source),
        _exact(
            "E2b",
            "sum of tau = F_T",
            np.abs(tau.sum(axis=1) - np.concatenate(F_T)).max() / F_N,
            1e-9,
            how,
            source,
        ),
    ]


@_row("E3")
def _check_momentum(runs: Runs) -> list[Claim]:
    scene = setup2(L=0.012, H=0.005, theta=0.5, V=0.3)
    worst = 0.0
    for geometry in ("linear", "finite"):
        state = _shaken(scene, geometry, 1e-7)
        forces = core.evaluate(core.model(scene, geometry, state.u_drv0), state, state.t)
        outer = [scene.d * forces.F_T + forces.f.sum(), forces.p.sum() - scene.F_N]
        change = scene.m * forces.a.sum(axis=(0, 2))
        size = scene.m * np.abs(forces.a).sum()
        worst = max(worst, float(np.abs(change - outer).max() / size))
    return [
        _exact(
            "E3",
            "momentum changes by the outer forces alone",
            worst,
            1e-12,
            "error of sum(m a) over sum |m a|, a shaken slider, both geometries",
            "rounding",
        )
    ]


def _shaken(scene: Scene, geometry: str, dt: float) -> State:
    """The loaded state with random velocities, the same every time."""
    state = State.at_rest(scene, loaded_state(scene, geometry), dt)
    noise = np.random.default_rng(0).standard_normal((scene.N_z, 2, scene.N_x))
    state.y[:, 2:] = 1e-7 / stability_limit(scene)[0] * noise
    state.y[0, 2] = 0.0
    if scene.rigid:
        state.y[-1, 2:] = 0.0
    return state


@_row("E4")
def _check_energy(runs: Runs) -> list[Claim]:
    scene, errors = _small(), []
    for share in (0.5, 0.125):
        dt = share * stability_limit(scene)[0]
        how = {"fidelity": "dynamic", "geometry": "finite", "dt": dt, "budget": True}
        curve = simulate(scene, 3e-3, progress=False, **how).curve
        stored = curve[list(core.ENERGIES)].sum(axis=1)
        given = curve[["work_driver", "work_load"]].sum(axis=1)
        lost = curve[["dissipated_bonds", "friction_heat", "switching_loss"]].sum(axis=1)
        error = (stored - stored.iloc[0]) - given + lost
        errors.append(float(np.abs(error).max() / np.abs(curve["work_driver"].iloc[-1])))
    return [
        _exact(
            "E4",
            "the energy budget closes",
            errors[-1],
            1e-6,
            "work of driver and load less stored energy, dissipation in bonds, friction heat and "
            "switching loss, over the driver's work; 3 ms with slip, an eighth of the largest step",
            f"it falls with the step: {errors[0]:.1e} at four times the step",
        )
    ]


@_row("E5")
def _check_mirror(runs: Runs) -> list[Claim]:
    ends, switches = [], 0
    for side in ("left", "right"):
        scene = _small(side=side)
        state = State.at_rest(_small(), loaded_state(_small(), "finite"), 2e-7)
        if side == "right":
            state = _mirrored(state)
        log = core.Log(scene.N_x)
        core.advance(core.model(scene, "finite", state.u_drv0), state, log, 15_000)
        switches += log.n_switch
        ends.append(_mirrored(state) if side == "right" else state)
    differ = sum(int((getattr(ends[0], a) != getattr(ends[1], a)).sum()) for a in ("y", "mode"))
    return [
        _exact(
            "E5",
            "driven from the right, a slider does the mirror image",
            differ if switches else np.nan,
            0,
            f"numbers with other bits after 15000 steps from mirrored states, {switches} switches",
            "exact",
        )
    ]


def _mirrored(state: State) -> State:
    image = state.copy()
    image.y = np.ascontiguousarray(state.y[:, :, ::-1] * np.array([[-1.0], [1.0], [-1.0], [1.0]]))
    image.rod = state.rod * np.array([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0])
    image.mode = np.ascontiguousarray(np.where(state.mode == OPEN, OPEN, -state.mode)[::-1])
    for name in ("corner", "slack", "loss", "heat", "s_0"):
        setattr(image, name, np.ascontiguousarray(getattr(state, name)[::-1]))
    image.u_drv0 = -state.u_drv0
    return image


@_row("E6")
def _check_order(runs: Runs) -> list[Claim]:
    scene, ends = setup1(L=0.02, H=0.0125, V=1e-3), []
    coarse = 0.2 * stability_limit(scene)[0]
    for halvings in range(4):
        state = _shaken(scene, "finite", coarse / 2**halvings)
        log = core.Log(scene.N_x)
        core.advance(core.model(scene, "finite", state.u_drv0), state, log, 40 * 2**halvings)
        if log.n_switch:
            raise RuntimeError("the order is that between switches, and something switched")
        ends.append(np.concatenate([state.y.ravel(), state.rod]))
    errors = [np.abs(end - ends[-1]).max() for end in ends[:2]]
    return [
        Claim(
            number="E6",
            text="the stepper is of order 4 while nothing switches",
            value=float(np.log2(errors[0] / errors[1])),
            low=3.75,
            high=4.25,
            how="log2 of the errors at steps dt and dt/2 against dt/8, shaken setup 1, finite "
            "geometry",
            source="4; the next order and the reference leave a quarter",
        )
    ]


@_row("E7")
def _check_stuck(runs: Runs) -> list[Claim]:
    scene, worst = preset("fig1"), 0.0
    for geometry in ("linear", "finite"):
        u_x, drive = loaded_state(scene, geometry).u[0, 0], 1e-4
        rest = solve_static(scene, u_x, drive, geometry=geometry)
        state = State.at_rest(scene, rest, 1e-7)
        t = drive / scene.driver.V
        forces = core.evaluate(core.model(scene, geometry, state.u_drv0), state, t)
        left = np.abs(forces.a).max() * scene.m / (scene.F_N / scene.N_x)
        worst = max(worst, float(left), abs(forces.F_T - rest.F_T) / scene.F_N)
    return [
        _exact(
            "E7",
            "a stuck slider is where the static solver puts it",
            worst,
            1e-9,
            "largest force left on a block in the core, over F_N/N_x, driver 0.1 mm on, both "
            "geometries",
            "the residual of the static solver",
        )
    ]


@_row("E8")
def _check_translation(runs: Runs) -> list[Claim]:
    scene = setup2(L=0.012, H=0.005)
    worst = 0.0
    for geometry in ("linear", "finite"):
        rest = loaded_state(scene, geometry)
        state = State.at_rest(scene, rest, 1e-7)
        state.y[:] = 0.0
        state.y[:, 0], state.y[:, 1] = 3 * scene.slider.l, 0.5 * scene.slider.l
        state.mode[:] = OPEN
        model = core.model(scene, geometry, 3 * scene.slider.l)
        forces = scene.m * core.evaluate(model, state, 0.0).a
        forces[-1, 1] += scene.load
        worst = max(worst, float(np.abs(forces).max() / (scene.slider.k * scene.slider.l)))
    return [
        _exact(
            "E8",
            "a rigid translation gives no force",
            worst,
            1e-15,
            "largest force over k l, moved by 3 l and lifted off, both geometries",
            "rounding",
        )
    ]


@_row("E9")
def _check_chain_fronts(runs: Runs) -> list[Claim]:
    taubar = 0.7
    error = _chain_front(taubar) * math.sqrt(1 - taubar**2) - 1
    return [
        _exact(
            "E9",
            "fronts in an undamped chain travel at c/sqrt(1 - taubar^2)",
            abs(error),
            1e-3,
            "relative error of the slope of block over rupture time, blocks 150 to 300, taubar = "
            f"{taubar:g}",
            "contacts switch at step ends: a thousandth of the time from block to block",
        )
    ]


def _chain_front(taubar: float) -> float:
    """Speed of a front over l sqrt(k/m), in a chain under uniform prestress taubar."""
    mu_s, mu_k, p, n, released = 0.7, 0.45, 10.0, 300, 20
    tau = p * (mu_k + taubar * (mu_s - mu_k))
    scene = chain(L=(n - 1) * 2.5e-3, p=p, tau=tau, eta=0.0, K=1e-3, V=0.0)
    unit, guess = math.sqrt(scene.m / scene.slider.k), 1 / math.sqrt(1 - taubar**2)
    state = State.at_rest(scene, loaded_state(scene), 0.97e-3 * unit / guess)
    state.mode[:released] = 1
    record = simulate(
        scene,
        1.05 * (n - released) * unit / guess,
        fidelity="dynamic",
        dt=state.dt,
        initial=state,
        budget=False,
        t_gap=1.0,
        progress=False,
    )
    times = record.rupture_times[0][n // 2 :]
    return float(np.polyfit(times, np.arange(n // 2, n), 1)[0] * unit)


@_row("E10")
def _check_homogeneity(runs: Runs) -> list[Claim]:
    how = {"fidelity": "dynamic", "geometry": "linear", "progress": False}
    one = simulate(_small(), 3e-3, **how)
    two = simulate(_small(F_N=7000.0, V=1.0), 3e-3, **how)
    differ = int((2 * one.final_state.y != two.final_state.y).sum())
    differ += int((2 * one.curve["F_T"] != two.curve["F_T"]).sum())
    return [
        _exact(
            "E10",
            "in linear geometry, twice the load and speed is twice the motion",
            differ,
            0,
            f"numbers with other bits in state and force after 3 ms, {len(one.events)} events",
            "exact",
        )
    ]


NUMBERS = tuple(sorted(ROWS, key=lambda number: (number[0] == "E", int(number.lstrip("E")))))
"""Numbers of the claims, in order."""


# --- all together --------------------------------------------------------------------------------


def measure(
    numbers: Iterable[str | int] | None = None,
    *,
    workers: int | None = None,
    cache: bool | str | os.PathLike[str] = True,
    progress: bool | Callable[[int, int], None] | None = None,
) -> list[Claim]:
    """Measure claims, with all the runs they need.

    Args:
        numbers: which claims, of `NUMBERS`; None means all.
        workers, cache, progress: as in `pyfric.sweep.run_all`.

    Returns:
        The claims, in order; a claim with several parts gives several.

    Raises:
        SceneError: there is no claim of that number.
        JobError: a run failed.
        KeyboardInterrupt: after Ctrl-C.
    """
    wanted = NUMBERS if numbers is None else [_known(number) for number in numbers]
    rows = {number: ROWS[number] for number in NUMBERS if number in wanted}
    names = list(dict.fromkeys(name for row in rows.values() for name in row.runs))
    found = run_all([jobs()[name] for name in names], workers, cache, progress)
    runs = dict(zip(names, found, strict=True))
    claims = []
    for row in rows.values():
        start = time.process_time()
        measured = row.measure(runs)
        seconds = time.process_time() - start
        seconds += sum(runs[name].timings["processor"] for name in row.runs)
        claims += [dataclasses.replace(claim, seconds=seconds) for claim in measured]
    return claims


def _known(number: str | int) -> str:
    text = str(number).upper()
    if text not in ROWS:
        allowed = f"1 to 16 or E1 to E10 (did you mean {nearest(text, NUMBERS)}?)"
        raise SceneError("number", number, "", allowed, "there is no such claim")
    return text


def report(claims: Iterable[Claim]) -> str:
    """Return the table of the claims as text: two lines each, and why those that miss do."""
    claims = list(claims)
    lines = []
    for claim in claims:
        value = f"{claim.value:.4g} {claim.unit}".strip()
        band = f"{claim.band} {claim.unit}".strip()
        lines.append(f"{claim.number:>4}  {claim.verdict:<6}  {claim.text}")
        lines.append(f"      {value} (band {band}): {claim.how}")
        if claim.note:
            lines.append(f"      note: {claim.note}")
    missed = [claim.number for claim in claims if not claim.holds]
    lines.append("")
    lines.append(
        f"{len(claims) - len(missed)} of {len(claims)} hold"
        + (f"; misses: {', '.join(missed)}" if missed else "")
    )
    return "\n".join(lines)


def save(claims: Iterable[Claim], folder: str | os.PathLike[str]) -> list[Path]:
    """Write claims.json and claims.csv into a folder, which is made if it is missing.

    Both hold every attribute of the claims, with band and verdict, and every digit.

    Returns:
        The paths.

    Raises:
        OSError: a file cannot be written.
    """
    claims, folder = list(claims), Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    content = {"pyfric": __version__, "claims": table(claims)}
    text = io.StringIO()
    pd.DataFrame([claim.as_dict() for claim in claims]).to_csv(text, index=False)
    paths = [folder / "claims.json", folder / "claims.csv"]
    for path, full in zip(
        paths, (json.dumps(content, indent=2, allow_nan=False) + "\n", text.getvalue()), strict=True
    ):
        with written(path) as draft:
            draft.write_text(full, encoding="utf-8")
    return paths


def table(claims: Iterable[Claim]) -> list[dict[str, Any]]:
    """Return the claims as plain dicts; None stands for numbers that are not finite."""
    return [{name: _plain(value) for name, value in claim.as_dict().items()} for claim in claims]


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
