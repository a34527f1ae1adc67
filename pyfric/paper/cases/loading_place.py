"""V. Dawara and K. Viswanathan, 2024: rupture of pushed, pulled and sheared sliders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import pandas as pd

from pyfric.figures import BLACK, BLUE, VERMILION, DataFigure, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.scene import preset
from pyfric.sweeps import Job

if TYPE_CHECKING:
    from pyfric.record import Record

PLACES: Mapping[str, Mapping[str, Any]] = {
    "pushed": {"side": "left"},
    "pulled": {"side": "pull right"},
    "sheared": {"side": "top", "h": "20 mm"},
}
SPEEDS = {f"V = {V} mm/s": {"V": f"{V} mm/s"} for V in (0.45, 0.6, 0.8)}
T_END = 0.8
"""End of runs, after the first rupture of nine tenths of the blocks, s."""


@case(
    "Pushed, pulled or sheared: the place of the load decides how the interface breaks",
    "V. Dawara, K. Viswanathan (2024), arXiv:2403.02510",
    "trend",
    {
        "places": "pulled, pushed or sheared: distinct rupture modes (abstract)",
        "slider": "setup 2 of the paper of pyfric, l = 2 mm, Coulomb friction; the source has "
        "bonds that break and reform",
    },
)
def loading_place(
    run: Runner, *, places: Mapping[str, Mapping[str, Any]] = PLACES, l: float = 2e-3
) -> Found:
    """Measure ruptures of a slider loaded at different places."""
    how = {"fidelity": "hybrid", "geometry": "linear", "verify": "none"}
    records = run([Job(preset("setup2", at, l=l), T_END, how) for at in places.values()])
    found = dict(zip(places, records, strict=True))
    modes = {name: _mode(record) for name, record in found.items()}
    parts = [
        Claim(
            "loading_place",
            "trend: pushed, pulled and sheared sliders have distinct modes of rupture",
            len(set(modes.values())),
            Band(3, 3, "abstract: distinct modes"),
            "number of modes: where ruptures start (left, right, inside) and whether shorter ones "
            "come first; " + "; ".join(f"{name}: {mode}" for name, mode in modes.items()),
            [given("pushed at three speeds", places=SPEEDS)],
        ),
    ]
    return Found(parts, lambda: _drawn(found))


def _mode(record: Record) -> str:
    """Return where the first rupture of at least 8 blocks starts, and whether it is short."""
    scene, events = record.scene, record.events[record.events["n_blocks"] >= 8]
    if events.empty:
        return "none"
    x = (events["nucleation_block"].iloc[0] - 0.5) / scene.N_x
    x = x if scene.ahead > 0 else 1 - x
    place = "left" if x < 0.2 else "right" if x > 0.8 else "inside"
    short = events["n_blocks"].iloc[0] < scene.N_x / 2
    return f"{place}, {'short ones first' if short else 'at once'}"


def _drawn(records: Mapping[str, Record]) -> DataFigure:
    fig, axes = panels(3.6, [1] * len(records), sharex=True)
    tables = []
    for panel, (name, record), colour in zip(
        axes, records.items(), (BLACK, BLUE, VERMILION), strict=False
    ):
        N, events = record.scene.N_x, record.events[record.events["n_blocks"] >= 2]
        first, last = events["first_block"].to_numpy(), events["last_block"].to_numpy()
        if record.scene.ahead < 0:
            first, last = N + 1 - last, N + 1 - first
        panel.vlines(events["t_start"], first, last, color=colour, lw=0.8)
        panel.set(ylabel=name, ylim=(0, N + 1))
        tables.append(events[["t_start", "first_block", "last_block"]].assign(load=name))
    axes[-1].set_xlabel("t (s)")
    fig.caption = (
        "Blocks that slip in each event over time, from the left, of a slider that moves to "
        "the right and is pushed on the left, pulled on the right, or sheared on its top."
    )
    fig.tables = {"events": pd.concat(tables)}
    return fig
