"""Options of a run, and the method that follows from them for a scene and an engine.

`Options` holds what a user asks for, independent of the scene. `Options.settled` fills in what was
left open, for one scene. It returns a `Method`, which the record of the run keeps.
"""

from __future__ import annotations

import dataclasses
import math
import os
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypedDict

import numpy as np

from pyfric import core
from pyfric.core import STEPPERS, Switching
from pyfric.engines.cost import POINTS
from pyfric.engines.pauses import longest_pause
from pyfric.record import Method
from pyfric.scene import (
    Annotation,
    Conditions,
    Geometry,
    NotNegative,
    Positive,
    Quantity,
    SceneError,
    annotations,
    check_geometry,
    check_number,
    check_whole,
    condition,
    default_geometry,
    paper_step,
    part,
)
from pyfric.statics import check_rests, check_sticks, stability_limit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Unpack

    from pyfric.engines.dynamic import Run
    from pyfric.scene import Number, Scene, SceneLike, Written

AUTO_SHARE = 0.5
"""dt = "auto" is this share of the stability limit, rounded down to two digits.

In the Fig. 1 scene with switches at step ends, the main precursors up to 0.9 s then keep their
order. Their forces are those of the paper's step, an eighth of the limit, within 8e-4 F_N. The
difference is proportional to the step, and far smaller with located switches."""
RTOL = 1e-6
"""Default of rtol. The error of rupture times of a short front is then 2e-11 s, with located
switching; 1e-3 makes it 7e-9 s for 1.3 times less work."""
ACCURACY = 1e-6
"""Default of accuracy."""
FINEST = 1e-9
"""Smallest accuracy."""
LONGEST_LOCATED = 30.0
"""Longest step of the adaptive stepper with located switching, over the stability limit of RK4."""
MAX_STEPS = 10**12
"""Most steps of one run."""
MAX_THREADS = 4096
"""Most threads that may be asked for."""

Fidelity = Literal["auto", "equilibrium", "quasistatic", "hybrid", "dynamic"]
"""The engine, or "auto" for the cheapest one that is accurate enough."""
Want = Literal["loading_curve", "precursors", "stress", "front_speed", "motion"]
"""The quantity that a run is made for."""
Verify = Literal["none", "sample", "full"]
"""How errors are measured."""
StepperName = Literal["rk4", "rk4_opposite", "verlet", "symplectic_euler", "adaptive"]
"""The name of a stepper."""


@dataclasses.dataclass(frozen=True)
class Step(Quantity):
    """Annotation of a time step, or "auto"."""

    unit: str = "s"
    gt: float | None = 0.0
    note: str = ", or 'auto'"

    def check(self, value: Any, written: Written | None = None) -> Any:
        return value if _is_auto(value) else super().check(value, written)


@dataclasses.dataclass(frozen=True)
class Refused(Annotation):
    """Annotation of an option that no run has; `allowed` says what to give instead."""

    allowed: str = ""

    def check(self, value: Any, written: Written | None = None) -> None:
        if value is not None:
            raise SceneError("", value, "", self.allowed)


class Keywords(TypedDict, total=False):
    """Keyword arguments of `Options`. Numbers may be text with a unit, such as "1 us"."""

    fidelity: Fidelity
    method: Literal["paper"] | None
    want: Want
    tolerance: Number
    verify: Verify | None
    geometry: Geometry | None
    stepper: StepperName
    switching: Switching | None
    rtol: Number | None
    dt: Number
    accuracy: Number | None
    energies: bool | None
    budget: None
    sample: Number | None
    t_gap: Number | None
    stop_when: str | Sequence[str] | None
    threads: int | None
    checkpoint: str | os.PathLike[str] | None
    checkpoint_every: Number


