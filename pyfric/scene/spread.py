"""Random values along the interface, the same on any machine."""

from typing import Annotated, ClassVar

import numpy as np

from pyfric.scene.checked import NotNegative, Whole, part
from pyfric.scene.errors import SceneError

SUMMED = 12
"""Uniform numbers in a sum that approximates a normal number; the sum has variance 1."""


def uniform(n: int, seed: int) -> np.ndarray:
    """Return n numbers in [0, 1), multiples of 2^-53, of Philox under the key (seed, 0)."""
    key = np.array([seed, 0], dtype=np.uint64)
    raw = np.random.Philox(key=key, counter=[0, 0, 0, 0]).random_raw(n)
    return (raw >> np.uint64(11)).astype(float) * 2.0**-53


@part
class Spread:
    """A field of random numbers, one for each block.

    Args:
        mean: mean, in the unit of the field.
        std: standard deviation, for a normal distribution; alternatively
        range: half width of a uniform distribution from mean - range to mean + range.
        correlation_length: length over which the field is averaged, m; 0 for independent blocks.
            The correlation of two blocks falls linearly with their distance and is 0 at this
            length.
        seed: seed of the generator, a whole number from 0 to 2^64 - 1.

    The normal distribution is that of the sum of twelve uniform numbers minus 6, within
    0.0023. No independent value is further than 6 std from the mean. With `range` there is no
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

    def draw(self, n: int, l: float) -> np.ndarray:
        """Return the field on n blocks with spacing l (m), from the trailing edge on."""
        if self.range is not None:
            return self.mean + self.range * (2 * uniform(n, self.seed) - 1)
        over = max(1, round(self.correlation_length / l))
        normal = np.zeros(n + over - 1)
        for each in uniform(SUMMED * len(normal), self.seed).reshape(SUMMED, -1):
            normal += each
        normal -= SUMMED / 2
        total = np.zeros(n)
        for first in range(over):
            total += normal[first : first + n]
        return self.mean + (self.std / np.sqrt(float(over))) * total


Field = float | tuple[float, ...] | Spread
"""A number, a list with a number for each block from the trailing edge on, or a `Spread`."""
BLOCKS = {"listed": True, "each": "block", "note": ", or a list of N_x of them"}
"""What the annotations of values of each block have in common."""
FIELD = BLOCKS | {"drawn": Spread, "note": BLOCKS["note"] + ", or a Spread"}
"""What the annotations of fields have in common."""
