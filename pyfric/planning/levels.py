"""Levels: the models of a scene in the order of their cost.

Each level differs from the one before in everything that the answer hangs on. With h the longest
step that the tolerance allows, and a the accuracy of jumps:

engine        geometry   stepper        step   jumps
-----------   --------   ------------   ----   ------
quasistatic   linear
hybrid        linear     rk4_opposite   h      a
hybrid        finite     rk4            h      a/10
hybrid        finite     rk4_opposite   h/2    a/100
hybrid        finite     rk4            h/4    a/1000

The leading errors of rk4 and rk4_opposite have opposite signs, so that the limit of short steps
lies between both. Where the opposite stepper is unstable, or contacts switch at step ends, the step
is halved instead. In a scene of one geometry the second level has half the step. Without states of
rest the levels are full dynamics with h, h/2 and h/4.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

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
    rounded_step,
    step_size,
)
from pyfric.scene import default_geometry
from pyfric.statics import stability_limit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.engines import Want
    from pyfric.scene import Geometry, Scene

SHARE, LOOSEST = 0.25, 1e-3
"""Accuracy of jumps at the first level, over the tolerance and over F_N at most; the share of the
tolerance for errors of steps, too. Policies."""
STRICTER = 0.1
"""Accuracy of jumps at a level over that at the one before: a policy."""
LONGEST = 0.9
"""Longest step over the stability limit, which is that of the lattice at rest. Forces and switches
leave a tenth."""
STATIC, ROTATION = 0.01, 0.2
"""Errors of forces over F_N without inertia, and without rotation of bonds over the strain: orders
of magnitude. A level whose error exceeds the tolerance is left out."""
HALVED = 2
"""Levels with half the step of the one before: a policy."""
PHASE = 1 / 120
"""Phase error of one RK4 step for a motion of angular frequency omega, over (omega dt)^5."""
ALONE = ((0.1, 0), (0.02, 1), (0.0, 2))
"""Least tolerance -> number of the level that is made where no errors are measured: a policy. The
quasi-static sequence is off by up to 0.04 F_N in the paper's scenes, linear geometry by 0.005."""


@dataclass(frozen=True, kw_only=True)
class Level:
    """A model of a scene, and its numbers.

    Attributes:
        engine, geometry: the engine and its geometry.
        stepper, dt: stepper and step in s; "" and None without steps.
        switching: where contacts switch; None without steps.
        accuracy: accuracy of jumps over F_N; None without jumps.
        rtol: largest error of a sub-step; None for steps of fixed length.
        answers: whether its run may be returned. Otherwise it only measures errors.
        cannot: why it cannot run; "" if it can.
    """

    engine: str
    geometry: Geometry
    stepper: str = ""
    dt: float | None = None
    switching: Any = None
    accuracy: float | None = None
    rtol: float | None = None
    answers: bool = True
    cannot: str = ""

    def __str__(self) -> str:
        words = [f"{self.engine}, {self.geometry} geometry"]
        if self.dt is not None:
            words.append(f"{self.stepper}, dt = {self.dt * 1e6:.3g} us")
        if self.accuracy is not None:
            words.append(f"jumps within {self.accuracy:.1g} F_N")
        return ", ".join(words)

    def options(self, asked: Options) -> Options:
        """Return the options of its run."""
        how: dict[str, Any] = {"fidelity": self.engine, "geometry": self.geometry, "verify": None}
        how |= {"method": None, "dt": self.dt or "auto", "stepper": self.stepper or None}
        for name in ("switching", "accuracy", "rtol"):
            how[name] = getattr(self, name)
        if self.dt is None:
            return dataclasses.replace(asked, **how, sample=None, energies=None, threshold=None)
        return dataclasses.replace(asked, **how, energies=bool(asked.energies))


class Way(NamedTuple):
    """Geometry, stepper and step (s) of a level."""

    geometry: Geometry
    stepper: str
    dt: float


