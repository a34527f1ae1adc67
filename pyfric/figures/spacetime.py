"""One event over space and time: slip rate, or share of pinned junctions, with lines."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pyfric import theory
from pyfric.core import State
from pyfric.figures.again import again, check_event
from pyfric.figures.style import (
    BLACK,
    COLUMN_WIDTH,
    GREEN,
    PURPLE,
    DataFigure,
    caption,
    colour_bar,
    legend,
    style,
    time_unit,
)
from pyfric.record import Record, energy_release, front, material_of
from pyfric.scene import Scene
from pyfric.signals import at_once
from pyfric.values import SceneError

BEFORE, AFTER = 0.15, 0.5
"""Time shown before and after the front, over the duration of the front."""
ROWS, FEWEST = 500, 100
"""Largest number of instants of a picture, and least number for runs with located switches."""
AROUND, LEAST = 0.5, 8
"""Length shown on either side of the front, over the length of the front; least number of blocks on
either side."""
SLOW = 0.1
"""Speed over c_R below which steps from block to block in the first third of a front are creep."""
ROUNDED = 1e-6
"""Distance from 1 within which a scaled prestress counts as 1."""
INSTANTS = 20
"""Fewest instants of a picture that is made from the record itself."""
SHORTEST = 4
"""Least duration of a front, in time steps."""


@at_once()
def space_time(record: Record, event: int, initial: State | None = None) -> DataFigure:
    """Draw the slip rate along the interface over time, with wave speeds and theory as lines.

    The event is run again with full dynamics. On junctions the colour is the share of pinned
    junctions, at the times of the record's curve (`sample`).

    Lines begin where and when the front starts to run: c_R (dash-dotted), c_S (dotted) and c_L
    (dashed); in a chain there is only c. Black: the rupture times of the record. Purple: theory
    (`theory_times`).

    Args:
        record: a run of the hybrid or the dynamic engine, from the loaded slider on.
        event: its number, from 1.
        initial: the state from which the run began; None for the loaded slider.

    Returns:
        The figure, with the tables "slip_rate" (n, x_over_L, t_s, v_m_per_s), "lines" (name,
        speed_m_per_s, x_over_L, t_s) and "front". On junctions "pinned" (n, x_over_L, t_s, share)
        replaces "slip_rate".

    Raises:
        SceneError: there is no such event, it cannot be run again, or the curve has too few points.
    """
    check_event(record, event)
    if "pinned" in record.motion:
        t, v = _pinned_shares(record, _window(record, event))
    else:
        t, v = _slip_rates(record, event, initial)
    lines = pd.concat([wave_lines(record, event), theory_times(record, event)], ignore_index=True)
    fig = _drawn(record, event, t, v, lines)
    N_x, n = record.scene.N_x, np.arange(1, record.scene.N_x + 1)
    rates = {
        "n": np.tile(n, len(t)),
        "x_over_L": np.tile((n - 1) / (N_x - 1), len(t)),
        "t_s": np.repeat(t, N_x),
        "share" if "pinned" in record.motion else "v_m_per_s": v.ravel(),
    }
    name = "pinned" if "pinned" in record.motion else "slip_rate"
    fig.tables = {name: pd.DataFrame(rates), "lines": lines, "front": front(record, event)}
    fig.caption = _caption(record, event, lines)
    return fig


def wave_lines(record: Record, event: int) -> pd.DataFrame:
    """Return the lines of waves that leave the front's starting block at its starting time.

    Returns:
        name ("c_R", "c_S", "c_L", or "c" for a chain), speed_m_per_s, x_over_L, t_s: two points of
        each line on each side, up to the ends of the slider.
    """
    scene, (x_0, t_0) = record.scene, _origin(record, event)
    rows = [
        (name, speed, x, t_0 + abs(x - x_0) * scene.slider.L / speed)
        for name, speed in speeds(scene).items()
        for end in (0.0, 1.0)
        if end != x_0
        for x in (x_0, end)
    ]
    return pd.DataFrame(rows, columns=["name", "speed_m_per_s", "x_over_L", "t_s"])


def speeds(scene: Scene) -> dict[str, float]:
    """Return the speeds of long waves by name, m/s."""
    slider = scene.slider
    if scene.N_z == 1:
        chain = theory.lattice_waves(slider.k, scene.m, slider.l, polarisation="chain")
        return {"c": float(chain.phase)}
    material = material_of(scene)
    return {"c_R": material.c_R, "c_S": material.c_S, "c_L": material.c_P}


def theory_times(record: Record, event: int) -> pd.DataFrame:
    """Return the theoretical line of a front with the same starting place and time.

    In a chain the speed is the exact speed of steady fronts at the local prestress. In two
    dimensions the speed v follows from fracture mechanics: g_II(v) G = Gamma, with G of static
    states (`pyfric.analysis.energy_release`). Without weakening Gamma is 0 and v is c_R, which is
    drawn already. A prescribed interface has no static states, and so no line. The line ends where
    theory gives no front.

    Returns:
        Columns of `wave_lines`, one row for each block; empty if theory gives no line.
    """
    scene, table, x_0 = record.scene, front(record, event), _origin(record, event)[0]
    nothing = pd.DataFrame({k: [] for k in ("name", "speed_m_per_s", "x_over_L", "t_s")})
    table = table[table["x_over_L"] >= x_0]
    if scene.N_z == 1:
        name, v = "exact", _chain_speeds(scene, table["scaled"].to_numpy())
    elif scene.law.weakens and scene.has_rests and record.events["at_trailing_edge"].loc[event]:
        grown = energy_release(record, event).set_index("n")
        name, v = "LEFM", grown["v"].reindex(table["n"]).to_numpy()
    else:
        return nothing
    runs = np.append(v > 0, False)
    first = int(runs.argmax())
    last = first + int(runs[first:].argmin())
    if last - first < 2:
        return nothing
    x, v = table["x_over_L"].to_numpy()[first:last], v[first:last]
    t = table["t"].to_numpy()[first] + np.cumsum(np.diff(x, prepend=x[0]) * scene.slider.L / v)
    return pd.DataFrame({"name": name, "speed_m_per_s": v, "x_over_L": x, "t_s": t})


# --- parts ---------------------------------------------------------------------------------------


def _chain_speeds(scene: Scene, scaled: np.ndarray) -> np.ndarray:
    """Return the exact speed at each block, m/s; 0 without a steady front or without stress."""
    scaled = np.round(np.nan_to_num(scaled), 9)
    unit = scene.slider.l * math.sqrt(scene.slider.k / scene.m)
    eta = scene.eta / math.sqrt(scene.slider.k * scene.m)
    known = {tau_bar: 0.0 for tau_bar in scaled}
    for tau_bar in known:
        try:
            known[tau_bar] = theory.chain_speed(float(tau_bar), 0.0, eta) * unit
        except ValueError:  # the block slips at once, or no front exists
            known[tau_bar] = math.inf if tau_bar > 1 - ROUNDED else 0.0
    return np.array([known[tau_bar] for tau_bar in scaled])


def _origin(record: Record, event: int) -> tuple[float, float]:
    """Return x/L and t at which the front starts to run: first slip, without slow creep.

    On junctions, where fronts may be slow, this is the start of the event.
    """
    table = front(record, event)
    if table.empty or "pinned" in record.motion:
        row = record.events.loc[event]
        return float(row["x_nucleation"] / record.scene.slider.L), float(row["t_start"])
    first = int(table["t"].argmin())
    least = SLOW * next(iter(speeds(record.scene).values()))
    waits = np.abs(np.diff(table["t"].to_numpy()[first:]))
    slow = np.flatnonzero(waits[: len(waits) // 3] > record.scene.slider.l / least)
    row = table.iloc[first + (int(slow[-1]) + 1 if slow.size else 0)]
    return float(row["x_over_L"]), float(row["t"])


def _window(record: Record, event: int) -> tuple[float, float]:
    """Return the times between which the event is shown, s."""
    times, row = record.rupture_times[record.row(event)], record.events.loc[event]
    known = times[np.isfinite(times)]
    begin = known.min() if known.size and "pinned" not in record.motion else row["t_start"]
    span = known.max() - begin if known.size > 1 else row["duration"]
    span = np.fmax(span, SHORTEST * record.method.dt)  # a duration may be unknown
    return max(begin - BEFORE * span, 0.0), begin + (1 + AFTER) * span


def _slip_rates(record: Record, event: int, initial: State | None) -> tuple[np.ndarray, np.ndarray]:
    """Return times (s) and slip rates along the drive from the trailing edge, (times, N_x), m/s."""
    scene, dt, window = record.scene, record.method.dt, _window(record, event)
    length = window[1] - window[0]
    if record.method.switching == "located" and length < FEWEST * dt:
        dt /= math.ceil(FEWEST * dt / length)
    every = max(1, math.ceil(length / (ROWS * dt)))
    order, times, rates = np.argsort(scene.n_of_i), [], []
    for _, state in again(record, event, np.arange(*window, every * dt), initial, dt):
        if times and state.t <= times[-1]:
            continue  # before the start of the run
        times.append(state.t)
        rates.append(scene.d * state.y[0, 2][order])
    return np.array(times), np.array(rates)


def _pinned_shares(record: Record, window: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return times (s) and shares of pinned junctions from the trailing edge, (times, N_x)."""
    t = record.curve["t"].to_numpy()
    shown = (t >= window[0]) & (t <= window[1])
    if shown.sum() < INSTANTS:
        sample, length = record.method.sample * record.method.dt, window[1] - window[0]
        allowed = f"at most {length / INSTANTS:.2g} s to show this event"
        raise SceneError("sample", sample, "s", allowed, "the record has too few points there")
    return t[shown], record.motion["pinned"][shown][:, np.argsort(record.scene.n_of_i)]


