"""Claims E1 to E10, which have exact answers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse.linalg import spsolve

from pyfric import core
from pyfric.core import OPEN, State
from pyfric.paper.claims import damage as to
from pyfric.paper.claims.claim import Band, Claim, Runs, claim
from pyfric.planning import simulate
from pyfric.record import budget_left
from pyfric.scene import Scene, chain, preset, setup1, setup2
from pyfric.statics import bonds, loaded_state, solve_static, spring_stiffness, stability_limit

if TYPE_CHECKING:
    import pandas as pd

    from pyfric.record import Record

RESIDUAL = "1e-9: the residual of the static solver, over F_N/N_x"
ROUNDING = "rounding"


def _small(**changes: Any) -> Scene:
    """Return a small setup 1 that slips after about a millisecond."""
    return setup1(**{"L": 0.02, "H": 0.0125, "V": 0.5} | changes)


def _without_diagonals(bonds: Any) -> Any:
    """Return the stiffness of the lattice with negligible diagonal springs."""
    diagonal = np.abs(bonds.d).min(axis=1) > 0
    return spring_stiffness(dataclasses.replace(bonds, k=np.where(diagonal, 1e-6, 1.0) * bonds.k))


def _strip(stiffness: Callable[..., Any]) -> tuple[float, float]:
    """Return the relative error of E B and the error of nu for a strip pulled along z."""
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
    return abs(EB / (4 * k / 3) - 1), abs(-across / along - 1 / 3)


@claim("E1")
def _elasticity(runs: Runs, stiffness: Callable[..., Any] = spring_stiffness) -> Iterator[Claim]:
    modulus, ratio = _strip(stiffness)
    how = "strip of 9 x 65 blocks pulled between rollers, "
    band = Band(None, 1e-5, "exact, but for 1e-5 from the ends of the strip")
    yield Claim(
        "E1a",
        "Young's modulus E B = 4 k/3",
        modulus,
        band,
        f"{how}less the share of its edge springs, k l: relative error",
        [to.given("1 % more stiffness", stiffness=lambda bonds: 1.01 * spring_stiffness(bonds))],
    )
    yield Claim(
        "E1b",
        "Poisson's ratio 1/3",
        ratio,
        band,
        f"{how}error",
        [to.given("without diagonal springs", stiffness=_without_diagonals)],
    )


@claim("E2", "fig1")
def _sums(runs: Runs) -> Iterator[Claim]:
    record = runs["fig1"]
    done = record.events["finished"].to_numpy(dtype=bool)
    F_T = np.concatenate([[0], *(record.events[f"F_T_{at}"][done] for at in ("start", "arrest"))])
    for number, name, sign, expected in (
        ("E2a", "p", "F_N", record.scene.F_N),
        ("E2b", "tau", "F_T", F_T),
    ):
        states = [getattr(record, f"{name}_{when}") for when in ("initial", "before", "after")]
        sums = np.vstack([states[0], states[1][done], states[2][done]]).sum(axis=1)
        yield Claim(
            number,
            f"sum of {name} = {sign}",
            np.abs(sums - expected).max() / record.scene.F_N,
            Band(None, 1e-9, RESIDUAL),
            f"largest error over F_N in {len(sums)} static states of the Fig. 1 scene",
            [to.each("1e-7 F_N more p, less tau on one block", _weighed_down)],
        )


def _weighed_down(record: Record) -> Record:
    """Return the record with 1e-7 F_N more on one block, and its friction smaller by as much."""
    share = 1e-7 * record.scene.F_N * np.eye(record.scene.N_x)[0]
    return record.replace(p_before=record.p_before + share, tau_before=record.tau_before - share)


def _pulled(model: Any, state: State, t: float) -> Any:
    """Return the forces with 1e-9 of the total force added to one block."""
    forces = core.evaluate(model, state, t)
    a = forces.a.copy()
    a[0, 0, 0] += 1e-9 * np.abs(a).max() * a.size
    return forces._replace(a=a)


@claim("E3")
def _momentum(runs: Runs, evaluate: Callable[..., Any] = core.evaluate) -> Iterator[Claim]:
    scene = setup2(L=0.012, H=0.005, theta=0.5, V=0.3)
    worst = 0.0
    for geometry in ("linear", "finite"):
        state = shaken(scene, geometry, 1e-7, 1e-7 / stability_limit(scene)[0])
        forces = evaluate(core.model(scene, geometry, state.u_drv0), state, state.t)
        outer = [scene.d * forces.F_T + forces.f.sum(), forces.p.sum() - scene.F_N]
        change = scene.m * forces.a.sum(axis=(0, 2))
        size = scene.m * np.abs(forces.a).sum()
        worst = max(worst, float(np.abs(change - outer).max() / size))
    yield Claim(
        "E3",
        "momentum changes by the outer forces alone",
        worst,
        Band(None, 1e-12, ROUNDING),
        "error of sum(m a) over sum |m a|, a shaken slider, both geometries",
        [to.given("1e-9 of the total force added to one block", evaluate=_pulled)],
    )


def shaken(scene: Scene, geometry: str, dt: float, speed: float) -> State:
    """Return the loaded state with random velocities of size `speed` (m/s), from a fixed seed."""
    state = loaded_state(scene, geometry).state(scene, dt)
    noise = np.random.default_rng(0).standard_normal((scene.N_z, 2, scene.N_x))
    state.y[:, 2:] = speed * noise
    state.y[0, 2] = 0.0
    if scene.rigid:
        state.y[-1, 2:] = 0.0
    return state


def _without_heat(curve: pd.DataFrame) -> pd.Series:
    """Return the remainder of the energy budget with 1 % less heat of friction."""
    return budget_left(curve.assign(friction_heat=0.99 * curve["friction_heat"]))


@claim("E4")
def _energy(runs: Runs, left: Callable[[pd.DataFrame], pd.Series] = budget_left) -> Iterator[Claim]:
    scene, errors = _small(), []
    for share in (0.5, 0.125):
        dt = share * stability_limit(scene)[0]
        how = {"fidelity": "dynamic", "geometry": "finite", "dt": dt, "switching": "step_end"}
        curve = simulate(scene, 3e-3, progress=False, **how).curve
        errors.append(float(left(curve).abs().max() / abs(curve["work_driver"].iloc[-1])))
    yield Claim(
        "E4",
        "the energy budget closes",
        errors[-1],
        Band(None, 1e-6, "error of a step of RK4, which falls with the step"),
        "residual of the energy budget over the driver's work, in 3 ms with slip, at an eighth of "
        f"the largest step; {errors[0]:.1e} at four times this step",
        [to.given("1 % less friction heat", left=_without_heat)],
    )


@claim("E5")
def _mirror(runs: Runs, V: float = 0.5) -> Iterator[Claim]:
    ends, switches = [], 0
    for side in ("left", "right"):
        scene = _small(side=side, V=V if side == "right" else 0.5)
        state = loaded_state(_small(), "finite").state(_small(), 2e-7)
        if side == "right":
            state = _mirrored(state)
        log = core.Log(scene.N_x)
        core.advance(core.model(scene, "finite", state.u_drv0), state, log, 15_000)
        switches += log.n_switch
        ends.append(_mirrored(state) if side == "right" else state)
    differ = sum(int((getattr(ends[0], a) != getattr(ends[1], a)).sum()) for a in ("y", "mode"))
    how = f"numbers whose bits differ after 15000 steps from mirrored states, {switches} switches"
    yield Claim(
        "E5",
        "driven from the right, a slider does the mirror image",
        differ if switches else np.nan,
        Band(None, 0.0, "exact"),
        how,
        [to.given("V larger by 1e-12 on the right", V=0.5 + 5e-13)],
    )


def _mirrored(state: State) -> State:
    image = state.copy()
    image.y = np.ascontiguousarray(state.y[:, :, ::-1] * np.array([[-1.0], [1.0], [-1.0], [1.0]]))
    image.rod = state.rod * np.array([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0])
    image.mode = np.ascontiguousarray(np.where(state.mode == OPEN, OPEN, -state.mode)[::-1])
    for name in ("corner", "margin", "loss", "heat", "memory"):
        setattr(image, name, np.ascontiguousarray(getattr(state, name)[::-1]))
    image.u_drv0 = -state.u_drv0
    return image


@claim("E6")
def _order(runs: Runs, stepper: str = "rk4") -> Iterator[Claim]:
    scene, ends = setup1(L=0.02, H=0.0125, V=1e-3), []
    limit = stability_limit(scene)[0]
    for halvings in range(4):
        state = shaken(scene, "finite", 0.2 * limit / 2**halvings, 1e-7 / limit)
        log = core.Log(scene.N_x)
        model = core.model(scene, "finite", state.u_drv0)
        core.advance(model, state, log, 40 * 2**halvings, stepper=stepper)
        if log.n_switch:
            raise RuntimeError("the order is that between switches, and something switched")
        ends.append(np.concatenate([state.y.ravel(), state.rod]))
    errors = [np.abs(end - ends[-1]).max() for end in ends[:2]]
    how = "log2 of the errors at steps dt and dt/2 against dt/8, shaken setup 1, finite geometry"
    yield Claim(
        "E6",
        "the stepper is of order 4 while nothing switches",
        np.log2(errors[0] / errors[1]),
        Band(3.75, 4.25, "4, within 0.25 for higher-order terms and the error of the reference"),
        how,
        [to.given("velocity Verlet for RK4", stepper="verlet")],
    )


@claim("E7")
def _stuck(runs: Runs, behind: float = 0.0) -> Iterator[Claim]:
    scene, worst = preset("fig1"), 0.0
    for geometry in ("linear", "finite"):
        u_x, drive = loaded_state(scene, geometry).u[0, 0], 1e-4
        rest = solve_static(scene, u_x, drive, geometry=geometry)
        state = rest.state(scene, 1e-7)
        t = (1 - behind) * drive / scene.driver.V
        forces = core.evaluate(core.model(scene, geometry, state.u_drv0), state, t)
        left = np.abs(forces.a).max() * scene.m / (scene.F_N / scene.N_x)
        worst = max(worst, float(left), abs(forces.F_T - rest.F_T) / scene.F_N)
    yield Claim(
        "E7",
        "a stuck slider is where the static solver puts it",
        worst,
        Band(None, 1e-9, RESIDUAL),
        "largest force left on a block in the core, over F_N/N_x, driver 0.1 mm on, both "
        "geometries",
        [to.given("the driver 1e-7 of its way behind", behind=1e-7)],
    )


@claim("E8")
def _translation(runs: Runs, stretch: float = 0.0) -> Iterator[Claim]:
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
    yield Claim(
        "E8",
        "a rigid translation gives no force",
        worst,
        Band(None, 1e-15, ROUNDING),
        "largest force over k l, moved by 3 l and lifted off, both geometries",
        [to.given("a stretch of 1e-12 besides", stretch=1e-12)],
    )


@claim("E9")
def _chain_fronts(runs: Runs, more: float = 0.0) -> Iterator[Claim]:
    taubar = 0.7
    yield Claim(
        "E9",
        "fronts in an undamped chain travel at c/sqrt(1 - taubar^2)",
        abs(_chain_front(taubar + more) * math.sqrt(1 - taubar**2) - 1),
        Band(None, 1e-6, "switches located inside steps of 0.097 of the time from block to block"),
        f"relative error of the speed from rupture times of blocks 150 to 300, taubar = {taubar:g}",
        [to.given("prestress larger by 1e-4", more=1e-4)],
    )


def _chain_front(taubar: float) -> float:
    """Return the speed of a front over l sqrt(k/m), in an undamped, evenly loaded chain."""
    mu_s, mu_k, p, n, released = 0.7, 0.45, 10.0, 300, 20
    tau = p * (mu_k + taubar * (mu_s - mu_k))
    scene = chain(L=(n - 1) * 2.5e-3, p=p, tau=tau, mu_s=mu_s, mu_k=mu_k, K=1e-3, V=0.0, eta=0.0)
    block = math.sqrt(scene.m / scene.slider.k * (1 - taubar**2))  # time from block to block
    state = loaded_state(scene).state(scene, 0.097 * block)
    state.mode[:released] = 1
    record = simulate(
        scene,
        1.05 * (n - released) * block,
        fidelity="dynamic",
        dt=state.dt,
        initial=state,
        switching="located",
        energies=False,
        t_gap=1.0,
        progress=False,
    )
    times = record.rupture_times[0][n // 2 :]
    unit = math.sqrt(scene.m / scene.slider.k)
    return float(np.polyfit(times, np.arange(n // 2, n), 1)[0] * unit)


@claim("E10")
def _homogeneity(runs: Runs, V: float = 1.0) -> Iterator[Claim]:
    how = {"fidelity": "dynamic", "geometry": "linear", "progress": False}
    single = simulate(_small(), 3e-3, **how)
    double = simulate(_small(F_N=7000.0, V=V), 3e-3, **how)
    differ = int((2 * single.final_state.y != double.final_state.y).sum())
    differ += int((2 * single.curve["F_T"] != double.curve["F_T"]).sum())
    how = f"numbers whose bits differ in state and force after 3 ms, {len(single.events)} events"
    yield Claim(
        "E10",
        "in linear geometry, twice the load and speed is twice the motion",
        differ,
        Band(None, 0.0, "exact"),
        how,
        [to.given("twice the load, 2 + 1e-12 times the speed", V=1.0 + 5e-13)],
    )
