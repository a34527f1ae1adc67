"""Static states with a memory of earlier solutions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pyfric.statics import EquilibriumError, Static

if TYPE_CHECKING:
    import numpy as np

    from pyfric.statics import StaticSolver

__all__ = ["RememberedStates"]


class RememberedStates:
    """A `StaticSolver` that keeps its solutions, so that the same state is solved only once."""

    def __init__(self, solver: StaticSolver) -> None:
        self.finder = solver
        self.found: dict[tuple[Any, ...], Static | EquilibriumError] = {}

    def solve(
        self,
        u_x_bottom: np.ndarray,
        drive: float,
        *,
        free: np.ndarray,
        load: tuple[float, float] | None = None,
    ) -> Static:
        key = u_x_bottom.tobytes(), float(drive), free.tobytes(), load
        if key not in self.found:
            try:
                rest = self.finder.solve(u_x_bottom, drive, free=free, load=load)
                self.found[key] = Static(rest.F_T, rest.tau, rest.p)
            except EquilibriumError as error:
                self.found[key] = error
        found = self.found[key]
        if isinstance(found, EquilibriumError):
            raise found
        return found