def _drawn(
    record: Record, event: int, t: np.ndarray, v: np.ndarray, lines: pd.DataFrame
) -> DataFigure:
    N_x, (_, t_0) = record.scene.N_x, _origin(record, event)
    scale, unit = time_unit(t[-1] - t[0])
    fig = DataFigure(figsize=(1.25 * COLUMN_WIDTH, 3.3))
    axes = fig.subplots()
    style(axes)
    half = 0.5 / (N_x - 1)
    below, above = (t[0] - t_0) * scale, (t[-1] - t_0) * scale
    largest = float(np.quantile(np.abs(v[np.abs(v) > 0]), 0.99)) if v.any() else 1e-12
    look = {"cmap": "RdBu_r", "vmin": -largest, "vmax": largest}
    if "pinned" in record.motion:
        look = {"cmap": "viridis", "vmin": 0, "vmax": 1}
    image = axes.imshow(
        v, extent=(-half, 1 + half, below, above), origin="lower", aspect="auto",
        interpolation="nearest", **look,
    )  # fmt: skip
    _lines(axes, lines, t_0, scale)
    table = front(record, event)
    look = {"ls": "", "marker": "."} if N_x <= 30 else {"lw": 0.9}
    at = (table["t"] - t_0) * scale
    axes.plot(table["x_over_L"], at, color=BLACK, ms=3, label="rupture times", **look)
    far = max(AROUND * np.ptp(table["x_over_L"]), LEAST * 2 * half) if len(table) else 1.0
    far = 1.0 if "pinned" in record.motion else far
    axes.set_xlim(
        max(table["x_over_L"].min() - far, 0.0) - half,
        min(table["x_over_L"].max() + far, 1.0) + half,
    )
    axes.set_ylim(below, above)
    axes.set_xlabel(r"position $x/L$ from the trailing edge")
    axes.set_ylabel(f"time from the start of the front ({unit})")
    legend(fig, loc="outside upper center", ncols=5)
    if "pinned" in record.motion:
        colour_bar(fig, image, axes, "share of pinned junctions", extend="neither")
    else:
        colour_bar(fig, image, axes, "slip rate along the drive (m/s)")
    return fig


