"""The friction law of a scene whose blocks can rest. No other Python module evaluates mu.

A block that has slipped by s since it last stuck, at speed v, resists with mu p + alpha v:

    stuck       |f| <= mu_s p                                            `Law.hold`
    slips       mu = mu_k + (mu_s - mu_k) slide(s/d_c), times factors
    open        no friction

Static states, the quasi-static sequence and the prediction curve do not resolve slip weakening: a
slipping block has mu_k, which is Amontons-Coulomb friction (`Law.slide`). The core evaluates the
whole law, in Fortran.

The slip path needs only one stored number, s_0. The path is s = s_0 + mode u_x while a block slips,
and s_0 otherwise.

`pyfric.scene.restless` has the laws under which blocks never stick.

Source: PRL 107, 074301 (2011), interface law, and its remark on slip weakening.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from pyfric.scene.laws import Tables, Variable


def memory_of(state: tuple[Variable, ...], shape: tuple[int, ...] = ()) -> np.dtype:
    """Return the type of the memory of a block with these state variables, each of this shape."""
    return np.dtype([(variable.name, float, shape) for variable in state])


CLOCKS = (
    Variable("s_0", "m", "slip since the last stick, minus mode u_x while the block slips"),
    Variable("t_0", "s", "time at which the block stuck or began to slip"),
)
NO_TABLES = Tables()
GRADUAL = 0.01
"""Largest (mu_s - mu_k)/mu_s for which quasi-static slip is continuous, with friction mu_s."""


@dataclass(frozen=True)
class Law:
    """Strength of the interface under a load p.

    Strength is linear in p, so that p may also be a stiffness. Each of the first four attributes is
    a number, or an array with one number for each column, shape (N_x,).

    Attributes:
        mu_s: static friction coefficient.
        mu_k: kinetic friction coefficient.
        d_c: slip over which friction weakens, in m; 0 means at once.
        alpha: viscosity of slip, in N s/m.
        tables: tables of the law; see `pyfric.laws`.
    """

    mu_s: Any
    mu_k: Any
    d_c: Any = 0.0
    alpha: Any = 0.0
    tables: Tables = NO_TABLES

    state: ClassVar[tuple[Variable, ...]] = CLOCKS
    """State variables of a block; all are numbers."""
    motion: ClassVar[tuple[Variable, ...]] = ()
    """What a run records of the state variables at points of the loading curve."""
    memory: ClassVar[np.dtype] = memory_of(CLOCKS)
    """Names and shapes of the state variables."""
    code: ClassVar[int] = 1
    """Number of the law in the core (pyfric_law)."""
    restless: ClassVar[str] = ""
    """Reason why no block rests; "" if blocks can rest."""
    flows: ClassVar[bool] = False
    """Whether friction depends on speed in such a way that steps have to be implicit."""
    junctions: ClassVar[int] = 0
    """Number of junctions of each block; 0 without junctions."""
    apart: ClassVar[bool] = False
    """Whether the junctions of a block break or pin one by one: many switches in each step."""
    slowest: ClassVar[float] = 0.0
    """Longest mean time scale of the law itself, in s; 0 if it has none."""

    @property
    def rests(self) -> bool:
        """Whether a block can stick, with constant u_x."""
        return not self.restless

    def hold(self, p: Any, age: Any = 0.0) -> Any:
        """Return the strength of blocks that have been stuck for `age` (s), in units of p."""
        gain = self.tables.hold
        return self.mu_s * p if gain is None else (self.mu_s + gain(age)) * p

    def slide(self, p: Any) -> Any:
        """Return the strength of slipping blocks after any weakening with slip, in units of p.

        Factors of speed and of time, and alpha, are left out.
        """
        return self.mu_k * p

    def at(self, which: Any) -> Law:
        """Return the law of some columns."""
        fields = {name: of(getattr(self, name), which) for name in ("mu_s", "mu_k", "d_c", "alpha")}
        return replace(self, **fields)

    def in_motion(self, memory: np.ndarray) -> dict[str, np.ndarray]:
        """Return the values of `motion`, each of shape (N_x,)."""
        return {variable.name: memory[variable.name].copy() for variable in self.motion}

    def begin(
        self, t: float, u_x: np.ndarray, p: np.ndarray, f: np.ndarray, d: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return margins (`State.margin`) and state variables of blocks at rest since t (s).

        Args:
            t: time, in s.
            u_x: displacements, shape (N_x,), in m.
            p: normal forces, shape (N_x,), in N.
            f: friction forces on the blocks, along +x, shape (N_x,), in N.
            d: direction of the drive.
        """
        memory = np.zeros(len(p), self.memory)
        memory["t_0"] = t
        return self.margin(p, f), memory

    @property
    def bare(self) -> Any:
        """Whether blocks have no friction, mu_s = alpha = 0, although others have some."""
        if not self.rests:
            return False
        none = np.equal(self.mu_s, 0) & np.equal(self.alpha, 0)
        return none & ~np.all(none)

    @property
    def core_fields(self) -> tuple[Any, ...]:
        """Fields for the core: numbers, or arrays with one number for each column."""
        return self.mu_s, self.mu_k, self.d_c, self.alpha, self.bare

    @property
    def core_tables(self) -> Tables:
        """Tables for the core."""
        return self.tables

    @property
    def core_numbers(self) -> dict[str, float]:
        """Numbers of the law for the core by name, in the order of `numbers_t` in the core."""
        return {}

    def budget(self, heat: Any = 0.0, loss: Any = 0.0, parts: Any = (0.0, 0.0)) -> dict[str, Any]:
        """Return the terms of the interface in the energy budget by name, from those of `State`.

        With Amontons-Coulomb friction the heat has no parts.
        """
        terms = {"friction_heat": heat, "switching_loss": loss}
        if self.tables == NO_TABLES and not np.any(self.alpha):
            return terms
        return terms | {"weakening_heat": parts[0], "viscous_heat": parts[1]}

    @property
    def drop(self) -> Any:
        """Loss of strength in a slip, over p."""
        return self.mu_s - self.mu_k

    @property
    def mean(self) -> Law:
        """The law with each field replaced by its mean."""
        means = {n: float(np.mean(getattr(self, n))) for n in ("mu_s", "mu_k", "d_c", "alpha")}
        return replace(self, **means)

    @property
    def weakens(self) -> bool:
        """Whether friction depends on slip."""
        return self.tables.slide is not None and bool(np.any(np.greater(self.drop, 0)))

    def blocks_in_L_b(self, p: float, k: float) -> float:
        """Return L_b/l, over which rate-and-state friction weakens; inf for other laws.

        Args:
            p: load of a block, in N.
            k: stiffness of a bond, in N/m.
        """
        return math.inf

    def fracture_energy(self, p: Any) -> Any:
        """Return the work against friction above mu_k p during a slip, in J.

        The work is (mu_s - mu_k) p d_c/2 for linear weakening. For any other table, the area of the
        table replaces 1/2.
        """
        left = self.tables.slide
        return self.drop * self.d_c * (0.0 if left is None else left.area) * p

    def margin(self, p: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Return the strength minus |f| of stuck blocks, in N."""
        return self.hold(p) - np.abs(f)

    def margins(self, p: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the margins against slip in +x and in -x, in N; f is the force of friction."""
        strength = self.hold(p)
        return strength + f, strength - f

    def scaled(self, ratio: Any) -> Any:
        """Return (tau/p - mu_k)/(mu_s - mu_k) for a ratio tau/p; NaN if mu_s = mu_k."""
        drop = np.where(np.equal(self.drop, 0), np.nan, self.drop)
        return (ratio - self.mu_k) / drop

    @property
    def gradual(self) -> bool:
        """Whether quasi-static slip is treated as continuous."""
        return bool(np.all(self.drop <= GRADUAL * np.asarray(self.mu_s)))

    def continuous(self) -> Law:
        """Return the law with mu_k = mu_s, for continuous slip."""
        return Law(self.mu_s, self.mu_s)

    def steepness(self, p: float) -> float:
        """Return the steepest weakening slope -df/ds under a load p (N), in N/m.

        The slope is inf if friction falls at once, unless friction depends on speed.
        """
        if self.tables.slide is None:
            at_once = self.tables.speed is None and np.any(np.greater(self.drop, 0))
            return math.inf if at_once else 0.0
        falls = -float(self.tables.slide.slopes.min())
        d_c = np.where(np.equal(self.d_c, 0), np.nan, self.d_c)
        return max(0.0, falls) * p * float(np.nanmax(self.drop / d_c))

    def resolving_step(self, p: float, m: float) -> float:
        """Return the longest step (s) that resolves weakening under a load p (N); inf without any.

        The step is 1 over the largest growth rate of slip of a free block of mass m (kg). Weakening
        with slip alone gives the rate sqrt(steepness/m), weakening with speed alone mu p
        |dfactor/dv|/m. Friction that falls at once, with d_c = 0, has no weakening to resolve.
        """
        if not self.weakens and self.tables.speed is None:
            return math.inf
        falls = 0.0 if self.tables.speed is None else max(0.0, -self.tables.speed.slopes.min())
        by_speed = float(np.max(self.mu_s)) * falls * p / m
        rate = math.hypot(math.sqrt(self.steepness(p) / m), by_speed / 2) + by_speed / 2
        return 1 / rate if rate > 0 else math.inf


FRICTIONLESS = Law(0.0, 0.0)


def of(field: Any, which: Any) -> Any:
    """Return a field at some columns; a number holds for all columns."""
    return field[which] if np.ndim(field) else field


def slipped(s_0: np.ndarray, mode: np.ndarray, u_x: np.ndarray) -> np.ndarray:
    """Return the slip path (m) of blocks since they last stuck, from s_0 (m)."""
    return s_0 + np.where(np.abs(mode) == 1, mode * u_x, 0.0)