def levels(scene: Scene, options: Options, *, begun: bool = False) -> tuple[Level, ...]:
    """Return the levels of a scene, the cheapest first, with those that cannot run.

    Options that were given hold for all runs that may be returned. If the step is among them, a run
    with half of it measures errors.

    Args:
        scene: the scene.
        options: options of the run, on this scene.
        begun: whether the run begins at a state of motion.
    """
    moves = _moves(scene, options)
    own = options.geometry or default_geometry(scene)
    if moves:
        found = [Level(engine="hybrid", geometry=own, cannot=moves)]
    else:
        cannot = "it starts from the loaded slider" * begun or _no_statics(scene, options)
        alike = ENGINES["quasistatic"].lacks(dataclasses.replace(options, verify=None)) is None
        found = [Level(engine="quasistatic", geometry="linear", cannot=cannot, answers=alike)]
    linear_first = not moves and own == "finite" and rotation(scene) <= options.tolerance
    geometries: list[Geometry] = [*["linear"] * linear_first, *[own] * (1 + HALVED)]
    answers = len(geometries)
    if options.dt != "auto":
        geometries, answers = geometries[: 2 + linear_first], 1 + linear_first
    engine = "dynamic" if moves else "hybrid"
    accuracy = options.accuracy or min(max(SHARE * options.tolerance, FINEST), LOOSEST)
    for n, way in enumerate(_ways(scene, options, geometries)):
        found.append(_of_way(scene, options, engine, way, accuracy, answers=n < answers))
        if options.accuracy is None or n + 1 >= answers:
            accuracy = max(STRICTER * accuracy, FINEST)
    return tuple(found)


