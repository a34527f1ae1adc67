"""Pictures of one event: the velocity field of the slider, and the interface below it.

The event is run again with full dynamics, from a state shortly before it. A run of the hybrid
engine gives this state. On junctions and on a prescribed interface, full dynamics gives the state.
"""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.ticker import EngFormatter

from pyfric import core
from pyfric.core import State
from pyfric.figures.again import LEAD, again, check_event
from pyfric.figures.style import (
    BLACK,
    COLUMN_WIDTH,
    GREY,
    SMALL,
    VERMILION,
    DataFigure,
    caption,
    colour_bar,
    mark,
    style,
    time_unit,
)
from pyfric.record import Record
from pyfric.scene import Scene
from pyfric.signals import at_once
from pyfric.values import SceneError, check_unmasked, written

MOMENTS = (0.05, 0.3, 0.55, 0.8, 1.0, 1.6)
"""Times of the frames of a strip, over the duration of the front."""
FILM_DPI = 150


class Film(type(Path())):
    """The path of a film; notebooks show the film."""

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.read_bytes()).decode()
        if self.suffix.lower() == ".gif":
            return f'<img alt="{self.stem}" src="data:image/gif;base64,{data}">'
        return f'<video controls loop muted src="data:video/mp4;base64,{data}"></video>'


@dataclass(frozen=True)
class Frame:
    """The slider at one instant. Columns run from the trailing edge, rows from the bottom.

    Attributes:
        t: time, s.
        v: velocity along the drive and upward, shape (N_z, 2, N_x), m/s.
        tau, p: friction force, positive where it resists the drive, and normal force, shape
            (N_x,), N.
        mode: contact, shape (N_x,): 0 stuck, 1 slips along the drive, -1 slips back, 2 open.
    """

    t: float
    v: np.ndarray
    tau: np.ndarray
    p: np.ndarray
    mode: np.ndarray

    @property
    def tau_over_p(self) -> np.ndarray:
        """tau/p, NaN where a block is open."""
        return np.divide(self.tau, self.p, out=np.full(self.p.shape, np.nan), where=self.p > 0)


def frame_times(record: Record, event: int, moments: Sequence[float] = MOMENTS) -> np.ndarray:
    """Return times in s: the first slip plus `moments` times the duration of the front.

    If no front is resolved, the duration of the event is used.
    """
    check_event(record, event)
    check_unmasked("moments", moments)
    row, times = record.events.loc[event], record.rupture_times[record.row(event)]
    last = np.nanmax(times) if np.isfinite(times).any() else math.nan
    spans = (last - row["t_start"], row["duration"], LEAD * record.method.dt)
    span = next(span for span in spans if span > 0)
    return row["t_start"] + span * np.asarray(moments, dtype=float)


def event_frames(
    record: Record,
    event: int,
    times: Sequence[float] | np.ndarray,
    initial: State | None = None,
) -> list[Frame]:
    """Run one event again and return the slider at the given times.

    Args:
        record: a run of the hybrid or the dynamic engine; its geometry and stepper are kept.
        event: its number, from 1.
        times: increasing times in s, from the first slip of the event on. Each frame shows the
            end of the first step that reaches its time.
        initial: the state from which the run began; None for the loaded slider.

    Raises:
        SceneError: there is no such event; the engine or its stepper cannot run it again; times are
            before the event; or the run began from another state.
    """
    check_event(record, event)
    check_unmasked("times", times)
    scene, method = record.scene, record.method
    t_start = record.events["t_start"].loc[event]
    times = np.asarray(times, dtype=float)
    if not (times.size and np.all(np.diff(times) >= 0) and times[0] >= t_start - method.dt):
        allowed = f"increasing times in s from {t_start:.6g} on"
        raise SceneError("times", times, "s", allowed)
    order, frames = np.argsort(scene.n_of_i), []
    for model, state in again(record, event, times, initial):
        forces = core.evaluate(model, state, state.t)
        v = state.y[:, 2:].copy()
        v[:, 0] *= scene.d
        mode = np.where(np.abs(state.mode) == 1, scene.d * state.mode, state.mode)
        tau = -scene.d * forces.f + 0.0
        frames.append(Frame(state.t, v[:, :, order], tau[order], forces.p[order], mode[order]))
    return frames


