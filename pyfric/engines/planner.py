"""The planner: which model is enough for a question.

Full dynamics in finite geometry is the reference. `plan` says what may be left out of it for what
is wanted, and at what cost and error:

level         engine        geometry   left out
----------    -----------   --------   -----------------------------------------------
quasistatic   quasistatic   linear     inertia, rotation of bonds
hybrid        hybrid        linear     rotation of bonds, the last of each ring-down
hybrid        hybrid        finite     the last of each ring-down
dynamic       dynamic       finite     nothing

It takes the first level whose expected error is within the tolerance and whose assumptions hold.
Each assumption is a number with a limit. `Plan.check` looks at them again in the record of a run.

Expected errors of forces are over F_N. Those of the ladder and of jumps were measured on the
paper's scenes up to the first event over the whole interface (`reference_data/`); that of steps
follows from the scene (`step_error`). `pyfric.engines.verification` measures them in the run.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.display import html
from pyfric.engines.cost import NS, beside, beside_ladder, evaluations_of_events, set_up, work
from pyfric.engines.guard import largest_strain
from pyfric.engines.options import Fidelity, Options, Want, step_size
from pyfric.engines.quasistatic import beyond_ladder
from pyfric.engines.scout import decay_times, interval, most_open, scouted
from pyfric.engines.stretches import bends
from pyfric.record import RESOLVED, zone_at_rest
from pyfric.scene import Geometry, at_once, check_number, default_geometry
from pyfric.statics import creeps, one_thread_if_small, stability_limit

if TYPE_CHECKING:
    from pyfric.core import Switching
    from pyfric.engines.scout import DecayTimes, Scout
    from pyfric.record import Record
    from pyfric.scene import Scene, SceneLike

__all__ = ["Assumption", "Plan", "long_note", "plan"]

ERROR_QUASISTATIC = 0.05
"""Largest difference of start forces between ladder and dynamics, event by event, over F_N."""
ERROR_JUMPS = 1e-4
"""The same between hybrid and dynamics."""
PHASE = 1 / 120
"""A step of RK4 is off by this times (omega dt)^5 in the phase of a motion of rate omega."""
RESOLVED_ERROR = 0.05
"""Relative error of front speeds with `RESOLVED` blocks in X_c0 (`pyfric fronts`); taken to fall in
proportion to l."""
RING_SHARE = 0.25
"""Longest decay time of the slider's oscillations, over the time between main events."""
OPEN_BLOCKS = 2
"""More open blocks than this are a gap; small differences then decide the order of events."""
SOFT = "{}; following it takes as long as the hybrid engine, which leaves out less"
"""Measured in eleven scenes with d_c from 0.2 to 2 um: 0.4 to 1.6 times as long, start forces off
by 0.038 F_N at most (docs/laws.md)."""
STABLE = 4
"""Steps with weakening that is followed as static states, over those without: 1.8 and 3.5 with
d_c = 1 um in the Fig. 1 scene, 13 with 5 um."""
OVERDAMPED = 0.433
"""Blocks oscillate below this eta over sqrt(k m)."""
LONG = 600.0
"""A run that takes longer is said to, before it starts, s."""


