"""The method of a run: engine, steps, definition of events, software and processor."""

from __future__ import annotations

import datetime
import platform
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import tomli_w

from pyfric import core
from pyfric.scene import __version__
from pyfric.values import write

T_GAP = 1e-3
"""Default longest pause inside an event, s. A policy."""
SWITCH = {
    "located": "stick-slip transitions located within time steps",
    "step_end": "stick-slip transitions at step ends, as in the paper",
}


@dataclass(frozen=True, kw_only=True)
class Model:
    """Engine of a run, with its geometry, steps and accuracy.

    ``stepper`` and ``switching`` are "" without steps. ``dt`` (s) is None without fixed steps.
    ``accuracy`` (over F_N) is the accuracy of jumps, None without jumps. ``rtol`` is the largest
    error of an adaptive sub-step, None for other steppers. ``faster`` is the relative increase of
    the driver's speed over that of the scene.
    """

    engine: str
    geometry: str
    stepper: str = ""
    switching: str = ""
    rtol: float | None = None
    dt: float | None = None
    accuracy: float | None = None
    faster: float = 0.0

    __pydantic_config__: ClassVar[Any] = {"extra": "forbid"}  # of files

    def __str__(self) -> str:
        words = [f"{self.engine}, {self.geometry} geometry"]
        if self.dt is not None:
            words.append(f"{self.stepper}, dt = {self.dt * 1e6:.3g} us")
        if self.accuracy is not None:
            words.append(f"jumps within {self.accuracy:.1g} F_N")
        if self.faster:
            words.append(f"a driver that is faster by {self.faster:g}")
        return ", ".join(words)

    @classmethod
    def of(cls, other: object) -> Self:
        """Return a model with the attributes of an object."""
        names = (field.name for field in fields(cls))
        return cls(**{name: getattr(other, name) for name in names if hasattr(other, name)})


@dataclass(frozen=True, kw_only=True)
class Method:
    """The method of a run.

    The first fields are the fields of its `Model`. ``sample`` is the number of steps between two
    points of the curve. ``t_gap`` (s) is the longest pause inside an event. ``budget`` is True if
    the energy budget was computed. ``threshold`` (m/s) is the slip rate that defines events, None
    if contact defines them.
    """

    engine: str
    geometry: str
    stepper: str = ""
    switching: str = ""
    rtol: float | None = None
    dt: float | None = None
    accuracy: float | None = None
    sample: int = 0
    t_gap: float = T_GAP
    threads: int = 1
    variant: str = ""
    budget: bool = False
    threshold: float | None = None

    __pydantic_config__: ClassVar[Any] = {"extra": "forbid"}  # of files

    def __str__(self) -> str:
        """Text with engine, geometry, stepper, step, switches, and slip rate of events."""
        words = [f"{self.engine} engine", f"{self.geometry} geometry"]
        if self.stepper:
            words.append(self.stepper)
        if self.dt is not None:
            words.append(f"dt = {self.dt * 1e6:g} us")
        if self.switching:
            words.append(SWITCH.get(self.switching, self.switching))
        if self.threshold is not None:
            words.append(f"events faster than {self.threshold:g} m/s")
        return ", ".join(words)

    @property
    def model(self) -> Model:
        """Engine, geometry, steps and accuracy."""
        return Model.of(self)


def versions() -> dict[str, str]:
    """Return the versions of the software that makes a record."""
    build = core.build_info()
    return {
        "pyfric": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "compiler": build["compiler"],
        "flags": build["flags"],
        "machine": platform.machine(),
    }


def provenance(path: Path, command: str) -> Path:
    """Write command, date, software and processor of a set of files to `path`; return `path`."""
    made = {
        "command": command,
        "date": datetime.datetime.now(datetime.UTC).replace(microsecond=0),
        "processor": _processor(),
        "versions": versions(),
    }
    return write(path, tomli_w.dumps(made).encode())


def _processor() -> str:
    """Return the name of the processor model as the operating system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()
