"""Definitions of the event catalogue, on logs small enough to work out by hand."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import pyfric
from pyfric.record import build_catalogue, front_speed
from pyfric.record.episodes import QUIET_COLUMNS, SWITCH_COLUMNS
from pyfric.record.held import found_arrays, held_in
from pyfric.record.rupture import five_known, longest_link, rupture_front
from pyfric.scene import setup1
from pyfric.scene.friction import CoulombLaw
from pyfric.statics import EquilibriumError

MS = 1e-3
DT = 1e-7
STUCK, RIGHT, LEFT, OPEN = 0, 1, -1, 2


def make_scene(N_x=8, d=1, j_h=2, l=2.5e-3):
    """Return an object with the attributes of a scene that the catalogue reads."""
    i = np.arange(N_x)
    return SimpleNamespace(
        N_x=N_x,
        load_at=lambda _: None,
        N_z=2,
        top=None,  # no prescribed load
        d=d,
        ahead=d,
        j_h=j_h,
        m=4e-5,
        law=CoulombLaw(0.7, 0.45),
        n_of_i=i + 1 if d == 1 else N_x - i,
        slider=SimpleNamespace(l=l, k=1.35e7),
        driver=SimpleNamespace(V=1e-3, side="left" if d == 1 else "right"),
        drive=lambda t: 1e-3 * t,
    )


def columns(rows, kinds, N_x=None):
    """Return a log as the engines write it."""
    values = zip(*rows, strict=True) if rows else [[]] * len(kinds)
    found = {
        name: np.array(column, dtype=kind)
        for (name, kind), column in zip(kinds.items(), values, strict=True)
    }
    wide = ("u_x", "mode") if N_x else ()
    return found | {name: found[name].reshape(-1, N_x) for name in wide}


class Run:
    """A run that writes the two logs like an engine; blocks are columns i from the left."""

    def __init__(self, N_x=8, opened=()):
        self.mode = np.zeros(N_x, dtype=np.int32)
        self.mode[list(opened)] = OPEN
        self.corner = np.zeros(N_x, dtype=bool)
        self.u_x = np.zeros(N_x)
        self.changes = []

    def set(self, t, i, new, corner=False, u_x=0.0, p=10.0):
        self.changes.append((t, i, new, corner, u_x, p))
        return self

    def slip(self, i, t_start, t_stop=None, *, new=RIGHT, after=STUCK, corner=False, u_x=1e-6):
        self.set(t_start, i, new, corner)
        if t_stop is not None:
            self.set(t_stop, i, after, corner, u_x)
        return self

    def logs(self):
        switches, quiet = [], []
        mode, corner, u_x = self.mode.copy(), self.corner.copy(), self.u_x.copy()
        active = False
        for t, i, new, is_corner, u, p in sorted(self.changes, key=lambda change: change[0]):
            step = int(np.ceil(t / DT - 1e-6))
            switches.append((step, i, mode[i], new, is_corner, t, u, p))
            mode[i], corner[i], u_x[i] = new, is_corner, u
            now = bool(np.any((np.abs(mode) == 1) & ~corner))
            if now != active:
                kind = 1 if now else -1
                quiet.append((step, t, kind, 100.0 + t, u_x.copy(), mode.copy()))
                active = now
        return columns(switches, SWITCH_COLUMNS), columns(quiet, QUIET_COLUMNS, mode.size)

    def catalogue(self, scene=None, **options):
        return build_catalogue(*self.logs(), scene or make_scene(self.mode.size), **options)


# --- episodes ------------------------------------------------------------------------------------


def test_episode_holds_block_times_slip_and_direction():
    run = Run().set(1 * MS, 2, LEFT, u_x=5e-6, p=12.5).set(3 * MS, 2, STUCK, u_x=2e-6)
    (row,) = run.catalogue(make_scene(d=-1)).episodes.to_dict("records")
    assert (row["n"], row["i"]) == (6, 2)
    assert (row["t_start"], row["t_stop"]) == (1 * MS, 3 * MS)
    assert (row["u_x_start"], row["u_x_stop"]) == (5e-6, 2e-6)
    assert row["slip"] == 2e-6 - 5e-6
    assert (row["direction"], row["reversals"], row["p_start"]) == (-1, 0, 12.5)
    assert (row["step_start"], row["step_stop"]) == (10000, 30000)
    assert not row["corner"]


def test_reversal_continues_an_episode():
    run = Run()
    run.set(1 * MS, 3, RIGHT).set(1.1 * MS, 3, LEFT).set(1.2 * MS, 3, RIGHT).set(1.3 * MS, 3, STUCK)
    run.slip(3, 5 * MS, 6 * MS)
    episodes = run.catalogue().episodes
    assert list(episodes["t_stop"]) == [1.3 * MS, 6 * MS]
    assert list(episodes["reversals"]) == [2, 0]
    assert list(episodes["direction"]) == [1, 1]


def test_opening_ends_an_episode_and_landing_into_slip_starts_one():
    run = Run().slip(0, 1 * MS, 2 * MS, after=OPEN).slip(0, 3 * MS, 4 * MS, new=LEFT)
    episodes = run.catalogue().episodes
    assert list(episodes["t_start"]) == [1 * MS, 3 * MS]
    assert list(episodes["t_stop"]) == [2 * MS, 4 * MS]


def test_opening_and_landing_at_rest_are_not_slip():
    run = Run().set(1 * MS, 0, OPEN).set(2 * MS, 0, STUCK)
    catalogue = run.catalogue()
    assert len(catalogue.episodes) == len(catalogue.events) == 0


def test_episodes_are_ordered_by_start_then_block_number():
    run = Run().slip(5, 1 * MS, 4 * MS).slip(1, 1 * MS, 2 * MS).slip(3, 0.5 * MS, 3 * MS)
    assert list(run.catalogue().episodes["n"]) == [4, 2, 6]
    assert list(run.catalogue(make_scene(d=-1)).episodes["n"]) == [5, 3, 7]


def test_unfinished_episode_has_no_stop():
    (row,) = Run().slip(0, 1 * MS).catalogue().episodes.to_dict("records")
    assert row["step_stop"] == -1
    assert np.isnan([row["t_stop"], row["u_x_stop"], row["slip"]]).all()


def test_episode_begun_before_the_log_starts_at_t_begin():
    run = Run()
    run.mode[2] = RIGHT
    run.set(5 * MS, 2, STUCK, u_x=3e-6)
    catalogue = run.catalogue(t_begin=4 * MS)
    (row,) = catalogue.episodes.to_dict("records")
    assert (row["t_start"], row["t_stop"]) == (4 * MS, 5 * MS)
    assert np.isnan(row["slip"])
    assert catalogue.events["quiet_start"].item() == -1
    assert np.isnan(catalogue.events["F_T_start_inst"].item())


def test_contradicting_log_is_refused():
    switches, quiet = Run().slip(0, 1 * MS, 2 * MS).logs()
    switches["old"][1] = STUCK
    with pytest.raises(pyfric.RecordError, match="contradict each other"):
        build_catalogue(switches, quiet, make_scene())
    switches["block"][:] = 8
    with pytest.raises(pyfric.RecordError, match="outside"):
        build_catalogue(switches, quiet, make_scene())
    del switches["p"]
    with pytest.raises(pyfric.RecordError, match=r"switches\.p is missing"):
        build_catalogue(switches, quiet, make_scene())
    with pytest.raises(pyfric.RecordError, match="needs 9 along x"):
        build_catalogue(*Run().logs(), make_scene(9))


# --- events --------------------------------------------------------------------------------------


@pytest.mark.parametrize(("pause", "n_events"), [(0.9 * MS, 1), (1.1 * MS, 2)])
def test_t_gap_joins_and_splits(pause, n_events):
    run = Run().slip(0, 1 * MS, 2 * MS).slip(1, 2 * MS + pause, 6 * MS)
    events = run.catalogue().events
    assert len(events) == n_events
    assert len(run.catalogue(t_gap=pause / 2).events) == 2
    assert events["t_stop"].iloc[-1] == 6 * MS


def test_a_pause_within_rounding_of_t_gap_does_not_part_events():
    for t in (0.0, 0.9, 7.3):
        run = Run()
        run.slip(0, t + 1 * MS, t + 2 * MS)
        run.slip(1, t + 2 * MS + 1 * MS, t + 4 * MS)
        assert len(run.catalogue(t_gap=1 * MS).events) == 1
        assert len(run.catalogue(t_gap=(1 - 1e-6) * MS).events) == 2


def test_gap_counts_from_the_end_of_all_activity():
    """A short slip inside a long one does not end the activity."""
    run = Run().slip(0, 1 * MS, 9 * MS).slip(1, 2 * MS, 2.1 * MS).slip(2, 9.5 * MS, 10 * MS)
    events = run.catalogue().events
    assert len(events) == 1
    assert events["n_episodes"].item() == 3
    assert events["duration"].item() == 10 * MS - 1 * MS


def test_corner_episodes_do_not_start_join_or_end_events():
    run = Run()
    run.slip(0, 0.5 * MS, 0.9 * MS, corner=True)  # just before the event: does not start it
    run.slip(1, 1 * MS, 2 * MS)
    run.slip(0, 2.5 * MS, 2.6 * MS, corner=True)  # bridges the gap: does not join
    run.slip(1, 3.3 * MS, 4 * MS)
    run.slip(0, 4.1 * MS, 9 * MS, corner=True)  # outlasts the event: does not end it
    catalogue = run.catalogue()
    assert list(catalogue.events["t_start"]) == [1 * MS, 3.3 * MS]
    assert list(catalogue.events["t_stop"]) == [2 * MS, 4 * MS]
    assert list(catalogue.events["n_episodes"]) == [1, 1]
    assert list(catalogue.episodes["event"]) == [0, 1, 0, 2, 0]
    assert list(catalogue.events.index) == [1, 2]


def test_first_last_distinct_blocks_and_episode_count():
    run = Run().slip(2, 1 * MS, 1.1 * MS).slip(4, 1.2 * MS, 1.3 * MS).slip(2, 1.4 * MS, 1.5 * MS)
    row = run.catalogue().events.iloc[0]
    assert (row["first_block"], row["last_block"]) == (3, 5)
    assert (row["n_blocks"], row["n_episodes"]) == (2, 3)


def test_instantaneous_force_is_that_of_first_slip_and_last_stick():
    run = Run().slip(0, 1 * MS, 2 * MS).slip(1, 2.5 * MS, 3 * MS)  # one event, two bursts
    run.slip(0, 8 * MS, 9 * MS)
    events = run.catalogue().events
    assert list(events["F_T_start_inst"]) == [100 + 1 * MS, 100 + 8 * MS]
    assert list(events["F_T_arrest_inst"]) == [100 + 3 * MS, 100 + 9 * MS]
    assert list(events["quiet_start"]) == [0, 4]
    assert list(events["quiet_stop"]) == [3, 5]


def test_unfinished_event():
    run = Run(opened=[7]).slip(3, 1 * MS, 2 * MS)
    run.slip(0, 8 * MS, 9 * MS).slip(1, 8.1 * MS).set(8.2 * MS, 2, OPEN)
    catalogue = run.catalogue()
    assert list(catalogue.events["finished"]) == [True, False]
    last = catalogue.events.iloc[1]
    assert np.isnan([last["t_stop"], last["duration"], last["F_T_arrest_inst"]]).all()
    assert last["quiet_stop"] == -1
    assert catalogue["region"][1].tolist() == [1, 1, 2, 0, 0, 0, 0, 2]  # open when the log ends
    assert last["L_p_over_L"] == 3 / 8


def test_event_that_stopped_within_t_gap_of_the_end_is_not_finished():
    run = Run().slip(0, 1 * MS, 2 * MS)
    assert not run.catalogue(t_end=2.5 * MS).events["finished"].item()
    assert run.catalogue(t_end=3.5 * MS).events["finished"].item()
    assert run.catalogue(t_end=2.5 * MS).events["t_stop"].item() == 2 * MS


# --- length --------------------------------------------------------------------------------------


def test_L_p_stops_at_a_gap_in_the_slipped_set():
    run = Run()
    for i in (0, 1, 2, 5, 6):
        run.slip(i, 1 * MS, 2 * MS)
    row = run.catalogue().events.iloc[0]
    assert row["L_p_over_L"] == 3 / 8
    assert row["last_block"] == 7
    assert row["is_precursor"]
    assert row["is_main"]


@pytest.mark.parametrize("how", ["open at the end", "corner slip"])
def test_open_and_corner_blocks_fill_the_gap(how):
    run = Run(opened=[2] if how == "open at the end" else [])
    for i in (0, 1, 3):
        run.slip(i, 1 * MS, 2 * MS)
    if how == "corner slip":
        run.slip(2, 1.5 * MS, 1.6 * MS, corner=True)
    catalogue = run.catalogue()
    assert catalogue["region"][0].tolist() == [1, 1, 2, 1, 0, 0, 0, 0]
    row = catalogue.events.iloc[0]
    assert row["L_p_over_L"] == 4 / 8
    assert row["n_blocks"] == 3
    assert not row["is_main"]


@pytest.mark.parametrize("opened", [[1], []])
def test_a_block_that_lands_in_an_event_does_not_end_it(opened):
    """The block did not hold the slider: with inertia, a landing block would slip."""
    run = Run(opened=opened).slip(0, 1 * MS, 2 * MS)
    if not opened:
        run.set(1.2 * MS, 1, OPEN)
    catalogue = run.set(1.5 * MS, 1, STUCK).catalogue()
    assert catalogue["region"][0].tolist() == [1, 2, 0, 0, 0, 0, 0, 0]
    assert catalogue.events["L_p_over_L"].item() == 2 / 8
    assert catalogue.events["n_blocks"].item() == 1


def test_a_block_that_lands_between_events_does_not_count():
    run = Run(opened=[1]).slip(0, 1 * MS, 2 * MS).slip(0, 8 * MS, 9 * MS).set(5 * MS, 1, STUCK)
    assert run.catalogue()["region"][:, 1].tolist() == [2, 0]


def test_corner_slip_outside_the_event_does_not_count():
    run = Run().slip(1, 1 * MS, 2 * MS)
    run.slip(0, 0.8 * MS, 0.9 * MS, corner=True).slip(0, 2.1 * MS, 2.2 * MS, corner=True)
    assert run.catalogue()["region"][0].tolist() == [0, 1, 0, 0, 0, 0, 0, 0]


def test_one_long_corner_slip_counts_in_every_event_it_overlaps():
    run = Run().slip(0, 1.5 * MS, 20 * MS, corner=True)
    for t in (1, 5, 10, 30):
        run.slip(1, t * MS, (t + 1) * MS)
    assert list(run.catalogue().events["L_p_over_L"]) == [0.25, 0.25, 0.25, 0]


def test_event_that_does_not_reach_block_1():
    row = Run().slip(3, 1 * MS, 2 * MS).slip(4, 1 * MS, 2 * MS).catalogue().events.iloc[0]
    assert row["L_p_over_L"] == 0
    assert not row["is_precursor"]
    assert (row["first_block"], row["last_block"]) == (4, 5)


def test_system_size_event_is_not_a_precursor():
    run = Run()
    for i in range(8):
        run.slip(i, (1 + 0.01 * i) * MS, 2 * MS)
    row = run.catalogue().events.iloc[0]
    assert row["L_p_over_L"] == 1
    assert row["is_main"]
    assert not row["is_precursor"]


@pytest.mark.parametrize(("n_slipped", "is_main"), [(3, False), (4, True)])
def test_main_events_have_four_blocks(n_slipped, is_main):
    run = Run()
    for i in range(n_slipped):
        run.slip(2 * i, 1 * MS, 2 * MS)
    assert run.catalogue().events["is_main"].item() is is_main


@pytest.mark.parametrize(("n_slipped", "main"), [(2, False), (3, True)])
def test_of_fewer_blocks_all_make_a_main_event(n_slipped, main):
    """In a scene of three blocks, a main event needs all three."""
    scene = pyfric.preset("chain", L=5e-3)
    run = Run(scene.N_x)
    for i in range(n_slipped):
        run.slip(i, 1 * MS, 2 * MS)
    assert run.catalogue(scene).events["is_main"].item() is main


# --- nucleation and sides ------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "expected"), [(1, True), (4, True), (5, False)])
def test_nucleation_at_the_trailing_edge_means_x_up_to_h_plus_l(n, expected):
    """h = 2 l: blocks 1 to 4 (x = 0 ... 3 l)."""
    run = Run().slip(n - 1, 1 * MS, 2 * MS).slip(0, 1.1 * MS, 2 * MS).slip(7, 1.2 * MS, 2 * MS)
    row = run.catalogue().events.iloc[0]
    assert row["nucleation_block"] == n
    assert row["x_nucleation"] == (n - 1) * 2.5e-3
    assert row["at_trailing_edge"] == expected


def test_driver_on_the_right_gives_the_mirror_image():
    left, right = Run(), Run()
    for n, t in ((2, 1.0), (1, 1.05), (3, 1.08), (4, 1.13), (5, 1.18), (6, 1.2)):
        left.slip(n - 1, t * MS, 2 * MS)
        right.slip(8 - n, t * MS, 2 * MS, new=LEFT)
    a = left.catalogue(make_scene(d=1))
    b = right.catalogue(make_scene(d=-1))
    assert a.events.equals(b.events)
    assert np.array_equal(a["region"], b["region"][:, ::-1])
    assert a.events["n_front"].item() == 6
    assert np.array_equal(a["rupture_times"], b["rupture_times"][:, ::-1], equal_nan=True)
    assert a.events["L_p_over_L"].item() == 6 / 8
    assert list(b.episodes["n"]) == list(a.episodes["n"])
    assert list(b.episodes["i"]) == [7 - i for i in a.episodes["i"]]


# --- fronts --------------------------------------------------------------------------------------


def test_front_holds_the_first_slip_not_a_later_one():
    run = Run()
    for i in range(8):
        run.slip(i, (1 + 0.01 * i) * MS, 1.5 * MS)
        run.slip(i, (1.6 + 0.01 * i) * MS, 1.9 * MS)
    catalogue = run.catalogue()
    expected = (1 + 0.01 * np.arange(8)) * MS
    np.testing.assert_array_equal(catalogue["rupture_times"][0], expected)
    v_c = front_speed(catalogue["rupture_times"][0], 2.5e-3)
    np.testing.assert_allclose(v_c[2:-2], 250.0)
    assert np.isnan(v_c[[0, 1, -2, -1]]).all()


@pytest.mark.parametrize("N_x", [2, 4, 5, 6])
def test_fronts_of_few_blocks_have_speeds_from_five_on(N_x):
    t = np.array([np.arange(N_x), np.zeros(N_x)], dtype=float)
    assert np.isfinite(front_speed(t, 1.0)).sum(axis=1).tolist() == [max(N_x - 4, 0), 0]
    assert five_known(t).sum(axis=1).tolist() == [max(N_x - 4, 0)] * 2


def test_merged_event_gives_the_longer_front_and_no_slow_speed():
    """Blocks 1-3 slip. 0.8 ms later a front runs over blocks 4-12, in the same event."""
    run = Run(12)
    for i in range(3):
        run.slip(i, (1 + 0.002 * i) * MS, 1.1 * MS)
    for i in range(12):
        run.slip(i, (1.9 + 0.002 * i) * MS, 2.2 * MS)
    catalogue = run.catalogue(make_scene(12))
    assert len(catalogue.events) == 1
    t = catalogue["rupture_times"][0]
    assert np.isnan(t[:3]).all()
    np.testing.assert_array_equal(t[3:], (1.9 + 0.002 * np.arange(3, 12)) * MS)
    v_c = front_speed(t, 2.5e-3)
    np.testing.assert_allclose(v_c[5:10], 1250.0)
    assert np.isnan(v_c[:5]).all()
    row = catalogue.events.iloc[0]
    assert (row["n_front"], row["n_not_increasing"], row["n_blocks"]) == (9, 0, 12)
    assert row["L_p_over_L"] == 1


def test_equally_long_fronts_the_earlier_counts_then_the_nearer_to_the_trailing_edge():
    t = np.array([[2.0, 2.1, np.nan, 1.0, 1.1], [1.0, 1.1, np.nan, 1.0, 1.1]])
    nan = np.nan
    n = np.arange(1, 6)
    expected = [[nan, nan, nan, 1.0, 1.1], [1.0, 1.1, nan, nan, nan]]
    np.testing.assert_array_equal(rupture_front(t, n, 0.2), expected)
    expected = [[nan, nan, nan, 1.0, 1.1], [nan, nan, nan, 1.0, 1.1]]
    np.testing.assert_array_equal(rupture_front(t, n[::-1], 0.2), expected)


def test_front_links_only_neighbours_within_the_limit():
    t = np.array([[0.0, 1.0, 2.0, 4.5, 5.5]])
    n = np.arange(1, 6)
    assert np.isfinite(rupture_front(t, n, 2.5)).sum() == 5
    assert np.isfinite(rupture_front(t, n, 2.4)).tolist() == [[True, True, True, False, False]]
    assert np.isfinite(rupture_front(t, n, 0.5)).tolist() == [[True, False, False, False, False]]


def test_one_pause_at_the_link_limit_is_not_a_slow_front():
    """The speed over such a pause stays above the limit of slow fronts, 0.05 c_s."""
    scene = make_scene()
    c_s = scene.slider.l * np.sqrt(scene.slider.k / (2 * scene.m))
    step = scene.slider.l / c_s
    t = np.array([0.0, step, 2 * step, 2 * step + longest_link(scene), 0.0])
    t[4] = t[3] + step
    v_c = front_speed(t, scene.slider.l)[2]
    assert 0.05 < v_c / c_s < 0.1


def test_front_speed_runs_away_from_the_driven_side():
    t = np.arange(7.0)
    assert np.isfinite(front_speed(t, 1.0)).sum() == 3
    assert np.isnan(front_speed(t, 1.0, -1)).all()
    np.testing.assert_array_equal(front_speed(t[::-1], 1.0, -1), front_speed(t, 1.0)[::-1])


def test_front_speed_is_nan_where_times_do_not_strictly_increase():
    run = Run(9)
    t = np.array([0, 1, 2, 3, 4, 5, 5, 6, 7]) * 0.01 * MS
    for i in range(9):
        run.slip(i, 1 * MS + t[i], 2 * MS)
    catalogue = run.catalogue(make_scene(9))
    v_c = front_speed(catalogue["rupture_times"], 2.5e-3)[0]
    assert np.isfinite(v_c).tolist() == [False] * 2 + [True] * 2 + [False] * 5
    assert catalogue.events["n_front"].item() == 9
    assert catalogue.events["n_not_increasing"].item() == 3


def test_front_speed_of_short_interfaces_is_nan():
    assert np.isnan(front_speed(np.arange(4.0), 1.0)).all()
    assert front_speed(np.empty((0, 8)), 1.0).shape == (0, 8)


# --- static states -------------------------------------------------------------------------------


class Solver:
    """A stand-in for the solver, which returns its arguments."""

    def solve(self, u_x_bottom, drive, *, free):
        return SimpleNamespace(F_T=drive, tau=u_x_bottom.copy(), p=free.astype(float))


def test_static_states_hold_the_interface_of_first_slip_and_last_stick():
    run = Run(opened=[6]).slip(0, 1 * MS, 2 * MS, u_x=3e-6).slip(1, 1.5 * MS, 2.5 * MS, u_x=4e-6)
    run.set(2.2 * MS, 7, OPEN)
    run.slip(0, 8 * MS, u_x=0.0)
    found = run.catalogue(solver=Solver())
    np.testing.assert_allclose(found["F_T_start"], [1e-6, 8e-6], rtol=1e-15)
    assert found["F_T_arrest"][0] == 2.5 * MS * 1e-3
    assert np.isnan(found["F_T_arrest"][1])
    assert found.events["F_T_start"].to_list() == found["F_T_start"].tolist()
    assert found["tau_before"].shape == (2, 8)
    assert found["tau_after"][0].tolist() == [3e-6, 4e-6, 0, 0, 0, 0, 0, 0]
    assert found["p_before"][0].tolist() == [0, 0, 0, 0, 0, 0, 1, 0]
    assert found["p_after"][0].tolist() == [0, 0, 0, 0, 0, 0, 1, 1]
    assert np.isnan(found["tau_after"][1]).all()


@pytest.mark.parametrize(("side", "d"), [("left", 1), ("right", -1)])
def test_static_states_are_in_balance(side, d):
    """With the real solver the sum of tau is F_T, the sum of p is F_N, and slip lowers F_T."""
    equilibrium = pytest.importorskip("pyfric.statics.equilibrium")
    scene = setup1(L=0.05, H=0.02, h=5e-3)
    scene = dataclasses.replace(scene, driver=dataclasses.replace(scene.driver, side=side))
    new = RIGHT if d == 1 else LEFT
    run = Run(scene.N_x)
    for n in range(5):
        i = n if d == 1 else scene.N_x - 1 - n
        run.slip(i, 50 * MS, 50.1 * MS, new=new, u_x=d * 2e-6)
    found = run.catalogue(scene, solver=equilibrium.StaticSolver(scene, "linear"))
    for when, force in (("before", "F_T_start"), ("after", "F_T_arrest")):
        np.testing.assert_allclose(found[f"tau_{when}"].sum(axis=1), found[force], rtol=1e-8)
        np.testing.assert_allclose(found[f"p_{when}"].sum(axis=1), scene.F_N, rtol=1e-8)
    assert 0 < found["F_T_arrest"][0] < found["F_T_start"][0]


def test_without_a_solver_static_values_are_nan():
    catalogue = Run().slip(0, 1 * MS, 2 * MS).catalogue()
    assert np.isnan(catalogue.events["F_T_start"]).all()
    assert np.isnan(catalogue["p_after"]).all()
    assert catalogue["p_after"].shape == (1, 8)


# --- sizes ---------------------------------------------------------------------------------------


def test_no_events_gives_empty_tables_of_the_same_types():
    empty = Run().catalogue(solver=Solver())
    full = Run().slip(0, 1 * MS, 2 * MS).catalogue(solver=Solver())
    assert len(empty.episodes) == len(empty.events) == 0
    columns = [name for name, held in held_in("events").items() if held.required]
    assert list(empty.events.columns) == columns
    assert empty.events.dtypes.equals(full.events.dtypes)
    assert empty.episodes.dtypes.equals(full.episodes.dtypes)
    assert {array.shape for array in empty.arrays.values()} == {(0, 8)}
    assert list(empty.arrays) == list(found_arrays())


def test_only_corner_episodes_gives_no_events():
    catalogue = Run().slip(0, 1 * MS, 2 * MS, corner=True).catalogue()
    assert len(catalogue.episodes) == 1
    assert len(catalogue.events) == 0


def test_negative_t_gap_is_refused():
    with pytest.raises(ValueError, match="t_gap"):
        Run().catalogue(t_gap=-1.0)


def test_random_logs_agree_with_a_plain_loop():
    """Vectorised events agree with the definition applied one episode at a time."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        run = Run(8)
        for i in range(8):
            times = np.cumsum(rng.integers(1, 30, 2 * rng.integers(1, 12))) * 0.1 * MS
            for a, b in zip(times[::2], times[1::2], strict=True):
                run.slip(i, a, b, corner=bool(rng.random() < 0.2))
        catalogue = run.catalogue()
        events, end = [], -np.inf
        for row in catalogue.episodes.itertuples():
            if row.corner:
                continue
            if row.t_start - end > 1 * MS:
                events.append([])
            events[-1].append(row)
            end = max(end, row.t_stop)
        assert len(events) == len(catalogue.events)
        for rows, event in zip(events, catalogue.events.itertuples(), strict=True):
            assert event.t_start == rows[0].t_start
            assert event.t_stop == max(row.t_stop for row in rows)
            assert event.n_blocks == len({row.n for row in rows})
            assert event.last_block == max(row.n for row in rows)


