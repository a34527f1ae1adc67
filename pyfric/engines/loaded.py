"""The loaded slider at rest, at which runs with time steps begin."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from contextvars import ContextVar
from typing import TYPE_CHECKING

from pyfric.engines.strains import folded, largest_strain
from pyfric.statics import EquilibriumError, StaticSolver, check_pushes
from pyfric.values import SceneError

if TYPE_CHECKING:
    from pyfric.scene import Geometry, OnDriven, Scene

FOLDING = 0.2
"""Strain of bonds above which a missing loaded state means that F_N is too large."""
_KEPT: ContextVar[dict[tuple[Scene, Geometry], StaticSolver] | None] = ContextVar(
    "kept", default=None
)


@contextlib.contextmanager
def shared_statics() -> Iterator[None]:
    """Let successive runs of one scene in one geometry share their static solver."""
    token = _KEPT.set({})
    try:
        yield
    finally:
        _KEPT.reset(token)


def loaded_solver(scene: Scene, geometry: Geometry, u_drv0: OnDriven | None) -> StaticSolver:
    """Return the static solver with the loaded slider, shared with an equal run just before."""
    kept = _KEPT.get()
    if kept is None or u_drv0 is not None:
        return _found(scene, geometry, u_drv0)
    if (scene, geometry) not in kept:
        kept.clear()
        kept[scene, geometry] = _found(scene, geometry, None)
    return kept[scene, geometry]


def _found(scene: Scene, geometry: Geometry, u_drv0: OnDriven | None) -> StaticSolver:
    """Return the static solver with the loaded slider.

    Raises:
        SceneError: the load folds the lattice (finite geometry), or pushes are refused.
        EquilibriumError: no loaded state was found, for any other reason.
    """
    strain, pushed = largest_strain(scene, 0.0, 0.0), scene
    scene = scene.replace({"top.push": ()}) if scene.top.push else scene
    allowed = (
        "a force that compresses bonds by less than their length, far below k l N_x = "
        f"{scene.slider.k * scene.slider.l * scene.N_x:.3g} N"
    )
    try:
        solver = StaticSolver(scene, geometry, u_drv0=u_drv0)
    except EquilibriumError as error:
        if geometry == "linear" or strain < FOLDING:
            raise
        raise SceneError("top.F_N", scene.F_N, "N", allowed, str(error)) from error
    at = folded(scene, solver.loaded.u) if geometry == "finite" else None
    if at is not None:
        reason = f"it folds the lattice at the block in column {at[0] + 1}, row {at[1] + 1}"
        raise SceneError("top.F_N", scene.F_N, "N", allowed, reason)
    if u_drv0 is None:
        check_pushes(pushed, solver)
    return solver
