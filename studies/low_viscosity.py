"""Fig. 4(b) with little viscosity: the last precursors of runs 1 to 4, from the same tractions.

Each precursor of the runs with l = 1.25 mm and d_c = 1 um starts from the tractions just before its
first slip (`finer`), on the same and on a finer lattice, with the paper's viscosity and with little
of it along the bonds. Cracks follow fracture mechanics with the latter only (`fronts`). What
prestress and position explain of ln v_c is compared like for like, as in `collapse`.

Source: PRL 107, 074301 (2011), Fig. 4.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from collapse import collapse
from collapse import report as of_collapse
from fronts import COLLAPSE, D_C, LAST, begun, kept, main_events

from pyfric.record import analysis
from pyfric.scene import preset
from pyfric.signals import at_once

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pyfric.record import Record

__all__ = ["VISCOSITIES", "report", "shares_of", "study"]

L = 1.25e-3
"""Lattice constant of the runs that give the tractions, m."""
SPACINGS = (1.25e-3, 0.625e-3)
"""Lattice constants of the precursors, m."""
VISCOSITIES: dict[str, dict[str, Any]] = {
    "the paper's": {},
    "0.001 k m, along bonds": {"damping": 1e-3, "dashpots": "along"},
}
"""eta^2 and what dashpots resist -> fields of the slider."""
TRIES = 24
"""Runs go on until such a front has stopped, at most so many times `AFTER`."""
LONG = 0.5
"""Least length of the front, over that of the run's: small events may come before it."""


@at_once()
def study(
    runs: Path,
    names: Sequence[str] = tuple(COLLAPSE),
    spacings: Sequence[float] = SPACINGS,
    l: float = L,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Return the fronts, as `fronts` does: one row for each block.

    Args:
        runs: folder in which runs are kept; it is made if missing.
        names: which of the runs 1 to 4.
        spacings: lattice constants of the precursors, m.
        l: that of the runs they come from, m.
        say: called with what is done next.

    Returns:
        Columns: scene, l (m), viscosity, event (of the run), n, x_over_L, v_c (m/s), scaled,
        X_c0_over_l, X_c_over_l, and others of `pyfric.analysis.fronts`; L_p_over_L of the event.
    """
    runs.mkdir(parents=True, exist_ok=True)
    tables = []
    for name in names:
        say(f"{name}, l = {l * 1e3:g} mm")
        path = runs / f"{name}_{l * 1e3:g}_{D_C * 1e6:g}.nc"
        run = kept(path, preset(name, l=l, d_c=D_C), COLLAPSE[name])
        for event in main_events(run)[-LAST:].tolist():
            for spacing in spacings:
                for viscosity, fields in VISCOSITIES.items():
                    say(f"{name}, event {event}, l = {spacing * 1e3:g} mm, eta^2: {viscosity}")
                    scene = preset(name, l=spacing, d_c=D_C, **fields)
                    file = f"{name}_{event}_{spacing * 1e3:g}_{scene.eta:.3g}.nc"
                    enough = functools.partial(_long, run=run, event=event)
                    record = begun(runs / file, run, event, scene, enough, TRIES)
                    table, front = analysis.fronts(record), _long(record, run, event)[0]
                    about = {"scene": name, "l": spacing, "viscosity": viscosity, "event": event}
                    about["L_p_over_L"] = record.events["L_p_over_L"].loc[front]
                    tables.append(table[table["event"] == front].assign(**about))
    return pd.concat(tables, ignore_index=True)


def _long(record: Record, run: Record, event: int) -> list[int]:
    """Return the finished main events whose fronts are about as long as that of a run's event."""
    L_p, least = record.events["L_p_over_L"], LONG * run.events["L_p_over_L"].loc[event]
    return [one for one in main_events(record).tolist() if L_p.loc[one] >= least]


def shares_of(fronts: pd.DataFrame) -> pd.DataFrame:
    """Return what prestress and position explain: a row for each lattice and viscosity.

    Columns are those of `collapse`, and viscosity.
    """
    found = [
        collapse(part.assign(d_c=D_C, begun=L)).assign(viscosity=viscosity)
        for viscosity, part in fronts.sort_values("l", kind="stable").groupby(
            "viscosity", sort=False
        )
    ]
    return pd.concat(found, ignore_index=True)


def report(table: pd.DataFrame) -> str:
    """Return the table as text."""
    parts = table.groupby("viscosity", sort=False)
    return "\n\n".join(f"eta^2: {name}\n{of_collapse(part)}" for name, part in parts)
