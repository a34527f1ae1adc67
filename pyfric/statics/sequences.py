"""Sequences of static states as the core follows them: slider, protocol and interfaces as arrays.

The core does what `Contact` and `pyfric.engines.quasistatic` do in Python, with the same changes in
the same order. `follows` returns whether the core can follow a scene.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from pyfric.core import CORNER_SHARE, CondensedSlider, CoreLeg, Interfaces, Rules
from pyfric.scene import CoulombLaw
from pyfric.statics.complementarity import CHANGES, LEAST, LOST, RATE_TOL
from pyfric.statics.contact import CONTACT_TOL, LEAST_DEFINITENESS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.scene import Scene
    from pyfric.statics.complementarity import Contact, ContactProblem
    from pyfric.statics.routes import Stretch


class Start(NamedTuple):
    """Start of a run: contact states and held positions (m), shape (N_x,), and the drive (m)."""

    scene: Scene
    mode: np.ndarray
    u_x: np.ndarray
    drive: float

    @classmethod
    def of(cls, contact: Contact) -> Self:
        """Return the start of a run from a state."""
        u_x = contact.column[: contact.N_x].copy()
        return cls(contact.scene, contact.mode.copy(), u_x, contact.drive)


def follows(scene: Scene) -> bool:
    """Return whether the core follows sequences of a scene: strength mu_s p, friction mu_k p."""
    return isinstance(scene.law, CoulombLaw)


def slider_of(problem: ContactProblem, parts: Sequence[Stretch]) -> CondensedSlider:
    """Return the slider for the core, with its loads along the routes of a protocol."""
    routes = [part.route for part in parts if part.route is not None]
    looks = [problem.along(route) for route in routes] or [problem]
    scene, of = problem.scene, problem.slider
    loads, F_T = zip(*(look.loads for look in looks), strict=True)
    return CondensedSlider(
        k=scene.slider.k,
        K=scene.driver.K,
        unit=problem.unit,
        rounded=CONTACT_TOL,
        least=LEAST * problem.unit,
        lost=LOST * problem.unit,
        S=np.ascontiguousarray(of.S),
        drive=np.ascontiguousarray(of.G[:, 0]),
        loads=np.array(loads),
        F_T=np.array(F_T),
    )


def legs_of(parts: Sequence[Stretch]) -> list[CoreLeg]:
    """Return the load segments of a protocol for the core.

    While loads are constant, segments begin at the loaded state of each run (`interfaces_of`), so
    that runs on different foundations share the segments.
    """
    found, routes = [], 0
    for leg, offset, route in parts:
        routes += route is not None
        numbers = leg.t, leg.t_end, leg.first, leg.last, leg.value, leg.slope
        at = (0.0, leg.way, 0) if route is None else (offset, leg.way, routes)
        found.append(CoreLeg(*numbers, *at))
    return found


def rules_of(scene: Scene, idle: int, growth: int) -> Rules:
    """Return the limits of a sequence for the core; the engine sets `idle` and `growth`."""
    p_corner = CORNER_SHARE * scene.F_N / scene.N_x
    return Rules(CHANGES, idle, growth, RATE_TOL, LEAST_DEFINITENESS, p_corner)


def interfaces_of(
    starts: Sequence[Start], parts: Sequence[Stretch], *, grow: bool = True
) -> Interfaces:
    """Return interfaces and states of runs for the core.

    Args:
        starts: start of each run, in its loaded state.
        parts: protocol of one of the runs.
        grow: whether slip grows continuously where friction falls little (`CoulombLaw.gradual`).
    """
    n, N_x = len(starts), starts[0].scene.N_x
    drive, shared = np.array([s.drive for s in starts]), any(part.route is None for part in parts)
    fields, kinds = np.empty((n, 4, N_x)), np.empty((n, N_x), dtype=np.int32)
    gradual = np.array([start.scene.law.static.gradual and grow for start in starts])
    for row, kind, start, grows in zip(fields, kinds, starts, gradual, strict=True):
        scene, law = start.scene, start.scene.law
        mu_k = law.mu_s if grows else law.mu_k
        for line, value in zip(row, (law.mu_s, mu_k, scene.k_f, scene.gap), strict=True):
            line[:] = value
        kind[:] = np.where(scene.touches, np.where(scene.bare, 1, 2), 0)
    return Interfaces(
        fields=fields,
        kinds=kinds,
        mode=np.array([start.mode for start in starts]),
        u_x=np.array([start.u_x for start in starts]),
        drive=drive,
        offset=drive if shared else 0.0 * drive,
        gradual=gradual,
    )
