"""The runs behind the paper's figures and claims.

Each run is a `pyfric.Job` for `pyfric.run_all`, with the hybrid engine and located switches. The
Fig. 1 scene, and scenes that differ from it in F_N, are in finite geometry. All others are in
linear geometry, in which F_N only sets the scale of forces. Finite geometry costs two to five times
more, and changes forces by about 1 % of F_N (`reference_data/`). Steps are half of the stability
limit in setup 1 and two thirds in setup 2. With nine tenths of the limit a single event is right
(rupture times to 3e-8 s). In a long run, however, some event comes early: there are 10 precursors
below L/2 in place of 9 at L = 140 mm.

Source: PRL 107, 074301 (2011), Figs. 1 to 4.
"""

from __future__ import annotations

import functools
import math
from typing import Any

from pyfric.scene import preset, setup1
from pyfric.sweeps import Job

HYBRID = {"fidelity": "hybrid", "accuracy": 1e-4, "switching": "located"}
"""Options of the hybrid engine. Errors of forces by jumps stay below 1e-3 F_N, the resolution of a
figure."""
FINITE, LINEAR = HYBRID | {"geometry": "finite"}, HYBRID | {"geometry": "linear"}
FIG1 = Job(scene=preset("fig1"), t_end=2.0, options=FINITE)
"""The scene of Figs. 1(b), 3 and 4(a), up to the seventh event over the whole interface."""


FIG4B = tuple(
    Job(scene=preset(name), t_end=t_end, options=LINEAR)
    for name, t_end in (("run1", 0.8), ("run2", 0.9), ("run3", 1.0), ("run4", 1.1))
)
"""Runs 1 to 4 of Fig. 4(b), beyond the first event over the whole interface."""
H_2A = (2.5, 5.0, 7.5, 10.0, 12.5, 15.0)  # mm
AT_2700 = {L: tuple(f"{L}/{h:g}/2700" for h in H_2A) for L in (140, 200)}


def _fig2a(name: str) -> Job:
    """Return a run in setup 1 with L (mm), h (mm) and F_N (N) from its name."""
    values, _, finite = name.partition(" ")
    L, h, F_N = map(float, values.split("/"))
    words = f"L = {L:g} mm, h = {h:g} mm, F_N = {F_N:g} N"
    t_end = (0.95 if 5 <= h <= 10 else 1.02) * F_N / 3500
    scene = setup1(L=L / 1e3, h=h / 1e3, F_N=F_N, name=words)
    return Job(scene=scene, t_end=t_end, options=FINITE if finite else LINEAR)


FIG2A = {name: _fig2a(name) for name in AT_2700[140] + AT_2700[200]}
FIG2A |= {"200/10/2700": FIG4B[3], "fig1": FIG1}
FIG2A |= {
    name: _fig2a(name) for name in ("140/5/1750 finite", "200/5/1750 finite", "200/5/3500 finite")
}
"""Name of a run, "L/h/F_N" in mm and N -> the run in setup 1, up to about the first event over the
whole interface. All L and h have runs, one of which is run 4. Runs with other F_N are in finite
geometry at h = 5 mm."""

SETUP2 = ("setup2-", "setup2", "setup2+")
FIG2B = tuple(
    Job(scene=preset(name), t_end=0.68, options=LINEAR | {"dt": 4.5e-7}) for name in SETUP2
)
"""Setup 2 with theta = -0.833, 0 and 0.833, up to about the first event over the interface. The
limit of dt is 0.68 us."""

RUNS: dict[str, Job | tuple[Job, ...]] = {
    "fig1": FIG1,
    "fig2a": tuple(FIG2A.values()),
    "fig2b": FIG2B,
    "fig4b": FIG4B,
}
"""Runs of each figure (`pyfric.figures.FIGURES`): one run, or several."""

# --- claims --------------------------------------------------------------------------------------

