"""The runs behind the paper's figures.

Each is a `pyfric.Job`, for `pyfric.run_all`, by the hybrid engine with located switches. The Fig. 1
scene and those with its h in which F_N differs are in finite geometry. All others are in linear
geometry, where F_N only sets the scale of forces: finite geometry costs two to five times more, and
forces in linear geometry are within about 1 % of F_N of it (`reference_data/`). Steps are half of
the stability limit in setup 1 and two thirds of it in setup 2. With nine tenths of it one event is
right (rupture times to 3e-8 s), but over a whole run some event comes early: 10 precursors below
L/2 instead of 9 at L = 140 mm.

Source: PRL 107, 074301 (2011), Figs. 1 to 4.
"""

from __future__ import annotations

from pyfric.scene import preset, setup1
from pyfric.sweeps import Job

FINITE = {"fidelity": "hybrid", "geometry": "finite", "switching": "located"}
LINEAR = {"fidelity": "hybrid", "geometry": "linear", "switching": "located"}
SETUP2 = LINEAR | {"dt": 4.5e-7}
"""Setup 2, where the limit is 0.68 us."""

FIG1 = Job(scene=preset("fig1"), t_end=2.0, options=FINITE)
"""The scene of Figs. 1(b), 3 and 4(a), up to the seventh event over the whole interface."""


FIG4B = tuple(
    Job(scene=preset(name), t_end=t_end, options=LINEAR)
    for name, t_end in (("run1", 0.8), ("run2", 0.9), ("run3", 1.0), ("run4", 1.1))
)
"""Runs 1 to 4, beyond the first event over the whole interface."""


def _fig2a(L: float, h: float, F_N: float, options: dict[str, str]) -> Job:
    name = f"L = {L * 1e3:g} mm, h = {h * 1e3:g} mm, F_N = {F_N:g} N"
    t_end = (0.95 if 5e-3 <= h <= 10e-3 else 1.02) * F_N / 3500
    return Job(scene=setup1(L=L, h=h, F_N=F_N, name=name), t_end=t_end, options=options)


FIG2A = (
    *(
        FIG4B[3] if (L, h) == (0.2, 10e-3) else _fig2a(L, h, 2700.0, LINEAR)
        for L in (0.14, 0.2)
        for h in (2.5e-3, 5e-3, 7.5e-3, 10e-3, 12.5e-3, 15e-3)
    ),
    FIG1,
    _fig2a(0.14, 5e-3, 1750.0, FINITE),
    *(_fig2a(0.2, 5e-3, F_N, FINITE) for F_N in (1750.0, 3500.0)),
)
"""Setup 1 up to about the first event over the whole interface: all L and h, one of them run 4, and
other F_N in finite geometry at h = 5 mm."""

FIG2B = tuple(
    Job(scene=preset(name), t_end=0.68, options=SETUP2) for name in ("setup2-", "setup2", "setup2+")
)
"""Setup 2 with theta = -0.833, 0 and 0.833, up to about the first event over the interface."""

RUNS: dict[str, Job | tuple[Job, ...]] = {
    "fig1": FIG1,
    "fig2a": FIG2A,
    "fig2b": FIG2B,
    "fig4b": FIG4B,
}
"""What figures are drawn from (`pyfric.figures.FIGURES`): one run, or several."""
