"""Starts of ruptures at a chosen place, by forces on blocks (`push`), for any interface.

Three ways to nucleate: a patch stressed beyond its strength, a rupture that is forced to run at a
given speed, and a force on one block that grows. Each takes a scene and returns it with its
pushes; what they need is read off the slider at rest.
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

__all__ = ["check_pushes", "forced", "overstressed", "ramped"]

EXCESS = 0.05
"""What patches are stressed beyond their strength, over the strength, where it is not given."""


class AtRest:
    """A slider that nothing has pushed yet: what friction holds, and what it could hold.

    Args:
        scene: the scene; pushes are left out.
        solver: its static solver; None makes one.
    """

    def __init__(self, scene: Scene, solver: StaticSolver | None = None) -> None:
        self.scene = scene.replace({"top.push": ()}) if scene.top.push else scene
        self.solver = solver or StaticSolver(self.scene, default_geometry(scene))

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Return friction along +x and strength at t (s), left to right, N; None after slip."""
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
            except EquilibriumError:  # far beyond what friction holds
                return None
        strength = np.where(state.open, 0.0, scene.law.hold(state.p))
        slips = ~state.open & (np.abs(state.f) > strength)
        return None if moved and slips.any() else (state.f, strength)


def check_pushes(scene: Scene, solver: StaticSolver) -> None:
    """Check that each push lets its block slip, where nothing slips before it begins.

    Args:
        scene: the scene.
        solver: static solver of the scene without its pushes.

    Raises:
        SceneError: one does not.
    """
    if not (scene.top.push and scene.law.rests) or isinstance(scene.top, PrescribedLoad):
        return  # those of a prescribed interface are checked with the scene
    rest = AtRest(scene, solver)
    known = {t: rest.at(t) for t in {one.begin for one in scene.top.push}}
    for one in scene.top.push:
        if known[one.begin] is not None:
            check_push(scene, one, *known[one.begin])


def _rest_at(scene: Scene, begin: float) -> tuple[np.ndarray, np.ndarray]:
    """Return shear stress along the driving and strength at a time, from the trailing edge, N."""
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
    """Return a scene with a patch that is stressed beyond its strength, for ever.

    Each block of it is pushed up to (1 + excess) mu_s p.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        x: centre of the patch from the trailing edge, m.
        length: of the patch, m: blocks up to length/2 from x.
        excess: stress beyond the strength, over the strength, > 0.
        begin: when, s; nothing may slip before.

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
    """Return a scene in which a rupture is forced to run from a place, both ways.

    The block at a distance s from x is pushed from begin + s/speed on, for the l/speed that it
    takes to the next one, to (1 + excess) mu_s p. A rupture may run ahead of that by itself.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        x: where it starts, from the trailing edge, m.
        length: of what is forced, m: blocks up to length/2 from x.
        speed: of the two fronts, m/s.
        excess: stress beyond the strength, over the strength, > 0.
        begin: when it starts, s; nothing may slip before.

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
    """Return a scene with a force on one block that grows without end.

    Where the slider rests, the block starts to slip at begin + (mu_s p - tau)/rate.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        x: of the block, or the next one beyond, from the trailing edge, m.
        rate: N/s.
        begin: when, s.

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
    """Return a scene with further pushes."""
    plain = [Push(one.block, *map(float, one[1:])) for one in pushes]
    return scene.replace({"top.push": (*scene.top.push, *plain)})
