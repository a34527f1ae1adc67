"""Nucleation of ruptures at a chosen place, for any interface.

Three ways use forces on blocks (`push`): a patch stressed beyond its strength, a rupture forced to
run at a given speed, and a growing force on one block. The forces follow from the static state of
the slider. The fourth way is friction that is forced to fall (`limit`), on a patch or behind a
front. Each function returns the given scene with a start of a rupture.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.scene import PrescribedLoad, Push, as_scene, check_push, default_geometry
from pyfric.statics.equilibrium import StaticSolver
from pyfric.statics.rest import EquilibriumError
from pyfric.values import SceneError, check_number

if TYPE_CHECKING:
    from pyfric.scene import Scene, SceneLike

EXCESS = 0.05
"""Default excess of the stress of a patch over its strength, divided by the strength."""


def _at_rest(
    scene: Scene, t: float, solver: StaticSolver | None = None
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return friction along +x and strength before any push, at t (s), shape (N_x,), in N.

    None is returned if blocks slip before t. `solver` is the solver of the scene without its
    pushes.
    """
    scene = scene.replace({"top.push": ()}) if scene.top.push else scene
    solver = solver or StaticSolver(scene, default_geometry(scene))
    loaded = state = solver.loaded
    for time in (*(corner for corner in scene.corners if corner < t), t):
        drive, load = scene.drive(time), scene.load_at(time)
        moved = drive != 0 or load not in (None, scene.load_at(0.0))
        if moved and not scene.has_rests:
            return None
        if moved:
            try:
                state = solver.solve(loaded.u[0, 0], drive, free=loaded.open, load=load)
            except EquilibriumError:  # the load is far beyond the strength
                return None
        else:
            state = loaded
        strength = np.where(state.open, 0.0, scene.law.static.hold(state.p))
        if moved and (~state.open & (np.abs(state.f) > strength)).any():
            return None
    return state.f, strength


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
        return  # pushes on a prescribed interface are checked with the scene
    known = {t: _at_rest(scene, t, solver) for t in {push.begin for push in scene.top.push}}
    for push in scene.top.push:
        if known[push.begin] is not None:
            check_push(scene, push, *known[push.begin])


def _patch(scene: Scene, x: float, length: float) -> list[int]:
    """Return the numbers of the blocks of a patch, counted from 1 at the trailing edge."""
    l = scene.slider.l
    last = (scene.N_x - 1) * l
    if not x <= last * (1 + 1e-12):
        raise SceneError("x", x, "m", f"0 to {last!r} m", "outside the interface")
    reach = length / 2 + 1e-9 * l
    blocks = [n for n in range(1, scene.N_x + 1) if abs((n - 1) * l - x) <= reach]
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
        length: length of the patch, in m, which contains blocks up to length/2 from x.
        excess: stress beyond the strength, over the strength, > 0.
        begin: start time of the push, in s; nothing may slip before.

    Raises:
        SceneError: a value is refused.
    """
    return _stressed(scene, x, length, excess, begin)


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
        length: length of the forced part, in m, which contains blocks up to length/2 from x.
        speed: speed of the two forced fronts, in m/s.
        excess: stress beyond the strength, over the strength, > 0.
        begin: start time, in s; nothing may slip before.

    Raises:
        SceneError: a value is refused.
    """
    return _stressed(scene, x, length, excess, begin, check_number("speed", speed, "m/s", gt=0.0))


def _stressed(
    scene: SceneLike, x: Any, length: Any, excess: Any, begin: Any, speed: float | None = None
) -> Scene:
    """Return a scene with a patch stressed at once, or by two fronts of a speed (m/s) from x."""
    scene = as_scene(scene)
    x, length = check_number("x", x, "m", ge=0.0), check_number("length", length, "m", ge=0.0)
    excess = check_number("excess", excess, "", gt=0.0)
    begin = check_number("begin", begin, "s", ge=0.0)
    scene.resting_law("its blocks have no threshold")
    found = _at_rest(scene, begin)
    if found is None:
        reason = "something slips before, or it is not known: there are no static states then"
        raise SceneError("begin", begin, "s", "an earlier time, or a driver at rest", reason)
    needed, order = (1 + excess) * found[1] + scene.d * found[0], np.argsort(scene.n_of_i)
    l, pushes = scene.slider.l, []
    for n in _patch(scene, x, length):
        times = [begin]
        if speed is not None:
            steps = _steps_from(n, x, l)
            times = [begin + step * (l / speed) for step in (steps, steps + 1)]
        pushes.append(Push(n, needed[order[n - 1]], *times))
    return scene.replace({"top.push": (*scene.top.push, *pushes)})


def _steps_from(n: int, x: float, l: float) -> float:
    """Return the distance of block n from x (m), over l (m), rounded to an integer within 1e-9."""
    steps = abs(n - 1 - x / l)
    return round(steps) if math.isclose(steps, round(steps), abs_tol=1e-9) else steps


def weakened(
    scene: SceneLike,
    *,
    x: Any,
    length: Any,
    speed: Any = None,
    mu: Any = None,
    over: Any = 0.0,
    begin: Any = 0.0,
) -> Scene:
    """Return a scene whose friction is forced to fall, on a patch or behind two fronts from x.

    The friction coefficient of the block at a distance s from x is limited from the time
    begin + s/speed on. The limit falls linearly from the largest mu_s to mu over the time `over`
    (`Interface.limit`). Beyond the patch there is no limit, so that a rupture stops there, or runs
    on by itself.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        x: centre of the patch from the trailing edge, in m.
        length: length of the patch, in m, which contains blocks up to length/2 from x.
        speed: speed of the two fronts, in m/s; None means that the whole patch weakens at once.
        mu: final value of the limit, >= 0; None means the smallest mu_k.
        over: time in which the limit falls, in s; 0 means at once.
        begin: start time, in s.

    Raises:
        SceneError: a value is refused, or the scene has limits.

    Source: R. A. Harris et al., Seismol. Res. Lett. 89, 1146 (2018), for forced rupture.
    """
    scene = as_scene(scene)
    x, length = check_number("x", x, "m", ge=0.0), check_number("length", length, "m", ge=0.0)
    over, begin = check_number("over", over, "s", ge=0.0), check_number("begin", begin, "s", ge=0.0)
    speed = math.inf if speed is None else check_number("speed", speed, "m/s", gt=0.0)
    largest = float(scene.field("mu_s").max())
    mu = float(scene.field("mu_k").min()) if mu is None else check_number("mu", mu, "", ge=0.0)
    if mu > largest:
        raise SceneError("mu", mu, "", f"at most mu_s = {largest!r}", "limits nothing")
    if scene.interface.limit:
        raise SceneError("interface.limit", scene.interface.limit, "", "none", "given already")
    times, l = [math.inf] * scene.N_x, scene.slider.l
    for n in _patch(scene, x, length):
        times[n - 1] = begin + _steps_from(n, x, l) * (l / speed)
    limit = ((0.0, largest), (over, mu)) if over else ((0.0, mu),)
    return scene.replace({"interface.limit": limit, "interface.limit_from": times})


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
    x, begin = check_number("x", x, "m", ge=0.0), check_number("begin", begin, "s", ge=0.0)
    rate = check_number("rate", rate, "N/s", gt=0.0)
    n = math.ceil(x / scene.slider.l * (1 - 1e-12)) + 1
    _patch(scene, x, 2 * scene.slider.l)
    return scene.replace({"top.push": (*scene.top.push, Push(n, 0.0, begin, math.inf, rate))})
