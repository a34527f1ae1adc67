"""Figures show the content of the record, and their files carry data and caption."""

import dataclasses
import re
from unittest import mock

import matplotlib
import numpy as np
import pandas as pd
import pytest
from helpers import refused
from matplotlib.animation import FFMpegWriter
from matplotlib.collections import LineCollection

import pyfric
from pyfric import figures, laws
from pyfric.figures import fig1b, figure_caption, save_figure, slip_segments, strip
from pyfric.figures.loading import CURVE_BINS, envelope
from pyfric.figures.spacetime import speeds as wave_speeds
from pyfric.figures.strip import event_frames, frame_times
from pyfric.figures.style import SMALL, colour_bar, panels, scene_text
from pyfric.paper import reproduction
from pyfric.record import (
    QUIET_COLUMNS,
    SWITCH_COLUMNS,
    T_GAP,
    Method,
    Record,
    analysis,
    build_catalogue,
)
from pyfric.scene import setup1, setup2

LADDER = (6, 8, 10, 12, 14, 17, 20, 23, 27, 31, 36, 42, 49, 57, 9, 22, 40, 57, 11, 26, 45, 57)


def made_up_record(side="left", lengths=LADDER, opened=()):
    """Return a record like Fig. 1(b): loading, growing precursors, micro-slips between."""
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
            engine="dynamic",
            geometry="finite",
            stepper="rk4",
            switching="step_end",
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


def test_legend_keeps_off_a_short_curve(ladder):
    end = ladder.curve["F_T"].max() / ladder.scene.F_N
    short = ladder.curve.assign(F_T=0.2 * ladder.curve["F_T"] / end)
    fig = pyfric.figures.fig1b(dataclasses.replace(ladder, curve=short))
    fig.draw_without_rendering()
    axes = fig.axes[0]
    box = axes.get_legend().get_window_extent()
    points = axes.transData.transform(axes.lines[-1].get_xydata())
    assert not box.count_contains(points)


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


def test_times_of_a_short_run_are_in_milliseconds(ladder):
    curve = ladder.curve[ladder.curve["t"] < 0.01]
    top, bottom = fig1b(ladder.replace(curve=curve)).axes
    assert "(ms)" in bottom.get_xlabel()
    np.testing.assert_allclose(top.get_lines()[-1].get_xdata(), 1e3 * curve["t"])
    starts = [one[0, 0] for bars in bottom.collections for one in bars.get_segments()]
    np.testing.assert_allclose(sorted(starts), np.sort(1e3 * slip_segments(ladder)["t_s"]))


def test_all_text_stays_inside_and_is_readable(ladder):
    inside_and_readable(fig1b(ladder))


def inside_and_readable(fig, width=3.4):
    fig.canvas.draw()
    assert fig.get_figwidth() == width
    right, top = fig.canvas.get_width_height()
    for text in fig.findobj(matplotlib.text.Text):
        if text.get_text() and text.get_visible():
            assert text.get_fontsize() >= 7
    for axes in fig.axes:
        box = axes.get_tightbbox()
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= right
        assert box.y1 <= top


def test_saved_files(ladder, tmp_path):
    stem = tmp_path / "new" / "fig1b"
    fig = fig1b(ladder)
    with pytest.raises(OSError, match=r"No such file or directory: .*new.fig1b\.png"):
        save_figure(fig, stem)
    stem.parent.mkdir()
    save_figure(fig, stem)
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


def test_the_suffix_of_a_figure_is_optional_and_no_other(ladder, tmp_path):
    fig = fig1b(ladder)
    files = save_figure(fig, tmp_path / "a")
    for name in ("a.png", "a.pdf", "a.PNG", "a.png.png"):
        assert save_figure(fig, tmp_path / name) == files
    for name in ("b.csv", "b.svg", "b.nc", "b.csv.png"):
        refused = f"path = '.*{name[:4]}.*': the file would be PNG, not .*; .* ends in .png"
        with pytest.raises(pyfric.SceneError, match=refused):
            save_figure(fig, tmp_path / name)
    assert sorted(tmp_path.iterdir()) == sorted(files)


