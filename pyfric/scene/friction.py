"""Base class of friction laws, and the friction law of scenes whose blocks can rest.

No other Python module evaluates mu. Under `CoulombLaw` a block that has slipped by s since it last
stuck, at speed v, resists with mu p + alpha v:

    stuck       |f| <= mu_s p                                            `CoulombLaw.hold`
    slips       mu = mu_k + (mu_s - mu_k) slide(s/d_c), times factors
    open        no friction

Static states, the quasi-static sequence and the prediction curve do not resolve slip weakening: a
slipping block has mu_k, which is Amontons-Coulomb friction (`CoulombLaw.slide`). The core evaluates
the whole law, in Fortran.

The slip path needs only one stored number, s_0. The path is s = s_0 + mode u_x while a block slips,
and s_0 otherwise.

`pyfric.scene.restless` has the laws under which blocks never stick.

Source: PRL 107, 074301 (2011), interface law, and its remark on slip weakening.
"""

from __future__ import annotations

import abc
import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np

from pyfric.scene.laws import Tables, Variable

NO_TABLES = Tables()


def memory_of(state: tuple[Variable, ...], shape: tuple[int, ...] = ()) -> np.dtype:
    """Return the data type of a block's state variables, each an array of the given shape."""
    return np.dtype([(variable.name, float, shape) for variable in state])


GRADUAL = 0.01
"""Largest (mu_s - mu_k)/mu_s for which quasi-static slip is continuous, with friction mu_s."""


class Sums(NamedTuple):
    """Energies of the interface that the core sums over all blocks, in J, named as in the core.

    Attributes:
        elastic: energy that junctions store.
        heat, loss: sums of `State.heat` and `State.loss` over all blocks.
        above, viscous: sums of the two rows of `State.parts` over all blocks.
    """

    elastic: Any = 0.0
    heat: Any = 0.0
    loss: Any = 0.0
    above: Any = 0.0
    viscous: Any = 0.0


class Term(NamedTuple):
    """A term of the interface in the energy budget.

    Attributes:
        name, unit, meaning, dtype: as in a `Variable`.
        sum: name of the entry of `Sums` that holds the term.
        counts: how the term enters the total: "stored", "given" or "lost". A "part" is counted with
            the heat of friction.
    """

    name: str
    unit: str
    meaning: str
    sum: str
    counts: Literal["stored", "given", "lost", "part"]
    dtype: str = "f8"


NO_SUMS = Sums()


