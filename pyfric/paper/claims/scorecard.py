"""All claims, measured together."""

from __future__ import annotations

import dataclasses
import os
import re
import time
from collections.abc import Callable, Iterable

from pyfric.engines import jobs_bar
from pyfric.paper.claims import exact, fronts, lengths, stresses
from pyfric.paper.claims.claim import Claim, Runs
from pyfric.paper.claims.runs import jobs
from pyfric.scene import SceneError, nearest
from pyfric.signals import at_once
from pyfric.sweeps import run_all, side_by_side

__all__ = ["NUMBERS", "ROWS", "measure"]

ROWS = lengths.ROWS | stresses.ROWS | fronts.ROWS | exact.ROWS
"""Number -> row."""
NUMBERS = tuple(sorted(ROWS, key=lambda number: (number[0] == "E", int(number.lstrip("E")))))
"""Numbers of the claims, in order."""


@at_once()
def measure(
    numbers: Iterable[str | int] | None = None,
    *,
    workers: int | None = None,
    cache: bool | str | os.PathLike[str] = True,
    progress: bool | Callable[[int, int], None] | None = None,
) -> list[Claim]:
    """Measure claims, with all the runs they need.

    Args:
        numbers: which claims, of `NUMBERS`, or which parts, such as "3a"; None means all.
        workers, cache: as in `pyfric.run_all`.
        progress: the same, where a claim counts like a run.

    Returns:
        The claims, in order; a claim with several parts gives several.

    Raises:
        SceneError: there is no claim of that number, or no such part of it.
        JobError: a run failed.
        KeyboardInterrupt: after Ctrl-C.
    """
    wanted = dict.fromkeys(map(_known, NUMBERS if numbers is None else numbers))
    rows = {number: ROWS[number] for number in NUMBERS if number in {one for one, _ in wanted}}
    names = list(dict.fromkeys(name for row in rows.values() for name in row.runs))
    every, total = [jobs()[name] for name in names], len(names) + len(rows)
    claims: list[Claim] = []
    with side_by_side(every, workers) as pool, jobs_bar(progress, total) as show:
        counted = lambda done, _: show(done, total)  # noqa: E731
        found = run_all(every, cache=cache, progress=counted, executor=pool)
        runs = dict(zip(names, found, strict=True))
        needed = [{name: runs[name] for name in row.runs} for row in rows.values()]
        measured = pool.map(_measured, rows, needed)
        for done, number in enumerate(rows, len(names)):
            show(done, total)
            parts = [part for one, part in wanted if one == number]
            claims += _chosen(number, parts, next(measured))
        show(total, total)
    return claims


def _measured(number: str, runs: Runs) -> list[Claim]:
    """Return the parts of a claim, measured."""
    start = time.process_time()
    found = ROWS[number].measured(number, runs)
    seconds = time.process_time() - start
    seconds += sum(run.timings["processor"] for run in runs.values())
    return [dataclasses.replace(claim, seconds=seconds) for claim in found]


def _chosen(number: str, parts: list[str], measured: list[Claim]) -> list[Claim]:
    """Return these parts of a claim; "" means all."""
    known = {claim.number for claim in measured}
    for part in parts:
        if part and f"{number}{part}" not in known:
            allowed = f"{number}, or one of its parts: {', '.join(sorted(known))}"
            raise SceneError("number", f"{number}{part}", "", allowed, "no such part")
    return [
        claim for claim in measured if "" in parts or claim.number.removeprefix(number) in parts
    ]


def _known(number: str | int) -> tuple[str, str]:
    """Return the number of a claim and the letter of its part, "" for all parts."""
    text = str(number).upper()
    whole = re.sub(r"(?<=\d)[A-Z]$", "", text)
    if whole not in ROWS:
        guess = nearest(text, NUMBERS)
        hint = f", did you mean {guess}?" if guess else ""
        allowed = "1 to 16 or E1 to E10"
        raise SceneError("number", number, "", allowed, f"there is no such claim{hint}")
    return whole, text.removeprefix(whole).lower()
