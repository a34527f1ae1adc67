"""Linear or finite geometry: how bond forces follow from displacements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

from pyfric.scene.units import SceneError

if TYPE_CHECKING:
    from pyfric.scene.scene import Scene

__all__ = ["Geometry", "check_geometry", "default_geometry"]

Geometry = Literal["linear", "finite"]
"""How bond forces follow from displacements."""


def check_geometry(geometry: str, scene: Scene | None = None) -> None:
    """Check that `geometry` is "linear" or "finite", and "linear" if the scene is a chain.

    Raises:
        SceneError: unknown geometry, or finite geometry for a chain.
    """
    if not isinstance(geometry, str) or geometry not in get_args(Geometry):
        raise SceneError("geometry", geometry, "", " or ".join(map(repr, get_args(Geometry))))
    if geometry == "finite" and scene is not None and scene.N_z == 1:
        raise SceneError("geometry", geometry, "", "'linear'", "a chain has linear geometry only")


def default_geometry(scene: Scene) -> Geometry:
    """Return "finite", as in the paper, or "linear" for a chain."""
    return "finite" if scene.N_z > 1 else "linear"
