"""Measurement of all claims, and of the runs that they need."""

from __future__ import annotations

import dataclasses
import os
import re
import time
from collections.abc import Callable, Iterable

from pyfric.display import jobs_bar
from pyfric.paper.claims import exact, fronts, lengths, stresses  # noqa: F401 they register claims
from pyfric.paper.claims.claim import CLAIMS, Claim, Runs
from pyfric.paper.runs import jobs
from pyfric.signals import at_once
from pyfric.sweeps import run_all, side_by_side
from pyfric.values import unknown

NUMBERS = tuple(sorted(CLAIMS, key=lambda number: (number[0] == "E", int(number.lstrip("E")))))
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
        numbers: claims of `NUMBERS`, or parts, such as "3a"; None means all.
        workers, cache: as in `pyfric.run_all`.
        progress: as in `pyfric.run_all`; a claim counts like a run.

    Returns:
        The claims, in order. A claim with several parts gives one entry for each part.

    Raises:
        SceneError: there is no claim of a given number, or the claim has no such part.
        JobError: a run failed.
        KeyboardInterrupt: after Ctrl-C.
    """
    wanted = [_known(entry) for entry in (NUMBERS if numbers is None else numbers)]
    chosen = [number for number in NUMBERS if number in {known for known, _ in wanted}]
    names = list(dict.fromkeys(name for number in chosen for name in CLAIMS[number].runs))
    every, total = [jobs()[name] for name in names], len(names) + len(chosen)
    claims: list[Claim] = []
    with side_by_side(every, workers) as pool, jobs_bar(progress, total) as show:
        counted = lambda done, _: show(done, total)  # noqa: E731
        found = run_all(every, cache=cache, progress=counted, executor=pool)
        runs = dict(zip(names, found, strict=True))
        needed = [{name: runs[name] for name in CLAIMS[number].runs} for number in chosen]
        measured = pool.map(_measured, chosen, needed)
        for done, number in enumerate(chosen, len(names)):
            show(done, total)
            parts = {part for known, part in wanted if known == number}
            claims += _parts(number, parts, next(measured))
        show(total, total)
    return claims


def _measured(number: str, runs: Runs) -> list[Claim]:
    """Return the measured parts of a claim, with their processor time."""
    start = time.process_time()
    found = CLAIMS[number].tried(runs)
    seconds = sum(run.timings["processor"] for run in runs.values())
    seconds += time.process_time() - start
    return [dataclasses.replace(claim, seconds=seconds) for claim in found]


def _parts(number: str, letters: set[str], measured: list[Claim]) -> list[Claim]:
    """Return the parts of a claim with these letters, in order; "" means all."""
    parts = {claim.number.removeprefix(number): claim for claim in measured}
    for letter in letters - {"", *parts}:
        part, known = f"{number}{letter}", [number, *(f"{number}{part}" for part in parts)]
        raise unknown("number", part, part, known)
    return [parts[letter] for letter in sorted(parts) if letters & {"", letter}]


def _known(number: str | int) -> tuple[str, str]:
    """Return the number of a claim and the letter of its part, "" for all parts."""
    text = str(number).upper()
    whole = re.sub(r"(?<=\d)[A-Z]$", "", text)
    if whole not in CLAIMS:
        raise unknown("number", number, text, NUMBERS)
    return whole, text.removeprefix(whole).lower()
