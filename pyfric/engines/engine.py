"""An engine is an object: its model, its options, and the function that runs a scene.

    DYNAMIC = Engine(name="dynamic", models="dynamics throughout", options=..., follow=...)

Each option declares its owner (`pyfric.engines.options`), which decides the engines that have it.
An engine refuses options that it lacks. The error names the option, and the engines that have this
option.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Protocol

from pyfric import core
from pyfric.core import State
from pyfric.engines.cost import POINTS, check_memory
from pyfric.engines.declared import REGISTERED
from pyfric.engines.options import RTOL
from pyfric.engines.pauses import longest_pause, pause_notes
from pyfric.engines.step_sizes import (
    ACCURACY,
    ERRORS,
    check_located,
    check_steps,
    is_auto,
    keeps,
)
from pyfric.record import Method
from pyfric.scene import check_geometry, default_geometry
from pyfric.values import SceneError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.display import Progress
    from pyfric.engines.options import Options
    from pyfric.record import Record
    from pyfric.scene import Geometry, Scene


class Counted(Protocol):
    """A run in progress that counts its operations."""

    @property
    def counts(self) -> dict[str, int]: ...


class Follow(Protocol):
    """Function that runs a scene to t_end (s) with options that its engine has."""

    def __call__(
        self,
        scene: Scene,
        t_end: float,
        options: Options,
        *,
        initial: State | Record | None,
        progress: bool | Callable[[Progress], None] | None,
        enough: Callable[[Counted], bool] | None,
    ) -> Record: ...


@dataclasses.dataclass(frozen=True, kw_only=True)
class Engine:
    """An engine.

    Args:
        name: name of the engine, a value of the option `fidelity`.
        models: the physics that the engine models, in words.
        leaves_out: the effects that the engine leaves out, in words.
        options: names of the allowed options.
        geometries: allowed geometries of bonds.
        steppers: allowed steppers; () if the engine makes no time steps.
        jumps: whether the engine makes jumps.
        check: function that raises SceneError for a scene that the engine cannot run.
        follow: function that runs a scene.
    """

    name: str
    models: str
    leaves_out: tuple[str, ...] = ()
    options: frozenset[str]
    geometries: tuple[Geometry, ...] = ("finite", "linear")
    steppers: tuple[str, ...] = ()
    jumps: bool = False
    check: Callable[[Scene], None] = lambda scene: None
    follow: Follow

    @property
    def steps(self) -> bool:
        """Whether the engine makes time steps, so that its runs can continue a `State`."""
        return bool(self.steppers)

    @property
    def energies(self) -> bool:
        """Whether the engine can compute the energy budget."""
        return "energies" in self.options

    def cannot(self, scene: Scene) -> str:
        """Return why the engine cannot run a scene, or "" if it can."""
        try:
            self.check(scene)
        except SceneError as error:
            return error.reason
        return ""

    def has(self, name: str, value: Any) -> bool:
        """Return whether the engine allows an option this value. None is always allowed."""
        if name in self._values:
            return value is None or value in self._values[name]
        return name in self.options

    @property
    def _values(self) -> dict[str, tuple[str, ...]]:
        """Allowed values of the options "geometry" and "stepper", if the engine has them."""
        values = {"geometry": self.geometries, "stepper": self.steppers}
        return {name: known for name, known in values.items() if name in self.options}

    def lacks(self, options: Options) -> SceneError | None:
        """Return the error for the first option that the engine lacks, or None."""
        for name, option in options.declared().items():
            value = getattr(options, name)
            if option.of_engine and option.asks(value) and not self.has(name, value):
                others = [e.name for e in ENGINES.values() if e.has(name, value)]
                known = self._values.get(name)
                allowed = " or ".join(map(repr, known or (option.nothing,)))
                if others:
                    allowed += f", or fidelity = {' or '.join(map(repr, others))}"
                lack = f"has no {name} {value!r}" if known else option.lack
                reason = f"the {self.name} engine {lack}"
                return SceneError(name, value, option.mark.unit, allowed, reason)
        return None

    def check_options(self, options: Options) -> None:
        """Raise SceneError if the engine lacks an option."""
        if (error := self.lacks(options)) is not None:
            raise error

    def settled(self, scene: Scene, options: Options, t_begin: float, t_end: float) -> Method:
        """Return the method of a run with time steps between two times, in s.

        Raises:
            SceneError: the scene or the engine does not allow an option.
        """
        if options.geometry is not None:
            check_geometry(options.geometry, scene)
        self.check(scene)
        self.check_options(options)
        if self.jumps and options.energies and scene.law.flows:
            reason = "steps without inertia between events leave energies out"
            raise SceneError("energies", True, "", "False, or fidelity = 'dynamic'", reason)
        dt, switching = options.steps_on(scene)
        stepper = options.stepper_on(scene)
        chosen = is_auto(options.dt) and options.method is None and keeps(stepper, switching)
        if options.accuracy is not None and not (self.jumps or chosen):
            steppers = " or ".join(map(repr, ERRORS))
            allowed = f"None, or dt = 'auto' with the stepper {steppers} and located switching"
            raise SceneError("accuracy", options.accuracy, "F_N", allowed, "has no effect")
        if switching == "located":
            check_located(scene, stepper, dt)
        check_steps(t_begin, t_end, dt)
        every = (t_end - t_begin) / dt / POINTS if options.sample is None else options.sample / dt
        budget = options.energies
        if budget is None:
            budget = self.energies and not self.jumps
        return Method(
            engine=self.name,
            geometry=options.geometry or default_geometry(scene),
            stepper=stepper,
            switching=switching,
            rtol=(options.rtol or RTOL) if options.stepper == "adaptive" else None,
            dt=dt,
            sample=max(1, round(every)),
            t_gap=longest_pause(scene) if options.t_gap is None else options.t_gap,
            threads=core.useful_threads(scene.N_x * scene.N_z, options.threads),
            variant=core.VARIANT,
            budget=budget,
            accuracy=(options.accuracy or ACCURACY) if self.jumps else None,
            threshold=options.threshold,
        )

    def run(
        self,
        scene: Scene,
        t_end: float,
        options: Options,
        *,
        initial: State | Record | None = None,
        progress: bool | Callable[[Progress], None] | None = None,
        enough: Callable[[Counted], bool] | None = None,
    ) -> Record:
        """Run a scene to t_end (s); see `pyfric.simulate`.

        The run of an engine with time steps ends as soon as `enough` returns true.

        Raises:
            SceneError: the engine cannot run the scene, lacks an option, or needs more memory than
                is available.
        """
        self.check(scene)
        self.check_options(options)
        geometry = options.geometry or default_geometry(scene)
        check_memory(
            scene, self.name, geometry if geometry in self.geometries else self.geometries[0]
        )
        how = {"initial": initial, "progress": progress, "enough": enough}
        record = self.follow(scene, t_end, options, **how)
        new = [note for note in pause_notes(record) if note not in record.notes]
        return record.replace(notes=(*record.notes, *new)) if new else record


ENGINES: dict[str, Engine] = REGISTERED
"""All engines by name, in order of increasing work."""
