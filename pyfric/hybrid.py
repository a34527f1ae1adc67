"""Hybrid engine: dynamics where the interface slips, closed forms where it waits.

Events are integrated like in full dynamics, by the same core and on the same steps in time. Once
nothing slips any more, the slider rings down: `pyfric.ringdown` follows its slow modes in closed
form and bounds the rest. The run jumps to the last step before a contact state can change, and
goes on there, with the modes that are left. What the jump drops is smaller than `REMAINDER`.

Where a jump is not safe, steps are made: a slider that never comes to rest is integrated in full,
and the record says so.

Source: PRL 107, 074301 (2011) for the model.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyfric import core
from pyfric.dynamic import Run
from pyfric.equilibrium import EquilibriumError
from pyfric.ringdown import Frozen, first_crossing
from pyfric.state import OPEN, STUCK

if TYPE_CHECKING:
    from pyfric.equilibrium import Equilibrium

__all__ = ["REMAINDER", "HybridRun"]

REMAINDER = 1e-3
"""What a jump may neglect: its bound of the change of any contact force, over F_N/N_x."""
LOOK = 24
"""Steps between two looks whether a jump is possible; grows while it is not."""
SHORTEST = 64
"""Shortest jump worth its cost, in steps."""
MOSTLY = 0.5
"""A larger share of time that is integrated is noted in the record."""
STRAIGHT = 0.02
"""In finite geometry, F_T over t is taken as straight up to a change of this share of F_N."""
KEPT = 8
"""Contact states whose modes are kept."""


class _Rest(NamedTuple):
    """A static state and its slider with fixed contact states."""

    t: float
    open: np.ndarray
    frozen: Frozen
    growth: np.ndarray
    q: np.ndarray
    margins: np.ndarray
    F_T: float


class HybridRun(Run):
    """A run that steps through events and jumps between them."""

    name = "hybrid"
    keeps_budget = False

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.log = core.Log(self.scene.N_x, quiet=1)
        self.frozen: dict[bytes, Frozen] = {}
        self.jumps, self.jumped, self.wait = 0, 0, LOOK
        self.look_at = self.state.step
        self.rest_key: bytes | None = None
        self.rest: _Rest | None = None

    def _slips(self) -> np.ndarray:
        return np.abs(self.state.mode) == 1

    def call_length(self) -> int:
        """Return how many steps may be made before the next look."""
        slips = self._slips()
        if slips.any():  # the core returns when the last block stops, corner slip aside
            return LOOK if self.state.corner[slips].all() else 2**30
        return max(1, self.look_at - self.state.step)

    def before_call(self, last: int) -> None:
        """Jump if nothing slips and it is safe."""
        state = self.state
        if self._slips().any():
            self.look_at, self.wait = state.step, LOOK
        elif state.step >= self.look_at:
            self.wait = LOOK if self.jump(last) else min(2 * self.wait, 64 * LOOK)
            self.look_at = state.step + self.wait

    def counts(self) -> dict[str, int]:
        """Return steps, block evaluations, jumps and the steps they spared."""
        made = super().counts()
        old = self.before.counts if self.before else {}
        return made | {
            "jumps": self.jumps + old.get("jumps", 0),
            "steps_spared": self.jumped + old.get("steps_spared", 0),
        }

    def notes(self) -> tuple[str, ...]:
        """Say so where the slider hardly ever came to rest."""
        done = self.counts()
        share = done["steps"] / max(done["steps"] + done["steps_spared"], 1)
        if share <= MOSTLY or done["steps"] < 1000:
            return ()
        return (
            f"hybrid: {100 * share:.0f} % of the time was integrated like in full dynamics (more "
            f"than {100 * MOSTLY:.0f} %), because the slider was hardly ever at rest",
        )

    def jump(self, last: int) -> bool:
        """Go to the last step before a contact state can change; False if that is too near."""
        state, scene = self.state, self.scene
        dt, most, V = state.dt, last - state.step, scene.driver.V
        rest = self._rest()
        if rest is None:
            return False
        frozen, known = rest.frozen, self.solver.known
        since = state.t - rest.t
        q = known.coordinates(state.y[:, :2], state.rod[:3])
        v = known.coordinates(state.y[:, 2:], state.rod[3:])
        q -= rest.q + (V * since) * frozen.drift + frozen.lag
        motion = frozen.split(q, v - V * frozen.drift)
        bound = frozen.bound * math.sqrt(motion.remainder)
        rate = V * frozen.margin_rate
        c = rest.margins + rate * since + frozen.margin_lag
        modal = np.column_stack([frozen.modal * (frozen.weight * motion.a), -bound])
        rates = np.append(rest.growth, -frozen.decay)
        there, n_there = None, 0
        for _ in range(8):
            s = first_crossing(c, rate, modal, rates, most * dt, dt)
            n = min(math.floor(s / dt), most)
            left = bound.max() * math.exp(-frozen.decay * n * dt)
            too_soon = left > REMAINDER * scene.F_N / scene.N_x
            if too_soon or n < min(most, SHORTEST):
                return False
            if self.method.geometry == "linear":
                break
            if there is not None and abs(n - n_there) <= 2:
                break
            t, n_there = state.t0 + (state.step + n) * dt, n
            there = self._static(t, rest.open)
            if there is None:
                return False
            rate = (frozen.margins(there) - rest.margins) / (t - rest.t)
            c = rest.margins + rate * since + frozen.margin_lag
        else:
            return False
        if there is None:
            q_there = rest.q + (V * (since + n * dt)) * frozen.drift
            force = rest.F_T + V * frozen.force_rate * (since + n * dt)
        else:
            q_there = known.coordinates(there.u, there.rod)
            q_there += (V * (n - n_there) * dt) * frozen.drift
            force = there.F_T + V * frozen.force_rate * (n - n_there) * dt
        margins = c + rate * (n * dt) + (modal[:, :-1] @ np.exp(rest.growth * (n * dt))).real
        self._sample_jump(rest, force, motion.a, n)
        self._land(q_there, rest, motion.a, n)
        state.slack[:] = frozen.slack(margins)
        return True

    def _static(self, t: float, open_: np.ndarray) -> Equilibrium | None:
        """Return the static state at time t if it has these open blocks."""
        try:
            found = self.solver.solve(self.state.y[0, 0], self.scene.driver.V * t, free=open_)
        except EquilibriumError:
            return None
        return found if (found.open == open_).all() else None

    def _rest(self) -> _Rest | None:
        """Return the static state about which the slider rings, None if there is none."""
        state, known = self.state, self.solver.known
        open_ = state.mode == OPEN
        key = state.y[0, 0, ~open_].tobytes() + open_.tobytes()
        if self.rest_key != key:
            self.rest_key, self.rest = key, None
            found = self._static(state.t, open_)
            if found is not None:
                frozen = self._frozen(~open_)
                q = known.coordinates(found.u, found.rod)
                growth = frozen.growth
                if self.method.geometry == "finite":
                    growth = frozen.stiffened(known.stiffening(found))
                margins = frozen.margins(found)
                self.rest = _Rest(state.t, open_, frozen, growth, q, margins, found.F_T)
        return self.rest

    def _frozen(self, stuck: np.ndarray) -> Frozen:
        key = stuck.tobytes()
        if key not in self.frozen:
            while len(self.frozen) >= KEPT:
                del self.frozen[next(iter(self.frozen))]
            self.frozen[key] = Frozen(self.solver.known, stuck, self.method.dt)
        return self.frozen[key]

    def _sample_jump(self, rest: _Rest, force: float, a: np.ndarray, n: int) -> None:
        """Add the points of the loading curve in a jump of n steps that ends at a static force."""
        state, every, frozen = self.state, self.method.sample, rest.frozen
        steps = np.arange((state.step // every + 1) * every, state.step + n + 1, every)
        t, s = state.t0 + steps * state.dt, (steps - state.step) * state.dt
        t_end = state.t + n * state.dt
        x = (t - rest.t) / (t_end - rest.t)
        F_T = rest.F_T + (force - rest.F_T) * x
        far = abs(force - rest.F_T) > STRAIGHT * self.scene.F_N
        if far and len(t) and self.method.geometry == "finite":
            middle = self._static((rest.t + t_end) / 2, rest.open)
            if middle is not None:  # a parabola
                F_T += (4 * middle.F_T - 2 * (rest.F_T + force)) * x * (1 - x)
        modes = frozen.force_modal * (frozen.weight * a)
        F_T += frozen.force_lag + (modes @ np.exp(np.outer(rest.growth, s))).real
        self.rows += np.column_stack([t, F_T]).tolist()

    def _land(self, q: np.ndarray, rest: _Rest, a: np.ndarray, n: int) -> None:
        """Put the state n steps later, where the static state is q."""
        state, known = self.state, self.solver.known
        frozen = rest.frozen
        w, v = frozen.deviation(a, n * state.dt, rest.growth)
        u_x = state.y[0, 0].copy()
        state.y[:, :2], state.rod[:3] = known.displacements(q + frozen.lag + w)
        state.y[:, 2:], state.rod[3:] = known.displacements(v + self.scene.driver.V * frozen.drift)
        held = state.mode == STUCK
        state.y[0, 0, held], state.y[0, 2, held] = u_x[held], 0.0
        state.step += n
        self.jumps, self.jumped = self.jumps + 1, self.jumped + n
