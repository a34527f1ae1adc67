"""Text of a scene, and notes on weakening that a run does not reach or does not resolve."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pyfric.scene.composed import Composed
from pyfric.scene.parts import PrescribedLoad
from pyfric.values import annotations, with_prefix

LEFT = 0.01
"""Share of mu_s - mu_k that remains where friction counts as fallen."""


def scene_text(scene: Composed) -> str:
    """Return a text with a line for each part of a scene; numbers are in SI units."""
    lines = [f"Scene {scene.name or 'without a name'}: {scene.N_x} x {scene.N_z} blocks"]
    for name in ("slider", "top", "driver", "interface"):
        part = getattr(scene, name)
        entries = [
            f"{key} = {_short(value)} {mark.unit}".rstrip()
            for key, mark in annotations(type(part)).items()
            if (value := getattr(part, key)) not in (None, ())
        ]
        lines.append(f"  {type(part).__name__}: {', '.join(entries)}")
    lines.insert(2, f"  Each block: {_block(scene)}")
    if scene.stop_when:
        lines.append(f"  ends when: {', or '.join(scene.stop_when)}")
    return "\n".join(lines)


def _block(scene: Composed) -> str:
    """Return a text with block mass, mean load and speeds of long waves; see `Material`."""
    c = scene.slider.l * math.sqrt(scene.slider.k / scene.m)
    waves = {"c": c} if scene.N_z == 1 else {"c_P": math.sqrt(1.5) * c, "c_S": math.sqrt(0.5) * c}
    speeds = [f"{name} = {speed:.6g} m/s" for name, speed in waves.items()]
    load = f"F_N/N_x = {scene.F_N / scene.N_x:.6g} N"
    return ", ".join([f"m = {scene.m:.6g} kg", load, *speeds])


def _short(value: Any) -> str:
    if isinstance(value, tuple):
        return f"{len(value)} values"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def law_notes(scene: Composed, t_end: float, dt: float | None = None) -> tuple[str, ...]:
    """Return notes on the law of a scene.

    If a table of mu falls over more slip than the displacement of the driver, mu_k is not reached.
    If mu falls over more slip than the size of a block, the unit of slip may be wrong. Steps that
    do not resolve weakening (`Law.resolving_step`) have a note, too.

    Args:
        scene: the scene.
        t_end: end of the motion of the driver, in s.
        dt: step, in s; None for an engine without steps.
    """
    law, notes, least = scene.law, [], 0.0
    if law.weakens:
        table = law.static.tables.slide
        fallen = np.append(np.flatnonzero(np.array(table.y) > LEFT) + 1, 0).max()
        d_c, far = np.atleast_1d(law.static.d_c), table.x[min(fallen, len(table.x) - 1)]
        slip, least, l = far * float(d_c.max()), far * float(d_c[d_c > 0].min()), scene.slider.l
        path = max(abs(x) for leg in scene.legs(t_end) for x in (leg.first, leg.last))
        falls = f"friction falls until a slip of {with_prefix(slip, 'm')}"
        driven = scene.driver.K and not isinstance(scene.top, PrescribedLoad)
        table_of_mu = scene.interface.law.ends() is not None
        if table_of_mu and driven and slip > path > 0:
            far = with_prefix(path, "m")
            notes.append(f"{falls}, but the driver moves only {far}: mu_k is not reached")
        elif table_of_mu and slip > l:
            notes.append(f"{falls}, more than the block size l = {with_prefix(l, 'm')}")
    if dt is not None and dt > (resolves := scene.resolving_step):
        steepness = law.static.steepness(scene.F_N / scene.N_x)
        by_slip = law.weakens and steepness > 0.25 / resolves**2 * scene.m_interface
        over = f"over {with_prefix(least, 'm')} of slip" if by_slip else "with speed"
        notes.append(
            f"steps of {dt:.3g} s do not resolve weakening {over}: friction drops at once. "
            f"Resolving it needs dt <= {resolves:.3g} s"
        )
    return tuple(notes)