class Assumption(NamedTuple):
    """What a level relies on: it holds while `value` is at most `limit`."""

    name: str
    value: float
    limit: float
    meaning: str

    @property
    def holds(self) -> bool:
        return self.value <= self.limit

    def __str__(self) -> str:
        sign = "<=" if self.holds else "> "
        return f"{self.name}: {self.value:.3g} {sign} {self.limit:.3g} ({self.meaning})"


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What will be modelled, and why that is enough.

    Attributes:
        want: what the run is made for.
        tolerance: accepted error, over F_N (relative, for front speeds).
        fidelity, geometry: the engine and its geometry.
        switching, dt: where contacts switch; time step in s; None for the quasi-static engine.
        assumptions: what the level relies on; all of them hold.
        reasons: why cheaper levels were passed over.
        error: expected error, as the tolerance.
        evaluations: expected number of blocks times force evaluations.
        seconds: expected time on one core, without verification.
        price: expected time more that measuring errors takes, in s: as much again, or `CHEAP`.
        share: part of the run that is compared at that price.
        lattice: for front speeds, the lattice constant that the tolerance needs, and its price; ""
            where this one is enough, and for other wants.
    """

    want: Want
    tolerance: float
    fidelity: Fidelity
    geometry: Geometry
    switching: Switching | None
    dt: float | None
    assumptions: tuple[Assumption, ...]
    reasons: tuple[str, ...]
    error: float
    evaluations: float
    seconds: float
    price: float = 0.0
    share: float = 1.0
    lattice: str = ""

    def __str__(self) -> str:
        models = {
            "quasistatic": "a ladder of static states; events by a rule without inertia",
            "hybrid": "dynamics inside events, closed forms between them",
            "dynamic": "dynamics throughout",
        }
        left_out = {
            "quasistatic": ["inertia, waves, ring-down"],
            "hybrid": ["what ring-down leaves of fast modes"],
            "dynamic": [],
        }[self.fidelity]
        if any(one.name == STRAIN for one in self.assumptions):
            left_out.append("rotation of bonds")
        step = ""
        if self.dt is not None:
            step = f", dt = {self.dt * 1e6:.3g} us, {self.switching} switching"
        part = "" if self.share == 1 else f", for the first {self.share:.0%} of the run"
        lines = [
            f"for {self.want} within {self.tolerance:g}: {self.fidelity}, {self.geometry} geometry"
            + step,
            f"modelled: {models[self.fidelity]}",
            f"left out: {'; '.join(left_out) or 'nothing'}",
            *(f"because {one}" for one in self.assumptions),
            *(f"not less: {reason}" for reason in self.reasons),
            f"expected error: {self.error:.2g}",
            f"expected cost: {self.evaluations:.2g} block evaluations, about {self.seconds:.2g} s",
            f"verification: about {self.price:.2g} s more{part}",
            *([f"lattice: {self.lattice}"] if self.lattice else ()),
        ]
        return "\n".join(lines)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return html(self)

    def up(self, scene: Scene, failed: list[Assumption]) -> Plan | None:
        """Return the plan one level up from where these assumptions failed; None if it is the top.

        The quasi-static engine moves up to the hybrid one. Linear geometry gives way to finite.
        """
        if self.fidelity == "quasistatic":
            geometry = self.geometry
            if any(one.name == STRAIN for one in failed):
                geometry = default_geometry(scene)
            switching, dt, _ = _step(scene, self.want, self.tolerance, math.inf)
            how = {"fidelity": "hybrid", "geometry": geometry, "switching": switching, "dt": dt}
            return dataclasses.replace(self, **how)
        if self.geometry == "linear" and default_geometry(scene) == "finite":
            return dataclasses.replace(self, geometry="finite")
        return None

    def check(self, record: Record) -> list[Assumption]:
        """Return the assumptions that the record of a run does not bear out."""
        found = _of_record(record, self)
        return [one for one in found if not one.holds]


@at_once()
@one_thread_if_small
def plan(
    scene: SceneLike,
    want: Want = "precursors",
    tolerance: float = 0.01,
    *,
    t_end: float = 1.0,
) -> Plan:
    """Return which engine, geometry and step are enough for a question.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        want: "loading_curve", "precursors", "stress", "front_speed" or "motion".
        tolerance: accepted error over F_N; for front speeds relative.
        t_end: time of the end of the run, in s, for cost and assumptions.

    Raises:
        SceneError: an argument is refused.
        EquilibriumError: the scene has no loaded state.

    Source: errors of the levels as measured on the paper's scenes.
    """
    tolerance = Options(want=want, tolerance=tolerance).tolerance
    t_end = check_number("t_end", t_end, "s", ge=0.0)
    if scene.prescribed or not scene.law.rests:
        return _on_lattice(_all_of_it(scene, want, tolerance, t_end), scene)
    scout, times = scouted(scene, t_end), decay_times(scene)
    why_not, without_inertia = _ladder(scene, want, tolerance, t_end, scout, times)
    if without_inertia is not None:
        return without_inertia
    return _on_lattice(_stepped(scene, want, tolerance, t_end, scout, times, why_not), scene)


def _on_lattice(chosen: Plan, scene: Scene) -> Plan:
    """Return the plan with what front speeds need of the lattice.

    Half the lattice constant takes 8 times the time: 4 times the blocks, twice the steps.
    """
    if chosen.want != "front_speed":
        return chosen
    p = scene.p_prescribed if scene.prescribed else np.full(scene.N_x, scene.F_N / scene.N_x)
    blocks = float(np.min(zone_at_rest(scene, p)))
    need = RESOLVED * max(1.0, RESOLVED_ERROR / chosen.tolerance)
    if not blocks < need:
        return chosen
    what = f"X_c0/l = {blocks:.2g}, and front speeds within {chosen.tolerance:g} need {need:.2g}"
    if blocks == 0:
        text = f"{what}: no l resolves a front whose friction does not weaken over a length d_c"
        return dataclasses.replace(chosen, lattice=text)
    times = math.ceil(need / blocks)
    exponent = 1 if scene.N_z == 1 else 2
    seconds = chosen.seconds * times ** (exponent + 1)
    text = (
        f"{what}: l = {scene.slider.l / times * 1e3:.3g} mm, {times} times smaller, about "
        f"{seconds:.2g} s ({chosen.evaluations * times ** (exponent + 1):.2g} block evaluations)"
    )
    return dataclasses.replace(chosen, lattice=text)


def _all_of_it(scene: Scene, want: Want, tolerance: float, t_end: float) -> Plan:
    """Return the plan for a scene that only full dynamics can follow."""
    switching, dt, error = _step(scene, want, tolerance, max(t_end, 1e-30))
    geometry = default_geometry(scene)
    evaluations = 4.0 * t_end / dt * scene.N_x * scene.N_z
    other = beside(scene, evaluations, 0, geometry, dt)
    what = "a prescribed interface in two dimensions has no static states"
    if not scene.law.rests:
        what = "junctions break and pin all the time, so that jumps over rests gain nothing"
    return Plan(
        want=want,
        tolerance=tolerance,
        fidelity="dynamic",
        geometry=geometry,
        switching=switching,
        dt=dt,
        assumptions=(_resolution(scene, dt),),
        reasons=(f"quasistatic: {what}", f"hybrid: {what}"),
        error=error,
        evaluations=evaluations,
        seconds=evaluations * NS[geometry] * 1e-9,
        price=other.seconds,
        share=other.share,
    )


def _ladder(
    scene: Scene,
    want: Want,
    tolerance: float,
    t_end: float,
    scout: Scout,
    times: DecayTimes,
) -> tuple[list[str], Plan | None]:
    """Return why the quasi-static engine is not enough, or else its plan."""
    strain, one_row = largest_strain(scene, scout.F_max, t_end), scene.N_z == 1
    needs = [_waits(times.slow, scout.interval), _gap(scout.open), _damping(scene)]
    error = max(ERROR_QUASISTATIC, scout.drop) + (0.0 if one_row else strain)
    why_not = []
    if want in ("front_speed", "motion"):
        why_not.append(f"it has no {want.replace('_', ' ')}")
    elif beyond := beyond_ladder(scene):
        why_not.append(SOFT.format(beyond.reason) if creeps(scene.law) else beyond.reason)
    elif bend := bends(scene):
        why_not.append(bend.reason)
    elif scout.failed:
        why_not.append(scout.failed)
    elif error > tolerance:
        why_not.append(f"its expected error is {error:.2g}")
    else:
        why_not += [str(one) for one in needs if not one.holds]
    if why_not:
        return [f"quasistatic: {reason}" for reason in why_not], None
    other = beside_ladder(scene, scout.events, scout.front_blocks, step_size(scene))
    return [], Plan(
        want=want,
        tolerance=tolerance,
        fidelity="quasistatic",
        geometry="linear",
        switching=None,
        dt=None,
        assumptions=(*needs, *(() if one_row else (_strain(strain, tolerance),))),
        reasons=(),
        error=error,
        evaluations=0.0,
        seconds=scout.seconds * (1 + scout.far) + set_up(scene, "quasistatic", "linear").seconds,
        price=other.seconds,
        share=other.share,
    )


def _stepped(
    scene: Scene,
    want: Want,
    tolerance: float,
    t_end: float,
    scout: Scout,
    times: DecayTimes,
    reasons: list[str],
) -> Plan:
    """Return the plan of an engine with time steps; `reasons` say why there is none without."""
    lasts = min(scout.interval, max(t_end, 1e-30))
    switching, dt, error = _step(scene, want, tolerance, lasts)
    needs, reasons = [_resolution(scene, dt)], list(reasons)
    geometry: Geometry = "linear"
    if scene.N_z > 1:
        strain = largest_strain(scene, scout.F_max, t_end)
        small = _strain(strain, tolerance / 2)
        if small.holds:
            needs.append(small)
            error += strain
        else:
            geometry = default_geometry(scene)
            reasons.append(f"linear geometry: {small}")
    quiet, fidelity = _comes_to_rest(times.fast, scout.interval), "dynamic"
    if want == "motion":
        reasons.append("hybrid: it leaves out fast motion between events")
    elif not quiet.holds:
        reasons.append(f"hybrid: {quiet}")
    elif error + ERROR_JUMPS > tolerance:
        reasons.append(f"hybrid: its expected error is {error + ERROR_JUMPS:.2g}")
    else:
        fidelity, error = "hybrid", error + ERROR_JUMPS
        needs.append(quiet)
    evaluations, seconds = _cost(scene, t_end, scout, fidelity, geometry, dt)
    jumps = scout.events if fidelity == "hybrid" else 0
    other = beside(scene, evaluations, jumps, geometry, dt, lasts=t_end)
    ready = set_up(scene, fidelity, default_geometry(scene)).seconds
    return Plan(
        want=want,
        tolerance=tolerance,
        fidelity=fidelity,
        geometry=geometry,
        switching=switching,
        dt=dt,
        assumptions=tuple(needs),
        reasons=tuple(reasons),
        error=error,
        evaluations=evaluations,
        seconds=seconds,
        price=ready + other.seconds,
        share=other.share,
    )


def _cost(
    scene: Scene, t_end: float, scout: Scout, fidelity: Fidelity, geometry: Geometry, dt: float
) -> tuple[float, float]:
    """Return the expected number of block evaluations, and the time in s."""
    blocks, steps, jumps = scene.N_x * scene.N_z, t_end / dt, 0
    evaluations = 4.0 * steps * blocks
    if fidelity == "hybrid":
        jumps = scout.events
        followed = creeps(scene.law) and geometry == "linear"
        if scene.law.coulomb or followed:  # else stable slip may take any share of it
            made = scout.events, scout.front_blocks, geometry, dt, steps
            evaluations = evaluations_of_events(scene, *made) * (STABLE if followed else 1)
    seconds = scout.seconds + set_up(scene, fidelity, geometry).seconds
    return evaluations, seconds + work(blocks, evaluations, jumps, geometry)


def long_note(
    scene: Scene, length: float, fidelity: Fidelity, geometry: Geometry, dt: float
) -> str:
    """Return what to say before a run of `length` s that takes long; "" if it does not.

    Its cheaper way is the quickest one of those that leave out less than inertia.
    """
    blocks = scene.N_x * scene.N_z
    most = 4.0 * length / dt * blocks * NS[geometry] * 1e-9
    if most + set_up(scene, fidelity, geometry).seconds <= LONG:
        return ""
    hint = "larger blocks take less: twice l, about a tenth of the time"
    if scene.prescribed or not scene.law.rests:
        return f"{fidelity}: this run takes about {most / 60:.2g} minutes on one core; {hint}"
    scout = scouted(scene, length)

    def seconds(fidelity: Fidelity, geometry: Geometry) -> float:
        return _cost(scene, length, scout, fidelity, geometry, dt)[1]

    expected = seconds(fidelity, geometry)
    if expected <= LONG:
        return ""
    ways = {("hybrid", geometry), ("hybrid", "linear")} - {(fidelity, geometry)}
    quicker = [(seconds(*way), *way) for way in sorted(ways)]
    least, engine, bonds = min(quicker, default=(math.inf, "", ""))
    if least < expected:
        hint = f"the {engine} engine in {bonds} geometry takes about {least / 60:.2g} minutes"
    return f"{fidelity}: this run takes about {expected / 60:.2g} minutes on one core; {hint}"


# --- numbers -------------------------------------------------------------------------------------


STRAIN = "largest strain"


def _damping(scene: Scene) -> Assumption:
    ratio = scene.eta / math.sqrt(scene.slider.k * scene.m)
    return Assumption("eta/sqrt(k m)", ratio, OVERDAMPED, "blocks are underdamped")


def _waits(decay: float, interval: float) -> Assumption:
    name, times = "slowest decay over time between main events", _times(decay, interval)
    meaning = f"{times}: the driver's drift during ring-down"
    return Assumption(name, _share(decay, interval), RING_SHARE, meaning)


def _comes_to_rest(decay: float, interval: float) -> Assumption:
    name, times = "decay of fast modes over time between main events", _times(decay, interval)
    return Assumption(name, _share(decay, interval), RING_SHARE, times)


def _share(decay: float, interval: float) -> float:
    if not math.isfinite(decay):
        return math.inf
    return decay / interval if interval > 0 else math.inf


def _times(decay: float, interval: float) -> str:
    first = f"{decay * 1e3:.3g} ms" if math.isfinite(decay) else "no decay"
    return f"{first} in " + (f"{interval * 1e3:.3g} ms" if interval < math.inf else "all of it")


def _gap(blocks: int) -> Assumption:
    return Assumption("open blocks", blocks, OPEN_BLOCKS, "no gap beyond the corner")


def _strain(value: float, limit: float) -> Assumption:
    return Assumption(STRAIN, value, limit, "bounds the error of linear geometry over F_N")


def _resolution(scene: Scene, dt: float) -> Assumption:
    limit = stability_limit(scene)[0]
    return Assumption(
        "dt over the stability limit", dt / limit, 1.0, f"{dt:.3g} s of {limit:.3g} s"
    )


def _step(
    scene: Scene, want: Want, tolerance: float, lasts: float
) -> tuple[Switching, float, float]:
    """Return where contacts switch, the time step in s, and the expected error of both."""
    auto = step_size(scene)
    error = step_error(scene, want, auto, lasts)
    dt = auto * (tolerance / (2 * error)) ** 0.25 if error > 0 else auto
    if dt >= auto:
        return "located", auto, error
    digit = 10.0 ** (math.floor(math.log10(dt)) - 1)
    dt = float(f"{math.floor(dt / digit) * digit:.1e}")
    return "located", dt, error * (dt / auto) ** 4


def step_error(scene: Scene, want: Want, dt: float, lasts: float) -> float:
    """Return the expected error of located RK4 steps, as the tolerance of a plan.

    A block that starts to slip excites its own motion, omega^2 = s/m with s the stiffness of what
    holds it along the interface, which lasts 1/(eta omega^2/(2 k)) and at most to the next event.
    Its phase is then off by omega lasts (omega dt)^4/120: a front speed by that share, F_T by that
    share of the drop (mu_s - mu_k) F_N/N_x of one block.

    Args:
        scene: the scene.
        want: what is wanted.
        dt: step, in s.
        lasts: time to the next event, in s.
    """
    slider, law = scene.slider, scene.law
    stiff = 2.5 * slider.k
    if scene.N_z == 1:
        stiff = 2 * slider.k + scene.k_top + scene.driver.K
    omega2 = stiff / scene.m
    lasts = min(lasts, 2 * slider.k / (scene.eta * omega2) if scene.eta else math.inf)
    if not math.isfinite(lasts):
        lasts = 1 / math.sqrt(omega2)
    phase = PHASE * lasts * dt**4 * omega2**2.5
    return (
        phase if want == "front_speed" else phase * max(float(np.max(law.drop)), 1e-6) / scene.N_x
    )


def _of_record(record: Record, plan: Plan) -> list[Assumption]:
    """Return the assumptions of a plan with the numbers of its record."""
    scene, found = record.scene, []
    if plan.fidelity == "quasistatic":
        found.append(_waits(decay_times(scene).slow, interval(record)))
        found.append(_gap(most_open(record)))
    if plan.geometry == "linear" and default_geometry(scene) == "finite":
        limit = plan.tolerance / (1 if plan.fidelity == "quasistatic" else 2)
        F_max = float(record.curve["F_T"].abs().max())
        t_end = float(record.curve["t"].iloc[-1])
        found.append(_strain(largest_strain(scene, F_max, t_end), limit))
    return found
