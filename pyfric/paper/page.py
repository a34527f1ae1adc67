"""The page that shows a folder of figures.

It is made from the folder alone: figures and captions, the tables behind them, what the runs cost,
and, where ``claims.json`` is there (`pyfric claims`), the table of claims. What it looks like is in
``page.html``.
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import pandas as pd
from markupsafe import Markup, escape

from pyfric.figures import FIGURES, template
from pyfric.scene import __version__, write

CLAIM_VALUES = (
    *("number", "text", "value", "unit", "band", "verdict", "how", "note", "source"),
    *("damage", "damaged"),
)
FILMS = ("event.mp4", "event.gif")
"""The film of an event, by the first of these names that is there."""
FILM_TEXT = "event.txt"


def write_index(folder: str | os.PathLike[str]) -> Path:
    """Write index.html from what the folder holds, and return its path.

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
        missed=[one["number"] for one in found or () if one["verdict"] == "misses"],
        runs=_runs(folder, names),
    )
    return write(folder / "index.html", text.encode())


def _figure(folder: Path, name: str) -> dict[str, Any]:
    """What the page says of a figure, and the files that lie beside it."""
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

    text = text.replace("<=", "≤").replace(">=", "≥")
    return Markup(SYMBOL.sub(math, str(escape(text))))


def _claims(path: Path) -> list[dict[str, Markup]] | None:
    """The claims as `pyfric claims` writes them, where they are; misses first."""
    try:
        claims = json.loads(path.read_text(encoding="utf-8"))["claims"]
        claims = sorted(claims, key=lambda claim: claim.get("verdict") != "misses")
        return [
            {name: mathematical(_plain(claim.get(name))) for name in CLAIM_VALUES}
            for claim in claims
        ]
    except (ValueError, KeyError, TypeError, AttributeError):
        return None


def _runs(folder: Path, names: list[str]) -> list[dict[str, Any]]:
    """Each run once, with the figures that it is for."""
    tables = [pd.read_csv(folder / f"{name}_runs.csv").assign(figure=name) for name in names]
    if not tables:
        return []
    every = pd.concat(tables, ignore_index=True)
    which = [column for column in every if column != "figure"]
    found = every.groupby(which, dropna=False, sort=False)["figure"].agg(
        lambda of: ", ".join(of.unique())
    )
    return found.reset_index().to_dict("records")


def _plain(value: Any) -> str:
    """A value of a JSON file as text."""
    if isinstance(value, float):
        return f"{value:.4g}"
    return "" if value is None else str(value)
