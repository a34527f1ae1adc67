"""Wave speeds of the lattice and of its continuum limit.

The lattice has springs k along its sides and k/2 along its diagonals. Waves along x:

    m omega^2 = 6 k sin^2(q l/2)   longitudinal,      m omega^2 = 2 k sin^2(q l/2)   shear,

so that at long wavelengths c_P = l sqrt(1.5 k/m) and c_S = l sqrt(0.5 k/m). In two dimensions the
lattice is a material with lambda = mu. Its Poisson's ratio is 1/3 in plane stress and 1/4 in plane
strain.

Source: PRL 107, 074301 (2011), model section; L. B. Freund, Dynamic Fracture Mechanics (1990).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Literal, NamedTuple, Self, get_args

import numpy as np
from numpy.typing import ArrayLike

from pyfric.theory.inputs import checked, checked_array, choice, refusal

Polarisation = Literal["longitudinal", "shear", "chain"]

STIFFEST = 1e3
"""Largest c_P/c_S accepted; a nearly incompressible material."""
SOFTEST = 1.001
"""Smallest c_P/c_S accepted; at 1 the plane bulk modulus vanishes."""

# omega = 2 sqrt(a k/m) |sin(q l/2)|
_STIFFNESS = {"longitudinal": 1.5, "shear": 0.5, "chain": 1.0}


class Waves(NamedTuple):
    """Plane waves along x.

    Attributes:
        omega: frequency, rad/s.
        phase: phase speed omega/q, m/s.
        group: group speed d omega/d q, m/s.
    """

    omega: np.ndarray
    phase: np.ndarray
    group: np.ndarray


def lattice_waves(
    k: float, m: float, l: float, q: ArrayLike = 0.0, polarisation: Polarisation = "longitudinal"
) -> Waves:
    """Return frequency and speeds of waves along x in the infinite lattice or chain.

    Bond viscosity and foundation are left out.

    Args:
        k: stiffness of the nearest-neighbour springs, N/m.
        m: mass of a block, kg.
        l: lattice constant, m.
        q: wave number, rad/m, any shape, 0 to pi/l; 0 is the limit of long waves.
        polarisation: "longitudinal", "shear" (along z), or "chain" (longitudinal, one row).

    Returns:
        `Waves`, each of the shape of q.

    Source: PRL 107, 074301 (2011): omega = 2 sqrt(a k/m) sin(q l/2), a = 3/2, 1/2, 1.
    """
    k, m, l = checked("k", k, "N/m", gt=0), checked("m", m, "kg", gt=0), checked("l", l, "m", gt=0)
    a = _STIFFNESS[choice("polarisation", polarisation, get_args(Polarisation))]
    q = checked_array("q", q, "rad/m", ge=0, le=np.pi / l * (1 + 1e-12))
    c, half = l * np.sqrt(a * k / m), q * l / 2
    omega = 2 * c / l * np.sin(half)
    return Waves(omega[()], c * np.sinc(half / np.pi)[()], c * np.cos(half)[()])


def density_factor(N_x: int, N_z: int) -> float:
    """Return the density correction factor N_x N_z/((N_x - 1)(N_z - 1)).

    A slider of mass M and size L H has N_x N_z blocks of mass m = M/(N_x N_z), but only
    (N_x - 1)(N_z - 1) cells of area l^2. The density of the lattice is m/(l^2 B). The density of
    the slider, M/(L H B), is larger by the density correction factor. Waves in a continuum of the
    slider's density are slower by the root of this factor (1677 instead of 1720 m/s in setup 1 of
    the paper).

    Args:
        N_x, N_z: numbers of blocks, whole and at least 2.
    """
    for name, N in (("N_x", N_x), ("N_z", N_z)):
        if checked(name, N, ge=2) % 1:
            raise refusal(name, N, "", "an integer >= 2")
    return N_x * N_z / ((N_x - 1) * (N_z - 1))


def reduced_D(xi2: ArrayLike, r: ArrayLike) -> np.ndarray:
    """Return D c_S^2/v^2, D = 4 alpha_d alpha_s - (1 + alpha_s^2)^2, without cancellation.

    Args:
        xi2: (v/c_S)^2, 0 to 1.
        r: (c_S/c_P)^2.

    Returns:
        The quotient: 2 (1 - r) at v = 0, 0 at c_R, negative between c_R and c_S.
    """
    product = np.sqrt(1 - r * xi2) * np.sqrt(1 - xi2)
    return 4 - xi2 - 4 * (1 + r - r * xi2) / (1 + product)


def rayleigh_speed(c_P: float, c_S: float) -> float:
    """Return the Rayleigh speed, the root of D(v) = 4 alpha_d alpha_s - (1 + alpha_s^2)^2, in m/s.

    Args:
        c_P, c_S: longitudinal and shear speed of plane waves, m/s; see `Material`.

    Raises:
        ValueError: a value is not positive, or c_P/c_S is outside `SOFTEST` ... `STIFFEST`.

    Source: Freund (1990), chapter 2; the root at v = 0 is divided out.

    >>> round(float(pyfric.theory.rayleigh_speed(c_P=3**0.5, c_S=1.0)), 6)
    0.919402
    """
    return Material(c_P=c_P, c_S=c_S, rho=1.0).c_R


@dataclass(frozen=True, kw_only=True)
class Material:
    """An isotropic elastic material in two dimensions.

    Only the speeds matter in the plane: plane stress with nu and plane strain with nu/(1 + nu) are
    the same problem.

    Args:
        c_P: longitudinal speed of plane waves in the plane, m/s; of a thin plate (plane stress) or
            of the bulk (plane strain).
        c_S: shear speed, m/s.
        rho: density, kg/m^3.

    Raises:
        ValueError: a value is not positive, or c_P/c_S is outside `SOFTEST` ... `STIFFEST`.
    """

    c_P: float
    c_S: float
    rho: float

    def __post_init__(self) -> None:
        c_S = checked("c_S", self.c_S, "m/s", gt=0)
        c_P = checked("c_P", self.c_P, "m/s", ge=SOFTEST * c_S, le=STIFFEST * c_S)
        rho = checked("rho", self.rho, "kg/m^3", gt=0)
        for name, value in (("c_P", c_P), ("c_S", c_S), ("rho", rho)):
            object.__setattr__(self, name, value)

    @classmethod
    def of_lattice(cls, k: float, m: float, l: float, B: float) -> Self:
        """Return the material of the lattice at long wavelengths.

        c_P = l sqrt(1.5 k/m), c_S = l sqrt(0.5 k/m), rho = m/(l^2 B), so that E_prime = 4 k/(3 B).
        For a continuum of the slider's mass take m times `density_factor`.

        Args:
            k: stiffness of the nearest-neighbour springs, N/m.
            m: mass of a block, kg.
            l: lattice constant, m.
            B: thickness, m.
        """
        c_P = lattice_waves(k, m, l).phase
        c_S = lattice_waves(k, m, l, polarisation="shear").phase
        return cls(c_P=c_P, c_S=c_S, rho=m / (l**2 * checked("B", B, "m", gt=0)))

    @classmethod
    def plane_stress(cls, E: float, nu: float, rho: float) -> Self:
        """Return a thin plate: c_P^2 = E/(rho (1 - nu^2)), c_S^2 = E/(2 rho (1 + nu)).

        Args:
            E: Young modulus, Pa.
            nu: Poisson's ratio, -0.99 to 0.5.
            rho: density, kg/m^3.
        """
        E, rho = checked("E", E, "Pa", gt=0), checked("rho", rho, "kg/m^3", gt=0)
        nu = checked("nu", nu, ge=-0.99, le=0.5)
        c_P, c_S = np.sqrt(E / (rho * (1 - nu**2))), np.sqrt(E / (2 * rho * (1 + nu)))
        return cls(c_P=c_P, c_S=c_S, rho=rho)

    @classmethod
    def plane_strain(cls, E: float, nu: float, rho: float) -> Self:
        """Return a thick body: c_P^2 = E (1 - nu)/(rho (1 + nu)(1 - 2 nu)), c_S as in a plate.

        Args:
            E: Young modulus, Pa.
            nu: Poisson's ratio, -0.99 to 0.499999.
            rho: density, kg/m^3.
        """
        E, rho = checked("E", E, "Pa", gt=0), checked("rho", rho, "kg/m^3", gt=0)
        nu = checked("nu", nu, ge=-0.99, le=0.499999)
        c_S = np.sqrt(E / (2 * rho * (1 + nu)))
        return cls(c_P=c_S * np.sqrt(2 * (1 - nu) / (1 - 2 * nu)), c_S=c_S, rho=rho)

    @property
    def r(self) -> float:
        """(c_S/c_P)^2."""
        return (self.c_S / self.c_P) ** 2

    @property
    def mu(self) -> float:
        """Shear modulus, Pa."""
        return self.rho * self.c_S**2

    @property
    def E_prime(self) -> float:
        """E in plane stress, E/(1 - nu^2) in plane strain, Pa; both are 4 mu (1 - r)."""
        return 4 * self.mu * (1 - self.r)

    @property
    def nu_plane_stress(self) -> float:
        """Poisson's ratio of the plate with these speeds, 1 - 2 r."""
        return 1 - 2 * self.r

    @property
    def nu_plane_strain(self) -> float:
        """Poisson's ratio of the thick body with these speeds, (1 - 2 r)/(2 (1 - r))."""
        return (1 - 2 * self.r) / (2 * (1 - self.r))

    @functools.cached_property
    def c_R(self) -> float:
        """Rayleigh speed, m/s; see `rayleigh_speed`."""
        low, high = 0.0, 1.0  # by halving: to import scipy.optimize takes half a second
        while low < (middle := 0.5 * (low + high)) < high:
            if reduced_D(middle, self.r) > 0:
                low = middle
            else:
                high = middle
        return self.c_S * np.sqrt(low)
