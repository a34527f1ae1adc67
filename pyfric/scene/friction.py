"""The friction law: all of Python that knows mu.

A block that has slipped by s since it last stuck resists with mu(s) p:

    stuck       |f| <= mu_s p                                           `Law.hold`
    slips       mu(s) p,  mu(s) = mu_s - (mu_s - mu_k) min(s/d_c, 1)    `Law.slide`
    open        nothing

Static states, the ladder and the prediction have no path: for them a slipping block has slipped all
of d_c, which is Amontons-Coulomb friction. The core evaluates the same law in Fortran.

Slip is a clock that costs nothing to keep: s = s_0 + mode u_x while a block slips, s_0 otherwise.

Source: PRL 107, 074301 (2011), interface law, and its remark on slip weakening.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["FRICTIONLESS", "Law", "clock", "slipped"]

GRADUAL = 0.01
"""With mu_s - mu_k up to this many mu_s, slip is continuous, at mu_s."""


@dataclass(frozen=True)
class Law:
    """Strength of the interface under a load p; strengths are linear in p, so p may be a stiffness.

    Attributes:
        mu_s: static friction coefficient.
        mu_k: kinetic friction coefficient.
        d_c: slip over which friction weakens, m; 0 for none.
    """

    mu_s: float
    mu_k: float
    d_c: float = 0.0

    def hold(self, p: Any) -> Any:
        """Return the strength of stuck blocks, in units of p."""
        return self.mu_s * p

    def slide(self, p: Any, slip: Any = math.inf) -> Any:
        """Return the strength of blocks that have slipped by `slip` (m), in units of p."""
        if self.d_c == 0 or (np.ndim(slip) == 0 and slip >= self.d_c):
            return self.mu_k * p
        return (self.mu_s - self.drop * np.minimum(np.divide(slip, self.d_c), 1.0)) * p

    @property
    def drop(self) -> float:
        """Loss of strength in a slip, over p."""
        return self.mu_s - self.mu_k

    def fracture_energy(self, p: Any) -> Any:
        """Return the work against friction beyond mu_k p in a slip, J: (mu_s - mu_k) p d_c/2."""
        return self.drop * self.d_c / 2 * p

    def margin(self, p: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Return what is left of the strength of stuck blocks that carry f, in N."""
        return self.hold(p) - np.abs(f)

    def margins(self, p: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the margins against slip in +x and in -x: it is f that resists, in N."""
        strength = self.hold(p)
        return strength + f, strength - f

    def scaled(self, ratio: Any) -> Any:
        """Return (ratio - mu_k)/(mu_s - mu_k) of a tau/p: 0 at mu_k, 1 at mu_s; NaN if equal."""
        return (ratio - self.mu_k) / self.drop if self.drop else ratio * np.nan

    @property
    def gradual(self) -> bool:
        """Whether slip is taken as continuous."""
        return self.drop <= GRADUAL * self.mu_s

    def continuous(self) -> Law:
        """Return the law whose slip is continuous, at mu_s."""
        return Law(self.mu_s, self.mu_s)

    def growth(self, p: float, m: float) -> float:
        """Return the rate at which weakening lets a free block of mass m (kg) run away, in 1/s."""
        return math.sqrt(self.drop * p / (m * self.d_c)) if self.d_c else math.inf


FRICTIONLESS = Law(0.0, 0.0)


def slipped(s_0: np.ndarray, mode: np.ndarray, u_x: np.ndarray) -> np.ndarray:
    """Return the path (m) that blocks have slipped since they last stuck, of their clocks s_0."""
    return s_0 + np.where(np.abs(mode) == 1, mode * u_x, 0.0)


def clock(slip: np.ndarray | float, mode: np.ndarray, u_x: np.ndarray) -> np.ndarray:
    """Return the clocks s_0 (m) of blocks that have slipped by `slip` (m) and are at u_x."""
    return slip - np.where(np.abs(mode) == 1, mode * u_x, 0.0)
