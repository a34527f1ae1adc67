"""The time step of a run: its default, its limits, and where contact states switch."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Any, Literal

from pyfric.core import STEPPERS, Switching
from pyfric.scene import as_scene
from pyfric.statics import stability_limit
from pyfric.values import SceneError, check_number

if TYPE_CHECKING:
    from pyfric.scene import Number, Scene, SceneLike

ACCURACY = 1e-5
"""Default of the option `accuracy`: error of forces over F_N that steps and jumps may leave."""
AUTO_SHARE = 0.5
"""Ratio of dt = "auto" to the stability limit, for steppers outside `ERRORS` and for switches at
step ends."""
ERRORS = {"rk46": 1e-6, "rk46_waves": 1e-5}
"""Stepper -> largest error of forces of events, over F_N, with located switches and steps of half
the stability limit. `studies finer --errors` measures these errors. With shorter steps, they fall
with the stepper's order in linear motion."""
LONGEST = 0.9
"""Longest step over the stability limit. The limit holds for the lattice at rest. Steps stay below
it, because the slider is loaded and contacts switch."""
HALVED = 2
"""Largest number of halvings by which a step is shortened to resolve weakening, a policy."""
DIGITS = 3
"""Number of digits to which dt = "auto" over sqrt(m/k) is rounded."""
ALMOST = 1e-9
"""Relative increase of dt before it is rounded down, so that a rounding error changes no digit."""
LONGEST_LOCATED = 30.0
"""Longest step of the adaptive stepper with located switching, over the stability limit of RK4."""
MAX_STEPS = 10**14
"""Largest number of steps of one run, at which rounding of the time is 1 % of a step."""


def check_steps(t_begin: float, t_end: float, dt: float) -> None:
    """Raise SceneError if a run between two times (s) has more than `MAX_STEPS` steps dt (s)."""
    if (t_end - t_begin) / dt > MAX_STEPS:
        allowed = f"at most {t_begin + MAX_STEPS * dt:.3g} s, {MAX_STEPS:g} steps of {dt:g} s"
        raise SceneError("t_end", t_end, "s", allowed)


def default_switching(scene: Scene, method: str | None = None) -> Switching:
    """Return the default of the option `switching`; see `Options`."""
    return "located" if method is None and not scene.law.at_step_end else "step_end"


def is_auto(dt: Any) -> bool:
    """Return whether a time step is the text "auto"."""
    return isinstance(dt, str) and dt == "auto"


@functools.lru_cache(maxsize=256)
def default_stepper(scene: Scene, switching: Switching | None = None) -> str:
    """Return the default of the option `stepper` for a value of `switching`, None its default.

    With switches at step ends, errors are proportional to the step. The long steps that six stages
    allow then gain nothing. With little viscosity, "rk46" lets waves grow unless steps are short.
    """
    if scene.law.flows:
        return "imex"
    if (switching or default_switching(scene)) == "step_end":
        return "rk4"
    damped, waves = (stability_limit(scene, name)[0] for name in ("rk46", "rk46_waves"))
    return "rk46" if damped >= waves / 2 else "rk46_waves"


def keeps(stepper: str, switching: Switching) -> bool:
    """Return whether `ERRORS` has the error of a stepper with this switching."""
    return stepper in ERRORS and switching == "located"


def share_of_limit(stepper: str, switching: Switching, accuracy: float) -> float:
    """Return the step, over the stability limit, whose error over F_N is `accuracy`.

    For steppers without measured errors, return `AUTO_SHARE`.
    """
    if not keeps(stepper, switching):
        return AUTO_SHARE
    order = STEPPERS[stepper].linear_order
    return min(AUTO_SHARE * (accuracy / ERRORS[stepper]) ** (1 / order), LONGEST)


def step_size(
    scene: SceneLike,
    dt: Number | Literal["auto"] = "auto",
    stepper: str | None = None,
    accuracy: float = ACCURACY,
    switching: Switching | None = None,
) -> float:
    """Return the time step in s, checked against the stability limit of the stepper.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        dt: step in s, or "auto" for `share_of_limit`, rounded down to three digits over sqrt(m/k).
            "auto" is shortened to resolve weakening of friction, by at most a factor of four. The
            stepper "adaptive" makes sub-steps inside dt. Any dt is allowed with it, and "auto" uses
            the limit of RK4.
        stepper: the stepper; None means the default.
        accuracy: error of forces of events over F_N that "auto" allows.
        switching: where contacts switch; None means the default.

    Raises:
        SceneError: dt is not a number, not positive, or above the limit.
    """
    scene = as_scene(scene)
    switching = switching or default_switching(scene)
    stepper = stepper or default_stepper(scene, switching)
    limit, _ = stability_limit(scene, stepper)
    if is_auto(dt):
        share = share_of_limit(stepper, switching, accuracy)
        return rounded_step(scene, resolving(scene, share * limit))
    dt = check_number("dt", dt, "s", gt=0.0, note=", or 'auto'")
    if not STEPPERS[stepper].adaptive and dt > limit:
        allowed = f"0 < dt <= {limit:.4g} s, the stability limit of {stepper} for this scene"
        raise SceneError("dt", dt, "s", allowed, "unstable")
    return dt


def resolving(scene: Scene, dt: float) -> float:
    """Return a step (s), shortened to resolve weakening if `HALVED` halvings or fewer suffice."""
    resolves = scene.resolving_step
    return min(dt, resolves) if resolves >= dt / 2**HALVED else dt


def rounded_step(scene: Scene, dt: float) -> float:
    """Return a step (s) rounded down to `DIGITS` digits over sqrt(m/k)."""
    unit = math.sqrt(scene.m / scene.slider.k)
    times = dt / unit * (1 + ALMOST)
    places = DIGITS - 1 - math.floor(math.log10(times))
    return math.floor(times * 10.0**places) / 10.0**places * unit


def step_of_waves(scene: Scene) -> float:
    """Return the default time step (s) of the scene without viscosity."""
    return step_size(scene.replace({"slider.eta": 0.0, "slider.damping": None}))


def check_located(scene: Scene, stepper: str, dt: float) -> None:
    """Raise SceneError if switches cannot be located with this stepper or step."""
    if scene.law.flows:
        reason = "contact states follow from speeds"
        raise SceneError("switching", "located", "", "'step_end' with this law", reason)
    if scene.eta == 0 and STEPPERS[stepper].growth is None:
        allowed = (
            f"'step_end', or another stepper than {stepper!r}, or eta > 0: its steps conserve "
            "energy only as long as they are equal, and those that end at a switch are not"
        )
        raise SceneError("switching", "located", "", allowed)
    if not STEPPERS[stepper].adaptive:
        return
    limit = LONGEST_LOCATED * stability_limit(scene, "rk4")[0]
    if dt > limit:
        allowed = f"at most {limit:.3g} s with located switching: each step has room for some"
        raise SceneError("dt", dt, "s", allowed, "too long")