def test_caption_states_scene_engine_and_counts(ladder):
    caption = figure_caption(ladder)
    for part in (
        "L = 140 mm",
        "F_N = 3500 N",
        "h = 5 mm",
        "mu_s = 0.7, mu_k = 0.45",
        "dynamic engine, finite geometry, rk4, dt = 0.2 us, stick-slip transitions at step ends",
        f"pauses up to {T_GAP * 1e3:g} ms",
        "19 main precursors, 3 events over the whole interface",
        "pyfric 0.1.0",
    ):
        assert part in caption
    interrupted = dataclasses.replace(ladder, status="interrupted")
    assert "Run interrupted." in figure_caption(interrupted)


def test_an_event_that_has_not_ended_is_no_precursor(ladder):
    last = ladder.events.index[ladder.events["is_main"] & ladder.events["is_precursor"]][-1]
    finished = ladder.events["finished"] & (ladder.events.index != last)
    cut = ladder.replace(events=ladder.events.assign(finished=finished))
    counts = "18 main precursors, 3 events over the whole interface, 1 unfinished main event, "
    assert counts in figure_caption(cut)
    assert "unfinished" not in figure_caption(ladder)


def test_caption_states_slip_weakening():
    scene = setup1(d_c=5e-6)
    assert "mu_k = 0.45, d_c = 5 um." in scene_text([scene])
    assert "d_c" not in scene_text([setup1()])
    assert "d_c = 0, 5 um." in scene_text([scene, setup1()])
    law = laws.TabulatedLaw(slip=(0.0, 3e-6), mu=(0.7, 0.45))
    text = scene_text([setup1().replace(law=law)])
    assert "law TabulatedLaw(slip 0 to 3 um" in text
    assert "d_c" not in text


def test_record_without_events(tmp_path):
    record = made_up_record(lengths=())
    fig = fig1b(record)
    save_figure(fig, tmp_path / "none")
    assert fig.axes[0].get_legend() is None
    assert fig.tables["slip"].empty
    empty = dataclasses.replace(record, curve=pd.DataFrame({"t": [], "F_T": []}, dtype=float))
    save_figure(fig1b(empty), tmp_path / "empty")


def test_long_curves_keep_their_extremes():
    t = np.linspace(0, 1, 1_000_000)
    y = np.sin(20 * t)
    y[123_456] = -3.0
    y[654_321] = 3.0
    thin_t, thin_y = envelope(t, y)
    assert thin_t.size <= 2 * CURVE_BINS + 2
    assert (thin_t[0], thin_t[-1]) == (0, 1)
    assert (thin_y.min(), thin_y.max()) == (-3, 3)
    assert (np.diff(thin_t) > 0).all()


# --- figures 2 to 4, on a small slider -----------------------------------------------------------


def small(side="left", **changes):
    """Return a run with eight main precursors and a few events over the whole interface."""
    own = {"L": 0.07, "H": 0.0375, "V": 5e-3, "F_N": 1750.0, "name": "small", "side": side}
    return simulated(setup1(**own | changes), 0.11)


def simulated(scene, t_end, **options):
    how = {"fidelity": "hybrid", "geometry": "linear", "progress": False}
    return pyfric.simulate(scene, t_end, **how, **options)


@pytest.fixture(scope="module")
def run():
    return small()


@pytest.fixture(scope="module")
def short():
    """Return a run with another height and load, up to a few precursors."""
    return simulated(small_scene(h=7.5e-3, F_N=1500.0, name="short"), 0.05)


def small_scene(**changes):
    return setup1(**{"L": 0.07, "H": 0.0375, "V": 5e-3, "F_N": 1750.0} | changes)


