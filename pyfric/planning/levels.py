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
import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pyfric.core import STEPPERS
from pyfric.display import html
from pyfric.engines import (
    ACCURACY,
    ENGINES,
    EVENT_STEPS,
    FINEST,
    RTOL,
    Options,
    check_steps,
    coarser,
    default_switching,
    finer_counts,
    full_counts,
    largest_strain,
    located,
    machine_speed,
    set_up,
    step_size,
    work,
)
from pyfric.record import blocks_needed, zone_of_scene
from pyfric.scene import SceneError, check_number, default_geometry
from pyfric.signals import at_once
from pyfric.statics import EquilibriumError, one_thread_if_small, stability_limit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.engines import Want
    from pyfric.record import Record
    from pyfric.scene import Geometry, Number, Scene, SceneLike

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


ROTATION_OF_BONDS = "rotation of bonds"
MOVING = 0.8
"""Front speed over the limiting one, c_R or the speed of sound in a chain, at which plans state the
length of the cohesive zone, too: a definition."""
PILOT = 0.5
"""Largest work of the sequence by which costs are expected, in s: a policy."""


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
        how |= {"method": None, "dt": self.dt or "auto", "stepper": self.stepper or "rk4"}
        for name in ("switching", "accuracy", "rtol"):
            how[name] = getattr(self, name)
        if self.dt is None:
            return dataclasses.replace(asked, **how, sample=None, energies=None)
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
    opposite, own = STEPPERS["rk4"].opposite, options.stepper
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
    if options.stepper not in ENGINES["hybrid"].steppers:
        return f"its steps are not those of {options.stepper!r}"
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
    auto = step_size(scene, options.dt, options.stepper)
    error = step_error(scene, options.want, auto)
    if options.dt != "auto" or options.stepper != "rk4" or error == 0:
        return auto
    dt = auto * (SHARE * options.tolerance / error) ** 0.25
    dt = min(dt, LONGEST * stability_limit(scene)[0])
    if scene.resolving_step >= dt / 2**HALVED:
        dt = min(dt, scene.resolving_step)
    digit = 10.0 ** (math.floor(math.log10(dt)) - 1)
    return float(f"{math.floor(dt / digit) * digit:.1e}")


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


# --- what levels cost ----------------------------------------------------------------------------


def expected_work(scene: Scene, level: Level, lasts: float, before: Record | None) -> float:
    """Return the expected work of a run at a level, in s, from the counts of another run.

    Args:
        scene: the scene.
        level: the level.
        lasts: length of the run, in s.
        before: a run at another level, or None.
    """
    counts = {} if before is None else dict(before.counts)
    first = set_up(scene, level.engine, level.geometry).work
    if level.dt is None:
        return first + work(scene, "linear", counts)
    full = full_counts(scene, level.dt, lasts, level.stepper)
    if counts.get("steps"):
        ratio, stepper = before.method.dt / level.dt, before.method.stepper
        full["block_evaluations"] += located(scene, counts, stepper)
        counts = finer_counts(scene, counts, ratio, stepper, level.stepper)
    else:
        events = int(before.events["is_main"].sum()) if before is not None else 0
        times = EVENT_STEPS * (1 + events) / max(full["steps"], 1.0)
        counts = {name: count * times for name, count in full.items()}
    return first + work(scene, level.geometry, full if level.engine == "dynamic" else counts)


def as_full(level: Level) -> Level:
    """Return a level with full dynamics, which makes no jumps."""
    return dataclasses.replace(level, engine="dynamic", accuracy=None)


def as_made(scene: Scene, level: Level, lasts: float, before: Record | None) -> Level:
    """Return a level with full dynamics if jumps are not expected to spare work.

    The arguments are those of `expected_work`.
    """
    full = as_full(level)
    spares = level.engine != "hybrid" or expected_work(scene, level, lasts, before) < expected_work(
        scene, full, lasts, before
    )
    return level if spares else full


def left_out(scene: Scene, level: Level) -> str:
    """Return what a level leaves out, in words."""
    words = [word for word in ENGINES[level.engine].leaves_out if word != ROTATION_OF_BONDS]
    if level.geometry != default_geometry(scene):
        words.append(ROTATION_OF_BONDS)
    return "; ".join(words) or "nothing"


def work_done(record: Record) -> float:
    """Return the work of a run, in s."""
    scene, method = record.scene, record.method
    first = set_up(scene, method.engine, method.geometry).work
    return first + work(scene, method.geometry, record.counts)


