"""Claims 7 to 11: stresses on the interface, and the force they add up to."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from pyfric.paper.claims import damage as to
from pyfric.paper.claims.claim import TENTH, Claim, Row, Runs, damaged, row
from pyfric.paper.claims.parts import (
    corner,
    growing,
    left_behind,
    prediction_error,
    reach,
    rms,
    size,
)
from pyfric.paper.claims.runs import AT_2700, BASE, D_C, MATTRESS, MU_S
from pyfric.record import analysis

if TYPE_CHECKING:
    from pyfric.record import Record

__all__ = ["ROWS"]

ROWS: dict[str, Row] = {}
"""Number -> row."""


def _decay_length(record: Record) -> float:
    """Distance over which loading's tau falls to 1/e behind its peak, over h."""
    scene = record.scene
    rise = analysis.stress_profile(record, 1)["tau"] - analysis.stress_profile(record)["tau"]
    rise = rise.to_numpy() / rise.max()
    peak = int(rise.argmax())
    i = peak + int(np.argmax(rise[peak:] < 1 / np.e))
    blocks = i - (1 / np.e - rise[i]) / (rise[i - 1] - rise[i]) - peak
    return blocks * scene.slider.l / scene.driver.h


H_BACKWARDS = {a: b for one in AT_2700.values() for a, b in zip(one, one[::-1], strict=True)}
LOADED = damaged(
    "the state before the first slip instead", to.each(to.loaded_for_initial, ["fig1"])
)


def _other_h(runs: Runs) -> Runs:
    """Each run of Fig. 2(a) as if h were that of the run in its place in reverse order."""
    return {
        name: dataclasses.replace(
            one, scene=dataclasses.replace(one.scene, driver=runs[H_BACKWARDS[name]].scene.driver)
        )
        if name in H_BACKWARDS
        else one
        for name, one in runs.items()
    }


@row(
    ROWS,
    "7",
    "fig1",
    *AT_2700[140],
    *AT_2700[200],
    damage={"a": LOADED, "b": LOADED, "c": damaged("h in reverse order", _other_h)},
)
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


WAYS = {
    "all": "over the slipped, closed blocks",
    "inner": "without the blocks at x <= h + l",
    "force": "weighted by p",
}
"""How distances from mu_k p are put together."""
BEFORE = damaged("the state before each event instead", to.each(to.before_for_after))


@row(ROWS, "8", "fig1", damage=dict.fromkeys("abc", BEFORE))
def _claim_8(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    events = analysis.precursor_lengths(record)["event"].to_numpy()
    claims = []
    for letter, way in zip("abc", WAYS, strict=True):
        each = [size(left_behind(record, [event]), way) for event in events]
        but_last = size(left_behind(record, events[:-1]), way)
        claims.append(
            Claim(
                number=f"8{letter}",
                text="a precursor leaves tau = mu_k p behind it" + _also(way),
                value=size(left_behind(record), way),
                unit="mu_s - mu_k",
                high=0.1,
                how=f"RMS of (tau/p - mu_k)/(mu_s - mu_k) after arrest {WAYS[way]}, tip block left "
                f"out, {len(events)} precursors; one by one: "
                + ", ".join(f"{one:.3f}" for one in each if np.isfinite(one)),
                source=TENTH,
                note=f"without the last precursor {but_last:.3f}; the last one "
                "nearly spans the interface and leaves blocks above and below mu_k p",
            )
        )
    return claims


def _also(way: str) -> str:
    return "" if way == "all" else f", {WAYS[way]}"


IN_PROPORTION = damaged(
    "tau and F_T at arrest in proportion to mu_s",
    to.each(lambda record: to.with_force(_as_mu_s)(to.with_stress(_tau_as_mu_s)(record))),
)
MIDDLE = damaged(
    "tau halfway from mu_k p to mu_s p, with weakening",
    to.each(
        to.with_stress(lambda record, tau, p: 0.5 * (tau + record.scene.interface.mu_s * p)),
        [f"d_c {d_c * 1e6:g}" for d_c in D_C if d_c > 0],
    ),
)


def _tau_as_mu_s(record: Record, tau: np.ndarray, p: np.ndarray) -> np.ndarray:
    return tau * record.scene.interface.mu_s / 0.7


def _as_mu_s(record: Record, force: np.ndarray) -> np.ndarray:
    return force * record.scene.interface.mu_s / 0.7


@row(
    ROWS,
    "9",
    BASE,
    *(f"mu_s {mu_s:g}" for mu_s in MU_S),
    *(f"d_c {d_c * 1e6:g}" for d_c in D_C),
    damage=dict.fromkeys("ab", IN_PROPORTION) | dict.fromkeys("cdef", MIDDLE),
)
def _claim_9(runs: Runs) -> list[Claim]:
    base = runs[BASE]
    by_mu_s = {base.scene.interface.mu_s: base} | {mu_s: runs[f"mu_s {mu_s:g}"] for mu_s in MU_S}
    by_d_c = {d_c: runs[f"d_c {d_c * 1e6:g}"] for d_c in D_C}
    return [*_over_mu_s(dict(sorted(by_mu_s.items()))), *_over_d_c(by_d_c)]


def _over_mu_s(runs: dict[float, Record]) -> list[Claim]:
    """Claims 9a and 9b."""
    mean, spread, apart = {}, {}, {}
    for mu_s, record in runs.items():
        ratio = left_behind(record)["tau_over_p"] - record.scene.interface.mu_k
        mean[mu_s], spread[mu_s] = float(np.mean(ratio)), rms(ratio)
        apart[mu_s] = float(np.mean(prediction_error(record)))
    slope = np.polyfit(list(mean), list(mean.values()), 1)[0]
    shift = np.polyfit(list(apart), list(apart.values()), 1)[0]
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
    ]


