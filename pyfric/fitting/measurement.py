"""What a measurement is to a fit: what a run has of it, and how far that is from it.

A measurement is one object, and measurements of one experiment are added:
`Events(curve) + Lengths(table) + Known("mu_k", 0.45, 0.01)`. A fit asks each for the same few
things, and for nothing else. A new kind is a class under `@measurement`.
"""

from __future__ import annotations

import abc
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pandas as pd

from pyfric.display import Shown
from pyfric.record import Record
from pyfric.scene import Scene
from pyfric.values import SceneError, check_number

CAP = 10.0
"""Standard deviations beyond which an event without a partner, or a pair, counts no more."""
KINDS: dict[str, type[Measurement]] = {}
"""Kinds of measurements by name."""
ROWS = ("at", "measured", "error", "model", "off")
"""Columns of numbers beside those of a model: place, value, standard deviation, value of the model,
residual."""


class At(NamedTuple):
    """Parameters by name, and the standard deviation of forces of the model, over F_N."""

    values: Mapping[str, float]
    tolerance: float = 0.0


def measurement(kind: type[Any]) -> Any:
    """Add a kind of measurement."""
    KINDS[kind.kind] = kind
    return kind


class Measurement(Shown, abc.ABC):
    """A measurement of one experiment.

    Attributes:
        kind: its name.
        own: parameters that are not of a scene but of the measurement, and their units.
        smooth: whether it changes smoothly with parameters of the scene.
        engines: engines that have it; empty: all.
        duration: length of a run that has it, s; None: any.
        notes: what was left out, and what it may miss.
    """

    kind: ClassVar[str]
    own: ClassVar[Mapping[str, str]] = {}
    smooth: ClassVar[bool] = False
    engines: ClassVar[tuple[str, ...]] = ()

    @property
    def duration(self) -> float | None:
        return None

    def lasts(self, scene: Scene) -> float | None:
        """Return the length of a run of a scene that has it, s; None: any."""
        return self.duration

    @property
    def notes(self) -> tuple[str, ...]:
        return ()

    @property
    @abc.abstractmethod
    def size(self) -> int:
        """Number of residuals."""

    @property
    def count(self) -> int:
        """Number of independent residuals, of which parameters have to be fewer."""
        return self.size

    @property
    def groups(self) -> np.ndarray:
        """Number of the group of each residual that errors of a wrong model have in common."""
        return np.arange(self.size)

    def check(self, scene: Scene) -> None:
        """Raise SceneError if it cannot be of this scene."""

    def doubts(self, scene: Scene) -> tuple[str, ...]:
        """Return what it may not tell of a scene."""
        return ()

    def seen(self, record: Record) -> Any:
        """Return what a run has of it."""
        return None

    @abc.abstractmethod
    def residuals(self, seen: Any, at: At) -> np.ndarray:
        """Return how far a run is from it, in standard deviations, shape (size,)."""

    def overview(self, seen: Any, at: At) -> np.ndarray:
        """Return how far a run is that may be far away: residuals that lead to the nearer ones."""
        return self.residuals(seen, at)

    @property
    def of_overview(self) -> int:
        """Number of residuals of the overview, at most `size`."""
        return self.size

    def none(self, at: At) -> np.ndarray:
        """Return the residuals of parameters that have no run, shape (size,)."""
        return np.full(self.size, CAP)

    def told(self, seen: Any, at: At) -> int:
        """Return the number of residuals that tell something of these parameters."""
        return self.count

    def table(self, seen: Any, at: At) -> pd.DataFrame:
        """Return what was measured beside what a run has of it."""
        return pd.DataFrame(columns=list(ROWS))

    def excess(self, seen: Any, at: At) -> np.ndarray:
        """Return squares of errors of forces, over F_N, less their variance in the measurement."""
        return np.zeros(0)

    def __add__(self, other: Any) -> Together:
        return Together.of(self) + other

    def __radd__(self, other: Any) -> Together:
        return Together.of(self) + other

    def __str__(self) -> str:
        return f"{type(self).__name__}: {self.count} numbers"

    __repr__ = __str__


