"""Events of two runs are paired in order, at the least cost of all pairings."""

from itertools import combinations

import numpy as np
import pandas as pd
import pytest

from pyfric.record import paired
from pyfric.record.pairing import event_distances, in_order
from pyfric.scene import preset, slab


def events(*rows):
    """Return a table of events: t_start (s), F_T_start (N), first_block, last_block."""
    return pd.DataFrame(rows, columns=["t_start", "F_T_start", "first_block", "last_block"])


@pytest.mark.parametrize(("n", "m"), [(1, 1), (3, 3), (3, 6), (6, 3), (0, 2)])
def test_pairs_have_the_least_total_cost(n, m):
    rng = np.random.default_rng(n + 10 * m)
    for _ in range(20):
        cost = rng.random((n, m))
        i, j = in_order(cost)
        few, many = (i, j) if n <= m else (j, i)
        assert list(few) == list(range(min(n, m)))
        assert (np.diff(many) > 0).all()
        sides = cost if n <= m else cost.T
        ways = combinations(range(max(n, m)), min(n, m))
        least = min(sum(sides[k, way[k]] for k in range(len(way))) for way in ways)
        assert cost[i, j].sum() == pytest.approx(least, rel=1e-12, abs=0)


def test_distances_are_forces_times_and_blocks():
    scene = preset("fig1")
    one = events((0.1, 350.0, 1, 10))
    others = events((0.1, 350.0, 1, 10), (0.1, 385.0, 1, 10), (0.2, 350.0, 1, 10),
                    (0.1, 350.0, 6, 15), (0.1, 350.0, 11, 20))  # fmt: skip
    rate = scene.driver.K * scene.driver.V / scene.F_N
    np.testing.assert_allclose(
        event_distances(one, others, scene)[0], [0, 0.01, 0.1 * rate, 1 - 5 / 15, 1], atol=1e-15
    )


def test_an_event_more_is_passed_over():
    """A micro-slip at nearly the same force is not paired with an event of many blocks."""
    a = events((0.1, 300.0, 1, 3), (0.2, 700.0, 1, 7), (0.3, 999.0, 1, 12))
    b = events((0.1, 300.0, 1, 3), (0.1999, 699.0, 1, 1), (0.21, 720.0, 1, 8), (0.3, 999.0, 1, 12))
    assert [list(one) for one in paired(a, b, preset("fig1"))] == [[0, 1, 2], [0, 2, 3]]
    assert [list(one) for one in paired(b, a, preset("fig1"))] == [[0, 2, 3], [0, 1, 2]]


def test_events_without_forces_are_paired_by_blocks_and_times():
    scene = slab(p=10.0, L=0.02, H=0.005, l=2.5e-3)
    assert scene.driver.K == 0
    a = events((1.0, np.nan, 1, 4), (2.0, np.nan, 1, 4))
    b = events((1.1, np.nan, 1, 4), (1.4, np.nan, 1, 4), (2.1, np.nan, 1, 4))
    assert list(paired(a, b, scene)[1]) == [0, 2]
    np.testing.assert_allclose(event_distances(a, b, scene, span=10.0)[0], [0.01, 0.04, 0.11])
