"""The steppers, one entry each.

A stepper is a table of coefficients. Let h be the step, M the mass, and F_j(u_j, v_j, t + c_j h)
the forces at stages j < i. Stage i is at

    u_i = u + c_i h v + h^2 sum_j abar_ij F_j/M ,   v_i = v + h sum_j a_ij F_j/M .

The step ends at u + h v + h^2 sum_i bbar_i F_i/M and v + h sum_i b_i F_i/M. An error estimate comes
from an embedded method, whose weights are b - e and bbar - ebar.

An implicit-explicit stepper has a second table s for the friction of blocks that never rest. s is a
lower triangle with a diagonal. A step ends at the last stage.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np


def _product(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return left @ right with sums in a fixed order, so that all processors give the same bits."""
    total = np.zeros((*left.shape[:-1], right.shape[-1]))
    for k in range(len(right)):
        total += left[..., k, None] * right[k]
    return total


@dataclass(frozen=True, eq=False)
class Stepper:
    """The coefficients of a stepper with n stages.

    Attributes:
        name: its name in options.
        order: power of the step with which the error at the end of a run without switches falls.
        c, b, a: coefficients, shapes (n,), (n,), (n, n).
        bbar, abar: coefficients b and a for displacements. None means b a and a a, as in a
            Runge-Kutta method.
        e: b minus b of the embedded method, shape (n,); None for steps of fixed length.
        s: implicit coefficients, shape (n, n), with zeros in the first column and one number on
            the rest of the diagonal; None for explicit steppers. The last rows of s and a end the
            step, so that the last stage needs no forces.
        swept: whether each stage depends only on the stage before. The core then makes a step in
            one sweep over the lattice. It has sweeps for four and for six stages.
        growth: R(z), the factor by which exp(lambda t) grows in a step, with z = lambda h. None for
            steppers that treat u and v differently.
    """

    name: str
    order: int
    c: np.ndarray
    b: np.ndarray
    a: np.ndarray
    bbar: np.ndarray | None = None
    abar: np.ndarray | None = None
    e: np.ndarray | None = None
    s: np.ndarray | None = None
    swept: bool = False
    growth: np.polynomial.Polynomial | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        nothing = np.zeros(len(self.b))
        object.__setattr__(self, "e", nothing if self.e is None else self.e)
        if self.bbar is None:  # u' = v
            object.__setattr__(self, "growth", self._growth())
            object.__setattr__(self, "bbar", _product(self.b, self.a))
            object.__setattr__(self, "abar", _product(self.a, self.a))

    def _growth(self) -> np.polynomial.Polynomial:
        """Return R(z) = 1 + sum_j z^(j+1) b A^j 1 of the explicit part."""
        powers = [np.ones((len(self.b), 1))]
        while len(powers) < len(self.b):
            powers.append(_product(self.a, powers[-1]))
        return np.polynomial.Polynomial([1.0, *(_product(self.b, power)[0] for power in powers)])

    @property
    def evaluations(self) -> int:
        """Number of force evaluations of each step or sub-step."""
        return len(self.b) - self.implicit

    @functools.cached_property
    def linear_order(self) -> int:
        """Order in linear motion: the largest power of z up to which R(z) and exp(z) agree."""
        terms = [] if self.growth is None else self.growth.coef
        right = [math.isclose(a * math.factorial(n), 1, rel_tol=1e-9) for n, a in enumerate(terms)]
        return len(list(itertools.takewhile(bool, right))) - 1 if right else self.order

    @property
    def implicit(self) -> bool:
        """Whether stages are implicit in the friction of blocks that never rest."""
        return self.s is not None

    @property
    def adaptive(self) -> bool:
        """Whether the stepper estimates its error and makes sub-steps."""
        return bool(self.e.any())

    @functools.cached_property
    def columns(self) -> np.ndarray:
        """Coefficients in the order of the core, as columns, shape (n, n_columns).

        Columns are c and b; if the stepper is not swept, bbar, e, ebar, a and abar; if it is
        implicit, s - a, a (s - a) and s.
        """
        columns = [self.c, self.b]
        if not self.swept:
            columns += [self.bbar, self.e, _product(self.e, self.a), self.a, self.abar]
        if self.s is not None:
            columns += [self.s - self.a, _product(self.a, self.s - self.a), self.s]
        return np.asfortranarray(np.column_stack(columns))

    def step(
        self,
        force: Callable[[np.ndarray, np.ndarray], np.ndarray],
        u: np.ndarray,
        p: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return u and p = h v (m) after one step.

        Args:
            force: h^2 M^-1 F (m) as a function of u and p.
            u, p: displacement and h times velocity before the step, in m.
        """
        found: list[np.ndarray] = []
        for c, abar, a in zip(self.c, self.abar, self.a, strict=True):
            at_u = u + c * p + sum(w * f for w, f in zip(abar, found, strict=False))
            at_p = p + sum(w * f for w, f in zip(a, found, strict=False))
            found.append(force(at_u, at_p))
        to_u = u + p + sum(w * f for w, f in zip(self.bbar, found, strict=True))
        return to_u, p + sum(w * f for w, f in zip(self.b, found, strict=True))


def _nested(name: str, c: str, b: str) -> Stepper:
    """Return a swept stepper of order 4, from texts of c and b."""
    of_c, of_b = (np.array(text.split(), dtype=float) for text in (c, b))
    return Stepper(name, order=4, c=of_c, b=of_b, a=np.diag(of_c[1:], -1), swept=True)


def _lower(*rows: list[float]) -> np.ndarray:
    """Return a strictly lower triangular matrix from its rows after the first."""
    a = np.zeros((len(rows) + 1,) * 2)
    for i, row in enumerate(rows, 1):
        a[i, : len(row)] = row
    return a


_RK4_ROWS = [0.5], [0.0, 0.5], [0.0, 0.0, 1.0]

STEPPERS: dict[str, Stepper] = {
    stepper.name: stepper
    for stepper in (
        Stepper(
            "rk4",
            order=4,
            c=np.array([0.0, 0.5, 0.5, 1.0]),
            b=np.array([1.0, 2.0, 2.0, 1.0]) / 6,
            a=_lower(*_RK4_ROWS),
            swept=True,
        ),
        # Six stages, each of which depends only on the stage before. The order in linear motion is
        # 6: R(z) = 1 + z + ... + z^6/720. This R(z) and eight conditions of order 4 leave a family
        # of one parameter. The member here has only positive b, c between 0 and 1, and nearly the
        # smallest errors in nonlinear motion. Undamped motion grows by |z|^8/5760 in a step.
        _nested(
            "rk46",
            c="0 .215698616936814233 .589123227484637551 .887069754615658149 .1643 "
            ".817963330929096716",
            b=".0327885706189006058 .282159545482237559 .296320423971946809 .194766711269656088 "
            ".102282590685891691 .0916821579713672473",
        ),
        # Six stages with the R(z) of J. Berland, C. Bogey, C. Bailly, Computers & Fluids 35, 1459
        # (2006): z^5 and z^6 have the factors 0.007856772044 and 0.000959998595. Undamped motion
        # does not grow up to |z| = 3.81.
        _nested(
            "rk46_waves",
            c="0 .465515130665907016 .123614612658358104 .44338770386844224 .9222 "
            ".532141752459933376",
            b=".137085190131006644 .024058266856017584 .0245763656183909007 .491341862869562718 "
            ".246267357324908651 .0766709572001135015",
        ),
        # u' = u + h (v + h F_1/2m), v' = v + h (F_1 + F_2)/2m. F_2 is evaluated at u' and, for
        # viscous forces, at the predicted velocity v + h F_1/m.
        Stepper(
            "verlet",
            order=2,
            c=np.array([0.0, 1.0]),
            b=np.array([0.5, 0.5]),
            a=_lower([1.0]),
            bbar=np.array([0.5, 0.0]),
            abar=_lower([0.5]),
        ),
        # v' = v + h F(u, v)/m, u' = u + h v'.
        Stepper(
            "symplectic_euler",
            order=1,
            c=np.zeros(1),
            b=np.ones(1),
            a=np.zeros((1, 1)),
            bbar=np.ones(1),
            abar=np.zeros((1, 1)),
        ),
        # Classical RK4 with one more stage, which gives a pair of orders 4 and 3
        # (J. A. Zonneveld, 1963; E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary
        # Differential Equations I, section II.4).
        Stepper(
            "adaptive",
            order=4,
            c=np.array([0.0, 0.5, 0.5, 1.0, 0.75]),
            b=np.array([1.0, 2.0, 2.0, 1.0, 0.0]) / 6,
            a=_lower(*_RK4_ROWS, [5 / 32, 7 / 32, 13 / 32, -1 / 32]),
            e=np.array([1.0, 2.0, 2.0, 1.0, 0.0]) / 6 - np.array([-3.0, 14, 14, 13, -32]) / 6,
        ),
        # Both parts have order 3, with four force evaluations. The implicit part damps the fastest
        # motion entirely (U. M. Ascher, S. J. Ruuth, R. J. Spiteri, Appl. Numer. Math. 25, 151
        # (1997), section 2.8). The explicit part is stable on the imaginary axis up to 1.57.
        Stepper(
            "imex",
            order=3,
            c=np.array([0.0, 1 / 2, 2 / 3, 1 / 2, 1.0]),
            b=np.array([1 / 4, 7 / 4, 3 / 4, -7 / 4, 0.0]),
            a=_lower(
                [1 / 2], [11 / 18, 1 / 18], [5 / 6, -5 / 6, 1 / 2], [1 / 4, 7 / 4, 3 / 4, -7 / 4]
            ),
            s=np.array(
                [
                    [0.0, 0.0, 0.0, 0.0, 0.0],
                    [0.0, 1 / 2, 0.0, 0.0, 0.0],
                    [0.0, 1 / 6, 1 / 2, 0.0, 0.0],
                    [0.0, -1 / 2, 1 / 2, 1 / 2, 0.0],
                    [0.0, 3 / 2, -3 / 2, 1 / 2, 1 / 2],
                ]
            ),
        ),
    )
}
"""Steppers by name."""
