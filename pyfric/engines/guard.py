"""Checks that end a run outside the range of the model.

A step within the stability limit keeps small motions bounded, but large motions can still grow.
Three checks end such a run. The first is made after each call of the core, the others every `STEPS`
steps:

- numbers: every displacement and velocity is finite;
- energy: only the driver and the forces on the top can add energy. Let G be the kinetic and elastic
  energy and the potential of the load. Then dG/dt <= F_T V, and F_T <= sqrt(2 K G) because G
  contains the energy of the driver's spring. When G first reaches a new maximum G_1, all earlier
  values are lower, so that

      G_1 - G_0 <= V (t_1 - t_0) sqrt(2 K max(G_0, G_1)) + work of the constant shear forces.

  The exact motion satisfies this bound for any sequence of contact states. `MARGIN` times G allows
  for errors of the steps. An instability makes G grow without limit and violates the bound;
- lattice, in finite geometry: no corner of a cell is turned inside out, which springs alone would
  allow. The core also ends a call after a step that may have turned a corner inside out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric import core
from pyfric.engines.strains import folded
from pyfric.record import budget_error, budget_left

if TYPE_CHECKING:
    import pandas as pd

    from pyfric.core import State
    from pyfric.scene import Geometry, Scene
    from pyfric.statics import Equilibrium

STEPS = 250
"""Steps between two checks of energy and lattice. A run that fails a check returns to the last
state that passed."""
MARGIN = 0.1
"""Relative energy that errors of steps may add between two checks."""


class Trouble(NamedTuple):
    """The failed check of a state, and the column and row of the block concerned."""

    what: str
    i: int
    j: int


class Energy(NamedTuple):
    """Energy of a state, and works up to its time.

    Attributes:
        t: time, in s.
        stored: energy G, in J.
        shear: work of constant shear forces, in J.
        changes: bound of the work that changes of loads do from u = 0 on, in J.
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
        loaded: the loaded slider at rest, whose energy sets the constant in G.
    """

    def __init__(
        self, scene: Scene, model: core.Model, geometry: Geometry, loaded: Equilibrium
    ) -> None:
        self.scene, self.model = scene, model
        self.finite = geometry == "finite"
        # Without friction the loaded slider would gain a little more energy from the load, but less
        # than its elastic energy at rest. With this energy as constant, G stays above the energy of
        # the driver's spring.
        rest = loaded.state(scene, 1.0)
        parts = core.energies(model, rest, 0.0)
        elastic = sum(parts[name] for name in core.ENERGIES[2:5])
        self.floor = elastic - self._potential(rest)
        # Rounding of the energy of bonds under F_N/N_x, summed over blocks.
        self.rounding = np.finfo(float).eps * scene.F_N**2 / (scene.N_x * scene.slider.k)

    def _potential(self, state: State) -> float:
        """Return the potential of the load, in J."""
        scene = self.scene
        weight = float(np.sum(scene.weights * state.y[:, 1])) if scene.slider.g else 0.0
        if scene.rigid:
            return float((scene.F_N + scene.M_rod * scene.slider.g) * state.rod[1]) + weight
        return float(scene.load @ state.y[-1, 1]) + weight

    def energy(self, state: State, model: core.Model | None = None) -> Energy:
        """Return the energy of a state; `model` is the model at its time, None the present one."""
        stored = sum(core.energies(model or self.model, state, state.t).values())
        scene, u = self.scene, state.y[:, 0]
        shear = float(scene.shear @ u[scene.j_shear] + scene.push_at(state.t)[0] @ u[0])
        stored += self._potential(state) + self.floor
        return Energy(state.t, stored, shear, self._of_changes(state))

    def _of_changes(self, state: State) -> float:
        """Return a bound of the work (J) that changes of loads do until a state.

        The potential uses F_N and T at t = 0. The bound is a sum over loads: the largest change of
        a load in its protocol, times the largest displacement. The loads are F_N, T, pushes, and
        forces of a moving plate on the top. Between two states, both bounds are added.
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
        """Return the relative error of the energy budget of a curve, 0 if rounding explains it."""
        small = budget_left(curve).abs().max() <= self.rounding
        return 0.0 if small else budget_error(curve)

    def trouble(self, before: State, after: State, base: Energy | None = None) -> Trouble | None:
        """Return the failed check of the state `after`, None if it passes.

        Args:
            before: an earlier state of the run.
            after: the state to check.
            base: energy of an earlier state; None means that only the numbers are checked.
        """
        if not (np.isfinite(after.y).all() and np.isfinite(after.rod).all()):
            return Trouble("the motion is not finite", *_fastest(before))  # before NaN spread
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
