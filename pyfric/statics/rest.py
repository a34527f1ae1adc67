"""A static state, and the errors if there is none."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pyfric.core import OPEN, STUCK, State, spring_of
from pyfric.values import SceneError

if TYPE_CHECKING:
    from pyfric.scene import OnDriven, Scene


class EquilibriumError(RuntimeError):
    """No equilibrium was found.

    Attributes:
        residual: largest residual force, in N; NaN if not computed.
        limit: largest accepted residual, in N.
        iterations: number of iterations.
    """

    def __init__(self, what: str, residual: float, limit: float, iterations: int) -> None:
        self.residual, self.limit, self.iterations = residual, limit, iterations
        super().__init__(what, residual, limit, iterations)

    def __str__(self) -> str:
        known = [f"{self.iterations} iterations"] * bool(self.iterations)
        if not math.isnan(self.residual):
            known = [f"residual {self.residual:.3g} N", f"limit {self.limit:.3g} N", *known]
        return f"no equilibrium: {self.args[0]}" + f" ({', '.join(known)})" * bool(known)


@dataclass(frozen=True, kw_only=True)
class Equilibrium:
    """A static state. Arrays are read-only and run from left to right.

    Attributes:
        u: displacements, shape (N_z, 2, N_x), in m; [j, 0] is u_x of row j, [j, 1] is u_z.
        rod: X (m), Z (m), phi (rad), shape (3,); zeros without a rod.
        F_T: force of the driver, in N, positive if it pushes.
        f: friction force on each block in +x, shape (N_x,), in N.
        tau: -d f, shape (N_x,), in N, positive against the drive direction. The sum of tau is F_T +
            T; in a chain, the sum of tau is F_T plus the sum of the prescribed tau minus k_top d
            sum(u_x).
        p: foundation force on each block, shape (N_x,), in N.
        open: blocks that do not touch the foundation, p = f = 0, shape (N_x,), bool; blocks
            without friction (`Scene.bare`) touch it with f = 0.
        slipped: blocks that slipped while F_N was applied, shape (N_x,), bool (`loaded_state`).
        drive: displacement V t of the driver since t = 0, in m.
        u_drv0: u_x of the driven blocks at which drive = 0 gives F_T = 0, in m: see
            `Scene.u_driven`.
        residual: largest residual force, in N.
        iterations: number of Newton steps, summed over all sets of contact states.
    """

    u: np.ndarray
    rod: np.ndarray
    F_T: float
    f: np.ndarray
    tau: np.ndarray
    p: np.ndarray
    open: np.ndarray
    slipped: np.ndarray
    drive: float
    u_drv0: OnDriven
    residual: float
    iterations: int

    def __post_init__(self) -> None:
        for name in ("u", "rod", "f", "tau", "p", "open", "slipped"):
            getattr(self, name).setflags(write=False)

    def __repr__(self) -> str:
        blocks = f"{self.u.shape[2]} x {self.u.shape[0]} blocks"
        p = f"p = {self.p.min():.4g} to {self.p.max():.4g} N"
        return (
            f"Equilibrium of {blocks}: F_T = {self.F_T:.6g} N, {p}, {int(self.open.sum())} open, "
            f"drive = {self.drive:.6g} m, residual {self.residual:.2g} N"
        )

    def state(self, scene: Scene, dt: float, t0: float = 0.0) -> State:
        """Return the initial state of a run from this static state, at rest and without slip.

        Args:
            scene: the scene.
            dt: time step, in s.
            t0: time, in s.
        """
        N_x, N_z = scene.N_x, scene.N_z
        y = np.zeros((N_z, 4, N_x))
        y[:, :2] = self.u
        rod = np.zeros(6)
        if scene.rigid:
            rod[:3] = self.rod
            y[-1, 0] = rod[0]
            y[-1, 1] = rod[1] + rod[2] * scene.x
        margin, memory = scene.law.begin(float(t0), y[0, 0], self.p, self.f, scene.d)
        return State(
            y=y,
            rod=rod,
            mode=np.where(self.open | scene.bare, OPEN, STUCK).astype(np.int32),
            corner=np.zeros(N_x, dtype=np.int32),
            margin=margin,
            memory=memory,
            loss=np.zeros(N_x),
            dissipated=np.zeros(N_z),
            heat=np.zeros(N_x),
            work=np.zeros(2),
            step=0,
            t0=float(t0),
            dt=float(dt),
            u_drv0=copy.copy(self.u_drv0),
            drive=scene.drive(float(t0)),
            spring=spring_of(scene),
        )


def check_rests(scene: Scene) -> None:
    """Raise SceneError for a scene whose only static state is its initial state.

    On a prescribed interface in two dimensions p does not follow from displacements, and only
    friction holds the slider.
    """
    if scene.prescribed:
        allowed = "'rod' or 'distributed', or a chain, for static states"
        reason = "a prescribed interface in two dimensions needs full dynamics"
        raise SceneError("top.kind", "prescribed", "", allowed, reason)
    if scene.top.push:
        reason = "a slider whose blocks are pushed needs full dynamics"
        raise SceneError("top.push", scene.top.push, "N", "none, for static states", reason)
    if scene.driver.K == 0:
        reason = "a chain without a driver needs full dynamics"
        raise SceneError("driver.K", 0.0, "N/m", "> 0 N/m, for static states", reason)


def check_sticks(scene: Scene) -> None:
    """Raise SceneError for a scene whose blocks do not come to rest between events."""
    engines = "'hybrid', 'dynamic' or 'auto'" if scene.law.flows else "'dynamic' or 'auto'"
    scene.resting_law(scene.law.restless, f"fidelity = {engines}, or another friction law")


def as_prescribed(scene: Scene) -> Equilibrium:
    """Return the initial state on a prescribed interface."""
    N_x = scene.N_x
    no, u = np.zeros(N_x, dtype=bool), np.zeros((scene.N_z, 2, N_x))
    return Equilibrium(
        u=u,
        rod=np.zeros(3),
        F_T=0.0,
        f=-scene.shear,
        tau=scene.d * scene.shear,
        p=scene.p_prescribed,
        open=no,
        slipped=no.copy(),
        drive=0.0,
        u_drv0=scene.u_driven(u),
        residual=0.0,
        iterations=0,
    )
