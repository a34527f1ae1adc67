"""A case: a published result, its measured values, and damages for which the case must miss."""

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
    """Function that makes runs: `pyfric.run_all` with its other arguments given."""

    def __call__(self, jobs: Sequence[Job], /) -> list[Record]: ...


class Found(NamedTuple):
    """The result of a case.

    Attributes:
        parts: the measured values. Damages of parts are other keywords of the case
            (`damage.given`).
        draw: function that draws the figure.
    """

    parts: Sequence[Claim]
    draw: Callable[[], DataFigure]


Find = Callable[..., Found]
"""Function of a `Runner` that measures a case. Its keywords have defaults, which damages change."""


@dataclass(frozen=True)
class Case:
    """A published result.

    Attributes:
        name: name of the case and of its function.
        title: the published result, in short.
        source: authors, journal, DOI.
        target: "number", or "trend" if the source gives only a direction, or numbers for another
            system.
        seen: parameter -> its place in the source, or the reason for its value.
        find: function that measures the result.
    """

    name: str
    title: str
    source: str
    target: Literal["number", "trend"]
    seen: Mapping[str, str]
    find: Find

    def tried(self, run: Runner) -> tuple[list[Claim], DataFigure]:
        """Return the measured parts, with their values in changed scenes, and the figure.

        Raises:
            ValueError: for a part, no change is given that must move it out of its band.
        """
        found = self.find(run)

        def parts(_: Any, **given: Any) -> Iterator[Claim]:
            yield from (self.find(run, **given) if given else found).parts

        return Measured((), parts).tried({}), found.draw()


CASES: dict[str, Case] = {}
"""Name of a case -> the case."""


def case(
    title: str, source: str, target: Literal["number", "trend"], seen: Mapping[str, str]
) -> Callable[[Find], Find]:
    """Register the decorated function as a case, under its own name; see `Case` for arguments."""

    def enter(find: Find) -> Find:
        name = find.__name__
        CASES[name] = Case(name, title, source, target, seen, find)
        return find

    return enter
