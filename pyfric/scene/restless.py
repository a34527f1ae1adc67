"""Laws under which no block rests: junctions, and rate-and-state friction.

Junctions are springs, and the positions of their anchors are state variables. Under rate-and-state
friction, blocks at rest creep at a minute speed. Each law names its state variables, its terms of
the energy budget, and why no block rests.

Source: J. Trømborg et al., Proc. Natl. Acad. Sci. 111, 8764 (2014), junctions;
`pyfric.laws.RateAndState` names the sources of rate-and-state friction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pyfric.scene.friction import CoulombLaw, Law, Term, memory_of
from pyfric.scene.laws import (
    EVOLUTIONS,
    FrictionLaw,
    Junctions,
    RateAndState,
    Table,
    Tables,
    Variable,
)
from pyfric.values import SceneError

LONGEST_REST, LARGEST_RATIO = 1e10, 550.0
"""Rest time (s) at which parameters are checked, and largest accepted friction coefficient over a.

The smallest speed is V* exp(-600) (fortran/evolution.f90).
"""


@dataclass(frozen=True, kw_only=True)
class JunctionLaw(Law):
    """Strength, stiffness and state variables of blocks on junctions.

    Attributes:
        kind: the parameters of the interface.
        C: the constant in k_j = sqrt(C p/n_s), in N/m^2; a number or an array of shape (N_x,).
        t_R, t_R_std: mean slip time of a junction and its standard deviation, in s; numbers or
            arrays of shape (N_x,).
    """

    kind: Junctions
    C: Any
    t_R: Any
    t_R_std: Any

    state: ClassVar[tuple[Variable, ...]] = (
        Variable("anchor", "m", "position of the anchor of each junction"),
        Variable("pinned", "1", "1 for a pinned junction, 0 for one that slips"),
        Variable("release", "s", "time at which each junction pins or pinned"),
        Variable("breaks", "1", "number of breaks of each junction"),
    )
    fields: ClassVar[tuple[str, ...]] = (*Law.fields, "C", "t_R", "t_R_std")
    motion: ClassVar[tuple[Variable, ...]] = (
        Variable("pinned", "1", "share of the junctions of a block that is pinned", "f4"),
    )
    margin: ClassVar[Variable] = Variable(
        "margin", "1", "number of junctions that may break before the block is ruptured"
    )
    terms: ClassVar[tuple[Term, ...]] = (
        Term(
            "elastic_junctions",
            "J",
            "elastic energy of the junctions of the interface",
            "elastic",
            "stored",
        ),
        Term("friction_heat", "J", "heat of junctions that are dragged along", "above", "lost"),
        Term("switching_loss", "J", "heat of breaks and of pinning of junctions", "loss", "lost"),
        Term(
            "stiffness_work",
            "J",
            "work of the stiffness of junctions, which follows p",
            "viscous",
            "given",
        ),
    )
    code: ClassVar[int] = 2
    restless: ClassVar[str] = (
        "junctions break and pin all the time under load: no jump over a rest gains anything"
    )

    @classmethod
    def of(cls, kind: Junctions, given: Callable[[str], Any], p: float, V: float) -> JunctionLaw:
        """Return the law of an interface of junctions.

        Args:
            kind: the parameters of the interface.
            given: function of the name of a field of the interface that returns its values.
            p: mean load of a block, in N.
            V: speed of the driver at t = 0, in m/s.

        Raises:
            SceneError: the interface has mu_s = 0 or a viscosity.
        """
        mu_s, mu_k, alpha = map(given, ("mu_s", "mu_k", "alpha"))
        for name, value, wrong, allowed in (
            ("alpha", alpha, np.any(alpha), "0 N s/m"),
            ("mu_s", mu_s, not np.all(mu_s), "> 0"),
        ):
            if wrong:
                reason = "an interface of junctions"
                raise SceneError(f"interface.{name}", float(np.max(value)), "", allowed, reason)
        t_R, t_R_std = given("t_R"), given("t_R_std")
        C = given("C") if kind.u_s is None else mu_s**2 * p / (kind.n_s * given("u_s") ** 2)
        more = {"kind": kind, "C": C, "t_R": t_R, "t_R_std": t_R_std}
        return cls(mu_s, mu_k, **more)

    def stiffness(self, p: Any) -> Any:
        """Return the stiffness of blocks with all junctions pinned, n_s k_j, in N/m."""
        return np.sqrt(self.kind.n_s * self.C * p)

    def u_s(self, p: Any) -> Any:
        """Return the stretch (m) at which junctions break under a load p (N) of the block."""
        return self.mu_s * np.sqrt(p / (self.kind.n_s * self.C))

    @property
    def junctions(self) -> int:
        """Number of junctions of each block."""
        return self.kind.n_s

    @property
    def at_step_end(self) -> bool:
        """Whether stretches, strengths or slip times differ between junctions.

        Then the junctions of a block break or pin one by one, with many switches in each step.
        """
        return bool(np.any(self.t_R_std) or self.kind.stretch or self.kind.u_s_spread)

    @property
    def slowest(self) -> float:
        """Longest mean slip time of junctions, in s."""
        return float(np.max(self.t_R))

    def in_motion(self, memory: np.ndarray) -> dict[str, np.ndarray]:
        """Return the share of pinned junctions of each block, (N_x,), by the name "pinned"."""
        return {"pinned": memory["pinned"].mean(axis=1)}

    @property
    def memory(self) -> np.dtype:
        return memory_of(self.state, (self.kind.n_s,))

    def begin(
        self, t: float, u_x: np.ndarray, p: np.ndarray, f: np.ndarray, d: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return margins and state variables of blocks whose junctions are pinned and carry f.

        The mean stretch of the junctions of a block follows from f. The stretches are spread evenly
        about this mean. If p = 0, all junctions of the block slip. See `Law.begin`.

        Raises:
            SceneError: a junction would break.
        """
        n, u_s = self.kind.n_s, self.u_s(p)
        closed = p > 0
        whole = np.where(closed, self.stiffness(p), 1.0)
        even = (2 * np.arange(1, n + 1) - n - 1) / n
        stretch = (-f / whole)[:, None] + d * self.kind.stretch * u_s[:, None] * even
        over = np.abs(stretch) - self.kind.factors * u_s[:, None]
        worst = int(np.argmax(np.where(closed, over.max(axis=1), -np.inf)))
        if closed.any() and over[worst].max() > 0:
            number = worst + 1 if d > 0 else len(p) - worst
            reached = float(np.abs(stretch[worst]).max() / u_s[worst])
            reason = f"junctions of block {number} from the trailing edge would break at the start"
            allowed = "stretches up to u_s: less stretch, a larger mu_s or u_s"
            raise SceneError("interface.law", reached, "u_s", allowed, reason)
        memory = np.zeros(len(p), self.memory)
        memory["anchor"] = np.where(closed[:, None], u_x[:, None] - stretch, u_x[:, None])
        memory["pinned"] = closed[:, None]
        memory["release"] = t
        return n * (closed - self.kind.ruptured), memory

    def core_fields(self, limits: Iterable[Any] = ()) -> tuple[Any, ...]:
        """Return fields for the core; see `Law.core_fields`. Junctions have no limits of mu."""
        return self.mu_s, self.mu_k, self.C, self.t_R, self.t_R_std

    @property
    def core_numbers(self) -> dict[str, float]:
        high, low = divmod(self.kind.seed, 2**32)
        seed = {"seed_low": low, "seed_high": high}
        return {"n": self.kind.n_s, **seed, "ruptured": self.kind.ruptured}

    @property
    def core_tables(self) -> Tables:
        mean = float(np.mean(self.t_R))
        cv = float(np.mean(self.t_R_std)) / mean if mean else 0.0
        strengths = None
        if self.kind.u_s_spread:
            numbers = tuple(range(1, self.kind.n_s + 1))
            strengths = Table(numbers, tuple(self.kind.factors.tolist()))
        return Tables(hold=self.kind.quantiles_of_t_R(cv), slide=strengths)


