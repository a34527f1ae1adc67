"""Options of a run, and the method that follows from them for a scene and an engine.

`Options` holds the choices of a user, independent of the scene. `Engine.settled` adds the defaults
for one scene. It returns the `Method` that is stored in the record.
"""

from __future__ import annotations

import dataclasses
import functools
import os
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypedDict

from pyfric.core import STEPPERS, Switching
from pyfric.engines.cost import POINTS
from pyfric.engines.declared import (
    Budget,
    Count,
    Ends,
    EngineName,
    FilePath,
    Option,
    Owner,
    Step,
    YesNo,
    documented,
    option,
)
from pyfric.engines.step_sizes import (
    ACCURACY,
    default_stepper,
    default_switching,
    step_size,
)
from pyfric.record import Method
from pyfric.scene import SETTABLE, Geometry, condition, paper_step
from pyfric.values import Annotation, NotNegative, Positive, Quantity, SceneError, annotations, part

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Unpack

    from pyfric.scene import Number, Scene

RTOL = 1e-6
"""Default of the option `rtol`. With located switching, rupture times of a short front have an
error of 2e-11 s. With rtol = 1e-3 the error is 7e-9 s, and the work is less by a factor of 1.3."""
FINEST = 1e-9
"""Smallest value of the option `accuracy`."""
MAX_THREADS = 4096
"""Largest allowed number of threads."""

Fidelity = Literal["auto", "equilibrium", "quasistatic", "hybrid", "dynamic"]
"""The engine, or "auto" for the engine with the least work that is accurate enough."""
Want = Literal["loading_curve", "precursors", "stress", "front_speed", "motion"]
"""The quantity whose error a run limits."""
Verify = Literal["none", "sample", "full", "shared"]
"""Method by which the errors of a run are measured."""
StepperName = Literal["rk4", "rk46", "rk46_waves", "verlet", "symplectic_euler", "adaptive", "imex"]
"""The name of a stepper."""


class Keywords(TypedDict, total=False):
    """Keyword arguments of `Options`. Numbers may be text with a unit, such as "1 us"."""

    fidelity: Fidelity
    method: Literal["paper"] | None
    want: Want
    tolerance: Number
    verify: Verify | None
    budget: Number | None
    geometry: Geometry | None
    stepper: StepperName | None
    switching: Switching | None
    rtol: Number | None
    dt: Number
    accuracy: Number | None
    energies: bool | None
    sample: Number | None
    t_gap: Number | None
    threshold: Number | None
    stop_when: str | Sequence[str] | None
    threads: int | None
    checkpoint: str | os.PathLike[str] | None
    checkpoint_every: Number


METHOD_PAPER = {"stepper": (None, "rk4"), "switching": (None, "step_end"), "dt": ("auto",)}
"""Options -> values that are allowed with method = "paper"."""