@at_once()
def event_strip(
    record: Record,
    event: int,
    moments: Sequence[float] = MOMENTS,
    initial: State | None = None,
) -> DataFigure:
    """Draw an event as a strip of frames: velocity along the drive, tau/p and slip below it.

    Args:
        record: a run of the hybrid or the dynamic engine.
        event: its number, from 1.
        moments: times of the frames from the first slip on, over the duration of the front.
        initial: as in `event_frames`.

    Raises:
        SceneError: see `event_frames`.
    """
    frames = event_frames(record, event, frame_times(record, event, moments), initial)
    t_start, fastest = record.events["t_start"].loc[event], _largest(frames)
    fig, drawn = _panels(record.scene, len(frames), fastest)
    unit = time_unit(frames[-1].t - t_start)
    for panel, frame in zip(drawn, frames, strict=True):
        panel.show(frame, t_start, unit)
    fig.tables = _tables(frames, t_start)
    fig.caption = _caption(record, event, fastest)
    return fig


@at_once()
def event_movie(
    record: Record,
    event: int,
    path: str | os.PathLike[str],
    *,
    count: int = 60,
    moments: tuple[float, float] = (0.0, 2.0),
    fps: int = 12,
    initial: State | None = None,
) -> Film:
    """Write an animation of an event; see `event_strip`.

    Args:
        record, event: as in `event_strip`.
        path: the file; its name ends in .gif, or in .mp4 if ffmpeg is installed.
        count: number of frames.
        moments: times of the first and the last frame, over the duration of the front.
        fps: frames per second.
        initial: as in `event_frames`.

    Returns:
        The path, which shows the film in a notebook.

    Raises:
        SceneError: see `event_frames`; or the name ends in neither .gif nor .mp4.
        OSError: the file cannot be written.
    """
    writer = _writer(Path(path), fps)
    times = frame_times(record, event, np.linspace(*moments, count))
    frames = event_frames(record, event, times, initial)
    t_start = record.events["t_start"].loc[event]
    fig, (panels,) = _panels(record.scene, 1, _largest(frames))
    named = f"{record.scene.name or 'scene'}, event {event}: first slip at $t$ = {t_start:.6g} s"
    fig.suptitle(named, fontsize=SMALL)
    panels.scale(record.scene)
    unit = time_unit(frames[-1].t - t_start)
    fig.set_dpi(FILM_DPI)
    with written(path) as draft:
        film = draft.with_name(draft.name + Path(path).suffix)  # its suffix sets the format
        try:
            with writer.saving(fig, film, dpi=FILM_DPI):
                panels.show(frames[0], t_start, unit)
                _stand_still(fig, panels.moving)
                for frame in frames:
                    panels.show(frame, t_start, unit)
                    writer.grab_frame()
            os.replace(film, draft)
        finally:
            film.unlink(missing_ok=True)
    return Film(path)


def _stand_still(fig: DataFigure, moving: Sequence[Artist]) -> None:
    """Replace everything that does not move by a picture, so that frames are drawn fast."""
    fig.canvas.draw()
    fig.set_layout_engine(None)  # "none" would draw each frame twice
    for artist in (*moving, fig.patch, *(axes.patch for axes in fig.axes)):
        artist.set_visible(False)
    fig.canvas.draw()
    picture = np.array(fig.canvas.buffer_rgba())
    for artist in fig.findobj(include_self=False):
        artist.set_visible(isinstance(artist, Axes) or artist in moving or artist is fig.patch)
    fig.figimage(picture, zorder=100)