class Together(tuple[Measurement, ...]):
    """Measurements of one experiment; they are added, and so do their sums of squares."""

    __slots__ = ()

    @classmethod
    def of(cls, *parts: Measurement) -> Together:
        return cls(parts)

    def __add__(self, other: Any) -> Together:
        if isinstance(other, Measurement):
            other = (other,)
        elif other == 0:  # the start of sum()
            other = ()
        elif not isinstance(other, Together):
            return NotImplemented
        return Together((*self, *other))

    __radd__ = __add__


@measurement
@dataclass(frozen=True, repr=False)
class Known(Measurement):
    """A parameter that is known within an error: a prior.

    Args:
        name: of a parameter that is varied.
        value: its value, SI units.
        error: its standard deviation, > 0.

    Raises:
        SceneError: a number is refused.
    """

    kind: ClassVar[str] = "known"
    smooth: ClassVar[bool] = True
    name: str
    value: float
    error: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", check_number("value", self.value, ""))
        object.__setattr__(self, "error", check_number("error", self.error, "", gt=0.0))

    @property
    def size(self) -> int:
        return 1

    def residuals(self, seen: Any, at: At) -> np.ndarray:
        return np.array([(at.values[self.name] - self.value) / self.error])

    def none(self, at: At) -> np.ndarray:
        return self.residuals(None, at)

    def table(self, seen: Any, at: At) -> pd.DataFrame:
        off = float(self.residuals(seen, at)[0])
        row = (self.name, self.value, self.error, at.values[self.name], off)
        return pd.DataFrame([row], columns=list(ROWS))

    def __str__(self) -> str:
        return f"Known: {self.name} = {self.value:.5g} +- {self.error:.2g}"


def packed(value: Any) -> Any:
    """Return a value for a file: arrays and tables as lists, NaN as None."""
    if isinstance(value, pd.DataFrame):
        columns = {name: packed(of.to_numpy()) for name, of in value.items()}
        attrs = {name: packed(of) for name, of in value.attrs.items()}
        index = {"index": value.index.tolist(), "name": value.index.name}
        return {"table": columns, "attrs": attrs} | index
    if isinstance(value, Measurement):
        named = {part: packed(getattr(value, part)) for part in value.__dataclass_fields__}
        return {"measurement": named, "kind": value.kind}
    if isinstance(value, np.ndarray):
        return {"array": [packed(each) for each in value.tolist()]}
    if isinstance(value, tuple | list):
        return {"tuple": [packed(each) for each in value]}
    if isinstance(value, Mapping):
        return {"mapping": {name: packed(of) for name, of in value.items()}}
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else {"float": str(float(value))}
    return value.item() if isinstance(value, np.generic) else value


def unpacked(value: Any) -> Any:
    """Return the value that `packed` was given."""
    if not isinstance(value, dict):
        return value
    if "table" in value:
        columns = {name: unpacked(of) for name, of in value["table"].items()}
        found = pd.DataFrame(columns, index=pd.Index(value["index"], name=value["name"]))
        found.attrs = {name: unpacked(of) for name, of in value["attrs"].items()}
        return found
    if "measurement" in value:
        made = object.__new__(KINDS[value["kind"]])
        for name, of in value["measurement"].items():
            object.__setattr__(made, name, unpacked(of))
        return made
    makers: dict[str, Callable[[Any], Any]] = {
        "array": lambda of: np.array([unpacked(each) for each in of]),
        "tuple": lambda of: tuple(unpacked(each) for each in of),
        "mapping": lambda of: {name: unpacked(each) for name, each in of.items()},
        "float": float,
    }
    (name, of), *_ = value.items()
    return makers[name](of)


def experiments(measured: Any) -> Iterator[Together]:
    """Yield the measurements of each experiment, of one sum or of a list of them.

    Raises:
        SceneError: something else is among them.
    """
    for each in measured if isinstance(measured, list) else [measured]:
        parts = Together.of(each) if isinstance(each, Measurement) else each
        if not isinstance(parts, Together):
            allowed = "measurements, such as pyfric.fitting.Events(curve), or a sum of them"
            raise SceneError("measured", type(each).__name__, "", allowed, "no measurement")
        yield parts
