"""What changes every step, in one object that can be copied, saved and continued."""

from __future__ import annotations

import dataclasses
import io
import math
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from pyfric.display import html
from pyfric.scene import clock, sealed, slipped, unsealed, write

if TYPE_CHECKING:
    from pyfric.scene import Scene

__all__ = ["OPEN", "STUCK", "State", "StateError"]

STUCK, OPEN = 0, 2
"""Contact states; a slipping block carries the sign of its motion, +1 or -1."""


REAL, WHOLE = np.dtype(np.float64), np.dtype(np.int32)


class StateError(ValueError):
    """A state is damaged or does not belong to the scene."""


@dataclass(eq=False)
class State:
    """State of a run between two steps; the time is t0 + step dt.

    Attributes:
        y: u_x, u_z (m), v_x, v_z (m/s), shape (N_z, 4, N_x); row 0 at the bottom. Under a rod the
            top row is where the rod carries it.
        rod: X, Z (m), phi (rad) and their rates, shape (6,); zeros without a rod.
        mode: contact of the bottom blocks, shape (N_x,), int32: 0 stuck, +1 or -1 slips to that
            side, 2 open.
        corner: 1 where the present or last slip is a corner episode, shape (N_x,), int32.
        margin: mu_s p - |f other than friction| at the last step, shape (N_x,), in N.
        loss: kinetic energy removed where a switch stopped a block, shape (N_x,), in J.
        dissipated: heat of the bonds that start in each row, shape (N_z,), in J.
        heat: friction heat under each block, shape (N_x,), in J.
        work: of the driver and of the forces on the top (load, shear), shape (2,), in J.
        step: steps made since t0.
        t0: time of step 0, in s.
        dt: time step, in s.
        u_drv0: u_x of the driven block at which F_T = 0 at t = 0, in m.
        s_0: slip of each bottom block since it last stuck, less mode u_x while it slips, shape
            (N_x,), in m; see `slip`. None starts slip at 0. An open block keeps what it had
            slipped; moving without contact is not slip.
        t_0: time at which each bottom block stuck, or began to slip after a stick, shape (N_x,), in
            s. None means t.
        parts: what of `heat` went into friction above mu_k p, and what into alpha, shape (2, N_x),
            in J. None means 0.
        sub: longest sub-step that the error of the adaptive stepper allows, in s; 0 for dt.
    """

    y: np.ndarray
    rod: np.ndarray
    mode: np.ndarray
    corner: np.ndarray
    margin: np.ndarray
    loss: np.ndarray
    dissipated: np.ndarray
    heat: np.ndarray
    work: np.ndarray
    step: int
    t0: float
    dt: float
    u_drv0: float
    sub: float = 0.0
    s_0: np.ndarray | None = None
    t_0: np.ndarray | None = None
    parts: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.s_0 is None:  # a state of files that do not hold it
            self.s_0 = clock(0.0, self.mode, self.y[0, 0])
        if self.t_0 is None:
            self.t_0 = np.full(len(self.mode), self.t)
        if self.parts is None:
            self.parts = np.zeros((2, len(self.mode)))

    @property
    def slip(self) -> np.ndarray:
        """Path that each bottom block has slipped since it last stuck, shape (N_x,), in m."""
        return slipped(self.s_0, self.mode, self.y[0, 0])

    @property
    def t(self) -> float:
        """Time, in s."""
        return self.t0 + self.step * self.dt

    def __eq__(self, other: object) -> bool:
        """Whether all values are equal; NaN equals NaN."""
        if not isinstance(other, State):
            return NotImplemented
        names = [one.name for one in dataclasses.fields(self)]
        pairs = [(getattr(self, name), getattr(other, name)) for name in names]
        return all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)

    __hash__ = None

    def __repr__(self) -> str:
        blocks = f"{self.y.shape[2]} x {self.y.shape[0]} blocks"
        slipping, opened = int((abs(self.mode) == 1).sum()), int((self.mode == 2).sum())
        moving = f"{slipping} slip, {opened} open" if slipping or opened else "none slips"
        return f"State of {blocks} at t = {self.t:.9g} s, step {self.step}: {moving}"

    def _repr_html_(self) -> str:
        return html(self)

    def copy(self) -> Self:
        """Return a copy that shares nothing."""
        values = {one.name: getattr(self, one.name) for one in dataclasses.fields(self)}
        return type(self)(
            **{name: v.copy() if isinstance(v, np.ndarray) else v for name, v in values.items()}
        )

    def with_dt(self, dt: float) -> Self:
        """Return a copy that goes on with another step; the same step keeps the count."""
        new = self.copy()
        if dt != self.dt:
            new.t0, new.step, new.dt, new.sub = self.t, 0, float(dt), 0.0
        return new

    def check(self, N_x: int, N_z: int | None = None) -> None:
        """Check shapes and types, which is all the core relies on.

        Raises:
            StateError: an array has the wrong shape, type or memory order, or dt is not positive.
        """
        N_z = len(self.y) if N_z is None else N_z
        blocks = (N_x,)
        for name, shape, dtype in (
            ("y", (N_z, 4, N_x), REAL),
            ("rod", (6,), REAL),
            ("mode", blocks, WHOLE),
            ("corner", blocks, WHOLE),
            ("margin", blocks, REAL),
            ("loss", blocks, REAL),
            ("s_0", blocks, REAL),
            ("t_0", blocks, REAL),
            ("parts", (2, N_x), REAL),
            ("dissipated", (N_z,), REAL),
            ("heat", blocks, REAL),
            ("work", (2,), REAL),
        ):
            array = getattr(self, name)
            right = isinstance(array, np.ndarray) and array.shape == shape and array.dtype == dtype
            if not (right and array.flags.carray):
                raise StateError(f"state.{name}: expected a contiguous {dtype} {shape}")
        if not (
            self.dt > 0 and math.isfinite(self.t0) and math.isfinite(self.u_drv0) and self.step >= 0
        ):
            raise StateError(
                f"state: dt = {self.dt} s, t0 = {self.t0} s, u_drv0 = {self.u_drv0} m, "
                f"step = {self.step}: expected finite values, dt > 0, step >= 0"
            )

    def check_physics(self, scene: Scene) -> None:
        """Check a state that comes from outside before a run goes on from it.

        Raises:
            StateError: it does not fit the scene, holds values that are not finite, a contact
                state that does not exist, a stuck block that moves, or a top row off its rod.
        """
        self.check(scene.N_x, scene.N_z)
        for one in dataclasses.fields(self):
            if not np.isfinite(getattr(self, one.name)).all():
                raise StateError(f"state.{one.name}: holds values that are not finite")
        if not np.isin(self.mode, (STUCK, 1, -1, OPEN)).all():
            raise StateError(f"state.mode: {self.mode}, allowed: 0, 1, -1, 2")
        if (self.y[0, 2, self.mode == STUCK] != 0).any():
            raise StateError("state: a stuck block moves")
        if scene.rigid:
            X, Z, phi = self.rod[:3]
            if (self.y[-1, 0] != X).any() or (self.y[-1, 1] != Z + phi * scene.x).any():
                raise StateError("state: the top row is not where the rod carries it")

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the state to a NumPy archive (.npz), exactly and atomically.

        The last line of the file is the SHA-256 of all before it.

        Raises:
            OSError: the file cannot be written; it names path and reason.
        """
        values = {one.name: getattr(self, one.name) for one in dataclasses.fields(self)}
        content = io.BytesIO()
        np.savez(content, **values)
        return write(path, sealed(content.getbuffer()))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a state written by `save`.

        Raises:
            OSError: the file cannot be read.
            StateError: it holds no state, or is damaged.
        """
        inside = unsealed(Path(path).read_bytes())
        if inside is None:
            reason = "its content and the hash at its end do not agree"
            raise StateError(f"{path}: damaged, or not a state ({reason})")
        try:
            with np.load(io.BytesIO(inside)) as archive:
                values = {one.name: archive[one.name] for one in dataclasses.fields(cls)}
        except (KeyError, ValueError, EOFError, zipfile.BadZipFile) as error:
            raise StateError(f"{path}: not a state ({error})") from error
        scalars = ("step", "t0", "dt", "u_drv0", "sub")
        numbers = {name: values[name].item() for name in scalars}
        return cls(**values | numbers)
