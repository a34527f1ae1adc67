"""Checks E1 to E10, whose answers are known."""

from __future__ import annotations

import dataclasses
import math
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse.linalg import spsolve

from pyfric import core
from pyfric.core import OPEN, State
from pyfric.engines import simulate
from pyfric.paper.claims.claim import Claim, Row, Runs, damaged, replaced, row
from pyfric.record import budget_left
from pyfric.scene import Scene, chain, preset, setup1, setup2
from pyfric.statics import bonds, loaded_state, solve_static, spring_stiffness, stability_limit

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import pandas as pd

    from pyfric.record import Record

__all__ = ["ROWS"]

ROWS: dict[str, Row] = {}
"""Number -> row."""


def _small(**changes: Any) -> Scene:
    """A small setup 1 that slips after about a millisecond."""
    return setup1(**{"L": 0.02, "H": 0.0125, "V": 0.5} | changes)


def _exact(number: str, text: str, value: float, high: float, how: str, source: str) -> Claim:
    return Claim(number=number, text=text, value=float(value), high=high, how=how, source=source)


def _without_diagonals(bonds: Any) -> Any:
    """Stiffness of the lattice with diagonal springs next to none."""
    diagonal = np.abs(bonds.d).min(axis=1) > 0
    return spring_stiffness(dataclasses.replace(bonds, k=np.where(diagonal, 1e-6, 1.0) * bonds.k))


