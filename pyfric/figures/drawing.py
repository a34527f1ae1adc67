"""What notebooks show of an object."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pyfric.figures.lengths import growth
from pyfric.figures.loading import fig1b
from pyfric.figures.sketch import sketch
from pyfric.record import Record
from pyfric.scene import Scene
from pyfric.sweeps import Sweep

if TYPE_CHECKING:
    from pyfric.figures.style import DataFigure

__all__ = ["drawing"]


def drawing(shown: Any) -> DataFigure | None:
    """Return the loading curve of a record (of a prediction, length against force), a sketch of a
    scene; None for what has no drawing."""
    match shown:
        case Record():
            return (growth if "L_p_over_L" in shown.curve else fig1b)(shown)
        case Scene():
            return sketch(shown)
        case Sweep():
            return sketch(shown.scene)
    return None
