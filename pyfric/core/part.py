"""A part of a chain, from one block to another, in the form that the core takes.

In a chain, forces act only between neighbours. A stuck block between stuck blocks stays at rest,
and only the driver changes the force on this block. If the outermost blocks of a part rest, the
part therefore makes the same steps as in the whole chain.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from pyfric.core.log import Log
from pyfric.core.packing import BEYOND, OF_BLOCKS, Constants, Counts, Model
from pyfric.core.state import State

ROWS, MU_S = len(OF_BLOCKS), OF_BLOCKS.index("mu_s")
"""Number of rows of N_x numbers in a `Model`, and index of the row of mu_s."""


class Part:
    """The blocks of a chain from `first` to `end` - 1, counted from 0.

    Args:
        model: the chain.
        first, end: index of the first block, and index after the last block.
    """

    def __init__(self, model: Model, first: int, end: int) -> None:
        self.N_x, self.first, self.end = model.N_x, first, end
        counts, n = Counts(*model.counts.tolist()), len(Constants._fields)
        constants = Constants(*model.numbers[:n])
        driven = slice(counts.i_h - 1, counts.i_h_end)
        aside = np.zeros(self.N_x)
        aside[driven] = model.numbers[n : n + driven.stop - driven.start]
        n += driven.stop - driven.start
        rows = model.numbers[n : n + ROWS * self.N_x].reshape(ROWS, -1)[:, first:end].copy()
        knots = model.numbers[n + ROWS * self.N_x :]
        begin, stop = max(driven.start, first), min(driven.stop, end)
        if begin >= stop:  # no driven block in this part
            constants, begin, stop = constants._replace(k_drv=0.0), first, first + 1
        if first > 0:
            rows[MU_S, 0] = np.inf
        if end < self.N_x:
            rows[MU_S, -1] = np.inf
        counts = counts._replace(
            nx=end - first,
            i_h=begin - first + 1,
            i_h_end=stop - first,
            left=counts.left if first == 0 else BEYOND["free"],
            right=counts.right if end == self.N_x else BEYOND["free"],
        )
        numbers = np.concatenate([constants, aside[begin:stop], rows.ravel(), knots])
        self.model = Model(np.array(counts, dtype=np.int32), numbers)

    def state(self, whole: State) -> State:
        """Return a copy of the state of this part, without the numbers of the driver."""
        at = slice(self.first, self.end)
        values = {name: getattr(whole, name)[..., at].copy() for name in BY_BLOCK}
        copied = {name: getattr(whole, name).copy() for name in OF_ROWS}
        return dataclasses.replace(whole, **values, **copied, u_drv0=0.0, spring=np.zeros(4))

    def put(self, part: State, whole: State) -> None:
        """Copy the state of this part to the state of the whole chain."""
        at = slice(self.first, self.end)
        for name in BY_BLOCK:
            getattr(whole, name)[..., at] = getattr(part, name)
        whole.step, whole.drive = part.step, part.drive

    def switched(self, log: Log) -> bool:
        """Return whether one of the last two blocks before a cut has switched."""
        blocks = log.switch_i[0, : log.n_switch]
        near = (blocks < 2) & (self.first > 0)
        return bool((near | ((blocks >= self.end - self.first - 2) & (self.end < self.N_x))).any())

    def log(self, part: Log, whole: Log, state: State) -> None:
        """Fill the log of the whole chain, except F_T; `state` is its state before the steps."""
        n, m, at = part.n_switch, part.n_quiet, slice(self.first, self.end)
        whole.n_switch, whole.n_quiet, whole.n_point = n, m, part.n_point
        whole.switch_i[:, :n], whole.switch_r[:, :n] = part.switch_i[:, :n], part.switch_r[:, :n]
        whole.switch_i[0, :n] += self.first
        head = len(whole.quiet_r) - self.N_x
        whole.quiet_i[0, :m], whole.quiet_i[1:, :m] = part.quiet_i[0, :m], state.mode[:, None]
        whole.quiet_i[1:][at, :m] = part.quiet_i[1:, :m]
        whole.quiet_r[:head, :m] = part.quiet_r[:head, :m]
        whole.quiet_r[head:, :m] = state.y[0, 0][:, None]
        whole.quiet_r[head:][at, :m] = part.quiet_r[head:, :m]
        whole.points[:, : part.n_point] = part.points[:, : part.n_point]
        whole.n_crossing = whole.n_burst = 0
        whole.tried = part.tried * (self.end - self.first) / self.N_x
        whole.block = part.block + self.first * (part.block >= 0)
        whole.t = part.t


BY_BLOCK = "y", "mode", "corner", "margin", "memory", "loss", "heat", "parts", "phase"
"""Names of the arrays of a state whose last index counts blocks."""
OF_ROWS = "rod", "dissipated", "radiated", "work"
"""Names of the other arrays of a state."""
