"""Claims 12 to 16: speeds of fronts and waves, and what results hardly depend on."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from pyfric.engines import decay_times
from pyfric.paper.claims.claim import Claim, Row, Runs, row
from pyfric.paper.claims.parts import force_step, forces_apart, growing
from pyfric.paper.claims.runs import BASE, ETA, FRONTS, K_F
from pyfric.record import analysis
from pyfric.scene import Scene, preset
from pyfric.statics import dispersion

__all__ = ["ROWS"]

ROWS: dict[str, Row] = {}
"""Number -> row."""


def _shear_speed(scene: Scene) -> float:
    return float(scene.slider.l * np.sqrt(scene.slider.k / (2 * scene.m)))


@row(ROWS, "12", "fig4a")
def _claim_12(runs: Runs) -> list[Claim]:
    record = runs["fig4a"]
    table = analysis.front(record, int(analysis.precursors(record)["event"].iloc[10]))
    speed = table["v_c"].dropna()
    switching = record.method.switching.replace("_", " ")
    how = f"v_c of the 11th main precursor, Fig. 1 scene, {switching} switching: "
    return [
        Claim(
            number="12a",
            text="fronts start at about 2400 m/s near the trailing edge",
            value=float(speed[table["x_over_L"] < 0.25].max()),
            unit="m/s",
            low=2264.0,
            high=2536.0,
            how=how + "largest at x < L/4",
            source="2400 m/s, give or take half the range over switches at the ends of steps of "
            "0.4, 0.2, 0.1, 0.05 us: 2297, 2478, 2521, 2570 m/s",
            note="the paper's own method, switches at the ends of steps of 0.2 us, gives 2478 m/s, "
            "within the band; with smaller steps the speed rises to the converged value, 2604 m/s",
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


@row(ROWS, "13", *FRONTS)
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


@row(ROWS, "14")
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


@row(ROWS, "15", BASE, *(f"eta {share:g}" for share in ETA), *(f"k_f {share:g}" for share in K_F))
def _claim_15(runs: Runs) -> list[Claim]:
    base = growing(runs[BASE])
    changed = [*(f"eta {share:g}" for share in ETA), *(f"k_f {share:g}" for share in K_F)]

    def part(number: str, text: str, names: list[str], more: str) -> Claim:
        apart = {name: np.abs(forces_apart(growing(runs[name]), base)) for name in names}
        listed = ", ".join(
            f"{name}: {d.max():.4f} F_N ({len(growing(runs[name]))})" for name, d in apart.items()
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
            value=float(max(abs(len(growing(runs[name])) - len(base)) for name in changed)),
            unit="precursors",
            high=1.0,
            how=f"largest difference from {len(base)}, of all these runs; by viscosity alone "
            f"{max(abs(len(growing(runs[name])) - len(base)) for name in changed[: len(ETA)])}",
            source="one more or less may end before sliding; the paper says similar",
            note="on a stiffer foundation precursors follow the same curve in longer steps",
        ),
    ]


@row(ROWS, "16", *FRONTS)
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
