"""All claims, measured together."""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable, Iterable

from pyfric.engines import run_all
from pyfric.paper.claims import exact, fronts, lengths, stresses
from pyfric.paper.claims.claim import Claim
from pyfric.paper.claims.runs import jobs
from pyfric.scene import SceneError, nearest

__all__ = ["NUMBERS", "ROWS", "measure"]

ROWS = lengths.ROWS | stresses.ROWS | fronts.ROWS | exact.ROWS
"""Number -> row."""
NUMBERS = tuple(sorted(ROWS, key=lambda number: (number[0] == "E", int(number.lstrip("E")))))
"""Numbers of the claims, in order."""


def measure(
    numbers: Iterable[str | int] | None = None,
    *,
    workers: int | None = None,
    cache: bool | str | os.PathLike[str] = True,
    progress: bool | Callable[[int, int], None] | None = None,
) -> list[Claim]:
    """Measure claims, with all the runs they need.

    Args:
        numbers: which claims, of `NUMBERS`; None means all.
        workers, cache, progress: as in `pyfric.run_all`.

    Returns:
        The claims, in order; a claim with several parts gives several.

    Raises:
        SceneError: there is no claim of that number.
        JobError: a run failed.
        KeyboardInterrupt: after Ctrl-C.
    """
    wanted = NUMBERS if numbers is None else [_known(number) for number in numbers]
    rows = {number: ROWS[number] for number in NUMBERS if number in wanted}
    names = list(dict.fromkeys(name for row in rows.values() for name in row.runs))
    found = run_all([jobs()[name] for name in names], workers, cache, progress)
    runs = dict(zip(names, found, strict=True))
    claims = []
    for row in rows.values():
        start = time.process_time()
        measured = row.measure(runs)
        seconds = time.process_time() - start
        seconds += sum(runs[name].timings["processor"] for name in row.runs)
        claims += [dataclasses.replace(claim, seconds=seconds) for claim in measured]
    return claims


def _known(number: str | int) -> str:
    text = str(number).upper()
    if text not in ROWS:
        allowed = f"1 to 16 or E1 to E10 (did you mean {nearest(text, NUMBERS)}?)"
        raise SceneError("number", number, "", allowed, "there is no such claim")
    return text
