"""Ring-down of a slider at fixed contact states: amplitudes of its modes during one jump."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pyfric.engines.modes import Modes


class Ringing:
    """Amplitudes of modes over a time s, with rates that change along the path in finite geometry.

    Each amplitude is a sqrt(lambda(0)/lambda(s)) exp(int_0^s lambda), with lambda linear in s (the
    WKB approximation). `correct` replaces the rates and shapes of `modes`.

    Args:
        modes: the modes.
        a: amplitudes at s = 0, shape (n,).

    Attributes:
        rates: rates at s = 0, shape (n,), in 1/s.
        growth: mean rates of the amplitudes, shape (n,), in 1/s.
        off: errors of rates, shape (n,), in 1/s.
        gaps: gap functions of the modes at s = 0, shape (n_c, n), complex, in N.
        which, change: indices of modes that follow the tangent, and time derivatives of their
            rates, shape (m,), in 1/s^2.
    """

    def __init__(self, modes: Modes, a: np.ndarray) -> None:
        self.modes, self.a, self.gaps = modes, a, modes.gaps * a
        self.rates, self.growth = modes.rates.copy(), modes.growth.copy()
        self.off = modes.off.copy()
        self.which = np.zeros(0, dtype=int)
        self.change = np.zeros(0, dtype=complex)
        self._corrected = np.zeros(len(a), dtype=bool)

    def correct(self, which: np.ndarray) -> None:
        """Replace rates of some modes by corrected rates, unless they are already corrected.

        Args:
            which: indices of the modes, shape (m,).
        """
        new = which[~self._corrected[which]]
        for k, mode in zip(new.tolist(), self.modes.corrected(new), strict=True):
            _, self.rates[k], self.off[k] = mode
        self.growth[new] = self.modes.stepped(self.rates[new])
        self._corrected[new] = True

    def follow(self, begin: np.ndarray, end: np.ndarray, s: float, which: np.ndarray) -> None:
        """Let rates of some corrected modes follow the change of the tangent up to s (s).

        Args:
            begin, end: changes of bond stiffness at 0 and s, shape (3, n_bonds), in N/m.
            s: time, in s.
            which: indices of the modes, shape (m,).
        """
        self.rates[self.which] = [mode.rate for mode in self.modes.corrected(self.which)]
        self.growth = self.modes.stepped(self.rates)
        first, last = (self.modes.changes(stiffer, which) for stiffer in (begin, end))
        self.rates[which] += first
        self.which, self.change = which, (last - first) / s
        self.growth[which] = self.modes.stepped(self.rates[which] + 0.5 * s * self.change)

    def at(self, s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return amplitudes and rates (1/s) at s (s), shape (n,)."""
        rates, growth, which = self.rates.copy(), self.growth.copy(), self.which
        rates[which] += s * self.change
        growth[which] = self.modes.stepped(rates[which] - 0.5 * s * self.change)
        return self.a * np.sqrt(self.rates / rates) * np.exp(growth * s), rates

    def motion_at(self, s: float, which: np.ndarray) -> np.ndarray:
        """Return w (m), w' (m/s) and w'' (m/s^2), shape (3, n_q), of some modes at s (s).

        Args:
            s: time, in s.
            which: indices of the modes, shape (m,).
        """
        a, rates = self.at(s)
        parts = np.array([a, a * rates, a * rates**2])
        motion = (parts[:, which] @ self.modes.x[:, which].T).real @ self.modes.space.B.T
        known = which[self._corrected[which]]
        for part, mode in zip(parts[:, known].T, self.modes.corrected(known), strict=True):
            motion += np.outer(part.real, mode.shift.real) - np.outer(part.imag, mode.shift.imag)
        return motion

    def late(self, s: float, which: np.ndarray) -> np.ndarray:
        """Return errors of gap functions at s (s) due to errors of rates, shape (n_c, m), in N."""
        a = np.abs(np.exp(self.growth[which] * s))
        return np.abs(self.gaps[:, which]) * (a * self.off[which] * s)

    def distances(self) -> np.ndarray:
        """Return the distance of each rate from the nearest other rate, (n,), in 1/s."""
        apart = np.abs(self.rates[:, None] - self.rates)
        np.fill_diagonal(apart, np.inf)
        return apart.min(axis=1, initial=np.inf)

    def alive(self, s: float, enough: float) -> np.ndarray:
        """Return the indices of modes that have not decayed at s (s), shape (m,).

        All other modes together change no gap function by more than `enough` (N).
        """
        level = np.abs(self.gaps).max(axis=0, initial=0.0) * np.exp(self.growth.real * s)
        return np.flatnonzero(level * len(level) > enough)