def test_many_switches_take_little_time():
    n = 100_000
    t = np.arange(n) * 0.4 * MS
    block = np.arange(n) % 8
    run = {
        "step": np.stack([np.arange(n) * 2, np.arange(n) * 2 + 1], 1).ravel(),
        "block": np.repeat(block, 2),
        "old": np.tile(np.array([0, 1], np.int32), n),
        "new": np.tile(np.array([1, 0], np.int32), n),
        "corner": np.zeros(2 * n, dtype=bool),
        "t": np.stack([t, t + 0.1 * MS], 1).ravel(),
        "u_x": np.zeros(2 * n),
        "p": np.ones(2 * n),
    }
    _, quiet = Run().logs()
    one = build_catalogue(run, quiet, make_scene())
    many = build_catalogue(run, quiet, make_scene(), t_gap=0.1 * MS)
    assert len(one.events) == 1
    assert one.events["n_blocks"].item() == 8
    assert len(many.events) == len(many.episodes) == n


def test_a_static_state_that_is_not_found_is_nan_and_said():
    """The rest of the catalogue is complete."""

    class Solver:
        def solve(self, u_x_bottom, drive, *, free):
            if u_x_bottom.any():
                raise EquilibriumError("it topples", 5.0, 1.0, 7)
            return SimpleNamespace(F_T=1.0, tau=np.ones(8), p=np.ones(8))

    catalogue = Run().slip(0, 1 * MS, 2 * MS).catalogue(solver=Solver())
    with pytest.warns(RuntimeWarning, match=r"1 static states .* t = 0.002 s: .*it topples"):
        events = catalogue.events
    assert events["F_T_start"].iloc[0] == 1.0
    assert np.isnan(events["F_T_arrest"].iloc[0])
    assert np.isnan(catalogue["tau_after"]).all()


def test_blocks_that_slip_throughout_count():
    """Such blocks are not in the logs, and their rupture times are unknown."""
    logs, scene = Run().slip(3, 1 * MS, 2 * MS).logs(), make_scene()
    last = SimpleNamespace(mode=np.array([1, 1, 1, 0, 0, 0, 0, 0]), corner=np.zeros(8, dtype=bool))
    how = {"t_begin": 0.5 * MS, "t_end": 9 * MS}
    catalogue = build_catalogue(*logs, scene, last=last, **how)
    event = catalogue.events.iloc[0]
    assert event["n_blocks"] == 4
    assert event["t_start"] == 0.5 * MS
    assert not event["finished"]
    assert np.flatnonzero(np.isfinite(catalogue.arrays["rupture_times"][0])).tolist() == [3]
    assert len(build_catalogue(*logs, scene, **how).episodes) == 1
