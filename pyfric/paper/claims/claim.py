"""A claim: a statement, its band, its value, and damages for which the claim must miss."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

from pyfric.display import plain
from pyfric.scene import __version__
from pyfric.values import write

if TYPE_CHECKING:
    from pyfric.record import Record

Runs = Mapping[str, "Record"]
Measure = Callable[..., "Iterator[Claim]"]
"""Function that yields the parts of a claim from its runs. Damages may replace its keywords."""


class Damage(NamedTuple):
    """A change of a claim's runs or measurement for which the claim must miss.

    Attributes:
        what: the change, in words.
        change: function that changes the runs.
        given: other keywords of the measurement.
    """

    what: str
    change: Callable[[Runs], Runs] = lambda runs: runs
    given: Mapping[str, Any] = {}


@dataclass(frozen=True)
class Band:
    """The range in which a value has to lie, ends included.

    Attributes:
        low, high: its ends; None means no end.
        source: origin of the band.
        unit: unit of the value, "" for a pure number; a unit that is a difference is in brackets.
    """

    low: float | None
    high: float | None
    source: str
    unit: str = ""

    def __str__(self) -> str:
        if self.low is None:
            return "any" if self.high is None else f"<= {self.high:.6g}"
        return f">= {self.low:.6g}" if self.high is None else f"{self.low:.6g} to {self.high:.6g}"

    def outside(self, value: float) -> float:
        """Return the distance of a value from the band: 0 inside, infinite for NaN."""
        if math.isnan(value):
            return math.inf
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        return float(max(low - value, value - high, 0.0))


@dataclass(frozen=True)
class Claim:
    """A measured claim, or part of a claim.

    Attributes:
        number: "1" to "16" or "E1" to "E10", with a letter where a claim has several parts.
        text: the claim in short.
        value: the measured value.
        band: band of the value.
        how: description of the measurement.
        damages: damages for which the claim must miss; empty after all have been tried.
        note: remarks, such as why the claim misses.
        damage: the tried damage whose value is nearest to the band.
        damaged: the value with this damage.
        seconds: processor time of the claim, its runs included (shared by its parts, and with
            other claims that need the same runs), s.
    """

    number: str
    text: str
    value: float
    band: Band
    how: str
    damages: Sequence[Damage] = ()
    note: str = ""
    damage: str = ""
    damaged: float | None = None
    seconds: float = 0.0

    @property
    def holds(self) -> bool:
        """Whether the value is in the band; NaN never is."""
        return self.band.outside(self.value) == 0

    @property
    def verdict(self) -> str:
        return "holds" if self.holds else "misses"

    def as_dict(self) -> dict[str, Any]:
        """Return the attributes of the claim and of its band, and the verdict."""
        own = vars(self) | vars(self.band) | {"band": str(self.band), "verdict": self.verdict}
        return {name: value for name, value in own.items() if name != "damages"}


class Measured(NamedTuple):
    """A claim before measurement: names of its runs, and the function that measures its parts."""

    runs: tuple[str, ...]
    measure: Measure

    def __call__(self, runs: Runs, **given: Any) -> list[Claim]:
        """Return the measured parts of the claim."""
        found = self.measure(runs, **given)
        return [replace(claim, value=float(claim.value)) for claim in found]

    def tried(self, runs: Runs) -> list[Claim]:
        """Return the measured parts, with their values in changed runs.

        Raises:
            ValueError: for a part, no change is given that must move it out of its band.
        """
        claims = self(runs)
        damages = {damage.what: damage for claim in claims for damage in claim.damages}
        values = {
            what: {claim.number: claim.value for claim in self(damage.change(runs), **damage.given)}
            for what, damage in damages.items()
        }
        tried = []
        for claim in claims:
            found = {damage.what: values[damage.what][claim.number] for damage in claim.damages}
            what = min(found, key=lambda what: claim.band.outside(found[what]))
            tried.append(replace(claim, damages=(), damage=what, damaged=found[what]))
        return tried


CLAIMS: dict[str, Measured] = {}
"""Number of a claim -> the claim, not yet measured."""


def claim(number: str, *runs: str) -> Callable[[Measure], Measure]:
    """Register the decorated function, which measures a claim from the named runs."""

    def enter(measure: Measure) -> Measure:
        CLAIMS[number] = Measured(runs, measure)
        return measure

    return enter


def measured(value: float | None, unit: str) -> str:
    """Return a value as text; None and NaN mean not measured.

    A unit that is a difference stands in brackets: 0.1 (mu_s - mu_k).
    """
    known = value is not None and not math.isnan(value)
    return f"{value:.4g} {unit}".rstrip() if known else "not measured"


def report(claims: Iterable[Claim]) -> str:
    """Return the table of the claims as text, with the processor time of each and its runs."""
    claims = list(claims)
    lines = []
    for claim in claims:
        value, damaged = (measured(x, claim.band.unit) for x in (claim.value, claim.damaged))
        lines.append(f"{claim.number:>4}  {claim.verdict:<6}  {claim.text} ({claim.seconds:.1f} s)")
        lines.append(f"      {value} (band {claim.band}): {claim.how}")
        if claim.damage:
            lines.append(f"      {claim.damage}: {damaged}")
        if claim.note:
            lines.append(f"      note: {claim.note}")
    missed = [claim.number for claim in claims if not claim.holds]
    misses = f"; misses: {', '.join(missed)}" if missed else ""
    return "\n".join([*lines, "", f"{len(claims) - len(missed)} of {len(claims)} hold{misses}"])


def save(claims: Iterable[Claim], folder: str | os.PathLike[str]) -> list[Path]:
    """Write claims.json and claims.csv into a folder, which is made if it is missing.

    Both files hold every attribute of the claims, with band and verdict, and every digit.

    Returns:
        The paths.

    Raises:
        OSError: a file cannot be written.
    """
    claims, folder = list(claims), Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    content = {"pyfric": __version__, "claims": table(claims)}
    files = {
        "claims.json": json.dumps(content, indent=2, allow_nan=False) + "\n",
        "claims.csv": pd.DataFrame([claim.as_dict() for claim in claims]).to_csv(index=False),
    }
    return [write(folder / name, text.encode()) for name, text in files.items()]


def table(claims: Iterable[Claim]) -> list[dict[str, Any]]:
    """Return the claims as plain dicts; None replaces numbers that are not finite."""
    return plain([claim.as_dict() for claim in claims])
