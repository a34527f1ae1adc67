"""One run as data: what `pyfric.simulate` is called with, and the key of what that gives."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from pyfric.engines import Options
from pyfric.scene import (
    Number,
    Scene,
    SceneError,
    SceneLike,
    __version__,
    as_scene,
    check_number,
    unknown,
)

ELSEWHERE = ("threads", "checkpoint", "checkpoint_every")
"""Options that do not change what a run gives; jobs leave them to `run_all`."""
OPTIONS = tuple(known.name for known in dataclasses.fields(Options) if known.name not in ELSEWHERE)
"""Options that a job may have."""
DEFAULTS = Options()
ROOMS = ("scene", "theory", "core", "statics", "record", "engines")
"""Rooms whose code determines what a run gives."""


class JobError(RuntimeError):
    """A run failed.

    Attributes:
        job: its job.
        error: what went wrong; a `RunError` has the record until then. Of a run that failed
            earlier, the reason that was noted, as text.
    """

    def __init__(self, job: Job, error: Exception | str) -> None:
        super().__init__(job, error)
        self.job, self.error = job, error

    @property
    def reason(self) -> str:
        """What went wrong, after its type."""
        if isinstance(self.error, str):
            return self.error
        return f"{type(self.error).__name__}: {self.error}"

    def __str__(self) -> str:
        return f"{self.job}: {self.reason}"


@dataclass(frozen=True, init=False)
class Job:
    """One run: what `pyfric.simulate` is called with.

    Args:
        scene: a scene, the name of a preset, or the path of a scene file, which is read at once.
        t_end: time of the end, in s.
        options: an `Options`, or a mapping from names in `OPTIONS` to values.

    Raises:
        SceneError: a value is refused, or an option is unknown.
    """

    scene: Scene
    t_end: float
    options: Options

    def __init__(
        self, *, scene: SceneLike, t_end: Number, options: Options | Mapping[str, Any] = DEFAULTS
    ) -> None:
        scene, t_end = as_scene(scene), check_number("t_end", t_end, "s", ge=0.0)
        if not isinstance(options, Options | Mapping):
            raise SceneError("options", options, "", "Options, or a mapping")
        given = options.given() if isinstance(options, Options) else options
        for name, value in given.items():
            if name not in OPTIONS:
                raise unknown(f"options.{name}", value, str(name), OPTIONS)
        options = options if isinstance(options, Options) else Options(**options)
        options.check_sample(t_end)
        vars(self).update(scene=scene, t_end=t_end, options=options)

    def __repr__(self) -> str:
        return f"Job: {self}"

    def __str__(self) -> str:
        options = "".join(f", {name} = {value}" for name, value in self.options.given().items())
        return f"{self.scene.name or 'scene'} to t = {self.t_end:g} s{options}"

    @property
    def key(self) -> str:
        """Hash of all that determines the record: scene (not its name), end, options, code."""
        scene = dataclasses.replace(self.scene, name="").to_toml()
        options = {name: getattr(self.options, name) for name in OPTIONS}
        content = json.dumps([scene, self.t_end, options, code_version()], sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()[:40]


@functools.cache
def code_version() -> str:
    """Return a hash of what computes a run: `ROOMS`, the compiled core, NumPy and SciPy."""
    versions = (__version__, np.__version__, scipy.__version__)  # static states go through LAPACK
    found = hashlib.sha256(" ".join(versions).encode())
    package = Path(__file__).parents[1]
    for path in sorted(package.rglob("*")):
        inside = path.relative_to(package).parts
        if path.suffix == ".so" or (path.suffix == ".py" and inside[0] in ROOMS):
            name = path.relative_to(package).as_posix().encode()
            found.update(name + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()