def test_lengths_are_those_of_the_records_with_their_predictions(run, short):
    fig = figures.fig2a([run, short])
    points, curves = fig.tables["points"], fig.tables["prediction"]
    for record in (run, short):
        mine = points[points["scene"] == record.scene.name]
        expected = analysis.precursor_lengths(record)
        assert len(mine) == len(expected) > 3
        np.testing.assert_array_equal(mine["F_T_over_F_N"], expected["force"])
        np.testing.assert_array_equal(mine["L_p_over_L"], expected["L_p_over_L"])
        assert (mine["h_mm"] == record.scene.driver.h * 1e3).all()
        curve = pyfric.prediction_curve(record.scene).curve
        mine = curves[curves["scene"] == record.scene.name]
        np.testing.assert_array_equal(mine["F_T_over_F_N"], curve["F_T"] / record.scene.F_N)
        assert mine["L_p_over_L"].iloc[-1] == 1
    (axes,) = fig.axes
    drawn = [line for line in axes.get_lines() if line.get_marker() in ("o", "s", "^", "D")]
    assert sum(len(line.get_xdata()) for line in drawn) == points["advances"].sum()
    assert [0.45, 0.45] in [list(line.get_xdata()) for line in axes.get_lines()]  # mu_k
    assert f"{len(points)} precursors" in fig.caption
    assert "h = 5, 7.5 mm" in fig.caption
    assert "F_N = 1500, 1750 N" in fig.caption
    assert "hybrid engine, linear geometry" in fig.caption
    inside_and_readable(fig)


def test_runs_that_differ_in_load_are_shifted(run):
    scene = run.scene.replace(F_N=1600.0, name="other load")
    events = run.events.assign(F_T_arrest=run.events["F_T_arrest"] * 1600 / 1750 + 1.6)
    method = dataclasses.replace(run.method, geometry="finite")
    other = dataclasses.replace(run, scene=scene, events=events, method=method)
    fig = figures.fig2a([run, other])
    first, second = (line for line in fig.axes[1].get_lines() if line.get_marker() == "o")
    assert first.get_markerfacecolor() != second.get_markerfacecolor()
    shifted = lengths_in_order([other, run])
    for n, line in enumerate((first, second)):
        np.testing.assert_allclose(line.get_xdata(), shifted[n] + n * figures.lengths.SHIFT)


def lengths_in_order(records):
    """Return the forces of precursors that advance, one array for each record."""
    tables = [figures.lengths.lengths_of([one]) for one in records]
    return [table.loc[table["advances"], "F_T_over_F_N"].to_numpy() for table in tables]


def test_precursors_behind_an_earlier_one_are_told_apart(run):
    lengths = figures.lengths.lengths_of([run])
    ahead = lengths["L_p_over_L"][lengths["advances"]]
    assert (np.diff(ahead) > 0).all()
    behind = lengths[~lengths["advances"]]
    for row, one in behind.iterrows():
        assert one["L_p_over_L"] <= lengths["L_p_over_L"][:row].max()


def test_slopes_of_the_load_are_three_curves():
    records = [
        simulated(setup2(L=0.05, H=0.01, V=5e-3, theta=theta, name=f"theta {theta}"), 0.04)
        for theta in (0.8, -0.8, 0.0)
    ]
    fig = figures.fig2b(records)
    points = fig.tables["points"]
    # lower load on the trailing edge: lower force for the same length
    curves = [points[points["theta"] == theta] for theta in (0.8, 0.0, -0.8)]
    force = [np.interp(0.3, one["L_p_over_L"], one["F_T_over_F_N"]) for one in curves]
    assert force[0] < force[1] < force[2]
    shown = [text.get_text() for text in fig.axes[0].get_legend().get_texts()]
    assert [text for text in shown if "theta" in text] == [
        rf"$\theta = {theta:g}$" for theta in (-0.8, 0, 0.8)
    ]
    inside_and_readable(fig)


