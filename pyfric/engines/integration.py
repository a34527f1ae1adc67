"""A run of an engine with time steps: its set-up, the grid of its steps, and checks that end it.

A step within the stability limit keeps small motions bounded, but large motions can still grow.
Three checks end a run outside the range of the model. The first follows each call of the core, the
others every `STEPS` steps:

- numbers: every displacement and velocity is finite;
- energy: only the driver and the forces on the top can add energy. Let G be the kinetic and elastic
  energy and the potential of the load. Then dG/dt <= F_T V, and F_T <= sqrt(2 K G) because G
  contains the energy of the driver's spring. When G first reaches a new maximum G_1, all earlier
  values are lower, so that

      G_1 - G_0 <= V (t_1 - t_0) sqrt(2 K max(G_0, G_1)) + work of the constant shear forces.

  The exact motion satisfies this bound for any sequence of contact states. `MARGIN` times G allows
  for errors of the steps. An instability makes G grow without limit and violates the bound;
- lattice, in finite geometry: no corner of a cell is turned inside out. The springs alone would
  allow it. The core also ends a call after a step in which one may have been.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextvars import ContextVar
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric import core
from pyfric.core import State
from pyfric.display import Progress, run_bar
from pyfric.engines.stopping import stopping_of
from pyfric.record import Record, budget_error, budget_left
from pyfric.scene import default_geometry
from pyfric.signals import answered
from pyfric.statics import EquilibriumError, StaticSolver, check_pushes, one_thread
from pyfric.values import SceneError, check_number

if TYPE_CHECKING:
    import pandas as pd

    from pyfric.engines.dynamic import Run
    from pyfric.engines.options import Options
    from pyfric.record import Method
    from pyfric.scene import Geometry, OnDriven, Scene
    from pyfric.statics import Equilibrium

ON_GRID = 1e-9
"""A breakpoint of a protocol this close to the end of a step, over dt, counts as on it."""
FOLDING = 0.2
"""Strain of bonds above which F_N is reported as too large if no loaded state is found."""
STEPS = 250
"""Steps between two checks of energy and lattice. A run that fails returns to the last one."""
MARGIN = 0.1
"""Energy that errors of the steps may add between two checks, over the energy."""
STRAIN_SHARE = 0.65
"""Largest strain of a bond, at the driven block, over F_T/(k l). Under a plate it is smaller."""
LINEAR = 0.1
"""Strain above which results of linear geometry carry a note."""


def integrate(
    kind: type[Run],
    scene: Scene,
    t_end: float,
    options: Options,
    *,
    initial: State | Record | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
    enough: Callable[[Run], bool] | None = None,
) -> Record:
    """Integrate a scene with a kind of run that makes time steps; see `pyfric.simulate`.

    The run ends with status "interrupted" as soon as `enough` returns true.
    """
    before = initial if isinstance(initial, Record) else None
    if before is not None:
        initial = before.final_state
    if initial is not None:
        initial = initial if before is not None else initial.under(scene)
        initial.check_physics(scene)
    t_begin = 0.0 if initial is None else initial.t
    t_end = check_number("t_end", t_end, "s", ge=0.0)
    if before is not None and t_begin - initial.dt < t_end < t_begin:
        t_end = t_begin  # a run to t_end ends with the step that reaches it
    t_end = check_number("t_end", t_end, "s", ge=t_begin)
    method = options.settled(scene, kind.engine(), t_begin, t_end)

    # One BLAS thread from here on: banded matrices and small products get slower with more.
    with run_bar(progress, scene.name, t_begin, t_end) as show, one_thread():
        start = time.perf_counter()
        solver = _loaded(scene, method.geometry, None if initial is None else initial.u_drv0)
        dt = method.dt
        state = solver.loaded.state(scene, dt) if initial is None else initial.with_dt(dt)
        stopping = stopping_of(options.stop_when, scene, method.t_gap, before, t_end)
        if stopping is not None and before is None:
            stopping.begin(state)
        run = kind(scene, method, solver, state, before, stopping)
        run.timings["set-up"] = time.perf_counter() - start
        last = _last(scene, state, t_end)
        with answered() as stop:
            run.advance(last, lambda: stop() or (enough is not None and enough(run)), show, options)
            done = "complete" if run.state.step >= last else "interrupted"
            return run.record(run.ending or done, late=enough is None)


def _last(scene: Scene, state: State, t_end: float) -> int:
    """Return the number of the last step. Each breakpoint of a protocol starts a new time grid."""
    t0 = state.t0
    for corner in scene.corners:
        if state.t + ON_GRID * state.dt < corner < t_end:
            t0 = corner - last_step(t0, state.dt, corner) * state.dt
    return math.ceil((t_end - t0) / state.dt * (1 - 1e-14))


_KEPT: ContextVar[dict[tuple[Scene, Geometry], StaticSolver] | None] = ContextVar(
    "kept", default=None
)


@contextlib.contextmanager
def shared_statics() -> Iterator[None]:
    """Let runs of one scene in one geometry that follow each other share their statics."""
    token = _KEPT.set({})
    try:
        yield
    finally:
        _KEPT.reset(token)


def _loaded(scene: Scene, geometry: Geometry, u_drv0: OnDriven | None) -> StaticSolver:
    """Return the static solver with the loaded slider, that of the run before if it is the same."""
    kept = _KEPT.get()
    if kept is None or u_drv0 is not None:
        return _found(scene, geometry, u_drv0)
    if (scene, geometry) not in kept:
        kept.clear()
        kept[scene, geometry] = _found(scene, geometry, None)
    return kept[scene, geometry]


def _found(scene: Scene, geometry: Geometry, u_drv0: OnDriven | None) -> StaticSolver:
    """Return the static solver with the loaded slider.

    Raises:
        SceneError: the load folds the lattice (finite geometry), or pushes are refused.
        EquilibriumError: no loaded state was found, for any other reason.
    """
    strain, pushed = largest_strain(scene, 0.0, 0.0), scene
    scene = scene.replace({"top.push": ()}) if scene.top.push else scene
    allowed = (
        "a force that compresses bonds by less than their length, far below k l N_x = "
        f"{scene.slider.k * scene.slider.l * scene.N_x:.3g} N"
    )
    try:
        solver = StaticSolver(scene, geometry, u_drv0=u_drv0)
    except EquilibriumError as error:
        if geometry == "linear" or strain < FOLDING:
            raise
        raise SceneError("top.F_N", scene.F_N, "N", allowed, str(error)) from error
    at = folded(scene, solver.loaded.u) if geometry == "finite" else None
    if at is not None:
        reason = f"it folds the lattice at the block in column {at[0] + 1}, row {at[1] + 1}"
        raise SceneError("top.F_N", scene.F_N, "N", allowed, reason)
    if u_drv0 is None:
        check_pushes(pushed, solver)
    return solver


def last_step(t0: float, dt: float, t: float) -> int:
    """Return the number of the first step that ends at t or later, within rounding."""
    return math.ceil((t - t0) / dt * (1 - 1e-14) - ON_GRID)


def just_after(state: State) -> float:
    """Return a time (s) just after the state, which selects the next piece of a protocol."""
    return state.t + ON_GRID * state.dt


class Trouble(NamedTuple):
    """What is wrong with a state, and the column and row of the block where it is."""

    what: str
    i: int
    j: int


class Energy(NamedTuple):
    """Energy of a state at a step and time (s).

    Attributes:
        t: time, in s.
        stored: energy G, in J.
        shear: work of constant shear forces, in J.
        changes: bound of the work of changes of loads, relative to u = 0, in J.
    """

    t: float
    stored: float
    shear: float
    changes: float


class Guard:
    """Checks of the states of one run.

    Args:
        scene: the scene.
        model: the scene in the form that the core takes.
        geometry: "linear" or "finite".
        loaded: the loaded slider at rest; its energy sets the constant in G.
    """

    def __init__(
        self, scene: Scene, model: core.Model, geometry: Geometry, loaded: Equilibrium
    ) -> None:
        self.scene, self.model = scene, model
        self.finite = geometry == "finite"
        # Without friction the loaded slider would gain a little more energy from the load, but less
        # than it has already gained. So G, which is the elastic energy at rest, stays above the
        # energy of the driver's spring.
        rest = loaded.state(scene, 1.0)
        parts = core.energies(model, rest, 0.0)
        elastic = sum(parts[name] for name in core.ENERGIES[2:5])
        self.floor = elastic - self._potential(rest)
        # Rounding of what a bond stores under F_N/N_x, summed over blocks: less says nothing.
        self.rounding = np.finfo(float).eps * scene.F_N**2 / (scene.N_x * scene.slider.k)

    def _potential(self, state: State) -> float:
        """Return the potential of the load, in J."""
        scene = self.scene
        weight = float(np.sum(scene.weights * state.y[:, 1])) if scene.slider.g else 0.0
        if scene.rigid:
            return float((scene.F_N + scene.M_rod * scene.slider.g) * state.rod[1]) + weight
        return float(scene.load @ state.y[-1, 1]) + weight

    def energy(self, state: State, model: core.Model | None = None) -> Energy:
        """Return the energy of a state; `model` is that of its time if loads changed since."""
        stored = sum(core.energies(model or self.model, state, state.t).values())
        scene, u = self.scene, state.y[:, 0]
        shear = float(scene.shear @ u[scene.j_shear] + scene.push_at(state.t)[0] @ u[0])
        stored += self._potential(state) + self.floor
        return Energy(state.t, stored, shear, self._of_changes(state))

    def _of_changes(self, state: State) -> float:
        """Return a bound of the work (J) of changes of F_N, T and pushes up to a displacement.

        The potential uses F_N and T at t = 0. The bound uses their largest change over the whole
        protocol, and that by a moving plate on the top until now, times the largest displacement.
        Between two states, it is the sum of both bounds.
        """
        top, parts = self.scene.top, 0.0
        for protocol, first, c in ((top.protocol, self.scene.F_N, 1), (top.T_protocol, 0.0, 0)):
            change = max((abs(value - first) for _, value in protocol), default=0.0)
            parts += change * float(np.abs(state.y[-1, c]).max())
        plate = self.scene.N_x * self.scene.k_top * abs(self.scene.V_top) * state.t
        parts += plate * float(np.abs(state.y[-1, 0]).max())
        changing = [push for push in top.push if not push.ever]
        force = sum(abs(push.force) + abs(push.at(min(state.t, push.end))) for push in changing)
        parts += force * float(np.abs(state.y[0, 0]).max())
        return 2 * parts

    def missing(self, curve: pd.DataFrame) -> float:
        """Return what the energy budget of a curve misses, relative; 0 if it may be rounding."""
        small = budget_left(curve).abs().max() <= self.rounding
        return 0.0 if small else budget_error(curve)

    def trouble(self, before: State, after: State, base: Energy | None = None) -> Trouble | None:
        """Return what is wrong with the state `after`, None if nothing is.

        Args:
            before: an earlier state of the run.
            after: the state to check.
            base: energy of an earlier state; None means that only the numbers are checked.
        """
        if not (np.isfinite(after.y).all() and np.isfinite(after.rod).all()):
            return Trouble("the motion is not finite", *_fastest(before))  # later it has spread
        if base is None:
            return None
        t_0, G_0, W_0, changes_0 = base
        t_1, G_1, W_1, changes_1 = self.energy(after)
        driver, largest = self.scene.driver, max(G_0, G_1)
        work = driver.fastest * (t_1 - t_0) * np.sqrt(2 * driver.K * max(largest, 0.0))
        work += changes_0 + changes_1
        if not G_1 - G_0 - (W_1 - W_0) <= work + MARGIN * largest + self.rounding:
            what = f"the energy grows from {G_0:.3g} J to {G_1:.3g} J, by more than the work done"
            return Trouble(what, *_fastest(after))
        at = folded(self.scene, after.y[:, :2]) if self.finite else None
        return None if at is None else Trouble("the lattice is folded", *at)


def _fastest(state: State) -> tuple[int, int]:
    """Return column and row of the fastest block."""
    v = np.hypot(state.y[:, 2], state.y[:, 3])
    j, i = np.unravel_index(np.argmax(v), v.shape)
    return int(i), int(j)


def folded(scene: Scene, u: np.ndarray) -> tuple[int, int] | None:
    """Return column and row of a block at which a cell is turned inside out, or None.

    Args:
        scene: the scene.
        u: displacements, shape (N_z, 2, N_x), in m.
    """
    if scene.N_z == 1:
        return None
    l, x, z = scene.slider.l, u[:, 0], u[:, 1]
    right_x, right_z = l + np.diff(x, axis=1), np.diff(z, axis=1)  # (N_z, N_x - 1)
    up_x, up_z = np.diff(x, axis=0), l + np.diff(z, axis=0)  # (N_z - 1, N_x)
    for rows in (slice(None, -1), slice(1, None)):
        for columns in (slice(None, -1), slice(1, None)):
            area = right_x[rows] * up_z[:, columns] - right_z[rows] * up_x[:, columns]
            if not (area > 0).all():
                j, i = np.argwhere(~(area > 0))[0]
                return int(i + (columns.start or 0)), int(j + (rows.start or 0))
    return None


def largest_strain(scene: Scene, F_T: float, t_end: float = math.inf) -> float:
    """Return the largest strain of a bond under the driver force F_T or under F_N and T.

    Args:
        scene: the scene.
        F_T: force of the driver, in N.
        t_end: time until which F_N and T are considered, in s.
    """
    unit = scene.slider.k * scene.slider.l
    if scene.N_z == 1 or scene.prescribed:
        return abs(F_T) / unit
    times = [0.0, *(corner for corner in scene.corners if corner < t_end)]
    times += [t_end] * math.isfinite(t_end)
    load = max(max(map(abs, scene.load_at(t) or (scene.F_N,))) for t in times)
    return max(STRAIN_SHARE * abs(F_T), load / scene.N_x) / unit


def strain_notes(scene: Scene, engine: str, F_T: float, t_end: float) -> tuple[str, ...]:
    """Return notes on linear geometry up to t_end (s), for driver forces up to F_T (N)."""
    strain = largest_strain(scene, F_T, t_end)
    if strain <= LINEAR:
        return ()
    instead = "; geometry = 'finite' follows them" * (default_geometry(scene) == "finite")
    return (
        f"{engine}: strains reach about {strain:.2g}, above {LINEAR:g}, where linear geometry, "
        f"which leaves out the rotation and the change of length of bonds, means little{instead}",
    )


def contact_notes(
    scene: Scene, engine: str, switches: Mapping[str, np.ndarray], mode: np.ndarray | None = None
) -> tuple[str, ...]:
    """Return a note if most blocks were open at some time; `mode` holds the contacts at the end."""
    changes = (switches["new"] == core.OPEN).astype(int) - (switches["old"] == core.OPEN)
    number = np.cumsum(changes)
    if mode is not None and len(number):
        number += np.sum(mode == core.OPEN) - number[-1]
    lifted = np.flatnonzero(2 * number > scene.N_x)
    if scene.N_z == 1 or not len(lifted):
        return ()
    at = lifted[0]
    return (
        f"{engine}: from t = {switches['t'][at]:.4g} s on {number[at]} of {scene.N_x} blocks have "
        "no contact: the slider turns over or lifts off; a lower driver (h) or T, or a longer "
        "slider (L), keeps it down",
    )


def unfinished(scene: Scene, method: Method, log: core.Log, status: core.Status) -> str:
    """Return the message of a step that the core could not finish."""
    if status == core.Status.TOO_SHORT:
        return (
            f"the error of an adaptive sub-step stays above rtol = {method.rtol:g} at "
            f"t = {log.t:.9g} s, however short it is; increase rtol"
        )
    return (
        f"contacts switch without end inside one step of dt = {method.dt:g} s: block "
        f"{scene.n_of_i[log.block]} (1 at the trailing edge) between stick, slip and gap at "
        f"t = {log.t:.12g} s, more often than {len(scene.x) * 2 + 100} times are allowed; "
        "switching = 'step_end' or a smaller dt goes on"
    )
