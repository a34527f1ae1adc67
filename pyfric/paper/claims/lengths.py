"""Claims 1 to 6: precursors, their lengths and the force."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.engines import prediction_curve
from pyfric.paper.claims import damage as to
from pyfric.paper.claims.claim import WORDS, Claim, Row, Runs, damaged, row
from pyfric.paper.claims.parts import (
    below,
    exponent,
    force_at,
    force_step,
    forces_apart,
    growing,
    off_line,
    prediction_error,
    rms,
    straight,
)
from pyfric.paper.claims.runs import AT_2700, AT_F_N, BASE, GRID, H_2A, SETUP2, SPEEDS_V
from pyfric.record import analysis

if TYPE_CHECKING:
    pass

__all__ = ["ROWS"]

ROWS: dict[str, Row] = {}
"""Number -> row."""

HALF = "half a step between precursors, which the curve is made of; the paper has no number"
BLOCKS = "resolution: lengths are whole blocks"


@row(
    ROWS,
    "1",
    "fig1",
    damage={
        "a": damaged("every second main event left out", to.each(to.every_second)),
        "b": damaged("seen from the leading edge", to.each(to.mirrored)),
        "c": damaged("lengths in reverse order", to.each(to.lengths_backwards)),
        "d": damaged("start and arrest exchanged", to.each(to.drops_undone)),
    },
)
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


@row(
    ROWS,
    "2",
    *GRID,
    AT_F_N[1],
    damage={
        "a": damaged(
            "force over 2700 N instead of F_N",
            to.each(to.with_force(lambda record, force: force * record.scene.F_N / 2700)),
        ),
        "b": damaged(
            "force over 2700 N instead of F_N",
            to.each(to.with_force(lambda record, force: force * record.scene.F_N / 2700)),
        ),
        "c": damaged("over the square of the force", to.each(to.with_force(lambda _, f: f**2))),
        "d": damaged("curves turned by half a turn", to.each(to.turned)),
    },
)
def _claim_2(runs: Runs) -> list[Claim]:
    tables = {name: growing(record) for name, record in runs.items()}
    return [*_collapses(tables), *_slopes(runs, tables)]


def _collapses(found: Mapping[str, pd.DataFrame]) -> list[Claim]:
    """Claims 2a and 2b."""
    tables = [found[name] for name in GRID]
    both = pd.concat(tables, ignore_index=True)
    spread = analysis.collapse_spread(both["L_p_over_L"], both["force"], log=False)
    step = float(np.mean([force_step(table) for table in tables]))
    base = found["fig1"]
    loads = [np.abs(forces_apart(found[name], base)) for name in AT_F_N]
    return [
        Claim(
            number="2a",
            text="length against force is one curve for all L, h and F_N",
            value=spread.rms / step,
            unit="steps",
            high=0.5,
            how=f"RMS of F_T/F_N about its median in bins of L_p/L ({spread.rms:.4f}) over the "
            f"mean step between precursors ({step:.4f}); {spread.n} precursors, {len(GRID)} scenes",
            source=HALF,
        ),
        Claim(
            number="2b",
            text="the same with F_N alone, in finite geometry",
            value=float(np.concatenate(loads).max() / force_step(base)),
            unit="steps",
            high=0.5,
            how="largest distance in force, at equal length, of the Fig. 1 scene at 1750 and "
            "2700 N from 3500 N",
            source=HALF,
        ),
    ]


def _slopes(runs: Runs, found: Mapping[str, pd.DataFrame]) -> list[Claim]:
    """Claims 2c and 2d."""
    scenes, tables = [runs[name].scene for name in GRID], [found[name] for name in GRID]
    both = pd.concat(tables, ignore_index=True)
    low, high = both[both["L_p_over_L"] < 0.5], both[both["L_p_over_L"] >= 0.5]
    slopes = [np.polyfit(one["force"], one["L_p_over_L"], 1)[0] for one in (low, high)]
    short = [below(table, 0.5) for table in tables]
    bent = [  # distance in blocks, scene
        (straight(table, scene.N_x), scene.name)
        for scene, table in zip(scenes, short, strict=True)
        if len(table) > 2
    ]
    return [
        Claim(
            number="2c",
            text="near linear up to half the length",
            value=max(bent)[0],
            unit="blocks",
            high=1.0,
            how="RMS distance of L_p < L/2 from a straight line over the force, worst scene "
            f"({max(bent)[1]}), of {len(bent)}; in the middle "
            f"{sorted(bent)[len(bent) // 2][0]:.2f}",
            source=BLOCKS,
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


def _one_h(runs: Runs) -> Runs:
    """Under every h the run of h = 5 mm."""
    return {name: runs[f"{name.split('/')[0]}/5/2700"] for name in runs}


FIRST_AND_SECOND = {
    f"{L}/{a}/2700": f"{L}/{b}/2700" for L in (140, 200) for a, b in ((2.5, 5), (5, 2.5))
}
LENGTHS_EXCHANGED = {
    f"{a}/{h:g}/2700": f"{b}/{h:g}/2700" for h in H_2A for a, b in ((140, 200), (200, 140))
}
HEIGHTS_BACKWARDS = {
    f"{L}/{a:g}/2700": f"{L}/{b:g}/2700"
    for L in (140, 200)
    for a, b in zip(H_2A, H_2A[::-1], strict=True)
}


@row(
    ROWS,
    "3",
    *AT_2700[140],
    *AT_2700[200],
    damage=dict.fromkeys("ab", damaged("h = 5 mm in all runs", _one_h))
    | {
        "c": damaged("runs of the two lengths exchanged", to.exchanged(LENGTHS_EXCHANGED)),
        "d": damaged("runs in reverse order of h", to.exchanged(HEIGHTS_BACKWARDS)),
    }
    | dict.fromkeys("ef", damaged("h = 2.5 and 5 mm exchanged", to.exchanged(FIRST_AND_SECOND))),
)
def _claim_3(runs: Runs) -> list[Claim]:
    return [*_exponents(runs), *_counts(runs), *_lines(runs)]


H_SMALL = np.array(H_2A[:3])  # mm


def _steps(runs: Runs, name: str, L: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean steps below L/2 for small h, of L_p in mm or of F_T in F_N, and their resolution.

    A mean of n steps is known to the n-th part of a block; that of the force to what it takes to
    advance by that.
    """
    tables = [below(growing(runs[one]), 0.5) for one in AT_2700[L][:3]]
    ends = [table.iloc[-1] - table.iloc[0] for table in tables]
    numbers = np.array([len(table) - 1 for table in tables])
    L_p, force = (np.array([end[key] for end in ends]) for key in ("L_p_over_L", "force"))
    block = 1 / runs[AT_2700[L][0]].scene.N_x
    if name == "L_p":
        return L * L_p / numbers, L * block / numbers
    return force / numbers, block * force / L_p / numbers


