"""Pictures and pages of objects, for notebooks and browsers.

The page of a record, `Record.to_html`, is one file that loads no other file. ``view.html`` is its
template, and ``view.js`` handles mouse and keys. This module computes the numbers on the page.
``head.html`` is the common beginning of all pages.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pyfric.figures.fitted import fit_page, tornado
from pyfric.figures.lengths import growth
from pyfric.figures.loading import (
    CURVE_BINS,
    KINDS,
    envelope,
    event_kinds,
    fig1b,
    slip_segments,
)
from pyfric.figures.phases import phase_map
from pyfric.figures.results import curve_figure, resolution_figure, sweep_figure
from pyfric.figures.sizes import sizes_drawn
from pyfric.figures.sketch import sketch
from pyfric.figures.style import DataFigure
from pyfric.fitting import Fit, Sensitivity
from pyfric.measured import Curve
from pyfric.record import GROUPS, Record, Sizes, held_in, main_blocks, summary
from pyfric.scene import Scene, as_scene
from pyfric.sweeps import PhaseDiagram, Resolution, Results, Sweep
from pyfric.values import usage

if TYPE_CHECKING:
    import jinja2

LARGEST = 2_000_000
"""Largest number of bytes of a page."""
SPARE = 20_000
"""Bytes reserved for parts of the page whose size is counted last."""
MOST_EVENTS = 3000
"""Largest number of events of a page. Events with the fewest blocks are left out."""


@usage('plot(); pyfric.figures.save_figure(record.plot(), "name") writes it')
def drawing(shown: Any) -> DataFigure | None:
    """Return the picture of an object; None if it has none.

    The picture of a record is its loading curve. The picture of a prediction is length against
    force.
    """
    match shown:
        case Record():
            return (growth if "L_p_over_L" in shown.curve else fig1b)(shown)
        case Sweep():
            return sketch(as_scene(shown.scene))
    return next((draw(shown) for kind, draw in DRAWN.items() if isinstance(shown, kind)), None)


DRAWN: Mapping[type, Callable[[Any], DataFigure]] = {
    Scene: sketch,
    Curve: curve_figure,
    Results: sweep_figure,
    PhaseDiagram: phase_map,
    Resolution: resolution_figure,
    Fit: fit_page,
    Sensitivity: tornado,
    Sizes: sizes_drawn,
}
"""Type of a result -> function that draws it."""


def record_page(record: Record) -> str:
    """Return a page about a record, as HTML of at most 2 MB that needs no other files.

    The page shows the loading curve, where the interface slips, and the method of the run. For a
    selected event the page shows when each block slips, and the stresses before and after. If there
    are too many events for the size of the page, a line names the events left out.
    """
    kept = np.argsort(-record.events["n_blocks"].to_numpy(), kind="stable")[:MOST_EVENTS] + 1
    rows = _event_rows(record, np.sort(kept))
    page = {
        "record": record,
        "found": summary(record, []),
        "scene_lines": repr(record.scene).splitlines(),
        "rows": rows,
        "kinds": {kind: (label, colour) for kind, (label, colour, *_) in KINDS.items()},
        "micro_blocks": main_blocks(record.scene.N_x),
        "left_out": len(record.events) - len(kept),
        "columns": [held_in("events")[name] for name in record.events],
        "holds": [what for group in GROUPS for what in held_in(group).values()],
    }
    data = {"events": rows, "details": {}} | _overview(record, kept)
    render = template(__file__, "view.html").render
    size = len(render(page, data=_json(data), without=len(kept)).encode())
    data["details"] = _details(record, kept, LARGEST - SPARE - size)
    return render(page, data=_json(data), without=len(kept) - len(data["details"]))


def _json(values: Any) -> str:
    """Return JSON that is safe inside a script element."""
    return json.dumps(values, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _overview(record: Record, kept: np.ndarray) -> dict[str, Any]:
    """Return the loading curve and the slipped regions."""
    t, F_T = (record.curve[name].to_numpy() for name in ("t", "F_T"))
    length = record.curve.get("L_p_over_L")
    if length is None:
        t, F_T = envelope(t, F_T, CURVE_BINS // 3)
    pieces = slip_segments(record)
    pieces = pieces[pieces["event"].isin(kept)]
    columns = ("t_s", "x_from", "x_to", "slipped")
    slip = {
        kind: [_rounded(group[name].astype(float), 7) for name in columns]
        for kind, group in pieces.groupby("kind")
    }
    friction = record.scene.law.mean
    return {
        "curve": {"t": _rounded(t, 7), "F": _rounded(F_T / record.scene.F_N, 5)},
        "growth": None if length is None else _rounded(length, 5),
        "slip": slip,
        "colours": {kind: colour for kind, (_, colour, *_) in KINDS.items()},
        "mu_s": friction.mu_s,
        "mu_k": friction.mu_k,
        "N_x": record.scene.N_x,
    }


def _event_rows(record: Record, kept: np.ndarray) -> list[dict[str, Any]]:
    """Return the entries of each event on the page, in order of time."""
    events, F_N = record.events.loc[kept], record.scene.F_N
    kinds = event_kinds(record)[kept - 1]
    return [
        {
            "event": int(event),
            "kind": str(kind),
            "kind_name": KINDS[kind][0].partition(",")[0],
            "precursor": bool(row["is_precursor"]),
            "t": _number(row["t_start"], 9),
            "duration": _number(row["duration"]),
            "start": _number(row["F_T_start"] / F_N),
            "arrest": _number(row["F_T_arrest"] / F_N),
            "L_p": _number(row["L_p_over_L"], 4),
            "blocks": int(row["n_blocks"]),
            "x_0": _number(row["x_nucleation"] / record.scene.slider.L, 4),
            "share": _number(row["share_X_c0"], 3),
        }
        for kind, (event, row) in zip(kinds, events.iterrows(), strict=True)
    ]


def _details(record: Record, kept: np.ndarray, room: int) -> dict[str, Any]:
    """Return stresses and slip of events, largest first, as many as fit into `room` bytes.

    Stresses are static tau and p over F_N/N_x from the trailing edge on.
    """
    order, unit = np.argsort(record.scene.n_of_i), record.scene.F_N / record.scene.N_x
    episodes = {event: rows for event, rows in record.episodes.groupby("event") if event}
    details = {}
    for event in map(int, kept):
        detail: dict[str, Any] = {
            name: _rounded(record.arrays[name][event - 1][order] / unit, 4)
            for name in ("tau_before", "p_before", "tau_after", "p_after")
        }
        detail["slips"] = _slips(record, event, episodes.get(event))
        detail["columns"] = _rounded(record.events.loc[event].astype(float))
        room -= len(_json(detail)) + len(str(event)) + 4
        if room < 0:
            break
        details[str(event)] = detail
    return details


def _slips(record: Record, event: int, episodes: pd.DataFrame | None) -> list[list[float | None]]:
    """Return episodes: block, begin and end (us) from the first slip, slip along the drive (nm)."""
    if episodes is None:
        return []
    t_0 = record.events["t_start"].loc[event]
    columns = (
        episodes["n"].to_numpy(float),
        np.round((episodes["t_start"] - t_0).to_numpy() * 1e6, 2),
        np.round((episodes["t_stop"] - t_0).to_numpy() * 1e6, 2),
        record.scene.d * episodes["slip"].to_numpy() * 1e9,
    )
    return [[_number(value) for value in row] for row in zip(*columns, strict=True)]


def _rounded(values: Iterable[float], digits: int = 6) -> list[float | None]:
    return [_number(value, digits) for value in values]


def _number(value: float, digits: int = 6) -> float | int | None:
    """Return a number with `digits` digits, as short as possible; None if it is unknown."""
    if not math.isfinite(value):
        return None
    short = float(f"{value:.{digits}g}")
    return int(short) if short.is_integer() else short


def template(beside: str, name: str) -> jinja2.Template:
    """Return the template of this name, in the folder of a file or of this module."""
    import jinja2  # slow to import

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([Path(beside).parent, Path(__file__).parent]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(name)