def test_profiles_about_a_precursor(run):
    event = int(analysis.precursor_lengths(run)["event"][3])
    fig = figures.fig3a(run, event)
    table = fig.tables["profiles"].set_index("state")
    for state, when in (("before", "before"), ("after", "after")):
        expected = analysis.stress_profile(run, event, when)
        np.testing.assert_array_equal(table.loc[state, "tau"], expected["tau"])
        np.testing.assert_array_equal(table.loc[state, "p"], expected["p"])
    initial = table.loc["initial"]
    p, tau = initial["p"].to_numpy(), initial["tau"].to_numpy()
    np.testing.assert_allclose(p, p[::-1], rtol=1e-9)
    np.testing.assert_allclose(tau, -tau[::-1], atol=1e-9)
    for state in ("initial", "before", "after"):  # sums of p and tau are the loads
        assert table.loc[state, "p"].mean() == pytest.approx(1, rel=1e-9)
    force = run.events["F_T_arrest"][event] / run.scene.F_N
    assert table.loc["after", "tau"].mean() == pytest.approx(force, rel=1e-9)
    slipped = table.loc["after"]["region"].to_numpy() == 1
    inner = np.flatnonzero(slipped)[:-1]
    np.testing.assert_allclose(table.loc["after", "tau_over_p"].iloc[inner], 0.45, atol=0.05)
    assert f"before and after event {event} " in fig.caption
    inside_and_readable(fig)


@pytest.mark.parametrize("figure", [figures.fig3a, figures.fig4a])
def test_figures_of_one_event_show_the_longest_precursor_by_default(run, short, figure):
    lengths = analysis.precursor_lengths(run)
    longest = int(lengths["event"][lengths["L_p_over_L"].argmax()])
    assert f"event {longest} " in figure(run).caption
    for event in (0, len(run.events) + 1):
        with pytest.raises(pyfric.SceneError, match=r"event = .*an event of the record, 1 to"):
            figure(run, event)
    none = run.replace(events=run.events.assign(is_precursor=False))
    with pytest.raises(pyfric.SceneError, match="raise t_end"):
        figure(none)


def test_stresses_of_a_chain_are_all_seen():
    """Its p does not change: dotted over dashed over solid lines are visible, beside the legend."""
    run = simulated(pyfric.chain(L=0.05, V=0.05), 1e-3)
    fig = figures.fig3a(run, 1)
    fig.draw_without_rendering()
    top, bottom = fig.axes
    assert [line.get_linestyle() for line in top.lines[:3]] == ["-", "--", ":"]
    texts = [text.get_text().split(",")[0] for text in top.get_legend().get_texts()]
    assert texts == ["initial", "before", "after"]
    box = top.get_legend().get_window_extent()
    for line in top.lines[:3]:
        assert not box.count_contains(top.transData.transform(line.get_xydata()))
    name = next(one for one in bottom.texts if "before" in one.get_text())
    assert name.get_window_extent().y1 < bottom.get_window_extent().y1


def test_the_paper_s_event_is_counted_where_the_paper_counts_it(run):
    """The event is the eleventh main precursor of the first loading, by any event number."""
    assert {one.precursor for one in figures.FIGURES.values()} == {None, 11}
    refused(lambda: reproduction._event("fig4a", run), "main precursors", value=8, within=(11,))
    again = figures.FIGURES["fig4a"]._replace(precursor=6)
    with mock.patch.dict(figures.FIGURES, fig4a=again):
        event = analysis.precursor_lengths(run)["event"][5]
        assert reproduction._event("fig4a", run) == {"event": event}
    assert reproduction._event("fig1b", run) == {}


def test_normal_forces_after_precursors_and_sliding(run, short):
    fig = figures.fig3b(run)
    before, after = fig.tables["precursors"], fig.tables["sliding"]
    precursors = analysis.precursor_lengths(run)["event"]
    assert list(before["event"].unique()) == list(precursors[[1, 3, 5, 7]])
    assert after["event"].nunique() == len(analysis.system_size_events(run)) >= 3
    top, bottom = fig.axes
    assert sum(len(line.get_xdata()) == 29 for line in top.get_lines()) == 4
    assert (
        sum(len(line.get_xdata()) == 29 for line in bottom.get_lines())
        == after["event"].nunique() + 1
    )
    inside_and_readable(fig)
    with pytest.raises(pyfric.SceneError, match="events over the whole interface"):
        figures.fig3b(short)


