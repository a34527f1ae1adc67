"""Lines where a label changes are found in few runs; maps are refined at these lines."""

import math

import numpy as np
import pandas as pd
import pytest

from pyfric.planning import simulate
from pyfric.scene import chain
from pyfric.sweeps import boundary, label_map
from pyfric.values import SceneError

LINES = {
    "straight": lambda y: 10 ** (0.3 * y - 1),
    "parabola": lambda y: 10 ** (0.4 * y**2 - 1),
    "wave": lambda y: 10 ** (0.5 * math.sin(3 * y)),
    "falling": lambda y: 1 / (1 + 3 * y),
    "steep": lambda y: 10 ** (1.5 * math.tanh(4 * (y - 0.5))),
}


class Counted:
    def __init__(self, line):
        self.line, self.calls = line, []

    def __call__(self, x, y):
        self.calls.append((x, y))
        return "runs through" if x > self.line(y) else "arrests"


def check_line(line, exact, tolerance=1e-3):
    """Check that the line is within its tolerance, in decades, and inside its brackets."""
    assert (line["low"] <= exact).all()
    assert (exact <= line["high"]).all()
    assert np.abs(np.log10(line["along"] / exact)).max() <= tolerance * (1 + 1e-6)
    assert np.log10(line["high"] / line["low"]).max() <= 2 * tolerance * (1 + 1e-6)
    assert set(line["below"]) == {"arrests"}
    assert set(line["above"]) == {"runs through"}


@pytest.mark.parametrize("name", LINES)
def test_a_point_takes_at_most_six_runs_on_average(name):
    f, over = Counted(LINES[name]), np.linspace(0, 1, 20)
    line = boundary(f, (1e-2, 1e2), over)
    check_line(line, np.array([LINES[name](y) for y in over]))
    assert line["runs"].sum() == len(f.calls) == len(set(f.calls))
    assert line["runs"][0] == 13  # both ends, and log2(4 decades / 2e-3)
    assert line["runs"].mean() < 6
    assert line["runs"][2:].median() <= 5


@pytest.mark.parametrize("name", sorted(LINES.keys() - {"steep"}))
def test_labels_that_are_known_bracket_the_line(name):
    """With labels of 20 x 20 points, each point to 1e-3 decades takes at most six runs."""
    grid, over = np.logspace(-2, 2, 20), np.linspace(0, 1, 20)
    points = [(x, y, Counted(LINES[name])(x, y)) for y in over for x in grid]
    known = pd.DataFrame(points, columns=["along", "over", "label"])
    f = Counted(LINES[name])
    line = boundary(f, (1e-2, 1e2), over[4:12], known=known)
    check_line(line, np.array([LINES[name](y) for y in over[4:12]]))
    assert line["runs"].sum() == len(f.calls) <= 6 * 8
    assert not {(x, y) for x, y, _ in points} & set(f.calls)


def test_known_labels_beyond_a_line_that_left_the_range():
    known = pd.DataFrame({"along": [0.1, 10.0], "over": 0.5, "label": ["arrests"] * 2})
    line = boundary(
        Counted(lambda y: 1.0 if y != 0.5 else 1e9), (1e-2, 1e2), [0, 0.5, 1], known=known
    )
    assert list(line["along"].isna()) == [False, True, False]


def test_how_much_prestress_lets_the_first_slip_run_through():
    def first_slip(ratio, mu_k):
        scene = chain(
            L=0.024, l=1e-3, p=10.0, tau=ratio * 10.0, mu_k=mu_k, k=1e6, M=0.1, K=1e5, V=1e-3
        )
        how = {"fidelity": "quasistatic", "t_gap": 1e-3, "progress": False}  # slips are 10 ms apart
        events = simulate(scene, 0.08, **how).events
        return "runs through" if events["L_p_over_L"].iloc[0] == 1 else "arrests"

    line = boundary(first_slip, (0.2, 0.69), np.linspace(0.3, 0.6, 7))
    assert line["runs"][2:].median() <= 5
    assert np.log10(line["high"] / line["low"]).max() <= 2e-3 * (1 + 1e-6)
    assert set(line["below"]) == {"arrests"}
    assert set(line["above"]) == {"runs through"}
    # Slip crosses the whole chain only if the mean force at rest exceeds mu_k p.
    assert (line["along"] > line["over"]).all()
    assert (line["along"] < line["over"] + 0.05).all()


