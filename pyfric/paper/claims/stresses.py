"""Claims 7 to 11: stresses on the interface, and the force they add up to."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pyfric.paper.claims.claim import TENTH, Claim, Row, Runs, row
from pyfric.paper.claims.parts import arrested, growing, left_behind, prediction_error, reach, rms
from pyfric.paper.claims.runs import AT_2700, BASE, D_C, MU_S
from pyfric.record import analysis
from pyfric.scene import Law

if TYPE_CHECKING:
    from pyfric.record import Record

__all__ = ["ROWS"]

ROWS: dict[str, Row] = {}
"""Number -> row."""


def _decay_length(record: Record) -> float:
    """Distance over which loading's tau falls to 1/e behind its peak, over h."""
    scene = record.scene
    rise = analysis.stress_profile(record, 0)["tau"] - analysis.stress_profile(record)["tau"]
    rise = rise.to_numpy() / rise.max()
    peak = int(rise.argmax())
    i = peak + int(np.argmax(rise[peak:] < 1 / np.e))
    blocks = i - (1 / np.e - rise[i]) / (rise[i - 1] - rise[i]) - peak
    return blocks * scene.slider.l / scene.driver.h


@row(ROWS, "7", "fig1", *AT_2700[140], *AT_2700[200])
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


@row(ROWS, "8", "fig1")
def _claim_8(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    events = analysis.precursor_lengths(record)["event"].to_numpy()
    left = [arrested(record, event)["scaled"].to_numpy() for event in events]
    each, but_last = [rms(one) for one in left], rms(np.concatenate(left[:-1] or [[np.nan]]))
    return [
        Claim(
            number="8",
            text="a precursor leaves tau = mu_k p behind it",
            value=rms(left_behind(record)),
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


@row(ROWS, "9", BASE, *(f"mu_s {mu_s:g}" for mu_s in MU_S), *(f"d_c {d_c * 1e6:g}" for d_c in D_C))
def _claim_9(runs: Runs) -> list[Claim]:
    base = runs[BASE]
    by_mu_s = {base.scene.interface.mu_s: base} | {mu_s: runs[f"mu_s {mu_s:g}"] for mu_s in MU_S}
    mean, spread, apart = {}, {}, {}
    for mu_s, record in sorted(by_mu_s.items()):
        ratio = left_behind(record, "tau_over_p") - record.scene.interface.mu_k
        mean[mu_s], spread[mu_s] = float(np.mean(ratio)), rms(ratio)
        apart[mu_s] = float(np.mean(prediction_error(record)))
    slope = np.polyfit(list(mean), list(mean.values()), 1)[0]
    shift = np.polyfit(list(apart), list(apart.values()), 1)[0]
    weak = {d_c: rms(left_behind(runs[f"d_c {d_c * 1e6:g}"])) for d_c in D_C}
    first = {d_c: len(growing(runs[f"d_c {d_c * 1e6:g}"])) for d_c in D_C}
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


@row(ROWS, "10", "fig1", BASE, *(f"mu_s {mu_s:g}" for mu_s in MU_S))
def _claim_10(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    last = analysis.precursor_lengths(record).iloc[-1]
    friction = record.scene.interface
    left = friction.law.scaled(last["force"])
    by_mu_s = {0.7: runs[BASE]} | {mu_s: runs[f"mu_s {mu_s:g}"] for mu_s in MU_S}
    found = {mu_s: _largest(one) for mu_s, one in sorted(by_mu_s.items())}
    R = {mu_s: Law(mu_s, friction.mu_k).scaled(F_max) for mu_s, F_max in found.items()}
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


@row(ROWS, "11", "fig1")
def _claim_11(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    scene = record.scene
    events = analysis.precursor_lengths(record)["event"].to_numpy()
    falls, ahead = [], []
    corner = scene.j_h + 2  # blocks at x <= h + l
    for event in events:
        table, tip = analysis.stress_profile(record, event, "after"), reach(record, event)
        ratio, n = table["p_over_p_initial"].to_numpy(), table["n"].to_numpy()
        behind = ratio[(n > corner) & (n < tip)]
        falls.append(1 - behind.min() if behind.size else 0.0)
        ahead.append(ratio[n > tip + scene.j_h] - 1)
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
            value=rms(np.concatenate(ahead)),
            high=0.1,
            how="RMS of p/p_initial - 1 over x > L_p + h, all precursors; in order: "
            + ", ".join(f"{rms(one):.3f}" for one in ahead),
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