def test_front_speed_and_prestress_of_one_event(run):
    event = int(analysis.precursor_lengths(run)["event"][5])
    fig = figures.fig4a(run, event)
    pd.testing.assert_frame_equal(fig.tables["front"], analysis.front(run, event))
    top = fig.axes[0]
    speeds = [line.get_ydata()[0] for line in top.get_lines() if len(line.get_xdata()) == 2]
    known = wave_speeds(run.scene)
    np.testing.assert_allclose(sorted(speeds), [known["c_S"], known["c_L"]])
    shown = next(line for line in top.get_lines() if line.get_marker() == "o")
    np.testing.assert_array_equal(shown.get_ydata(), fig.tables["front"]["v_c"])
    assert f"{fig.tables['front']['v_c'].count()} points" in fig.caption
    inside_and_readable(fig)


def test_wave_speeds_are_the_paper_s():
    scene = setup1()
    blocks = (scene.N_x - 1) * (scene.N_z - 1) / (scene.N_x * scene.N_z)
    speeds = [wave_speeds(scene)[name] * np.sqrt(blocks) for name in ("c_L", "c_S")]
    np.testing.assert_allclose(speeds, [1677, 968], rtol=1e-3)


def test_a_chain_has_one_wave_speed():
    scene = pyfric.chain(L=0.025)
    fig = figures.fig4b([simulated(scene, 1e-3)])
    assert [text.get_text() for text in fig.axes[0].texts] == ["$c$"]
    c = scene.slider.l * np.sqrt(scene.slider.k / scene.m)
    assert fig.axes[0].get_lines()[-1].get_ydata()[0] == pytest.approx(c)


def test_speeds_of_several_runs(run):
    weak = small(mu_s=0.5, mu_k=0.2)  # a scene with the same name
    fig = figures.fig4b([run, weak])
    points = fig.tables["points"]
    for n, record in enumerate((run, weak), 1):
        all_fronts = analysis.fronts(record)
        mine = points[points["run"] == n]
        known = all_fronts["v_c"].notna() & all_fronts["tau_over_p"].notna()
        assert len(mine) == known.sum() > 20
        mu_s, mu_k = record.scene.interface.mu_s, record.scene.interface.mu_k
        np.testing.assert_allclose(mine["scaled"], (mine["tau_over_p"] - mu_k) / (mu_s - mu_k))
    both = fig.axes
    for axes, x in zip(both, ("tau_over_p", "scaled"), strict=True):
        lines = [line for line in axes.get_lines() if line.get_marker() in ("o", "s")]
        drawn = [line for line in lines if line.get_linestyle() == "None"]
        assert sum(len(line.get_xdata()) for line in drawn) == len(points)
        medians = [one for one in lines if one not in drawn]
        for n, line in enumerate(medians, 1):
            mine = points[points["run"] == n]
            far = mine[mine[x] >= mine[x].quantile(0.9)]
            assert line.get_ydata()[-1] == pytest.approx(far["v_c"].median(), rel=0.1)
    assert set(fig.tables["medians"]["run"]) == {1, 2}
    assert "mu_s/mu_k = 0.5/0.2, 0.7/0.45" in fig.caption
    inside_and_readable(fig)


def test_labels_of_less_than_a_decade_are_as_small_as_others():
    fig, (axes,) = panels(2.0)
    axes.set(yscale="log", ylim=(600, 1300))
    norm = matplotlib.colors.LogNorm(0.45, 0.55)
    colour_bar(fig, matplotlib.cm.ScalarMappable(norm), axes, "")
    for one in fig.axes:
        labels = [label for label in one.get_yticklabels(which="both") if label.get_text()]
        assert len(labels) > 1
        assert {label.get_fontsize() for label in labels} == {SMALL}