def _exponents(runs: Runs) -> list[Claim]:
    """Claims 3a and 3b."""
    claims = []
    for number, name, unit in (("3a", "L_p", "mm"), ("3b", "F_T", "F_N")):
        found = {L: _steps(runs, name, L)[0] for L in (140, 200)}
        powers = {L: exponent(H_SMALL, steps) for L, steps in found.items()}
        listed = "; ".join(
            f"L = {L} mm: {', '.join(f'{one:.3g}' for one in steps)} {unit}, "
            f"exponent {powers[L]:.2f}"
            for L, steps in found.items()
        )
        claims.append(
            Claim(
                number=number,
                text=f"steps of {name} between precursors are almost proportional to h, for "
                "small h",
                value=float(np.mean(list(powers.values()))),
                low=0.75,
                high=1.25,
                how=f"exponent of the mean step below L/2 over h = 2.5, 5, 7.5 mm; {listed}",
                source="proportional is 1; almost, read as nearer to 1 than to 1/2 or 3/2",
                note="steps grow along a line with an offset (3e, 3f). A finer lattice does not "
                "mend that: with l = 1.25 mm the steps at L = 140 mm are 4.0, 5.5, 5.3 mm",
            )
        )
    return claims


def _counts(runs: Runs) -> list[Claim]:
    """Claims 3c and 3d."""
    counts = np.array([[len(growing(runs[name])) for name in AT_2700[L]] for L in (140, 200)])
    return [
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


def _lines(runs: Runs) -> list[Claim]:
    """Claims 3e and 3f."""
    claims = []
    for number, name, unit in (("3e", "L_p", "mm"), ("3f", "F_T", "F_N")):
        found = {L: _steps(runs, name, L) for L in (140, 200)}
        off = {L: off_line(H_SMALL, steps) for L, (steps, _) in found.items()}
        lines = {L: np.polyfit(H_SMALL, steps, 1) for L, (steps, _) in found.items()}
        listed = "; ".join(
            f"L = {L} mm: {line[1]:.2g} {unit} + {line[0]:.2g} {unit} h/mm, off it by "
            f"{np.abs(off[L] / found[L][0]).max():.1%}"
            for L, line in lines.items()
        )
        claims.append(
            Claim(
                number=number,
                text=f"steps of {name} between precursors lie on a line over h, for small h",
                value=float(max(np.abs(off[L] / found[L][1]).max() for L in off)),
                unit="blocks/n",
                high=1.0,
                how="largest distance of the mean step below L/2 from a straight line over h = "
                f"2.5, 5, 7.5 mm, over what a block makes of a mean of n steps; {listed}",
                source=BLOCKS,
                note="the line does not go through 0, see 3a and 3b",
            )
        )
    return claims


THETA_BACKWARDS = dict(zip(SETUP2, SETUP2[::-1], strict=True))


@row(
    ROWS,
    "4",
    *SETUP2,
    damage=dict.fromkeys(
        "ab", damaged("runs in reverse order of theta", to.exchanged(THETA_BACKWARDS))
    ),
)
def _claim_4(runs: Runs) -> list[Claim]:
    lengths = np.arange(0.1, 1.0, 0.1)
    minus, zero, plus = (force_at(growing(runs[name]), lengths) for name in SETUP2)
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
            low=0.024,
            how=f"{how} ... 0.5",
            source="linear geometry may shift each curve by 1.2 % of F_N; the paper has no number",
        ),
    ]