def test_a_linear_range_and_falling_values():
    over = np.linspace(1, -1, 21)
    line = boundary(lambda x, y: x > 0.3 * y, (-1.0, 1.0), over, scale="linear", tolerance=1e-4)
    assert np.abs(line["along"] - 0.3 * over).max() <= 2e-4 * (1 + 1e-6)
    assert (line["high"] - line["low"]).max() <= 4e-4 * (1 + 1e-6)
    assert list(line["below"]) == 21 * [False]


def test_a_power_law_is_straight_where_both_scales_are_logarithmic():
    over = np.logspace(-3, 1, 20)
    runs = {
        scale: boundary(Counted(lambda y: 0.1 * y**0.3), (1e-3, 1.0), over, over_scale=scale)
        for scale in ("log", "linear")
    }
    for line in runs.values():
        check_line(line, 0.1 * over**0.3)
    assert runs["log"]["runs"][2:].max() <= 8
    assert runs["log"]["runs"].sum() < 0.6 * runs["linear"]["runs"].sum()


def test_a_line_that_jumps_is_found_again():
    line = boundary(Counted(lambda y: 0.1 if y < 0.5 else 20.0), (1e-2, 1e2), np.linspace(0, 1, 10))
    check_line(line, np.array([0.1] * 5 + [20.0] * 5))


@pytest.mark.parametrize("beyond", [1e-9, 1e9])
def test_where_there_is_no_line(beyond):
    f = Counted(lambda y: 1.0 if y < 0.5 or y > 0.8 else beyond)
    line = boundary(f, (1e-2, 1e2), np.linspace(0, 1, 21))
    gone = (line["over"] >= 0.5) & (line["over"] <= 0.8)
    assert list(line["along"].isna()) == list(gone)
    check_line(line[~gone], 1.0)
    assert (line["below"] == line["above"])[gone].all()


def test_a_line_that_goes_through_the_end_of_the_range():
    line = boundary(Counted(lambda y: 10 ** (4 * y)), (1.0, 1e2), np.linspace(0.05, 1, 20))
    exact = 10 ** (4 * line["over"])
    inside = exact < 1e2
    check_line(line[inside], exact[inside])
    assert line["along"][~inside].isna().all()


def test_a_third_label_above_the_line_does_not_disturb():
    def three(x, y):
        return 0 if x < 1 + y else 1 if x < 1.001 + y else 2

    line = boundary(three, (0.1, 10.0), np.linspace(0, 1, 11))
    assert np.allclose(line["along"], 1 + line["over"], rtol=2.4e-3)
    assert set(line["below"]) == {0}


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("along", {"along": (2.0, 1.0)}),
        ("along", {"along": (0.0, 1.0)}),
        ("along", {"along": 3.0}),
        ("along", {"along": (1.0, math.nan)}),
        ("over", {"over": [1.0, 1.0]}),
        ("over", {"over": [1.0, 3.0, 2.0]}),
        ("over", {"over": ["a"]}),
        ("over", {"over_scale": "log"}),
        ("over_scale", {"over_scale": "cubic"}),
        ("scale", {"scale": "cubic"}),
        ("tolerance", {"tolerance": 0.0}),
        ("known", {"known": pd.DataFrame({"x": [1.0]})}),
    ],
)
def test_bad_arguments_are_refused(name, arguments):
    f = Counted(lambda y: 1.0)
    with pytest.raises(SceneError, match=name):
        boundary(f, **{"along": (0.1, 10.0), "over": [0.0, 1.0]} | arguments)
    assert not f.calls


def test_a_map_is_finer_where_labels_differ():
    def inside(x, y):
        return "in" if math.hypot(math.log10(x) - 1, y) < 0.5 else "out"

    found = label_map(inside, (1.0, 100.0), (-1.0, 1.0), 200, scales=("log", "linear"))
    assert len(found) == 200
    distance = np.abs(np.hypot(np.log10(found["x"]) - 1, found["y"]) - 0.5)
    points = zip(found["x"], found["y"], strict=True)
    assert (found["label"] == [inside(*point) for point in points]).all()
    even = np.pi * 0.1 * 2 / 4  # share of a band 0.1 wide about the circle
    assert (distance < 0.1).mean() > 3 * even


def test_a_map_without_room_is_refused():
    for name, x, runs in (("x", (1.0, 0.0), 10), ("runs", (0.0, 1.0), 3)):
        with pytest.raises(SceneError, match=name):
            label_map(lambda x, y: 0, x, (0.0, 1.0), runs)