# --- sketch, strip and movie ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "texts"),
    [
        (setup1(), ("$L$ = 140 mm", "$H$ = 75 mm", "$h$ = 5 mm", "rod 75.6 g", "3500 N")),
        (setup2(theta=0.5, side="right"), ("400 N", r"$\theta = 0.5$", "$K$ = 0.8 MN/m")),
        (pyfric.chain(L=0.05, tau=10.0, k_top=2e6), ("61.4 N on each", "= 2 MN/m to a rigid top")),
    ],
)
def test_sketch_shows_the_scene_with_its_numbers(scene, texts):
    if scene.N_z == 1:
        scene = pyfric.chain(L=0.05, p=61.4, tau=10.0, k_top=2e6)
    fig = figures.sketch(scene)
    shown = " ".join(text.get_text() for text in fig.findobj(matplotlib.text.Text))
    for text in texts:
        assert text in shown
    table = fig.tables["columns"]
    np.testing.assert_array_equal(table["load_N"], scene.load)
    np.testing.assert_array_equal(table["shear_N"], scene.shear)
    blocks = next(line for line in fig.axes[0].get_lines() if line.get_marker() == "s")
    x, z, L = blocks.get_xdata() / 100, blocks.get_ydata() / 100, scene.slider.L
    assert (x.min(), x.max()) == pytest.approx((0, 1))
    assert (z.min(), z.max()) == pytest.approx((0, scene.slider.H / L))
    if scene.N_z > 1:  # the driven row is drawn
        assert np.isclose(z, scene.driver.h / L).any()
    all_inside(fig)


def all_inside(fig):
    fig.canvas.draw()
    right, top = fig.canvas.get_width_height()
    for text in fig.findobj(matplotlib.text.Text):
        if text.get_text():
            box = text.get_window_extent()
            assert -1 <= box.x0 <= box.x1 <= right + 1
            assert -1 <= box.y0 <= box.y1 <= top + 1


@pytest.mark.parametrize("side", ["left", "right"])
def test_sketch_has_room_for_long_numbers(side):
    fields = {"mu_s": 0.677, "mu_k": 0.525, "d_c": 12.25e-6, "k_f": 9.375e6}
    all_inside(figures.sketch(setup1(side=side, **fields)))
    varied = {"mu_s": 0.7, "d_c": 12.25e-6, "alpha": 1.5}
    varied = {name: pyfric.Spread(mean=mean, std=0.1 * mean) for name, mean in varied.items()}
    fig = figures.sketch(setup1(side=side, **varied))
    all_inside(fig)
    shown = " ".join(text.get_text() for text in fig.findobj(matplotlib.text.Text))
    assert shown.count(r"$\mu_\mathrm{s}$") == shown.count(r"$d_\mathrm{c}$") == 1


def test_sketch_shows_a_field_of_the_law_that_varies():
    fig = figures.sketch(pyfric.preset("slow", u_s=pyfric.Spread(mean=1e-6, std=1e-7)))
    all_inside(fig)
    shown = [text.get_text() for text in fig.findobj(matplotlib.text.Text)]
    assert any(re.fullmatch(r"u_s\n0\.\d+\$-\$1\.\d+ \$\\mu\$m", text) for text in shown)


@pytest.mark.filterwarnings("error")
def test_sketch_shows_fields_of_starts_and_gaps():
    """Blocks without a limit are left out of the curve of its times."""
    wavy = pyfric.preset("wavy", l="5 mm")
    scene = pyfric.weakened(wavy, x=0.05, length=0.03, speed=200.0)
    scene = scene.replace({"interface.slip": [1e-6 * (n < 9) for n in range(scene.N_x)]})
    drawing = figures.sketch(scene)
    told = " ".join(text.get_text() for text in drawing.findobj(matplotlib.text.Text))
    for text in ("gap", "slip before", "limit from"):
        assert text in told
    heights = [line.get_ydata() for line in drawing.axes[0].lines]
    limits = [y for y in heights if np.isnan(np.asarray(y, dtype=float)).any()]
    assert len(limits) == 1
    assert np.isfinite(limits[0]).sum() == np.isfinite(scene.field("limit_from")).sum()


def test_numbers_of_a_large_scene_are_in_large_units():
    fig = figures.sketch("tpv3")
    shown = " ".join(text.get_text() for text in fig.findobj(matplotlib.text.Text))
    for text in ("$L$ = 17.9 km", "$H$ = 11.9 km", "= 200 mm", "12 to 120 GN", "up to 8.16 GN"):
        assert text in shown
    assert "L = 17.9 km, H = 11.9 km, l = 100 m " in fig.caption
    assert "e+" not in shown + fig.caption


