"""Choice of the model: the cheapest one whose expected error is within the tolerance.

Full dynamics in finite geometry is the reference. The cheaper models leave something out:

engine        geometry   left out
-----------   --------   -------------------------------------------
quasistatic   linear     inertia, rotation of bonds
hybrid        linear     rotation of bonds, the end of each ring-down
hybrid        finite     the end of each ring-down
dynamic       finite     nothing

- Full dynamics is chosen if it is cheap, or if no other engine is chosen.
- The quasi-static engine is chosen if its assumptions hold.
- Linear geometry is chosen if two static states show that its error is small.
- The hybrid engine is chosen if a pilot run shows that it saves at least half of the work.

The step follows from the tolerance and the error of RK4. It resolves weakening of friction, too, if
steps of reference runs can. The accuracy of jumps is a share of the tolerance. The choice rests on
expected errors; `pyfric.planning.verification` measures them.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.core import OPEN
from pyfric.display import html
from pyfric.engines import (
    ENGINES,
    FINEST,
    RUN,
    Fidelity,
    Options,
    Want,
    check_steps,
    default_switching,
    full_counts,
    located,
    machine_speed,
    relaxation_time,
    step_size,
    work,
)
from pyfric.planning.pilot import (
    counted,
    drop,
    expected_end,
    interval,
    linear_error,
    pilot_run,
    quasistatic_work,
    transitions,
)
from pyfric.planning.price import CHEAP, RATIOS, price
from pyfric.planning.verification import LOOSEST
from pyfric.record import blocks_needed, zone_of_scene
from pyfric.scene import Geometry, check_number, default_geometry
from pyfric.signals import at_once
from pyfric.statics import NO_RESTS, beyond_ladder, one_thread_if_small, stability_limit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pyfric.core import Switching
    from pyfric.planning.pilot import Pilot
    from pyfric.record import Record
    from pyfric.scene import Number, Scene, SceneLike

ERROR_QUASISTATIC = 0.05
"""Largest difference of start forces between the quasi-static engine and dynamics, over F_N. Events
are compared one by one, up to the first system-size event, in the paper's scenes
(`reference_data/`)."""
RING_SHARE = 0.25
"""Longest relaxation time for the quasi-static engine, over the time between main events."""
OPEN_BLOCKS = 2
"""Most blocks open at a time for the quasi-static engine. Beyond it there is a gap, and small
differences decide the order of events."""
SHARE = 0.25
"""Share of the tolerance for each of the errors of geometry, jumps and steps."""
SPARES = 0.5
"""Largest work of the hybrid engine, over that of full dynamics, for which it is chosen."""
LONGEST = 0.9
"""Longest step of a plan over the stability limit. Forces and switches leave a tenth: the limit is
that of the lattice at rest."""
PHASE = 1 / 120
"""Phase error of one RK4 step for a motion of angular frequency omega, over (omega dt)^5."""
MOVING = 0.8
"""Front speed over the limiting one, c_R or the speed of sound in a chain, at which plans state the
length of the cohesive zone, too."""
STEPS = {"dt", "switching", "accuracy", "sample"}
"""Options that the quasi-static engine does not have."""
OVERDAMPED = math.sqrt(3) / 4
"""eta/sqrt(k m) below which a block oscillates: 8 eta < 2 sqrt(3 k m), from its eight bonds."""


class Assumption(NamedTuple):
    """An assumption of a chosen model. It holds if `value` is at most `limit`."""

    name: str
    value: float
    limit: float
    meaning: str

    @property
    def holds(self) -> bool:
        return self.value <= self.limit

    def __str__(self) -> str:
        sign = "<=" if self.holds else ">"
        return f"{self.name}: {self.value:.3g} {sign} {self.limit:.3g} ({self.meaning})"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The chosen model, and the reasons for the choice.

    Attributes:
        want: the quantity that the run is made for.
        tolerance: accepted error, over F_N (relative error for front speeds).
        fidelity, geometry: the engine and its geometry.
        switching, dt: where contacts switch; time step in s; None for the quasi-static engine.
        accuracy: accuracy of jumps, over F_N; None if the engine makes no jumps.
        assumptions: assumptions of the chosen model; all of them hold.
        reasons: why cheaper models were rejected.
        error: expected error, in the unit of the tolerance.
        work: expected work of the run, in s on the reference machine of `pyfric.engines.cost`.
        seconds: expected time of the run, in s on one core of this machine, without verification.
        price: expected time of verification, in s on this machine.
        refinement: time that is added if the run has to be refined, likewise.
        lattice: for front speeds, the lattice constant that the tolerance needs, and the time of a
            run with it; "" if the present one suffices, and for other quantities.
    """

    want: Want
    tolerance: float
    fidelity: Fidelity
    geometry: Geometry
    switching: Switching | None = None
    dt: float | None = None
    accuracy: float | None = None
    assumptions: tuple[Assumption, ...] = ()
    reasons: tuple[str, ...] = ()
    error: float
    work: float
    seconds: float
    price: float
    refinement: float
    lattice: str = ""

    def __str__(self) -> str:
        step = ""
        if self.dt is not None:
            step = f", dt = {self.dt * 1e6:.3g} us, {self.switching} switching"
        engine = ENGINES[self.fidelity]
        left_out = [*engine.leaves_out]
        if any(assumption.name == LINEAR for assumption in self.assumptions):
            left_out.append("rotation of bonds")
        lines = [
            f"for {self.want} within {self.tolerance:g}: {self.fidelity}, {self.geometry} geometry"
            + step,
            f"modelled: {engine.models}",
            f"left out: {'; '.join(left_out) or 'nothing'}",
            *(f"because {assumption}" for assumption in self.assumptions),
            *(f"rejected: {reason}" for reason in self.reasons),
            f"expected error: {self.error:.2g}",
            f"expected time: about {self.seconds:.2g} s",
            f"verification: about {self.price:.2g} s more"
            + f", and {self.refinement:.2g} s if the run has to be refined" * (self.refinement > 0),
            *([f"lattice: {self.lattice}"] if self.lattice else ()),
        ]
        return "\n".join(lines)

    __repr__ = __str__

    _repr_html_ = html

    def check(self, record: Record) -> list[Assumption]:
        """Return the assumptions that the record of a run contradicts."""
        if self.fidelity != "quasistatic":
            return []
        return [need for need in _needs(record.scene, record) if not need.holds]


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
    """Return the engine, geometry and step that suffice for a quantity and a tolerance.

    Operations are counted in pilot runs. Full dynamics that takes less than half a second is made
    once as a whole, because most transitions occur in its last events.

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

    Source: the rules of `pyfric.planning.choice`.
    """
    options = Options(want=want, tolerance=tolerance, stop_when=stop_when)
    return choose(scene, options, check_number("t_end", t_end, "s", ge=0.0), priced=True)


