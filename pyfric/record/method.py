"""How a scene was run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from pyfric.record.catalogue import T_GAP

SWITCH = {
    "located": "stick-slip transitions located within time steps",
    "step_end": "stick-slip transitions at step ends, as in the paper",
}


@dataclass(frozen=True, kw_only=True)
class Method:
    """How a scene was run.

    ``rtol`` is the largest error of an adaptive sub-step, None for other steppers. ``dt`` (s) is
    None for engines without a fixed step; ``sample`` is the number of steps between
    two points of the curve; ``t_gap`` (s) is the longest pause inside an event; ``budget`` says
    whether the energy budget was kept; ``accuracy`` (over F_N) is that of jumps, None without them.
    """

    engine: str
    geometry: str
    stepper: str = ""
    switching: str = ""
    rtol: float | None = None
    dt: float | None = None
    sample: int = 0
    t_gap: float = T_GAP
    threads: int = 1
    variant: str = ""
    budget: bool = False
    accuracy: float | None = None

    __pydantic_config__: ClassVar[Any] = {"extra": "forbid"}  # of files

    def __str__(self) -> str:
        """Engine, geometry, stepper, step and where contacts switch, in words."""
        words = [f"{self.engine} engine", f"{self.geometry} geometry"]
        if self.stepper:
            words.append(self.stepper)
        if self.dt is not None:
            words.append(f"dt = {self.dt * 1e6:g} us")
        if self.switching:
            words.append(SWITCH.get(self.switching, self.switching))
        return ", ".join(words)