def _over_d_c(runs: dict[float, Record]) -> list[Claim]:
    """Claims 9c to 9f."""
    left = {d_c: left_behind(record) for d_c, record in runs.items()}
    count = {d_c: len(growing(record)) for d_c, record in runs.items()}
    far = {way: {d_c: size(one, way) for d_c, one in left.items()} for way in WAYS}
    worst = {way: max(x for d_c, x in far[way].items() if 0 < d_c <= 2e-6) for way in WAYS}

    def said(x: float) -> str:
        return f"{x:.3f}" if np.isfinite(x) else "no such blocks left behind"

    claims = [
        Claim(
            number=f"9{letter}",
            text=f"it holds with slip weakening over less than a few um{_also(way)}",
            value=worst[way],
            unit="mu_s - mu_k",
            high=0.1,
            how="claim 8's RMS, worst of d_c = 0.5, 1, 2 um; at d_c in um (with the number of "
            "precursors): "
            + ", ".join(f"{d_c * 1e6:g}: {said(x)} ({count[d_c]})" for d_c, x in far[way].items()),
            source=TENTH,
            note=f"without weakening it is {far[way][0.0]:.3f} in these runs (linear geometry), "
            "because of the last precursor, as in claim 8. From about 5 um on, slip grows stably "
            "at the driver's pace before it breaks out; these runs end at 0.5 s instead of 0.92 s",
        )
        for letter, way in zip("cef", WAYS, strict=True)
    ]
    claims.insert(
        1,
        Claim(
            number="9d",
            text="and is no further from mu_k p than without weakening",
            value=worst["all"] / far["all"][0.0],
            high=1.1,
            how="the value of 9c, over that at d_c = 0",
            source="1 is as far as without; a tenth more: the paper has no number",
        ),
    )
    return claims


@row(
    ROWS,
    "10",
    "fig1",
    BASE,
    *(f"mu_s {mu_s:g}" for mu_s in MU_S),
    damage={
        "a": damaged("without the precursors beyond 0.8 L", to.each(to.up_to(0.8))),
        "b": damaged("mu_k = 0.4", to.each(to.friction(mu_k=0.4))),
        "c": damaged("forces in proportion to mu_s", to.each(to.with_force(_as_mu_s))),
    },
)
def _claim_10(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    last = analysis.precursor_lengths(record).iloc[-1]
    by_mu_s = {0.7: runs[BASE]} | {mu_s: runs[f"mu_s {mu_s:g}"] for mu_s in MU_S}
    found = {mu_s: _largest(one) for mu_s, one in sorted(by_mu_s.items())}
    R = {mu_s: by_mu_s[mu_s].scene.law.scaled(F_max) for mu_s, F_max in found.items()}
    worst = max(R.values(), key=abs)
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
            value=float(record.scene.law.scaled(last["force"])),
            unit="mu_s - mu_k",
            low=-0.1,
            high=0.1,
            how="R = (F_T/F_N - mu_k)/(mu_s - mu_k) of the static force at arrest, "
            f"{last['force']:.4f} F_N",
            source=TENTH,
        ),
        Claim(
            number="10c",
            text="the largest force is only slightly above mu_k F_N, whatever mu_s",
            value=float(worst),
            unit="mu_s - mu_k",
            low=-0.1,
            high=0.1,
            how="R of the largest static force up to the first event over the whole interface, "
            "worst of mu_s: "
            + ", ".join(f"{one:.3f} at {mu_s:g}" for mu_s, one in R.items())
            + f"; Fig. 1 scene up to 2 s: {analysis.friction_coefficients(record).R:.3f}",
            source="as in 10b: 0 where mu_k sets the force, 1 where mu_s does",
            note="an event has to nucleate at the trailing edge, where tau reaches mu_s p: the "
            "force at which the whole interface goes feels mu_s a little, by R at all mu_s. A "
            "change of mu_s changes F_max/F_N by R times as much",
        ),
    ]


