"""Blocks of a scene: columns and rows, masses, half blocks, which blocks are driven."""

import functools
import math
from typing import Annotated, Any, ClassVar

import numpy as np

from pyfric.scene.ends import Conditions
from pyfric.scene.parts import (
    PARTS,
    DistributedLoad,
    Driver,
    Interface,
    PrescribedLoad,
    Rod,
    Slider,
    Walls,
)
from pyfric.values import Name, part

OnDriven = float | np.ndarray
"""A number for one driven block, or an array for several."""
MAX_NAME = 200
"""Largest number of characters in the name of a scene."""


@part
class Lattice:
    """The parts of a scene, and the blocks that follow from them."""

    slider: Annotated[Slider, PARTS["slider"]]
    top: Annotated[Rod | DistributedLoad | PrescribedLoad, PARTS["top"]]
    driver: Annotated[Driver, PARTS["driver"]]
    interface: Annotated[Interface, PARTS["interface"]]
    name: Annotated[str, Name(MAX_NAME)] = ""
    walls: Annotated[Walls, PARTS["walls"]] = Walls()
    stop_when: Annotated[tuple[str, ...], Conditions()] = ()

    _section: ClassVar[str] = ""

    @property
    def N_x(self) -> int:
        """Number of columns, L/l + 1."""
        return self.slider.N_x

    @property
    def N_z(self) -> int:
        """Number of rows, H/l + 1."""
        return self.slider.N_z

    @functools.cached_property
    def x(self) -> np.ndarray:
        """Reference positions of the columns from the centre, shape (N_x,), in m."""
        x = (np.arange(self.N_x) - (self.N_x - 1) / 2) * self.slider.l
        x.flags.writeable = False
        return x

    @property
    def m(self) -> float:
        """Mass of one block, M / (N_x N_z), in kg."""
        return self.slider.m

    @functools.cached_property
    def shares(self) -> tuple[np.ndarray, np.ndarray]:
        """Share of whole blocks in each row, shape (N_z,), and in each column, shape (N_x,).

        A share is 1, or 1/2 along a prescribed interface, along absorbing walls and, if the slider
        has half blocks, along all edges that are not mirrored. The share of a block is the product
        of the shares of its row and column. Bonds along such a row or column have half of their
        strength.
        """
        rows, columns = np.ones(self.N_z), np.ones(self.N_x)
        half = self.slider.edges == "half"
        cut = ("absorbing", "free", "held") if half else ("absorbing",)
        ends = [("left", columns, 0), ("right", columns, -1), ("top", rows, -1)]
        for name, of, end in ends[: 3 if self.N_z > 1 else 2]:
            if getattr(self.walls, name) in cut:
                of[end] = 0.5
        if self.prescribed or (half and self.N_z > 1):
            rows[0] = 0.5
        return rows, columns

    @property
    def top_shares(self) -> np.ndarray:
        """Share of whole blocks in the top row, shape (N_x,)."""
        return self.shares[0][-1] * self.shares[1]

    @property
    def m_interface(self) -> float:
        """Mass of a block of the bottom row, in kg: m, or m/2 if the row has half blocks."""
        return self.m * float(self.shares[0][0])

    @functools.cached_property
    def weights(self) -> np.ndarray:
        """Weights of the blocks, shape (N_z, N_x), in N."""
        return self.m * self.slider.g * np.outer(*self.shares)

    @property
    def eta(self) -> float:
        """Viscosity of every bond in N s/m; by default sqrt(0.1 k m)."""
        given, damping = self.slider.eta, self.slider.damping
        damping = 0.1 if damping is None else damping
        return math.sqrt(damping * self.slider.k * self.m) if given is None else given

    @property
    def d(self) -> int:
        """Direction of the drive: -1 if pushed from the right or pulled at the left, else +1."""
        return -1 if self.driver.side in ("right", "pull left") else 1

    @property
    def ahead(self) -> int:
        """Direction in which blocks are numbered: +1 from the left, -1 from a driven right side."""
        return -1 if self.driver.side in ("right", "pull right") else 1

    @property
    def n_of_i(self) -> np.ndarray:
        """Block numbers from the trailing edge (1 … N_x), left to right, shape (N_x,), int."""
        n = np.arange(1, self.N_x + 1)
        return n if self.ahead > 0 else n[::-1].copy()

    @property
    def i_h(self) -> int:
        """First column of driven blocks, counted from 0: 0 or N_x - 1."""
        return 0 if self.ahead > 0 else self.N_x - 1

    @property
    def i_h_end(self) -> int:
        """Last column of driven blocks, counted from 0."""
        return self.N_x - 1 if self.driver.side == "top" else self.i_h

    @property
    def j_h(self) -> int:
        """Row of the (lowest) driven block, counted from 0 at the bottom: h / l."""
        return round(self.driver.h / self.slider.l)

    @property
    def j_h_top(self) -> int:
        """Row of the highest driven block, counted from 0 at the bottom: h_top / l."""
        top = self.driver.h_top
        return self.j_h if top is None else round(top / self.slider.l)

    @property
    def n_driven(self) -> int:
        """Number of driven blocks, 1 for a spring at a side without a plate."""
        return (self.j_h_top - self.j_h + 1) * (self.i_h_end - self.i_h + 1)

    @property
    def driven(self) -> tuple[slice, int, slice]:
        """Index of u_x of the driven blocks in u, shape (N_z, 2 or 4, N_x)."""
        return slice(self.j_h, self.j_h_top + 1), 0, slice(self.i_h, self.i_h_end + 1)

    def u_driven(self, u: np.ndarray) -> OnDriven:
        """Return u_x of the driven block, or of several blocks, row by row, (n_driven,), in m.

        Args:
            u: displacements, or a state, shape (N_z, 2 or 4, N_x), in m.
        """
        if self.n_driven == 1:
            return float(u[self.j_h, 0, self.i_h])
        return u[self.driven].ravel()

    @property
    def j_shear(self) -> int:
        """Row on which `shear` acts, counted from 0 at the bottom."""
        return 0 if self.prescribed else self.N_z - 1

    @property
    def prescribed(self) -> bool:
        """True if the interface is prescribed in two dimensions, with given p and no foundation."""
        return isinstance(self.top, PrescribedLoad) and self.N_z > 1

    @property
    def rigid(self) -> bool:
        """True if the top row is glued to a rod (setup 1)."""
        return isinstance(self.top, Rod)

    @property
    def M_rod(self) -> float:
        """Mass of the rod in kg; 0 without a rod."""
        return self.top.mass

    @property
    def kappa(self) -> float:
        """Torque of the mattress per tilt, mattress L^2 / 12, in N m; 0 without a rod."""
        return self.top.mattress * self.slider.L**2 / 12

    @property
    def k_top(self) -> float:
        """Stiffness between each block of a chain, or of a free top, and a plate, in N/m."""
        return self.top.k_top or 0.0

    def _by_column(self, values: Any) -> np.ndarray:
        """Return values given from the trailing edge on as an array from left to right."""
        if isinstance(values, tuple):
            return np.array(values)[self.n_of_i - 1]
        return np.full(self.N_x, values)
