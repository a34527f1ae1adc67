"""Runs of cases by name; their verdicts, files, and page."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyfric.figures import save_figure, template
from pyfric.paper.cases.case import CASES, Case
from pyfric.paper.claims.claim import Claim, measured, report, table
from pyfric.record import provenance
from pyfric.scene import __version__
from pyfric.signals import at_once
from pyfric.sweeps import Job, run_all
from pyfric.values import unknown, write

if TYPE_CHECKING:
    from pyfric.figures import DataFigure
    from pyfric.record import Record

LIMIT = 180.0
"""Longest processor time of a case with its runs and damages, s."""


@dataclass(frozen=True)
class Result:
    """A case as measured.

    Attributes:
        case: the case.
        parts: the measured values, with bands and damages.
        figure: its figure.
        seconds: processor time of the case, its runs and damages included, s.
    """

    case: Case
    parts: Sequence[Claim]
    figure: DataFigure
    seconds: float

    @property
    def verdict(self) -> str:
        """ "holds" if all parts are in their bands."""
        return "holds" if all(part.holds for part in self.parts) else "misses"

    def as_dict(self) -> dict[str, Any]:
        """Return case, verdict and parts as plain values for JSON."""
        about = vars(self.case) | {"seen": dict(self.case.seen)}
        del about["find"]
        own = {"verdict": self.verdict, "seconds": round(self.seconds, 1)}
        return {"pyfric": __version__} | about | own | {"parts": table(self.parts)}

    def __str__(self) -> str:
        late = f", more than {LIMIT:g} s" if self.seconds > LIMIT else ""
        head = f"{self.case.name}: {self.case.title} ({self.seconds:.1f} s{late})"
        where = f"  {self.case.source}\n  target: a {self.case.target}"
        return f"{head}\n{where}\n{report(self.parts)}"

    def save(self, folder: str | os.PathLike[str], command: str) -> list[Path]:
        """Write figure, provenance and, last, NAME.json into a folder; return the paths.

        Raises:
            OSError: a file cannot be written.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        name = self.case.name
        paths = save_figure(self.figure, folder / name)
        paths.append(provenance(folder / f"{name}_provenance.toml", command))
        text = json.dumps(self.as_dict(), indent=2, allow_nan=False) + "\n"
        return [*paths, write(folder / f"{name}.json", text.encode())]


def run(
    names: Iterable[str] = (),
    *,
    workers: int | None = None,
    cache: bool | str | os.PathLike[str] = True,
    progress: bool | Callable[[int, int], None] | None = None,
) -> Iterator[Result]:
    """Run cases, one after the other, and yield the result of each.

    Args:
        names: keys of `CASES`; none means all.
        workers, cache, progress: as in `pyfric.run_all`, for the runs of one case.

    Raises:
        SceneError: there is no case of a given name, and nothing has been run.
        JobError: a run failed.
        KeyboardInterrupt: after Ctrl-C.
    """
    chosen = list(dict.fromkeys(names)) or list(CASES)
    for name in chosen:
        if name not in CASES:
            raise unknown("names", name, str(name), CASES)
    return (_result(CASES[name], workers, cache, progress) for name in chosen)


def _result(case: Case, workers: Any, cache: Any, progress: Any) -> Result:
    spent: list[float] = []

    def runner(jobs: Sequence[Job], /) -> list[Record]:
        begin = time.process_time()
        records = run_all(jobs, workers, cache, progress)
        processor = sum(record.timings["processor"] for record in records)
        spent.append(processor - (time.process_time() - begin))
        return records

    begin = time.process_time()
    with at_once():
        parts, figure = case.tried(runner)
    seconds = time.process_time() - begin + sum(spent)
    parts = [replace(part, seconds=round(seconds, 1)) for part in parts]
    return Result(case, parts, figure, seconds)


def write_page(folder: str | os.PathLike[str]) -> Path:
    """Write index.html from the cases in a folder, misses first, and return its path.

    Raises:
        OSError: a file cannot be read or written.
        ValueError: a file of a case is damaged.
    """
    folder = Path(folder)
    files = [folder / f"{name}.json" for name in CASES]
    found = [json.loads(path.read_text(encoding="utf-8")) for path in files if path.is_file()]
    for entry in found:
        for part in entry["parts"]:
            unit = part["unit"]
            part |= {name: measured(part[name], unit) for name in ("value", "damaged")}
        caption = folder / f"{entry['name']}.txt"
        entry["caption"] = caption.read_text(encoding="utf-8").strip() if caption.is_file() else ""
    found.sort(key=lambda entry: entry["verdict"] != "misses")
    missed = [entry["name"] for entry in found if entry["verdict"] == "misses"]
    page = template(__file__, "cases.html")
    text = page.render(version=__version__, cases=found, missed=missed)
    return write(folder / "index.html", text.encode())


def listed() -> str:
    """Return the names and titles of all cases, one case in each line."""
    width = max(map(len, CASES), default=0)
    return "\n".join(f"{name:<{width}}  {entry.title}" for name, entry in CASES.items())