# --- where a label is the sign of a number -------------------------------------------------------


@pytest.mark.parametrize("name", sorted(LINES.keys() - {"steep"}))
@pytest.mark.parametrize("power", [1.0, 3.0])
def test_roots_are_found_in_few_runs(name, power):
    """Interpolation of the measure, from brackets of a map, takes two or three runs."""
    line, grid, over = LINES[name], np.logspace(-2, 2, 20), np.linspace(0, 1, 20)

    def measure(x, y):
        return math.copysign(1, x - line(y)) * abs(math.tanh(math.log(x / line(y)))) ** power

    points = [(x, y, x > line(y), measure(x, y)) for y in over for x in grid]
    known = pd.DataFrame(points, columns=["along", "over", "label", "measure"])
    f = Counted(line)
    known["label"] = np.where(known["label"], "runs through", "arrests")
    found = boundary(f, (1e-2, 1e2), over, known=known, measure=measure)
    check_line(found, np.array([line(y) for y in over]))
    assert len(f.calls) == found["runs"].sum()
    if power == 1:
        assert found["runs"].max() <= 4
        assert found["runs"].mean() < 3
    else:  # at a triple root interpolation is poor: two runs more than bisection
        assert found["runs"].max() <= 2 + 7


def test_a_measure_that_says_nothing_costs_nothing():
    over = np.linspace(0, 1, 8)
    both = [
        boundary(Counted(LINES["wave"]), (1e-2, 1e2), over, measure=measure)
        for measure in (None, lambda x, y: math.nan)
    ]
    pd.testing.assert_frame_equal(*both)


@pytest.mark.parametrize("jump", [0.03, 0.3, 0.7, 0.97])
def test_no_point_needs_more_than_one_run_beyond_bisection(jump):
    """The second point lies anywhere in a known cell, for any position of the first point."""
    cell = 0.16
    for first in (0.05, 0.5, 0.95):
        known = pd.DataFrame(
            [(10**end, y, end == cell) for y in (0, 1, 2, 3) for end in (0.0, cell)],
            columns=["along", "over", "label"],
        )
        line = [10 ** (cell * share) for share in (first, first, first, jump)]
        known["label"] = np.where(known["along"] > 1, "runs through", "arrests")
        f = Counted(lambda y, line=line: line[int(y)])
        found = boundary(f, (0.1, 10.0), range(4), known=known)
        check_line(found, line)
        assert found["runs"].max() <= math.ceil(math.log2(cell / 2e-3)) + 1


def test_labels_that_are_nan_are_one_label():
    how = {"scale": "linear", "tolerance": 0.01}
    nothing = boundary(lambda x, y: float("nan"), (0.0, 1.0), [1.0, 2.0], **how)
    assert nothing["along"].isna().all()
    line = boundary(lambda x, y: float("nan") if x < 0.4 else 1.0, (0.0, 1.0), [1.0, 2.0], **how)
    assert np.abs(line["along"] - 0.4).max() <= 0.01
    assert line["below"].map(math.isnan).all()


def test_no_line_is_reported_only_after_the_lower_end_is_known():
    def turned(x, y):
        return (x > 0.3) != (y == 2.0)

    how = {"scale": "linear", "tolerance": 0.01}
    line = boundary(turned, (0.0, 1.0), [1.0, 2.0, 3.0], **how)
    assert np.abs(line["along"] - 0.3).max() <= 0.01
    assert list(line["below"]) == [False, True, False]
    known = pd.DataFrame({"along": [0.5, 0.6], "over": [1.0, 1.0], "label": [True, True]})
    line = boundary(lambda x, y: x > 0.3, (0.0, 1.0), [1.0], known=known, **how)
    assert abs(line["along"][0] - 0.3) <= 0.01


def test_what_is_no_label_and_no_number_is_refused():
    for field, f, measure in (
        ("f", lambda x, y: np.array([x]), None),
        ("measure", lambda x, y: x > 0.3, lambda x, y: "a"),
    ):
        with pytest.raises(SceneError) as error:
            boundary(f, (0.0, 1.0), [1.0], scale="linear", measure=measure)
        assert error.value.field == field
    with pytest.raises(SceneError, match="over = 3"):
        boundary(lambda x, y: x, (1.0, 2.0), 3)
    with pytest.raises(SceneError, match="scales"):
        label_map(lambda x, y: x, (0.0, 1.0), (0.0, 1.0), 5, scales=("linear",))