def choose(
    scene: Scene,
    options: Options,
    t_end: float,
    *,
    t_begin: float = 0.0,
    ladder: bool = True,
    priced: bool = False,
) -> Plan:
    """Return the plan that respects all options that were given.

    Args:
        scene: the scene.
        options: options; the plan fills in those left at None or "auto".
        t_end, t_begin: times of the end and the beginning of the run, in s.
        ladder: whether the quasi-static engine may be chosen.
        priced: whether full dynamics is made once, where it is cheap, to count its transitions.

    Raises:
        SceneError: a run with steps would have too many.
    """
    choice = _Choice(scene, options, (t_begin, t_end), ladder, priced)
    return choice.on_lattice(choice.model())


class _Choice:
    """The choice of a model for one scene and one set of options."""

    def __init__(
        self, scene: Scene, options: Options, ends: tuple[float, float], ladder: bool, priced: bool
    ) -> None:
        self.scene, self.options, self.t_end = scene, options.on(scene), ends[1] - ends[0]
        self.want, self.tolerance = options.want, options.tolerance
        self.reasons: list[str] = []
        self.ladder, self.priced = ladder, priced
        self.stepped = bool(options.energies) or options.stepper != "rk4"
        self.geometry: Geometry = options.geometry or default_geometry(scene)
        self.located = 0.0  # block evaluations for transitions, once a pilot run counts them
        self.dt, self.error = self._step()
        self._check_steps = functools.partial(check_steps, *ends, self.dt)
        if not ladder or self.want == "front_speed" or self.tolerance < ERROR_QUASISTATIC:
            self._check_steps()  # before pilot runs, because no static engine will be chosen
        if self._full_work() > CHEAP:
            self.t_end = expected_end(scene, self.t_end, self.options.stop_when)

    def model(self) -> Plan:
        """Return the plan with the cheapest engine that answers what is wanted."""
        scene, full = self.scene, self._full_work()
        if scene.prescribed and scene.N_z > 1:
            return self._full("a prescribed interface in two dimensions has no static states")
        if not scene.law.rests:
            self.reasons.append(f"quasi-static ({NO_RESTS})")
            return self._full(NO_RESTS)
        if not scene.has_rests:
            return self._full("scenes with a push, or without a driver, need full dynamics")
        if self.want == "motion":
            return self._full("motion between events is wanted, which only full dynamics has")
        if self.stepped:
            return self._full("plans have these options with full dynamics only")
        if full <= CHEAP:
            return self._full(f"full dynamics takes about {full * machine_speed():.2g} s")
        pilot = pilot_run(scene, self.t_end)
        if self.ladder and (found := self._ladder(pilot)) is not None:
            return found
        self._check_steps()
        needs = self._linear(pilot)
        return self._hybrid(pilot, needs)

    def _full_counts(self) -> dict[str, float]:
        """Return the operations of full dynamics."""
        how = self.options.stepper, self.options.calls_on(self.scene)
        counts = full_counts(self.scene, self.dt, self.t_end, *how)
        return counts | {"block_evaluations": counts["block_evaluations"] + self.located}

    def _full_work(self) -> float:
        return RUN + work(self.scene, self.geometry, self._full_counts())

    def _made(self, counts: dict[str, float] | None = None, **what: object) -> Plan:
        """Return the plan; `counts` are the operations of a run with time steps."""
        made = what["fidelity"], what["geometry"], self.dt, self.t_end, what["work"], counts
        cost = price(self.scene, self.options, *made)
        return Plan(
            want=self.want,
            tolerance=self.tolerance,
            reasons=tuple(self.reasons),
            seconds=what["work"] * machine_speed(),
            price=cost[0] * machine_speed(),
            refinement=cost[1] * machine_speed(),
            **what,
        )

    def _full(self, reason: str, needs: tuple[Assumption, ...] = ()) -> Plan:
        """Return the plan of full dynamics."""
        self._check_steps()
        self.reasons.append(f"hybrid ({reason})")
        switching = self.options.switching or default_switching(self.scene)
        made = {"geometry": self.geometry, "switching": switching, "dt": self.dt}
        if self.priced and self._full_work() <= CHEAP:
            options = dataclasses.replace(self.options, **made)
            self.located, self.t_end = transitions(self.scene, self.t_end, options)
        return self._made(
            self._full_counts(),
            fidelity="dynamic",
            **made,
            assumptions=(*needs, self._resolution()),
            error=self.error,
            work=self._full_work(),
        )

    def _ladder(self, pilot: Pilot) -> Plan | None:
        """Return the plan of the quasi-static engine, or None if it is rejected."""
        scene, options = self.scene, self.options
        record, needs, error, reason = pilot.record, (), ERROR_QUASISTATIC, ""
        if record is not None:
            needs, error = _needs(scene, record), max(error, drop(record))
        if self.want == "front_speed":
            reason = "it has no front speed"
        elif beyond := beyond_ladder(scene):
            reason = beyond.reason
        elif pilot.failed:
            reason = pilot.failed
        elif error > self.tolerance:
            reason = f"expected error {error:.2g}"
        elif failed := [need for need in needs if not need.holds]:
            reason = str(failed[0])
        elif options.given().keys() & STEPS or options.geometry == "finite":
            reason = "no steps and no finite geometry"
        if reason:
            self.reasons.append(f"quasi-static ({reason})")
            return None
        return self._made(
            fidelity="quasistatic",
            geometry="linear",
            assumptions=needs,
            error=error,
            work=quasistatic_work(scene, pilot),
        )

    def _linear(self, pilot: Pilot) -> tuple[Assumption, ...]:
        """Choose linear geometry if its error is small enough; return its assumption."""
        if self.options.geometry is not None or default_geometry(self.scene) == "linear":
            return ()
        error = linear_error(pilot)
        if error is None:
            self.reasons.append("linear geometry (its error could not be measured)")
            return ()
        small = Assumption(LINEAR, error, SHARE * self.tolerance, "by static states, over F_N")
        if not small.holds:
            self.reasons.append(f"linear geometry ({small})")
            return ()
        self.geometry, self.error = "linear", self.error + error
        return (small,)

    def _hybrid(self, pilot: Pilot, needs: tuple[Assumption, ...]) -> Plan:
        """Return the plan of the hybrid engine, or of full dynamics if little work is saved."""
        accuracy = self.options.accuracy or min(max(SHARE * self.tolerance, FINEST), LOOSEST)
        made = {"geometry": self.geometry, "dt": self.dt, "accuracy": accuracy}
        counts = counted(self.scene, self.t_end, dataclasses.replace(self.options, **made), pilot)
        self.located = located(self.scene, counts)  # by full dynamics, too
        full = self._full_work()
        spent = RUN + work(self.scene, self.geometry, counts)
        if spent > SPARES * full:
            spares = "the slider slips or rings down most of the time, so that it spares too little"
            return self._full(f"{spares} ({spent / full:.2g} of full dynamics)", needs)
        return self._made(
            counts,
            fidelity="hybrid",
            switching=self.options.switching or "located",
            assumptions=(*needs, self._resolution()),
            error=self.error + accuracy,
            work=spent,
            **made,
        )

    def _step(self) -> tuple[float, float]:
        """Return the time step in s, and its expected error."""
        scene, options = self.scene, self.options
        auto = step_size(scene, options.dt, options.stepper)
        error = step_error(scene, self.want, auto)
        if options.dt != "auto" or options.stepper != "rk4" or error == 0:
            return auto, error
        limit = stability_limit(scene)[0]
        dt = min(auto * (SHARE * self.tolerance / error) ** 0.25, LONGEST * limit)
        resolving = scene.resolving_step, RATIOS[-1] * scene.resolving_step
        for longest in resolving:  # of the run, or else of its reference run
            if RATIOS[0] * longest >= min(dt, auto):  # otherwise friction drops at once
                dt = min(dt, longest)
                break
        digit = 10.0 ** (math.floor(math.log10(dt)) - 1)
        dt = float(f"{math.floor(dt / digit) * digit:.1e}")
        return dt, step_error(scene, self.want, dt)

    def _resolution(self) -> Assumption:
        limit = stability_limit(self.scene, self.options.stepper)[0]
        meaning = f"{self.dt:.3g} s of {limit:.3g} s"
        return Assumption("dt over the stability limit", self.dt / limit, 1.0, meaning)

    def on_lattice(self, chosen: Plan) -> Plan:
        """Return the plan with the lattice constant that front speeds need, if it is smaller.

        Half the lattice constant takes 8 times as long: 4 times the blocks, twice the steps.
        """
        scene = self.scene
        if chosen.want != "front_speed" or not scene.law.rests:
            return chosen
        blocks, moving = zone_of_scene(scene), zone_of_scene(scene, MOVING)
        little, need = blocks_needed(scene, chosen.tolerance)
        if not blocks < need:
            return chosen
        within = f"front speeds within {chosen.tolerance:g}"
        what = f"X_c0/l = {blocks:.2g} ({moving:.2g} at {MOVING:g} of the limiting speed), and "
        what += f"{within} need {need:.2g}"
        if need > little:
            eta = scene.eta / math.sqrt(scene.slider.k * scene.m)
            what += f" with eta = {eta:.2g} sqrt(k m), {little:.2g} with little viscosity"
        if blocks == 0:
            text = f"{what}: no l resolves a front whose friction does not weaken over a length d_c"
            return dataclasses.replace(chosen, lattice=text)
        times = math.ceil(need / blocks)
        seconds = chosen.seconds * times ** (2 if scene.N_z == 1 else 3)
        text = (
            f"{what}: l = {scene.slider.l / times * 1e3:.3g} mm, {times} times smaller, about "
            f"{seconds:.2g} s"
        )
        return dataclasses.replace(chosen, lattice=text)


LINEAR = "error of linear geometry"


def _needs(scene: Scene, record: Record) -> tuple[Assumption, ...]:
    """Return the assumptions of the quasi-static engine, from a record of a scene's events."""
    relaxes, between = relaxation_time(scene), interval(record)
    share = 0.0 if relaxes == 0 else math.inf
    if between > 0 and math.isfinite(relaxes):
        share = relaxes / between
    lasts = f"{relaxes * 1e3:.3g} ms" if math.isfinite(relaxes) else "for ever"
    within = f"{between * 1e3:.3g} ms" if math.isfinite(between) else "all of the run"
    name = "relaxation time over time between main events"
    n_open = int((record.quiet["mode"] == OPEN).sum(axis=1).max(initial=0))
    ratio = scene.eta / math.sqrt(scene.slider.k * scene.m)
    return (
        Assumption(name, share, RING_SHARE, f"{lasts} in {within}"),
        Assumption("open blocks", n_open, OPEN_BLOCKS, "no gap beyond the corner"),
        Assumption("eta/sqrt(k m)", ratio, OVERDAMPED, "blocks are underdamped"),
    )


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