def of_named(scene: Scene, options: Options) -> tuple[Level, ...]:
    """Return the level of a run whose engine is named, and those that measure its errors.

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
    asked = dataclasses.replace(options, dt=dt, switching=switching, method=None)
    accuracy, found = options.accuracy or ACCURACY, []
    for n, way in enumerate(_ways(scene, asked, [own] * (1 + HALVED))):
        way = way if n else way._replace(geometry=options.geometry or own)
        found.append(_of_way(scene, asked, engine, way, accuracy, answers=not n))
        accuracy = max(STRICTER * accuracy, FINEST)
    return tuple(found)


def _ways(scene: Scene, options: Options, geometries: Sequence[Geometry]) -> list[Way]:
    """Return geometry, stepper and step of levels.

    Steppers alternate with their opposites, if contacts switch within steps and an eighth of the
    step is stable with the opposite one. A step that is given belongs to the stepper that is given;
    otherwise the second level has that stepper, unless the opposite one needs a far shorter step.
    The step is halved where the geometry is the same, or where steppers do not alternate.
    """
    given, dt = options.dt != "auto", longest_step(scene, options)
    opposite, own = STEPPERS["rk4"].opposite, options.stepper_on(scene)
    if own != "rk4" or (options.switching or default_switching(scene)) != "located":
        opposite = ""
    stable = LONGEST * stability_limit(scene, opposite)[0] if opposite else 0.0
    turns = stable >= dt / 8
    first = (given and geometries[0] == geometries[-1]) or stable < dt / 2
    ways: list[Way] = []
    for n, geometry in enumerate(geometries):
        before, step = ways[-1] if ways else None, dt
        if before and (geometry == before.geometry or not (turns or given)):
            step = before.dt / 2
        if turns and n % 2 == first:
            ways.append(Way(geometry, opposite, min(step, stable)))
        else:
            ways.append(Way(geometry, own, step))
    return ways


def _of_way(
    scene: Scene, options: Options, engine: str, way: Way, accuracy: float, *, answers: bool
) -> Level:
    """Return the level of an engine with steps."""
    rtol, longest = None, longest_step(scene, options)
    if STEPPERS[way.stepper].adaptive:
        rtol = max((options.rtol or RTOL) * (way.dt / longest) ** 4, 1e-12)
    return Level(
        engine=engine,
        geometry=way.geometry,
        stepper=way.stepper,
        dt=way.dt,
        switching=options.switching or default_switching(scene),
        accuracy=accuracy if ENGINES[engine].jumps else None,
        rtol=rtol,
        answers=answers,
    )


def rotation(scene: Scene) -> float:
    """Return the order of magnitude of what linear geometry leaves out, over F_N."""
    return ROTATION * largest_strain(scene, float(np.max(scene.law.mean.mu_k)) * scene.F_N)


def _moves(scene: Scene, options: Options) -> str:
    """Return why only full dynamics can answer, "" if jumps can."""
    if options.want == "motion":
        return "motion between events is wanted, which only full dynamics has"
    if options.energies:
        return "the energy budget follows all motion"
    if options.stepper_on(scene) not in ENGINES["hybrid"].steppers:
        return f"its steps are not those of {options.stepper_on(scene)!r}"
    return ENGINES["hybrid"].cannot(scene)


def _no_statics(scene: Scene, options: Options) -> str:
    """Return why the quasi-static sequence tells nothing of what is wanted, "" if it does."""
    if options.want == "front_speed":
        return "it has no front speed"
    if options.tolerance < STATIC:
        return f"its error is of the order of {STATIC:g} F_N"
    return ENGINES["quasistatic"].cannot(scene)


def longest_step(scene: Scene, options: Options) -> float:
    """Return the step of the first level with steps, in s.

    Its expected error is a share of the tolerance. It resolves weakening of friction if a step of
    the last level can; otherwise friction drops at once at all levels.
    """
    stepper = options.stepper_on(scene)
    auto = step_size(scene, options.dt, stepper)
    error = step_error(scene, options.want, auto)
    if options.dt != "auto" or stepper != "rk4" or error == 0:
        return auto
    dt = auto * (SHARE * options.tolerance / error) ** 0.25
    dt = min(dt, LONGEST * stability_limit(scene)[0])
    if scene.resolving_step >= dt / 2**HALVED:
        dt = min(dt, scene.resolving_step)
    return rounded_step(scene, dt)


def step_error(scene: Scene, want: Want, dt: float) -> float:
    """Return the expected error of RK4 steps with located switching, as the tolerance of a plan.

    A block that starts to slip oscillates with omega^2 = s/m, where s is the stiffness that its
    bonds offer along the interface. In two dimensions s = 2 k + 2 (k/2)/2 = 5 k/2, from two
    horizontal and two diagonal bonds. The oscillation lasts T = 1/(eta omega^2/(2 k)). Its phase
    error is then omega T (omega dt)^4/120. This is the relative error of a front speed. The error
    of F_T is this share of the force drop (mu_s - mu_k) F_N/N_x of one block.

    Args:
        scene: the scene.
        want: the quantity that the run is made for.
        dt: step, in s.
    """
    slider, law = scene.slider, scene.law
    stiff = 2.5 * slider.k
    if scene.N_z == 1:
        stiff = 2 * slider.k + scene.k_top + scene.driver.K
    omega2 = stiff / scene.m
    lasts = 2 * slider.k / (scene.eta * omega2) if scene.eta else 1 / math.sqrt(omega2)
    phase = min(PHASE * lasts * dt**4 * omega2**2.5, 1.0)  # out of phase
    if want == "front_speed":
        return phase
    return phase * max(float(np.max(law.drop)), 1e-6) / scene.N_x


def alone(of: tuple[Level, ...], tolerance: float) -> Level:
    """Return the level that is made where no errors are measured; see `ALONE`."""
    able = [level for level in of if level.answers and not level.cannot]
    row = next(number for least, number in ALONE if tolerance >= least)
    stepped = [level for level in able if level.dt is not None]
    if row == 0 or not stepped:
        return able[0]
    own = stepped[-1].geometry
    return stepped[0] if row == 1 else next(level for level in stepped if level.geometry == own)


def as_full(level: Level) -> Level:
    """Return a level with full dynamics, which makes no jumps."""
    return dataclasses.replace(level, engine="dynamic", accuracy=None)