@row(
    ROWS,
    "E1",
    damage={
        "a": replaced("1 % more stiffness", stiffness=lambda bonds: 1.01 * spring_stiffness(bonds)),
        "b": replaced("without diagonal springs", stiffness=_without_diagonals),
    },
)
def _check_elasticity(runs: Runs, stiffness: Callable[..., Any] = spring_stiffness) -> list[Claim]:
    """A strip between rollers, pulled along z."""
    scene = setup2(L=8e-3, H=64e-3)
    N_x, N_z, l, k = scene.N_x, scene.N_z, scene.slider.l, scene.slider.k
    dof = np.arange(2 * N_x * N_z).reshape(N_z, 2, N_x)
    u, given = np.zeros(dof.shape), np.zeros(dof.shape, dtype=bool)
    u[-1, 1] = 1e-3 * l
    given[0, 1] = given[-1, 1] = given[0, 0, N_x // 2] = True
    K = stiffness(bonds(scene)).tocsc()
    inner, outer, flat = dof[~given], dof[given], u.reshape(-1)
    flat[inner] = spsolve(K[np.ix_(inner, inner)], -K[np.ix_(inner, outer)] @ flat[outer])
    middle = N_z // 2
    along = float(np.mean(u[middle + 1, 1] - u[middle - 1, 1]) / (2 * l))
    across = float((u[middle, 0, -1] - u[middle, 0, 0]) / ((N_x - 1) * l))
    force = float((K @ flat)[dof[-1, 1]].sum())
    EB = (force / along - k * l) / ((N_x - 1) * l)
    how = "strip of 9 x 65 blocks pulled between rollers, "
    source = "exact; 1e-5 is what its ends leave in the middle of the strip"
    return [
        _exact(
            "E1a",
            "Young's modulus E B = 4 k/3",
            abs(EB / (4 * k / 3) - 1),
            1e-5,
            how + "less the share of its edge springs, k l: relative error",
            source,
        ),
        _exact(
            "E1b",
            "Poisson's ratio 1/3",
            abs(-across / along - 1 / 3),
            1e-5,
            how + "error",
            source,
        ),
    ]


def _weighed_down(record: Record) -> Record:
    """One block carries a ten-millionth of F_N more, and as much friction less."""
    share = 1e-7 * record.scene.F_N * np.eye(record.scene.N_x)[0]
    return record.replace(p_before=record.p_before + share, tau_before=record.tau_before - share)


@row(
    ROWS,
    "E2",
    "fig1",
    damage=dict.fromkeys(
        "ab",
        damaged(
            "1e-7 F_N more p, less tau on one block",
            lambda runs: {"fig1": _weighed_down(runs["fig1"])},
        ),
    ),
)
def _check_load(runs: Runs) -> list[Claim]:
    record = runs["fig1"]
    done = record.events["finished"].to_numpy(dtype=bool)
    p = np.concatenate([[record.p_initial], record.p_before[done], record.p_after[done]])
    F_T = [[0.0], *(record.events[f"F_T_{at}"][done] for at in ("start", "arrest"))]
    tau = np.concatenate([[record.tau_initial], record.tau_before[done], record.tau_after[done]])
    F_N = record.scene.F_N
    how = f"largest error over F_N in {len(p)} static states of the Fig. 1 scene"
    source = "1e-9: the residual of the static solver, over F_N/N_x"
    return [
        _exact("E2a", "sum of p = F_N", np.abs(p.sum(axis=1) / F_N - 1).max(), 1e-9, how, source),
        _exact(
            "E2b",
            "sum of tau = F_T",
            np.abs(tau.sum(axis=1) - np.concatenate(F_T)).max() / F_N,
            1e-9,
            how,
            source,
        ),
    ]


def _pulled(model: Any, state: State, t: float) -> Any:
    """The forces, with a billionth more acceleration of one block."""
    forces = core.evaluate(model, state, t)
    a = forces.a.copy()
    a[0, 0, 0] += 1e-9 * np.abs(a).max() * a.size
    return forces._replace(a=a)


@row(ROWS, "E3", damage={"": replaced("a force of 1e-9 of all on one block", evaluate=_pulled)})
def _check_momentum(runs: Runs, evaluate: Callable[..., Any] = core.evaluate) -> list[Claim]:
    scene = setup2(L=0.012, H=0.005, theta=0.5, V=0.3)
    worst = 0.0
    for geometry in ("linear", "finite"):
        state = _shaken(scene, geometry, 1e-7)
        forces = evaluate(core.model(scene, geometry, state.u_drv0), state, state.t)
        outer = [scene.d * forces.F_T + forces.f.sum(), forces.p.sum() - scene.F_N]
        change = scene.m * forces.a.sum(axis=(0, 2))
        size = scene.m * np.abs(forces.a).sum()
        worst = max(worst, float(np.abs(change - outer).max() / size))
    return [
        _exact(
            "E3",
            "momentum changes by the outer forces alone",
            worst,
            1e-12,
            "error of sum(m a) over sum |m a|, a shaken slider, both geometries",
            "rounding",
        )
    ]


def _shaken(scene: Scene, geometry: str, dt: float) -> State:
    """The loaded state with random velocities, the same every time."""
    state = loaded_state(scene, geometry).state(scene, dt)
    noise = np.random.default_rng(0).standard_normal((scene.N_z, 2, scene.N_x))
    state.y[:, 2:] = 1e-7 / stability_limit(scene)[0] * noise
    state.y[0, 2] = 0.0
    if scene.rigid:
        state.y[-1, 2:] = 0.0
    return state


def _without_heat(curve: pd.DataFrame) -> pd.Series:
    """What the budget leaves over where friction makes 1 % less heat."""
    return budget_left(curve.assign(friction_heat=0.99 * curve["friction_heat"]))


@row(ROWS, "E4", damage={"": replaced("1 % less friction heat", left=_without_heat)})
def _check_energy(
    runs: Runs, left: Callable[[pd.DataFrame], pd.Series] = budget_left
) -> list[Claim]:
    scene, errors = _small(), []
    for share in (0.5, 0.125):
        dt = share * stability_limit(scene)[0]
        how = {"fidelity": "dynamic", "geometry": "finite", "dt": dt, "switching": "step_end"}
        curve = simulate(scene, 3e-3, progress=False, **how).curve
        errors.append(float(left(curve).abs().max() / abs(curve["work_driver"].iloc[-1])))
    return [
        _exact(
            "E4",
            "the energy budget closes",
            errors[-1],
            1e-6,
            "work of driver and load less stored energy, dissipation in bonds, friction heat and "
            "switching loss, over the driver's work; 3 ms with slip, an eighth of the largest step",
            f"it falls with the step: {errors[0]:.1e} at four times the step",
        )
    ]


@row(
    ROWS,
    "E5",
    damage={"": replaced("V larger by 1e-12 on the right", V={"left": 0.5, "right": 0.5 + 5e-13})},
)
def _check_mirror(
    runs: Runs, V: Mapping[str, float] = MappingProxyType({"left": 0.5, "right": 0.5})
) -> list[Claim]:
    ends, switches = [], 0
    for side in ("left", "right"):
        scene = _small(side=side, V=V[side])
        state = loaded_state(_small(), "finite").state(_small(), 2e-7)
        if side == "right":
            state = _mirrored(state)
        log = core.Log(scene.N_x)
        core.advance(core.model(scene, "finite", state.u_drv0), state, log, 15_000)
        switches += log.n_switch
        ends.append(_mirrored(state) if side == "right" else state)
    differ = sum(int((getattr(ends[0], a) != getattr(ends[1], a)).sum()) for a in ("y", "mode"))
    return [
        _exact(
            "E5",
            "driven from the right, a slider does the mirror image",
            differ if switches else np.nan,
            0,
            f"numbers with other bits after 15000 steps from mirrored states, {switches} switches",
            "exact",
        )
    ]


def _mirrored(state: State) -> State:
    image = state.copy()
    image.y = np.ascontiguousarray(state.y[:, :, ::-1] * np.array([[-1.0], [1.0], [-1.0], [1.0]]))
    image.rod = state.rod * np.array([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0])
    image.mode = np.ascontiguousarray(np.where(state.mode == OPEN, OPEN, -state.mode)[::-1])
    for name in ("corner", "margin", "loss", "heat", "memory"):
        setattr(image, name, np.ascontiguousarray(getattr(state, name)[::-1]))
    image.u_drv0 = -state.u_drv0
    return image


@row(ROWS, "E6", damage={"": replaced("velocity Verlet for RK4", stepper="verlet")})
def _check_order(runs: Runs, stepper: str = "rk4") -> list[Claim]:
    scene, ends = setup1(L=0.02, H=0.0125, V=1e-3), []
    coarse = 0.2 * stability_limit(scene)[0]
    for halvings in range(4):
        state = _shaken(scene, "finite", coarse / 2**halvings)
        log = core.Log(scene.N_x)
        model = core.model(scene, "finite", state.u_drv0)
        core.advance(model, state, log, 40 * 2**halvings, stepper=stepper)
        if log.n_switch:
            raise RuntimeError("the order is that between switches, and something switched")
        ends.append(np.concatenate([state.y.ravel(), state.rod]))
    errors = [np.abs(end - ends[-1]).max() for end in ends[:2]]
    return [
        Claim(
            number="E6",
            text="the stepper is of order 4 while nothing switches",
            value=float(np.log2(errors[0] / errors[1])),
            low=3.75,
            high=4.25,
            how="log2 of the errors at steps dt and dt/2 against dt/8, shaken setup 1, finite "
            "geometry",
            source="4; the next order and the reference leave a quarter",
        )
    ]


@row(ROWS, "E7", damage={"": replaced("the driver 1e-7 of its way behind", behind=1e-7)})
def _check_stuck(runs: Runs, behind: float = 0.0) -> list[Claim]:
    scene, worst = preset("fig1"), 0.0
    for geometry in ("linear", "finite"):
        u_x, drive = loaded_state(scene, geometry).u[0, 0], 1e-4
        rest = solve_static(scene, u_x, drive, geometry=geometry)
        state = rest.state(scene, 1e-7)
        t = (1 - behind) * drive / scene.driver.V
        forces = core.evaluate(core.model(scene, geometry, state.u_drv0), state, t)
        left = np.abs(forces.a).max() * scene.m / (scene.F_N / scene.N_x)
        worst = max(worst, float(left), abs(forces.F_T - rest.F_T) / scene.F_N)
    return [
        _exact(
            "E7",
            "a stuck slider is where the static solver puts it",
            worst,
            1e-9,
            "largest force left on a block in the core, over F_N/N_x, driver 0.1 mm on, both "
            "geometries",
            "the residual of the static solver",
        )
    ]


@row(ROWS, "E8", damage={"": replaced("a stretch of 1e-12 besides", stretch=1e-12)})
def _check_translation(runs: Runs, stretch: float = 0.0) -> list[Claim]:
    scene = setup2(L=0.012, H=0.005)
    worst = 0.0
    for geometry in ("linear", "finite"):
        rest = loaded_state(scene, geometry)
        state = rest.state(scene, 1e-7)
        state.y[:] = 0.0
        state.y[:, 0], state.y[:, 1] = 3 * scene.slider.l, 0.5 * scene.slider.l
        state.y[:, 0] += stretch * scene.x
        state.mode[:] = OPEN
        model = core.model(scene, geometry, 3 * scene.slider.l)
        forces = scene.m * core.evaluate(model, state, 0.0).a
        forces[-1, 1] += scene.load
        worst = max(worst, float(np.abs(forces).max() / (scene.slider.k * scene.slider.l)))
    return [
        _exact(
            "E8",
            "a rigid translation gives no force",
            worst,
            1e-15,
            "largest force over k l, moved by 3 l and lifted off, both geometries",
            "rounding",
        )
    ]


@row(ROWS, "E9", damage={"": replaced("prestress larger by 1e-4", more=1e-4)})
def _check_chain_fronts(runs: Runs, more: float = 0.0) -> list[Claim]:
    taubar = 0.7
    error = _chain_front(taubar + more) * math.sqrt(1 - taubar**2) - 1
    return [
        _exact(
            "E9",
            "fronts in an undamped chain travel at c/sqrt(1 - taubar^2)",
            abs(error),
            1e-6,
            "relative error of the slope of block over rupture time, blocks 150 to 300, taubar = "
            f"{taubar:g}",
            "switches located inside steps of 0.097 of the time from block to block",
        )
    ]


def _chain_front(taubar: float) -> float:
    """Speed of a front over l sqrt(k/m), in a chain under uniform prestress taubar."""
    mu_s, mu_k, p, n, released = 0.7, 0.45, 10.0, 300, 20
    tau = p * (mu_k + taubar * (mu_s - mu_k))
    scene = chain(L=(n - 1) * 2.5e-3, p=p, tau=tau, eta=0.0, K=1e-3, V=0.0)
    unit, guess = math.sqrt(scene.m / scene.slider.k), 1 / math.sqrt(1 - taubar**2)
    state = loaded_state(scene).state(scene, 0.097 * unit / guess)
    state.mode[:released] = 1
    record = simulate(
        scene,
        1.05 * (n - released) * unit / guess,
        fidelity="dynamic",
        dt=state.dt,
        initial=state,
        switching="located",
        budget=False,
        t_gap=1.0,
        progress=False,
    )
    times = record.rupture_times[0][n // 2 :]
    return float(np.polyfit(times, np.arange(n // 2, n), 1)[0] * unit)


@row(ROWS, "E10", damage={"": replaced("twice the load, 2 + 1e-12 times the speed", V=1.0 + 5e-13)})
def _check_homogeneity(runs: Runs, V: float = 1.0) -> list[Claim]:
    how = {"fidelity": "dynamic", "geometry": "linear", "progress": False}
    one = simulate(_small(), 3e-3, **how)
    two = simulate(_small(F_N=7000.0, V=V), 3e-3, **how)
    differ = int((2 * one.final_state.y != two.final_state.y).sum())
    differ += int((2 * one.curve["F_T"] != two.curve["F_T"]).sum())
    return [
        _exact(
            "E10",
            "in linear geometry, twice the load and speed is twice the motion",
            differ,
            0,
            f"numbers with other bits in state and force after 3 ms, {len(one.events)} events",
            "exact",
        )
    ]