PREDICTION = (
    "half a step: the curve belongs to a precursor if it is nearer to it than to the next one; "
    "the paper has no number"
)
OTHER_FRICTION = damaged("prediction of mu_s = mu_k = 0.3", to.each(to.friction(mu_k=0.3)))


@row(
    ROWS,
    "5",
    *GRID,
    BASE,
    *SETUP2,
    *(f"V {share:g}" for share in SPEEDS_V),
    damage={
        "a": OTHER_FRICTION,
        "b": OTHER_FRICTION,
        "c": damaged(
            "force in proportion to V",
            to.each(
                to.with_force(lambda record, force: force * record.scene.driver.V / 0.7875e-3),
                [f"V {share:g}" for share in SPEEDS_V],
            ),
        ),
    },
)
def _claim_5(runs: Runs) -> list[Claim]:
    base = growing(runs[BASE])
    speed = [np.abs(forces_apart(growing(runs[f"V {share:g}"]), base)) for share in SPEEDS_V]
    return [
        _predicted("5a", "setup 1", {name: runs[name] for name in GRID}),
        _predicted("5b", "setup 2", {name: runs[name] for name in SETUP2}),
        Claim(
            number="5c",
            text="whatever the driving speed",
            value=float(np.concatenate(speed).max() / force_step(base)),
            unit="steps",
            high=0.5,
            how="largest distance in force, at equal length, of V/2 and 2 V from V; the prediction "
            "has no V",
            source=PREDICTION,
        ),
    ]


def _predicted(number: str, what: str, runs: Runs) -> Claim:
    """Claim 5a or 5b."""
    errors = {name: prediction_error(record) for name, record in runs.items()}
    every = np.concatenate(list(errors.values()))
    shares = {name: rms(error) / force_step(growing(runs[name])) for name, error in errors.items()}
    worst = max(shares, key=shares.__getitem__)
    engines = sorted({record.method.engine for record in runs.values()})
    return Claim(
        number=number,
        text=f"with mu_s = mu_k, equilibrium gives the lengths at arrest: {what}",
        value=shares[worst],
        unit="steps",
        high=0.5,
        how="RMS of F_arrest - F_pred(n) over the mean step between precursors, worst of "
        f"{len(runs)} scenes ({worst}); the Fig. 1 scene or the first one "
        f"{shares.get('fig1', next(iter(shares.values()))):.3f}; over F_N, all together: RMS "
        f"{rms(every):.4f}, largest {np.abs(every).max():.4f}; engine: {', '.join(engines)}",
        source=PREDICTION,
    )


@row(
    ROWS,
    "6",
    "chain",
    "fig1",
    damage={
        "a": damaged("over the square of the force", to.each(to.with_force(lambda _, f: f**2))),
        "b": damaged(
            "the chain's lengths for those of the Fig. 1 scene",
            lambda runs: {**runs, "fig1": runs["chain"]},
        ),
    },
)
def _claim_6(runs: Runs) -> list[Claim]:
    one, two = (straight(growing(runs[name]), runs[name].scene.N_x) for name in ("chain", "fig1"))
    curve = prediction_curve(runs["chain"].scene).curve
    table = curve.rename(columns={"F_T": "force"}).iloc[1:]
    exact = straight(table, runs["chain"].scene.N_x)
    return [
        Claim(
            number="6a",
            text="one dimension, homogeneous load: length is linear in force",
            value=one,
            unit="blocks",
            high=1.0,
            how="RMS distance of the lengths from a straight line over the force, 57 blocks; the "
            f"prediction curve: {exact:.1e}",
            source=BLOCKS,
        ),
        Claim(
            number="6b",
            text="two dimensions: it is not",
            value=two,
            unit="blocks",
            low=1.0,
            how=f"the same distance in the Fig. 1 scene, {two / one:.2g} times that of the chain",
            source="resolution, as in 6a",
        ),
    ]
