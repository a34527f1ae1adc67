"""The paper's figures in one folder, with a page that shows them.

`reproduce` runs what the figures need, draws them and writes ``index.html``. The page is made from
the folder alone: figures and captions, the tables behind them, what the runs cost, and, where
``claims.json`` is there (`pyfric claims`), the table of claims.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from pyfric import figures
from pyfric.engines import run_all
from pyfric.figures import DataFigure, save_figure
from pyfric.paper.runs import JOBS
from pyfric.scene import __version__, unknown, written

if TYPE_CHECKING:
    from pyfric.engines import Job
    from pyfric.record import Record

__all__ = ["DRAW", "reproduce", "write_index"]

DRAW: dict[str, Callable[[Sequence[Record]], DataFigure]] = {
    "fig1b": lambda records: figures.fig1b(*records),
    "fig2a": figures.fig2a,
    "fig2b": figures.fig2b,
    "fig3a": lambda records: figures.fig3a(*records),
    "fig3b": lambda records: figures.fig3b(*records),
    "fig4a": lambda records: figures.fig4a(*records),
    "fig4b": figures.fig4b,
}
"""Figure -> function of the records of its jobs (`pyfric.paper.runs.JOBS`)."""


def reproduce(
    names: Iterable[str] = (),
    out: str | os.PathLike[str] = "figures",
    *,
    workers: int | None = None,
    cache: bool | str | os.PathLike[str] = True,
    progress: bool | None = None,
    jobs: Mapping[str, Sequence[Job]] = JOBS,
) -> list[Path]:
    """Run what the figures need, side by side, and draw them.

    Args:
        names: figures, keys of `DRAW`; none means all.
        out: folder of the files; made if missing.
        workers, cache, progress: see `pyfric.run_all`.
        jobs: the runs of each figure.

    Returns:
        The files: for each figure PNG, PDF, caption and tables (see `save_figure`), among them
        ``<figure>_runs.csv`` with the cost of its runs; and the index page.

    Raises:
        SceneError: no such figure.
        JobError: a run failed.
        OSError: a file cannot be written.
    """
    names = list(dict.fromkeys(names)) or list(DRAW)
    for name in names:
        if name not in DRAW:
            raise unknown("names", name, str(name), DRAW)
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    wanted = [job for name in names for job in jobs[name]]
    records = iter(run_all(wanted, workers, cache, progress))
    paths = []
    for name in names:
        mine = [next(records) for _ in jobs[name]]
        fig = DRAW[name](mine)
        fig.tables["runs"] = runs_table(jobs[name], mine)
        paths += save_figure(fig, out / name)
    return [*paths, write_index(out)]


def runs_table(jobs: Sequence[Job], records: Sequence[Record]) -> pd.DataFrame:
    """What the runs were and cost: one row each.

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


# --- the page ------------------------------------------------------------------------------------

CSS = """
body { max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #222; background: #fff;
  font: 16px/1.5 system-ui, sans-serif; }
section { border-top: 1px solid #ccc; padding: 1rem 0; }
figure { display: flex; flex-wrap: wrap; gap: 1.5rem; margin: 0; align-items: flex-start; }
figure img { width: 34rem; max-width: 100%; height: auto; }
figcaption { flex: 1 1 20rem; font-size: 0.9rem; }
table { border-collapse: collapse; font-size: 0.85rem; }
div.wide { overflow-x: auto; }
th, td { text-align: left; vertical-align: top; padding: 0.2rem 0.8rem 0.2rem 0;
  border-bottom: 1px solid #ddd; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
tr.miss td { background: #fdf0e6; }
"""

TITLES = {
    "fig1b": "Fig. 1(b): loading curve and slipping regions",
    "fig2a": "Fig. 2(a): precursor length against force, setup 1",
    "fig2b": "Fig. 2(b): precursor length against force, setup 2",
    "fig3a": "Fig. 3(a): stresses before and after a precursor",
    "fig3b": "Fig. 3(b): normal force after precursors, and after sliding",
    "fig4a": "Fig. 4(a): front speed and prestress in one precursor",
    "fig4b": "Fig. 4(b): front speed against prestress, runs 1 to 4",
}


def write_index(folder: str | os.PathLike[str]) -> Path:
    """Write index.html from what the folder holds, and return its path.

    Raises:
        OSError: a file cannot be read or written.
    """
    folder = Path(folder)
    parts, there = [], [name for name in DRAW if (folder / f"{name}.png").is_file()]
    for name in there:
        parts.append(_figure(folder, name))
    claims = folder / "claims.json"
    if claims.is_file():
        parts.append(_claims(claims))
    runs = [folder / f"{name}_runs.csv" for name in there]
    tables = [(path.name.removesuffix("_runs.csv"), pd.read_csv(path)) for path in runs]
    if tables:
        parts.append(_cost(tables))
    path = folder / "index.html"
    with written(path) as draft:
        draft.write_text(_page(parts), encoding="utf-8")
    return path


