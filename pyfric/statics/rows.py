"""Indices of vectors and tables that belong to the bottom row, the top row and the interface."""

from __future__ import annotations

import functools
from typing import NamedTuple


class Ends(NamedTuple):
    """Indices of the bottom and the top row of blocks in u_full, or in forces on all blocks.

    The bottom row has the same indices in generalised coordinates and in the condensed slider.
    """

    u_x: slice
    u_z: slice
    top_x: slice
    top_z: slice


class TableRows(NamedTuple):
    """Rows u_x, f, u_z, F_T and columns u_x, drive, 1 of the table of the condensed interface.

    The rows and the columns of u_x have the same indices. `given` are the columns drive and 1.
    """

    u_x: slice
    f: slice
    u_z: slice
    F_T: int
    drive: int
    given: slice

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns."""
        return self.u_z.stop + 1, self.drive + 2


@functools.cache
def ends(N_x: int) -> Ends:
    """Return the rows of the bottom and the top row of a lattice of N_x columns."""
    bottom, top = (slice(0, N_x), slice(N_x, 2 * N_x)), (slice(-2 * N_x, -N_x), slice(-N_x, None))
    return Ends(*bottom, *top)


@functools.cache
def table_rows(N_x: int) -> TableRows:
    """Return the rows and columns of the table of an interface of N_x blocks."""
    u_x, f, u_z = (slice(n * N_x, (n + 1) * N_x) for n in range(3))
    return TableRows(u_x, f, u_z, -1, N_x, slice(N_x, None))
