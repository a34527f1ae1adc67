"""Claims 7 to 11: stresses on the interface, and their sum, the force."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from pyfric.paper.claims import damage as to
from pyfric.paper.claims.claim import Band, Claim, Damage, Runs, claim
from pyfric.paper.claims.lengths import HEIGHTS_BACKWARDS
from pyfric.paper.claims.quantities import (
    corner,
    growing,
    left_behind,
    listed,
    prediction_error,
    reach,
    rms,
    size,
    stated,
    weighted,
)
from pyfric.paper.runs import AT_2700, BASE, BY_D_C, BY_MU_S, MATTRESS
from pyfric.record import analysis

if TYPE_CHECKING:
    from pyfric.record import Record

TENTH = "a tenth of mu_s - mu_k, our reading of 'about': the paper has no number"


@claim("7", "fig1", *AT_2700[140], *AT_2700[200])
def _loading(runs: Runs) -> Iterator[Claim]:
    start = analysis.stress_profile(runs["fig1"])
    loaded = to.each("the state before the first slip instead", to.loaded_for_initial, ["fig1"])
    rounding = "1e-9: the rounding at which static states are accepted"
    for number, name, what, sign in (
        ("7a", "p", "symmetric", -1),
        ("7b", "tau", "antisymmetric", 1),
    ):
        yield Claim(
            number,
            f"at F_T = 0, {name} is {what}",
            np.abs(start[name] + sign * start[name].to_numpy()[::-1]).max(),
            Band(None, 1e-9, rounding, "F_N/N_x"),
            f"largest |{name}(n) {'+' if sign > 0 else '-'} {name}(N_x + 1 - n)|",
            [loaded],
        )
    lengths = [_decay_length(runs[name]) for L in AT_2700 for name in AT_2700[L]]
    yield Claim(
        "7c",
        "loading raises tau near the trailing edge over a distance of about h",
        max(lengths, key=lambda x: abs(math.log(x))),
        Band(0.5, 2, "about, read as within a factor of two", "h"),
        "distance from the peak of the rise before the first slip to 1/e of it; the one furthest "
        f"from h in {len(lengths)} scenes with h = 2.5 to 15 mm; all: {min(lengths):.2f} to "
        f"{max(lengths):.2f} h",
        [Damage("h in reverse order", _other_h)],
    )


def _decay_length(record: Record) -> float:
    """Return the distance over which the rise of tau falls from its peak to 1/e of it, in h."""
    scene = record.scene
    rise = analysis.stress_profile(record, 1)["tau"] - analysis.stress_profile(record)["tau"]
    rise = rise.to_numpy() / rise.max()
    peak = int(rise.argmax())
    i = peak + int(np.argmax(rise[peak:] < 1 / np.e))
    blocks = i - (1 / np.e - rise[i]) / (rise[i - 1] - rise[i]) - peak
    return blocks * scene.slider.l / scene.driver.h


def _other_h(runs: Runs) -> Runs:
    """Return the runs of Fig. 2(a), each with the h of another run, in reverse order."""
    changed = dict(runs)
    for name, other in HEIGHTS_BACKWARDS.items():
        changed[name] = to.in_scene(h=runs[other].scene.driver.h)(runs[name])
    return changed


@claim("8", "fig1")
def _behind_a_precursor(runs: Runs) -> Iterator[Claim]:
    record = runs["fig1"]
    events = analysis.precursor_lengths(record)["event"].to_numpy()
    left = left_behind(record)
    each = ", ".join(stated(size(left_behind(record, [event]))) for event in events)
    yield Claim(
        "8",
        "a precursor leaves tau = mu_k p behind it",
        size(left),
        Band(None, 0.1, TENTH, "(mu_s - mu_k)"),
        "RMS of (tau/p - mu_k)/(mu_s - mu_k) after arrest over the slipped, closed blocks, tip "
        f"block left out, {len(events)} precursors; {weighted(left)}; without the last precursor "
        f"{stated(size(left_behind(record, events[:-1])))}; one by one: {each}",
        [to.each("the state before each event instead", to.before_for_after)],
        "the last precursor nearly spans the interface and leaves blocks above and below mu_k p",
    )


FORCE_AS_MU_S = to.with_force(lambda record, force: force * record.scene.interface.mu_s / 0.7)


@claim("9", BASE, *BY_MU_S, *BY_D_C)
def _state_at_arrest(runs: Runs) -> Iterator[Claim]:
    by_mu_s = _by_mu_s(runs)
    ratio = {
        mu_s: left_behind(record)["tau_over_p"] - record.scene.interface.mu_k
        for mu_s, record in by_mu_s.items()
    }
    both = to.each("tau and F_T at arrest in proportion to mu_s", _as_mu_s)
    yield Claim(
        "9a",
        "the state at arrest depends only weakly on mu_s: tau/p",
        _slope({mu_s: float(np.mean(values)) for mu_s, values in ratio.items()}),
        Band(None, 0.1, "0 is no dependence, 1 is tau = mu_s p; a tenth: the paper has no number"),
        "slope over mu_s = 0.5 ... 0.9 of the mean tau/p that precursors leave; its RMS distance "
        "from mu_k is "
        + ", ".join(f"{rms(values):.3f} at {mu_s:g}" for mu_s, values in ratio.items()),
        [both],
    )
    apart = {mu_s: float(np.mean(prediction_error(record))) for mu_s, record in by_mu_s.items()}
    yield Claim(
        "9b",
        "the state at arrest depends only weakly on mu_s: force at equal length",
        _slope(apart),
        Band(None, 0.1, "0 is no dependence, 1 is F_T = mu_s F_N; the paper gives no number"),
        "slope over mu_s of the mean F_arrest - F_pred(n), over F_N: "
        + ", ".join(f"{value:.4f} at {mu_s:g}" for mu_s, value in apart.items()),
        [both],
    )
    left = {name: left_behind(runs[name]) for name in BY_D_C}
    far = {name: size(values) for name, values in left.items()}
    worst = max(far[name] for name, d_c in BY_D_C.items() if 0 < d_c <= 2e-6)
    middle = to.each(
        "tau halfway from mu_k p to mu_s p, with weakening",
        _towards_mu_s,
        [name for name, d_c in BY_D_C.items() if d_c > 0],
    )
    texts = [
        f"{1e6 * d_c:g}: {stated(far[name])} ({weighted(left[name])}; "
        f"{len(growing(runs[name]))} precursors)"
        for name, d_c in BY_D_C.items()
    ]
    yield Claim(
        "9c",
        "it holds with slip weakening over less than a few um",
        worst,
        Band(None, 0.1, TENTH, "(mu_s - mu_k)"),
        f"claim 8's RMS, worst of d_c = 0.5, 1, 2 um; at d_c in um: {', '.join(texts)}",
        [middle],
        "the last precursor raises it, as in claim 8 (linear geometry here). From about 5 um on, "
        "slip grows stably at the driver's pace before it breaks out; these runs end at 0.5 s "
        "instead of 0.92 s",
    )
    yield Claim(
        "9d",
        "and is no further from mu_k p than without weakening",
        worst / far["d_c 0"],
        Band(None, 1.1, "1 is as far as without; a tenth more is allowed: the paper has no number"),
        "the value of 9c, over that at d_c = 0",
        [middle],
    )


def _as_mu_s(record: Record) -> Record:
    tau = record.tau_after * record.scene.interface.mu_s / 0.7
    return FORCE_AS_MU_S(record).replace(tau_after=tau)


def _towards_mu_s(record: Record) -> Record:
    tau = 0.5 * (record.tau_after + record.scene.interface.mu_s * record.p_after)
    return record.replace(tau_after=tau)


def _by_mu_s(runs: Runs) -> dict[float, Record]:
    """Return mu_s -> run in linear geometry, in the order of mu_s."""
    return dict(sorted((runs[name].scene.interface.mu_s, runs[name]) for name in (BASE, *BY_MU_S)))


def _slope(numbers: dict[float, float]) -> float:
    return abs(np.polyfit(list(numbers), list(numbers.values()), 1)[0])


@claim("10", "fig1", BASE, *BY_MU_S)
def _force_at_sliding(runs: Runs) -> Iterator[Claim]:
    record = runs["fig1"]
    last = analysis.precursor_lengths(record).iloc[-1]
    yield Claim(
        "10a",
        "the last precursor nearly spans the interface",
        last["L_p_over_L"],
        Band(0.9, None, "nearly, read as nine tenths: the paper has no number", "L"),
        "largest L_p/L before the first event over the whole interface, Fig. 1 scene",
        [to.each("without the precursors beyond 0.8 L", to.without_long)],
    )
    yield Claim(
        "10b",
        "it leaves a force of about mu_k F_N",
        record.scene.law.static.scaled(last["force"]),
        Band(-0.1, 0.1, TENTH, "(mu_s - mu_k)"),
        "R = (F_T/F_N - mu_k)/(mu_s - mu_k) of the static force at arrest, "
        f"{last['force']:.4f} F_N",
        [to.each("mu_k = 0.4", to.in_scene(mu_k=0.4))],
    )
    R = {mu_s: _largest(group) for mu_s, group in _by_mu_s(runs).items()}
    source = "as in 10b: 0 where mu_k sets the force, 1 where mu_s does"
    yield Claim(
        "10c",
        "the largest force is only slightly above mu_k F_N, whatever mu_s",
        max(R.values(), key=abs),
        Band(-0.1, 0.1, source, "(mu_s - mu_k)"),
        "R of the largest static force up to the first system-size event, largest |R| over all "
        "mu_s: "
        + ", ".join(f"{stated(value)} at {mu_s:g}" for mu_s, value in R.items())
        + f"; Fig. 1 scene up to 2 s: {stated(analysis.friction_coefficients(record).R)}",
        [to.each("forces in proportion to mu_s", FORCE_AS_MU_S)],
        "an event has to nucleate at the trailing edge, where tau reaches mu_s p: the force at "
        "which the whole interface goes feels mu_s a little, by R at all mu_s. A change of mu_s "
        "changes F_max/F_N by R times as much",
    )


def _largest(record: Record) -> float:
    """Return the largest scaled start force of events up to the first system-size event."""
    sliding = analysis.system_size_events(record)["event"]
    if not len(sliding):
        return np.nan
    force = record.events["F_T_start"].loc[: sliding.iloc[0]].max() / record.scene.F_N
    return float(record.scene.law.static.scaled(force))


@claim("11", "fig1", BASE, *MATTRESS)
def _normal_force(runs: Runs) -> Iterator[Claim]:
    record = runs["fig1"]
    falls, ahead = _falls(record)
    readings = {BASE: "0.4 MN/m in all"} | MATTRESS
    yield Claim(
        "11a",
        "p falls behind a precursor, by up to 30 %",
        max(falls),
        Band(0.25, 0.35, "30 % to the nearest ten per cent"),
        "largest 1 - p/p_initial after arrest over h + l < x < L_p, of all precursors; in order: "
        + ", ".join(f"{value:.3f}" for value in falls)
        + "; in linear geometry, by the stiffness of the mattress: "
        + listed({what: max(_falls(runs[name])[0]) for name, what in readings.items()}),
        [to.each("p as at F_T = 0", to.p_unchanged)],
        "the largest is that of the last precursor; the paper's Fig. 4(a) shows the 11th. The "
        "paper's 0.4 MN/m may be that of the whole mattress, as here, or that on each top block",
    )
    yield Claim(
        "11b",
        "p is unchanged ahead of it",
        rms(np.concatenate(ahead)),
        Band(None, 0.1, "a third of the 30 % behind: the paper has no number"),
        "RMS of p/p_initial - 1 over x > L_p + h, all precursors; in order: "
        + ", ".join(f"{rms(values):.3f}" for values in ahead),
        [to.each("seen from the leading edge", to.mirrored)],
        "p rises towards the leading edge, which takes up the moment F_T h: most after the last "
        "precursors",
    )
    events = analysis.system_size_events(record)["event"]
    after = [
        analysis.stress_profile(record, event, "after")["p_over_p_initial"] for event in events
    ]
    enough = len(after) >= 4
    yield Claim(
        "11c",
        "p(x) is reproducible between events over the whole interface",
        np.std(np.array(after)[:, corner(record) :], axis=0).max() if enough else np.nan,
        Band(None, 0.03, "a tenth of the 30 %: the paper has no number"),
        f"largest standard deviation of p/p_initial at x > h + l just after {len(after)} such "
        "events",
        [to.each("p/p_initial shuffled along the interface", to.p_shuffled)],
    )


def _falls(record: Record) -> tuple[list[float], list[np.ndarray]]:
    """Return for each precursor the largest fall of p/p_initial behind, and its change ahead."""
    falls, ahead = [], []
    for event in analysis.precursor_lengths(record)["event"]:
        table, tip = analysis.stress_profile(record, event, "after"), reach(record, event)
        ratio, n = table["p_over_p_initial"].to_numpy(), table["n"].to_numpy()
        behind = ratio[(n > corner(record)) & (n < tip)]
        falls.append(float(1 - behind.min()) if behind.size else 0.0)
        ahead.append(ratio[n > tip + record.scene.j_h] - 1)
    return falls, ahead