def _page(parts: Iterable[str]) -> str:
    title = "Transition from static to kinetic friction in a 2D model"
    about = (
        "The figures of J. Trømborg, J. Scheibert, D. S. Amundsen, K. Thøgersen and "
        "A. Malthe-Sørenssen, Phys. Rev. Lett. 107, 074301 (2011), reproduced by pyfric "
        f"{escape(__version__)}. Each has its numbers beside it as CSV."
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width">\n'
        f"<title>{title}</title>\n<style>{CSS}</style>\n</head>\n<body>\n"
        f"<h1>{title}</h1>\n<p>{about}</p>\n{''.join(parts)}</body>\n</html>\n"
    )


def _figure(folder: Path, name: str) -> str:
    caption = (folder / f"{name}.txt").read_text(encoding="utf-8").strip()
    files = [f"{name}.pdf", *sorted(path.name for path in folder.glob(f"{name}_*.csv"))]
    links = ", ".join(f'<a href="{escape(one)}">{escape(one)}</a>' for one in files)
    title = escape(TITLES[name])
    return (
        f'<section id="{name}">\n<h2>{title}</h2>\n<figure>\n'
        f'<img src="{name}.png" alt="{title}">\n'
        f"<figcaption><p>{escape(caption)}</p>\n<p>{links}</p></figcaption>\n"
        "</figure>\n</section>\n"
    )


CLAIM_COLUMNS = ("number", "text", "value", "unit", "band", "verdict", "how", "source", "note")


def _claims(path: Path) -> str:
    """The claims as `pyfric claims` writes them; misses stand out."""
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))["claims"]
        body = [[_plain(row.get(column)) for column in CLAIM_COLUMNS] for row in rows]
        missed = ["miss" if row.get("verdict") == "misses" else "" for row in rows]
    except (ValueError, KeyError, TypeError, AttributeError):
        return f'<section id="claims">\n<p>{escape(path.name)} holds no claims.</p>\n</section>\n'
    holds = len(rows) - sum(map(bool, missed))
    return (
        '<section id="claims">\n<h2>What the paper says, measured</h2>\n'
        f"<p>{holds} of {len(rows)} claims hold, each in the band beside it.</p>\n"
        f"{_table(CLAIM_COLUMNS, body, missed)}</section>\n"
    )


def _cost(tables: Sequence[tuple[str, pd.DataFrame]]) -> str:
    runs = pd.concat([table.assign(figure=name) for name, table in tables], ignore_index=True)
    which = [column for column in runs if column != "figure"]
    grouped = runs.groupby(which, dropna=False, sort=False)["figure"]
    merged = grouped.agg(lambda names: ", ".join(dict.fromkeys(names))).reset_index()
    total = merged["seconds"].sum()
    head = ["scene", "figure", "to t (s)", "engine", "step (µs)", "events", "block evaluations",
            "processor time (s)"]  # fmt: skip
    body = [
        [
            row["scene"],
            row["figure"],
            f"{row['t_end_s']:.3g}",
            f"{row['engine']}, {row['geometry']}",
            "" if pd.isna(row["dt_us"]) else f"{row['dt_us']:.2g}",
            row["events"],
            f"{row['block_evaluations']:.2g}",
            f"{row['seconds']:.2f}",
        ]
        for _, row in merged.iterrows()
    ]
    text = f"{len(merged)} runs, {total:.1f} s of processor time in all when they were made."
    return (
        '<section id="cost">\n<h2>What the runs cost</h2>\n'
        f"<p>{text}</p>\n{_table(head, body)}</section>\n"
    )


def _table(head: Sequence[str], body: Sequence[Sequence[Any]], classes: Sequence[str] = ()) -> str:
    lines = ['<div class="wide"><table>', "<tr>"]
    lines += [f"<th>{escape(str(one))}</th>" for one in head]
    lines.append("</tr>")
    for n, row in enumerate(body):
        lines.append(f'<tr class="{classes[n]}">' if classes and classes[n] else "<tr>")
        for one in row:
            number = ' class="number"' if _is_number(one) else ""
            lines.append(f"<td{number}>{escape(str(one))}</td>")
        lines.append("</tr>")
    return "\n".join([*lines, "</table></div>\n"])


def _plain(value: Any) -> str:
    """A value of a JSON file as text."""
    if isinstance(value, float):
        return f"{value:.4g}"
    return "" if value is None else str(value)


def _is_number(value: Any) -> bool:
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True