@dataclass(frozen=True)
class Law(abc.ABC):
    """Base class of friction laws. Each field is a number, or an array of shape (N_x,).

    Attributes:
        mu_s: static friction coefficient.
        mu_k: kinetic friction coefficient.
        alpha: viscosity of slip, in N s/m.
    """

    mu_s: Any
    mu_k: Any
    alpha: Any = field(default=0.0, kw_only=True)

    fields: ClassVar[tuple[str, ...]] = ("mu_s", "mu_k", "alpha")
    """Names of the parameters with one number for each column."""
    state: ClassVar[tuple[Variable, ...]]
    """State variables of a block, each of which is a number."""
    motion: ClassVar[tuple[Variable, ...]] = ()
    """State variables that a run records at points of the loading curve."""
    margin: ClassVar[Variable]
    """Quantity by which a block is below the threshold of slip, `State.margin`."""
    terms: ClassVar[tuple[Term, ...]]
    """Terms of the interface in the energy budget."""
    memory: ClassVar[np.dtype]
    """Names and shapes of the state variables."""
    code: ClassVar[int]
    """Number of the law in the core (pyfric_law)."""
    restless: ClassVar[str] = ""
    """Reason why no block rests; "" if blocks can rest."""
    flows: ClassVar[bool] = False
    """Whether friction depends on speed so strongly that time steps have to be implicit."""
    junctions: ClassVar[int] = 0
    """Number of junctions of each block; 0 without junctions."""
    at_step_end: ClassVar[bool] = False
    """Whether blocks change contact state at the ends of steps by default."""
    slowest: ClassVar[float] = 0.0
    """Longest mean time scale of the law, in s; 0 if the law has no time scale."""
    v_slip: ClassVar[float | None] = None
    """Speed above which a block counts as slipping, in m/s; None if its contact state decides."""
    weakens: ClassVar[bool] = False
    """Whether friction depends on slip."""
    slides: ClassVar[bool] = False
    """Whether friction depends on slip alone, apart from a viscous part."""
    creeps: ClassVar[bool] = False
    """Whether friction depends on slip alone and falls, so that blocks can slip stably."""
    bears_mu_s: ClassVar[bool] = False
    """Whether the strength of a stuck block is mu_s p at any time."""
    parted: ClassVar[bool] = False
    """Whether the heat of friction is recorded in parts."""
    bare: ClassVar[Any] = False
    """Blocks without friction, mu_s = alpha = 0, if other blocks have friction: bool, or (N_x,)."""

    @property
    def rests(self) -> bool:
        """Whether a block can stick, with constant u_x."""
        return not self.restless

    @property
    def static(self) -> CoulombLaw:
        """The law that static states obey: Amontons-Coulomb friction."""
        return CoulombLaw(self.mu_s, self.mu_k, alpha=self.alpha)

    def at(self, which: Any) -> Self:
        """Return the law with its fields at some columns."""
        return replace(self, **{name: of(getattr(self, name), which) for name in self.fields})

    @property
    def mean(self) -> Self:
        """The law with each field replaced by its mean."""
        return replace(self, **{n: float(np.mean(getattr(self, n))) for n in self.fields})

    def in_motion(self, memory: np.ndarray) -> dict[str, np.ndarray]:
        """Return the values of `motion`, each of shape (N_x,)."""
        return {variable.name: memory[variable.name].copy() for variable in self.motion}

    @abc.abstractmethod
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

    @abc.abstractmethod
    def core_fields(self, limits: Iterable[Any] = ()) -> tuple[Any, ...]:
        """Return fields for the core: numbers, or arrays with one number for each column.

        Args:
            limits: largest values of mu, and their rates (1/s), for laws with such limits.
        """

    @property
    def core_tables(self) -> Tables:
        """Tables for the core."""
        return NO_TABLES

    @property
    def core_numbers(self) -> dict[str, float]:
        """Numbers of the law for the core by name, in the order of `numbers_t` in the core."""
        return {}

    def budget(self, sums: Sums = NO_SUMS) -> dict[str, Any]:
        """Return the terms of the interface in the energy budget by name, in J.

        Parts of the heat are left out if the heat of friction has no parts.
        """
        kept = (term for term in self.terms if term.counts != "part" or self.parted)
        return {term.name: getattr(sums, term.sum) for term in kept}

    def stiffness(self, p: Any) -> Any:
        """Return the stiffness of the interface along x under blocks that rest, in N/m."""
        return 0.0 * p

    def blocks_in_L_b(self, p: float, k: float) -> float:
        """Return L_b/l, over which rate-and-state friction weakens; inf for other laws.

        Args:
            p: load of a block, in N.
            k: stiffness of a bond, in N/m.
        """
        return math.inf

    def fracture_energy(self, p: Any) -> Any:
        """Return the work against friction above mu_k p during a slip, in J.

        The work is NaN under laws in which friction does not fall to mu_k.
        """
        return np.full(np.shape(p), math.nan)

    def resolving_step(self, p: float, m: float) -> float:
        """Return the longest step (s) that resolves weakening under a load p (N); inf if none.

        The step is 1 over the largest growth rate of slip of a free block of mass m (kg).
        """
        return math.inf