def _largest(record: Record) -> float:
    """Largest static force at the start of an event up to the first system-size event, over F_N."""
    sliding = analysis.system_size_events(record)["event"]
    if not len(sliding):
        return np.nan
    return float(record.events["F_T_start"].loc[: sliding.iloc[0]].max() / record.scene.F_N)


@row(
    ROWS,
    "11",
    "fig1",
    BASE,
    *MATTRESS,
    damage={
        "a": damaged("p as at F_T = 0", to.each(to.p_unchanged)),
        "b": damaged("seen from the leading edge", to.each(to.mirrored)),
        "c": damaged("p/p_initial shuffled along the interface", to.each(to.p_shuffled)),
        "d": damaged("p as at F_T = 0", to.each(to.p_unchanged)),
    },
)
def _claim_11(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    linear = {name: max(_falls(runs[name])[0]) for name in (BASE, *MATTRESS)}
    beside = "; in linear geometry, by the stiffness of the mattress: " + ", ".join(
        f"{what} {linear[name]:.3f}"
        for name, what in ((BASE, "0.4 MN/m in all"), *MATTRESS.items())
    )
    falls, ahead = _falls(record)

    def fall(number: str, text: str, value: float, how: str, note: str) -> Claim:
        return Claim(
            number=number,
            text=f"p falls behind a precursor, by up to 30 %{text}",
            value=float(value),
            low=0.25,
            high=0.35,
            how="largest 1 - p/p_initial after arrest over h + l < x < L_p, of all precursors"
            + how,
            source="30 % to the nearest ten per cent",
            note=note,
        )

    eleventh = (
        f"; the 11th, in the paper's Fig. 4(a), has {falls[10]:.3f}" if len(falls) > 10 else ""
    )
    return [
        fall(
            "11a",
            "",
            max(falls),
            "; in order: " + ", ".join(f"{one:.3f}" for one in falls) + beside,
            f"the largest is that of the last precursor{eleventh}. The paper's 0.4 MN/m may be "
            "that of the whole mattress, as here, or that on each top block, see 11d",
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
        _reproducible(record),
        fall(
            "11d",
            ", with a mattress of 0.4 MN/m on each top block",
            linear[EACH_BLOCK],
            beside,
            "the other reading of the paper's 0.4 MN/m",
        ),
    ]


EACH_BLOCK = next(iter(MATTRESS))


def _falls(record: Record) -> tuple[list[float], list[np.ndarray]]:
    """Of each precursor: the largest fall of p/p_initial behind it, and p/p_initial - 1 ahead."""
    falls, ahead = [], []
    for event in analysis.precursor_lengths(record)["event"]:
        table, tip = analysis.stress_profile(record, event, "after"), reach(record, event)
        ratio, n = table["p_over_p_initial"].to_numpy(), table["n"].to_numpy()
        behind = ratio[(n > corner(record)) & (n < tip)]
        falls.append(float(1 - behind.min()) if behind.size else 0.0)
        ahead.append(ratio[n > tip + record.scene.j_h] - 1)
    return falls, ahead


def _reproducible(record: Record) -> Claim:
    """Claim 11c."""
    sliding = analysis.system_size_events(record)["event"]
    after = [analysis.stress_profile(record, e, "after")["p_over_p_initial"] for e in sliding]
    spread = np.nan
    if len(after) >= 4:
        spread = float(np.std(np.array(after)[:, corner(record) :], axis=0).max())
    return Claim(
        number="11c",
        text="p(x) is reproducible between events over the whole interface",
        value=spread,
        high=0.03,
        how=f"largest standard deviation of p/p_initial at x > h + l just after {len(sliding)} "
        "such events",
        source="a tenth of the 30 %: the paper has no number",
    )
