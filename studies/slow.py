"""Slow fronts on an interface of junctions: where they are, their speed and length, and their end.

The runs are those of the preset `slow` to 1.6 s in linear geometry, with three seeds. Runs with the
first seed are repeated with half the step, with times t_R without spread, with 25 and 400 junctions
a block at the same u_s, and with t_R of 0.5 and 8 ms.

passage     time at which a front passes block i from the trailing edge: the largest of the first
            rupture times of blocks 1 to i in the event. A block that ruptures ahead of the front
            counts when the front has come
speed       over five blocks: 4 l over the time between the passages two blocks before and after
slow        a block at which the speed is 3 % of c_S or less
stretch     the longest sequence of at least five slow blocks, in an event that ruptures all blocks;
            its speed is that over all of its blocks
between     whether the front is fast before and after a stretch: both medians of speeds, over at
            least two blocks each, are at least 20 times the speed of the stretch
accepted    a stretch between fast parts whose speed is 1 to 3 % of c_S
slip speed  displacement of a block in the 0.2 ms from its first rupture on, over that time
arrest      the farthest block of ruptures from the trailing edge that stopped on the way, since the
            last rupture of all blocks

Source: J. Trømborg et al., Proc. Natl. Acad. Sci. 111, 8764 (2014); PRE 92, 012408 (2015).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from sizes import size

from pyfric import figures
from pyfric.engines import step_size
from pyfric.paper.cases.slow_fronts import passages, speeds
from pyfric.record import material_of
from pyfric.scene import preset
from pyfric.sweeps import Job, run_all

if TYPE_CHECKING:
    from pyfric.figures import DataFigure
    from pyfric.record import Record
    from pyfric.scene import Scene

__all__ = ["CASES", "amontons_coulomb", "figure", "jobs", "longest_stretch",
           "report", "ruptures", "slip_speeds", "speed_figure", "study", "tables"]  # fmt: skip

STORED = Path(__file__).parents[1] / "reference_data"
"""Stored runs with the paper's friction."""
T_END, FASTER = size((1.6, 1), (0.012, 50))
"""End of each run, s, and the driver's speed, in units of that of the preset."""
SAMPLE = 5e-5
"""Time between points of the motion, s."""
BAND, RATIO, LEAST = (0.01, 0.03), 20.0, 5
"""Stretches: range of speeds, in c_S; least ratio of speeds beside them; fewest blocks."""
SLOW = BAND[1]
"""Speed, in units of c_S, up to which a block counts as slow."""
BESIDE = 2
"""Fewest blocks with a speed before and after a stretch between fast parts."""
SLIPS = 0.2e-3
"""Time over which slip speeds are taken, s."""

CASES: Mapping[str, Mapping[str, Any]] = {
    "seed 0": {},
    "seed 1": {"seed": 1},
    "seed 2": {"seed": 2},
    "half the step": {"dt": 0.5},
    "no spread, step ends": {"t_R_std": 0.0, "switching": "step_end"},
    "no spread of t_R": {"t_R_std": 0.0},
    "n_s = 400": {"n_s": 400},
    "n_s = 25": {"n_s": 25},
    "t_R = 0.5 ms": {"t_R": 0.5e-3, "t_R_std": 0.15e-3},
    "t_R = 8 ms": {"t_R": 8e-3, "t_R_std": 2.4e-3},
}
CASES = size(CASES, {"seed 0": {}})
"""Names of runs -> changes of the law; dt (a share of the automatic step) and switching are
options."""


def jobs(cases: Sequence[str], t_end: float = T_END) -> list[Job]:
    """Return the runs of these cases."""
    found = []
    for name in cases:
        changes = dict(CASES[name])
        share, switching = changes.pop("dt", 1.0), changes.pop("switching", None)
        scene = preset("slow", {f"law.{field}": value for field, value in changes.items()})
        scene = scene.replace({"driver.V": FASTER * scene.driver.V})
        how = {"fidelity": "dynamic", "geometry": "linear", "verify": "none", "sample": SAMPLE}
        how["switching"] = switching
        how |= {} if share == 1 else {"dt": share * step_size(scene)}
        found.append(Job(scene=scene, t_end=t_end, options=how))
    return found


def study(
    folder: Path,
    cases: Sequence[str] = tuple(CASES),
    say: Callable[[str], None] = lambda _: None,
    t_end: float = T_END,
) -> dict[str, Record]:
    """Make the runs that are missing in the folder; return all runs by name."""
    records = {}
    for name, job in zip(cases, jobs(cases, t_end), strict=True):
        say(name)
        (records[name],) = run_all([job], workers=1, cache=folder, progress=False)
    return records


