"""The runs behind the paper's figures.

Each is a `pyfric.Job`, for `pyfric.run_all`. Engine and step are left to the planner; geometry is
chosen here where it matters for the cost: finite geometry costs two to five times more. Forces in
linear geometry are within about 1 % of F_N of it (`reference_data/`).

Source: PRL 107, 074301 (2011), Figs. 1 to 4.
"""

from __future__ import annotations

from pyfric.engines import Job
from pyfric.scene import Scene, preset, setup1

__all__ = ["FIG1", "FIG2A", "FIG2B", "FIG4A", "FIG4B", "RUNS"]

LENGTHS = {"want": "precursors", "tolerance": 0.02, "geometry": "linear"}
SPEEDS = {"want": "front_speed", "tolerance": 0.05, "geometry": "linear"}

FIG1 = Job(scene=preset("fig1"), t_end=2.0, options={"want": "stress", "tolerance": 0.01})
"""The scene of Figs. 1(b), 3(a) and 3(b), up to the seventh event over the whole interface."""


def _fig2a(L: float, h: float, F_N: float) -> Scene:
    name = f"L = {L * 1e3:g} mm, h = {h * 1e3:g} mm, F_N = {F_N:g} N"
    return setup1(L=L, h=h, F_N=F_N, name=name)


FIG2A = tuple(
    Job(scene=_fig2a(L, h, F_N), t_end=1.02 * F_N / 3500, options=LENGTHS)
    for L in (0.14, 0.2)
    for h in (2.5e-3, 5e-3, 7.5e-3, 10e-3, 12.5e-3, 15e-3)
    for F_N in (1750.0, 2700.0, 3500.0)
    if F_N == 2700.0 or h in (5e-3, 10e-3)
)
"""Setup 1 up to about the first event over the whole interface: all h, and all F_N at h = 5 and
10 mm, because in linear geometry F_N only sets the scale."""

FIG2B = tuple(
    Job(scene=preset(name), t_end=0.7, options={"want": "precursors", "tolerance": 0.03})
    for name in ("setup2-", "setup2", "setup2+")
)
"""Setup 2 with theta = -0.833, 0 and 0.833, up to about the first event over the interface."""

FIG4A = Job(scene=preset("fig1"), t_end=0.8, options=SPEEDS | {"geometry": "finite"})
"""The Fig. 1 scene with located switches, up to its 11th main precursor and a little further."""

FIG4B = tuple(
    Job(scene=preset(name), t_end=t_end, options=SPEEDS)
    for name, t_end in (("run1", 0.8), ("run2", 0.9), ("run3", 1.0), ("run4", 1.1))
)
"""Runs 1 to 4, beyond the first event over the whole interface."""

RUNS: dict[str, Job | tuple[Job, ...]] = {
    "fig1": FIG1,
    "fig2a": FIG2A,
    "fig2b": FIG2B,
    "fig4a": FIG4A,
    "fig4b": FIG4B,
}
"""What figures are drawn from (`pyfric.figures.FIGURES`): one run, or several."""
