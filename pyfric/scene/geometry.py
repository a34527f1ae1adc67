"""Linear or finite geometry: relation of bond forces to displacements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

from pyfric.scene.errors import SceneError

if TYPE_CHECKING:
    from pyfric.scene.scene import Scene

Geometry = Literal["linear", "finite"]
"""Relation of bond forces to displacements."""


def check_geometry(geometry: str, scene: Scene | None = None) -> None:
    """Check that `geometry` is "linear" or "finite", and "linear" if the load is prescribed.

    Raises:
        SceneError: unknown geometry, or finite geometry for a prescribed load.
    """
    if not isinstance(geometry, str) or geometry not in get_args(Geometry):
        raise SceneError("geometry", geometry, "", " or ".join(map(repr, get_args(Geometry))))
    if geometry == "finite" and scene is not None and default_geometry(scene) == "linear":
        what = "a chain" if scene.N_z == 1 else "a prescribed interface"
        raise SceneError("geometry", geometry, "", "'linear'", f"{what} has linear geometry only")


def default_geometry(scene: Scene) -> Geometry:
    """Return "finite", as in the paper, or "linear" for a prescribed load."""
    return "linear" if scene.N_z == 1 or scene.prescribed else "finite"
