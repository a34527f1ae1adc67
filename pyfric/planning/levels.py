"""Levels of a scene, in the order of their cost.

Each level is more exact than the level before in engine, geometry, step or accuracy of jumps. h is
a step at which errors fall with a power of the step (`STEP_ERROR`). A scene of finite geometry has
these levels:

tolerance     engine        geometry   step    jumps
-----------   -----------   --------   -----   -----
`LOOSE` or    quasistatic   linear
more          hybrid        finite     h       1e-4
              hybrid        finite     2h/3    1e-5
              hybrid        finite     4h/9    1e-6
less          hybrid        linear     h       1e-4
              hybrid        finite     2h/3    1e-5
              hybrid        finite     4h/9    1e-6
              hybrid        finite     8h/27   1e-7

A quasi-static sequence usually only measures the errors of other levels. The first level with
linear geometry is left out if linear geometry neglects more than the tolerance. If the law has no
states of rest, all levels are full dynamics. A step is 2/3 of the step before with the stepper
"rk46" and located switches. In all other cases, or if the step was given, steps are halved.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pyfric.core import STEPPERS
from pyfric.engines import (
    ACCURACY,
    ENGINES,
    FINEST,
    RTOL,
    Options,
    default_switching,
    largest_strain,
    resolving,
    rounded_step,
    share_of_limit,
    step_size,
)
from pyfric.record import Model
from pyfric.scene import default_geometry
from pyfric.statics import stability_limit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.scene import Geometry, Scene

STEP_ERROR = 7e-7
"""Error of forces over F_N due to steps of the first level in most scenes (`share_of_limit`). These
steps are 0.47 of the stability limit of "rk46". With longer steps, two runs with wrong events can
agree. In 200 scenes, no two runs with wrong events agreed at these steps."""
SHORTER, HALF = 2 / 3, 1 / 2
"""Step of a level over the step of the level before. Policies; see the module."""
FIRST, STRICTER = 1e-4, 0.1
"""Accuracy of jumps at the first level, and ratio of accuracies of successive levels. Policies."""
STEPPED = 4
"""Number of levels with steps if one level has linear geometry; otherwise one level less. A
policy."""
LOOSE = 0.05
"""Smallest tolerance for which a quasi-static sequence is run. The error of a sequence is up to
0.04 F_N in the paper's scenes."""
ROTATION = 0.2
"""Order of magnitude of the error of forces without rotation of bonds, over F_N and strain. Linear
geometry is left out if this error exceeds the tolerance."""
ALONE = ((0.1, 0), (0.02, 1), (0.0, 2))
"""Smallest tolerance, and the level that is run if no errors are measured: 0 the cheapest level, 1
the cheapest level with steps, 2 the cheapest level with steps in the geometry of the last level. A
policy."""


@dataclass(frozen=True, kw_only=True)
class Level(Model):
    """A level of a scene; see `Model` for further attributes.

    Attributes:
        answers: whether the run of the level may be returned. If not, the run only measures errors.
        cannot: reason why the level cannot run; "" if the level can run.
    """

    answers: bool = True
    cannot: str = ""

    __str__ = Model.__str__

    @property
    def model(self) -> Model:
        """The level as a `Model`, without `answers` and `cannot`."""
        return Model.of(self)

    def options(self, asked: Options) -> Options:
        """Return the options of a run at this level."""
        how: dict[str, Any] = {"fidelity": self.engine, "geometry": self.geometry, "verify": None}
        how |= {"method": None, "dt": self.dt or "auto", "accuracy": self.accuracy}
        how |= {"stepper": self.stepper or None, "switching": self.switching or None}
        how["rtol"] = self.rtol
        if self.dt is None:
            return dataclasses.replace(asked, **how, sample=None, energies=None, threshold=None)
        return dataclasses.replace(asked, **how, energies=bool(asked.energies))


def levels(scene: Scene, options: Options, *, begun: bool = False) -> tuple[Level, ...]:
    """Return the levels of a scene, the cheapest first, including levels that cannot run.

    Options that the user gives hold for all runs that may be returned. If the step is given, a run
    with half this step measures errors.

    Args:
        scene: the scene.
        options: options of the run, on this scene.
        begun: whether the run begins at a given state.
    """
    moves, own = _moves(scene, options), options.geometry or default_geometry(scene)
    given = options.dt != "auto"
    found, statics = [], False
    if moves:
        found = [Level(engine="hybrid", geometry=own, cannot=moves)]
    elif options.tolerance >= LOOSE:
        cannot = "it starts from the loaded slider" * begun or _no_statics(scene, options)
        alike = ENGINES["quasistatic"].lacks(dataclasses.replace(options, verify=None)) is None
        found = [Level(engine="quasistatic", geometry="linear", cannot=cannot, answers=alike)]
        statics = not cannot
    linear = own == "finite" and not (moves or statics or given)
    linear = linear and rotation(scene) <= options.tolerance
    geometries: list[Geometry] = ["linear"] * linear + [own] * (2 if given else STEPPED - 1)
    return (*found, *_stepped(scene, options, "dynamic" if moves else "hybrid", geometries))