@part
class Options:
    """Options of a run, which are the keyword arguments of `pyfric.simulate`."""

    fidelity: Annotated[Fidelity, EngineName()] = option(
        "auto",
        "plan",
        """the engine, or "auto" for the cheapest one that meets the tolerance. "dynamic" integrates
        everything. "hybrid" integrates events and jumps over the time between them. "quasistatic"
        leaves out inertia. "equilibrium" is the stuck slider up to its first slip. "auto" makes
        the levels of `pyfric.plan` for `want` and `tolerance`. Options given below hold for the run
        that is returned.""",
    )
    method: Literal["paper"] | None = option(
        None,
        "steps",
        """"paper" for RK4 with steps of 0.2 us (setup 2: 0.09 us), contacts that switch at step
        ends, and full dynamics unless `fidelity` is "hybrid". None means that the options below
        decide.""",
        kept=lambda method: None,
    )
    want: Want = option(
        "precursors",
        "plan",
        """the quantity that the run is made for. See `pyfric.plan`. Refused for an engine that is
        named, unless its errors are measured.""",
    )
    tolerance: Annotated[float, Positive("", le=1.0)] = option(
        0.01,
        "plan",
        """accepted error over F_N, relative for front speeds. See `pyfric.plan`. Refused like
        `want`.""",
    )
    verify: Verify | None = option(
        None,
        "events",
        """how errors are measured, which `Record.errors` holds. "sample": the run is made at levels
        (`pyfric.plan`) until two that follow each other agree within the tolerance, and the finer
        one is returned. A run whose engine is named is returned as it is, and compared with one of
        half the step in finite geometry. "full": a level more, and a run whose driver is faster by
        1e-9 relative. "shared": at some of many runs, which choose the level of all
        (`pyfric.Shared`). A single run refuses it. "none": not at all.""",
        unless='"none" for a named engine, "sample" for fidelity = "auto", in sweeps "shared"',
        nothing="none",
    )
    budget: Annotated[float | str | None, Budget()] = option(
        None,
        "plan",
        """largest processor time of a run with its verification, in s, or a multiple of that of the
        run alone, such as "3 x". A level that is expected to exceed it is not made, and the record
        says so. The first two levels are made whatever they take.""",
        unless='"4 x"',
    )
    geometry: Geometry | None = option(
        None,
        "run",
        """bonds rotate ("finite", as in the paper) or do not ("linear"). A plan chooses, if it is
        left open.""",
        unless='"finite", or "linear" for a chain and for static engines',
        kept=lambda method: method.geometry,
    )
    stepper: StepperName | None = option(
        None,
        "steps",
        """the stepper. "rk46": six stages, order 4, and 6 in linear motion. "rk46_waves": the same
        form, for waves with little damping. "rk4": classical RK4, order 4 (the paper's). "verlet":
        velocity Verlet with viscous forces at a predicted velocity, order 2. "symplectic_euler":
        semi-implicit Euler, order 1. "adaptive": RK4 with an error estimate and sub-steps inside
        dt. These three need full dynamics. "imex": implicit in rate-and-state friction, which needs
        it, order 3.""",
        unless='"rk46", "rk46_waves" where waves are damped too little for it, "rk4" with contacts '
        'that switch at step ends, and "imex" with rate-and-state friction',
        kept=lambda method: method.stepper or None,
    )
    switching: Switching | None = option(
        None,
        "steps",
        """contacts switch at the end of a step ("step_end", as in the paper) or inside it
        ("located"). "located": at the root of v_x, mu_s p - |f| or u_z of a block, and the step
        continues from there. A double root within a sub-step is found if the parabola through
        start, middle and end falls below zero. "step_end": late by up to a step. On junctions
        this changes single events, because the order in which junctions break decides where
        ruptures stop. Where they break one by one, "located" takes many times as long.""",
        unless='"located", or "step_end" with method = "paper", where junctions differ in stretch '
        "or slip time, and with rate-and-state friction",
        kept=lambda method: method.switching or None,
    )
    rtol: Annotated[float | None, Quantity("", ge=1e-12, le=1.0, optional=True)] = option(
        None,
        "steps",
        """largest error of a sub-step of the stepper "adaptive". Errors of displacements are over
        F_N/(N_x s), those of velocities over F_N/(N_x sqrt(s m)), with s the largest of k, k_f and
        k_top.""",
        unless="1e-6",
        kept=lambda method: method.rtol,
    )
    dt: Annotated[float | Literal["auto"], Step()] = option(
        "auto",
        "steps",
        """time step in s, or "auto" for the longest that keeps `accuracy`. See `step_size`; with a
        plan, its step.""",
        kept=lambda method: method.dt,
    )
    accuracy: Annotated[float | None, Quantity("F_N", ge=FINEST, le=1.0, optional=True)] = option(
        None,
        "steps",
        """error over F_N that time steps, and jumps of the hybrid engine, may cause in forces of
        events. It sets dt = "auto" of the steppers "rk46" and "rk46_waves", from errors measured in
        other scenes; `verify` measures those of a run.""",
        unless="1e-5, or that of the level (`pyfric.plan`)",
        kept=lambda method: method.accuracy,
    )
    energies: Annotated[bool | None, YesNo()] = option(
        None,
        "energies",
        """whether to keep the energy budget, as columns of the curve. In hybrid runs they are NaN
        inside jumps, and no jump is made over slip.""",
        unless='yes for fidelity = "dynamic"',
        nothing=False,
        kept=lambda method: method.budget,
    )
    sample: Annotated[float | None, Positive("s", optional=True)] = option(
        None,
        "steps",
        """time between two points of the loading curve, in s. Static engines have points where
        something changes.""",
        unless="5000 points",
        kept=lambda method: method.dt and method.sample * method.dt,
    )
    t_gap: Annotated[float | None, NotNegative("s", optional=True)] = option(
        None,
        "run",
        """longest pause inside an event, in s. See `pyfric.engines.pauses`.""",
        unless="a value derived from the scene, 1 ms in both setups of the paper",
        kept=lambda method: method.t_gap,
    )
    threshold: Annotated[float | None, Positive("m/s", optional=True)] = option(
        None,
        "steps",
        """slip rate above which a block makes events, in m/s, such as "1 mm/s". It is looked at in
        every step, and the motion of the interface is kept at the points of the curve.
        See `pyfric.record.rates`.""",
        unless="that blocks which slip make events, or are faster than v_slip of their law",
        kept=lambda method: method.threshold,
    )
    stop_when: Annotated[str | tuple[str, ...] | None, Ends()] = option(
        None,
        "run",
        """one or several conditions (on the command line one each), of which the first that holds
        ends the run before t_end: "arrested", "at_rest", "reached = 50 mm", "L_p = 0.5",
        "precursors = 3", "main_events = 1", "system_size", "slow = 1 um/s, 1 ms". It ends at the
        next point of the curve (`pyfric.engines.stopping`). () means none.""",
        unless="the conditions of the scene",
    )
    threads: Annotated[int | None, Count(MAX_THREADS)] = option(
        None,
        "machine",
        """largest number of threads. Small lattices use one.""",
        unless="as many as make the run faster",
    )
    checkpoint: Annotated[str | os.PathLike[str] | None, FilePath()] = option(
        None,
        "machine",
        """file to which the run so far is saved as a record every `checkpoint_every` s.""",
    )
    checkpoint_every: Annotated[float, Positive("s")] = option(
        60.0, "machine", "time between two such saves, in s."
    )

    _section: ClassVar[str] = ""
    _elsewhere: ClassVar[dict[str, str]] = dict.fromkeys(
        SETTABLE, 'a field of the scene, as in scene.replace(F_N="2 kN")'
    )

    if TYPE_CHECKING:  # types of arguments; the fields hold numbers in SI units

        def __init__(self, **keywords: Unpack[Keywords]) -> None: ...

    def __post_init__(self) -> None:
        if self.rtol is not None and self.stepper != "adaptive":
            raise SceneError("rtol", self.rtol, "", "None, or stepper = 'adaptive'")
        if self.method is not None:
            allowed = "none with method = 'paper', which is rk4, step ends and its own dt"
            for name, values in METHOD_PAPER.items():
                if (value := getattr(self, name)) not in values:
                    raise SceneError(name, value, "s" if name == "dt" else "", allowed)

    @staticmethod
    @functools.cache
    def declared() -> dict[str, Option]:
        """Return the declarations of all options, with the annotations of their values."""
        marks = annotations(Options)
        return {
            field.name: dataclasses.replace(
                field.metadata["option"], mark=marks.get(field.name, Annotation())
            )
            for field in dataclasses.fields(Options)
        }

    def given(self) -> dict[str, Any]:
        """Return the options that differ from their defaults."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return {name: value for name, value in values.items() if value != getattr(Options, name)}

    def on(self, scene: Scene) -> Options:
        """Return the options, with the end conditions of a scene if none were given.

        With the paper's method, the default engine is full dynamics.

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
                reason = "under this law no threshold tells when blocks stay at rest"
                raise SceneError("stop_when", text, "", "such as arrested", reason)
        paper = self.method is not None and self.fidelity == "auto"
        engine = "dynamic" if paper else self.fidelity
        return dataclasses.replace(self, stop_when=ends, fidelity=engine)

    def steps_on(self, scene: Scene) -> tuple[float, Switching]:
        """Return the time step (s), and the value of `switching`, for a scene."""
        dt = self.dt if self.method is None else paper_step(scene)
        if dt is None:
            allowed = "None for loads that are prescribed, which are not the paper's"
            raise SceneError("method", "paper", "", allowed)
        switching = self.switching or default_switching(scene, self.method)
        accuracy = self.accuracy or ACCURACY
        return step_size(scene, dt, self.stepper_on(scene), accuracy, switching), switching

    def stepper_on(self, scene: Scene) -> StepperName:
        """Return the stepper for a scene.

        Raises:
            SceneError: the stepper does not fit the law. Rate-and-state friction needs an implicit
                stepper, other laws an explicit one.
        """
        switching = self.switching or default_switching(scene, self.method)
        stepper = self.stepper or default_stepper(scene, switching)
        if STEPPERS[stepper].implicit is not (flows := scene.law.flows):
            allowed = "'imex'" if flows else "another one"
            law = scene.interface.law.kind
            raise SceneError("stepper", stepper, "", f"{allowed} with this law", f"law = {law!r}")
        return stepper

    def check_sample(self, length: float) -> None:
        """Raise SceneError if the sampling interval exceeds the length of the run (s)."""
        if self.sample is not None and 0 < length < self.sample:
            allowed = f"at most {length:g} s, the length of the run"
            raise SceneError("sample", self.sample, "s", allowed, "beyond the end")

    def calls_on(self, scene: Scene) -> int:
        """Return the number of calls of the core that points of the loading curve need."""
        return POINTS if self.stop_when or self.threshold or scene.law.junctions else 0


