"""Friction laws and protocols that sequences of static states can follow.

While loads are constant, static states depend only on the position of the driver. While F_N or T
change, the speed of the driver must be constant, so that driver and loads follow a straight line
over time. When a load jumps, the driver stays at one position.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.scene import Leg, legs
from pyfric.statics.complementarity import Route
from pyfric.statics.rest import check_rests, check_sticks
from pyfric.values import SceneError

if TYPE_CHECKING:
    from pyfric.scene import Scene

SOFTEST = 0.05
"""Largest k over the steepest weakening slope for which the weakening may be left out. In the Fig.
1 scene, d_c = 50 nm gives 0.044; F_T at the starts of events then differs from F_T for d_c = 0 by
at most 8e-4 F_N. At 0.088 F_T differs by 0.01 F_N, and fronts stop at other blocks."""
ROUNDING = 1e-12
"""Changes of loads below this share of F_N count as rounding."""


class Stretch(NamedTuple):
    """A load segment (`Leg`), the driver's `offset` (m) at its start, and its route.

    The route is None if loads never change.
    """

    leg: Leg
    offset: float
    route: Route | None = None


def check_statics(scene: Scene) -> None:
    """Raise SceneError if static states cannot follow a scene."""
    if (error := bends(scene)) is not None:
        raise error
    check_rests(scene)
    check_sticks(scene)


def check_ladder(scene: Scene) -> None:
    """Raise SceneError if the quasi-static sequence cannot follow a scene."""
    check_statics(scene)
    if (error := beyond_ladder(scene)) is not None:
        raise error


def beyond_ladder(scene: Scene) -> SceneError | None:
    """Return the error if the quasi-static sequence cannot follow a scene, None if it can.

    In the sequence, slipping blocks have friction mu_k. Weakening over a slip length may be left
    out if it is so steep that no block slips stably while friction falls (`SOFTEST`).
    """
    law, instead = scene.law.static, "or fidelity = 'hybrid' or 'dynamic'"
    tables = law.tables
    if tables.hold or tables.speed or tables.age:
        reason = "the quasi-static sequence cannot follow friction that depends on time or speed"
        kind, allowed = scene.interface.law.kind, f"a law of slip alone, {instead}"
        return SceneError("interface.law", kind, "", allowed, reason)
    if np.any(law.alpha):
        reason, alpha = "the quasi-static sequence cannot follow viscosity", np.max(law.alpha)
        return SceneError("interface.alpha", float(alpha), "N s/m", f"0, {instead}", reason)
    if scene.interface.slip_since == "start":
        reason = "the quasi-static sequence knows slip at mu_k only"
        return SceneError("interface.slip_since", "start", "", f"'stick', {instead}", reason)
    load = float(np.max(scene.F_N / scene.N_x))
    if law.weakens and (soft := scene.slider.k / law.steepness(load)) > SOFTEST:
        reason = (
            "the quasi-static sequence knows slip at mu_k only, and friction falls too slowly for "
            f"it: k over its steepest fall is {soft:.3g}, more than {SOFTEST:g}"
        )
        allowed = f"a smaller d_c, {instead}"
        return SceneError("interface.d_c", scene.interface.d_c, "m", allowed, reason)
    return bends(scene)


def bends(scene: Scene) -> SceneError | None:
    """Return the error if speed and loads change together, or if friction changes with time."""
    if scene.interface.limit:
        allowed = "none, or fidelity = 'hybrid' or 'dynamic'"
        reason = "static states cannot follow limits of friction that change with time"
        return SceneError("interface.limit", scene.interface.limit, "", allowed, reason)
    for t in (0.0, *scene.corners):
        V, F_N, T = (scene.piece(what, t) for what in ("V", "F_N", "T"))
        if V.slope and (F_N.slope or T.slope):
            allowed = "0 m/s^2 while F_N or T change, or fidelity = 'hybrid' or 'dynamic'"
            reason = f"from {t:g} s on speed and load change, and static states go straight"
            return SceneError("driver.protocol", V.slope, "m/s^2", allowed, reason)
    return None


def stretches(scene: Scene, drive_0: float, t_end: float) -> list[Stretch]:
    """Return the load segments of a protocol up to t_end (s), which may be inf.

    Args:
        scene: the scene.
        drive_0: position of the driver at t = 0, in m.
        t_end: end, in s.
    """
    if scene.load_at(0.0) is None:
        return [Stretch(leg, drive_0) for leg in scene.legs(t_end)]
    found, K = [], scene.driver.K
    load = scene.F_N, scene.top.T
    times = sorted({0.0, *scene.corners})
    pieces = [  # V(t), cut at the breakpoints of all protocols
        piece._replace(t=t, value=piece.at(t), integral=piece.integral_at(t))
        for t, piece in zip(times, (scene.piece("V", t) for t in times), strict=True)
    ]
    for leg in legs(pieces, t_end):
        F_N, T = (scene.piece(what, leg.t) for what in ("F_N", "T"))
        now, gain = (F_N.at(leg.t), T.at(leg.t)), (F_N.slope, T.slope)
        jump = tuple(b - a for a, b in zip(load, now, strict=True))
        far, drive = max(map(abs, jump)) / K, drive_0 + scene.drive(leg.t)
        if far > ROUNDING * scene.F_N / K:
            at_once = Leg(leg.t, leg.t, 0.0, far, 1, float("inf"), 0.0)
            route = Route(drive, 0.0, load, tuple(change / far for change in jump))
            found.append(Stretch(at_once, 0.0, route))
        load = now
        if any(gain):
            pace = max(abs(leg.value), *(abs(slope) / K for slope in gain))
            whole = Leg(leg.t, leg.t_end, 0.0, pace * (leg.t_end - leg.t), 1, pace, 0.0)
            route = Route(drive, leg.value / pace, now, tuple(slope / pace for slope in gain))
            found.append(Stretch(whole, 0.0, route))
            load = F_N.at(leg.t_end), T.at(leg.t_end)
        else:
            found.append(Stretch(leg, drive_0, Route(0.0, 1.0, now)))
    return found
