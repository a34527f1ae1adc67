"""A summary of a scene as text."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from pyfric.scene.checked import quantities

if TYPE_CHECKING:
    from pyfric.scene.scene import Scene


def scene_text(scene: Scene) -> str:
    """Return a text with a line for each part of a scene; numbers are in SI units."""
    lines = [f"Scene {scene.name or 'without a name'}: {scene.N_x} x {scene.N_z} blocks"]
    for name in ("slider", "top", "driver", "interface"):
        part = getattr(scene, name)
        units = {key: mark.unit for key, mark in quantities(type(part)).items()}
        values = {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
        entries = [
            f"{key} = {_short(value)} {units.get(key, '')}".rstrip()
            for key, value in values.items()
            if value is not None and value != ()
        ]
        lines.append(f"  {type(part).__name__}: {', '.join(entries)}")
    lines.insert(2, f"  Each block: {_block(scene)}")
    if scene.stop_when:
        lines.append(f"  ends when: {', or '.join(scene.stop_when)}")
    return "\n".join(lines)


def _block(scene: Scene) -> str:
    """Return mass, load and speeds of long waves, which follow from k; see `Material`."""
    c = scene.slider.l * math.sqrt(scene.slider.k / scene.m)
    waves = {"c": c} if scene.N_z == 1 else {"c_P": math.sqrt(1.5) * c, "c_S": math.sqrt(0.5) * c}
    speeds = [f"{name} = {speed:.6g} m/s" for name, speed in waves.items()]
    load = f"F_N/N_x = {scene.F_N / scene.N_x:.6g} N"
    return ", ".join([f"m = {scene.m:.6g} kg", load, *speeds])


def _short(value: Any) -> str:
    if isinstance(value, tuple):
        return f"{len(value)} values"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
