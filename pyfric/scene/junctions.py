"""The friction law of an interface of junctions: parameters and initial state.

A block on junctions never sticks: junctions are springs, and the positions of their anchors are
state variables. `begin` returns the initial positions. The core computes the motion.

Source: J. Trømborg et al., Proc. Natl. Acad. Sci. 111, 8764 (2014).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from pyfric.scene.errors import SceneError
from pyfric.scene.friction import Law
from pyfric.scene.laws import Tables
from pyfric.scene.laws.junctions import Junctions

if TYPE_CHECKING:
    from pyfric.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class JunctionLaw(Law):
    """Strength, stiffness and state variables of blocks on junctions.

    Attributes:
        kind: the parameters of the interface.
        C: the constant in k_j = sqrt(C p/n_s), in N/m^2; a number, or one for each column.
        t_R, t_R_std: mean slip time of a junction and its standard deviation, in s; numbers, or one
            for each column.
        numbers: block numbers from the trailing edge, from 1 on, shape (N_x,).
    """

    kind: Junctions
    C: Any
    t_R: Any
    t_R_std: Any
    numbers: Any

    rests: ClassVar[bool] = False

    @classmethod
    def of(cls, scene: Scene) -> JunctionLaw:
        """Return the law of a scene with an interface of junctions.

        Raises:
            SceneError: the interface has mu_s = 0 or a viscosity.
        """
        kind = scene.interface.law
        mu_s, mu_k, alpha = map(scene.given_field, ("mu_s", "mu_k", "alpha"))
        for name, value, wrong, allowed in (
            ("alpha", alpha, np.any(alpha), "0 N s/m"),
            ("mu_s", mu_s, not np.all(mu_s), "> 0"),
        ):
            if wrong:
                reason = "an interface of junctions"
                raise SceneError(f"interface.{name}", float(np.max(value)), "", allowed, reason)
        t_R, t_R_std = scene.given_field("t_R"), scene.given_field("t_R_std")
        if kind.u_s is None:
            C = scene.given_field("C")
        else:
            C = mu_s**2 * (scene.F_N / scene.N_x) / (kind.n_s * scene.given_field("u_s") ** 2)
        more = {"kind": kind, "C": C, "t_R": t_R, "t_R_std": t_R_std, "numbers": scene.n_of_i}
        return cls(mu_s, mu_k, **more)

    def stiffness(self, p: Any) -> Any:
        """Return the stiffness of blocks with all junctions pinned, n_s k_j, in N/m."""
        return np.sqrt(self.kind.n_s * self.C * p)

    def u_s(self, p: Any) -> Any:
        """Return the stretch at which junctions break under a load p (N), in m."""
        return self.mu_s * np.sqrt(p / (self.kind.n_s * self.C))

    @property
    def junctions(self) -> int:
        """Number of junctions of each block."""
        return self.kind.n_s

    @property
    def slowest(self) -> float:
        """Longest mean slip time of junctions, in s."""
        return float(np.max(self.t_R))

    def in_motion(self, memory: np.ndarray) -> dict[str, np.ndarray]:
        """Return the share of pinned junctions."""
        return {"pinned": memory["pinned"].mean(axis=1)}

    @property
    def memory(self) -> np.dtype:
        each = (self.kind.n_s,)
        return np.dtype([(name, float, each) for name in ("anchor", "pinned", "release", "breaks")])

    def begin(
        self, t: float, u_x: np.ndarray, p: np.ndarray, f: np.ndarray, d: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return margins and state variables of blocks whose junctions are pinned and carry f.

        The mean stretch of the junctions of a block follows from f. Their stretches are spread
        evenly about this mean.

        Args:
            t: time, in s.
            u_x: displacements, shape (N_x,), in m.
            p: normal forces, shape (N_x,), in N; if p = 0, all junctions of the block slip.
            f: friction forces on the blocks, along +x, shape (N_x,), in N.
            d: direction of the drive.

        Raises:
            SceneError: a junction would break.
        """
        n, u_s = self.kind.n_s, self.u_s(p)
        closed = p > 0
        whole = np.where(closed, self.stiffness(p), 1.0)
        even = (2 * np.arange(1, n + 1) - n - 1) / n
        stretch = (-f / whole)[:, None] + d * self.kind.stretch * u_s[:, None] * even
        over = np.abs(stretch) - u_s[:, None]
        worst = int(np.argmax(np.where(closed, over.max(axis=1), -np.inf)))
        if closed.any() and over[worst].max() > 0:
            reached = float(np.abs(stretch[worst]).max() / u_s[worst])
            reason = (
                f"junctions of block {self.numbers[worst]} from the trailing edge would break "
                "at the start"
            )
            allowed = "stretches up to u_s: less stretch, a larger mu_s or u_s"
            raise SceneError("interface.law", reached, "u_s", allowed, reason)
        memory = np.zeros(len(p), self.memory)
        memory["anchor"] = np.where(closed[:, None], u_x[:, None] - stretch, u_x[:, None])
        memory["pinned"] = closed[:, None]
        memory["release"] = t
        return n * (closed - self.kind.ruptured), memory

    @property
    def core_fields(self) -> tuple[Any, ...]:
        return self.mu_s, self.mu_k, self.C, self.t_R, self.t_R_std

    @property
    def core_tables(self) -> Tables:
        mean = float(np.mean(self.t_R))
        cv = float(np.mean(self.t_R_std)) / mean if mean else 0.0
        return Tables(hold=self.kind.quantiles_of_t_R(cv))

    def budget(self, heat: Any = 0.0, loss: Any = 0.0, parts: Any = (0.0, 0.0)) -> dict[str, Any]:
        """Return heat of dragging, heat of breaks and pinning, and work of stiffness changes."""
        return {"friction_heat": parts[0], "switching_loss": loss, "stiffness_work": parts[1]}
