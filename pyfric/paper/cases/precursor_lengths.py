"""Y. Katano and others, 2014: length of precursors over force, and the static friction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from pyfric.figures import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILION, DataFigure, legend, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.record import analysis
from pyfric.scene import preset
from pyfric.sweeps import Job

BASE: dict[str, dict[str, Any]] = {"as in Fig. 1": {}}
MOVING: dict[str, dict[str, Any]] = {"with inertia": {}, "V/2": {"V": 0.39375e-3}}
"""Name of a run with inertia -> changes of its scene. Quasi-static runs do not depend on V."""
RUNS = (
    BASE
    | MOVING
    | {
        "h = 10 mm": {"h": 10e-3},
        "F_N/2": {"F_N": 1750.0},
        "2 F_N": {"F_N": 7000.0},
    }
)
WAY = 0.85e-3
"""Displacement of the driver under F_N = 3500 N just after the first system-size event, m."""
HOW = {"verify": "none"}


@case(
    "Length of precursors over force: two straight lines, and what they depend on",
    "Y. Katano, K. Nakano, M. Otsuki, H. Matsukawa, Sci. Rep. 4, 6324 (2014), "
    "doi:10.1038/srep06324",
    "trend",
    {
        "V, h, F_z": "l/L over F_x/W does not depend on V and h, and depends on F_z (Fig. 2)",
        "fit": "two straight lines, for small and large F_x/W (Fig. 2)",
        "scene": "setup 1 of the paper of pyfric; the source has another slider",
    },
)
def precursor_lengths(
    run: Runner, *, variants: Mapping[str, Mapping[str, Any]] = RUNS, slider: str = "fig1"
) -> Found:
    """Measure lengths against force for different V, h and loads; `slider` is a preset."""
    jobs = []
    for name, changes in variants.items():
        scene = preset(slider, changes)
        engine = {"fidelity": "hybrid" if name in MOVING else "quasistatic"}
        jobs.append(Job(scene, WAY * scene.F_N / 3500 / scene.driver.V, HOW | engine))
    rows, peaks = [], {}
    for name, record in zip(variants, run(jobs), strict=True):
        table = analysis.precursor_lengths(record)[["force", "L_p_over_L"]]
        rows.append(table.assign(run=name))
        peaks[name] = float(record.events["F_T_start"].max() / record.scene.F_N)
    table = pd.concat(rows, ignore_index=True)
    curves = {name: table[table["run"] == name] for name in variants}
    base = curves["as in Fig. 1"]

    def apart(name: str, of: str) -> float:
        return _apart(curves[of], curves[name]) if {name, of} <= set(curves) else np.nan

    rms, slopes = _lines(base)
    chain = [given("a chain", variants=BASE, slider="chain")]
    fast = BASE | MOVING | {"V/2": {"V": 7.875e-3}}
    faster = [given("ten times V instead", variants=fast)]
    lower = [given("a driver at 40 mm", variants=BASE | {"h = 10 mm": {"h": 40e-3}})]
    parts = [
        Claim(
            "precursor_lengths a",
            "trend: l/L over F_x/W is two straight lines, the second one steeper",
            slopes if rms < 0.03 else np.nan,
            Band(1.5, None, "Fig. 2 of the source; factor and fit (rms 0.03 L) are choices"),
            f"ratio of the slopes of two lines (rms {rms:.3f} L)",
            chain,
        ),
        Claim(
            "precursor_lengths b",
            "trend: no dependence on V",
            apart("V/2", "with inertia"),
            Band(None, 0.02, "Fig. 2; half a block is 0.01 L", "L"),
            "largest difference of length at equal F_x/W, V halved",
            faster,
            "With inertia, by the hybrid engine; quasi-static lengths cannot depend on V.",
        ),
        Claim(
            "precursor_lengths c",
            "trend: no dependence on h",
            apart("h = 10 mm", "as in Fig. 1"),
            Band(None, 0.05, "Fig. 2; the width is a choice", "L"),
            "the same, h = 5 and 10 mm",
            lower,
            "The model's first precursor is as long as the stress that the driver concentrates.",
        ),
        Claim(
            "precursor_lengths d",
            "trend: static friction falls with the load",
            (peaks.get("2 F_N", np.nan) - peaks.get("F_N/2", np.nan)) * 4,
            Band(None, -0.01, "abstract; the size is a choice"),
            "change of the largest F_T/F_N with a load four times as large, times 4",
            [given("the same load twice", variants=RUNS | {"F_N/2": {}, "2 F_N": {}})],
            "Linear geometry and Amontons-Coulomb friction are homogeneous: F_T/F_N and lengths do "
            "not depend on F_N. The source's theory needs friction that falls with speed.",
        ),
    ]
    return Found(parts, lambda: _drawn(table))


def _apart(base: pd.DataFrame, other: pd.DataFrame) -> float:
    """Return the largest difference of lengths, over L, at forces within both curves."""
    low = max(base["force"].min(), other["force"].min())
    high = min(base["force"].max(), other["force"].max())
    force = np.linspace(low, high, 200)
    lengths = [np.interp(force, curve["force"], curve["L_p_over_L"]) for curve in (base, other)]
    return float(np.abs(lengths[0] - lengths[1]).max())


def _lines(curve: pd.DataFrame) -> tuple[float, float]:
    """Return RMS deviation (L) from the best two lines of three or more points; slope ratio."""
    x, y = curve["force"].to_numpy(), curve["L_p_over_L"].to_numpy()
    best = np.inf, np.nan
    for split in range(3, len(x) - 2):
        lines = [np.polyfit(x[part], y[part], 1) for part in (slice(split), slice(split, None))]
        error = y - np.concatenate(
            [np.polyval(lines[0], x[:split]), np.polyval(lines[1], x[split:])]
        )
        best = min(best, (float(np.sqrt(np.mean(error**2))), float(lines[1][0] / lines[0][0])))
    return best


def _drawn(table: pd.DataFrame) -> DataFigure:
    fig, (axes,) = panels(2.4)
    colours = (BLACK, PURPLE, ORANGE, BLUE, VERMILION, GREEN)
    for (name, marker), colour in zip(
        zip(table["run"].unique(), "oD+s^x", strict=False), colours, strict=False
    ):
        rows = table[table["run"] == name]
        axes.plot(
            rows["force"], rows["L_p_over_L"], marker, color=colour, ms=4, mfc="none", label=name
        )
    axes.set(xlabel="$F_T/F_N$ after the precursor", ylabel="$L_p/L$")
    legend(axes, loc="upper left")
    fig.caption = (
        "Lengths of precursors over force in setup 1, quasi-static, or with inertia. Half the "
        "speed changes next to nothing, the load nothing, the height of the driver the first ones."
    )
    fig.tables = {"lengths": table}
    return fig