def _writer(path: Path, fps: int) -> AbstractMovieWriter:
    """Return the writer for the suffix of a film.

    Raises:
        SceneError: no writer for this suffix is installed.
    """
    kind, allowed = path.suffix.lower(), "a name that ends in .gif, or .mp4 where ffmpeg is found"
    if kind == ".gif":
        return PillowWriter(fps=fps)
    if kind != ".mp4":
        raise SceneError("path", str(path), "", allowed, "an unknown kind of film")
    if not has_ffmpeg():
        reason = "an MP4 needs ffmpeg, or the extra movies (imageio-ffmpeg), which is not here"
        raise SceneError("path", str(path), "", allowed, reason)
    return FFMpegWriter(fps=fps, codec="h264", extra_args=["-preset", "veryfast"])


def has_ffmpeg() -> bool:
    """Whether MP4 can be written: ffmpeg is on the path, or imageio-ffmpeg is installed."""
    if FFMpegWriter.isAvailable():
        return True
    try:
        import imageio_ffmpeg

        mpl.rcParams["animation.ffmpeg_path"] = imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        return False
    return FFMpegWriter.isAvailable()


# --- parts ---------------------------------------------------------------------------------------


def _panels(scene: Scene, count: int, fastest: float) -> tuple[DataFigure, list[_Panels]]:
    """Return a figure with the panels of `count` frames, and one scale of colours."""
    columns = min(3, count)
    rows, width = -(-count // columns), COLUMN_WIDTH * min(2, count)
    chain = scene.N_z == 1
    field = 0.1 if chain else 0.72 * width / columns * scene.slider.H / scene.slider.L
    below = max(0.55 * field, 0.55)
    fig = DataFigure(figsize=(width, rows * (field + below + 0.25) + 0.3))
    fig.get_layout_engine().set(h_pad=0.02, w_pad=0.02, hspace=0.02, wspace=0.02)
    grid = fig.subplots(
        2 * rows, columns, squeeze=False, sharex=True, height_ratios=[field, below] * rows
    )
    above, under = grid[::2].ravel(), grid[1::2].ravel()
    for axes in (*above[count:], *under[count:]):
        axes.set_axis_off()
    lowest = columns * (rows - 1)
    drawn = [
        _Panels(*pair, scene, fastest, labelled=n % columns == 0, lowest=n >= lowest)
        for n, pair in enumerate(zip(above[:count], under[:count], strict=True))
    ]
    text = r"velocity along the drive $v_x$ (m/s)"
    colour_bar(fig, drawn[0].image, grid, text, fraction=0.05)
    return fig, drawn


class _Panels:
    """Panels of one frame: velocity field, and interface."""

    def __init__(
        self, top: Axes, bottom: Axes, scene: Scene, fastest: float, *, labelled: bool, lowest: bool
    ) -> None:
        slider, friction = scene.slider, scene.law.mean
        self.top, self.bottom = top, bottom
        l, half = slider.l / slider.L, slider.l / slider.L / 2
        z = slider.H / slider.L
        self.image = self.top.imshow(
            np.zeros((scene.N_z, scene.N_x)),
            extent=(-half, 1 + half, -half, z + half) if scene.N_z > 1 else (-half, 1 + half, 0, l),
            origin="lower",
            cmap="RdBu_r",
            vmin=-fastest,
            vmax=fastest,
            aspect="auto",  # aligned with the interface below; panel heights give the scale
            interpolation="nearest",
        )
        x = np.arange(scene.N_x) / (scene.N_x - 1)
        (self.line,) = self.bottom.plot(x, np.zeros(scene.N_x), color=BLACK, lw=0.8)
        (self.slip,) = self.bottom.plot(x, np.zeros(scene.N_x), "o", color=VERMILION, ms=1.8)
        (self.open,) = self.bottom.plot(x, np.zeros(scene.N_x), "x", color=GREY, ms=2.5, mew=0.6)
        for axes in (self.top, self.bottom):
            style(axes)
        mark(self.bottom, friction.mu_s, r"$\mu_\mathrm{s}$", at=0.98, away=(0, 1), ha="right")
        mark(self.bottom, friction.mu_k, r"$\mu_\mathrm{k}$", at=0.98, away=(0, 1), ha="right")
        self.bottom.set_ylim(-0.55 * friction.mu_s, 1.4 * friction.mu_s)
        self.bottom.set_xlim(-half, 1 + half)
        if scene.N_z == 1:
            self.top.set_yticks([])
        if labelled:
            self.bottom.set_ylabel(r"$\tau/p$")
            self.top.set_ylabel(r"$z/L$" if scene.N_z > 1 else "")
        if lowest:
            self.bottom.set_xlabel(r"$x/L$")
        self.title = self.top.set_title(" ", fontsize=SMALL, pad=2, y=1)
        self.moving = (self.image, self.line, self.slip, self.open, self.title)

    def scale(self, scene: Scene) -> None:
        """Draw a bar of a round length, about a fifth of L."""
        L = scene.slider.L
        power = 10.0 ** math.floor(math.log10(0.2 * L))
        long = max(step * power for step in (1, 2, 5) if step * power <= 0.2 * L)
        bar, shown = long / L, EngFormatter("m")(long)
        top = self.top.get_ylim()[1]
        self.top.plot([0.97 - bar, 0.97], [0.9 * top] * 2, color=BLACK, lw=2, solid_capstyle="butt")
        at, look = (0.97 - bar / 2, 0.87 * top), {"ha": "center", "va": "top", "fontsize": SMALL}
        self.top.text(*at, shown, **look)

    def show(self, frame: Frame, t_start: float, unit: tuple[float, str]) -> None:
        """Show a frame. t_start is the time of the first slip, s; `unit` is from `time_unit`."""
        self.image.set_data(frame.v[:, 0])
        ratio = frame.tau_over_p
        self.line.set_ydata(ratio)
        slips = np.abs(frame.mode) == 1
        self.slip.set_ydata(np.where(slips, ratio, np.nan))
        self.open.set_ydata(np.where(frame.mode == 2, 0.0, np.nan))
        text = f"{(frame.t - t_start) * unit[0]:.1f} {unit[1]}, slipping: {slips.sum()}"
        self.title.set_text(text)


def _largest(frames: Sequence[Frame]) -> float:
    """Return the range of the colours, m/s, which includes nearly all velocities of all frames."""
    found = float(np.quantile(np.abs([frame.v[:, 0] for frame in frames]), 0.995))
    return found or 1e-12


def _tables(frames: Sequence[Frame], t_start: float) -> dict[str, pd.DataFrame]:
    interface, field = [], []
    for number, frame in enumerate(frames, 1):
        N_z, _, N_x = frame.v.shape
        n = np.arange(1, N_x + 1)
        about = {"frame": number, "t_s": frame.t, "t_from_start_us": (frame.t - t_start) * 1e6}
        values = {
            "n": n,
            "x_over_L": (n - 1) / (N_x - 1),
            "tau_N": frame.tau,
            "p_N": frame.p,
            "tau_over_p": frame.tau_over_p,
            "mode": frame.mode,
        }
        interface.append(pd.DataFrame(about | values))
        values = {
            "n": np.tile(n, N_z),
            "row": np.repeat(np.arange(N_z), N_x),
            "v_x_m_per_s": frame.v[:, 0].ravel(),
            "v_z_m_per_s": frame.v[:, 1].ravel(),
        }
        field.append(pd.DataFrame({"frame": number} | values))
    return {
        "interface": pd.concat(interface, ignore_index=True),
        "field": pd.concat(field, ignore_index=True),
    }


def _caption(record: Record, event: int, fastest: float) -> str:
    row = record.events.loc[event]
    what = (
        f"Event {event} (first slip at t = {row['t_start']:.6g} s, "
        f"L_p/L = {row['L_p_over_L']:.3g}, {row['n_blocks']} blocks), run again with full dynamics "
        "from a state just before it. Above: velocity of the blocks along the drive, colours up to "
        f"{fastest:.3g} m/s. Below: tau/p at the same instants; dots are blocks that slip, crosses "
        "open ones. Times are from the first slip; x is from the trailing edge."
    )
    return caption(record, what)
