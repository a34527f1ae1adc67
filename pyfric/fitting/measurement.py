"""A measurement in a fit: measured values, values of a run, and their residuals.

A measurement is one object. Measurements of one experiment are added: `Events(curve) +
Lengths(table) + Known("mu_k", 0.45, 0.01)`. A fit uses only the methods of `Measurement`. A new
kind is a class with the decorator `@measurement`.
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
"""Largest residual of an unmatched event, or of a matched pair, in standard deviations."""
KINDS: dict[str, type[Measurement]] = {}
"""Name of a kind of measurement -> its class."""
ROWS = ("at", "measured", "error", "model", "off")
"""Columns of a table of measured and model values: place, value, standard deviation, value of the
model, residual."""


class At(NamedTuple):
    """Parameters by name, and the standard deviation of the model's forces, over F_N."""

    values: Mapping[str, float]
    tolerance: float = 0.0


def measurement(kind: type[Any]) -> Any:
    """Register a kind of measurement."""
    KINDS[kind.kind] = kind
    return kind


class Measurement(Shown, abc.ABC):
    """A measurement of one experiment.

    Attributes:
        kind: its name.
        own: parameters of the measurement itself, such as an offset, and their units.
        smooth: whether the measured quantity changes smoothly with parameters of the scene.
        engines: engines whose runs have the measured quantity; empty means all.
        duration: duration of a run, s; None means any duration.
        notes: remarks on samples or events that were left out or may be missing.
    """

    kind: ClassVar[str]
    own: ClassVar[Mapping[str, str]] = {}
    smooth: ClassVar[bool] = False
    engines: ClassVar[tuple[str, ...]] = ()

    @property
    def duration(self) -> float | None:
        return None

    def lasts(self, scene: Scene) -> float | None:
        """Return the duration of a run of a scene, s; None means any duration."""
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
        """Number of independent residuals, which must exceed the number of parameters."""
        return self.size

    @property
    def groups(self) -> np.ndarray:
        """Group number of each residual; in a group, errors of a wrong model are correlated."""
        return np.arange(self.size)

    def check(self, scene: Scene) -> None:
        """Raise SceneError if the measurement cannot belong to this scene."""

    def doubts(self, scene: Scene) -> tuple[str, ...]:
        """Return warnings on parameters of a scene that the measurement may not determine."""
        return ()

    def seen(self, record: Record) -> Any:
        """Return the value of the measured quantity in a run."""
        return None

    @abc.abstractmethod
    def residuals(self, seen: Any, at: At) -> np.ndarray:
        """Return the differences of a run from the measurement, in standard deviations, (size,)."""

    def overview(self, seen: Any, at: At) -> np.ndarray:
        """Return rough residuals, which guide the search far from the best parameters."""
        return self.residuals(seen, at)

    @property
    def of_overview(self) -> int:
        """Number of rough residuals, at most `size`."""
        return self.size

    def none(self, at: At) -> np.ndarray:
        """Return the residuals for parameters that cannot be run, shape (size,)."""
        return np.full(self.size, CAP)

    def told(self, seen: Any, at: At) -> int:
        """Return the number of independent residuals that depend on the parameters."""
        return self.count

    def table(self, seen: Any, at: At) -> pd.DataFrame:
        """Return a table of measured values and values of a run, with the columns `ROWS`."""
        return pd.DataFrame(columns=list(ROWS))

    def excess(self, seen: Any, at: At) -> np.ndarray:
        """Return squared deviations of F_T/F_N of a run, minus the variance of the measurement."""
        return np.zeros(0)

    def __add__(self, other: Any) -> Together:
        return Together.of(self) + other

    def __radd__(self, other: Any) -> Together:
        return Together.of(self) + other

    def __str__(self) -> str:
        return f"{type(self).__name__}: {self.count} numbers"

    __repr__ = __str__


class Together(tuple[Measurement, ...]):
    """Measurements of one experiment; their sums of squares are added."""

    __slots__ = ()

    @classmethod
    def of(cls, *parts: Measurement) -> Together:
        return cls(parts)

    def __add__(self, other: Any) -> Together:
        if isinstance(other, Measurement):
            other = (other,)
        elif other == 0:  # sum() starts from 0
            other = ()
        elif not isinstance(other, Together):
            return NotImplemented
        return Together((*self, *other))

    __radd__ = __add__


@measurement
@dataclass(frozen=True, repr=False)
class Known(Measurement):
    """A prior: value and standard deviation of a parameter, known before the fit.

    Args:
        name: name of a varied parameter.
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
    """Return a value in a form that JSON can store: arrays and tables become lists."""
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
    """Return the value that `packed` has turned into `value`."""
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
    """Yield the measurements of each experiment, from one sum or a list of sums.

    Raises:
        SceneError: an entry is no measurement.
    """
    for each in measured if isinstance(measured, list) else [measured]:
        parts = Together.of(each) if isinstance(each, Measurement) else each
        if not isinstance(parts, Together):
            allowed = "measurements, such as pyfric.fitting.Events(curve), or a sum of them"
            raise SceneError("measured", type(each).__name__, "", allowed, "no measurement")
        yield parts
