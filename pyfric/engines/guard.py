"""Checks that end a run outside the range of the model: numbers, energy, lattice.

A step within the stability limit keeps small motions bounded, but large motions can still grow.
There are three checks. The first follows each call of the core, the others every `STEPS` steps:

- numbers: every displacement and velocity is finite;
- energy: only the driver and the forces on the top can add energy. Let G be the kinetic and elastic
  energy and the potential of the load. Then dG/dt <= F_T V, and F_T <= sqrt(2 K G) because G
  contains the energy of the driver's spring. When G first reaches a new maximum G_1, all earlier
  values are lower, so that

      G_1 - G_0 <= V (t_1 - t_0) sqrt(2 K max(G_0, G_1)) + work of the constant shear forces.

  The exact motion satisfies this bound for any sequence of contact states. `MARGIN` times G allows
  for errors of the steps. An instability makes G grow without limit and violates the bound;
- lattice, in finite geometry: no corner of a cell is turned inside out. The springs alone would
  allow it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric import core
from pyfric.core import State
from pyfric.scene import default_geometry

if TYPE_CHECKING:
    from pyfric.record import Method
    from pyfric.scene import Geometry, Scene
    from pyfric.statics import Equilibrium

STEPS = 250
"""Steps between two checks of energy and lattice. A run that fails returns to the last one."""
MARGIN = 0.1
"""Energy that errors of the steps may add between two checks, over the energy."""
STRAIN_SHARE = 0.65
"""Largest strain of a bond, at the driven block, over F_T/(k l). Under a plate it is smaller."""
LINEAR = 0.1
"""Strain above which results of linear geometry carry a note."""


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

    def _potential(self, state: State) -> float:
        """Return the potential of the load, in J."""
        if self.scene.rigid:
            return float(self.scene.F_N * state.rod[1])
        return float(self.scene.load @ state.y[-1, 1])

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
        protocol, times the largest displacement. Between two states, it is the sum of both bounds.
        """
        top, parts = self.scene.top, 0.0
        for name, first, c in (("protocol", self.scene.F_N, 1), ("T_protocol", 0.0, 0)):
            change = max((abs(value - first) for _, value in getattr(top, name, ())), default=0.0)
            parts += change * float(np.abs(state.y[-1, c]).max())
        changing = [one for one in top.push if not one.ever]
        most = sum(abs(one.force) + abs(one.at(min(state.t, one.end))) for one in changing)
        parts += most * float(np.abs(state.y[0, 0]).max())
        return 2 * parts

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
        driver, most = self.scene.driver, max(G_0, G_1)
        work = driver.fastest * (t_1 - t_0) * np.sqrt(2 * driver.K * max(most, 0.0))
        work += changes_0 + changes_1
        if not G_1 - G_0 - (W_1 - W_0) <= work + MARGIN * most:
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


def largest_load(scene: Scene, t_end: float = math.inf) -> tuple[float, float]:
    """Return the largest F_N and |T| up to t_end (s), in N."""
    if scene.load_at(0.0) is None:
        return scene.F_N, 0.0
    times = [0.0, *(one for one in scene.corners if one < t_end)]
    times += [t_end] * math.isfinite(t_end)
    F_N, T = np.abs([scene.load_at(t) for t in times]).max(axis=0)
    return float(F_N), float(T)


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
    loads = max(largest_load(scene, t_end)) / scene.N_x
    return max(STRAIN_SHARE * abs(F_T), loads) / unit


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
