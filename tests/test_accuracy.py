"""The chart of cost and error: comparison of records, frontiers, plans against their tolerances."""

import dataclasses
import functools
from unittest import mock

import accuracy as chart
import numpy as np
import pandas as pd
import pytest

from pyfric.figures import save_figure
from pyfric.planning import simulate
from pyfric.scene import setup1

METHODS = (
    chart.Method("quasistatic"),
    chart.Method("hybrid", "linear", "located", 0.5),
    chart.Method("hybrid", "finite", "located", 0.5),
    chart.FULL,
    chart.Method("hybrid", "finite", "located", 2.0),
)
TOLERANCES = (0.01,)


def small():
    """15 x 8 blocks, driven fast; four main events take 20 ms."""
    return setup1(L=0.07, H=0.035, l=5e-3, V=20e-3, F_N=1750.0, name="small")


@functools.cache
def table():
    with mock.patch.multiple(chart, TRIES=1, TOLERANCES=TOLERANCES):
        return pd.DataFrame(chart.points("small", small(), methods=METHODS, events=2))


@functools.cache
def record():
    return simulate(small(), 0.05, fidelity="hybrid", geometry="linear", progress=False)


def test_a_record_agrees_with_itself():
    found = chart.errors(record(), record())
    assert found["events"] >= 2
    assert found["missing"] == 0
    assert "status" not in found
    assert all(found[want] == 0 for want in chart.WANTS)


def test_errors_are_what_was_changed():
    one, F_N = record(), small().F_N
    events = one.events.assign(F_T_start=one.events["F_T_start"] + 0.01 * F_N)
    times = one.rupture_times * 0.5
    tau_after = one.tau_after + 0.1 * F_N / 15
    changed = one.replace(events=events, rupture_times=times, tau_after=tau_after)
    found = chart.errors(changed, one)
    assert found["precursors"] == pytest.approx(0.01)
    assert found["stress"] == pytest.approx(0.1 / np.sqrt(2))
    assert found["front_speed"] == pytest.approx(1.0)
    assert found["loading_curve"] == 0


def test_events_that_are_missing_are_said():
    events = record().events
    last = events.index[events["is_main"]][-1]
    fewer = dataclasses.replace(
        record(), events=events.assign(finished=events["finished"] & (events.index != last))
    )
    assert chart.errors(fewer, record())["status"].endswith("events differ")
    none = dataclasses.replace(record(), events=events.assign(finished=False))
    assert chart.errors(none, record()) == {
        "events": 0,
        "missing": chart.errors(record(), record())["events"],
        "status": "no event in common",
    }


@pytest.mark.slow
def test_every_method_and_plan_has_its_point():
    found = table()
    methods = found[found["kind"] == "method"]
    assert len(methods) == len(METHODS)
    assert "stability limit" in methods["status"].iloc[-1]
    plans = found[found["kind"] == "plan"]
    assert len(plans) == len(chart.WANTS) * len(TOLERANCES)
    assert (plans["said"] <= plans["tolerance"]).all()
    finite = methods[(methods["geometry"] == "finite") & (methods["engine"] == "hybrid")]
    linear = methods[(methods["geometry"] == "linear") & (methods["engine"] == "hybrid")]
    assert finite["precursors"].iloc[0] < 1e-4 < linear["precursors"].iloc[0]


def test_frontier_has_what_nothing_beats():
    part = pd.DataFrame(
        {
            "seconds": [1.0, 2.0, 3.0, 4.0, 0.5],
            "stress": [0.1, 0.2, 0.01, 0.01, np.nan],
            "status": ["ok", "ok", "ok", "ok", "ok"],
        }
    )
    assert list(chart.frontier(part, "stress")["seconds"]) == [1.0, 3.0]
    part.loc[0, "status"] = "no event in common"
    assert list(chart.frontier(part, "stress")["seconds"]) == [2.0, 3.0]


def test_drawn_scenes_are_those_of_their_seed():
    assert chart.drawn(7) == chart.drawn(7)
    assert chart.drawn(7) != chart.drawn(8)


@pytest.mark.slow
def test_the_figure_shows_every_want(tmp_path):
    points = table().assign(scene="random")
    fig = chart.figure(points)
    assert len(fig.axes) == len(chart.WANTS)
    assert min(len(axes.lines) for axes in fig.axes) > 2 * len(chart.TOLERANCES)
    names = {path.name for path in save_figure(fig, tmp_path / "chart")}
    assert names == {"chart.png", "chart.pdf", "chart.txt", "chart_points.csv"}