@functools.lru_cache(maxsize=16)
def pilot(scene: Scene, t_end: float, stop_when: tuple[str, ...] = ()) -> Record | None:
    """Return the quasi-static sequence of a scene to t_end (s), or None where there is none.

    A scene of many blocks has larger ones.
    """
    small = coarser(scene)
    small = dataclasses.replace(small, interface=small.interface.coulomb())

    def enough(run: Any) -> bool:
        return work(small, "linear", run.counts) > PILOT

    if ENGINES["hybrid"].cannot(scene) or ENGINES["quasistatic"].cannot(small):
        return None
    options = Options(stop_when=stop_when)
    try:
        return ENGINES["quasistatic"].follow(
            small, t_end, options, initial=None, progress=False, enough=enough
        )
    except EquilibriumError:
        return None


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The levels of a scene, and what they are expected to cost.

    Attributes:
        want: the quantity that the run is made for.
        tolerance: accepted error, over F_N (relative error for front speeds).
        levels: the levels, the cheapest first, with those that cannot run.
        left_out: what each of them leaves out.
        seconds: expected time of each on one core of this machine, in s.
        alone: the level that is made where no errors are measured.
        t_end: time at which the run is expected to end, in s.
        lattice: for front speeds, the lattice constant that the tolerance needs, and the time of a
            run with it; "" if the present one suffices, and for other quantities.
    """

    want: Want
    tolerance: float
    levels: tuple[Level, ...]
    left_out: tuple[str, ...]
    seconds: tuple[float, ...]
    alone: Level
    t_end: float
    lattice: str = ""

    def __str__(self) -> str:
        lines = [
            f"for {self.want} within {self.tolerance:g}, to about {self.t_end:.3g} s: levels are "
            "made until two that follow each other agree; the finer one is the answer"
        ]
        rows = zip(self.levels, self.left_out, self.seconds, strict=True)
        for number, (level, left_out, seconds) in enumerate(rows, 1):
            if level.cannot:
                lines.append(f"-  {level.engine}: left out ({level.cannot})")
                continue
            role = "" if level.answers else " (measures errors alone)"
            lines.append(f"{number}  {level}: about {seconds:.2g} s{role}")
            lines.append(f"   models {ENGINES[level.engine].models}; leaves out {left_out}")
        lines.append(f"without errors (verify = 'none'): {self.alone}")
        return "\n".join([*lines, *([f"lattice: {self.lattice}"] if self.lattice else ())])

    __repr__ = __str__

    _repr_html_ = html


@at_once()
@one_thread_if_small
def plan(
    scene: SceneLike,
    want: Want = "precursors",
    tolerance: float = 0.01,
    *,
    t_end: Number = 1.0,
    stop_when: str | Sequence[str] | None = None,
) -> Plan:
    """Return the levels that `simulate` makes for a quantity and a tolerance, and their cost.

    A quasi-static sequence tells how many events there are, and when a condition ends the run.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        want: "loading_curve", "precursors", "stress", "front_speed" or "motion".
        tolerance: accepted error over F_N; relative error for front speeds.
        t_end: time of the end of the run, in s.
        stop_when: conditions that end the run before t_end; None means those of the scene; see
            `Options`.

    Raises:
        SceneError: an argument is refused.
        EquilibriumError: the scene has no loaded state.

    Source: `pyfric.planning.levels`.
    """
    options = Options(want=want, tolerance=tolerance, stop_when=stop_when).on(scene)
    t_end = check_number("t_end", t_end, "s", ge=0.0)
    found = levels(scene, options)
    for level in found:
        if level.dt is not None and not level.cannot:
            check_steps(0.0, t_end, level.dt)
    first = pilot(scene, t_end, options.stop_when)
    if first is not None and first.done:
        t_end = min(t_end, float(first.curve["t"].iloc[-1]))
    found = tuple(as_made(scene, level, t_end, first) for level in found)
    speed = machine_speed()
    seconds = [speed * expected_work(scene, level, t_end, first) for level in found]
    single = alone(found, tolerance)
    return Plan(
        want=want,
        tolerance=tolerance,
        levels=found,
        left_out=tuple(left_out(scene, level) for level in found),
        seconds=tuple(seconds),
        alone=single,
        t_end=t_end,
        lattice=_lattice(scene, options, seconds[found.index(single)]),
    )


def _lattice(scene: Scene, options: Options, seconds: float) -> str:
    """Return the lattice constant that front speeds need, and the time of a run, if it is smaller.

    Half the lattice constant takes 8 times as long: 4 times the blocks, twice the steps.
    """
    if options.want != "front_speed" or not scene.law.rests:
        return ""
    blocks, moving = zone_of_scene(scene), zone_of_scene(scene, MOVING)
    little, need = blocks_needed(scene, options.tolerance)
    if not blocks < need:
        return ""
    text = f"X_c0/l = {blocks:.2g} ({moving:.2g} at {MOVING:g} of the limiting speed), and "
    text += f"front speeds within {options.tolerance:g} need {need:.2g}"
    if need > little:
        eta = scene.eta / math.sqrt(scene.slider.k * scene.m)
        text += f" with eta = {eta:.2g} sqrt(k m), {little:.2g} with little viscosity"
    if blocks == 0:
        return f"{text}: no l resolves a front whose friction does not weaken over a length d_c"
    times = math.ceil(need / blocks)
    seconds *= times ** (2 if scene.N_z == 1 else 3)
    l = scene.slider.l / times * 1e3
    return f"{text}: l = {l:.3g} mm, {times} times smaller, about {seconds:.2g} s"


def expected_cost(scene: Scene, t_end: float, options: Options) -> tuple[float, float]:
    """Return the expected time of a run to t_end (s) in s, and the size of its record in bytes.

    A planned run is expected to make all levels up to that of its tolerance, at least two. A run
    that would be refused costs nothing.
    """
    options = options.on(scene)
    try:
        check_steps(0.0, t_end, longest_step(scene, options))
    except SceneError:
        return 0.0, 0.0
    first = pilot(scene, t_end, options.stop_when)
    if first is not None and first.done:
        t_end = min(t_end, float(first.curve["t"].iloc[-1]))
    if options.fidelity == "auto":
        found = [level for level in levels(scene, options) if not level.cannot]
        single = alone(found, options.tolerance)
        last = max(found.index(single), 1)
        found = [single] if options.verify == "none" else found[: last + 1]
    else:
        found = [*of_named(scene, options)][: 1 if options.verify in (None, "none") else 2]
    made = sum(expected_work(scene, level, t_end, first) for level in found)
    events = 0 if first is None else len(first.events)
    return made * machine_speed(), 1e5 + 8.0 * events * (9 * scene.N_x + 40)
