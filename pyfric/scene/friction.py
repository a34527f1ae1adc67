"""The friction law of a scene: all of Python that knows mu.

A block that has slipped by s at speed v since it last stuck resists with mu p + alpha v:

    stuck       |f| <= mu_s p                                            `Law.hold`
    slips       mu = mu_k + (mu_s - mu_k) slide(s/d_c), times factors    `Law.slide`
    open        nothing

Static states, the ladder and the prediction have no path: for them a slipping block has left its
weakening behind, which is Amontons-Coulomb friction. The core evaluates the same law in Fortran.

Slip is a clock that costs nothing to keep: s = s_0 + mode u_x while a block slips, s_0 otherwise.

Source: PRL 107, 074301 (2011), interface law, and its remark on slip weakening.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pyfric.scene.laws import Tables

__all__ = ["FRICTIONLESS", "Law", "clock", "of", "slipped"]

CLOCKS = np.dtype([("s_0", float), ("t_0", float)])
"""What the law remembers of a block: its slip clock, m; when it stuck or began to slip, s."""

NO_TABLES = Tables()
GRADUAL = 0.01
"""With mu_s - mu_k up to this many mu_s, slip is continuous, at mu_s."""


@dataclass(frozen=True)
class Law:
    """Strength of the interface under a load p; strengths are linear in p, so p may be a stiffness.

    Attributes:
        mu_s: static friction coefficient; a number, or one for each column, shape (N_x,).
        mu_k: kinetic friction coefficient, likewise.
        d_c: slip over which friction weakens, m; 0 for none; likewise.
        alpha: viscosity of slip, N s/m; likewise.
        tables: what else the law says; see `pyfric.laws`.
    """

    mu_s: Any
    mu_k: Any
    d_c: Any = 0.0
    alpha: Any = 0.0
    tables: Tables = NO_TABLES

    def hold(self, p: Any, age: Any = 0.0) -> Any:
        """Return the strength of blocks that have been stuck for `age` (s), in units of p."""
        gain = self.tables.hold
        return self.mu_s * p if gain is None else (self.mu_s + gain(age)) * p

    def slide(self, p: Any, slip: Any = math.inf) -> Any:
        """Return the strength of blocks that have slipped by `slip` (m), in units of p.

        Factors of speed and age, and alpha, are left out.
        """
        if self.tables.slide is None or (np.ndim(slip) == 0 and slip == math.inf):
            return self.mu_k * p
        return self.weakening(slip)[0] * p

    def piece(self, slip: Any) -> np.ndarray:
        """Return on which straight piece of mu(s) blocks are that have slipped by `slip` (m).

        It is the number of the last knot at or before the slip, from 0.
        """
        return self.tables.slide.piece(self._in_units_of_d_c(slip))

    def weakening(self, slip: Any, piece: Any = None) -> tuple[Any, Any]:
        """Return mu of blocks that have slipped by `slip` (m), and dmu/ds (1/m).

        Args:
            slip: path since the last stick, m, a number or one for each column.
            piece: the straight pieces to stay on, from `piece`; None means those of the slip.
        """
        x, table = self._in_units_of_d_c(slip), self.tables.slide
        left, slope = table.on(table.piece(x) if piece is None else piece, x)
        rate = np.divide(self.drop * slope, self.d_c, out=np.zeros(x.shape), where=slope != 0)
        return self.mu_k + self.drop * left, rate

    def next_knot(self, piece: np.ndarray) -> np.ndarray:
        """Return the slip (m) at which straight pieces end; inf for the last one."""
        ends = np.append(self.tables.slide.x[1:], math.inf)[piece]
        return ends * np.where(np.equal(self.d_c, 0), 1.0, self.d_c)

    def _in_units_of_d_c(self, slip: Any) -> np.ndarray:
        """Return slip/d_c; where d_c = 0 friction has fallen at once: inf."""
        slip, d_c = np.broadcast_arrays(np.asarray(slip, float), self.d_c)
        return np.divide(slip, d_c, out=np.full(slip.shape, math.inf), where=d_c > 0)

    def at(self, which: Any) -> Law:
        """Return the law of some columns."""
        fields = {name: of(getattr(self, name), which) for name in ("mu_s", "mu_k", "d_c", "alpha")}
        return replace(self, **fields)

    @property
    def memory(self) -> np.dtype:
        """Names and shapes of what the law remembers of a block, all of them numbers."""
        return CLOCKS

    @property
    def rests(self) -> bool:
        """Whether a block can stick: its u_x then stays. Only full dynamics follows other laws."""
        return True

    @property
    def slowest(self) -> float:
        """Longest mean time that the law itself gives contacts to change, in s."""
        return 0.0

    def in_motion(self, memory: np.ndarray) -> dict[str, np.ndarray]:
        """Return what the curve of a run holds of the memory of blocks, by name, (N_x,) each."""
        return {}

    def begin(
        self, t: float, u_x: np.ndarray, p: np.ndarray, f: np.ndarray, d: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return margins (`State.margin`) and memory of blocks at rest since t (s).

        Args:
            t: time, in s.
            u_x: displacements, shape (N_x,), in m.
            p: normal forces, shape (N_x,), in N.
            f: friction forces on the blocks, along +x, shape (N_x,), in N.
            d: direction of driving.
        """
        memory = np.zeros(len(p), self.memory)
        memory["t_0"] = t
        return self.margin(p, f), memory

    @property
    def core_fields(self) -> tuple[Any, ...]:
        """The fields that the core takes, numbers or one for each column."""
        return self.mu_s, self.mu_k, self.d_c, self.alpha, 0.0

    @property
    def core_tables(self) -> Tables:
        """The tables that the core takes."""
        return self.tables

    @property
    def budget_names(self) -> tuple[str, ...]:
        """Names of what `budget` returns."""
        parts = () if self.coulomb else ("weakening_heat", "viscous_heat")
        return "friction_heat", "switching_loss", *parts

    def budget(self, heat: Any, loss: Any, parts: Any) -> list[Any]:
        """Return what the interface adds to an energy budget, of what the core keeps (`State`)."""
        return [heat, loss, *([] if self.coulomb else parts)]

    @property
    def drop(self) -> Any:
        """Loss of strength in a slip, over p."""
        return self.mu_s - self.mu_k

    @property
    def mean(self) -> Law:
        """The law with the means of its fields."""
        means = {n: float(np.mean(getattr(self, n))) for n in ("mu_s", "mu_k", "d_c", "alpha")}
        return replace(self, **means)

    @functools.cached_property
    def coulomb(self) -> bool:
        """Whether it is Amontons-Coulomb friction."""
        return self.tables == NO_TABLES and not np.any(self.alpha)

    @property
    def weakens(self) -> bool:
        """Whether friction depends on slip."""
        return self.tables.slide is not None and bool(np.any(np.greater(self.drop, 0)))

    def fracture_energy(self, p: Any) -> Any:
        """Return the work against friction beyond mu_k p in a slip, J: (mu_s - mu_k) p d_c/2.

        For other tables than a straight line the area below them stands for 1/2.
        """
        left = self.tables.slide
        return self.drop * self.d_c * (0.0 if left is None else left.area) * p

    def margin(self, p: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Return what is left of the strength of stuck blocks that carry f, in N."""
        return self.hold(p) - np.abs(f)

    def margins(self, p: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the margins against slip in +x and in -x: it is f that resists, in N."""
        strength = self.hold(p)
        return strength + f, strength - f

    def scaled(self, ratio: Any) -> Any:
        """Return (ratio - mu_k)/(mu_s - mu_k) of a tau/p: 0 at mu_k, 1 at mu_s; NaN if equal."""
        drop = np.where(np.equal(self.drop, 0), np.nan, self.drop)
        return (ratio - self.mu_k) / drop

    @property
    def gradual(self) -> bool:
        """Whether slip is taken as continuous."""
        return bool(np.all(self.drop <= GRADUAL * np.asarray(self.mu_s)))

    def continuous(self) -> Law:
        """Return the law whose slip is continuous, at mu_s."""
        return Law(self.mu_s, self.mu_s)

    def steepness(self, p: float) -> float:
        """Return the steepest weakening under a load p (N): its negative stiffness, in N/m.

        It is inf where friction falls at once, unless speed decides.
        """
        if self.tables.slide is None:
            at_once = self.tables.speed is None and np.any(np.greater(self.drop, 0))
            return math.inf if at_once else 0.0
        falls = -float(self.tables.slide.slopes.min())
        d_c = np.where(np.equal(self.d_c, 0), np.nan, self.d_c)
        return max(0.0, falls) * p * float(np.nanmax(self.drop / d_c))

    def growth(self, p: float, m: float) -> float:
        """Return the fastest rate at which weakening lets a free block of mass m (kg) run away.

        Weakening with slip alone gives sqrt(steepness/m), with speed mu p |dfactor/dv|/m; in 1/s.
        """
        falls = 0.0 if self.tables.speed is None else max(0.0, -self.tables.speed.slopes.min())
        by_speed = float(np.max(self.mu_s)) * falls * p / m
        return math.hypot(math.sqrt(self.steepness(p) / m), by_speed / 2) + by_speed / 2


FRICTIONLESS = Law(0.0, 0.0)


def of(field: Any, which: Any) -> Any:
    """Return a field at some columns; a number is the same at all."""
    return field[which] if np.ndim(field) else field


def slipped(s_0: np.ndarray, mode: np.ndarray, u_x: np.ndarray) -> np.ndarray:
    """Return the path (m) that blocks have slipped since they last stuck, of their clocks s_0."""
    return s_0 + np.where(np.abs(mode) == 1, mode * u_x, 0.0)


def clock(slip: np.ndarray | float, mode: np.ndarray, u_x: np.ndarray) -> np.ndarray:
    """Return the clocks s_0 (m) of blocks that have slipped by `slip` (m) and are at u_x."""
    return slip - np.where(np.abs(mode) == 1, mode * u_x, 0.0)