@pytest.mark.filterwarnings("error")
def test_sketch_of_a_prescribed_interface_shows_its_forces_on_the_bottom_row():
    """The sketch shows p_i and tau_i, no foundation, and no absent driver."""
    scene = pyfric.slab(p=lambda x: 60.0 + 1e3 * x, tau=30.0, L=0.03, H=0.01, l=2.5e-3)
    fig = figures.sketch(scene)
    np.testing.assert_array_equal(fig.tables["columns"]["load_N"], scene.p_prescribed)
    shown = [text for text in fig.findobj(matplotlib.text.Text) if text.get_text()]
    said = " ".join(text.get_text() for text in shown)
    assert "60 to 90 N on each" in said
    assert "up to 30 N" in said
    assert "$K$" not in said
    assert "k_" not in said
    fig.canvas.draw()
    top = fig.canvas.get_width_height()[1]
    assert all(text.get_window_extent().y1 <= top + 1 for text in shown)
    assert "$K$ = 4 MN/m" in " ".join(
        text.get_text()
        for text in figures.sketch(scene.replace(K=4e6)).findobj(matplotlib.text.Text)
    )


def test_figures_of_fronts_without_known_speed_and_of_other_setups():
    record = made_up_record(lengths=(4,))  # five blocks make a speed
    figure = figures.fig4a(record, 1)
    assert figure.tables["front"]["v_c"].isna().all()
    assert np.isfinite(figure.axes[0].get_ylim()).all()
    with pytest.raises(pyfric.SceneError, match=r"scene\.top\.kind = 'rod'.*setup 2"):
        figures.fig2b([record])


@pytest.mark.parametrize("draw", [figures.fig2a, figures.fig2b, figures.fig4b])
def test_figures_of_several_runs_name_what_is_missing(draw):
    with pytest.raises(pyfric.SceneError, match=r"records = \[\]: none is given"):
        draw([])
    with pytest.raises(pyfric.SceneError, match=r"records = 'Record': not a list; .* a list of"):
        draw(made_up_record(lengths=(4,)))


DRAWN = ("fig1a", "fig1b", "fig3a", "fig3b", "fig4a")


@pytest.mark.parametrize("draw", [figures.FIGURES[name].draw for name in DRAWN])
def test_figures_of_one_run_refuse_a_list(draw):
    with pytest.raises(pyfric.SceneError, match=r"record = 'list': not a record; .* one record"):
        draw([made_up_record(lengths=(4,))])


@pytest.mark.parametrize("switching", ["step_end", "located"])
def test_frames_run_the_event_again(run, switching):
    if switching == "located":
        run = simulated(run.scene, 0.08, switching=switching)
    event = int(analysis.precursor_lengths(run)["event"][5])
    row, times = run.events.loc[event], run.rupture_times[run.row(event)]
    ruptured = np.sort(times[np.isfinite(times)])
    ended = row["t_stop"] + np.array([1e-5, 4e-5])  # two times after the last block has stopped
    frames = event_frames(run, event, [*ruptured, *ended])
    dt = run.method.dt
    for t, frame in zip(ruptured, frames, strict=False):
        assert 0 <= frame.t - t < 1.001 * dt
        # ruptured blocks have slipped or slip, so that the front is at the same place
        behind = np.isfinite(times) & (times < frame.t - 1.5 * dt) & (times > frame.t - 5 * dt)
        assert (np.abs(frame.mode[behind]) == 1).all()
        ahead = np.isfinite(times) & (times > frame.t + 1.5 * dt)
        assert (frame.mode[ahead] != 1).all()
        slips = frame.mode == 1
        np.testing.assert_allclose(frame.tau_over_p[slips], run.scene.interface.mu_k, rtol=1e-12)
        assert (np.abs(frame.tau) <= run.scene.interface.mu_s * frame.p * (1 + 1e-9)).all()
        assert (frame.v[0, 0, frame.mode == 0] == 0).all()
    assert not (np.abs(frames[-1].mode) == 1).any()


