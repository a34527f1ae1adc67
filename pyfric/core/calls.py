"""Calls of the compiled core, with checks of their arguments."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, get_args

import numpy as np

from pyfric.core.builds import VARIANT, forked, load_variant
from pyfric.core.log import Log, Switching, room_of_step
from pyfric.core.packing import Model, springs
from pyfric.core.state import OPEN
from pyfric.core.status import Status
from pyfric.core.steppers import STEPPERS

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.core.state import State
    from pyfric.scene import Geometry, Scene

SWITCHING = get_args(Switching)
_core = load_variant(VARIANT)

ENERGIES = (
    "kinetic_blocks",
    "kinetic_rod",
    "elastic_bonds",
    "elastic_foundation",
    "elastic_mattress",
    "elastic_driver",
)
"""Names of the energies in the order of the core. In a chain, "elastic_mattress" is the energy of
k_top."""
SLIP_FINISHED = 1
"""Largest code of the core with which slip without inertia can go on: no limit, no error."""
JUNCTIONS = "elastic_junctions"
"""Name of the elastic energy of junctions."""


def advance(
    model: Model,
    state: State,
    log: Log,
    n_steps: int,
    *,
    stepper: str = "rk4",
    switching: Switching = "step_end",
    rtol: float = 1.0,
    budget: bool = True,
    threads: int = 1,
    variant: str = VARIANT,
) -> Status:
    """Make up to n_steps; the state changes in place.

    Args:
        model: from `model`, for the scene of the state.
        state: initial state; on return, the state at which the core stopped.
        log: buffers, filled from their beginning. The core stops early if they could overflow.
        n_steps: number of steps to make, at least 0.
        stepper: one of `STEPPERS`.
        switching: "step_end", or "located". With "located", contacts switch inside the step, at the
            zero of a gap function, and the step continues from there.
        rtol: largest error of a sub-step, for "adaptive". Errors of displacements are over
            F_N/(N_x s), those of velocities over F_N/(N_x sqrt(s m)), with s the largest of k, k_f
            and k_top.
        budget: whether to integrate work and dissipation.
        threads: number of threads, which does not change results. If `forked`, one thread is used.
        variant: build to use, which does not change results.

    Returns:
        The reason why the call ended. After `ENDLESS` and `TOO_SHORT` the state is inside a step,
        and no run may continue from this state. `log.block` and `log.t` are then block and time of
        the failure.

    Raises:
        ValueError: arrays do not fit the model, or a number is out of range.
        MemoryError: there is no memory for the work space; the state is unchanged.
    """
    N_x = model.N_x
    state.check(N_x, n_memory=model.n_memory)
    switches, quiet = room_of_step(N_x, switching)
    if log.N_x != N_x or log.switch_r.shape[1] < switches or log.quiet_r.shape[1] < quiet:
        raise ValueError(f"log: room for {log.N_x} blocks, expected {N_x}")
    if stepper not in STEPPERS or switching not in SWITCHING or not rtol > 0:
        given = f"stepper = {stepper!r}, switching = {switching!r}, rtol = {rtol}"
        raise ValueError(f"{given}: the core has no such method")
    if model.flows and not (STEPPERS[stepper].implicit and switching == "step_end"):
        allowed = "stepper = 'imex', switching = 'step_end'"
        raise ValueError(f"stepper = {stepper!r}: rate-and-state friction needs {allowed}")
    if not 0 <= n_steps < 2**31:
        raise ValueError(f"n_steps = {n_steps}: must be from 0 to {2**31 - 1}")
    if not 1 <= threads <= 4096:
        raise ValueError(f"threads = {threads}: must be from 1 to 4096")
    step, sub = np.array([float(state.step)]), np.array([state.sub or state.dt])
    n_log, tried, block, log.t, status = load_variant(variant).advance(
        *model,
        STEPPERS[stepper].columns,
        int(switching == "located"),
        rtol,
        state.t0,
        state.dt,
        n_steps,
        1 if forked() else min(threads, state.y.shape[0]),
        int(budget),
        log.every,
        step,
        sub,
        state.y.T,
        state.rod,
        state.mode,
        state.corner,
        state.margin,
        state.loss,
        state.numbers.T,
        state.dissipated,
        state.radiated,
        state.heat,
        state.parts.T,
        state.work,
        log.switch_i,
        log.switch_r,
        log.quiet_i,
        log.quiet_r,
        log.points,
        log.threshold,
        log.fast.T,
        log.speeds,
        log.crossing_i,
        log.crossing_r,
        log.burst_i,
        log.burst_r,
    )
    _check_status(status, state.y.shape)
    state.step, log.tried, log.block = int(step[0]), tried, block - 1
    state.drive = model.drive(state.t)
    if STEPPERS[stepper].adaptive:
        state.sub = float(sub[0])
    log.n_switch, log.n_quiet, log.n_point, log.n_crossing, log.n_burst = n_log.tolist()
    return Status(status)


def _check_status(status: int, shape: tuple[int, ...]) -> None:
    """Raise MemoryError if the core had no memory, ValueError if it does not know the law.

    Args:
        status: status of the core.
        shape: (N_z, 4, N_x).
    """
    if status == Status.NO_MEMORY:
        raise MemoryError(f"the core has no memory for {shape[2]} x {shape[0]} blocks")
    if status == Status.UNKNOWN_LAW:
        raise ValueError("the core does not know this law of friction")


class Forces(NamedTuple):
    """One evaluation of the right-hand side, at fixed contact states.

    Attributes:
        a: accelerations, shape (N_z, 2, N_x), in m/s^2.
        a_rod: accelerations of X, Z (m/s^2) and phi (rad/s^2), shape (3,).
        f: friction force on each bottom block in +x, shape (N_x,), in N.
        p: foundation force, shape (N_x,), in N.
        F_T: driver force, in N.
        dissipated: power dissipated in the bonds that start in each row, shape (N_z,), in W.
        heat: friction power of each bottom block, shape (N_x,), in W.
        work: powers of the driver and of the other external forces, shape (2,), in W.
    """

    a: np.ndarray
    a_rod: np.ndarray
    f: np.ndarray
    p: np.ndarray
    F_T: float
    dissipated: np.ndarray
    heat: np.ndarray
    work: np.ndarray


def evaluate(
    model: Model, state: State, t: float, variant: str = VARIANT, n_times: int = 1
) -> Forces:
    """Return all forces at time t (s); the state does not change.

    Args:
        model: from `model`, for the scene of the state.
        state: the state.
        t: time, in s.
        variant: build to use, which does not change results.
        n_times: number of times that the evaluation is repeated, for timing.

    Raises:
        ValueError: arrays do not fit the model, or n_times is less than 1.
    """
    state.check(model.N_x, n_memory=model.n_memory)
    if not 1 <= n_times < 2**31:
        raise ValueError(f"n_times = {n_times}: must be from 1 to {2**31 - 1}")
    a, *rest, status = load_variant(variant).evaluate(
        *model, t, n_times, state.y.T, state.rod, state.mode, state.numbers.T
    )
    _check_status(status, state.y.shape)
    return Forces(a.T, *rest)


class SlowSlip(NamedTuple):
    """Slip without inertia, up to a time on the grid of time steps.

    Attributes:
        t: end time since the beginning, in s.
        u: displacements since the beginning, shape (N_x,), in m.
        log_theta: ln of theta (s), shape (N_x,).
        v: velocities, shape (N_x,), in m/s.
        a: accelerations, shape (N_x,), in m/s^2.
        points: u, ln theta and v at those requested times that were reached, shape (n, 3, N_x).
        h: length of the next step, in s.
        steps: number of steps made.
        goes_on: whether slip can go on, because neither a limit nor an error ended it.
        passed: passages through the threshold, shape (m, 2), in order of time: block, and new value
            of the block in `fast` (see `slow_slip`). Some passages may be after t.
        passed_at: for each passage, time since the beginning (s), normal force of the block (N),
            and displacements of all blocks (m), shape (m, N_x + 2).
        sums: time (s) and |sum of velocities| (m/s) at the ends of steps, shape (steps, 2); empty
            without a threshold.
    """

    t: float
    u: np.ndarray
    log_theta: np.ndarray
    v: np.ndarray
    a: np.ndarray
    points: np.ndarray
    h: float
    steps: int
    goes_on: bool
    passed: np.ndarray
    passed_at: np.ndarray
    sums: np.ndarray


class SlowLimits(NamedTuple):
    """Limits that end slip without inertia, and its accuracy.

    Attributes:
        end: end time since the beginning, in s, to which the last step is shortened.
        dt: spacing of the time grid, and shortest step, in s.
        relative: relative error of a step, in displacements and ln theta.
        u: additional absolute error of displacements, in m.
        log_theta: additional absolute error of ln theta.
        inertia: largest sum of loads by inertia over the interface, in N.
        speed: speed that no block may reach, in m/s.
        least: step length below which slip ends if steps do not grow, in s. Shorter steps save no
            work.
        last: requested time of the final state, in s, on the grid. The first step that reaches this
            time is the last step, and is not shortened.
        steps: largest number of steps.
    """

    end: float
    dt: float
    relative: float
    u: float
    log_theta: float
    inertia: float = np.inf
    speed: float = np.inf
    least: float = 0.0
    last: float = np.inf
    steps: int = 2**31 - 1


def slow_slip(
    model: Model,
    load: tuple[np.ndarray, np.ndarray],
    p: tuple[np.ndarray, np.ndarray],
    log_theta: np.ndarray,
    limits: SlowLimits,
    *,
    viscous: tuple[np.ndarray, np.ndarray] | None = None,
    inertial: tuple[np.ndarray, np.ndarray] | None = None,
    v: np.ndarray | None = None,
    closed: np.ndarray | None = None,
    times: np.ndarray | None = None,
    h: float = 0.0,
    threshold: float = 0.0,
    fast: np.ndarray | None = None,
    variant: str = VARIANT,
) -> SlowSlip:
    """Return slip without inertia under rate-and-state friction (pyfric_slow_slip in Fortran).

    Args:
        model: from `model`, for a scene with rate-and-state friction.
        load: load on each block along +x, in N: its value, first and second time derivative, shape
            (N_x, 3), and its derivatives by displacements, shape (N_x, N_x).
        p: normal force with the derivatives of `load`.
        log_theta: ln of theta (s) at the beginning, shape (N_x,).
        limits: limits and accuracy.
        viscous: derivatives of load and normal force by velocities, shapes (N_x, N_x), in N s/m;
            None means 0.
        inertial: derivatives of load and normal force by accelerations, shapes (N_x, N_x), in kg;
            None means 0.
        v: velocities at the beginning, shape (N_x,), in m/s, needed if the state evolves with
            stress; None means velocities that balance the loads.
        closed: blocks in contact, shape (N_x,), bool; None means all.
        times: times of points, ascending, in s.
        h: length of the first step, in s; 0 means dt.
        threshold: speed above which a block is fast, in m/s; 0 means no threshold. Slip ends early
            if there is no more room for passages, and can then go on in another call.
        fast: +1 or -1 for blocks that are fast to the right or left at the beginning, 0 for others,
            shape (N_x,), int32; None means 0.
        variant: build to use, which does not change results.

    Raises:
        ValueError: arrays do not fit the model, or the model has another law.
        MemoryError: there is no memory for the work space.
    """
    N_x = model.N_x
    shapes = (N_x, 3), (N_x, N_x)
    fit = all(a.shape == b for part in (load, p) for a, b in zip(part, shapes, strict=True))
    if not model.flows or not fit or log_theta.shape != (N_x,):
        raise ValueError(f"slow_slip: needs rate-and-state friction and arrays of {N_x} blocks")
    times = np.zeros(0) if times is None else np.asarray(times, dtype=float)
    contact = np.ones(N_x) if closed is None else closed
    none = np.zeros((N_x, N_x))
    by_v = (none, none) if viscous is None else viscous
    by_a = (none, none) if inertial is None else inertial
    if any(array.shape != none.shape for array in by_v):
        raise ValueError(f"slow_slip: needs viscosity of {N_x} x {N_x} blocks")
    elastic = (
        array for part, v, a in zip((load, p), by_v, by_a, strict=True) for array in (*part, v, a)
    )
    q = np.array([np.zeros(N_x), log_theta])
    points, step = np.zeros((max(len(times), 1), 3, N_x)), np.array([h or limits.dt])
    passed_i = np.zeros((4 * N_x, 2), dtype=np.int32)
    passed_r = np.zeros((4 * N_x, N_x + 2))
    sums = np.zeros((limits.steps if threshold else 1, 2))
    v = np.full(N_x, np.nan) if v is None else np.array(v, dtype=float)
    a, made, t, status = load_variant(variant).slow_slip(
        *model,
        contact.astype(np.int32),
        *(np.asfortranarray(array) for array in elastic),
        np.array(limits[:-1]),
        limits.steps,
        times if len(times) else np.array([np.inf]),
        threshold,
        step,
        q.T,
        v,
        points.T,
        np.zeros(N_x, dtype=np.int32) if fast is None else fast,
        passed_i.T,
        passed_r.T,
        sums.T,
    )
    _check_status(-status, (1, 4, N_x))
    steps, n, m = made.tolist()
    order = np.lexsort((passed_i[:m, 0], passed_r[:m, 0]))
    found = passed_i[order], passed_r[order], sums[: steps if threshold else 0]
    goes_on = status <= SLIP_FINISHED
    return SlowSlip(t, *q, v, a, points[:n], float(step[0]), steps, goes_on, *found)


def bond_forces(scene: Scene, geometry: Geometry) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function that computes the forces of all springs on the blocks.

    The function takes displacements u, shape (N_z, 2, N_x) or flat, in m. It returns forces in N,
    in the same shape.
    """
    bare = springs(scene, geometry, 1.0)
    memory = np.zeros((bare.n_memory, scene.N_x), order="F")
    # m = 1: accelerations equal forces
    y, rod = np.zeros((scene.N_z, 4, scene.N_x)), np.zeros(6)
    mode = np.full(scene.N_x, OPEN, dtype=np.int32)

    def forces(u: np.ndarray) -> np.ndarray:
        y[:, :2] = u.reshape(scene.N_z, 2, scene.N_x)
        a, *_, status = load_variant(VARIANT).evaluate(*bare, 0.0, 1, y.T, rod, mode, memory)
        _check_status(status, y.shape)
        return a.T.reshape(u.shape)

    return forces