T_END = 1.02
"""End of variations of the Fig. 1 scene, s: just after the first system-size event."""
ELEVENTH = 0.75
"""Time just after the 11th main precursor, s."""
BY_MU_S = {f"mu_s {mu_s:g}": mu_s for mu_s in (0.5, 0.6, 0.8, 0.9)}
BY_D_C = {f"d_c {d_c * 1e6:g}": d_c for d_c in (0.0, 0.5e-6, 1e-6, 2e-6, 5e-6, 10e-6)}
BY_ETA = {f"eta {share:g}": share for share in (0.15, 0.22, 0.42)}
"""Name of a run -> eta in sqrt(k m); the default is 0.316."""
BY_K_F = {f"k_f {share:g}": share for share in (1.5, 3.0, 1000.0)}
"""Name of a run -> k_f over k."""
BY_V = {f"V {share:g}": share for share in (0.5, 2.0)}
"""Name of a run -> V over V of the Fig. 1 scene."""
MATTRESS = {"mattress on each": "0.4 MN/m on each top block", "mattress rigid": "rigid"}
"""Name of a run -> its mattress. In all other runs the mattress has 0.4 MN/m in total."""
BASE = "140/5/3500"
"""Name of the Fig. 1 scene in linear geometry, up to its first system-size event."""
AT_F_N = ("140/5/1750 finite", "140/5/2700 finite")
FRONTS = ("fig4a", "run1", "run2", "run3", "run4")

SPEEDS = {
    "fig4a": "located switching, m = M/N",
    "fig4a paper": "switching at the ends of steps of 0.2 us, m = M/N",
    "fig4a heavy": "located switching, mass per area M/(L H)",
    "fig4a paper heavy": "switching at the ends of steps of 0.2 us, mass per area M/(L H)",
}
"""Name of a run of the Fig. 1 scene up to its 11th main precursor -> switching and mass."""


@functools.cache
def jobs() -> dict[str, Job]:
    """Return name -> job of each run behind the claims."""
    fig1 = preset("fig1")
    unit = math.sqrt(fig1.slider.k * fig1.m)

    def fig(t_end: float = T_END, **changes: Any) -> Job:
        return Job(scene=preset("fig1", **changes), t_end=t_end, options=LINEAR)

    found = FIG2A | {"fig4a": FIG1, BASE: fig(0.95)}
    found |= {job.scene.name: job for job in (*FIG2B, *FIG4B)}
    F_N = 2700.0
    job = Job(scene=preset("fig1", F_N=F_N), t_end=0.95 * F_N / 3500, options=FINITE)
    found["140/5/2700 finite"] = job
    found |= {name: fig(mu_s=mu_s) for name, mu_s in BY_MU_S.items()}
    found |= {name: fig(0.92 if d_c < 5e-6 else 0.5, d_c=d_c) for name, d_c in BY_D_C.items()}
    found |= {name: fig(0.92, eta=share * unit) for name, share in BY_ETA.items()}
    found |= {name: fig(0.92, k_f=share * fig1.slider.k) for name, share in BY_K_F.items()}
    found |= {name: fig(T_END / share, V=share * fig1.driver.V) for name, share in BY_V.items()}
    each, rigid = fig1.N_x * fig1.top.mattress, 1e6 * fig1.top.mattress
    found |= dict(zip(MATTRESS, (fig(mattress=each), fig(mattress=rigid)), strict=True))
    N_x, N_z = fig1.N_x, fig1.N_z
    heavy = preset("fig1", M=fig1.slider.M * N_x * N_z / ((N_x - 1) * (N_z - 1)))
    paper_steps = FINITE | {"switching": "step_end", "dt": 2e-7}
    found["fig4a paper"] = Job(scene=fig1, t_end=ELEVENTH, options=paper_steps)
    found["fig4a heavy"] = Job(scene=heavy, t_end=ELEVENTH, options=FIG1.options)
    found["fig4a paper heavy"] = Job(scene=heavy, t_end=ELEVENTH, options=paper_steps)
    found["chain"] = Job(scene=preset("chain"), t_end=0.55, options={"fidelity": "hybrid"})
    return found
