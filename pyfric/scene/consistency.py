"""Checks of a scene that involve several of its parts."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np

from pyfric.scene.composed import Composed
from pyfric.scene.parts import CHAIN_NOTE, PrescribedLoad, steps_in
from pyfric.scene.profile import Profile
from pyfric.scene.protocol import Push
from pyfric.scene.spread import Spread
from pyfric.values import Annotation, SceneError, Words, annotations, naming

Geometry = Literal["linear", "finite"]
"""Relation of bond forces to displacements."""


def check(scene: Composed) -> None:
    """Check the conditions that involve several parts of a scene.

    Raises:
        SceneError: see `Scene`.
    """
    _check_fields(scene)
    _check_pushed(scene)
    _check_starts(scene)
    if scene.slider.edges == "half":
        _check_half(scene)
    if isinstance(scene.top, PrescribedLoad):
        _check_prescribed(scene)
    elif scene.N_z == 1:
        allowed = f"a multiple of l = {scene.slider.l!r} m, >= l{CHAIN_NOTE}"
        reason = f"too small where top.kind = {scene.top.kind!r}"
        raise SceneError("slider.H", scene.slider.H, "m", allowed, reason)
    if scene.N_z > 1:
        _check_height(scene)
        _check_T(scene)
    _check_absent(scene)


def _check_fields(scene: Composed) -> None:
    """Check the fields of the interface block by block."""
    law = scene.interface.law
    for name in scene.fields:
        owner = law if name in law.fields else scene.interface
        mark, given = annotations(type(owner))[name], getattr(owner, name)
        full_name = f"{owner._section}.{name}"
        _check_length(scene, full_name, given, mark)
        field = scene.field(name)
        low = ((field < 0) & (mark.ge is not None)) | ((field <= 0) & (mark.gt is not None))
        if isinstance(given, Spread | Profile) and low.any():
            n, value = int(scene.n_of_i[np.argmax(low)]), float(field[low][0])
            kind = type(given).__name__.lower()
            reason = f"the {kind} reaches this at block {n} from the trailing edge"
            raise SceneError(full_name, value, mark.unit, mark.allowed, reason)
    mark = annotations(type(scene.interface))["contact"]
    _check_length(scene, "interface.contact", scene.interface.contact, mark)
    if np.count_nonzero(scene.touches) < 2:
        reason = "nothing carries the slider"
        raise SceneError("interface.contact", False, "", "True for at least two blocks", reason)
    mu_s, mu_k = scene.field("mu_s"), scene.field("mu_k")
    above = mu_k > mu_s
    if above.any():
        i = int(np.argmax(above))
        allowed = f"0 <= mu_k <= mu_s = {float(mu_s[i])!r} there"
        reason = f"mu_k exceeds mu_s at block {scene.n_of_i[i]} from the trailing edge"
        raise SceneError("interface.mu_k", float(mu_k[i]), "", allowed, reason)


def _check_length(scene: Composed, name: str, given: Any, mark: Annotation) -> None:
    """Check that a list has one number for each block."""
    if isinstance(given, tuple) and len(given) != scene.N_x:
        allowed = mark.allowed.replace("N_x", str(scene.N_x))
        raise SceneError(name, given, mark.unit, allowed, f"{len(given)} numbers")


def _check_height(scene: Composed) -> None:
    """Check that driven blocks are above the bottom row, or on the top row for a driven top."""
    if scene.driver.side == "top":
        for name, given, allowed in (
            ("h", steps_in(scene.driver.h, scene.slider.l) == scene.N_z - 1, scene.slider.H),
            ("h_top", scene.driver.h_top is None, None),
        ):
            if not given:
                value, allowed = getattr(scene.driver, name), f"{allowed!r}" + " m" * bool(allowed)
                raise SceneError(f"driver.{name}", value, "m", allowed, "the top is driven")
        return
    l, H, lowest = scene.slider.l, scene.slider.H, 1
    for name, least, where in (
        ("h", "l", "not on a row that can be driven"),
        ("h_top", f"h = {scene.driver.h!r} m", "not on the driven side above h"),
    ):
        height = getattr(scene.driver, name)
        steps = lowest if height is None else steps_in(height, l)
        if steps is None or not lowest <= steps < scene.N_z:
            allowed = f"a multiple of l = {l!r} m, from {least} to H = {H!r} m"
            reason = "not on a row" if steps is None else where
            raise SceneError(f"driver.{name}", height, "m", allowed, reason)
        lowest = steps


def _check_prescribed(scene: Composed) -> None:
    """Check that prescribed forces fit the blocks, and that a chain does not slip at t = 0."""
    for name in ("p", "tau"):
        mark = annotations(PrescribedLoad)[name]
        _check_length(scene, f"top.{name}", getattr(scene.top, name), mark)
    if scene.law.rests:
        for push in scene.top.push:
            check_push(scene, push, -scene.shear, scene.law.static.hold(scene.p_prescribed))
    if scene.prescribed:  # blocks that carry more than mu_s p slip from t = 0 on
        return
    p, tau = np.atleast_1d(scene.top.p), np.atleast_1d(scene.top.tau)
    strength, tau = np.broadcast_arrays(scene.law.static.hold(p), tau)
    margin = strength - np.abs(tau)
    if (margin < 0).any():
        i = int(np.argmax(margin < 0))
        allowed = f"|tau| <= mu_s p = {float(strength[i])!r} N"
        reason = f"block {i + 1} from the trailing edge would slip"
        raise SceneError("top.tau", float(tau[i]), "N", allowed, reason)


def _check_T(scene: Composed) -> None:
    """Check that friction can hold a shear force on the top at t = 0."""
    strength = float(np.max(scene.field("mu_s"))) * scene.pressing
    if abs(scene.top.T) > strength:
        allowed = f"|T| <= mu_s F_N = {strength!r} N at t = 0"
        raise SceneError("top.T", scene.top.T, "N", allowed, "more than friction holds")


def _check_pushed(scene: Composed) -> None:
    """Check that pushes act on existing blocks with a force."""
    for push in scene.top.push:
        if not 1 <= push.block <= scene.N_x:
            allowed = f"blocks 1 to {scene.N_x}"
            raise SceneError("top.push", push.block, "", allowed, "outside the interface")
        if not (push.force or push.rate):
            raise SceneError("top.push", push.force, "N", "a force that is not 0", "pushes nothing")


def _check_starts(scene: Composed) -> None:
    """Check that the friction law can have the given initial slip and friction limits."""
    interface = scene.interface
    for name in ("slip", "limit"):
        given = getattr(interface, name)
        if not scene.law.rests and given not in (None, ()):
            reason = f"of a law whose blocks can rest, not of {interface.law.kind!r}"
            mark = annotations(type(interface))[name]
            raise SceneError(f"interface.{name}", given, mark.unit, "none", reason)
    if interface.slip_since == "start" and not scene.law.weakens:
        reason = "friction does not depend on slip: a law with d_c > 0, or a table over slip"
        raise SceneError("interface.slip_since", "start", "", "'stick'", reason)
    if interface.limit_from is not None and not interface.limit:
        raise SceneError("interface.limit", (), "", "breakpoints (t, mu)", "limit_from needs them")


def _check_half(scene: Composed) -> None:
    """Refuse forces that are given for each block if the slider has half blocks."""
    top, driver = scene.top, scene.driver
    for name, given, allowed, unit in (
        ("top.k_top", scene.k_top, 0.0, "N/m"),
        ("top.T_protocol", top.T_protocol, (), "N"),
        ("driver.side", driver.side == "top" and driver.side, "a side", ""),
        ("interface.law", scene.law.junctions and scene.interface.law.kind, "another law", ""),
    ):
        if given:
            reason = "slider.edges = 'half' does not divide it among whole and half blocks"
            raise SceneError(name, given, unit, repr(allowed), reason)


def check_push(scene: Composed, push: Push, f: np.ndarray, strength: np.ndarray) -> None:
    """Check that a push is large enough to make its block slip.

    Args:
        scene: the scene.
        push: a push of the scene.
        f: friction along +x on the blocks at rest, without pushes, shape (N_x,), in N.
        strength: strength of the blocks, shape (N_x,), in N.

    Raises:
        SceneError: the push is too small.
    """
    i = int(np.argmax(scene.n_of_i == push.block))
    others = scene.push_at(push.begin)[0, i] - scene.d * push.force
    ends = (push.begin, push.end) if push.rate else (push.begin,)
    pull = max(abs(f[i] - others - scene.d * push.at(t)) for t in ends)
    if not pull > strength[i]:
        more = float(strength[i] + scene.d * (f[i] - others))
        allowed = f"more than {more!r} N along the driving on block {push.block}"
        raise SceneError("top.push", push.force, "N", allowed, "does not let it slip")


def _check_absent(scene: Composed) -> None:
    """Refuse values that only scenes with another top or driver can have."""
    absent: dict[str, tuple[str, str]] = {}
    if scene.prescribed:
        absent["top.k_top"] = "0 N/m", "a chain has springs to a rigid top; here walls.top = 'held'"
        absent["top.V_top"] = "None, or 0 m/s", "a prescribed slab has no springs on its top"
        absent["interface.k_f"] = "None", "a prescribed interface has no foundation"
    else:
        for side in ("left", "right", "top"):
            reason = "walls need top.kind = 'prescribed' and at least two rows"
            absent[f"walls.{side}"] = "'free'", reason
    if isinstance(scene.top, PrescribedLoad):
        absent["interface.gap"] = "None", "p is prescribed"
        absent["interface.slip"] = "None", "displacements count from t = 0; give tau instead"
        absent["slider.g"] = "0 m/s^2", "p is prescribed"
        absent["interface.contact"] = "None", "p is prescribed; mu_s = 0 lets blocks move freely"
    if scene.N_z == 1:
        reason = "a chain is driven at its only row"
        absent |= {"driver.h": ("0 m", reason), "driver.h_top": ("None, or 0 m", reason)}
    if not scene.k_top and not scene.rigid:
        absent["top.V_top"] = "None, or 0 m/s", "only springs, top.k_top > 0, follow a plate"
    for name, (allowed, reason) in absent.items():
        part, _, field = name.partition(".")
        owner = getattr(scene, part)
        value, mark = getattr(owner, field), annotations(type(owner))[field]
        if not (value is None or (value == 0 and value is not False) or value == "free"):
            raise SceneError(name, value, mark.unit, allowed, reason)
    if scene.driver.K == 0 and scene.N_z > 1 and not scene.prescribed:
        reason = "only a prescribed interface, or a chain, goes without a driver"
        raise SceneError("driver.K", 0.0, "N/m", "> 0 N/m", reason)
    if scene.prescribed and scene.walls.top == "held" and scene.j_h_top == scene.N_z - 1:
        name = "h" if scene.driver.h_top is None else "h_top"
        highest = f"at most {(scene.N_z - 2) * scene.slider.l!r} m"
        value = getattr(scene.driver, name)
        raise SceneError(f"driver.{name}", value, "m", highest, "the top row is held")


def check_geometry(geometry: str, scene: Composed | None = None) -> None:
    """Check that `geometry` is "linear" or "finite", and possible in the scene.

    Raises:
        SceneError: unknown geometry, or finite geometry for a prescribed load or half blocks.
    """
    with naming("geometry"):
        Words(get_args(Geometry)).check(geometry)
    if geometry == "finite" and scene is not None and default_geometry(scene) == "linear":
        what = "a chain" if scene.N_z == 1 else "a prescribed interface"
        what = what if scene.N_z == 1 or scene.prescribed else "a slider with half blocks"
        raise SceneError("geometry", geometry, "", "'linear'", f"{what} has linear geometry only")


def default_geometry(scene: Composed) -> Geometry:
    """Return "finite", as in the paper, or "linear" for a prescribed load or half blocks."""
    half = scene.slider.edges == "half"
    return "linear" if half or scene.N_z == 1 or scene.prescribed else "finite"
