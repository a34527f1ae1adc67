"""Random values along the interface, the same on any machine."""

from typing import Annotated, ClassVar

import numpy as np

from pyfric.scene.profile import Profile
from pyfric.values import NotNegative, SceneError, Whole, part

SUMMED = 12
"""Number of uniform numbers whose sum approximates a normal number; the sum has variance 1."""
CELLS = 32
"""Number of cells of white noise in one correlation length."""
MOST_CELLS = 2_000_000
"""Largest number of cells, whose random numbers take half a second."""


def stream(name: str) -> int:
    """Return the number of the random stream of a field, computed from its name; 0 for mu_s."""
    of_name, first = (int.from_bytes(text.encode()[:8], "big") for text in (name, "mu_s"))
    return of_name ^ first


def uniform(n: int, seed: int, name: str = "mu_s") -> np.ndarray:
    """Return n random multiples of 2^-53 in [0, 1), from Philox with key (seed, stream of name)."""
    key = np.array([seed, stream(name)], dtype=np.uint64)
    raw = np.random.Philox(key=key, counter=[0, 0, 0, 0]).random_raw(n)
    return (raw >> np.uint64(11)).astype(float) * 2.0**-53


@part
class Spread:
    """A field of random numbers, one for each block.

    Args:
        mean: mean, in the unit of the field.
        std: standard deviation, for a normal distribution; alternatively
        range: half width of a uniform distribution from mean - range to mean + range.
        correlation_length: length over which white noise along the interface is averaged, m; 0 for
            independent blocks. The correlation of two points falls linearly with their distance and
            is 0 at this length.
        seed: seed of the generator, a whole number from 0 to 2^64 - 1.

    Each field has a stream of its own: equal seeds of two fields give independent numbers. With a
    correlation length the field is a function of the distance x from the trailing edge. The field
    depends neither on l nor on L: blocks of l/2 are on the same interface. Without a correlation
    length, the interface differs for each l.

    The normal distribution is approximated, within 0.0023, by the sum of twelve uniform numbers
    minus 6. No independent value is further than 6 std from the mean. With `range` there is no
    correlation length. The uniform numbers are those of Philox 4x64 with ten rounds. Only
    additions, products and one square root follow, so that fields are the same on any machine.

    Source: J. K. Salmon et al., Proc. SC11, 16 (2011), Philox.
    """

    mean: Annotated[float, NotNegative("")]
    std: Annotated[float | None, NotNegative("", optional=True)] = None
    range: Annotated[float | None, NotNegative("", optional=True)] = None
    correlation_length: Annotated[float, NotNegative("m")] = 0.0
    seed: Annotated[int, Whole(2**64 - 1)] = 0

    _section: ClassVar[str] = "spread"
    in_unit: ClassVar[tuple[str, ...]] = ("mean", "std", "range")

    def __post_init__(self) -> None:
        if (self.std is None) == (self.range is None):
            raise SceneError("spread.std", self.std, "", "either std or range", "one is needed")
        if self.range is not None and self.correlation_length:
            allowed = "0 m with a uniform distribution: averages are not uniform"
            raise SceneError("spread.correlation_length", self.correlation_length, "m", allowed)

    @property
    def in_space(self) -> bool:
        """Whether the field is a function of x, independent of the blocks."""
        return bool(self.correlation_length)

    def draw(self, n: int, l: float, name: str = "mu_s") -> np.ndarray:
        """Return the field on n blocks with spacing l (m), from the trailing edge on.

        Args:
            n: number of blocks.
            l: spacing, in m.
            name: name of the field, whose stream is used.

        Raises:
            SceneError: the correlation length is so short that blocks are independent.
        """
        if self.range is not None:
            return self.mean + self.range * (2 * uniform(n, self.seed, name) - 1)
        if self.correlation_length:
            return self.mean + self.std * self._averaged(n, l, name)
        normal = np.zeros(n)
        for each in uniform(SUMMED * n, self.seed, name).reshape(SUMMED, -1):
            normal += each
        return self.mean + self.std * (normal - SUMMED / 2)

    def _averaged(self, n: int, l: float, name: str) -> np.ndarray:
        """Return white noise averaged from each block over a correlation length, of variance 1.

        A window begins at the fraction f of a cell, and ends at the same fraction of another cell.
        """
        x = np.arange(n) * (CELLS * (l / self.correlation_length))
        if x[-1] > MOST_CELLS:
            shortest = CELLS * (n - 1) * l / MOST_CELLS
            length, allowed = self.correlation_length, f"0 m, or at least {shortest:.3g} m"
            raise SceneError("spread.correlation_length", length, "m", allowed, "far below l")
        cell = np.floor(x).astype(np.int64)
        f, normal = x - cell, np.zeros(int(cell[-1]) + CELLS + 1)
        for each in uniform(SUMMED * len(normal), self.seed, name).reshape(-1, SUMMED).T:
            normal += each
        normal -= SUMMED / 2
        walk = np.concatenate([[0.0], np.cumsum(normal)])
        begin, end = (walk[c] + f * normal[c] for c in (cell, cell + CELLS))
        return (end - begin) / np.sqrt(CELLS - 2 * f * (1 - f))


Field = float | tuple[float, ...] | Spread | Profile
"""A number, a list of numbers for blocks from the trailing edge on, a `Spread` or `Profile`."""
BLOCKS = {"listed": True, "each": "block", "note": ", or a list of N_x of them"}
"""Keyword arguments of annotations of values with one number for each block."""
FIELD = BLOCKS | {"drawn": (Spread, Profile), "note": BLOCKS["note"] + ", a Spread or a Profile"}
"""Keyword arguments of annotations of fields."""