@dataclass(frozen=True, kw_only=True)
class RateStateLaw(Law):
    """Rate-and-state friction (`pyfric.laws.RateAndState`); mu_s and mu_k are f*.

    Attributes:
        kind: the parameters of the law.
        a, b: direct and evolution effect; numbers or arrays of shape (N_x,).
        D_c: slip over which the state evolves, in m; a number or an array of shape (N_x,).
        theta: state at t = 0, in s; a number or an array of shape (N_x,).
    """

    kind: RateAndState
    a: Any
    b: Any
    D_c: Any
    theta: Any

    state: ClassVar[tuple[Variable, ...]] = (
        Variable("theta", "s", "state variable of rate-and-state friction"),
    )
    fields: ClassVar[tuple[str, ...]] = (*Law.fields, "a", "b", "D_c", "theta")
    motion: ClassVar[tuple[Variable, ...]] = state
    margin: ClassVar[Variable] = Variable(
        "margin", "m/s", "speed that is missing before the block slips"
    )
    terms: ClassVar[tuple[Term, ...]] = tuple(
        term for term in CoulombLaw.terms if term.name != "weakening_heat"
    )
    code: ClassVar[int] = 3
    restless: ClassVar[str] = "with rate-and-state friction no block ever rests"
    flows: ClassVar[bool] = True
    at_step_end: ClassVar[bool] = True
    memory: ClassVar[np.dtype] = memory_of(state)

    @classmethod
    def of(
        cls, kind: RateAndState, given: Callable[[str], Any], p: float, V: float
    ) -> RateStateLaw:
        """Return the law of an interface; see `JunctionLaw.of`.

        Raises:
            SceneError: a coefficient of friction differs from f*; the state at t = 0 is undefined
                because the driver does not move; or a is so small that speeds vanish.
        """
        f, D_c = given("f_star"), given("D_c")
        for name in ("mu_s", "mu_k"):
            if np.any(given(name) != f):
                reason = "rate-and-state friction has f_star"
                allowed = "none, or f_star of the law"
                raise SceneError(
                    f"interface.{name}", float(np.max(given(name))), "", allowed, reason
                )
        if kind.theta_0 is not None:
            theta = given("theta_0")
        elif kind.v_0 is None and not V > 0:
            reason = "the driver does not move at t = 0"
            raise SceneError("interface.law.theta_0", None, "s", "theta_0, or v_0", reason)
        else:
            speed = V if kind.v_0 is None else given("v_0")
            theta = EVOLUTIONS[kind.evolution].steady * D_c / speed
        a, b = given("a"), given("b")
        if kind.c and not np.all(b):
            reason = "the law weighs the rate of stress with c/b"
            raise SceneError("interface.law.b", 0.0, "", "> 0", reason)
        rested = np.maximum(theta, LONGEST_REST)
        cut = kind.V_star / kind.V_c if kind.V_c else 0.0
        strength = f + b * np.log(kind.V_star * rested / D_c + cut)
        too_small = np.ravel(a * LARGEST_RATIO < strength)
        if too_small.any():
            i = int(np.argmax(too_small))
            least = float(np.resize(strength, too_small.size)[i]) / LARGEST_RATIO
            allowed = f">= {least:.3g}: (f* + b ln(V* theta/D_c))/{LARGEST_RATIO:g} there"
            reason = f"blocks at rest for {LONGEST_REST:g} s are slower than the least numbers"
            value = float(np.resize(a, too_small.size)[i])
            raise SceneError("interface.law.a", value, "", allowed, reason)
        more = {"kind": kind, "a": a, "b": b, "D_c": D_c, "theta": theta}
        return cls(f, f, alpha=given("alpha"), **more)

    def begin(
        self, t: float, u_x: np.ndarray, p: np.ndarray, f: np.ndarray, d: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return margins and state variables; see `Law.begin`."""
        memory = np.zeros(len(p), self.memory)
        memory["theta"] = self.theta
        return np.full(len(p), self.v_slip), memory

    @property
    def v_slip(self) -> float:
        return self.kind.v_slip

    @property
    def parted(self) -> bool:
        return bool(np.any(self.alpha))

    def core_fields(self, limits: Iterable[Any] = ()) -> tuple[Any, ...]:
        """Return fields for the core; see `Law.core_fields`. This law has no limits of mu."""
        return self.a, self.b, self.D_c, self.alpha, self.mu_k

    @property
    def core_numbers(self) -> dict[str, float]:
        kind = self.kind
        cut = 0.0 if kind.V_c is None else kind.V_star / kind.V_c
        law, speeds = EVOLUTIONS[kind.evolution].code, {"v_ref": kind.V_star, "cut": cut}
        return {"law": law, **speeds, "v_slip": self.v_slip, "c": self.c}

    @property
    def c(self) -> float:
        """Parameter c of the evolution with stress ("nagata"); 0 for other evolutions."""
        return self.kind.c or 0.0

    def weakening(self, v: np.ndarray, theta: np.ndarray) -> Any:
        """Return -d(ln theta)/d|u| in a wave at speeds v (m/s) and states theta (s), in 1/m."""
        x = np.abs(v) * theta / self.D_c
        return EVOLUTIONS[self.kind.evolution].weakening(x, self) / self.D_c

    def blocks_in_L_b(self, p: float, k: float) -> float:
        """Return L_b/l, L_b = E* D_c l B (1 + c)/(b p), with E* B = 4 k/3 of the lattice."""
        falls = 3 * np.maximum(self.b, np.finfo(float).tiny) * p
        return float(np.min(4 * k * self.D_c * (1 + self.c) / falls))

    def resolving_step(self, p: float, m: float) -> float:
        """Return the longest step (s) that resolves weakening; see `Law.resolving_step`.

        Slip of a free block grows at most with the rate sqrt(p (b - a)/(m D_c (1 + c))).
        """
        steepest = float(np.max((self.b - self.a) / self.D_c)) * p / (1 + self.c)
        return math.sqrt(m / steepest) if steepest > 0 else math.inf


WITHOUT_REST: dict[type[FrictionLaw], type[JunctionLaw | RateStateLaw]] = {
    Junctions: JunctionLaw,
    RateAndState: RateStateLaw,
}
"""Classes of interface parameters under which no block rests, and their classes of laws."""
LAWS: tuple[type[Law], ...] = (CoulombLaw, *WITHOUT_REST.values())
"""All classes of friction laws."""
