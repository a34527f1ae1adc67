"""Notes on the friction law of a scene: values that a run does not reach or does not resolve."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pyfric.scene.parts import PrescribedLoad
from pyfric.scene.units import with_prefix

if TYPE_CHECKING:
    from pyfric.scene.scene import Scene

LEFT = 0.01
"""Remaining share of mu_s - mu_k at which friction counts as fallen."""


def resolving_step(scene: Scene) -> float:
    """Return the longest step (s) that resolves weakening: 1 over the growth rate of slip.

    The rate is that of `Law.growth`. Without weakening with slip or speed the step is inf.
    """
    law = scene.law
    if not law.weakens and law.tables.speed is None:
        return math.inf
    growth = law.growth(scene.F_N / scene.N_x, scene.m_interface)
    return float(1 / growth) if growth > 0 else math.inf


def law_notes(scene: Scene, t_end: float, dt: float | None = None) -> tuple[str, ...]:
    """Return notes on the law of a scene.

    If a table of mu falls over more slip than the displacement of the driver, mu_k is not reached.
    If it falls over more than a block, the unit of slip may be wrong. Steps that do not resolve
    weakening (`resolving_step`) have a note, too.

    Args:
        scene: the scene.
        t_end: end of the motion of the driver, in s.
        dt: step, in s; None for an engine without steps.
    """
    law, notes, slip = scene.law, [], 0.0
    if law.weakens:
        table = law.tables.slide
        fallen = np.append(np.flatnonzero(np.array(table.y) > LEFT) + 1, 0).max()
        slip, l = table.x[min(fallen, len(table.x) - 1)] * float(np.max(law.d_c)), scene.slider.l
        path = max(abs(x) for leg in scene.legs(t_end) for x in (leg.first, leg.last))
        falls = f"friction falls until a slip of {with_prefix(slip, 'm')}"
        driven = scene.driver.K and not isinstance(scene.top, PrescribedLoad)
        table_of_mu = scene.interface.law.ends() is not None
        if table_of_mu and driven and slip > path > 0:
            far = with_prefix(path, "m")
            notes.append(f"{falls}, but the driver moves only {far}: mu_k is not reached")
        elif table_of_mu and slip > l:
            notes.append(f"{falls}, more than the block size l = {with_prefix(l, 'm')}")
    resolves = resolving_step(scene)
    if dt is not None and dt > resolves:
        steepness = law.steepness(scene.F_N / scene.N_x)
        by_slip = law.weakens and steepness > 0.25 / resolves**2 * scene.m_interface
        over = f"over {with_prefix(slip, 'm')} of slip" if by_slip else "with speed"
        notes.append(
            f"steps of {dt:.3g} s do not resolve weakening {over}: friction drops at once. "
            f"Resolving it needs dt <= {resolves:.3g} s"
        )
    return tuple(notes)
