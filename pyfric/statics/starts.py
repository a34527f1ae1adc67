"""Nucleation of ruptures at a chosen place, by forces on blocks (`push`), for any interface.

There are three ways: a patch stressed beyond its strength, a rupture forced to run at a given
speed, and a growing force on one block. Each function takes a scene and returns it with pushes. The
forces follow from the static state of the slider.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.scene import (
    PrescribedLoad,
    Push,
    Quantity,
    SceneError,
    as_scene,
    check_push,
    default_geometry,
)
from pyfric.statics.equilibrium import StaticSolver
from pyfric.statics.rest import EquilibriumError

if TYPE_CHECKING:
    from pyfric.scene import Scene, SceneLike

EXCESS = 0.05
"""Default stress of patches beyond their strength, over the strength."""


class AtRest:
    """Friction and strength of a slider before any push.

    Args:
        scene: the scene; its pushes are left out.
        solver: static solver of the scene; None makes one.
    """

    def __init__(self, scene: Scene, solver: StaticSolver | None = None) -> None:
        self.scene = scene.replace({"top.push": ()}) if scene.top.push else scene
        self.solver = solver or StaticSolver(self.scene, default_geometry(scene))

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Return friction along +x and strength at t (s), shape (N_x,), in N; None after slip."""
        found = None
        for one in (*(c for c in self.scene.corners if c < t), t):
            if (found := self._now(one)) is None:
                return None
        return found

    def _now(self, t: float) -> tuple[np.ndarray, np.ndarray] | None:
        scene, state = self.scene, self.solver.loaded
        drive, load = scene.drive(t), scene.load_at(t)
        moved = drive != 0 or load not in (None, scene.load_at(0.0))
        if moved and not scene.has_rests:
            return None
        if moved:
            try:
                state = self.solver.solve(state.u[0, 0], drive, free=state.open, load=load)
            except EquilibriumError:  # the load is far beyond the strength
                return None
        strength = np.where(state.open, 0.0, scene.law.hold(state.p))
        slips = ~state.open & (np.abs(state.f) > strength)
        return None if moved and slips.any() else (state.f, strength)


def check_pushes(scene: Scene, solver: StaticSolver) -> None:
    """Check that each push is large enough to make its block slip.

    A push is checked only if nothing slips before it begins.

    Args:
        scene: the scene.
        solver: static solver of the scene without its pushes.

    Raises:
        SceneError: a push does not make its block slip.
    """
    if not (scene.top.push and scene.law.rests) or isinstance(scene.top, PrescribedLoad):
        return  # those of a prescribed interface are checked with the scene
    rest = AtRest(scene, solver)
    known = {t: rest.at(t) for t in {one.begin for one in scene.top.push}}
    for one in scene.top.push:
        if known[one.begin] is not None:
            check_push(scene, one, *known[one.begin])


def _rest_at(scene: Scene, begin: float) -> tuple[np.ndarray, np.ndarray]:
    """Return shear force along the drive and strength at `begin` (s), in N.

    Both have shape (N_x,), ordered from the trailing edge.
    """
    if not scene.law.rests:
        reason = "blocks on junctions have no threshold"
        raise SceneError("interface.law", scene.interface.law.kind, "", "another law", reason)
    found = AtRest(scene).at(begin)
    if found is None:
        reason = "something slips before, or it is not known: there are no static states then"
        raise SceneError("begin", begin, "s", "an earlier time, or a driver at rest", reason)
    f, strength = found
    order = np.argsort(scene.n_of_i)
    return (-scene.d * f)[order], strength[order]


def _checked(name: str, value: Any, unit: str, **limits: float) -> float:
    try:
        return Quantity(unit, **limits).check(value)
    except SceneError as error:
        raise error.at(name) from None


def _patch(scene: Scene, x: float, length: float) -> list[int]:
    """Return the blocks of a patch, counted from 1 at the trailing edge."""
    l = scene.slider.l
    last = (scene.N_x - 1) * l
    if not x <= last * (1 + 1e-12):
        raise SceneError("x", x, "m", f"0 to {last!r} m", "outside the interface")
    most = length / 2 + 1e-9 * l
    blocks = [n for n in range(1, scene.N_x + 1) if abs((n - 1) * l - x) <= most]
    if not blocks:
        raise SceneError("length", length, "m", f"at least {l!r} m", "no block lies inside")
    return blocks


