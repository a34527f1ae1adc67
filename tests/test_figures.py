"""Figures show what the record holds, and their files carry data and caption."""

import dataclasses
import subprocess
import sys

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection

from pyfric import figures
from pyfric.catalogue import QUIET_COLUMNS, SWITCH_COLUMNS, T_GAP, build_catalogue
from pyfric.figures import fig1b, figure_caption, save_figure, slip_segments
from pyfric.record import Method, Record
from pyfric.scene import setup1

LADDER = (6, 8, 10, 12, 14, 17, 20, 23, 27, 31, 36, 42, 49, 57, 9, 22, 40, 57, 11, 26, 45, 57)


def made_up_record(side="left", lengths=LADDER, opened=()):
    """A run like the paper's Fig. 1(b): loading, precursors that grow, micro-slips between."""
    scene = setup1()
    scene = dataclasses.replace(scene, driver=dataclasses.replace(scene.driver, side=side))
    column = np.argsort(scene.n_of_i)
    rng = np.random.default_rng(3)
    N_x, F_N, rate = scene.N_x, scene.F_N, 0.52 * scene.F_N
    dt = 4e-4
    now, force = 0.0, 0.0
    t, F_T, switches, quiet = [0.0], [0.0], [], []
    mode = np.zeros(N_x, dtype=np.int32)
    mode[column[list(opened)]] = 2

    def slip(n_blocks, start=0):
        step = round(now / 1e-7)
        quiet.append((step, now, 1, force, np.zeros(N_x), mode))
        blocks = [column[n] for n in range(start, start + n_blocks) if n not in opened]
        for b, i in enumerate(blocks):
            switches.append((step + b, i, 0, 1, 0, now + b * 1e-7, 0.0, 50.0))
        for i in blocks:
            switches.append((step + 900, i, 1, 0, 0, now + 90e-6, 1e-6, 50.0))
        quiet.append((step + 900, now + 90e-6, -1, force, np.zeros(N_x), mode))

    for n in lengths:
        drop = F_N * (0.006 + 0.1 * (n / 57) ** 4)
        ceiling = 0.47 * F_N if n == 57 else F_N * 0.46 * (n / 57) ** 0.75
        while force < ceiling:
            now, force = now + dt, force + rate * dt
            t.append(now)
            F_T.append(force)
            if rng.random() < 0.04:
                slip(1)
        now += 2e-3
        slip(n)
        now, force = now + 2e-4, force - drop
        t.append(now)
        F_T.append(force)
        now += 2e-3
    rows = np.array(switches, dtype=float).reshape(-1, len(SWITCH_COLUMNS))
    switches = {
        name: column.astype(kind)
        for (name, kind), column in zip(SWITCH_COLUMNS.items(), rows.T, strict=True)
    }
    table = list(zip(*quiet, strict=True)) or [[]] * 6
    quiet = {
        name: np.array(column, dtype=kind)
        for (name, kind), column in zip(QUIET_COLUMNS.items(), table, strict=True)
    }
    quiet |= {name: quiet[name].reshape(-1, N_x) for name in ("u_x", "mode")}
    return Record.from_catalogue(
        build_catalogue(switches, quiet, scene),
        scene=scene,
        method=Method(
            engine="full dynamics",
            geometry="finite",
            stepper="RK4",
            switching="switching at step ends",
            dt=0.2e-6,
        ),
        curve=pd.DataFrame({"t": t, "F_T": F_T}),
        tau_initial=np.zeros(N_x),
        p_initial=np.zeros(N_x),
        quiet=quiet,
        switches=switches,
        versions={"pyfric": "0.1.0"},
    )


@pytest.fixture(scope="module")
def ladder():
    return made_up_record()


def test_bars_end_at_L_p(ladder):
    segments = slip_segments(ladder)
    assert (segments["x_from"] == 0).all()
    np.testing.assert_array_equal(segments["x_to"], ladder.events["L_p_over_L"])
    np.testing.assert_array_equal(segments["t_s"], ladder.events["t_start"])
    kinds = segments.loc[segments["kind"] != "micro", "kind"]
    assert list(kinds) == ["whole" if n == 57 else "partial" for n in LADDER]
    assert (segments.loc[segments["kind"] == "micro", "last_block"] == 1).all()


def test_driver_on_the_right_gives_the_same_picture(ladder):
    mirrored = slip_segments(made_up_record("right"))
    pd.testing.assert_frame_equal(mirrored, slip_segments(ladder))