def longest_stretch(v: np.ndarray, slow: float) -> tuple[int, int] | None:
    """Return first and last block (from 0) of the longest slow stretch, None if it is too short."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (v <= slow).astype(int), [0]])))
    runs = edges.reshape(-1, 2)
    if not len(runs):
        return None
    first, end = runs[np.argmax(np.diff(runs, axis=1)[:, 0])]
    return (int(first), int(end) - 1) if end - first >= LEAST else None


def ruptures(record: Record) -> pd.DataFrame:
    """Return one row for each event that ruptures all blocks.

    Columns: event; t_start (s); F_T_start and F_T_arrest over F_N; arrest, from 1; first and last
    block of its slow stretch, from 1, and the speed of the stretch in c_S; ratios of speeds before
    and after it to its speed; between; accepted. Without a slow stretch these columns are NaN and
    False.
    """
    scene, rows, since = record.scene, [], 0
    whole = record.events[(record.events["n_blocks"] == scene.N_x) & record.events["is_main"]]
    edge = record.events[record.events["first_block"] == 1]
    for event, row in whole.iterrows():
        t = passages(record, event)
        v = speeds(t, scene.slider.l)
        found = {"event": event, "t_start": row["t_start"]}
        found["arrest"] = edge.loc[since + 1 : event - 1, "last_block"].max()
        since = event
        found |= {name: row[name] / scene.F_N for name in ("F_T_start", "F_T_arrest")}
        found |= dict.fromkeys(("first", "last", "speed", "before", "after"), np.nan)
        stretch = longest_stretch(v, SLOW * material_of(scene).c_S)
        if stretch is not None:
            first, last = stretch
            speed = (last - first) * scene.slider.l / (t[last] - t[first])
            found |= {"first": first + 1, "last": last + 1, "speed": speed / material_of(scene).c_S}
            for name, part in (("before", v[:first]), ("after", v[last + 1 :])):
                known = part[~np.isnan(part)]
                found[name] = np.median(known) / speed if len(known) >= BESIDE else np.nan
        found["between"] = bool(found["before"] >= RATIO and found["after"] >= RATIO)
        found["accepted"] = found["between"] and BAND[0] <= found["speed"] <= BAND[1]
        rows.append(found)
    names = ["event", "t_start", "F_T_start", "F_T_arrest", "arrest", "first", "last", "speed",
             "before", "after", "between", "accepted"]  # fmt: skip
    return pd.DataFrame(rows, columns=names)


def slip_speeds(record: Record) -> pd.DataFrame:
    """Return front speed, slip speed (m/s) and prestress of blocks in ruptures of all blocks.

    Columns: event, n, front, slip, and tau_over_p in the static state before the event.
    """
    scene, t = record.scene, record.curve["t"].to_numpy()
    order, rows = np.argsort(scene.n_of_i), []
    u = scene.d * record.motion["u_x"][:, order]
    for event in ruptures(record)["event"]:
        passed, row = passages(record, event), record.row(event)
        ratio = (record.tau_before[row] / record.p_before[row])[order]
        for i, v in enumerate(speeds(passed, scene.slider.l)):
            end = passed[i] + SLIPS
            if np.isfinite(v) and end <= t[-1]:
                slip = np.diff(np.interp([passed[i], end], t, u[:, i]))[0]
                found = {"event": event, "n": i + 1, "front": v, "slip": slip / SLIPS}
                rows.append(found | {"tau_over_p": ratio[i]})
    return pd.DataFrame(rows, columns=["event", "n", "front", "slip", "tau_over_p"])


def power_law(table: pd.DataFrame) -> tuple[float, float]:
    """Return exponent and r^2 of slip speed as a power of front speed; NaN for few blocks."""
    known = table[(table["slip"] > 0) & (table["front"] > 0)]
    if len(known) < 3:
        return np.nan, np.nan
    x, y = np.log(known["front"]), np.log(known["slip"])
    return float(np.polyfit(x, y, 1)[0]), float(np.corrcoef(x, y)[0, 1] ** 2)


def summary(record: Record) -> dict[str, float]:
    """Return a row of the table of accepted stretches, with medians over events."""
    found, main = ruptures(record), record.events[record.events["is_main"]]
    slow = found[found["speed"].notna()]
    exponent, r2 = power_law(slip_speeds(record))
    return {
        "ruptures": len(found),
        "slow": len(slow),
        "between": int(found["between"].sum()),
        "accepted": int(found["accepted"].sum()),
        "speed": slow["speed"].median(),
        "least": slow["speed"].min(),
        "blocks": (slow["last"] - slow["first"] + 1).median(),
        "first": slow["first"].median(),
        "around_arrest": int(slow["arrest"].between(slow["first"], slow["last"]).sum()),
        "begins_before_arrest": (slow["arrest"] - slow["first"]).median(),
        "before": slow["before"].median(),
        "after": slow["after"].median(),
        "arrested": int((main["n_blocks"] < record.scene.N_x).sum()),
        "interval": found["t_start"].diff().median(),
        "F_T_start": found["F_T_start"].median(),
        "F_T_arrest": found["F_T_arrest"].median(),
        "exponent": exponent,
        "r2": r2,
    }


def tables(records: Mapping[str, Record]) -> dict[str, pd.DataFrame]:
    """Return the table of accepted stretches, and the ruptures of all runs."""
    rows = [{"case": name} | summary(record) for name, record in records.items()]
    each = [ruptures(record).assign(case=name) for name, record in records.items()]
    return {"acceptance": pd.DataFrame(rows), "ruptures": pd.concat(each, ignore_index=True)}


def same_events(one: Record, other: Record) -> int:
    """Return the number of first main events that agree within 1 block and 1e-3 F_N."""
    limit, same = 1e-3 * one.scene.F_N, 0
    ours, theirs = (run.events[run.events["is_main"]].itertuples() for run in (one, other))
    for a, b in zip(ours, theirs, strict=False):
        if abs(a.n_blocks - b.n_blocks) > 1 or abs(a.F_T_start - b.F_T_start) > limit:
            break
        same += 1
    return same


def figure(records: Mapping[str, Record]) -> DataFigure:
    """Return the first rupture of the first run with a stretch between fast parts, as x-t."""
    record = next(iter(records.values()))
    found = ruptures(record)
    best = found[found["between"]] if found["between"].any() else found
    fig = figures.space_time(record, int(best["event"].iloc[0]))
    fig.tables |= tables(records)
    fig.caption += f"\n\n{report(records)}"
    return fig


def amontons_coulomb() -> pd.DataFrame:
    """Return the stored blocks of Fig. 4(b) of the paper: tau_over_p, v_c/c_S, and x/L."""
    parts = []
    for name in ("run1", "run2", "run3", "run4"):
        scene = preset(name)
        points = pd.read_csv(STORED / f"{name}_finite" / "fronts.csv").dropna()
        ratio = points["v_c"] / material_of(scene).c_S
        parts.append(points.assign(v=ratio, x=(points["n"] - 1) / (scene.N_x - 1)))
    return pd.concat(parts, ignore_index=True)


def speed_figure(scene: Scene, found: pd.DataFrame, name: str) -> DataFigure:
    """Return front speeds over prestress for both kinds of friction, and slip over front speeds.

    Args:
        scene: interface of junctions.
        found: table of `slip_speeds`.
        name: name of the run.
    """
    exponent, r2 = power_law(found)
    wave, before = material_of(scene).c_S, amontons_coulomb()
    fig = figures.DataFigure(figsize=(9.2, 3.1), layout="constrained")
    FigureCanvasAgg(fig)
    left, middle, right = fig.subplots(1, 3)
    middle.sharey(left)
    look = {"s": 5, "cmap": "viridis", "vmin": 0, "vmax": 1}
    left.scatter(before["tau_over_p"], before["v"], c=before["x"], **look)
    at = (found["n"] - 1) / (scene.N_x - 1)
    middle.scatter(found["tau_over_p"], found["front"] / wave, c=at, **look)
    image = right.scatter(found["front"] / wave, found["slip"], c=at, **look)
    for axes, title in ((left, "(a) Amontons\N{EN DASH}Coulomb"), (middle, "(b) junctions")):
        axes.set(xlabel=r"$\tau/p$ before the event", yscale="log", title=title, xlim=(0, 0.75))
        axes.set_ylabel(r"front speed $v_\mathrm{c}/c_\mathrm{S}$")
        axes.axhline(SLOW, color="grey", lw=0.8)
    right.set(xscale="log", yscale="log", title="(c) junctions", ylabel="slip speed (m/s)")
    right.set_xlabel(r"front speed $v_\mathrm{c}/c_\mathrm{S}$")
    fig.colorbar(image, ax=right, label="$x/L$ from the trailing edge")
    fig.tables = {"speeds": found}
    fig.caption = (
        "(a) Front speed over the prestress of the static state before the event: blocks of Fig. "
        "4(b) of the paper, runs 1 to 4 in finite geometry. (b) The same for junctions, "
        f"{name}, in events that rupture all blocks. Line: {SLOW:g} c_S. Speeds beyond c_P are "
        "those of blocks that the front has passed at nearly one time. (c) Slip speed in the first "
        f"{1e3 * SLIPS:g} ms over front speed: exponent {exponent:.2f}, r^2 {r2:.2f}."
    )
    return fig


def report(records: Mapping[str, Record]) -> str:
    """Return the table of accepted stretches as text."""
    rows = tables(records)["acceptance"]
    lines = [rows.to_string(index=False, float_format=lambda x: f"{x:.3g}")]
    if {"seed 0", "half the step"} <= set(records):
        kept = same_events(records["seed 0"], records["half the step"])
        lines.append(f"first main events that half the step keeps: {kept}")
    return "\n".join(lines)
