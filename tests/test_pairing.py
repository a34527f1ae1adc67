"""Events of two runs are paired in order, at the least cost of all pairings."""

from itertools import combinations

import numpy as np
import pytest

from pyfric.record import paired


@pytest.mark.parametrize(("n", "m"), [(1, 1), (3, 3), (3, 6), (6, 3), (0, 2)])
def test_pairs_have_the_least_total_cost(n, m):
    rng = np.random.default_rng(n + 10 * m)
    for _ in range(20):
        cost = rng.random((n, m))
        i, j = paired(cost)
        few, many = (i, j) if n <= m else (j, i)
        assert list(few) == list(range(min(n, m)))
        assert (np.diff(many) > 0).all()
        sides = cost if n <= m else cost.T
        ways = combinations(range(max(n, m)), min(n, m))
        least = min(sum(sides[k, way[k]] for k in range(len(way))) for way in ways)
        assert cost[i, j].sum() == pytest.approx(least, rel=1e-12, abs=0)


def test_an_event_more_is_passed_over():
    a, b = np.array([3.0, 7.0, 12.0]), np.array([3.0, 4.0, 7.0, 12.0])
    assert list(paired(np.abs(np.subtract.outer(a, b)))[1]) == [0, 2, 3]