@dataclass(frozen=True)
class CoulombLaw(Law):
    """Strength of the interface under a load p.

    Strength is linear in p, so that p may also be a stiffness. mu_s, mu_k, d_c and alpha are
    numbers, or arrays with one number for each column, shape (N_x,).

    Attributes:
        d_c: slip over which friction weakens, in m; 0 means at once.
        tables: tables of the law; see `pyfric.laws`.
    """

    d_c: Any = 0.0
    tables: Tables = NO_TABLES

    fields: ClassVar[tuple[str, ...]] = ("mu_s", "mu_k", "d_c", "alpha")
    state: ClassVar[tuple[Variable, ...]] = (
        Variable("s_0", "m", "slip since the last stick, minus mode u_x while the block slips"),
        Variable("t_0", "s", "time at which the block stuck or began to slip"),
    )
    margin: ClassVar[Variable] = Variable(
        "margin", "N", "mu_s p - |force other than friction| at the last step"
    )
    terms: ClassVar[tuple[Term, ...]] = (
        Term("friction_heat", "J", "heat of friction", "heat", "lost"),
        Term(
            "switching_loss",
            "J",
            "kinetic energy removed where a switch stops a block",
            "loss",
            "lost",
        ),
        Term("weakening_heat", "J", "heat of friction above mu_k p", "above", "part"),
        Term("viscous_heat", "J", "heat of the viscosity of slip", "viscous", "part"),
    )
    memory: ClassVar[np.dtype] = memory_of(state)
    code: ClassVar[int] = 1

    @property
    def static(self) -> CoulombLaw:
        """The law itself."""
        return self

    def hold(self, p: Any, age: Any = 0.0) -> Any:
        """Return the strength of blocks that have been stuck for `age` (s), in units of p."""
        gain = self.tables.hold
        return self.mu_s * p if gain is None else (self.mu_s + gain(age)) * p

    def slide(self, p: Any) -> Any:
        """Return the strength of slipping blocks after any weakening with slip, in units of p.

        Factors that depend on speed or time, and alpha, are left out.
        """
        return self.mu_k * p

    def begin(
        self, t: float, u_x: np.ndarray, p: np.ndarray, f: np.ndarray, d: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return margins and state variables; see `Law.begin`."""
        memory = np.zeros(len(p), self.memory)
        memory["t_0"] = t
        return self.remaining(p, f), memory

    @property
    def bare(self) -> Any:
        none = np.equal(self.mu_s, 0) & np.equal(self.alpha, 0)
        return none & ~np.all(none)

    def core_fields(self, limits: Iterable[Any] = ()) -> tuple[Any, ...]:
        """Return fields for the core; see `Law.core_fields`."""
        return self.mu_s, self.mu_k, self.d_c, self.alpha, self.bare, *limits

    @property
    def core_tables(self) -> Tables:
        return self.tables

    @property
    def parted(self) -> bool:
        return self.tables != NO_TABLES or bool(np.any(self.alpha))

    @property
    def drop(self) -> Any:
        """Loss of strength during slip, over p."""
        return self.mu_s - self.mu_k

    @property
    def weakens(self) -> bool:
        return self.tables.slide is not None and bool(np.any(np.greater(self.drop, 0)))

    @property
    def slides(self) -> bool:
        return self.tables.speed is None and self.tables.age is None

    @property
    def creeps(self) -> bool:
        plain = self.slides and self.bears_mu_s
        return plain and self.weakens and not np.any(self.alpha)

    @property
    def bears_mu_s(self) -> bool:
        return self.tables.hold is None

    def fracture_energy(self, p: Any) -> Any:
        """Return the work against friction above mu_k p during a slip, in J.

        The work is (mu_s - mu_k) p d_c/2 for linear weakening. For any other table, the area of the
        table replaces 1/2.
        """
        left = self.tables.slide
        return self.drop * self.d_c * (0.0 if left is None else left.area) * p

    def remaining(self, p: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Return the strength minus |f| of stuck blocks, in N."""
        return self.hold(p) - np.abs(f)

    def margins(self, p: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the margins against slip in +x and in -x, in N; f is the friction force."""
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

    def continuous(self) -> CoulombLaw:
        """Return the law with mu_k = mu_s, for continuous slip."""
        return CoulombLaw(self.mu_s, self.mu_s)

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
        """Return the longest step (s) that resolves weakening; see `Law.resolving_step`.

        Weakening with slip alone gives the rate sqrt(steepness/m), weakening with speed alone mu p
        |dfactor/dv|/m. Friction that falls at once, with d_c = 0, has no weakening to resolve.
        """
        if not self.weakens and self.tables.speed is None:
            return math.inf
        falls = 0.0 if self.tables.speed is None else max(0.0, -self.tables.speed.slopes.min())
        by_speed = float(np.max(self.mu_s)) * falls * p / m
        rate = math.hypot(math.sqrt(self.steepness(p) / m), by_speed / 2) + by_speed / 2
        return 1 / rate if rate > 0 else math.inf


FRICTIONLESS = CoulombLaw(0.0, 0.0)


def of(field: Any, which: Any) -> Any:
    """Return a field at some columns; a number holds for all columns."""
    return field[which] if np.ndim(field) else field


def slipped(s_0: np.ndarray, mode: np.ndarray, u_x: np.ndarray) -> np.ndarray:
    """Return the slip path (m) of blocks since they last stuck, from s_0 (m)."""
    return s_0 + np.where(np.abs(mode) == 1, mode * u_x, 0.0)