LOOKS = {
    "c_R": (GREEN, (0, (6, 2, 1, 2)), r"$c_\mathrm{R}$"),
    "c_S": (GREEN, (0, (1, 1.5)), r"$c_\mathrm{S}$"),
    "c_L": (GREEN, (0, (5, 2)), r"$c_\mathrm{L}$"),
    "c": (GREEN, (0, (5, 2)), r"$c$"),
    "exact": (PURPLE, "-", "exact speed"),
    "LEFM": (PURPLE, "-", "fracture mechanics"),
}
"""Name of a line -> its colour, dashes and label."""


def _lines(axes: Axes, lines: pd.DataFrame, t_0: float, scale: float) -> None:
    for name, rows in lines.groupby("name", sort=False):
        colour, dashes, label = LOOKS[name]
        x, t = rows["x_over_L"].to_numpy(), (rows["t_s"].to_numpy() - t_0) * scale
        breaks = np.flatnonzero(t == 0)[1:]
        x, t = np.insert(x, breaks, np.nan), np.insert(t, breaks, np.nan)
        axes.plot(x, t, color=colour, ls=dashes, lw=1.1, label=label)


def _caption(record: Record, event: int, lines: pd.DataFrame) -> str:
    row = record.events.loc[event]
    named = lines.drop_duplicates("name")
    waves = ", ".join(
        f"{name} = {speed:.4g} m/s"
        for name, speed in zip(named["name"], named["speed_m_per_s"], strict=True)
        if name not in ("exact", "LEFM")
    )
    shown = "Share of pinned junctions in" if "pinned" in record.motion else "Slip rate of"
    again = ", run again with full dynamics from a state just before it" * (
        "pinned" not in record.motion
    )
    what = (
        f"{shown} event {event} (first slip at t = {row['t_start']:.6g} s, "
        f"L_p/L = {row['L_p_over_L']:.3g}){again}. Lines from where the front starts to run: "
        f"{waves}."
    )
    if (named["name"] == "exact").any():
        what += " Purple: the exact speed of steady fronts at the local prestress."
    if (named["name"] == "LEFM").any():
        what += " Purple: fracture mechanics, g_II(v) G = Gamma, with G of static states."
    if row["share_X_c0"] < 1 and "pinned" not in record.motion:
        what += (
            f" {100 * row['share_X_c0']:.0f} % of the front's blocks have six or more blocks in "
            "their cohesive zone: the lattice sets its speed."
        )
    return caption(record, what)