Options.__doc__ = documented(
    Options.__doc__ or "",
    Options.declared(),
    "    Raises:\n        SceneError: a value is refused; its message says what is allowed.",
)


def owned(*owners: Owner) -> frozenset[str]:
    """Return the names of the options that belong to one of these owners."""
    declared = Options.declared()
    return frozenset(name for name in declared if declared[name].owner in owners)


def kept(method: Method) -> dict[str, Any]:
    """Return the options that a continued run takes over from the method of its record."""
    kept = {name: known for name, known in Options.declared().items() if known.kept is not None}
    values = {name: known.kept(method) for name, known in kept.items()}
    return {n: value for n, value in values.items() if value is not None or kept[n].default is None}


def check_kept(scene: Scene, method: Method, given: Mapping[str, Any]) -> None:
    """Raise SceneError if a given option differs from the method of the record to continue.

    Args:
        scene: the scene.
        method: method of the record that is continued.
        given: values of options by name; None means not given.
    """
    for name, held in {"fidelity": method.engine, **kept(method)}.items():
        if given.get(name) is None:
            continue
        mark = Options.declared()[name].mark
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
    for name in sorted(owned("plan", "events") - {"fidelity"}):
        if given.get(name) not in (None, "none"):
            allowed = "none: a run that goes on keeps its model, and its errors are not measured"
            raise SceneError(name, given[name], "", allowed, "has no effect")
