"""The ladder with friction that weakens over a length.

Between events blocks slip stably, as static states (`pyfric.statics.creep`). Where slip loses
stability an event begins: it nucleates. The driver then stands still, and blocks slip as if a drag
resisted them, with no inertia,

    drag du/dt = -R(u) ,

R the sum of all forces. One block is released at a time, the one whose strength is exceeded most;
one that would move back sticks; at the end all stick. What stops a front is then the work of
weakening: it goes on while the energy that slip releases pays for it.

Source: K. Uenishi and J. R. Rice, J. Geophys. Res. 108, 2042 (2003), for nucleation.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.engines.quasistatic import SWEEPS, QuasistaticRun
from pyfric.engines.stretches import Stretch
from pyfric.statics import Creep, Values

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.scene import Scene
    from pyfric.statics import Forces

__all__ = ["SoftLadder"]

PUSH = 1e-6
"""How far the driver moves on where slip has lost stability, over F_N/(N_x K)."""
SETTLED = 1e-7
"""Sums of forces on blocks in equilibrium, over F_N/N_x."""
DRAG = 0.01
"""Least stiffness of slip without drag, over k."""
LEAST = 1e-6
"""A block with less load than this many F_N/N_x does not stick."""
STEPS = 40
"""Most steps for each change of contact state in an event."""


class _Interface(NamedTuple):
    """The interface as the ladder logs it."""

    slip: np.ndarray
    closed: np.ndarray
    drive: float
    tol: float
    now: Values

    def values(self) -> Values:
        return self.now


class SoftLadder(QuasistaticRun):
    """The ladder of quasi-static events of a scene whose friction weakens over a length."""

    def __init__(self, scene: Scene, t_gap: float | None = None) -> None:
        super().__init__(scene, t_gap)
        start, none = self.contact, np.zeros(scene.N_x)
        self.creep = Creep(self.problem, start.values().u_x, none, start.closed, none)
        self.tol, self.force = start.tol, SETTLED * self.problem.unit
        self._put(start.values(), start.drive)

    def _put(self, now: Values, drive: float) -> None:
        slip, closed = self.creep.way.astype(np.int8), self.creep.closed.copy()
        self.contact = _Interface(slip, closed, drive, self.tol, now)

    def _note(self, now: Values, drive: float) -> None:
        """Log what has switched; slip starts where blocks are now."""
        self._put(now, drive)
        self.log.set(self.contact, self.t, now)

    def advance(self, t_end: float, stop: Callable[[], bool], show: Callable[..., None]) -> bool:
        """Follow the scene to t_end (s); return whether it got there."""
        start = time.perf_counter()
        self.sample()
        for leg in self.scene.legs(t_end):
            if stop():
                break
            self.stretch = Stretch(leg, self.drive_0)
            if leg.way > 0:
                self._climb(self.drive_0 + leg.last, stop, show)
                continue
            if self.creep.way.any():  # it comes to rest where the driver holds
                self._rest()
                self.sample()
            self.rows.append((leg.t_end, self.contact.now.F_T))
        self.timings["events"] = time.perf_counter() - start
        return not stop()

    def _climb(self, drive_end: float, stop: Callable[[], bool], show: Callable[..., None]) -> None:
        """Follow stable slip and events until the driver is at drive_end."""
        creep, begin, idle = self.creep, self.creep.at(self.contact.drive), 0
        while not stop():
            drive = self.contact.drive
            if begin is None:
                self._event(drive, stop)
                self.sample()
                show(self.t, self.rows[-1][1], self.events)
                begin = creep.at(self.contact.drive)
                idle += begin is None
            else:
                path, change = creep.follow(begin, drive_end)
                begin = None
                for one in path:
                    self._put(Values(one.u_x, one.f, self._u_z(one), one.p, one.F_T), one.drive)
                    self.sample()
                if change.what == "end":
                    return
                if change.block >= 0:
                    begin = creep.after(change, path[-1])
                    self._note(self.contact.now, path[-1].drive)
            idle = idle + 1 if self.contact.drive - drive <= self.tol / self.scene.driver.K else 0
            if idle > SWEEPS * self.scene.N_x:
                raise self._unsettled(idle)

    def _rest(self) -> None:
        """Let all blocks stick where they are."""
        now, drive = self.contact.now, self.contact.drive
        self._stick(now.u_x.copy(), self.creep.forces(now.u_x, drive), drive)

    def _u_z(self, point: object) -> np.ndarray:
        return self.creep.forces(point.u_x, point.drive).u_z

    # --- events ----------------------------------------------------------------------------------

    def _event(self, drive: float, stop: Callable[[], bool]) -> None:
        """Let blocks slip with the driver at one place, until all are in equilibrium."""
        creep, scene = self.creep, self.scene
        self.events += 1
        drive += PUSH * self.problem.unit / scene.driver.K
        u_x = self.contact.now.u_x.copy()
        for _ in range(STEPS * SWEEPS * scene.N_x):
            if stop():
                return
            now = creep.forces(u_x, drive)
            if self._switches(u_x, now, drive):
                continue
            step = self._step(now)
            if step is None:
                self._stick(u_x, now, drive)
                return
            i = int(np.argmin(creep.way * step))
            if creep.way[i] * step[i] * scene.slider.k < -self.force:
                self._turn(i, 0.0, u_x, now, drive)
                continue
            u_x += step * self._share(u_x, step)
            creep.look(u_x)
        raise self._unsettled(STEPS * SWEEPS * scene.N_x)

    def _step(self, now: Forces) -> np.ndarray | None:
        """Return how far blocks slip next, shape (N_x,), in m; None where they are at rest."""
        free, step = np.flatnonzero(self.creep.free), np.zeros(self.scene.N_x)
        least, soft = now.least(), DRAG * self.scene.slider.k
        if not free.size or (least > 0 and np.abs(now.left).max() <= self.force):
            return None
        drag = max(-2 * least, soft - least, 0.0) if least < soft else 0.0
        step[free] = -np.linalg.solve(now.J + drag * np.eye(len(free)), now.left)
        return step

    def _share(self, u_x: np.ndarray, step: np.ndarray) -> float:
        """Return the share of a step that takes no block beyond its next knot."""
        creep = self.creep
        room, by = creep.knot() - (creep.clock + creep.way * u_x), creep.way * step
        over = (creep.way != 0) & (by > room)
        if not over.any():
            return 1.0
        return min(1.0, float(np.min((np.maximum(room, 0.0)[over] + 1e-15) / by[over])))

    def _switches(self, u_x: np.ndarray, now: Forces, drive: float) -> bool:
        """Let one block open, land or slip that has to; whether one did."""
        creep, tol = self.creep, 10 * self.tol
        depth = np.where(creep.closed, -now.p, -creep.k_f * now.u_z)
        i = int(np.argmax(depth))
        if depth[i] > tol:
            creep.closed[i] ^= True
            self._turn(i, 0.0, u_x, now, drive)
            return True
        margin = np.where(creep.free, np.inf, self.scene.law.margin(now.p, now.f))
        i = int(np.argmin(margin))
        if not margin[i] < -tol:
            return False
        self.releases += 1
        self._turn(i, -float(np.sign(now.f[i])), u_x, now, drive)
        return True

    def _turn(self, i: int, way: float, u_x: np.ndarray, now: Forces, drive: float) -> None:
        """Let block i slip one way, or none."""
        self.creep.turn(i, way, u_x)
        self.creep.u_x = u_x.copy()
        self._note(Values(u_x.copy(), now.f, now.u_z, now.p, now.F_T), drive)

    def _stick(self, u_x: np.ndarray, now: Forces, drive: float) -> None:
        """End an event: all blocks stick that carry more than next to nothing."""
        creep = self.creep
        creep.way[now.p > LEAST * self.problem.unit] = 0.0
        creep.u_x = u_x.copy()
        self._note(Values(u_x.copy(), now.f, now.u_z, now.p, now.F_T), drive)
