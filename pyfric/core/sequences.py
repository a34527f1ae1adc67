"""Quasi-static sequences of events in the core: calls, and the data of runs between calls."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from pyfric.core.builds import VARIANT, forked, load_variant
from pyfric.core.log import of_all, of_blocks
from pyfric.core.status import Status

if TYPE_CHECKING:
    from collections.abc import Sequence

KEPT = 2
"""Number of tables of the slider with all blocks held that the core stores for a run
(pyfric_pivots)."""
COUNTS = (
    *("leg", "phase", "step", "tried", "rests", "grown", "events", "starts", "releases"),
    *("block", "new", "slips", "gradual", "route", "base"),
)
"""Names of the integers that a run stores between calls, in the order of the core
(pyfric_sequences)."""
MOVES, IN_EVENT, PASSES = 2, 3, 5
"""Codes of phases of a run: before a change between events, inside an event, and before the next
change while slip grows (pyfric_sequence)."""
QUIET, POINTS = 256, 512
"""Largest numbers of starts and ends of slip, and of points of the curve, that a run logs in a
call."""


class CondensedSlider(NamedTuple):
    """The slider condensed onto its interface, for the core.

    Attributes:
        k: stiffness of a bond, in N/m.
        K: stiffness of the driver, in N/m.
        unit: F_N/N_x, in N.
        rounded: largest violation of conditions by rounding, over `unit`.
        least: normal force below which a block does not stick, in N.
        lost: violation of conditions by rounding, in N, above which the slider counts as not held.
        S: stiffness of u_x and u_z, shape (2 N_x, 2 N_x), in N/m.
        drive: load on the interface per motion of the driver, shape (2 N_x,), in N/m.
        loads: load per motion of the driver (N/m) and constant load (N), for each route of the
            loads, shape (n, 2 N_x, 2).
        F_T: F_T at u = 0, per motion of the driver (N/m) and constant (N), for each route, shape
            (n, 2).
    """

    k: float
    K: float
    unit: float
    rounded: float
    least: float
    lost: float
    S: np.ndarray
    drive: np.ndarray
    loads: np.ndarray
    F_T: np.ndarray


class Rules(NamedTuple):
    """Limits of a sequence.

    Attributes:
        changes: largest number of changes of contact state in an event, over N_x.
        idle: largest number of successive changes of contact state without motion of
            the driver.
        growth: largest number of changes while slip grows in a leg, over N_x.
        rate: rate of a force, over stiffness times rate of displacement, below which the rate is a
            rounding error.
        definite: definiteness below which slip may not be unique.
        p_corner: normal force below which slip begins as a corner episode, in N.
    """

    changes: float
    idle: float
    growth: float
    rate: float
    definite: float
    p_corner: float


class CoreLeg(NamedTuple):
    """A leg of a protocol: see `pyfric.scene.Leg` and `pyfric.statics.Stretch`.

    `route` is the number of the leg's loads, from 1; 0 means the loads of the leg before.
    """

    t: float
    t_end: float
    first: float
    last: float
    value: float
    slope: float
    offset: float
    way: int
    route: int


class Interfaces(NamedTuple):
    """The interfaces of n runs, and their states at the start.

    Attributes:
        fields: mu_s, mu_k, k_f (N/m) and gap (m), shape (n, 4, N_x).
        kinds: 0 for blocks that never touch the foundation, 1 for blocks without friction, 2 for
            all others, shape (n, N_x).
        mode: contact states, shape (n, N_x).
        u_x: positions of held blocks, shape (n, N_x), in m.
        drive: positions of the driver, shape (n,), in m.
        offset: length that is added to the driver's positions in all legs, shape (n,), in m.
        gradual: whether slip is continuous, as friction hardly weakens, shape (n,).
    """

    fields: np.ndarray
    kinds: np.ndarray
    mode: np.ndarray
    u_x: np.ndarray
    drive: np.ndarray
    offset: np.ndarray
    gradual: np.ndarray


class SequenceLog(NamedTuple):
    """Log of a run from one call of the core.

    Attributes:
        switches, quiet: columns as in `pyfric.core.Log`.
        points: time (s), F_T (N) and number of logged changes, shape (n, 3).
        f, p: friction along +x and normal force at the rows of `quiet`, shape (n, N_x), in N.
    """

    switches: dict[str, np.ndarray]
    quiet: dict[str, np.ndarray]
    points: np.ndarray
    f: np.ndarray
    p: np.ndarray

    @property
    def F_T(self) -> np.ndarray:
        """F_T at the rows of `quiet`, shape (n,), in N."""
        return self.quiet["F_T"]


def room_of_run(N_x: int) -> int:
    """Return the memory of a run of N_x blocks in `Sequences`, in bytes."""
    tables, logs = (1 + KEPT) * (N_x + 2) * (3 * N_x + 1), QUIET * (4 * N_x + 4) + 3 * POINTS
    return 8 * (tables + logs + 6 * (16 * N_x + 1024))


class Sequences:
    """Quasi-static sequences of several runs that share the slider and the protocol.

    The bits of a run do not depend on other runs, on threads, or on the number of calls.

    Args:
        slider: the slider.
        rules: limits of the sequences.
        legs: the protocol.
        interfaces: the interfaces and states of the runs.
        switches: room for switches of each run; None means room for many changes.

    Attributes:
        status: reason why each run stopped, a `Status`, shape (n,).
        counts: integers of each run, shape (n, 15); see `COUNTS`.
        mode: contact states after the last logged change, shape (n, N_x).
    """

    def __init__(
        self,
        slider: CondensedSlider,
        rules: Rules,
        legs: Sequence[CoreLeg],
        interfaces: Interfaces,
        switches: int | None = None,
    ) -> None:
        n, N_x = interfaces.mode.shape
        self.slider, self.rules = slider, rules
        self.legs = np.array(legs, dtype=float).reshape(-1, len(CoreLeg._fields))
        self.fields = np.ascontiguousarray(interfaces.fields, dtype=float)
        self.kinds = np.ascontiguousarray(interfaces.kinds, dtype=np.int32)
        self.states = np.zeros((n, 3 + KEPT, N_x), dtype=np.int32)
        self.states[:, 0], self.states[:, 3:] = interfaces.mode, -1
        self.states[:, 2] = np.where(interfaces.mode == 3, 2, interfaces.mode)
        self.columns = np.zeros((n, 2, N_x + 2))
        self.columns[:, 0, :N_x], self.columns[:, 0, N_x] = interfaces.u_x, interfaces.drive
        self.columns[:, 0, N_x + 1] = 1.0
        self.tables = np.empty((n, 1 + KEPT, N_x + 2, 3 * N_x + 1))
        self.counts = np.zeros((n, len(COUNTS)), dtype=np.int32)
        for name, value in (("leg", 1), ("route", 1), ("gradual", interfaces.gradual)):
            self.counts[:, COUNTS.index(name)] = value
        self.numbers = np.zeros((n, 4))
        self.numbers[:, 3] = interfaces.offset
        self.status = np.full(n, Status.PAUSED, dtype=np.int32)
        self._make_room(16 * N_x + 1024 if switches is None else max(switches, N_x))

    def _make_room(self, switches: int) -> None:
        n, N_x = len(self.states), self.states.shape[2]
        self.switch_i = np.empty((n, switches, 4), dtype=np.int32)
        self.switch_r = np.empty((n, switches, 4))
        self.quiet_i = np.empty((n, QUIET, N_x + 1), dtype=np.int32)
        self.quiet_r = np.empty((n, QUIET, 3 * N_x + 3))
        self.points = np.empty((n, POINTS, 3))
        self.n_log = np.zeros((n, 3), dtype=np.int32)

    def __len__(self) -> int:
        return len(self.status)

    def part(self, which: np.ndarray) -> Self:
        """Return the runs `which`, shape (n,), bool, with copies of their data."""
        part = object.__new__(type(self))
        part.slider, part.rules, part.legs = self.slider, self.rules, self.legs
        for name in ("fields", "kinds", "states", "columns", "tables", "counts", "numbers"):
            setattr(part, name, getattr(self, name)[which])
        part.status = self.status[which]
        part._make_room(self.switch_i.shape[1])
        return part

    def go_on(
        self, max_changes: int, *, stops: bool = False, threads: int = 1, variant: str = VARIANT
    ) -> np.ndarray:
        """Follow all runs, each for a limited number of changes; logs are filled from the start.

        Args:
            max_changes: largest number of changes of each run, at least 1.
            stops: whether to stop before each change between events; `ahead` is then the position
                of the driver at this change.
            threads: number of threads; one if `forked`.
            variant: build to use, which does not change results.

        Returns:
            `status`. Runs with the status `PAUSED` or `LOG_FULL` go on in the next call.

        Raises:
            ValueError: a number is out of range.
            MemoryError: there is no memory for the work space.
        """
        if not 1 <= max_changes < 2**31 or not 1 <= threads <= 4096:
            raise ValueError(
                f"max_changes = {max_changes}, threads = {threads}: must be at least 1"
            )
        load_variant(variant).sequences(
            np.array(self.slider[:6], dtype=float),
            self.slider.S.T,
            self.slider.drive,
            np.ascontiguousarray(self.slider.loads.transpose(0, 2, 1)).T,
            self.slider.F_T.T,
            np.array(self.rules, dtype=float),
            int(stops),
            self.legs.T,
            max_changes,
            1 if forked() else min(threads, len(self)),
            self.fields.T,
            self.kinds.T,
            self.states.T,
            self.columns.T,
            self.tables.T,
            self.counts.T,
            self.numbers.T,
            self.switch_i.T,
            self.switch_r.T,
            self.quiet_i.T,
            self.quiet_r.T,
            self.points.T,
            self.n_log.T,
            self.status,
        )
        if (self.status == Status.NO_MEMORY).any():
            raise MemoryError(f"the core has no memory for {self.states.shape[2]} blocks")
        return self.status

    def count(self, name: str) -> np.ndarray:
        """Return the integer `name` of `COUNTS` for each run, shape (n,)."""
        return self.counts[:, COUNTS.index(name)]

    @property
    def mode(self) -> np.ndarray:
        return self.states[:, 2]

    @property
    def looks(self) -> np.ndarray:
        """Whether each run has stopped before a change between events, shape (n,)."""
        before = np.isin(self.count("phase"), (MOVES, PASSES))
        return before & (self.status == Status.PAUSED)

    @property
    def ahead(self) -> np.ndarray:
        """Position of the driver at the next change, or now while slip grows, shape (n,), in m."""
        return self.numbers[:, 0]

    @property
    def slipping(self) -> np.ndarray:
        """Column of the block that slips at the next change, -1 if no block does, shape (n,)."""
        slips = (self.count("phase") == MOVES) & (np.abs(self.count("new")) == 1)
        return np.where(slips, self.count("block") - 1, -1)

    @property
    def tol(self) -> np.ndarray:
        """Largest violation of conditions by rounding, shape (n,), in N."""
        return self.numbers[:, 2]

    def force(self, run: int, drive: float) -> float:
        """Return F_T (N) of a run with the driver at a position (m), at present contact states."""
        row, column = self.tables[run, 0, :, -1], self.columns[run, 0].copy()
        column[-2] = drive
        return float(row @ column)

    def log(self, run: int) -> SequenceLog:
        """Return a copy of the log of a run from the last call."""
        n_switch, n_quiet, n_point = self.n_log[run].tolist()
        switches = of_blocks(self.switch_i[run, :n_switch].T, self.switch_r[run, :n_switch].T)
        of_quiet, N_x = self.quiet_r[run, :n_quiet], self.states.shape[2]
        u_x, f, p = (of_quiet[:, 3 + n * N_x : 3 + (n + 1) * N_x] for n in range(3))
        quiet = of_all(self.quiet_i[run, :n_quiet].T, of_quiet.T, u_x.T)
        return SequenceLog(switches, quiet, self.points[run, :n_point].copy(), f.copy(), p.copy())
