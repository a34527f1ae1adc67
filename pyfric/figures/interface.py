"""Figs. 3 and 4: stresses along the interface, and speeds of rupture fronts."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from pyfric.figures.spacetime import LOOKS as LINES
from pyfric.figures.spacetime import speeds
from pyfric.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PAPER,
    SMALL,
    VERMILION,
    DataFigure,
    caption,
    figure,
    joined,
    legend,
    listed,
    mark,
    panels,
    single,
)
from pyfric.record import (
    PER_BIN,
    Record,
    collapse_spread,
    front,
    fronts,
    precursor_lengths,
    stress_profile,
    system_size_events,
)
from pyfric.scene import Law, Scene
from pyfric.values import SceneError

STATES = {"initial": (GREY, ":", 1.2), "before": (BLUE, "--", 1.0), "after": (VERMILION, "-", 1.0)}
"""State -> colour, line style, line width (pt)."""
LOOKS = ((BLUE, "o"), (ORANGE, "s"), (GREEN, "^"), (VERMILION, "D"))
"""Colour and marker of each run."""
MEDIANS = 10
"""Number of bins of prestress for the medians of a run."""
MEDIAN = {"mec": "black", "mew": 0.5, "ms": 3.4}
"""Style of the markers of medians."""


@figure(
    "Fig. 3(a): stresses before and after the precursor of Fig. 4(a)", runs="fig1", precursor=11
)
def fig3a(record: Record, event: int | None = None) -> DataFigure:
    """Fig. 3(a) of the paper: p and tau on the interface at F_T = 0, before and after a precursor.

    Top: p over F_N/N_x. Bottom: tau, with the thresholds mu_s p before and mu_k p after the event.
    The paper does not say which precursor it shows. The precursor of Fig. 4(a) is drawn.

    Args:
        record: the run.
        event: its number, from 1; None means the longest precursor of the first loading.

    Raises:
        SceneError: there is no such event.
    """
    single(record)
    event = longest_precursor(record) if event is None else event
    states = {
        "initial": stress_profile(record),
        "before": stress_profile(record, event, "before"),
        "after": stress_profile(record, event, "after"),
    }
    order = np.argsort(record.scene.n_of_i)
    friction, row = record.scene.law.at(order), record.events.loc[event]

    fig, (top, bottom) = panels(3.6, (1, 1.35), sharex=True)
    force = {"initial": 0.0, "before": row["F_T_start"], "after": row["F_T_arrest"]}
    for state, table in reversed(states.items()):  # dashed on top: equal lines stay visible
        colour, line, width = STATES[state]
        look = {"color": colour, "ls": line, "lw": width, "zorder": 3}
        text = rf"$F_\mathrm{{T}}/F_\mathrm{{N}}$ = {force[state] / record.scene.F_N:.3g}"
        top.plot(table["x_over_L"], table["p"], label=f"{state}, {text}", **look)
        bottom.plot(table["x_over_L"], table["tau"], **look)
    _thresholds(bottom, states, friction)
    legend(top, loc="best", reverse=True)
    N_x = record.scene.N_x
    _mark_tip(top, bottom, (row["L_p_over_L"] * N_x - 1) / (N_x - 1))
    top.set_ylim(bottom=0)
    top.set_ylabel(r"$p\,N_x/F_\mathrm{N}$")
    bottom.margins(y=0.12)  # space for the name of the highest threshold
    bottom.set_ylabel(r"$\tau\,N_x/F_\mathrm{N}$")
    bottom.set_xlabel(r"position $x/L$ from the trailing edge")
    bottom.set_xlim(0, 1)
    fig.align_ylabels([top, bottom])
    tables = [table.assign(state=state) for state, table in states.items()]
    fig.tables = {"profiles": pd.concat(tables, ignore_index=True)}
    what = (
        "Normal force p (a) and friction force tau (b) on each block over F_N/N_x, static states: "
        f"at F_T = 0, and before and after event {event} "
        f"(L_p/L = {row['L_p_over_L']:.3g}); after Fig. 3(a) of {PAPER}. Thin lines: the "
        "thresholds mu_s p before and mu_k p after the event. Positive tau resists the drive."
    )
    fig.caption = caption(record, what)
    return fig


@figure("Fig. 3(b): normal force after precursors, and after sliding", runs="fig1")
def fig3b(record: Record) -> DataFigure:
    """Fig. 3(b) of the paper: how precursors change p, and (its inset) p after sliding.

    Top: p over the p of the same block at F_T = 0, after every second main precursor of the first
    loading; a dot marks the last block of each precursor. Bottom: p over F_N/N_x after each event
    over the whole interface.

    Raises:
        SceneError: the record holds no precursor or no event over the whole interface.
    """
    single(record)
    lengths, sliding = precursor_lengths(record), system_size_events(record)
    if lengths.empty or sliding.empty:
        allowed = "a run with precursors and events over the whole interface"
        raise SceneError("record", record.scene.name, "", allowed, "raise t_end")
    chosen = lengths.iloc[::-2].iloc[::-1]

    fig, (top, bottom) = panels(4.0, (1.25, 1), sharex=True)
    profiles = _after_precursors(top, record, chosen)
    after = _after_sliding(bottom, record, [int(event) for event in sliding["event"]])
    bottom.set_xlabel(r"position $x/L$ from the trailing edge")
    bottom.set_xlim(0, 1)
    fig.align_ylabels([top, bottom])
    fig.tables = {
        "precursors": pd.concat(profiles, ignore_index=True),
        "sliding": pd.concat(after, ignore_index=True),
    }
    events = joined(str(table["event"].iloc[0]) for table in profiles)
    what = (
        "(a) Normal force p over that of the same block at F_T = 0, after every second main "
        f"precursor of the first loading (events {events}). Dots: their last blocks. "
        f"(b) p over F_N/N_x after the {len(after)} events over the whole interface; after "
        f"Fig. 3(b) of {PAPER} and its inset."
    )
    fig.caption = caption(record, what)
    return fig


def longest_precursor(record: Record) -> int:
    """Return the number of the longest main precursor of the first loading; the first if several.

    Raises:
        SceneError: the run has no main precursor.
    """
    found = precursor_lengths(record)
    if found.empty:
        t, allowed = float(record.curve["t"].iloc[-1]), "a run with main precursors"
        raise SceneError(
            "record", t, "s", allowed, "the run ended before a main precursor: raise t_end"
        )
    return int(found["event"][found["L_p_over_L"].idxmax()])


@figure("Fig. 4(a): front speed and prestress in one precursor", runs="fig1", precursor=11)
def fig4a(record: Record, event: int | None = None) -> DataFigure:
    """Fig. 4(a) of the paper: front speed and prestress along the interface in one precursor.

    Top: v_c, averaged over five blocks, with the wave speeds of the lattice. Bottom: tau/p of the
    static state just before the event, with mu_s and mu_k.

    Args:
        record: a run with the small steps of want = "front_speed".
        event: its number, from 1; None means the longest precursor of the first loading.

    Raises:
        SceneError: there is no such event.
    """
    single(record)
    event = longest_precursor(record) if event is None else event
    table = front(record, event)
    friction, row = record.scene.law.mean, record.events.loc[event]
    fig, (top, bottom) = panels(3.4, sharex=True, ratios=(1.2, 1))
    fastest = _speeds(top, record.scene)
    top.plot(table["x_over_L"], table["v_c"], color=BLUE, lw=0.9, marker="o", ms=2.8)
    top.set_ylim(0, 1.1 * np.nanmax([*table["v_c"], fastest]))
    top.set_ylabel(r"front speed $v_\mathrm{c}$ (m/s)")
    mark(bottom, friction.mu_s, r"$\mu_\mathrm{s}$", at=0.97, away=(0, 1), ha="right")
    mark(bottom, friction.mu_k, r"$\mu_\mathrm{k}$", at=0.97, away=(0, 1), ha="right")
    bottom.plot(table["x_over_L"], table["tau_over_p"], color=VERMILION, lw=0.9, marker="s", ms=2.8)
    bottom.set_ylim(min(0.0, table["tau_over_p"].min()), 1.35 * friction.mu_s)
    bottom.set_ylabel(r"prestress $\tau/p$")
    bottom.set_xlabel(r"position $x/L$ from the trailing edge")
    bottom.set_xlim(-0.01, max(table["x_over_L"].max() * 1.05, 0.05))
    fig.align_ylabels([top, bottom])
    fig.tables = {"front": table}
    known = table["v_c"].dropna()
    between = int(table["v_c"].isna().sum()) - 4
    what = (
        f"Speed of the rupture front (a) and tau/p just before it (b), event {event} "
        f"(L_p/L = {row['L_p_over_L']:.3g}, {len(known)} points); after Fig. 4(a) of {PAPER}. "
        f"There is no speed at two blocks at each end, and at {max(between, 0)} more whose five "
        "times do not increase. Dashed: long waves of the lattice, and mu_s, mu_k."
    )
    fig.caption = caption(record, what)
    return fig


@figure("Fig. 4(b): front speed against prestress, runs 1 to 4", runs="fig4b")
def fig4b(records: Sequence[Record]) -> DataFigure:
    """Fig. 4(b) of the paper: front speed against prestress, all main events of several runs.

    Top: v_c against tau/p. Bottom (inset in the paper): v_c against (tau/p - mu_k)/(mu_s - mu_k).

    Args:
        records: runs with the small steps of want = "front_speed".

    Raises:
        SceneError: there is no record.
    """
    records = listed(records)
    tables = [fronts(run).assign(run=n, scene=run.scene.name) for n, run in enumerate(records, 1)]
    points = pd.concat(tables, ignore_index=True)
    blocks = len(points)
    points = points[np.isfinite(points["v_c"]) & np.isfinite(points["tau_over_p"])]
    points = points.reset_index(drop=True)
    fig, both = panels(4.4, (1, 1), sharey=True)
    handles, medians = _draw_runs(both, records, points)
    for axes in both:
        axes.set_yscale("log")
        _speeds(axes, records[0].scene)
        axes.set_ylabel(r"front speed $v_\mathrm{c}$ (m/s)")
    if len(medians):
        look = {"marker": "o", "mfc": "white", "color": "0.4", **MEDIAN}
        handles.append(Line2D([], [], label="medians", **look))
    legend(both[0], handles=handles, loc="lower right")
    both[0].set_xlabel(r"prestress $\tau/p$")
    scaled = r"(\tau/p-\mu_\mathrm{k})/(\mu_\mathrm{s}-\mu_\mathrm{k})"
    both[1].set_xlabel(rf"scaled prestress ${scaled}$")
    fig.tables = {"points": points, "medians": medians}
    what = (
        "Speed of rupture fronts against tau/p just before the event (a) and against "
        f"(tau/p - mu_k)/(mu_s - mu_k) (b); after Fig. 4(b) of {PAPER} and its inset. "
        f"{len(points)} blocks in {points.groupby(['run', 'event']).ngroups} main events. "
        f"{blocks - len(points)} blocks are left out: they are open or have no speed, at the ends "
        "of a front or where five times do not increase. Dashed: long waves of the lattice."
    )
    if len(medians):
        what += f" Lines: medians in {MEDIANS} bins of equal numbers of points."
    fig.caption = caption(records, what)
    return fig


# --- parts ---------------------------------------------------------------------------------------


def _thresholds(axes: Axes, states: dict[str, pd.DataFrame], friction: Law) -> None:
    """Draw the lines mu_s p before and mu_k p after the event."""
    for state, mu, name in (("before", friction.mu_s, "s"), ("after", friction.mu_k, "k")):
        table, (colour, _, _) = states[state], STATES[state]
        threshold = mu * table["p"]
        axes.plot(table["x_over_L"], threshold, color=colour, lw=0.6, alpha=0.6)
        at = int(0.78 * len(table))
        axes.annotate(
            rf"$\mu_\mathrm{{{name}}}\,p$ {state}",
            (table["x_over_L"][at], threshold[at]),
            xytext=(0, 2),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=SMALL,
            color=colour,
        )


def _mark_tip(top: Axes, bottom: Axes, tip: float) -> None:
    """Draw a line at x/L of the last block of an event."""
    for axes in (top, bottom):
        axes.axvline(tip, color="0.6", lw=0.6, ls=(0, (1, 2)), zorder=0)
    bottom.axhline(0, color="0.6", lw=0.5, zorder=0)
    bottom.annotate(
        r"$L_\mathrm{p}$", (tip, 0.02), xycoords=("data", "axes fraction"), xytext=(2, 1),
        textcoords="offset points", fontsize=SMALL, color="0.35",
    )  # fmt: skip


def _after_precursors(axes: Axes, record: Record, chosen: pd.DataFrame) -> list[pd.DataFrame]:
    """Draw p over the initial p after each precursor; return the profiles."""
    colours = mpl.colormaps["viridis_r"](np.linspace(0.1, 1, len(chosen)))
    profiles = []
    for (_, row), colour in zip(chosen.iterrows(), colours, strict=True):
        event = int(row["event"])
        table = stress_profile(record, event, "after")
        tip = round(row["L_p_over_L"] * len(table)) - 1
        look = {"color": colour, "lw": 0.9, "marker": "o", "ms": 3, "markevery": [tip]}
        text = f"{row['L_p_over_L']:.2f}"
        axes.plot(table["x_over_L"], table["p_over_p_initial"], label=text, **look)
        profiles.append(table.assign(event=event, L_p_over_L=row["L_p_over_L"]))
    axes.axhline(1, color="0.6", lw=0.5, zorder=0)
    legend(axes, title=r"$L_\mathrm{p}/L$", loc="upper center", ncols=2)
    axes.set_ylabel(r"$p/p_\mathrm{initial}$")
    return profiles


def _after_sliding(axes: Axes, record: Record, events: list[int]) -> list[pd.DataFrame]:
    """Draw p after each event over the whole interface; return the profiles."""
    after = [stress_profile(record, event, "after").assign(event=event) for event in events]
    loaded, (first, *rest) = stress_profile(record), after
    axes.plot(loaded["x_over_L"], loaded["p"], ":", color=GREY, lw=1.2, zorder=3, label="initial")
    axes.plot(first["x_over_L"], first["p"], "--", color=BLACK, lw=1.3, label="after the first")
    texts = [f"after the next {len(rest)}", *[None] * len(rest)]
    for table, text in zip(rest, texts, strict=False):
        axes.plot(table["x_over_L"], table["p"], color=BLUE, lw=0.8, label=text)
    legend(axes, title="events over the whole interface", loc="upper center")
    axes.set_ylim(bottom=0)
    axes.set_ylabel(r"$p\,N_x/F_\mathrm{N}$")
    return after


def _draw_runs(
    both: Sequence[Axes], records: Sequence[Record], points: pd.DataFrame
) -> tuple[list[Line2D], pd.DataFrame]:
    """Draw the points of each run and, if there are enough, their medians on top.

    Returns:
        One legend handle for each run; and the medians: run, scene, axis, median on the axis, v_c.
    """
    handles, tables = [], [pd.DataFrame(columns=["at", "v_c", "run", "scene", "axis"])]
    for n, record in enumerate(records, 1):
        colour, shape = LOOKS[(n - 1) % len(LOOKS)]
        rows, friction = points[points["run"] == n], record.scene.law.mean
        look = {"ls": "", "marker": shape, "ms": 1.8, "color": colour, "alpha": 0.35, "mew": 0.3}
        look["zorder"] = 3 - len(rows) / max(len(points), 1)  # runs with few points on top
        look["rasterized"] = len(rows) > 5000
        medians = {"color": colour, "marker": shape, "lw": 1.2, "zorder": 5, **MEDIAN}
        for axes, x in zip(both, ("tau_over_p", "scaled"), strict=True):
            axes.plot(rows[x], rows["v_c"], **look)
            if len(rows) >= PER_BIN * MEDIANS:
                edges = collapse_spread(rows[x], rows["v_c"], bins=MEDIANS).edges
                cut = pd.cut(rows[x], np.unique(edges), include_lowest=True)
                table = rows.groupby(cut, observed=True)[[x, "v_c"]].median()
                table = table.rename(columns={x: "at"}).reset_index(drop=True)
                axes.plot(table["at"], table["v_c"], **medians)
                tables.append(table.assign(run=n, scene=record.scene.name, axis=x))
        name = rf"{record.scene.name}: $\mu_\mathrm{{s}}$, $\mu_\mathrm{{k}}$ = "
        label = name + f"{friction.mu_s:g}, {friction.mu_k:g}"
        handles.append(Line2D([], [], ls="", marker=shape, color=colour, ms=3.5, label=label))
    return handles, pd.concat(tables[1:] or tables)


def _speeds(axes: Axes, scene: Scene) -> float:
    """Mark speeds of long waves: c_L and c_S as in the paper, or c of a chain.

    Returns:
        The largest of these speeds, m/s.
    """
    shown = {name: speed for name, speed in speeds(scene).items() if name != "c_R"}
    for name, speed in shown.items():
        mark(axes, speed, LINES[name][-1], at=0.985, away=(0, 1), ha="right")
    return max(shown.values())
