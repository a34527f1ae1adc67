"""Claims 12 to 16: speeds of fronts and waves, and parameters with little effect."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.engines import relaxation_time
from pyfric.paper.claims import damage as to
from pyfric.paper.claims.claim import Band, Claim, Damage, Runs, claim
from pyfric.paper.claims.quantities import furthest, growing, listed
from pyfric.paper.claims.shares import DRAWS, SCATTER, position_alone, shares, told
from pyfric.paper.runs import BASE, BY_ETA, BY_K_F, FRONTS, SPEEDS
from pyfric.record import analysis
from pyfric.scene import Scene, preset
from pyfric.statics import dispersion

if TYPE_CHECKING:
    from pyfric.record import Record

Speeds = Callable[[pd.DataFrame], pd.DataFrame]
"""Function that changes the speeds of points on fronts."""
ABOUT = "about: to the nearest hundred, like the paper's digits"
OVER_FRONTS = "the interval of 95 % of a bootstrap over fronts"
LEFT = "the share that {} explains of what the position along the front leaves"
TENTH = f"a tenth: the paper has no number; the lower end of {OVER_FRONTS}"
NEARER = f"1 is one curve, 0 is none; the lower end of {OVER_FRONTS} is nearer to 1"


@claim("12", *SPEEDS)
def _front_of_fig4a(runs: Runs, speeds: Speeds = lambda points: points) -> Iterator[Claim]:
    tables = {what: _eleventh(runs[name]) for name, what in SPEEDS.items()}
    first = {
        what: float(table.loc[table["x_over_L"] < 0.25, "v_c"].max())
        for what, table in tables.items()
    }
    last = {what: float(table["v_c"].dropna().iloc[-1]) for what, table in tables.items()}
    converged, *_, as_the_paper = SPEEDS.values()
    how = "v_c of the 11th main precursor, Fig. 1 scene, "
    backwards = to.each("times from block to block in reverse order", to.fronts_backwards)
    why = (
        "fronts of the paper's steps, which switch late, and of a mass per area, with which waves "
        "are slower, are within the band: 12d, 12e"
    )
    for letters, what, reason in (("ab", converged, why), ("de", as_the_paper, "")):
        yield Claim(
            f"12{letters[0]}",
            f"fronts start at about 2400 m/s near the trailing edge: {what}",
            first[what],
            Band(2350, 2450, ABOUT, "m/s"),
            f"{how}largest at x < L/4; {listed(first, '.0f')}",
            [backwards],
            reason,
        )
        yield Claim(
            f"12{letters[1]}",
            f"and come down to about 400 m/s before arrest: {what}",
            last[what],
            Band(350, 450, ABOUT, "m/s"),
            f"{how}the last one; {listed(last, '.0f')}",
            [backwards],
            reason,
        )
    points = speeds(_up_to_sliding(runs["fig4a"]))
    found = shares(points, "tau_over_p")
    yield Claim(
        "12c",
        "following tau/p, not the position along the front alone",
        found.loc["low", "beyond"],
        _above_position(found, "beyond", 0.1, TENTH),
        _described(found, "beyond", LEFT.format("tau/p"), points),
        _without_prestress(
            scatter=("shuffled",)
        ),  # null data with random signs are in the band, too
        "along the one front of the paper's Fig. 4(a) tau/p and position fall together, which "
        "cannot tell them apart: here are all fronts of its scene up to the first event over the "
        "whole interface",
    )


def _eleventh(record: Record) -> pd.DataFrame:
    """Return the front of the 11th main precursor."""
    return analysis.front(record, int(analysis.precursors(record)["event"].iloc[10]))


def _points(record: Record) -> pd.DataFrame:
    """Return the speeds of all fronts of a run, with positions along the front."""
    table, friction = analysis.fronts(record), record.scene.interface
    n = table.groupby("event")["n"]
    first, last = n.transform("min"), n.transform("max")
    table["place"] = (table["n"] - first) / (last - first)
    table["front"] = record.scene.name + table["event"].astype(str)
    table["pair"] = f"{friction.mu_s:g}/{friction.mu_k:g}"
    known = np.isfinite(table["v_c"]) & np.isfinite(table["tau_over_p"])
    return table[known].reset_index(drop=True)


def _up_to_sliding(record: Record) -> pd.DataFrame:
    """Return the points of fronts up to the first event over the whole interface."""
    points, whole = _points(record), record.events["L_p_over_L"] >= 1
    return points[points["event"] <= whole.idxmax()] if whole.any() else points


def _shuffled(points: pd.DataFrame) -> pd.DataFrame:
    """Return the points with v_c shuffled along each front."""
    rng = np.random.default_rng(0)
    v_c = points.groupby("front")["v_c"].transform(
        lambda speeds: rng.permutation(speeds.to_numpy())
    )
    return points.assign(v_c=v_c)


def _without_prestress(by: str = "", scatter: Sequence[str] = SCATTER) -> list[Damage]:
    """Return damages for claims that prestress sets the speed."""
    what = "v_c that depends on the position along the front alone, the rest "
    words = {"signs": "with a random sign for each front", "shuffled": "shuffled"}
    alone = [
        to.given(what + words[kind], speeds=partial(position_alone, by=by, scatter=kind))
        for kind in scatter
    ]
    return [*alone, to.given("v_c shuffled along each front", speeds=_shuffled)]


def _above_position(found: pd.DataFrame, share: str, least: float, source: str) -> Band:
    """Return the band of a share: at least `least`, and above the share in null data."""
    null = math.ceil(100 * found.loc["null", share]) / 100
    alone = f"and no less than the {null:.2f} of data that depend on the position alone"
    return Band(max(least, null), None, f"{source}; {alone}")


def _described(found: pd.DataFrame, share: str, what: str, points: pd.DataFrame) -> str:
    shuffled, signs = found.loc[list(SCATTER), share]
    return (
        f"lower end of the interval of {what}: {told(found, share)}. Shares of the variance of "
        f"ln v_c: prestress {told(found, 'prestress')}; position along the front "
        f"{told(found, 'position')}; prestress, of what the position leaves, "
        f"{told(found, 'beyond')}; prestress, of speeds less the curve of the position, "
        f"{told(found, 'after')}. Data that depend on the position alone reach {signs:.2f}, with "
        f"shuffled residuals {shuffled:.2f} (97.5 % of {DRAWS} draws). "
        f"{len(points)} points, {points['front'].nunique()} fronts"
    )


@claim("13", *FRONTS[1:])
def _collapse(
    runs: Runs, speeds: Speeds = lambda points: points, axis: str = "tau_over_p"
) -> Iterator[Claim]:
    points = speeds(pd.concat([_points(record) for record in runs.values()], ignore_index=True))
    pairs, scaled = shares(points, axis, "pair"), shares(points, "scaled")
    yield Claim(
        "13a",
        "v_c against tau/p is one curve per friction pair, for all events and geometries",
        pairs.loc["low", "prestress"],
        _above_position(pairs, "prestress", 0.5, NEARER),
        _described(
            pairs,
            "prestress",
            "the share that one curve of tau/p for each friction pair explains",
            points,
        ),
        _without_prestress("pair"),
    )
    common, several = (found.loc["value", "prestress"] for found in (shares(points, axis), pairs))
    yield Claim(
        "13b",
        "against tau/p, the pairs have different curves",
        math.sqrt((1 - common) / (1 - several)),
        Band(
            1.1,
            None,
            "1 if pairs had the same curve; a tenth more is allowed: the paper has no number",
        ),
        f"RMS of ln v_c about one curve for all (explains {common:.2f}) over that about one for "
        f"each pair ({several:.2f})",
        [to.given("the scaled prestress for tau/p", axis="scaled")],
    )
    yield Claim(
        "13c",
        "against the scaled prestress, all fall on one curve",
        scaled.loc["low", "prestress"],
        _above_position(scaled, "prestress", 0.5, NEARER),
        _described(scaled, "prestress", "the share that one curve explains", points),
        _without_prestress(),
    )
    yield Claim(
        "13d",
        "the prestress explains more than the position along the front alone",
        scaled.loc["low", "beyond"],
        _above_position(scaled, "beyond", 0.1, TENTH),
        _described(scaled, "beyond", LEFT.format("the scaled prestress"), points),
        _without_prestress(),
        "both curves fitted at once; of speeds less the curve of the position, which has taken "
        "what both explain, the prestress explains less",
    )
    yield Claim(
        "13e",
        "and more than the position along the front does",
        scaled.loc["low", "more"],
        Band(0, None, f"the lower end of {OVER_FRONTS} is not below 0"),
        _described(scaled, "more", "what it explains beyond the position", points),
        _without_prestress()[:-1],
        "each may explain part of what the other leaves, see 13d",
    )


@claim("14")
def _waves(runs: Runs, scene: Scene | None = None) -> Iterator[Claim]:
    scene = preset("fig1") if scene is None else scene
    q, (N_x, N_z) = np.array([1e-3 / scene.slider.l, 0.0]), (scene.N_x, scene.N_z)
    factor = math.sqrt((N_x - 1) * (N_z - 1) / (N_x * N_z))
    shear, long = dispersion(scene, q)[0] / q[0]
    soft = preset("fig1", k=0.99 * preset("fig1").slider.k)
    for number, name, speed, expected in (
        ("14a", "longitudinal", long, 1677),
        ("14b", "shear", shear, 968),
    ):
        yield Claim(
            number,
            f"{name} waves travel at {expected} m/s",
            speed * factor,
            Band(expected - 0.5, expected + 0.5, "the paper's digits", "m/s"),
            f"plane wave of 2 pi 1000 l in the lattice: {speed:.1f} m/s with m = M/N, times "
            f"sqrt((N_x-1)(N_z-1)/(N_x N_z)) = {factor:.4f} for the mass per area",
            [to.given("1 % less stiffness", scene=soft)],
        )


@claim("15", BASE, *BY_ETA, *BY_K_F)
def _viscosity_and_foundation(runs: Runs) -> Iterator[Claim]:
    tables = {name: growing(record) for name, record in runs.items()}
    count = {name: len(table) for name, table in tables.items()}
    more_force = to.with_force(lambda _, force: 1.1 * force)
    waits = []
    for name in BY_ETA:
        interval = float(np.median(np.diff(analysis.precursors(runs[name])["t_start"])))
        waits.append(f"{relaxation_time(runs[name].scene) / interval:.2f}")
    for number, what, names, more in (
        (
            "15a",
            "any viscosity with underdamped blocks and rest between events gives similar results",
            BY_ETA,
            "; eta in sqrt(k m), below 0.433; slowest decay over the interval: "
            f"{', '.join(waits)}, below 0.25",
        ),
        (
            "15b",
            "any foundation stiffer than the bonds gives similar results",
            BY_K_F,
            "; k_f in k",
        ),
    ):
        value, apart = furthest([tables[name] for name in names], tables[BASE])
        each = zip(names, apart, strict=True)
        yield Claim(
            number,
            what,
            value,
            Band(None, 0.5, "half a step: the paper says similar, without a number", "steps"),
            "largest distance in force, at equal length, from the default, over the mean step "
            f"between precursors; with their number, {count[BASE]} at the default: "
            + ", ".join(f"{name}: {error:.4f} F_N ({count[name]})" for name, error in each)
            + more,
            [to.each("a tenth more force", more_force, [*BY_ETA, *BY_K_F])],
        )
    more = {name: abs(number - count[BASE]) for name, number in count.items()}
    yield Claim(
        "15c",
        "viscosity and foundation do not change the number of precursors",
        max(more.values()),
        Band(None, 1, "one precursor more or fewer: the paper says 'similar'", "precursors"),
        f"largest difference from {count[BASE]}, of all these runs; by viscosity alone "
        f"{max(more[name] for name in BY_ETA)}; at k_f = k, "
        f"{', '.join(f'{share:g} k' for share in BY_K_F.values())}: "
        + ", ".join(str(count[name]) for name in (BASE, *BY_K_F)),
        [to.each("every second main event left out", to.every_second, [*BY_ETA, *BY_K_F])],
        "on a stiffer foundation precursors follow the same curve in longer steps",
    )


@claim("16", *FRONTS)
def _no_slow_fronts(runs: Runs) -> Iterator[Claim]:
    slowest = {}
    for name, record in runs.items():
        c_s = record.scene.slider.l * math.sqrt(record.scene.slider.k / (2 * record.scene.m))
        slowest[name] = float(analysis.fronts(record)["v_c"].min() / c_s)
    source = "slow fronts are those below 0.05 c_s; fronts are followed down to 0.025 c_s"
    yield Claim(
        "16",
        "no very slow fronts with Amontons-Coulomb friction",
        min(slowest.values()),
        Band(0.05, None, source, "c_s"),
        f"smallest v_c within the fronts of all main events: {listed(slowest)}",
        [to.each("fronts 20 times slower", to.fronts_slower(20.0))],
    )