@part
class Options:
    """How a run is made; these are the keyword arguments of `pyfric.simulate`.

    Args:
        fidelity: the engine. "dynamic" integrates everything. "hybrid" integrates events and jumps
            over the time between them. "quasistatic" leaves out inertia. "equilibrium" is the stuck
            slider up to its first slip. "auto" takes the choice of `pyfric.plan` for `want` and
            `tolerance`, among the engines that have all options given below.
        method: "paper" means the method of the paper: RK4 with its uniform step (0.2 us in setup 1,
            0.09 us in setup 2), contacts that switch at step ends, and full dynamics unless
            `fidelity` is "hybrid". None means that the options below decide.
        want: the quantity that the run is made for; see `pyfric.plan`. Refused for an engine that
            is named, unless its errors are measured.
        tolerance: accepted error; see `pyfric.plan`. Refused like `want`.
        verify: how the errors in `Record.errors` are measured. "sample": by a reference run within
            a budget of work, twice that of the run and half a second. "full": by a run in finite
            geometry with a quarter of the step, and a run whose driver is faster by 1e-9 relative.
            "none": not at all. None means "none" for a named engine. For fidelity = "auto", None
            means "sample", and the run is refined if its errors exceed the tolerance.
        geometry: "finite" (as in the paper) or "linear". None leaves the choice to the plan.
            Without a plan None means "finite", or "linear" for a chain and for static engines.
        stepper: "rk4": classical RK4, order 4 (the paper's). "rk4_opposite": order 4, with errors
            opposite to those of "rk4". The limit of short steps lies between both, if steps are not
            too long. "verlet": velocity Verlet with viscous forces at a predicted velocity, order
            2. "symplectic_euler": semi-implicit Euler, order 1. "adaptive": RK4 with an error
            estimate and sub-steps inside dt. The last three need full dynamics.
        switching: "located": a contact switches inside the step, at the root of v_x, mu_s p - |f|
            or u_z of a block, and the step continues from there. A double root within a sub-step is
            found if the parabola through start, middle and end falls below zero. "step_end":
            contacts switch at the end of a step, as in the paper, and are late by up to a step.
            None means "located", or "step_end" with method = "paper" and on junctions. There a late
            break changes the force of a block by 1/n_s of itself, for one step.
        rtol: largest error of a sub-step, for the stepper "adaptive". Errors of displacements are
            over F_N/(N_x s), those of velocities over F_N/(N_x sqrt(s m)), with s the largest of k,
            k_f and k_top. None means 1e-6.
        dt: time step in s, or "auto" (see `step_size`; with a plan, its step).
        accuracy: error over F_N that jumps of the hybrid engine may cause in forces of events. None
            means 1e-6, or with a plan a quarter of the tolerance, at most 1e-3.
        energies: whether to keep the energy budget, as columns of the curve; full dynamics only.
            None means yes for fidelity = "dynamic".
        sample: time between two points of the loading curve, in s; None means 5000 points. Static
            engines, which have points where something changes, refuse it.
        t_gap: longest pause inside an event, in s. None means a value derived from the scene, 1 ms
            in scenes of the paper (`pyfric.engines.pauses`).
        stop_when: one or several conditions. The first that holds ends the run before t_end, at the
            next point of the curve. Examples: "arrested", "at_rest", "reached = 50 mm",
            "L_p = 0.5", "precursors = 3", "main_events = 1", "system_size", "slow = 1 um/s, 1 ms"
            (`pyfric.engines.stopping`). None means the conditions of the scene, () none.
        threads: largest number of threads; None means all. Small lattices use one.
        checkpoint: file to which the run so far is saved as a record every `checkpoint_every` s.
        checkpoint_every: time between two such saves, in s.

    Raises:
        SceneError: a value is refused; the message names it, its unit and what is allowed.
    """

    fidelity: Fidelity = "auto"
    method: Literal["paper"] | None = None
    want: Want = "precursors"
    tolerance: Annotated[float, Positive("", le=1.0)] = 0.01
    verify: Verify | None = None
    geometry: Geometry | None = None
    stepper: StepperName = "rk4"
    switching: Switching | None = None
    rtol: Annotated[float | None, Quantity("", ge=1e-12, le=1.0, optional=True)] = None
    dt: Annotated[float | Literal["auto"], Step()] = "auto"
    accuracy: Annotated[float | None, Quantity("F_N", ge=FINEST, le=1.0, optional=True)] = None
    energies: bool | None = None
    budget: Annotated[None, Refused("None; energies = True keeps the energy budget")] = None
    sample: Annotated[float | None, Positive("s", optional=True)] = None
    t_gap: Annotated[float | None, NotNegative("s", optional=True)] = None
    stop_when: str | tuple[str, ...] | None = None
    threads: int | None = None
    checkpoint: str | os.PathLike[str] | None = None
    checkpoint_every: Annotated[float, Positive("s")] = 60.0

    _section: ClassVar[str] = ""

    if TYPE_CHECKING:  # what may be given; the fields hold numbers in SI units

        def __init__(self, **keywords: Unpack[Keywords]) -> None: ...

    def __post_init__(self) -> None:
        if self.rtol is not None and not STEPPERS[self.stepper].adaptive:
            raise SceneError("rtol", self.rtol, "", "None, or stepper = 'adaptive'")
        if self.method is not None:
            allowed = "none with method = 'paper', which is rk4, step ends and its own dt"
            known = {"stepper": ("rk4",), "switching": (None, "step_end"), "dt": ("auto",)}
            self._check_without(allowed, **known)
        if not isinstance(self.energies, bool | np.bool | None):
            raise SceneError("energies", self.energies, "", "True, False or None")
        if self.stop_when is not None:
            object.__setattr__(self, "stop_when", Conditions().check(self.stop_when))
        if self.threads is not None:
            check_whole("threads", self.threads, 1, MAX_THREADS, note=" or None")
        if not isinstance(self.checkpoint, str | os.PathLike | None):
            raise SceneError("checkpoint", self.checkpoint, "", "a path or None")

    def _check_without(self, allowed: str, **known: tuple[Any, ...]) -> None:
        """Raise SceneError unless each of these options has one of its values."""
        for name, values in known.items():
            value = getattr(self, name)
            if value not in values:
                raise SceneError(name, value, "s" if name in ("dt", "sample") else "", allowed)

    def given(self) -> dict[str, Any]:
        """Return the options that differ from their defaults."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {name: value for name, value in values.items() if value != getattr(Options, name)}

    def on(self, scene: Scene) -> Options:
        """Return the options with the conditions of a scene, unless others were given.

        The paper's method belongs to full dynamics, unless another engine was named.

        Raises:
            SceneError: a condition names a position beyond the interface, or needs thresholds of
                friction, which blocks on junctions do not have.
        """
        ends = scene.stop_when if self.stop_when is None else self.stop_when
        L = scene.slider.L
        for text, (name, values) in ((text, condition(text)) for text in ends):
            if name == "reached" and values[0] > L * (1 + 1e-9):
                reason = "beyond the interface"
                raise SceneError("stop_when", text, "", f"reached = 0 to {L!r} m", reason)
            if name == "at_rest" and not scene.law.rests:
                reason = "blocks on junctions have no threshold that tells when they stay at rest"
                raise SceneError("stop_when", text, "", "such as arrested", reason)
        paper = self.method is not None and self.fidelity == "auto"
        engine = "dynamic" if paper else self.fidelity
        return dataclasses.replace(self, stop_when=ends, fidelity=engine)

    def steps_on(self, scene: Scene) -> tuple[float, Switching]:
        """Return the time step (s), and where contacts switch."""
        dt = self.dt if self.method is None else paper_step(scene)
        if dt is None:
            allowed = "None for loads that are prescribed, which are not the paper's"
            raise SceneError("method", "paper", "", allowed)
        switching = self.switching or default_switching(scene, self.method)
        return step_size(scene, dt, self.stepper), switching

    def check_sample(self, length: float) -> None:
        """Raise SceneError if the sampling interval exceeds the length of the run (s)."""
        if self.sample is not None and 0 < length < self.sample:
            allowed = f"at most {length:g} s, the length of the run"
            raise SceneError("sample", self.sample, "s", allowed, "beyond the end")

    def calls_on(self, scene: Scene) -> int:
        """Return the number of calls of the core that points of the loading curve need."""
        return POINTS if self.stop_when or scene.law.junctions else 0

    def check_static(self) -> None:
        """Raise SceneError unless an engine without inertia can have these options."""
        self._check_without(
            f"nothing, because the {self.fidelity} engine is linear and makes no steps",
            method=(None,),
            geometry=(None, "linear"),
            stepper=("rk4",),
            switching=(None,),
            dt=("auto",),
            energies=(None, False),
            accuracy=(None,),
            sample=(None,),
        )
        if self.fidelity == "equilibrium":
            allowed = "'none', because there is no event whose error could be measured"
            self._check_without(allowed, verify=(None, "none"))

    def settled(self, scene: Scene, engine: type[Run], t_begin: float, t_end: float) -> Method:
        """Return the method of an engine with time steps for a run between two times, in s.

        Raises:
            SceneError: this scene or engine does not allow an option.
        """
        if self.geometry is not None:
            check_geometry(self.geometry, scene)
        if engine.name != "dynamic":
            check_rests(scene)
            check_sticks(scene)
        if self.stepper not in engine.steppers:
            known = " or ".join(map(repr, engine.steppers))
            allowed = f"{known} with fidelity = {engine.name!r}"
            raise SceneError("stepper", self.stepper, "", allowed)
        if self.accuracy is not None and not engine.jumps:
            raise SceneError("accuracy", self.accuracy, "F_N", "None, or fidelity = 'hybrid'")
        if self.energies and not engine.keeps_budget:
            allowed = "False, or fidelity = 'dynamic', which follows all motion"
            raise SceneError("energies", self.energies, "", allowed)
        dt, switching = self.steps_on(scene)
        if switching == "located":
            _check_located(scene, self.stepper, dt)
        check_steps(t_begin, t_end, dt)
        every = (t_end - t_begin) / dt / POINTS if self.sample is None else self.sample / dt
        return Method(
            engine=engine.name,
            geometry=self.geometry or default_geometry(scene),
            stepper=self.stepper,
            switching=switching,
            rtol=(self.rtol or RTOL) if STEPPERS[self.stepper].adaptive else None,
            dt=dt,
            sample=max(1, round(every)),
            t_gap=longest_pause(scene) if self.t_gap is None else self.t_gap,
            threads=core.useful_threads(scene.N_x * scene.N_z, self.threads and int(self.threads)),
            variant=core.VARIANT,
            budget=engine.keeps_budget if self.energies is None else bool(self.energies),
            accuracy=(self.accuracy or ACCURACY) if engine.jumps else None,
        )


def check_steps(t_begin: float, t_end: float, dt: float) -> None:
    """Raise SceneError if a run between two times has too many steps; all in s."""
    if (t_end - t_begin) / dt > MAX_STEPS:
        allowed = f"at most {t_begin + MAX_STEPS * dt:.3g} s, {MAX_STEPS:g} steps of {dt:g} s"
        raise SceneError("t_end", t_end, "s", allowed)


def _is_auto(dt: Any) -> bool:
    """Whether a time step is "auto"; an array is not."""
    return isinstance(dt, str) and dt == "auto"


def kept(method: Method) -> dict[str, Any]:
    """Return the options that a continued run takes over from the method of its record."""
    same: dict[str, Any] = {"geometry": method.geometry, "t_gap": method.t_gap, "method": None}
    if method.dt is not None:
        names = ("stepper", "switching", "rtol", "dt", "accuracy")
        same |= {name: getattr(method, name) for name in names}
        same["energies"] = method.budget
        same["sample"] = method.sample * method.dt
    return same


def check_kept(scene: Scene, method: Method, given: Mapping[str, Any]) -> None:
    """Raise SceneError if an option that was given differs from what a continued run keeps.

    Args:
        scene: the scene.
        method: method of the record that is continued.
        given: names of options to values; None is no choice.
    """
    for name, held in {"fidelity": method.engine, **kept(method)}.items():
        if given.get(name) is None:
            continue
        mark = annotations(Options).get(name, Annotation())
        value = mark.check(given[name])
        if name == "method":
            paper = ("rk4", "step_end", paper_step(scene))
            same = (method.stepper, method.switching, method.dt) == paper
        elif name == "dt":
            same = step_size(scene, value, method.stepper) == held
        elif name == "sample":
            same = max(1, round(value / method.dt)) == method.sample
        else:
            same = value == held or (name, value) == ("fidelity", "auto")
        if not same:
            allowed = "what the record that is continued was made with, or no such option"
            raise SceneError(name, value, mark.unit, allowed, "cannot change")
    for name in ("want", "tolerance", "verify"):
        if given.get(name) not in (None, "none"):
            allowed = "none: a run that goes on keeps its model, and its errors are not measured"
            raise SceneError(name, given[name], "", allowed, "has no effect")


def default_switching(scene: Scene, method: str | None = None) -> Switching:
    """Return the default of the option `switching`; see `Options`."""
    return "located" if method is None and scene.law.rests else "step_end"


def step_size(
    scene: SceneLike, dt: Number | Literal["auto"] = "auto", stepper: str = "rk4"
) -> float:
    """Return the time step in s, checked against the stability limit of the stepper.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        dt: step in s, or "auto" for `AUTO_SHARE` of the limit, rounded down to two digits. For the
            stepper "adaptive", which makes sub-steps inside dt, any dt is allowed, and "auto" uses
            the limit of RK4.
        stepper: the stepper.

    Raises:
        SceneError: dt is not a number, not positive, or above the limit.
    """
    limit, _ = stability_limit(scene, stepper)
    if _is_auto(dt):
        digit = 10.0 ** (math.floor(math.log10(AUTO_SHARE * limit)) - 1)
        return float(f"{math.floor(AUTO_SHARE * limit / digit) * digit:.1e}")
    dt = check_number("dt", dt, "s", gt=0.0, note=", or 'auto'")
    if not STEPPERS[stepper].adaptive and dt > limit:
        allowed = f"0 < dt <= {limit:.4g} s, the stability limit of {stepper} for this scene"
        raise SceneError("dt", dt, "s", allowed, "unstable")
    return dt


def _check_located(scene: Scene, stepper: str, dt: float) -> None:
    """Raise SceneError if switches cannot be located with this stepper or step."""
    if scene.eta == 0 and STEPPERS[stepper].growth is None:
        allowed = (
            f"'step_end', or another stepper than {stepper!r}, or eta > 0: its steps conserve "
            "energy only as long as they are equal, and those that end at a switch are not"
        )
        raise SceneError("switching", "located", "", allowed)
    limit = LONGEST_LOCATED * stability_limit(scene, "rk4")[0]
    if STEPPERS[stepper].adaptive and dt > limit:
        allowed = f"at most {limit:.3g} s with located switching: each step has room for some"
        raise SceneError("dt", dt, "s", allowed, "too long")
