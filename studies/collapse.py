"""Fig. 4(b) with weakening: do prestress or position explain front speeds?

The fronts are those of the study `fronts`: runs 1 to 4, on several lattices, with the paper's
viscosity, with d_c = 1 um and with Amontons-Coulomb friction. Only the last precursors of each run
are compared, as many as were run on the finest lattice. Shares of the variance of ln v_c, their
bootstrap over fronts, and synthetic speeds that depend on position alone are those of claim 13
(`pyfric.paper.claims.shares`).

The prestress is that of the first slip. With d_c > 0 the front begins tens of milliseconds later:
see `resolved`.

Source: PRL 107, 074301 (2011), Fig. 4.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd
from fronts import LAST

from pyfric.paper.claims.shares import shares
from pyfric.record import RESOLVED

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["collapse", "report"]

SHARES = {
    "prestress": ("prestress", ["value", "low", "high", "null"]),
    "position": ("position", ["value", "low", "high"]),
    "beyond": ("prestress, of what position leaves", ["value", "low", "high", "null"]),
}
"""Column of `shares` -> its meaning, and those of its rows that the study gives."""


def collapse(fronts: pd.DataFrame) -> pd.DataFrame:
    """Return one row for each lattice and friction, and for all precursors or the last of each run.

    Args:
        fronts: the table "fronts" of the study `fronts`; `begun` is 0 or the l of the coarser run.

    Returns:
        Columns: d_c and l (m); precursors, "all" or "last"; fronts and points, their numbers; X_c0
        and X_c, the shares of points with six blocks or more in the cohesive zone at rest, and at
        v_c (a front at or above c_R has no zone); then for each of `SHARES` its value, low, high
        (ends of the 95 % interval) and null (the upper end of the interval for synthetic speeds
        that depend on position alone).
    """
    return pd.DataFrame(_rows(_numbered(fronts[fronts["scene"] != "fig1"])))


def _rows(points: pd.DataFrame) -> Iterator[dict[str, Any]]:
    known = points["v_c"].notna() & points["scaled"].notna()
    for (d_c, l, _), table in points.groupby(["d_c", "l", "begun"], sort=False):
        of_run = table.groupby("scene")["front"]
        chosen = {"last": table["front"] > of_run.transform("max") - LAST}
        if not chosen["last"].all():
            chosen = {"all": table["front"] > 0} | chosen
        for which, some in chosen.items():
            part = table[some & known.loc[table.index]]
            found = shares(part, "scaled")
            row = {"d_c": d_c, "l": l, "precursors": which}
            row |= {"fronts": part["front"].nunique(), "points": len(part)}
            row |= {
                name: float((part[f"{name}_over_l"] >= RESOLVED).mean()) for name in ("X_c0", "X_c")
            }
            for share, (_, ends) in SHARES.items():
                row |= {f"{share}_{end}": found.loc[end, share] for end in ends}
            yield row


def _numbered(table: pd.DataFrame) -> pd.DataFrame:
    """Return the fronts, numbered from 1 in order of time, with the position of each block."""
    table = table.reset_index(drop=True)
    about = table[["scene", "d_c", "l", "begun", "event"]]
    # an event that began from the state of a coarser lattice is the first event of its run
    new = (about != about.shift()).any(axis=1) | (table["n"].diff() <= 0)
    table = table.assign(front=new.cumsum())
    n = table.groupby("front")["n"]
    first, last = n.transform("min"), n.transform("max")
    return table.assign(place=(table["n"] - first) / (last - first))


def report(table: pd.DataFrame) -> str:
    """Return the table as text: shares of the variance of ln v_c, with their intervals."""
    rows = {
        "d_c (um)": [f"{1e6 * one:g}" for one in table["d_c"]],
        "l (mm)": [f"{1e3 * one:g}" for one in table["l"]],
        "precursors": table["precursors"],
        "fronts": table["fronts"],
        "6 or more in X_c0": [f"{one:.0%}" for one in table["X_c0"]],
        "in X_c(v)": [f"{one:.0%}" for one in table["X_c"]],
    }
    for share, (what, ends) in SHARES.items():
        values = table[[f"{share}_{end}" for end in ends]].itertuples(index=False)
        rows[what] = [_interval(*one) for one in values]
    text = pd.DataFrame(rows).to_string(index=False)
    null = "upper end of that of data that know the position alone"
    return f"{text}\n\n(95 % interval over fronts; {null})"


def _interval(value: float, low: float, high: float, null: float | None = None) -> str:
    alone = "" if null is None else f"; {null:.2f}"
    return f"{value:.2f} ({low:.2f} to {high:.2f}{alone})"
