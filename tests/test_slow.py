"""The study of slow fronts, on synthetic fronts with and without a transition."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import slow

from pyfric.paper.cases.slow_fronts import passages
from pyfric.record import material_of
from pyfric.scene import preset

SCENE = preset("slow")
N, L = SCENE.N_x, SCENE.slider.l


def record(speeds, order=None):
    """Return one event whose front has these speeds (m/s); blocks first rupture in `order`."""
    t = 0.4 + np.cumsum(L / np.asarray(speeds, float))
    t = t if order is None else t[order]
    episodes = pd.DataFrame({"event": 2, "n": np.arange(1, N + 1), "t_start": t})
    again = episodes.assign(t_start=t + 5e-3)  # each block ruptures twice
    events = pd.DataFrame(
        {"n_blocks": [25, N], "first_block": 1, "last_block": [25, N], "is_main": True},
        index=[1, 2],
    ).assign(t_start=[t.min() - 0.01, t.min()], F_T_start=400, F_T_arrest=300)
    return SimpleNamespace(
        scene=SCENE, episodes=pd.concat([again, episodes], ignore_index=True), events=events
    )


def front(slow_speed, first=20, blocks=12):
    speeds = np.full(N, 500.0)
    speeds[first : first + blocks] = slow_speed
    return speeds


def test_a_slow_stretch_between_fast_ones_is_found():
    made = record(front(10.0))
    (row,) = slow.ruptures(made).itertuples()
    assert (row.event, row.arrest, row.between, row.accepted) == (2, 25, True, True)
    assert row.speed == pytest.approx(10 / material_of(made.scene).c_S, rel=1e-9)
    assert abs(row.first - 21) <= 2  # speeds are over five blocks
    assert abs(row.last - 32) <= 2
    assert row.before == row.after == pytest.approx(50)


@pytest.mark.parametrize("speeds", [front(100.0), front(10.0, blocks=3), np.full(N, 500.0)])
def test_fronts_that_are_not_slow_or_only_pause_have_none(speeds):
    (row,) = slow.ruptures(record(speeds)).itertuples()
    assert not row.between
    assert np.isnan(row.speed)


def test_a_stretch_below_the_band_is_not_accepted():
    (row,) = slow.ruptures(record(front(9.0))).itertuples()
    assert (row.between, row.accepted) == (True, False)


def test_a_front_that_stays_slow_is_not_between_fast_ones():
    (row,) = slow.ruptures(record(front(10.0, blocks=N - 20))).itertuples()
    assert not row.between
    assert row.speed > 0


def test_a_block_that_ruptures_ahead_does_not_count_before_the_front_has_come():
    plain, ahead = record(front(10.0)), record(front(10.0))
    ahead.episodes.loc[ahead.episodes["n"] == 30, "t_start"] = 0.4
    t, early = passages(plain, 2), passages(ahead, 2)
    np.testing.assert_array_equal(np.delete(early, 29), np.delete(t, 29))
    assert early[29] == t[28]


def test_exponent_of_slip_speed():
    v = np.geomspace(1, 1000, 30)
    exponent, r2 = slow.power_law(pd.DataFrame({"front": v, "slip": 1e-4 * v**0.7}))
    assert (exponent, r2) == pytest.approx((0.7, 1.0))


def test_cases_differ_in_one_thing():
    jobs = dict(zip(slow.CASES, slow.jobs(tuple(slow.CASES)), strict=True))
    base = jobs["seed 0"].scene.interface.law
    assert jobs["n_s = 400"].scene.interface.law.u_s == base.u_s
    for name in ("seed 1", "n_s = 400", "no spread of t_R"):
        law = jobs[name].scene.interface.law
        differ = [
            one
            for one in ("n_s", "seed", "t_R", "t_R_std")
            if getattr(law, one) != getattr(base, one)
        ]
        assert len(differ) == 1, name
    assert jobs["half the step"].scene == jobs["seed 0"].scene
