"""What a case is: a published result, what is measured of it, and what makes it miss."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

from pyfric.paper.claims.claim import Claim, Measured

if TYPE_CHECKING:
    from pyfric.figures import DataFigure
    from pyfric.record import Record
    from pyfric.sweeps import Job


class Runner(Protocol):
    """Makes runs, as `pyfric.run_all` does with its other arguments given."""

    def __call__(self, jobs: Sequence[Job], /) -> list[Record]: ...


class Found(NamedTuple):
    """What a case found.

    Attributes:
        parts: what was measured; their damages give other keywords of the case (`damage.given`).
        draw: draws the figure.
    """

    parts: Sequence[Claim]
    draw: Callable[[], DataFigure]


Find = Callable[..., Found]
"""Function of a `Runner`; its keywords, all with defaults, are what damages and tests change."""


@dataclass(frozen=True)
class Case:
    """A published result.

    Attributes:
        name: its name, that of the function.
        title: what was published, in short.
        source: authors, journal, DOI.
        target: "number", or "trend" where the source gives a direction only, or numbers of
            another system.
        seen: parameter -> where in the source it was seen, or why it was chosen.
        find: measures it.
    """

    name: str
    title: str
    source: str
    target: Literal["number", "trend"]
    seen: Mapping[str, str]
    find: Find

    def tried(self, run: Runner) -> tuple[list[Claim], DataFigure]:
        """Return the parts as measured, with their values when damaged, and the figure.

        Raises:
            ValueError: a part has no damage.
        """
        found = self.find(run)

        def parts(_: Any, **given: Any) -> Iterator[Claim]:
            yield from (self.find(run, **given) if given else found).parts

        return Measured((), parts).tried({}), found.draw()


CASES: dict[str, Case] = {}
"""Name -> case."""


def case(
    title: str, source: str, target: Literal["number", "trend"], seen: Mapping[str, str]
) -> Callable[[Find], Find]:
    """Enter the function below as a case, under its own name; see `Case` for the arguments."""

    def enter(find: Find) -> Find:
        name = find.__name__
        CASES[name] = Case(name, title, source, target, seen, find)
        return find

    return enter