def curve_point(model: Model, state: State, t: float, budget: bool = True) -> np.ndarray:
    """Return a point of the loading curve at time t (s), shape (16,).

    The first number is F_T (N). All others are in J: seven energies; the works of driver and load;
    heat of bonds, heat of friction, loss by switches and two parts of the friction heat; and the
    part of the heat of bonds that absorbing walls took. Without `budget` all these are 0.

    Raises:
        ValueError: arrays do not fit the model.
    """
    state.check(model.N_x, n_memory=model.n_memory)
    spent = state.dissipated, state.radiated, state.heat, state.loss, state.parts.T, state.work
    motion = state.y.T, state.rod, state.numbers.T
    values, status = _core.curve_point(*model, t, *motion, *spent, int(budget))
    _check_status(status, state.y.shape)
    return values


def energies(model: Model, state: State, t: float) -> dict[str, float]:
    """Return the energies of a state at time t (s), in J, by the names of `ENERGIES`.

    On junctions the result also has the energy "elastic_junctions".

    Raises:
        ValueError: arrays do not fit the model.
    """
    values = curve_point(model, state, t)[1:8].tolist()
    found = dict(zip((*ENERGIES, JUNCTIONS), values, strict=True))
    if not model.on_junctions:
        del found[JUNCTIONS]
    return found
