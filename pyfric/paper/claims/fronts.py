"""Claims 12 to 16: speeds of fronts and waves, and what results hardly depend on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.engines import relaxation_time
from pyfric.paper.claims import damage as to
from pyfric.paper.claims.claim import Claim, Row, Runs, damaged, replaced, row
from pyfric.paper.claims.parts import force_step, forces_apart, growing
from pyfric.paper.claims.runs import BASE, ETA, FRONTS, K_F, SPEEDS
from pyfric.record import analysis
from pyfric.scene import Scene, preset
from pyfric.statics import dispersion

if TYPE_CHECKING:
    from pyfric.record import Record

__all__ = ["ROWS"]

ROWS: dict[str, Row] = {}
"""Number -> row."""


def _shear_speed(scene: Scene) -> float:
    return float(scene.slider.l * np.sqrt(scene.slider.k / (2 * scene.m)))


BACKWARDS = damaged("times from block to block in reverse order", to.each(to.fronts_backwards))
SHUFFLED = damaged("v_c shuffled along each front", to.each(to.fronts_shuffled))


@row(
    ROWS,
    "12",
    *SPEEDS,
    damage=dict.fromkeys("abde", BACKWARDS) | {"c": SHUFFLED},
)
def _claim_12(runs: Runs) -> list[Claim]:
    tables = {what: _eleventh(runs[name]) for name, what in SPEEDS.items()}
    first = {
        what: float(table.loc[table["x_over_L"] < 0.25, "v_c"].max())
        for what, table in tables.items()
    }
    last = {what: float(table["v_c"].dropna().iloc[-1]) for what, table in tables.items()}
    converged, *_, paper = SPEEDS.values()
    table = tables[converged]
    how = "v_c of the 11th main precursor, Fig. 1 scene, "

    def start(number: str, what: str) -> Claim:
        return Claim(
            number=number,
            text=f"fronts start at about 2400 m/s near the trailing edge: {what}",
            value=first[what],
            unit="m/s",
            low=2350.0,
            high=2450.0,
            how=f"{how}largest at x < L/4; {_listed(first)}",
            source=DIGITS,
        )

    def end(number: str, what: str) -> Claim:
        return Claim(
            number=number,
            text=f"and come down to about 400 m/s before arrest: {what}",
            value=last[what],
            unit="m/s",
            low=350.0,
            high=450.0,
            how=f"{how}the last one; {_listed(last)}",
            source=DIGITS,
        )

    return [
        start("12a", converged),
        end("12b", converged),
        Claim(
            number="12c",
            text="following tau/p",
            value=float(table["v_c"].corr(table["tau_over_p"], method="spearman")),
            low=0.5,
            how="rank correlation of v_c with tau/p at initiation, block by block",
            source="1 is exact, 0 is none; nearer to 1",
        ),
        start("12d", paper),
        end("12e", paper),
    ]


DIGITS = "about, read as to the nearest hundred, the paper's digits"


def _eleventh(record: Record) -> pd.DataFrame:
    """The front of the 11th main precursor."""
    return analysis.front(record, int(analysis.precursors(record)["event"].iloc[10]))


def _listed(numbers: dict[str, float]) -> str:
    return ", ".join(f"{what}: {value:.0f}" for what, value in numbers.items())


ONE_CURVE = "1 is one curve, 0 is none; nearer to 1"
PERMUTATIONS = 99


@row(
    ROWS,
    "13",
    *FRONTS,
    damage=dict.fromkeys("acde", SHUFFLED)
    | {"b": damaged("tau/p scaled by mu_k and mu_s", to.each(to.scaled_prestress))},
)
def _claim_13(runs: Runs) -> list[Claim]:
    table = _points(runs)
    paper, fig1 = table[table["run"] != "fig4a"], table[table["run"] == "fig4a"]
    whole = runs["fig4a"].events["L_p_over_L"] >= 1
    fig1 = fig1[fig1["event"] <= whole.idxmax()] if whole.any() else fig1
    eleven = analysis.precursors(runs["fig4a"])["event"].iloc[:11]
    first = fig1[fig1["event"] <= eleven.max()]
    pairs, one = explained(paper, "tau_over_p", "pair"), explained(paper, "tau_over_p")
    scaled = explained(paper, "scaled")
    chance = {by: _by_chance(paper, *by) for by in (("tau_over_p", "pair"), ("scaled", ""))}
    listed = "; alone " + ", ".join(
        f"{name}: {explained(rows, 'tau_over_p'):.2f}" for name, rows in table.groupby("run")
    )
    most = max(found.max() for found in chance.values())
    return [
        Claim(
            number="13a",
            text="v_c against tau/p is one curve per friction pair, for all events and geometries",
            value=pairs,
            low=0.5,
            how="variance of ln v_c explained by tau/p, runs 1 to 4: 1 - (RMS about a binned "
            f"median, one for each pair)^2 / variance; {len(paper)} points{listed}; shuffled along "
            f"each front at most {chance['tau_over_p', 'pair'].max():.2f}",
            source=ONE_CURVE,
        ),
        Claim(
            number="13b",
            text="against tau/p, the pairs have different curves",
            value=math.sqrt((1 - one) / (1 - pairs)),
            low=1.1,
            how=f"RMS of ln v_c about one curve for all (explains {one:.2f}) over that about one "
            f"for each pair ({pairs:.2f})",
            source="1 if pairs had the same curve; a tenth more: the paper has no number",
        ),
        Claim(
            number="13c",
            text="against the scaled prestress, all fall on one curve",
            value=scaled,
            low=0.5,
            how="as 13a, by (tau/p - mu_k)/(mu_s - mu_k), one curve for all; shuffled along each "
            f"front at most {chance['scaled', ''].max():.2f}",
            source=ONE_CURVE,
        ),
        Claim(
            number="13d",
            text="and not by chance",
            value=float(min(pairs, scaled) - most),
            low=0.1,
            how="what 13a or 13c explains, more than the best of "
            f"{PERMUTATIONS} permutations of v_c along each front; all would have it at p = "
            f"{1 / (1 + PERMUTATIONS):.2g}",
            source="a tenth: the paper has no number",
        ),
        Claim(
            number="13e",
            text="the same in the Fig. 1 scene alone",
            value=explained(fig1, "tau_over_p"),
            low=0.5,
            how=f"as 13a, up to the first event over the whole interface, {len(fig1)} points; "
            f"up to the 11th precursor {explained(first, 'tau_over_p'):.2f}",
            source=ONE_CURVE,
        ),
    ]


def _points(runs: Runs) -> pd.DataFrame:
    """Speeds of all fronts, with the run and its friction."""
    tables = []
    for name in FRONTS:
        friction = runs[name].scene.interface
        table = analysis.fronts(runs[name]).assign(run=name)
        tables.append(table.assign(pair=f"{friction.mu_s:g}/{friction.mu_k:g}"))
    table = pd.concat(tables, ignore_index=True)
    return table[np.isfinite(table["v_c"]) & np.isfinite(table["tau_over_p"])]


def explained(table: pd.DataFrame, axis: str, by: str = "") -> float:
    """Share of the variance of ln v_c that an axis explains, by one curve or one for each group."""
    groups = [rows for _, rows in table.groupby(by)] if by else [table]
    parts = [analysis.collapse_spread(rows[axis], rows["v_c"]) for rows in groups]
    left = sum(part.n * part.rms**2 for part in parts) / sum(part.n for part in parts)
    return float(1 - left / np.var(np.log(table["v_c"])))


def _by_chance(table: pd.DataFrame, axis: str, by: str) -> np.ndarray:
    """What the axis explains after v_c was shuffled along each front, many times."""
    rng = np.random.default_rng(0)
    fronts = list(table.groupby(["run", "event"]).indices.values())
    found = []
    for _ in range(PERMUTATIONS):
        v_c = table["v_c"].to_numpy().copy()
        for rows in fronts:
            v_c[rows] = rng.permutation(v_c[rows])
        found.append(explained(table.assign(v_c=v_c), axis, by))
    return np.array(found)


@row(
    ROWS,
    "14",
    damage=dict.fromkeys(
        "ab", replaced("1 % less stiffness", scene=preset("fig1", k=0.99 * preset("fig1").slider.k))
    ),
)
def _claim_14(runs: Runs, scene: Scene | None = None) -> list[Claim]:
    scene = preset("fig1") if scene is None else scene
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


BY_ETA = tuple(f"eta {share:g}" for share in ETA)
BY_K_F = tuple(f"k_f {share:g}" for share in K_F)
MORE = damaged(
    "a tenth more force", to.each(to.with_force(lambda _, f: 1.1 * f), [*BY_ETA, *BY_K_F])
)


@row(
    ROWS,
    "15",
    BASE,
    *BY_ETA,
    *BY_K_F,
    damage={
        "a": MORE,
        "b": MORE,
        "c": damaged(
            "every second main event left out", to.each(to.every_second, [*BY_ETA, *BY_K_F])
        ),
    },
)
def _claim_15(runs: Runs) -> list[Claim]:
    waits = []
    for name in BY_ETA:
        interval = float(np.median(np.diff(analysis.precursors(runs[name])["t_start"])))
        waits.append(f"{relaxation_time(runs[name].scene) / interval:.2f}")
    count = {name: len(growing(runs[name])) for name in (BASE, *BY_ETA, *BY_K_F)}
    more = {name: abs(number - count[BASE]) for name, number in count.items()}
    return [
        _similar(
            "15a",
            "any viscosity with underdamped blocks and calm between events gives similar results",
            runs,
            BY_ETA,
            "; eta in sqrt(k m), below 0.433; slowest decay over the interval: "
            f"{', '.join(waits)}, below 0.25",
        ),
        _similar(
            "15b",
            "any foundation stiffer than the bonds gives similar results",
            runs,
            BY_K_F,
            "; k_f in k",
        ),
        Claim(
            number="15c",
            text="viscosity and foundation leave the number of precursors",
            value=float(max(more.values())),
            unit="precursors",
            high=1.0,
            how=f"largest difference from {count[BASE]}, of all these runs; by viscosity alone "
            f"{max(more[name] for name in BY_ETA)}; at k_f = k, "
            f"{', '.join(f'{share:g} k' for share in K_F)}: "
            + ", ".join(str(count[name]) for name in (BASE, *BY_K_F)),
            source="one more or less may end before sliding; the paper says similar",
            note="on a stiffer foundation precursors follow the same curve in longer steps",
        ),
    ]


def _similar(number: str, text: str, runs: Runs, names: tuple[str, ...], more: str) -> Claim:
    """Claim 15a or 15b."""
    base = growing(runs[BASE])
    tables = {name: growing(runs[name]) for name in names}
    apart = {name: np.abs(forces_apart(table, base)) for name, table in tables.items()}
    listed = ", ".join(
        f"{name}: {d.max():.4f} F_N ({len(tables[name])})" for name, d in apart.items()
    )
    return Claim(
        number=number,
        text=text,
        value=float(max(d.max() for d in apart.values()) / force_step(base)),
        unit="steps",
        high=0.5,
        how="largest distance in force, at equal length, from the default, over the mean step "
        f"between precursors; with their number, {len(base)} at the default: {listed}{more}",
        source="half a step between precursors: the paper says similar, without a number",
    )


@row(
    ROWS,
    "16",
    *FRONTS,
    damage={"": damaged("fronts 20 times slower", to.each(to.fronts_slower(20.0)))},
)
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