def test_frames_of_a_mirrored_run_are_the_same(run):
    mirrored = small(side="right")
    event = int(analysis.precursor_lengths(run)["event"][3])
    one, other = (event_frames(r, event, frame_times(r, event, [0.5]))[0] for r in (run, mirrored))
    np.testing.assert_array_equal(one.mode, other.mode)
    accuracy = run.method.accuracy  # slow shapes are not exactly symmetric
    np.testing.assert_allclose(one.v[:, 0], other.v[:, 0], atol=accuracy * np.abs(one.v).max())
    np.testing.assert_allclose(one.tau, other.tau, atol=accuracy * one.p.max())


def test_strip_and_movie(run, tmp_path):
    event = int(analysis.precursor_lengths(run)["event"][5])
    fig = figures.event_strip(run, event)
    field, interface = fig.tables["field"], fig.tables["interface"]
    assert len(field) == 6 * 29 * 16
    images = [axes.images[0] for axes in fig.axes if axes.images]
    assert len(images) == 6
    for number, image in enumerate(images, 1):
        mine = field[field["frame"] == number]
        np.testing.assert_array_equal(image.get_array().ravel(), mine["v_x_m_per_s"])
        below = interface[interface["frame"] == number]
        bottom = field[(field["frame"] == number) & (field["row"] == 0)]
        assert (bottom["v_x_m_per_s"].to_numpy()[below["mode"] == 0] == 0).all()
    assert f"Event {event}" in fig.caption
    inside_and_readable(fig, 6.8)
    path = figures.event_movie(run, event, tmp_path / "event.gif", count=3)
    assert path.read_bytes()[:6] == b"GIF89a"
    assert [one.name for one in tmp_path.iterdir()] == ["event.gif"]
    shown = path._repr_html_()
    assert shown.startswith('<img alt="event" src="data:image/gif;base64,R0lGOD')
    assert len(shown) > path.stat().st_size
    film = path.rename(tmp_path / "event.mp4")
    assert film._repr_html_().startswith('<video controls loop muted src="data:video/mp4;base64,')


def test_a_film_is_what_its_name_says(run, tmp_path, monkeypatch):
    monkeypatch.setattr(strip, "event_frames", None)  # refused before anything is made
    for name in ("event.avi", "event", "event.gif.png"):
        with pytest.raises(pyfric.SceneError, match=r"ends in \.gif"):
            figures.event_movie(run, 5, tmp_path / name)
    monkeypatch.setattr(FFMpegWriter, "isAvailable", lambda: False)
    with pytest.raises(pyfric.SceneError, match="needs ffmpeg"):
        figures.event_movie(run, 5, tmp_path / "event.mp4")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="there is no ffmpeg")
def test_an_mp4_is_one(run, tmp_path):
    event = int(analysis.precursor_lengths(run)["event"][5])
    path = figures.event_movie(run, event, tmp_path / "event.mp4", count=3)
    assert path.read_bytes()[4:8] == b"ftyp"
    assert [one.name for one in tmp_path.iterdir()] == ["event.mp4"]


def test_strip_refuses_what_it_cannot_show(run):
    ladder = pyfric.simulate(run.scene, 0.05, fidelity="quasistatic", progress=False)
    with pytest.raises(pyfric.SceneError, match="hybrid or the dynamic engine"):
        figures.event_strip(ladder, 1)
    for event in (-1, 0, len(run.events) + 1, 1.0, True):
        with pytest.raises(pyfric.SceneError, match="event = "):
            figures.event_strip(run, event)
    with pytest.raises(pyfric.SceneError, match="times"):
        event_frames(run, 5, [0.0])
    how = {"fidelity": "hybrid", "geometry": "linear", "progress": False}
    other = pyfric.simulate(run.scene, 0.01, **how).final_state
    late = pyfric.simulate(run.scene, 0.05, initial=other, **how)
    assert len(late.events)
    with pytest.raises(pyfric.SceneError, match="from the loaded slider"):
        figures.event_strip(late, len(late.events))
