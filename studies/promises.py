"""Statements of records beside true values, in scenes where a tolerance is hard to keep.

Each case returns rows: quantity, value in the record or the plan, and the value found by other
means. True errors are those of `plans.trial`, against full dynamics with steps of a tenth of the
stability limit.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import plans
from sizes import size
from tpv3 import STATIONS, distance, misfit, ruptured

from pyfric.engines import step_size
from pyfric.planning import simulate
from pyfric.record import differences, zone_of_scene
from pyfric.scene import chain, preset, setup1, slab

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

__all__ = ["CASES", "table"]

SLABS = size(12, 1)
"""Number of slabs whose fronts run to the end."""


def _slabs() -> list[tuple[str, Any, Any]]:
    """Return rows for slabs: no driver's force, and no arrest of unfinished events."""
    rows: list[dict[str, Any]] = []
    n = 0
    while len(rows) < SLABS:
        scene, t_end, _, tolerance = plans.drawn_wide(1, n)
        n += 1
        if scene.prescribed:
            rows.append(plans.trial(scene, t_end, "front_speed", tolerance))
    found = pd.DataFrame(rows)
    ratio = (found["real"] / found["measured"]).max()
    silent = (found["beyond_tolerance"] & ~found["said"]).sum()
    return [
        ("errors that were measured", SLABS, int((~found["not_measured"]).sum())),
        ("largest real error over the measured one, at most", 1.0, ratio),
        ("errors beyond the tolerance without notice", 0, int(silent)),
    ]


def _light_load() -> list[tuple[str, Any, Any]]:
    """Return rows for small strains, where linear geometry has an error near 0.01."""
    small, t_end = size(({}, 0.09), ({"l": 5e-3, "V": 8e-3}, 0.0045))
    row = plans.trial(preset("fig1", F_N=350.0, **small), t_end, "precursors", 0.01)
    return [
        ("error of forces (F_N), at most", row["measured"], row["real"]),
        ("error of stresses (F_N/N_x), at most", row["measured_stress"], row["real_stress"]),
    ]


def _paid(scene: Any, t_end: float, tolerance: float) -> list[tuple[str, Any, Any]]:
    start = time.process_time()
    how = {"want": "precursors", "tolerance": tolerance, "progress": False}
    simulate(scene, t_end, **how)
    paid = time.process_time() - start
    return [("time with verification (s), at most", 4 * plans.alone(scene, t_end), paid)]


def _free_slider() -> list[tuple[str, Any, Any]]:
    """Return the row of a slider with many events and a trailing edge that lifts off."""
    return _paid(preset("setup2+"), size(0.5, 0.02), 0.05)


def _uneven_chain() -> list[tuple[str, Any, Any]]:
    """Return the row of a chain with about 150 events, a few of which change with any step."""
    p = 60 * np.random.default_rng(43).uniform(0.5, 1.5, 43)
    return _paid(chain(p=p.tolist(), L=42 * 2.5e-3, k_top=1e6), size(1.0, 0.04), 0.02)


def _rod() -> list[tuple[str, Any, Any]]:
    """Return rows for finite geometry on a stiff foundation, where errors of jumps are largest."""
    fixed = {"L": 10 * 2.5e-3, "H": 7 * 2.5e-3, "h": 2.5e-3, "F_N": 660.0}
    k, t_end = setup1(**fixed).slider.k, size(0.3, 0.01)
    scene = setup1(**fixed, K=0.041 * k, k_f=19 * k)
    scene = scene.replace({"driver.V": plans._way(scene) / t_end})
    row = plans.trial(scene, t_end, "precursors", 0.001)
    speed = "error of front speeds, 95th percentile, at most"
    return [
        ("error of forces (F_N), at most", row["measured"], row["real"]),
        (speed, row["measured_speed_95"], row["real_speed_95"]),
    ]


def _benchmark() -> list[tuple[str, Any, Any]]:
    """Return X_c0/l of TPV3, which has barriers, beside (3 pi/4) k G/(drop of mu p)^2."""
    scene = preset("tpv3")
    inside = scene.N_x // 4
    drop = (
        float(np.broadcast_to(scene.law.static.drop, scene.N_x)[inside])
        * scene.p_prescribed[inside]
    )
    energy = drop * float(np.broadcast_to(scene.law.static.d_c, scene.N_x)[inside]) / 2
    return [("X_c0/l", zone_of_scene(scene), 0.75 * math.pi * scene.slider.k * energy / drop**2)]


def _viscosity() -> list[tuple[str, Any, Any]]:
    """Return misfits of TPV3 on 100 m, with the viscosity of `slab` and with the paper's."""
    lattice = {"p": [100.0] * 30, "tau": [69.0] * 30, "L": 29.0, "H": 9.0, "l": 1.0}
    plain = slab(**lattice)
    of = plain.eta / math.sqrt(plain.slider.k * plain.m)
    rows = []
    l = size(100.0, 500.0)
    for share, dashpots in ((of, plain.slider.dashpots), (math.sqrt(0.1), "full")):
        scene = preset("tpv3", l=l)
        eta = share * math.sqrt(scene.slider.k * scene.m)
        scene = preset("tpv3", l=l, eta=eta, dashpots=dashpots)
        times, _, _ = ruptured(scene, step_size(scene), 6.0)
        rows.append(misfit(np.interp(STATIONS, distance(scene), times)))
    return [("RMS of rupture times: of slab, and with the paper's viscosity", *rows)]


def _no_plan() -> list[tuple[str, Any, Any]]:
    """Return the row of a run without verification, because its engine is given."""
    faster, t_end = size(({}, 0.3), ({"V": 4e-3}, 0.02))
    scene = setup1(L=0.03, H=0.01, h=2.5e-3, F_N=700.0, **faster)
    made = simulate(scene, t_end, fidelity="hybrid", progress=False)
    fine = simulate(
        scene, t_end, fidelity="dynamic", dt=made.method.dt / 4, switching="located", progress=False
    )
    said = "not measured" if "errors not measured" in made.summary() else "nothing"
    return [("error of start forces (F_N)", said, differences(made, fine).errors()["start"])]


CASES: dict[str, tuple[str, Callable[[], list[tuple[str, Any, Any]]]]] = {
    "slabs": (f"{SLABS} random slabs, fronts that go on to t_end", _slabs),
    "light-load": ("Fig. 1 with F_N = 350 N to 0.09 s, tolerance 0.01", _light_load),
    "free-slider": ("setup2+ to 0.5 s, tolerance 0.05", _free_slider),
    "uneven-chain": ("43 blocks with uneven p to 1 s, tolerance 0.02", _uneven_chain),
    "rod": ("11 x 8 blocks, K/k = 0.041, k_f/k = 19, tolerance 0.001", _rod),
    "benchmark": ("TPV3, which has barriers", _benchmark),
    "viscosity": ("TPV3 on 100 m", _viscosity),
    "no-plan": ("12 x 5 blocks, fidelity = 'hybrid'", _no_plan),
}
"""Name of a case -> its description, and the function that measures it."""


def table(names: Iterable[str] = CASES) -> pd.DataFrame:
    """Return the rows of cases; columns: case, scene, quantity, said (by the record) and found."""
    rows = [
        {"case": name, "scene": CASES[name][0], "quantity": quantity, **_short(said, found)}
        for name in names
        for quantity, said, found in CASES[name][1]()
    ]
    return pd.DataFrame(rows)


def _short(said: Any, found: Any) -> dict[str, str]:
    values = {"said": said, "found": found}
    return {k: v if isinstance(v, str) else f"{v:.3g}" for k, v in values.items()}
