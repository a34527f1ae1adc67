"""The state of a run: everything that changes with each step, in one object."""

from __future__ import annotations

import dataclasses
import io
import math
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from pyfric.core.packing import check_driven
from pyfric.display import html
from pyfric.scene import slipped
from pyfric.values import check_free, read_at_most, sealed, unsealed, write

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pyfric.scene import OnDriven, Scene

STUCK, OPEN = 0, 2
"""Contact states. The state of a slipping block is its direction, +1 or -1."""


NUMBERS = ("step", "t0", "dt", "drive", "sub", "since")
REAL, WHOLE = np.dtype(np.float64), np.dtype(np.int32)


SIDES = {"left": 1, "right": -1, "pull right": 2, "pull left": -2, "top": 3}
"""Codes of driven sides in `State.spring`."""


class StateError(ValueError):
    """A state is damaged or does not belong to the scene."""


def spring_of(scene: Scene) -> np.ndarray:
    """Return `State.spring` of a scene, shape (4,): K (N/m), code of the side, and driven rows."""
    side = SIDES[scene.driver.side]
    return np.array([scene.driver.K, side, scene.j_h, scene.j_h_top], dtype=float)


@dataclass(eq=False, slots=True)
class State:
    """State of a run between two steps; the time is t0 + step dt.

    Attributes:
        y: u_x, u_z (m), v_x, v_z (m/s), shape (N_z, 4, N_x); row 0 is the bottom. Under a rod the
            top row moves with the rod.
        rod: X, Z (m), phi (rad) and their rates, shape (6,); zeros without a rod.
        mode: contact states of the bottom blocks, shape (N_x,), int32: 0 stuck, +1 or -1 slip in
            that direction, 2 open.
        corner: 1 if the present or last slip is a corner episode, shape (N_x,), int32.
        margin: margin of each block to slip at the last step, shape (N_x,), in the unit and with
            the meaning of `scene.law.margin`: a force in N if blocks can rest.
        memory: state variables of the friction law for each bottom block, shape (N_x,), a
            structured array with the names of the law; `state.s_0` is `memory["s_0"]`.
        loss: kinetic energy removed when a switch stopped a block, shape (N_x,), in J. On
            junctions: heat of breaks and of pinning.
        dissipated: heat of the bonds that start in each row, plus energy that absorbing walls take
            from this row, shape (N_z,), in J.
        heat: friction heat under each block, shape (N_x,), in J.
        work: work of the driver, and work of other external forces (load, shear, push), shape
            (2,), in J.
        step: number of steps since t0.
        t0: time of step 0, in s.
        dt: time step, in s.
        u_drv0: u_x of the driven block at which F_T = 0 if drive = 0, in m. Under a plate, u_x of
            its blocks at which no spring is strained, row by row, shape (n_driven,).
        drive: displacement of the driver, in m.
        parts: parts of `heat` from friction above mu_k p and from alpha, shape (2, N_x), in J. On
            junctions: heat of dragging, and work of changes of stiffness. None means 0.
        spring: K (N/m) and side of the driver (`SIDES`), the lowest and the highest driven row,
            shape (4,). None means zeros: the driver is unknown.
        radiated: part of `dissipated` that absorbing walls take, shape (N_z,), in J. None means 0.
        sub: longest sub-step that the error of the adaptive stepper allows, in s; 0 means dt. In a
            phase of slow slip: length of its first slow step.
        since: number of steps since the present phase of slow slip began; 0 without such a phase.
        phase: u_x (m), theta (s) and v_x (m/s) at the start of the present phase of slow slip,
            shape (3, N_x). None means 0.

    `scene.law.state` lists the state variables with units and meanings. State variables of
    junctions have the shape (N_x, n_s). While a block is open, its s_0 (see `slip`) does not
    change, because motion without contact is not slip.
    """

    y: np.ndarray
    rod: np.ndarray
    mode: np.ndarray
    corner: np.ndarray
    margin: np.ndarray
    memory: np.ndarray
    loss: np.ndarray
    dissipated: np.ndarray
    heat: np.ndarray
    work: np.ndarray
    step: int
    t0: float
    dt: float
    u_drv0: OnDriven
    drive: float
    sub: float = 0.0
    parts: np.ndarray | None = None
    spring: np.ndarray | None = None
    radiated: np.ndarray | None = None
    since: int = 0
    phase: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.parts is None:
            self.parts = np.zeros((2, len(self.mode)))
        if self.spring is None:
            self.spring = np.zeros(4)
        if self.radiated is None:
            self.radiated = np.zeros(len(self.y))
        if self.phase is None:
            self.phase = np.zeros((3, len(self.mode)))

    def __getattr__(self, name: str) -> np.ndarray:
        """Return a state variable of the law, as a view of `memory`."""
        if name != "memory" and name in self.memory.dtype.names:
            return self.memory[name]
        raise AttributeError(f"a state has no {name!r}", name=name, obj=self)

    @property
    def numbers(self) -> np.ndarray:
        """View of `memory` in the form that the core takes, shape (N_x, n_memory)."""
        return self.memory.view(float).reshape(len(self.memory), -1)

    @property
    def slip(self) -> np.ndarray:
        """Slip path of each bottom block since it last stuck, shape (N_x,), in m."""
        return slipped(self.s_0, self.mode, self.y[0, 0])

    @property
    def t(self) -> float:
        """Time, in s."""
        return self.t0 + self.step * self.dt

    def __eq__(self, other: object) -> bool:
        """Return whether all values are equal; NaN equals NaN."""
        if not isinstance(other, State):
            return NotImplemented
        left, right = self.values(), other.values()
        return left.keys() == right.keys() and all(
            np.array_equal(value, right[name], equal_nan=True) for name, value in left.items()
        )

    __hash__ = None

    def __repr__(self) -> str:
        blocks = f"{self.y.shape[2]} x {self.y.shape[0]} blocks"
        slipping, opened = int((abs(self.mode) == 1).sum()), int((self.mode == 2).sum())
        moving = f"{slipping} slip, {opened} open" if slipping or opened else "none slips"
        return f"State of {blocks} at t = {self.t:.9g} s, step {self.step}: {moving}"

    _repr_html_ = html

    def values(self) -> dict[str, Any]:
        """Return the arrays and numbers of the state by name, as in files."""
        names = [field.name for field in dataclasses.fields(self) if field.name != "memory"]
        return {name: getattr(self, name) for name in (*names, *self.memory.dtype.names)}

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Self:
        """Return the state whose `values` are these.

        Raises:
            KeyError: a value is missing.
        """
        own = {field.name for field in dataclasses.fields(cls)} - {"memory"}
        own -= {"spring", "radiated", "since", "phase"} - values.keys()
        law = {name: np.asarray(values[name]) for name in values if name not in own}
        types = [(name, float, value.shape[1:]) for name, value in law.items()]
        memory = np.empty(len(values["mode"]), types)
        for name, value in law.items():
            memory[name] = value
        return cls(**{name: values[name] for name in own}, memory=memory)

    def copy(self) -> Self:
        """Return a copy that shares no arrays."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return type(self)(
            **{name: v.copy() if isinstance(v, np.ndarray) else v for name, v in values.items()}
        )

    def with_dt(self, dt: float) -> Self:
        """Return a copy with time step dt (s). If dt is new, steps are counted from now on."""
        new = self.copy()
        if dt != self.dt:
            new.t0, new.step, new.dt, new.sub = self.t, 0, float(dt), 0.0
            new.out_of_phase()
        return new

    def out_of_phase(self) -> None:
        """Set `since` and `phase` to zero: no phase of slow slip has begun."""
        self.since, self.phase = 0, np.zeros_like(self.phase)

    def under(self, scene: Scene) -> Self:
        """Return a copy for a run under another protocol or driver, with the same F_T.

        Times of protocols count from t = 0. If the new protocol gives another driver position at t,
        or if K differs, u_drv0 is shifted so that F_T does not jump. If the driven blocks differ,
        F_T is divided evenly among the new driven blocks.

        Raises:
            StateError: the driver is on the other side, or the state is damaged.
        """
        self.check(scene.N_x, scene.N_z)
        new, drive = self.copy(), scene.drive(self.t)
        new.out_of_phase()
        if drive != self.drive:
            new.u_drv0, new.drive = self.u_drv0 + scene.d * (self.drive - drive), drive
        new.spring = spring_of(scene)
        if self.spring[1] and not np.array_equal(self.spring, new.spring):
            new.u_drv0 = self._taken_over(scene, drive)
        return new

    def _taken_over(self, scene: Scene, drive: float) -> OnDriven:
        """Return u_drv0 (m) of the driver of a scene at `drive` (m), for the present F_T."""
        K, side, low, high = self.spring
        if side != SIDES[scene.driver.side]:
            known = {number: name for name, number in SIDES.items()}.get(int(side), side)
            raise StateError(f"state: its driver is {known!r}, that of the scene on another side")
        d = scene.d
        u = scene.u_driven(self.y)
        if not scene.driver.K:
            return u
        then = self.y[int(low) : int(high) + 1, *scene.driven[1:]].ravel()
        forces = K / len(then) * (self.drive - d * (then - self.u_drv0))
        if (low, high) != (scene.j_h, scene.j_h_top):
            forces = np.full(scene.n_driven, forces.sum() / scene.n_driven)
        home = u - d * (drive - forces * scene.n_driven / scene.driver.K)
        return float(home[0]) if scene.n_driven == 1 else home

    def check(self, N_x: int, N_z: int | None = None, n_memory: int | None = None) -> None:
        """Raise StateError if shapes or types of arrays do not fit the core.

        Args:
            N_x: number of blocks along the interface.
            N_z: number of rows; None means any.
            n_memory: number of state variables of each block; None means any.

        Raises:
            StateError: an array has the wrong shape, type or memory order, or dt is not positive.
        """
        N_z, found = len(self.y) if N_z is None else N_z, np.shape(self.y)
        if len(found) == 3 and found[::2] != (N_z, N_x):
            raise StateError(f"state.y: of {found[2]} x {found[0]} blocks; needed: {N_x} x {N_z}")
        self._check_memory(N_x, n_memory)
        blocks = (N_x,)
        for name, shape, dtype in (
            ("y", (N_z, 4, N_x), REAL),
            ("rod", (6,), REAL),
            ("mode", blocks, WHOLE),
            ("corner", blocks, WHOLE),
            ("margin", blocks, REAL),
            ("loss", blocks, REAL),
            ("parts", (2, N_x), REAL),
            ("dissipated", (N_z,), REAL),
            ("radiated", (N_z,), REAL),
            ("heat", blocks, REAL),
            ("work", (2,), REAL),
            ("spring", (4,), REAL),
            ("phase", (3, N_x), REAL),
        ):
            array = getattr(self, name)
            right = isinstance(array, np.ndarray) and array.shape == shape and array.dtype == dtype
            if not (right and array.flags.carray) or np.ma.is_masked(array):
                raise StateError(f"state.{name}: expected a contiguous {dtype} {shape}")
        for name in NUMBERS:
            if np.ndim(getattr(self, name)):
                raise StateError(f"state.{name}: expected a number")
        low, high = self.spring[2:]
        if self.spring[1] and not (
            0 <= low <= high < N_z
            and np.size(self.u_drv0) == (N_x if self.spring[1] == SIDES["top"] else high - low + 1)
        ):
            raise StateError(f"state.spring: rows {low:g} to {high:g} are not in the lattice")
        if not (
            self.dt > 0
            and self.step >= self.since >= 0
            and all(map(math.isfinite, (self.t0, self.drive, *np.atleast_1d(self.u_drv0))))
        ):
            raise StateError(
                f"state: dt = {self.dt} s, t0 = {self.t0} s, u_drv0 = {self.u_drv0} m, drive = "
                f"{self.drive} m, step = {self.step}: expected finite values, dt > 0, step >= 0"
            )

    def _check_memory(self, N_x: int, n_memory: int | None) -> None:
        found, parts = self.memory, []
        right = isinstance(found, np.ndarray) and found.shape == (N_x,) and found.flags.carray
        if right:
            parts = [part for part, _ in (found.dtype.fields or {}).values()]
            right = all(part.base == REAL for part in parts)
        n = sum(part.itemsize for part in parts) // REAL.itemsize
        if not right or n * REAL.itemsize != found.dtype.itemsize or n_memory not in (None, n):
            count = "" if n_memory is None else f"{n_memory} "
            needed = f"needs {count}named {REAL} values for each of {N_x} blocks"
            raise StateError(f"state.memory: {needed}")

    def check_physics(self, scene: Scene) -> None:
        """Raise StateError if a run of a scene cannot continue from the state.

        Raises:
            StateError: the state does not fit the scene, a value is not finite, a contact state is
                unknown, a stuck block moves, the top row does not follow its rod, or the number of
                driven blocks differs.
        """
        self.check(scene.N_x, scene.N_z)
        if self.memory.dtype != scene.law.memory:
            names = ", ".join(scene.law.memory.names or ())
            raise StateError(f"state.memory: holds {self.memory.dtype}, its law needs {names}")
        for name, value in self.values().items():
            if not np.isfinite(value).all():
                raise StateError(f"state.{name}: holds values that are not finite")
        try:
            check_driven(scene, self.u_drv0)
        except ValueError as error:
            raise StateError(f"state.{error}") from None
        if not np.isin(self.mode, (STUCK, 1, -1, OPEN)).all():
            raise StateError(f"state.mode: {self.mode}, allowed: 0, 1, -1, 2")
        if scene.law.rests and (self.y[0, 2, self.mode == STUCK] != 0).any():
            raise StateError("state: a stuck block moves")
        if scene.rigid:
            X, Z, phi = self.rod[:3]
            if (self.y[-1, 0] != X).any() or (self.y[-1, 1] != Z + phi * scene.x).any():
                raise StateError("state: the top row is not where the rod carries it")

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write the state to a NumPy archive (.npz), exactly and atomically.

        The last line of the file is the SHA-256 of all bytes before it.

        Raises:
            OSError: the file cannot be written. The message names path and reason.
            SceneError: the name has the suffix of another format. Or the file exists and
                `overwrite` is not True; the state was then saved in another file beside it.
        """
        check_free(path, overwrite, self.save)
        content = io.BytesIO()
        np.savez(content, **self.values())
        return write(path, sealed(content.getbuffer()), ".npz")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a state written by `save`.

        Raises:
            OSError: the file cannot be read, or is not a regular file.
            StateError: the file contains no state, or is damaged.
        """
        inside = unsealed(read_at_most(path))
        if inside is None:
            reason = "its content and the hash at its end do not agree"
            raise StateError(f"{path}: damaged, or not a state ({reason})")
        try:
            with np.load(io.BytesIO(inside)) as archive:
                values = dict(archive)
            numbers = {name: values[name].item() for name in NUMBERS if name in values}
            if not values["u_drv0"].ndim:
                numbers["u_drv0"] = values["u_drv0"].item()
            return cls.of(values | numbers)
        except (KeyError, ValueError, TypeError, EOFError, zipfile.BadZipFile) as error:
            reason = f"{path}: damaged, or not a state, as State.save writes it"
            raise StateError(reason) from error
