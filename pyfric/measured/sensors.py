"""Slip at a place of the interface in a run, as a sensor would measure it.

Slip is the displacement of the block nearest to the sensor, along the drive, since the start of the
record. Runs that record motion have slip at all points of their curve. Other runs have slip only at
times at which the block starts or stops. Between these times slip is interpolated, which is exact
while the block sticks and approximate while it slips.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from pyfric.record import Record
from pyfric.values import check_number


def displacement(record: Record, x: float | str) -> tuple[np.ndarray, np.ndarray]:
    """Return times (s) and slip (m) at x; slip is NaN if it never stopped.

    Raises:
        SceneError: x is refused.
    """
    i, d, ends = _column(record, x), record.scene.d, record.curve["t"].to_numpy()
    if len(record.motion.get("u_x", ())):
        u = d * record.motion["u_x"][:, i]
        return ends, u - u[0]
    own = _episodes(record, x)
    t = own[["t_start", "t_stop"]].fillna(ends[-1]).to_numpy().ravel()
    u = own[["before", "after"]].to_numpy().ravel()
    if not len(u):
        return ends[[0, -1]], np.zeros(2)
    return np.concatenate([ends[:1], t, ends[-1:]]), np.concatenate([u[:1], u, u[-1:]])


def slips(record: Record, x: float | str, t_gap: float) -> list[dict[str, float]]:
    """Return t_start, t_stop (s), before and after (m) of the slip at x in each event.

    Events closer than the pause `t_gap` (s) count as one.
    """
    found: list[dict[str, float]] = []
    last = 0
    for row in _episodes(record, x).dropna().to_dict("records"):
        event = row.pop("event")
        if found and (event == last > 0 or row["t_start"] - found[-1]["t_stop"] <= t_gap):
            found[-1] |= {"t_stop": row["t_stop"], "after": row["after"]}
        else:
            found.append(row)
        last = event
    return found


def _episodes(record: Record, x: float | str) -> pd.DataFrame:
    """Return event, t_start, t_stop (s), before and after (m) of each episode of slip at x."""
    own = record.episodes[record.episodes["i"] == _column(record, x)]
    found = own[["event", "t_start", "t_stop"]].copy()
    ends = record.scene.d * own[["u_x_start", "u_x_stop"]].to_numpy()
    known = ends[np.isfinite(ends)]
    found[["before", "after"]] = ends - known[0] if len(known) else ends
    return found


def _column(record: Record, x: float | str) -> int:
    """Return the index of the block nearest to x (m, from the trailing edge)."""
    scene = record.scene
    place = check_number("x", x, "m", ge=0.0, le=scene.N_x * scene.slider.l)
    n = min(round(place / scene.slider.l) + 1, scene.N_x)
    return int(np.flatnonzero(scene.n_of_i == n)[0])