def of_named(scene: Scene, options: Options) -> tuple[Level, ...]:
    """Return the level of a run whose engine is named, and levels that measure its errors.

    Args:
        scene: the scene.
        options: options of the run, on this scene.
    """
    engine, own = options.fidelity, default_geometry(scene)
    if not ENGINES[engine].steps:
        more = dataclasses.replace(options, fidelity="auto", geometry=own)
        rest = [level for level in levels(scene, more) if level.dt is not None and not level.cannot]
        named = Level(engine=engine, geometry="linear")
        return named, *(dataclasses.replace(level, answers=False) for level in rest[1:])
    dt, switching = options.steps_on(scene)
    asked = dataclasses.replace(
        options, dt=dt, switching=switching, accuracy=options.accuracy or ACCURACY, method=None
    )
    return _stepped(scene, asked, engine, [options.geometry or own, own, own])


def _stepped(
    scene: Scene, options: Options, engine: str, geometries: Sequence[Geometry]
) -> tuple[Level, ...]:
    """Return the levels of an engine with steps, one for each geometry.

    If the step was given, only the first run may be returned.
    """
    stepper, switching = options.stepper_on(scene), options.switching or default_switching(scene)
    given = options.dt != "auto"
    dt = step_size(scene, options.dt, stepper) if given else first_step(scene, options)
    six = stepper == "rk46" and switching == "located" and not given
    shorter = SHORTER if six else HALF
    accuracy, found = options.accuracy or FIRST, []
    for n, geometry in enumerate(geometries):
        answers = not (given and n)
        found.append(
            Level(
                engine=engine,
                geometry=geometry,
                stepper=stepper,
                dt=dt * shorter**n,
                switching=switching,
                accuracy=accuracy if ENGINES[engine].jumps else None,
                rtol=_rtol(options, shorter**n) if STEPPERS[stepper].adaptive else None,
                answers=answers,
            )
        )
        if options.accuracy is None or given or not answers:
            accuracy = max(STRICTER * accuracy, FINEST)
    return tuple(found)


def _rtol(options: Options, shorter: float) -> float:
    """Return the largest error of a sub-step, proportional to the fourth power of the step."""
    return max((options.rtol or RTOL) * shorter**4, 1e-12)


def first_step(scene: Scene, options: Options) -> float:
    """Return the step of the first level with steps, in s.

    The step is shortened to resolve weakening of friction, if a few halvings suffice. All levels
    then resolve weakening. Otherwise friction drops at once at all levels.
    """
    if options.dt != "auto":
        return step_size(scene, options.dt, options.stepper_on(scene))
    stepper, switching = options.stepper_on(scene), options.switching or default_switching(scene)
    limit, _ = stability_limit(scene, stepper)
    share = share_of_limit(stepper, switching, STEP_ERROR)
    return rounded_step(scene, resolving(scene, share * limit))


def rotation(scene: Scene) -> float:
    """Return the order of magnitude of the error of forces in linear geometry, over F_N."""
    return ROTATION * largest_strain(scene, float(np.max(scene.law.mean.mu_k)) * scene.F_N)


def _moves(scene: Scene, options: Options) -> str:
    """Return the reason why a run needs full dynamics; "" if jumps are possible."""
    if options.want == "motion":
        return "motion between events is wanted, which only full dynamics has"
    if options.energies:
        return "the energy budget follows all motion"
    if options.stepper_on(scene) not in ENGINES["hybrid"].steppers:
        return f"its steps are not those of {options.stepper_on(scene)!r}"
    return ENGINES["hybrid"].cannot(scene)


def _no_statics(scene: Scene, options: Options) -> str:
    """Return the reason why a run cannot be a quasi-static sequence; "" if there is none."""
    if options.want == "front_speed":
        return "it has no front speed"
    return ENGINES["quasistatic"].cannot(scene)


def alone(of: tuple[Level, ...], tolerance: float) -> Level:
    """Return the level that is run if no errors are measured; see `ALONE`."""
    able = [level for level in of if level.answers and not level.cannot]
    row = next(number for least, number in ALONE if tolerance >= least)
    stepped = [level for level in able if level.dt is not None]
    if row == 0 or not stepped:
        return able[0]
    own = stepped[-1].geometry
    return stepped[0] if row == 1 else next(level for level in stepped if level.geometry == own)


def as_full(level: Level) -> Level:
    """Return a level with full dynamics as engine."""
    return dataclasses.replace(level, engine="dynamic", accuracy=None)
