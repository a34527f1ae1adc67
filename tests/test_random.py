"""The core's random numbers are those of NumPy's Philox, bit for bit."""

import numpy as np
import pytest

from pyfric import core
from pyfric.core.builds import load_variant

LAST = 2**64 - 1
KEYS = [(0, 0), (7, 0), (LAST, LAST), (0x0123456789ABCDEF, 0xFEDCBA9876543210)]
COUNTERS = [
    (0, 0, 0, 0),
    (0, 17, 100, 3),
    (LAST, 5, 0, 0),  # a carry into the next word
    (LAST - 1, LAST, LAST, 1),
    (LAST, LAST, LAST, LAST),  # a carry beyond the last word
    (0xFEDCBA9876543210, 0x0123456789ABCDEF, 0x8000000000000000, 0x7FFFFFFFFFFFFFFF),
]


def drawn(variant, key, counter, n):
    words = (np.array(one, dtype=np.uint64).view(np.int64) for one in (key, counter))
    return load_variant(variant).uniforms(n, *words)


def of_numpy(key, counter, n):
    bits = np.random.Philox(
        key=np.array(key, dtype=np.uint64), counter=np.array(counter, dtype=np.uint64)
    )
    return (bits.random_raw(n) >> np.uint64(11)) * 2.0**-53


@pytest.mark.parametrize("variant", [name for name, runs in core.variants().items() if runs])
@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("counter", COUNTERS)
def test_numbers_are_those_of_numpy(variant, key, counter):
    for n in (1, 4, 5, 12):
        np.testing.assert_array_equal(drawn(variant, key, counter, n), of_numpy(key, counter, n))


def test_blocks_junctions_and_breaks_have_numbers_of_their_own():
    """Neighbouring counters give different numbers, evenly spread over [0, 1)."""
    seen = np.array(
        [
            drawn(core.VARIANT, (3, 0), (0, i, j, n), 12)
            for i in range(1, 9)
            for j in range(1, 17)
            for n in range(1, 9)
        ]
    )
    assert len(np.unique(seen)) == seen.size
    assert seen.min() >= 0
    assert seen.max() < 1
    normal = seen.sum(axis=1) - 6
    assert abs(normal.mean()) < 4 / np.sqrt(len(normal))
    assert abs(normal.var() - 1) < 4 * np.sqrt(2 / len(normal))
