"""Comparison with other programs: LAMMPS for the bonds, SciPy for four sliding blocks.

wave
    A standing wave in a free lattice of the size of the Fig. 1 scene, without friction and
    viscosity. LAMMPS integrates the same bonds with velocity Verlet. The error is that of the
    displacements after two periods.
slider
    Four blocks that stick and slip, compared with `scipy.integrate.solve_ivp` with events. The
    error is that of the times of all switches.
chart
    The scenes of `accuracy`: the time that LAMMPS takes for the bond forces of the steps of full
    dynamics, with the error of those steps.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import accuracy as chart
import numpy as np
import peers
from scipy.integrate import solve_ivp
from sizes import size

from pyfric import core
from pyfric.core import OPEN
from pyfric.planning import simulate
from pyfric.scene import chain, preset
from pyfric.statics import loaded_state, stability_limit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import pandas as pd

    from pyfric.scene import Scene

__all__ = ["chart_points", "slider_points", "wave_points"]

REPEATS = size(3, 1)
SHARES = size((0.9, 0.5, 0.25, 0.125, 0.0625, 0.03125), (0.9,))
"""Time steps, as shares of the stability limit."""
AMPLITUDE = 1e-3
"""Amplitude of the wave, in l."""


def wave_points(say: Callable[[str], None] = lambda _: None) -> Iterator[dict[str, Any]]:
    """Yield the points of the standing wave; see `methods.table`."""
    scene = preset("fig1")
    unit = math.sqrt(scene.m / scene.slider.k)  # unit of time, s
    u = np.zeros((scene.N_z, 2, scene.N_x))
    u[:, 0] = AMPLITUDE * scene.slider.l * np.cos(np.pi * (scene.x / scene.slider.L + 0.5))
    t_end = 4 * (scene.N_x - 1) / math.sqrt(1.5) * unit
    least = math.ceil(t_end / (1.6 * unit))
    numbers = [least * 2**k for k in range(size(7, 2))]

    say("wave: reference")
    truth = _wave(scene, u, t_end, 4 * numbers[-1], "rk4")[0]
    scale = _rms(truth)
    for stepper in ("rk4", "verlet", "symplectic_euler"):
        for n in numbers:
            say(f"wave: {stepper}, {n} steps")
            runs = [_wave(scene, u, t_end, n, stepper) for _ in range(REPEATS)]
            yield {
                **_wave_row("pyfric", stepper, t_end / n, runs[0][0], truth, scale),
                "seconds": min(seconds for _, seconds in runs),
                "evaluations": n * core.STEPPERS[stepper].evaluations * scene.N_x * scene.N_z,
            }
    if peers.available()["lammps"].startswith("missing"):
        yield {"scene": "wave", "engine": "LAMMPS", "status": peers.INSTALL}
        return
    with peers.lammps_bonds(scene, integrate=True) as peer:
        for n in numbers:
            say(f"wave: LAMMPS, {n} steps")
            seconds = math.inf
            for _ in range(REPEATS):
                peer.start(u, t_end / n / unit)
                begin = time.perf_counter()
                peer.run(n)
                seconds = min(seconds, time.perf_counter() - begin)
            yield {
                **_wave_row("LAMMPS", "verlet", t_end / n, peer.displacements(), truth, scale),
                "seconds": seconds,
                "evaluations": n * scene.N_x * scene.N_z,
            }


def _wave(
    scene: Scene, u: np.ndarray, t_end: float, n: int, stepper: str
) -> tuple[np.ndarray, float]:
    """Return u after n steps of the free lattice from rest at u, and the processor time, in s."""
    state = loaded_state(scene).state(scene, t_end / n)
    state.y[:], state.rod[:], state.mode[:] = 0.0, 0.0, OPEN
    state.y[:, :2] = u
    model, log = core.springs(scene, "finite"), core.Log(scene.N_x)
    begin = time.perf_counter()
    core.advance(model, state, log, n, stepper=stepper, budget=False)
    return state.y[:, :2].copy(), time.perf_counter() - begin


def _wave_row(
    engine: str, stepper: str, dt: float, u: np.ndarray, truth: np.ndarray, scale: float
) -> dict[str, Any]:
    error = _rms((u - truth).ravel()) / scale
    row = {"scene": "wave", "engine": engine, "stepper": stepper, "geometry": "finite", "dt": dt}
    if not error < 1:
        return row | {"status": "unstable: the wave has grown"}
    return row | {"status": "ok", "displacement": error}


SLIDER_END = 2e-4


def slider_points(say: Callable[[str], None] = lambda _: None) -> Iterator[dict[str, Any]]:
    """Yield the points of the small slider; see `methods.table`."""
    scene = chain(
        L=7.5e-3,
        p=(60.0, 70.0, 55.0, 65.0),
        tau=(20.0, 0.0, -10.0, 15.0),
        V=0.3,
        k_top=2e7,
        K=4e6,
        k=5e7,
        mu_s=0.7,
        mu_k=0.2,
    )
    truth, _, _ = _ivp(scene, 1e-12)
    for rtol in size((1e-3, 1e-5, 1e-7, 1e-9), (1e-3,)):
        say(f"slider: solve_ivp, {rtol:g}")
        runs = [_ivp(scene, rtol) for _ in range(REPEATS)]
        found, _, evaluations = runs[0]
        yield {
            **_slider_row("scipy solve_ivp", "DOP853", "located", found, truth),
            "rtol": rtol,
            "seconds": min(seconds for _, seconds, _ in runs),
            "evaluations": evaluations * scene.N_x,
        }
    limit = stability_limit(scene)[0]
    for switching in ("step_end", "located"):
        for share in SHARES:
            say(f"slider: rk4, {switching}, {share:g}")
            runs = [
                simulate(
                    scene,
                    SLIDER_END,
                    fidelity="dynamic",
                    switching=switching,
                    dt=share * limit,
                    sample=SLIDER_END,
                    energies=False,
                    progress=False,
                )
                for _ in range(REPEATS)
            ]
            log = runs[0].switches
            found = list(zip(log["t"], log["block"], log["old"], log["new"], strict=True))
            yield {
                **_slider_row("pyfric", "rk4", switching, found, truth),
                "dt": share * limit,
                "share": share,
                "seconds": min(run.timings["stepping"] for run in runs),
                "evaluations": runs[0].counts["block_evaluations"],
            }


def _slider_row(
    engine: str, stepper: str, switching: str, found: list[tuple], truth: list[tuple]
) -> dict[str, Any]:
    row = {"scene": "slider", "engine": engine, "stepper": stepper, "switching": switching}
    if [one[1:] for one in found] != [one[1:] for one in truth]:
        return row | {"status": f"other switches: {len(found)} instead of {len(truth)}"}
    error = _rms(np.array([a[0] - b[0] for a, b in zip(found, truth, strict=True)]))
    return row | {"status": "ok", "rupture": error}


def _ivp(scene: Scene, rtol: float) -> tuple[list[tuple], float, int]:
    """Return SciPy's switches (t, block, old, new), wall time, s, and number of evaluations."""
    N, m, eta = scene.N_x, scene.m, scene.eta
    law = scene.law.static
    p, k, driver = scene.load, scene.slider.k, scene.driver
    bond = np.eye(N, k=1) + np.eye(N, k=-1) - np.diag([1.0, *((N - 2) * [2.0]), 1.0])
    stiff = k * bond - scene.k_top * np.eye(N)
    stiff[0, 0] -= driver.K
    push, viscous = np.zeros(N), eta * bond
    push[0] = driver.K * driver.V
    mode = np.zeros(N, dtype=int)

    def other(t: float, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return scene.shear + stiff @ u + viscous @ v + push * t

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        v = np.where(mode == 0, 0.0, y[N:])
        a = (other(t, y[:N], v) - mode * law.slide(p)) / m
        return np.concatenate([v, np.where(mode == 0, 0.0, a)])

    def margin(i: int) -> Callable[[float, np.ndarray], float]:
        def value(t: float, y: np.ndarray) -> float:
            if mode[i]:
                return mode[i] * y[N + i]
            return law.hold(p[i]) - abs(other(t, y[:N], y[N:])[i])

        value.terminal, value.direction = True, -1
        return value

    margins, found = [margin(i) for i in range(N)], []
    t, y, evaluations, begin = 0.0, np.zeros(2 * N), 0, time.perf_counter()
    while True:
        options = {"rtol": rtol, "atol": rtol * 1e-9, "events": margins, "method": "DOP853"}
        done = solve_ivp(slope, (t, SLIDER_END), y, **options)
        evaluations += done.nfev
        t, y = float(done.t[-1]), done.y[:, -1].copy()
        hit = [i for i in range(N) if done.t_events[i].size]
        if not hit:
            return found, time.perf_counter() - begin, evaluations
        i, old = hit[0], mode[hit[0]]
        y[N + i] = 0.0
        force = other(t, y[:N], y[N:])[i]
        stays = old and abs(force) <= law.hold(p[i])
        mode[i] = 0 if stays else int(np.sign(force))
        found.append((t, i, old, mode[i]))


LAMMPS_STEPS = size(2000, 20)
"""Number of steps that are timed for the chart."""


def chart_points(points: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Yield a point of LAMMPS for each scene of the chart."""
    for row in chart.full_dynamics(points).to_dict("records"):
        scene, row = chart.scenes()[row["scene"]], row | {"kind": "peer", "engine": "LAMMPS"}
        if peers.available()["lammps"].startswith("missing"):
            yield row | {"seconds": math.nan, "status": peers.INSTALL}
            continue
        with peers.lammps_bonds(scene, integrate=True) as peer:
            begin = time.process_time()
            peer.run(LAMMPS_STEPS)
            each = (time.process_time() - begin) / LAMMPS_STEPS
        yield row | {"seconds": each * row["evaluations"] / (scene.N_x * scene.N_z)}


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