def overstressed(
    scene: SceneLike, *, x: Any, length: Any, excess: float = EXCESS, begin: Any = 0.0
) -> Scene:
    """Return a scene with a patch that is stressed beyond its strength, from `begin` on.

    Each block of the patch is pushed up to (1 + excess) mu_s p.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        x: centre of the patch from the trailing edge, in m.
        length: length of the patch, in m; it contains blocks up to length/2 from x.
        excess: stress beyond the strength, over the strength, > 0.
        begin: start time of the push, in s; nothing may slip before.

    Raises:
        SceneError: a value is refused.
    """
    scene = as_scene(scene)
    x, length = _checked("x", x, "m", ge=0.0), _checked("length", length, "m", ge=0.0)
    excess, begin = _checked("excess", excess, "", gt=0.0), _checked("begin", begin, "s", ge=0.0)
    stress, strength = _rest_at(scene, begin)
    pushes = [
        Push(n, (1 + excess) * strength[n - 1] - stress[n - 1], begin)
        for n in _patch(scene, x, length)
    ]
    return _pushed(scene, pushes)


def forced(
    scene: SceneLike,
    *,
    x: Any,
    length: Any,
    speed: Any,
    excess: float = EXCESS,
    begin: Any = 0.0,
) -> Scene:
    """Return a scene in which a rupture is forced to run from x in both directions.

    The block at a distance s from x is pushed to (1 + excess) mu_s p. The push starts at
    begin + s/speed and lasts l/speed, the time of a front to the next block. The rupture may run
    ahead of the forced fronts.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        x: starting point from the trailing edge, in m.
        length: length of the forced part, in m; it contains blocks up to length/2 from x.
        speed: speed of the two forced fronts, in m/s.
        excess: stress beyond the strength, over the strength, > 0.
        begin: start time, in s; nothing may slip before.

    Raises:
        SceneError: a value is refused.
    """
    scene = as_scene(scene)
    x, length = _checked("x", x, "m", ge=0.0), _checked("length", length, "m", ge=0.0)
    excess, begin = _checked("excess", excess, "", gt=0.0), _checked("begin", begin, "s", ge=0.0)
    speed = _checked("speed", speed, "m/s", gt=0.0)
    stress, strength = _rest_at(scene, begin)
    l, pushes = scene.slider.l, []
    for n in _patch(scene, x, length):
        steps = abs(n - 1 - x / l)
        steps = round(steps) if math.isclose(steps, round(steps), abs_tol=1e-9) else steps
        times = (begin + step * (l / speed) for step in (steps, steps + 1))
        force = (1 + excess) * strength[n - 1] - stress[n - 1]
        pushes.append(Push(n, force, *times))
    return _pushed(scene, pushes)


def ramped(scene: SceneLike, *, x: Any, rate: Any, begin: Any = 0.0) -> Scene:
    """Return a scene with a force on one block that grows without limit.

    If the slider is at rest, the block starts to slip at begin + (mu_s p - tau)/rate.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        x: distance from the trailing edge, in m; the push acts on the first block at or beyond it.
        rate: growth of the force, in N/s.
        begin: start time of the push, in s.

    Raises:
        SceneError: a value is refused.
    """
    scene = as_scene(scene)
    x, begin = _checked("x", x, "m", ge=0.0), _checked("begin", begin, "s", ge=0.0)
    rate = _checked("rate", rate, "N/s", gt=0.0)
    n = math.ceil(x / scene.slider.l * (1 - 1e-12)) + 1
    _patch(scene, x, 2 * scene.slider.l)
    return _pushed(scene, [Push(n, 0.0, begin, math.inf, rate)])


def _pushed(scene: Scene, pushes: list[Push]) -> Scene:
    """Return a scene with additional pushes."""
    plain = [Push(one.block, *map(float, one[1:])) for one in pushes]
    return scene.replace({"top.push": (*scene.top.push, *plain)})
