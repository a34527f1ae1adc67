"""A claim as measured, tables and files of claims."""

from __future__ import annotations

import dataclasses
import io
import json
import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

from pyfric.scene import __version__, write

if TYPE_CHECKING:
    from pyfric.record import Record

__all__ = [
    "TENTH",
    "WORDS",
    "Claim",
    "Damage",
    "Row",
    "Runs",
    "damaged",
    "replaced",
    "report",
    "row",
    "save",
    "table",
]

WORDS = "the paper's words"
TENTH = "a tenth of mu_s - mu_k, our reading of 'about': the paper has no number"


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One claim, or a part of one, as measured.

    Attributes:
        number: "1" to "16" or "E1" to "E10", with a letter where a claim has several parts.
        text: the claim in short.
        value: what was measured.
        unit: its unit, "" for a pure number.
        low, high: the band; None where it has no end.
        how: how the value was measured.
        source: where the band comes from.
        note: what a reader has to know, such as why it misses.
        damage: what is done to its runs so that it has to miss; "" where that was not measured.
        damaged: the value then.
        seconds: processor time of the claim, its runs included (shared by its parts, and with
            other claims that need the same runs), s.
    """

    number: str
    text: str
    value: float
    unit: str = ""
    low: float | None = None
    high: float | None = None
    how: str
    source: str
    note: str = ""
    damage: str = ""
    damaged: float | None = None
    seconds: float = 0.0

    @property
    def holds(self) -> bool:
        """Whether the value is in the band, ends included; NaN never is."""
        return bool(self.outside == 0)

    @property
    def outside(self) -> float:
        """How far the value lies outside the band; infinite for NaN."""
        if math.isnan(self.value):
            return math.inf
        low = -math.inf if self.low is None else self.low
        high = math.inf if self.high is None else self.high
        return max(low - self.value, self.value - high, 0.0)

    @property
    def verdict(self) -> str:
        return "holds" if self.holds else "misses"

    @property
    def band(self) -> str:
        """The band as text."""
        if self.low is None and self.high is None:
            return "any"
        if self.low is None:
            return f"<= {self.high:.6g}"
        if self.high is None:
            return f">= {self.low:.6g}"
        return f"{self.low:.6g} to {self.high:.6g}"

    def as_dict(self) -> dict[str, Any]:
        """Attributes, with band and verdict."""
        return dataclasses.asdict(self) | {"band": self.band, "verdict": self.verdict}


Runs = Mapping[str, "Record"]
Measure = Callable[..., "list[Claim]"]
"""Measures claims from runs; some take what they rely on as keywords."""


class Damage(NamedTuple):
    """What is done to a claim so that it has to miss.

    `again` gets the function that measures the claim, and its runs, and measures it once more.
    """

    what: str
    again: Callable[[Measure, Runs], list[Claim]]


def damaged(what: str, change: Callable[[Runs], Runs]) -> Damage:
    """Return a damage that changes the runs of a claim."""
    return Damage(what, lambda measure, runs: measure(change(runs)))


def replaced(what: str, **given: Any) -> Damage:
    """Return a damage that replaces what a claim relies on, by keyword."""
    return Damage(what, lambda measure, runs: measure(runs, **given))


class Row(NamedTuple):
    """A claim: the names of its runs, the function that measures it, a damage for each part."""

    runs: tuple[str, ...]
    measure: Measure
    damage: Mapping[str, Damage]

    def measured(self, number: str, runs: Runs) -> list[Claim]:
        """Return the parts of the claim, each with its value when damaged.

        Raises:
            KeyError: a part has no damage.
        """
        claims = self.measure(runs)
        ways = (self.damage[claim.number[len(number) :]] for claim in claims)
        again = {
            what: {claim.number: claim.value for claim in one.again(self.measure, runs)}
            for what, one in {one.what: one for one in ways}.items()
        }
        found = []
        for claim in claims:
            what = self.damage[claim.number[len(number) :]].what
            value = again[what][claim.number]
            found.append(dataclasses.replace(claim, damage=what, damaged=value))
        return found


def row(
    rows: dict[str, Row], number: str, *runs: str, damage: Mapping[str, Damage]
) -> Callable[[Measure], Measure]:
    """Add the function below to the rows, under the number of its claim.

    Args:
        rows: where it is added.
        number: of the claim.
        runs: names of its runs.
        damage: letter of a part ("" for the only one) -> what makes it miss.
    """

    def add(function: Measure) -> Measure:
        rows[number] = Row(runs, function, damage)
        return function

    return add


def report(claims: Iterable[Claim]) -> str:
    """Return the table of the claims as text, with the processor time of each and its runs."""
    claims = list(claims)
    lines = []
    for claim in claims:
        value = f"{claim.value:.4g} {claim.unit}".strip()
        band = f"{claim.band} {claim.unit}".strip()
        lines.append(f"{claim.number:>4}  {claim.verdict:<6}  {claim.text} ({claim.seconds:.1f} s)")
        lines.append(f"      {value} (band {band}): {claim.how}")
        if claim.damage:
            lines.append(f"      {claim.damage}: {claim.damaged:.4g} {claim.unit}".rstrip())
        if claim.note:
            lines.append(f"      note: {claim.note}")
    missed = [claim.number for claim in claims if not claim.holds]
    lines.append("")
    lines.append(
        f"{len(claims) - len(missed)} of {len(claims)} hold"
        + (f"; misses: {', '.join(missed)}" if missed else "")
    )
    return "\n".join(lines)


def save(claims: Iterable[Claim], folder: str | os.PathLike[str]) -> list[Path]:
    """Write claims.json and claims.csv into a folder, which is made if it is missing.

    Both hold every attribute of the claims, with band and verdict, and every digit.

    Returns:
        The paths.

    Raises:
        OSError: a file cannot be written.
    """
    claims, folder = list(claims), Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    content = {"pyfric": __version__, "claims": table(claims)}
    text = io.StringIO()
    pd.DataFrame([claim.as_dict() for claim in claims]).to_csv(text, index=False)
    paths = [folder / "claims.json", folder / "claims.csv"]
    for path, full in zip(
        paths, (json.dumps(content, indent=2, allow_nan=False) + "\n", text.getvalue()), strict=True
    ):
        write(path, full.encode())
    return paths


def table(claims: Iterable[Claim]) -> list[dict[str, Any]]:
    """Return the claims as plain dicts; None stands for numbers that are not finite."""
    return [{name: _plain(value) for name, value in claim.as_dict().items()} for claim in claims]


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
