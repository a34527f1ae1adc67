"""Fig. 3: stresses along the interface, before and after precursors."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pyfric.figures.style import (
    BLACK,
    BLUE,
    GREY,
    PAPER,
    SMALL,
    VERMILION,
    DataFigure,
    caption,
    figure,
    joined,
    legend,
    panels,
    single,
)
from pyfric.record import Record, precursor_lengths, stress_profile, system_size_events
from pyfric.scene import Law, SceneError

STATES = {"initial": (GREY, ":", 1.2), "before": (BLUE, "--", 1.0), "after": (VERMILION, "-", 1.0)}
"""State -> colour, line style, line width (pt)."""


@figure(
    "Fig. 3(a): stresses before and after the precursor of Fig. 4(a)", runs="fig1", precursor=11
)
def fig3a(record: Record, event: int | None = None) -> DataFigure:
    """Fig. 3(a) of the paper: p and tau along the interface, at F_T = 0 and about one precursor.

    Top: p over F_N/N_x. Bottom: tau, with the thresholds mu_s p before and mu_k p after the event.
    Which precursor the paper shows is not known: for its run, that of Fig. 4(a) is taken.

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
    for state, table in reversed(states.items()):  # lines with gaps on top: equal ones are all seen
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
    bottom.margins(y=0.12)  # room for the name of a threshold that is the highest
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
    loading; a dot marks the last block of each. Bottom: p over F_N/N_x after each event over the
    whole interface.

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
    """Return the longest main precursor of the first loading, the first one if several are equal.

    Raises:
        SceneError: there is none.
    """
    found = precursor_lengths(record)
    if found.empty:
        t, allowed = float(record.curve["t"].iloc[-1]), "a run with main precursors"
        raise SceneError(
            "record", t, "s", allowed, "the run ended before a main precursor: raise t_end"
        )
    return int(found["event"][found["L_p_over_L"].idxmax()])


# --- parts ---------------------------------------------------------------------------------------


def _thresholds(axes: Axes, states: dict[str, pd.DataFrame], friction: Law) -> None:
    """The lines mu_s p before and mu_k p after the event."""
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
    """A line at x/L of the last block of an event."""
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
    for (_, one), colour in zip(chosen.iterrows(), colours, strict=True):
        event = int(one["event"])
        table = stress_profile(record, event, "after")
        tip = round(one["L_p_over_L"] * len(table)) - 1
        look = {"color": colour, "lw": 0.9, "marker": "o", "ms": 3, "markevery": [tip]}
        text = f"{one['L_p_over_L']:.2f}"
        axes.plot(table["x_over_L"], table["p_over_p_initial"], label=text, **look)
        profiles.append(table.assign(event=event, L_p_over_L=one["L_p_over_L"]))
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