def test_open_blocks_split_a_bar():
    segments = slip_segments(made_up_record(lengths=(6,), opened=(2, 3)))
    big = segments[segments["kind"] == "partial"]
    assert list(zip(big["first_block"], big["last_block"], strict=True)) == [(1, 2), (3, 4), (5, 6)]
    assert list(big["slipped"]) == [True, False, True]


def test_curve_and_bars_are_drawn(ladder):
    fig = fig1b(ladder)
    top, bottom = fig.axes
    curve = top.get_lines()[-1]
    np.testing.assert_array_equal(curve.get_xdata(), ladder.curve["t"])
    np.testing.assert_array_equal(curve.get_ydata(), ladder.curve["F_T"] / 3500)
    bars = [one for one in bottom.collections if isinstance(one, LineCollection)]
    assert sum(len(one.get_segments()) for one in bars) == len(slip_segments(ladder))
    assert top.get_shared_x_axes().joined(top, bottom)
    assert "(s)" in bottom.get_xlabel()
    assert fig.get_figwidth() == 3.4


def test_all_text_stays_inside_and_is_readable(ladder):
    fig = fig1b(ladder)
    fig.canvas.draw()
    width, height = fig.canvas.get_width_height()
    for text in fig.findobj(matplotlib.text.Text):
        if text.get_text() and text.get_visible():
            assert text.get_fontsize() >= 7
    for axes in fig.axes:
        box = axes.get_tightbbox()
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= width
        assert box.y1 <= height


def test_saved_files(ladder, tmp_path):
    stem = tmp_path / "new" / "fig1b"
    fig = fig1b(ladder, stem)
    names = {path.name for path in stem.parent.iterdir()}
    expected = {"fig1b.png", "fig1b.pdf", "fig1b.txt", "fig1b_curve.csv", "fig1b_slip.csv"}
    assert names == expected
    assert stem.with_suffix(".png").read_bytes()[:4] == b"\x89PNG"
    assert stem.with_suffix(".pdf").read_bytes()[:4] == b"%PDF"
    assert stem.with_suffix(".txt").read_text(encoding="utf-8").strip() == fig.caption
    slip = pd.read_csv(tmp_path / "new" / "fig1b_slip.csv", engine="python")
    pd.testing.assert_frame_equal(slip, slip_segments(ladder), check_dtype=False, check_exact=True)


def test_files_are_reproducible(ladder, tmp_path):
    first = [path.read_bytes() for path in save_figure(fig1b(ladder), tmp_path / "a")]
    again = [path.read_bytes() for path in save_figure(fig1b(ladder), tmp_path / "b")]
    assert first == again


def test_stem_with_a_dot_is_kept(ladder, tmp_path):
    paths = save_figure(fig1b(ladder), tmp_path / "mu0.7")
    assert paths[0].name == "mu0.7.png"


def test_caption_states_scene_engine_and_counts(ladder):
    caption = figure_caption(ladder)
    for part in (
        "L = 140 mm",
        "F_N = 3500 N",
        "h = 5 mm",
        "mu_s = 0.7, mu_k = 0.45",
        "full dynamics, finite geometry, RK4, switching at step ends, time step 0.2 us",
        f"pauses up to {T_GAP * 1e3:g} ms",
        "19 main precursors, 3 events over the whole interface",
        "pyfric 0.1.0",
    ):
        assert part in caption
    interrupted = dataclasses.replace(ladder, status="interrupted")
    assert "Run interrupted." in figure_caption(interrupted)


def test_record_without_events(tmp_path):
    record = made_up_record(lengths=())
    fig = fig1b(record, tmp_path / "none")
    assert fig.axes[0].get_legend() is None
    assert fig.tables["slip"].empty
    empty = dataclasses.replace(record, curve=pd.DataFrame({"t": [], "F_T": []}, dtype=float))
    fig1b(empty, tmp_path / "empty")


def test_long_curves_keep_their_extremes():
    t = np.linspace(0, 1, 1_000_000)
    y = np.sin(20 * t)
    y[123_456] = -3.0
    y[654_321] = 3.0
    thin_t, thin_y = figures._envelope(t, y)
    assert thin_t.size <= 2 * figures.CURVE_BINS + 2
    assert (thin_t[0], thin_t[-1]) == (0, 1)
    assert (thin_y.min(), thin_y.max()) == (-3, 3)
    assert (np.diff(thin_t) > 0).all()


def test_drawing_leaves_no_global_state():
    code = (
        "import sys, pyfric.figures;"
        "assert 'matplotlib.pyplot' not in sys.modules;"
        "assert 'xarray' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
