"""Claims 1 to 6: precursors, their lengths and the force."""

from __future__ import annotations

import functools
from collections.abc import Iterable

import numpy as np
import pandas as pd

from pyfric.engines import prediction_curve
from pyfric.paper.claims.claim import WORDS, Claim, Row, Runs, row
from pyfric.paper.claims.parts import (
    exponent,
    force_at,
    force_step,
    forces_apart,
    growing,
    precursors_below,
    prediction_error,
    rms,
    straight,
)
from pyfric.paper.claims.runs import AT_2700, BASE, GRID, H_2A, SETUP2, SPEEDS_V, jobs
from pyfric.record import analysis

__all__ = ["ROWS"]

ROWS: dict[str, Row] = {}
"""Number -> row."""


@row(ROWS, "1", "fig1")
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


@row(ROWS, "2", *GRID, "F_N 1750", "F_N 2700", "fig1")
def _claim_2(runs: Runs) -> list[Claim]:
    tables = [growing(runs[name]) for name in GRID]
    both = pd.concat(tables, ignore_index=True)
    spread = analysis.collapse_spread(both["L_p_over_L"], both["force"], log=False)
    step = float(np.mean([force_step(table) for table in tables]))
    low, high = both[both["L_p_over_L"] < 0.5], both[both["L_p_over_L"] >= 0.5]
    slopes = [np.polyfit(one["force"], one["L_p_over_L"], 1)[0] for one in (low, high)]
    bent = [  # distance in blocks, scene
        (straight(precursors_below(runs[name], 0.5), runs[name].scene.N_x), name)
        for name in GRID
        if len(precursors_below(runs[name], 0.5)) > 2
    ]
    base = growing(runs["fig1"])
    loads = [np.abs(forces_apart(growing(runs[f"F_N {F_N}"]), base)) for F_N in (1750, 2700)]
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
            value=float(np.concatenate(loads).max() / force_step(base)),
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


@row(ROWS, "3", *GRID)
def _claim_3(runs: Runs) -> list[Claim]:
    h, steps = np.array(H_2A[:3]), {}  # mm; of L_p in mm, of F_T in F_N
    for L in (140, 200):
        tables = [precursors_below(runs[name], 0.5) for name in AT_2700[L][:3]]
        spans = [table["L_p_over_L"].iloc[-1] - table["L_p_over_L"].iloc[0] for table in tables]
        numbers = [len(table) - 1 for table in tables]
        steps["L_p", L] = L * np.array(spans) / numbers
        steps["F_T", L] = np.array([force_step(table) for table in tables])
    counts = np.array([[len(growing(runs[name])) for name in AT_2700[L]] for L in (140, 200)])

    def part(number: str, name: str, unit: str) -> Claim:
        found = {L: steps[name, L] for L in (140, 200)}
        exponents = [exponent(h, step) for step in found.values()]
        lines = [np.polyfit(h, step, 1) for step in found.values()]
        listed = "; ".join(
            f"L = {L} mm: {', '.join(f'{one:.3g}' for one in step)} {unit}, exponent {power:.2f}"
            for (L, step), power in zip(found.items(), exponents, strict=True)
        )
        offsets = " and ".join(f"{line[1]:.2g} {unit} + {line[0]:.2g} h/mm" for line in lines)
        return Claim(
            number=number,
            text=f"steps of {name} between precursors are almost linear in h, for small h",
            value=float(np.mean(exponents)),
            low=0.75,
            high=1.25,
            how=f"exponent of the mean step below L/2 over h = 2.5, 5, 7.5 mm; {listed}",
            source="linear is 1; almost, read as nearer to 1 than to 1/2 or 3/2",
            note=f"steps grow along a line with an offset, {offsets}. A finer lattice does not "
            "mend that: with l = 1.25 mm the steps at L = 140 mm are 4.0, 5.5, 5.3 mm",
        )

    return [
        part("3a", "L_p", "mm"),
        part("3b", "F_T", "F_N"),
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


@row(ROWS, "4", *SETUP2)
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
            low=jobs()[SETUP2[0]].options.tolerance,
            how=f"{how} ... 0.5",
            source="the accepted error of these runs; the paper has no number",
        ),
    ]


@row(ROWS, "5", "fig1", *GRID, *SETUP2, *(f"V {share:g}" for share in SPEEDS_V))
def _claim_5(runs: Runs) -> list[Claim]:
    source = (
        "half a step: the curve belongs to a precursor if it is nearer to it than to the next one; "
        "the paper has no number"
    )

    def part(number: str, what: str, names: Iterable[str]) -> Claim:
        names = list(names)
        errors = [prediction_error(runs[name]) for name in names]
        steps = [force_step(growing(runs[name])) for name in names]
        every = np.concatenate(errors)
        shares = [rms(error) / step for error, step in zip(errors, steps, strict=True)]
        return Claim(
            number=number,
            text=f"with mu_s = mu_k, equilibrium gives the lengths at arrest: {what}",
            value=max(shares),
            unit="steps",
            high=0.5,
            how="RMS of F_arrest - F_pred(n) over the mean step between precursors, worst of "
            f"{len(names)} scenes ({names[int(np.argmax(shares))]}); the Fig. 1 scene or the first "
            f"one {shares[0]:.3f}; over F_N, all together: RMS {rms(every):.4f}, largest "
            f"{np.abs(every).max():.4f}; engine: "
            + ", ".join(sorted({runs[name].method.engine for name in names})),
            source=source,
        )

    base = growing(runs[BASE])
    speed = [np.abs(forces_apart(growing(runs[f"V {share:g}"]), base)) for share in SPEEDS_V]
    return [
        part("5a", "setup 1", ["fig1", *GRID]),
        part("5b", "setup 2", SETUP2),
        Claim(
            number="5c",
            text="whatever the driving speed",
            value=float(np.concatenate(speed).max() / force_step(base)),
            unit="steps",
            high=0.5,
            how="largest distance in force, at equal length, of V/2 and 2 V from V; the prediction "
            "has no V",
            source=source,
        ),
    ]


@row(ROWS, "6", "chain", "fig1")
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
