"""Claims 1 to 6: precursors, their lengths and the force."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from pyfric.engines import prediction_curve
from pyfric.paper.claims import damage as to
from pyfric.paper.claims.claim import Band, Claim, Runs, claim
from pyfric.paper.claims.quantities import (
    force_at,
    force_step,
    furthest,
    growing,
    listed,
    prediction_error,
    rms,
    short,
    straight,
)
from pyfric.paper.runs import AT_2700, AT_F_N, BASE, BY_V, FIG2A, H_2A, SETUP2
from pyfric.record import analysis

WORDS = "the paper's words"
HALF = "half a step between precursors, which the curve is made of; the paper has no number"
NEARER = (
    "half a step: the curve belongs to a precursor if it is nearer to it than to the next one; "
    "the paper has no number"
)
BLOCKS = "resolution: lengths are whole blocks"
SQUARED = to.each("over the square of the force", to.with_force(lambda _, force: force**2))


@claim("1", "fig1")
def _precursors(runs: Runs) -> Iterator[Claim]:
    record = runs["fig1"]
    table = analysis.precursors(record)
    table = table[table["event"].isin(analysis.precursor_lengths(record)["event"])]
    drops = table["force_start"] - table["force_arrest"]
    yield Claim(
        "1a",
        "at least 11 precursors before sliding",
        len(table),
        Band(11, None, WORDS),
        "main events with 0 < L_p < L before the first event over the whole interface",
        [to.each("every second main event left out", to.every_second)],
    )
    yield Claim(
        "1b",
        "all of them nucleate at the trailing edge",
        table["at_trailing_edge"].mean(),
        Band(1, None, WORDS),
        "share with first slip at x <= h + l",
        [to.each("seen from the leading edge", to.mirrored)],
    )
    yield Claim(
        "1c",
        "their lengths increase",
        np.diff(table["L_p_over_L"]).min() * record.scene.N_x,
        Band(1, None, WORDS, "blocks"),
        "smallest step of L_p from one precursor to the next",
        [to.each("lengths in reverse order", to.lengths_backwards)],
    )
    yield Claim(
        "1d",
        "the force drops at each of them",
        (drops > 0).mean(),
        Band(1, None, WORDS),
        "share of precursors with a static force at last stick below that at first slip; the drops "
        f"are {drops.min():.4f} to {drops.max():.4f} F_N",
        [to.each("start and arrest exchanged", to.drops_undone)],
    )


@claim("2", *FIG2A, AT_F_N[1])
def _collapse(runs: Runs) -> Iterator[Claim]:
    other_unit = to.each(
        "force over 2700 N instead of F_N",
        to.with_force(lambda record, force: force * record.scene.F_N / 2700),
    )
    tables = {name: growing(record) for name, record in runs.items()}
    every = pd.concat([tables[name] for name in FIG2A], ignore_index=True)
    spread = analysis.collapse_spread(every["L_p_over_L"], every["force"], log=False)
    step = float(np.mean([force_step(tables[name]) for name in FIG2A]))
    yield Claim(
        "2a",
        "length against force is one curve for all L, h and F_N",
        spread.rms / step,
        Band(None, 0.5, HALF, "steps"),
        f"RMS of F_T/F_N about its median in bins of L_p/L ({spread.rms:.4f}) over the mean step "
        f"between precursors ({step:.4f}); {spread.n} precursors, {len(FIG2A)} scenes",
        [other_unit],
    )
    yield Claim(
        "2b",
        "the same with F_N alone, in finite geometry",
        furthest([tables[name] for name in AT_F_N], tables["fig1"])[0],
        Band(None, 0.5, HALF, "steps"),
        "largest distance in force, at equal length, of the Fig. 1 scene at 1750 and 2700 N from "
        "3500 N",
        [other_unit],
    )
    bent = sorted(
        (straight(short(tables[name]), runs[name].scene.N_x), runs[name].scene.name)
        for name in FIG2A
        if len(short(tables[name])) > 2
    )
    yield Claim(
        "2c",
        "near linear up to half the length",
        bent[-1][0],
        Band(None, 1, BLOCKS, "blocks"),
        "RMS distance of L_p < L/2 from a straight line over the force, worst scene "
        f"({bent[-1][1]}), of {len(bent)}; in the middle {bent[len(bent) // 2][0]:.2f}",
        [SQUARED],
    )
    half = every["L_p_over_L"] < 0.5
    low, high = (np.polyfit(t["force"], t["L_p_over_L"], 1)[0] for t in (every[half], every[~half]))
    yield Claim(
        "2d",
        "faster beyond half the length",
        high / low,
        Band(1, None, WORDS),
        f"slope dL_p/dF_T above L/2 ({high:.2f} L/F_N) over that below ({low:.2f} L/F_N), all "
        "scenes",
        [to.each("curves turned by half a turn", to.turned)],
    )


SMALL = {L: names[:3] for L, names in AT_2700.items()}
"""L (mm) -> names of the runs with h = 2.5, 5 and 7.5 mm."""
H_SMALL = np.array(H_2A[:3])  # mm
UNITS = {"L_p": "mm", "F_T": "F_N"}
ONE_H = {name: names[1] for names in SMALL.values() for name in names}
FIRST_AND_SECOND = {a: b for names in SMALL.values() for a, b in (names[:2], names[1::-1])}
LENGTHS_EXCHANGED = dict(zip(AT_2700[140] + AT_2700[200], AT_2700[200] + AT_2700[140], strict=True))
HEIGHTS_BACKWARDS = {
    a: b for names in AT_2700.values() for a, b in zip(names, names[::-1], strict=True)
}


@claim("3", *AT_2700[140], *AT_2700[200])
def _steps_over_h(runs: Runs) -> Iterator[Claim]:
    steps = {(name, L): _steps(runs, name, L) for name in UNITS for L in SMALL}
    logs = {key: np.polyfit(np.log(H_SMALL), np.log(step), 1) for key, (step, _) in steps.items()}
    power = {key: float(slope) for key, (slope, _) in logs.items()}
    powers = {name: float(np.mean([power[name, L] for L in SMALL])) for name in UNITS}
    texts = [
        f"{name}, L = {L} mm: {', '.join(f'{x:.3g}' for x in step)} {UNITS[name]}, exponent "
        f"{power[name, L]:.2f}"
        for (name, L), (step, _) in steps.items()
    ]
    yield Claim(
        "3a",
        "steps of L_p and F_T between precursors are almost proportional to h, for small h",
        max(powers.values(), key=lambda power: abs(power - 1)),
        Band(0.75, 1.25, "1 means proportional; almost: nearer to 1 than to 1/2 or 3/2"),
        "exponent of the mean step below L/2 over h = 2.5, 5, 7.5 mm, mean of both L, the one "
        f"further from 1 ({listed(powers, '.2f')}); {'; '.join(texts)}",
        [to.exchanged("h = 5 mm in all runs", ONE_H)],
        "the steps grow linearly with h, with an offset (3b). A finer lattice does not change "
        "this: with l = 1.25 mm the steps at L = 140 mm are 4.0, 5.5, 5.3 mm",
    )
    lines = {key: np.polyfit(H_SMALL, step, 1, w=1 / step) for key, (step, _) in steps.items()}
    off = {key: np.abs(step - np.polyval(lines[key], H_SMALL)) for key, (step, _) in steps.items()}
    texts = [
        "{}, L = {} mm: {:.2g} {unit} + {:.2g} {unit} h/mm, off it by {:.1%}".format(
            *key, *np.polyfit(H_SMALL, step, 1)[::-1], (off[key] / step).max(), unit=UNITS[key[0]]
        )
        for key, (step, _) in steps.items()
    ]
    yield Claim(
        "3b",
        "for small h, increments of L_p and F_T between precursors are linear in h",
        max((off[key] / known).max() for key, (_, known) in steps.items()),
        Band(None, 1, BLOCKS, "blocks/n"),
        "mean steps below L/2 for h = 2.5, 5, 7.5 mm: largest distance from a straight line, "
        f"over one block per n steps; {'; '.join(texts)}",
        [to.exchanged("h = 2.5 and 5 mm exchanged", FIRST_AND_SECOND)],
        "the lines do not go through 0, see 3a",
    )
    numbers = np.array([[len(growing(runs[name])) for name in AT_2700[L]] for L in (140, 200)])
    yield Claim(
        "3c",
        "larger L gives more precursors",
        (numbers[1] - numbers[0]).min(),
        Band(1, None, WORDS),
        "smallest difference of their numbers between L = 200 and 140 mm, of six h: "
        f"{numbers[1].tolist()} and {numbers[0].tolist()}",
        [to.exchanged("runs of the two lengths exchanged", LENGTHS_EXCHANGED)],
    )
    yield Claim(
        "3d",
        "smaller h gives more precursors",
        (numbers[:, :3] - numbers[:, 1:4]).min(),
        Band(1, None, WORDS),
        "smallest difference of their numbers between h = 2.5, 5, 7.5, 10 mm and the next",
        [to.exchanged("runs in reverse order of h", HEIGHTS_BACKWARDS)],
        "beyond h = 10 mm their number no longer falls",
    )


def _steps(runs: Runs, name: str, L: int) -> tuple[np.ndarray, np.ndarray]:
    """Return mean steps of L_p (mm) or F_T (F_N) below L/2 for small h, and their errors.

    The error of a mean of n steps of L_p is 1/n of a block. The error of the mean step of force is
    the change of force while L_p grows by the error of its step.
    """
    tables = [short(growing(runs[name])) for name in SMALL[L]]
    ends = [table.iloc[-1] - table.iloc[0] for table in tables]
    numbers = np.array([len(table) - 1 for table in tables])
    L_p, force = (np.array([end[key] for end in ends]) for key in ("L_p_over_L", "force"))
    block = 1 / runs[SMALL[L][0]].scene.N_x
    if name == "L_p":
        return L * L_p / numbers, L * block / numbers
    return force / numbers, block * force / L_p / numbers


@claim("4", *SETUP2)
def _load_on_the_trailing_edge(runs: Runs) -> Iterator[Claim]:
    lengths = np.arange(0.1, 1.0, 0.1)
    minus, zero, plus = (force_at(growing(runs[name]), lengths) for name in SETUP2)
    gaps = np.array([minus - zero, zero - plus])
    text = "less load on the trailing edge, less force for the same length: "
    how = "smallest distance between neighbouring curves, theta = 0.833, 0, -0.833, at L_p/L = 0.1"
    backwards = dict(zip(SETUP2, SETUP2[::-1], strict=True))
    damage = to.exchanged("runs in reverse order of theta", backwards)
    yield Claim(
        "4a",
        text + "order of the three curves",
        np.nanmin(gaps),
        Band(0, None, WORDS, "F_N"),
        f"{how}, 0.2 ... as far as the data reach ({np.isfinite(gaps).sum()} distances)",
        [damage],
        "the curves meet at L_p = L, where the force is about mu_k F_N",
    )
    source = "linear geometry may shift each curve by 1.2 % of F_N; the paper has no number"
    yield Claim(
        "4b",
        text + "the curves are apart",
        np.nanmin(gaps[:, lengths < 0.55]),
        Band(0.024, None, source, "F_N"),
        f"{how} ... 0.5",
        [damage],
    )


@claim("5", *FIG2A, BASE, *SETUP2, *BY_V)
def _prediction(runs: Runs) -> Iterator[Claim]:
    damage = to.each("prediction of mu_s = mu_k = 0.3", to.in_scene(mu_k=0.3))
    for number, what, names in (("5a", "setup 1", tuple(FIG2A)), ("5b", "setup 2", SETUP2)):
        errors = {name: prediction_error(runs[name]) for name in names}
        every = np.concatenate(list(errors.values()))
        shares = {
            name: rms(error) / force_step(growing(runs[name])) for name, error in errors.items()
        }
        worst = max(shares, key=shares.__getitem__)
        engines = sorted({runs[name].method.engine for name in names})
        yield Claim(
            number,
            f"with mu_s = mu_k, equilibrium gives the lengths at arrest: {what}",
            shares[worst],
            Band(None, 0.5, NEARER, "steps"),
            "RMS of F_arrest - F_pred(n) over the mean step between precursors, worst of "
            f"{len(names)} scenes ({worst}); the Fig. 1 scene or the first one "
            f"{shares.get('fig1', shares[names[0]]):.3f}; over F_N, all together: RMS "
            f"{rms(every):.4f}, largest {np.abs(every).max():.4f}; engine: {', '.join(engines)}",
            [damage],
        )
    faster = to.with_force(lambda record, force: force * record.scene.driver.V / 0.7875e-3)
    yield Claim(
        "5c",
        "whatever the driving speed",
        furthest([growing(runs[name]) for name in BY_V], growing(runs[BASE]))[0],
        Band(None, 0.5, NEARER, "steps"),
        "largest difference in force at equal length, V/2 and 2 V compared with V",
        [to.each("force in proportion to V", faster, BY_V)],
    )


@claim("6", "chain", "fig1")
def _one_dimension(runs: Runs) -> Iterator[Claim]:
    chain, slider = (
        straight(growing(runs[name]), runs[name].scene.N_x) for name in ("chain", "fig1")
    )
    scene = runs["chain"].scene
    curve = prediction_curve(scene).curve.rename(columns={"F_T": "force"})
    yield Claim(
        "6a",
        "one dimension, homogeneous load: length is linear in force",
        chain,
        Band(None, 1, BLOCKS, "blocks"),
        f"RMS distance of the lengths from a straight line over the force, {scene.N_x} blocks; the "
        f"prediction curve: {straight(curve.iloc[1:], scene.N_x):.1e}",
        [SQUARED],
    )
    yield Claim(
        "6b",
        "two dimensions: it is not",
        slider,
        Band(1, None, "resolution, as in 6a", "blocks"),
        f"the same distance in the Fig. 1 scene, {slider / chain:.2g} times that of the chain",
        [to.exchanged("the chain's lengths for those of the Fig. 1 scene", {"fig1": "chain"})],
    )
