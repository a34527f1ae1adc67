"""The paper's figures in one folder: `reproduce` makes their runs, figures and page.

The page is made from the folder alone. The page shows figures and captions, their tables, the cost
of runs and, if ``claims.json`` exists (`pyfric claims`), the table of claims. ``page.html`` is its
template.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from markupsafe import Markup, escape

from pyfric.figures import FIGURES, event_movie, has_ffmpeg, save_figure, template
from pyfric.paper.claims.claim import measured
from pyfric.paper.runs import RUNS
from pyfric.record import precursor_lengths
from pyfric.scene import __version__
from pyfric.sweeps import Job, run_all, side_by_side
from pyfric.values import SceneError, unknown, write

if TYPE_CHECKING:
    from pyfric.record import Record

FILMED = "fig3a"
"""The figure whose event is filmed."""
FILMS = ("event.mp4", "event.gif")
"""Names of the film of an event. The page shows the first file that exists."""
FILM_TEXT = "event.txt"
CLAIM_VALUES = (
    *("number", "text", "value", "unit", "band", "verdict", "how", "note", "source"),
    *("damage", "damaged"),
)


def reproduce(
    names: Iterable[str] = (),
    out: str | os.PathLike[str] = "figures",
    *,
    workers: int | None = None,
    cache: bool | str | os.PathLike[str] = True,
    progress: bool | None = None,
) -> list[Path]:
    """Make the runs of the figures in parallel, and draw the figures.

    Args:
        names: figures, keys of `pyfric.figures.FIGURES`; none means all.
        out: folder of the files; made if missing.
        workers, cache, progress: see `pyfric.run_all`.

    Returns:
        The files: the index page and, for each figure, PNG, PDF, caption and tables (see
        `save_figure`). The table ``<figure>_runs.csv`` has the cost of its runs.

    Raises:
        SceneError: there is no figure of a given name.
        JobError: a run failed.
        OSError: a file cannot be written.
    """
    names = list(dict.fromkeys(names)) or sorted(FIGURES)
    for name in names:
        if name not in FIGURES:
            raise unknown("names", name, str(name), FIGURES)
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    jobs = {}
    for name in names:
        asked = RUNS[FIGURES[name].runs]
        jobs[name] = (asked,) if isinstance(asked, Job) else asked
    every = list(dict.fromkeys(job for name in names for job in jobs[name]))
    with side_by_side(every, workers) as pool:
        made = run_all(every, cache=cache, progress=progress, executor=pool)
        records = dict(zip(every, made, strict=True))
        made = []
        if FILMED in names:  # the film takes longest
            made.append(pool.submit(_film, records[jobs[FILMED][0]], out))
        for name in names:
            mine = [records[job] for job in jobs[name]]
            single = isinstance(RUNS[FIGURES[name].runs], Job)
            made.append(pool.submit(_drawn, name, jobs[name], mine, single, out))
        paths = [path for paths in made for path in paths.result()]
    return [*paths, write_index(out)]


def _drawn(
    name: str, jobs: Sequence[Job], records: Sequence[Record], single: bool, out: Path
) -> list[Path]:
    """Draw a figure from one record, or from all, and write its files."""
    fig = FIGURES[name].draw(records[0] if single else records, **_event(name, records[0]))
    fig.tables["runs"] = runs_table(jobs, records)
    return save_figure(fig, out / name)


def _event(name: str, record: Record) -> dict[str, int]:
    """Return the event that a figure of the paper shows, as a keyword; empty for other figures.

    Raises:
        SceneError: the record has too few main precursors.
    """
    number, found = FIGURES[name].precursor, precursor_lengths(record)["event"]
    if number is None:
        return {}
    if len(found) < number:
        allowed = f"at least {number} up to the first event over the whole interface"
        raise SceneError("main precursors", len(found), "", allowed, "too few: raise t_end")
    return {"event": int(found.iloc[number - 1])}


def _film(record: Record, out: Path) -> list[Path]:
    """Write the film of the event of Fig. 3(a), as MP4 if possible, and its caption."""
    (event,) = _event(FILMED, record).values()
    path = event_movie(record, event, out / FILMS[0 if has_ffmpeg() else 1])
    row, method = record.events.loc[event], record.method
    text = (
        f"Event {event} of the Fig. 1 run, shown in Figs. 3(a) and 4(a): first slip at "
        f"t = {row['t_start']:.6g} s, L_p/L = {row['L_p_over_L']:.3g}. It was run again with full "
        "dynamics from a state just before it. Above: velocity along the drive. Below: tau/p; "
        f"dots are blocks that slip. The run: {method}."
    )
    for other in set(FILMS) - {path.name}:
        (out / other).unlink(missing_ok=True)
    return [path, write(out / FILM_TEXT, f"{text}\n".encode())]


def runs_table(jobs: Sequence[Job], records: Sequence[Record]) -> pd.DataFrame:
    """Return a table of runs and their cost, one row for each run.

    Columns: scene; t_end_s; engine; geometry; dt_us (NaN without steps); events, all of the
    record; block_evaluations; seconds, processor time of the run with its plan and catalogue.
    """
    rows = [
        {
            "scene": job.scene.name,
            "t_end_s": job.t_end,
            "engine": record.method.engine,
            "geometry": record.method.geometry,
            "dt_us": float("nan") if record.method.dt is None else round(record.method.dt * 1e6, 9),
            "events": len(record.events),
            "block_evaluations": record.counts.get("block_evaluations", 0),
            "seconds": record.timings["processor"],
        }
        for job, record in zip(jobs, records, strict=True)
    ]
    return pd.DataFrame(rows)


# --- page ----------------------------------------------------------------------------------------


def write_index(folder: str | os.PathLike[str]) -> Path:
    """Write index.html from the files in the folder, and return its path.

    Raises:
        OSError: a file cannot be read or written.
    """
    folder = Path(folder)
    film = next((name for name in FILMS if (folder / name).is_file()), None)
    names = [name for name in sorted(FIGURES) if (folder / f"{name}.png").is_file()]
    claims = folder / "claims.json"
    found = _claims(claims) if claims.is_file() else None
    text = template(__file__, "page.html").render(
        version=__version__,
        film=film,
        film_text=mathematical((folder / FILM_TEXT).read_text(encoding="utf-8")) if film else "",
        figures=[_figure(folder, name) for name in names],
        has_claims=claims.is_file(),
        claims=found,
        missed=[claim["number"] for claim in found or () if claim["verdict"] == "misses"],
        runs=_runs(folder, names),
    )
    return write(folder / "index.html", text.encode())


def _figure(folder: Path, name: str) -> dict[str, Any]:
    """Return the entries of a figure on the page, and the names of its files."""
    caption = (folder / f"{name}.txt").read_text(encoding="utf-8").strip()
    what, _, details = caption.partition("\n")
    return {
        "name": name,
        "title": FIGURES[name].title,
        "caption": mathematical(what),
        "details": mathematical(details),
        "files": [f"{name}.pdf", *sorted(path.name for path in folder.glob(f"{name}_*.csv"))],
    }


SYMBOL = re.compile(
    r"\b(?P<letter>[FLNHVKXcdkluvtp]|mu|tau|theta|alpha|eta)_(?P<index>[A-Za-z]\w?|top|max|initial)\b"
    r"|\b(?P<greek>mu|tau|theta|alpha|eta)\b"
    r"|\b(?P<alone>[LHVKplh]|[xtkmRM](?= [=≤≥]|/[LHlp]\b))\b"
)
GREEK = {"mu": "μ", "tau": "τ", "theta": "θ", "alpha": "α", "eta": "η"}


def mathematical(text: str) -> Markup:
    """Return a text as HTML in which its symbols, such as mu_s and L_p, are MathML."""

    def math(found: re.Match[str]) -> str:
        letter, index = found["letter"] or found["greek"] or found["alone"], found["index"]
        shown = f"<mi>{GREEK.get(letter, letter)}</mi>"
        shown = f"<msub>{shown}<mi>{index}</mi></msub>" if index else shown
        return f"<math>{shown}</math>"

    text = text.replace("<=", "≤").replace(">=", "≥").replace(" - ", " − ")
    return Markup(SYMBOL.sub(math, str(escape(text))))


def _claims(path: Path) -> list[dict[str, Markup]] | None:
    """Return the claims that `pyfric claims` has written, misses first; None without a file."""
    try:
        claims = json.loads(path.read_text(encoding="utf-8"))["claims"]
        claims = sorted(claims, key=lambda claim: claim.get("verdict") != "misses")
        return [
            {name: mathematical(text) for name, text in _claim(claim).items()} for claim in claims
        ]
    except (ValueError, KeyError, TypeError, AttributeError):
        return None


def _claim(claim: dict[str, Any]) -> dict[str, str]:
    """Return the entries of a claim on the page; numbers have their units."""
    said = {name: str(claim.get(name) or "") for name in CLAIM_VALUES}
    numbers = {name: measured(claim.get(name), said["unit"]) for name in ("value", "damaged")}
    return said | numbers


def _runs(folder: Path, names: list[str]) -> list[dict[str, Any]]:
    """Return each run once, with the names of its figures."""
    tables = [pd.read_csv(folder / f"{name}_runs.csv").assign(figure=name) for name in names]
    if not tables:
        return []
    every = pd.concat(tables, ignore_index=True)
    which = [column for column in every if column != "figure"]
    found = every.groupby(which, dropna=False, sort=False)["figure"].agg(
        lambda of: ", ".join(of.unique())
    )
    return found.reset_index().to_dict("records")
