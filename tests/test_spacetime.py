"""Space-time pictures: slip rates of an event, waves and theory as lines, energy release."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import pyfric
from pyfric import figures, theory
from pyfric.cli.commands import main
from pyfric.figures import spacetime
from pyfric.figures.spacetime import space_time, speeds, theory_times, wave_lines
from pyfric.figures.strip import event_frames
from pyfric.figures.style import DataFigure
from pyfric.record import analysis
from pyfric.record.growth import _before
from pyfric.scene import chain, setup1
from pyfric.statics import loaded_state


def small(**changes):
    """Return a scene of 29 x 16 blocks."""
    scene = setup1(**{"L": 0.07, "H": 0.0375, "V": 5e-3, "F_N": 1750.0} | changes)
    return pyfric.simulate(
        scene, 0.09, fidelity="hybrid", geometry="linear", switching="located", progress=False
    )


@pytest.fixture(scope="module")
def run():
    return small()


def longest(record):
    return int(record.events["n_front"].idxmax())


def chain_scene(n, taubar):
    return chain(L=(n - 1) * 2.5e-3, p=10.0, tau=10 * (0.45 + taubar * 0.25), V=1e-3)


def chain_run(n, taubar=0.5):
    how = {"fidelity": "hybrid", "switching": "located", "progress": False}
    return pyfric.simulate(chain_scene(n, taubar), 6e-4, **how)


def ruptures_are_where_slip_begins(axes):
    """Check that rupture times are those at which slip begins in the picture."""
    (image,), (black,) = axes.images, (ax for ax in axes.lines if "rupture" in ax.get_label())
    left, right, low, high = image.get_extent()
    v = image.get_array()
    for x, t in zip(*black.get_data(), strict=True):
        column = int((x - left) / (right - left) * v.shape[1])
        row = (t - low) / (high - low) * v.shape[0]
        assert (v[: int(row - 1), column] == 0).all()
        assert v[int(row + 2), column] > 0


@pytest.mark.parametrize("side", ["left", "right"])
def test_what_slips_has_ruptured(run, side):
    run = run if side == "left" else small(side="right")
    event = longest(run)
    fig = space_time(run, event)
    rates, front = fig.tables["slip_rate"], analysis.front(run, event)
    v = rates.pivot(index="t_s", columns="n", values="v_m_per_s")
    dt = run.method.dt
    for n, t in zip(front["n"], front["t"], strict=True):
        assert (v.loc[v.index < t - 0.01 * dt, n] == 0).all()
        assert (v.loc[v.index > t + 0.01 * dt, n].iloc[:3] > 0).all()
    still = v.columns.difference(front["n"])
    assert (v[still].abs().max() == 0).sum() >= len(still) - 1
    assert v.max(axis=None) > 0.01
    assert set(fig.tables["lines"]["name"]) == {"c_R", "c_S", "c_L"}
    ruptures_are_where_slip_begins(fig.axes[0])
    assert f"event {event} (first slip" in fig.caption
    assert "the lattice sets its speed" in fig.caption


def test_lines_have_the_speed_that_they_say(run):
    lines, L = wave_lines(run, longest(run)), run.scene.slider.L
    names = speeds(run.scene)
    assert names["c_R"] / names["c_S"] == pytest.approx(0.919402, rel=1e-6)
    assert names["c_L"] / names["c_S"] == pytest.approx(np.sqrt(3))
    for name, rows in lines.groupby("name"):
        x, t = rows["x_over_L"].to_numpy(), rows["t_s"].to_numpy()
        np.testing.assert_allclose(np.abs(np.diff(x)[::2]) * L / np.diff(t)[::2], names[name])
        assert {0.0, 1.0} & set(x)


def crept(record, event):
    """Return the record with a front from t = 1 s: three steps at 0.05 c_R, others at 0.9 c_R."""
    scene, times = record.scene, record.rupture_times.copy()
    steps = scene.slider.l / (speeds(scene)["c_R"] * np.where(np.arange(28) < 3, 0.05, 0.9))
    times[event - 1] = (1.0 + np.concatenate([[0.0], np.cumsum(steps)]))[scene.n_of_i - 1]
    return record.replace(rupture_times=times), 1.0 + steps[:3].sum()


def test_fracture_mechanics_begins_where_creep_ends(run):
    """Speeds follow from g_II(v) G = Gamma of static states; without enough energy none exists."""
    weak = dataclasses.replace(run.scene.interface, d_c=1e-6)
    record = dataclasses.replace(run, scene=dataclasses.replace(run.scene, interface=weak))
    event = longest(record)
    record, t = crept(record, event)
    line = theory_times(record, event)
    assert (line["name"] == "LEFM").all()
    n = np.rint(28 * line["x_over_L"]).astype(int) + 1
    known = analysis.energy_release(record, event).set_index("n")["v"]
    np.testing.assert_array_equal(line["speed_m_per_s"], known[n])
    assert n.iloc[0] == 4
    assert n.iloc[-1] == 29 or not known[n.iloc[-1] + 1] > 0
    assert line["t_s"].iloc[0] == pytest.approx(t, abs=1e-12)


def test_lines_begin_where_creep_ends(run):
    event = longest(run)
    record, t = crept(run, event)
    lines = wave_lines(record, event)
    np.testing.assert_allclose(lines["x_over_L"][::2], 3 / 28)
    np.testing.assert_allclose(lines["t_s"][::2], t, rtol=1e-12)
    axes = DataFigure().subplots()
    spacetime._lines(axes, lines, lines["t_s"].iloc[0], 1e6)
    for line in axes.lines:  # one half to each side, with a gap
        assert list(np.flatnonzero(np.isnan(line.get_xdata()))) == [2]


@pytest.mark.parametrize("n", [10, 80])
def test_a_chain_has_the_exact_front_beside_it(n):
    record = chain_run(n)
    event = longest(record)
    assert record.events["n_front"].loc[event] == n
    line, front = theory_times(record, event), analysis.front(record, event)
    assert len(line) == n
    c = speeds(record.scene)["c"]
    known = theory.chain_speed(0.5, 0.0, np.sqrt(0.1)) * c
    assert line["speed_m_per_s"].iloc[-1] == pytest.approx(known, rel=1e-6)
    steps = np.diff(line["t_s"]) * line["speed_m_per_s"].to_numpy()[1:]
    np.testing.assert_allclose(steps, record.scene.slider.l)
    if n == 80:  # the front has become steady
        late = np.diff(front["t"].to_numpy())[-20:]
        np.testing.assert_allclose(late, np.diff(line["t_s"])[-20:], rtol=0.01)
    tau = record.tau_before.copy()
    tau[event - 1, 6:] = 4.0  # below mu_k p: no front
    assert len(theory_times(record.replace(tau_before=tau), event)) == 6
    rates = space_time(record, event).tables["slip_rate"]
    assert 100 <= rates["t_s"].nunique() <= 500  # smaller steps where a front needs few


def test_energy_release_is_the_work_that_friction_leaves(run):
    """G is the difference of potential energy of held and released slider, in linear geometry.

    All forces but f are conservative. These forces release the mean of f times du, of which
    friction takes the mean of mu_k p times du.
    """
    weak = dataclasses.replace(run.scene.interface, d_c=1e-6)
    record = dataclasses.replace(run, scene=dataclasses.replace(run.scene, interface=weak))
    event = longest(record)
    table, scene = analysis.energy_release(record, event), record.scene
    contact, i = _before(record, event), int(np.argsort(scene.n_of_i)[0])
    given = contact.column.copy()
    now = contact.values()
    contact.change(i, scene.d)
    end, work, forces = contact.values(), 0.0, []
    held = _before(record, event)
    for share in np.linspace(0, 1, 11):
        held.column = given.copy()
        held.column[i] += share * (end.u_x[i] - now.u_x[i])
        held.renew()
        state = held.values()
        forces.append(-scene.d * state.f[i] - scene.interface.mu_k * state.p[i])
    work = np.trapezoid(forces, dx=0.1) * scene.d * (end.u_x[i] - now.u_x[i])
    assert forces[-1] == pytest.approx(0, abs=1e-9 * now.p[i])
    assert table["G"].iloc[0] == pytest.approx(work, rel=1e-9)
    p = now.p[i]
    assert table["Gamma"].iloc[0] == pytest.approx(0.25 * p * 1e-6 / 2)


def test_griffith_length_is_where_it_no_longer_pays(run):
    table = analysis.energy_release(run, longest(run))
    assert (table["Gamma"].dropna() == 0).all()  # no fracture energy without weakening
    table = table.assign(G=0.0, Gamma=1.0)
    assert analysis.griffith_length(table) == 0
    table.loc[2:10, "G"] = 2.0  # blocks 3 to 11 of 29
    assert analysis.griffith_length(table) == 11 / 29
    table.loc[2:, "G"] = 2.0
    assert analysis.griffith_length(table) == 1


def test_no_event_no_motion(run):
    for event in (-1, 0, 10**6, True):
        with pytest.raises(pyfric.SceneError, match="event = "):
            figures.space_time(run, event)


def test_a_ladder_has_no_motion(run):
    ladder = pyfric.simulate(run.scene, 0.09, fidelity="quasistatic", progress=False)
    with pytest.raises(pyfric.SceneError, match="'quasistatic': it has no motion; allowed: a run"):
        figures.space_time(ladder, longest(ladder))


def test_a_continued_run_is_the_whole_run(run):
    """The run may be stopped inside the event, too."""
    event, row = longest(run), run.events.loc[longest(run)]
    how = {"fidelity": "hybrid", "geometry": "linear", "switching": "located", "progress": False}
    stopped = pyfric.simulate(run.scene, (row["t_start"] + row["t_stop"]) / 2, **how)
    record = pyfric.simulate(run.scene, 0.09, initial=stopped, **how)
    one, two = (space_time(each, event).tables["slip_rate"] for each in (run, record))
    pd.testing.assert_frame_equal(one, two)


def test_a_run_from_another_state_is_refused():
    """The other state is at a later time, or at t = 0, where only the event is missing."""
    scene, how = chain_scene(40, 0.5), {"fidelity": "hybrid", "switching": "located"}
    for t_0 in (0.0, 1e-3):
        state = loaded_state(scene).state(scene, pyfric.step_size(scene), t_0)
        state.mode[20], state.y[0, 2, 20] = 1, 0.1
        record = pyfric.simulate(scene, t_0 + 3e-5, initial=state, progress=False, **how)
        with pytest.raises(pyfric.SceneError, match="from another state': not allowed"):
            space_time(record, longest(record))


def test_command_line(run, tmp_path):
    path = tmp_path / "run.nc"
    run.save(path)
    one = ["spacetime", str(path), "--event", "1", "--out", str(tmp_path / "x.png"), "--quiet"]
    assert CliRunner().invoke(main, one).exit_code == 0
    assert (tmp_path / "x.png").is_file()
    assert (tmp_path / "x_slip_rate.csv").is_file()
    (tmp_path / "y_pinned.csv").touch()  # junctions have it in place of slip rates
    there = ["--event", "1", "--out", str(tmp_path / "y")]
    for wrong in ([], ["--event", "0"], ["--event", "99999"], there):
        assert CliRunner().invoke(main, ["spacetime", str(path), *wrong]).exit_code == 2


@pytest.fixture(scope="module")
def crack(tmp_path_factory):
    """Return a file with 2 s of TPV3 on large blocks."""
    path = tmp_path_factory.mktemp("crack") / "crack.nc"
    scene = pyfric.preset("tpv3", {"slider.l": 500.0})
    pyfric.simulate(scene, 2.0, fidelity="dynamic", progress=False).save(path)
    return path


def test_a_crack_is_shown_from_its_record(crack):
    """The crack begins at once, in overloaded blocks, without earlier static states."""
    record = pyfric.Record.load(crack)
    fig = space_time(record, 1)
    rates = fig.tables["slip_rate"].pivot(index="t_s", columns="n", values="v_m_per_s")
    for n, t in zip(fig.tables["front"]["n"], fig.tables["front"]["t"], strict=True):
        assert (rates.loc[rates.index <= t, n] == 0).all()
        assert (rates.loc[rates.index > t + record.method.dt, n] > 0).all()
    assert set(fig.tables["lines"]["name"]) == {"c_R", "c_S", "c_L"}
    assert fig.axes[0].get_ylabel().endswith("(s)")
    assert "prescribed interface" in fig.caption
    frames = event_frames(record, 1, [record.final_state.t])
    order = np.argsort(record.scene.n_of_i)
    np.testing.assert_array_equal(frames[0].v, record.final_state.y[:, 2:, order])
    film = figures.event_movie(record, 1, crack.with_suffix(".gif"), count=3)
    assert film.stat().st_size > 0


@pytest.mark.parametrize("command", ["spacetime", pytest.param("movie", marks=pytest.mark.slow)])
def test_a_crack_is_shown_from_its_scene(command, tmp_path):
    out = tmp_path / "crack"
    options = ["--event", "1", "--t-end", "2", "--set", "slider.l=750 m", "--out", str(out)]
    done = CliRunner().invoke(main, [command, "tpv3", *options])
    assert done.exit_code == 0, done.output
    assert out.with_suffix(".png").stat().st_size > 0


def test_a_front_that_was_started_is_shown_from_its_first_state():
    """Blocks are released by hand; the loaded slider would stay at rest."""
    scene = chain_scene(30, 0.5)
    scene = scene.replace({"driver.K": 0.0, "driver.V": 0.0})
    state = loaded_state(scene).state(scene, 2e-7)
    state.mode[:3], state.y[0, 2, :3] = 1, 1e-6
    how = {"fidelity": "dynamic", "progress": False, "switching": "located"}
    record = pyfric.simulate(scene, 5e-5, initial=state, **how)
    with pytest.raises(pyfric.SceneError, match="as initial"):
        space_time(record, 1)
    fig = space_time(record, 1, initial=state)
    ruptures_are_where_slip_begins(fig.axes[0])
    frames = event_frames(record, 1, [record.final_state.t], initial=state)
    order = np.argsort(record.scene.n_of_i)
    np.testing.assert_array_equal(frames[0].v, record.final_state.y[:, 2:, order])
