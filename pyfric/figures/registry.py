"""The paper's figures by name. A decorator enters the function that draws a figure."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

if TYPE_CHECKING:
    from pyfric.figures.style import DataFigure

__all__ = ["FIGURES", "PaperFigure", "figure"]

Draw = TypeVar("Draw", bound=Callable[..., Any])


class PaperFigure(NamedTuple):
    """A figure of the paper.

    Attributes:
        title: its title.
        runs: name of what it is drawn from, a key of `pyfric.paper.RUNS`.
        draw: function of a record, or of a list of records if there are several runs.
        precursor: which main precursor of the first loading the paper shows, counted from 1; None
            for figures that are not of one event.
    """

    title: str
    runs: str
    draw: Callable[..., DataFigure]
    precursor: int | None = None


FIGURES: dict[str, PaperFigure] = {}
"""Name -> figure, in the order of the modules; `sorted` gives the paper's."""


def figure(title: str, *, runs: str, precursor: int | None = None) -> Callable[[Draw], Draw]:
    """Enter the function below as a figure of the paper, under its own name."""

    def enter(draw: Draw) -> Draw:
        FIGURES[draw.__name__] = PaperFigure(title, runs, draw, precursor)
        return draw

    return enter
