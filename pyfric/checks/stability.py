"""Largest stable steps of a scene, computed and measured; growth of disturbances beyond them.

Computed limits are from `pyfric.stability_limit`, by eigenvalues of the scene's own operator.
Measured limits are from a slider at rest with a tiny disturbance: once stuck to the surface and, on
a foundation, once lifted off. The core integrates the motion with steps of different length, and
bisection finds the step at which the disturbance begins to grow. No contact switches, because
driver and loads do not move and friction is strong enough. `simulate` refuses steps beyond the
limit.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd

from pyfric import core
from pyfric.core import OPEN
from pyfric.figures import DataFigure
from pyfric.scene import Interface, Scene, SceneLike, as_scene
from pyfric.signals import at_once
from pyfric.statics import loaded_state, stability_limit

LIMITED = ("rk4", "verlet", "symplectic_euler")
"""Explicit steppers with uniform steps."""
BEYOND = (0.5, 0.9, 0.98, 1.02, 1.05, 1.1, 1.2, 1.5)
"""Steps, over the computed limit, at which growth is measured."""
STEPS, GROWTH, HALVINGS = 3000, 1e3, 9
LOOKS = 300
"""Number of times at which the disturbance is recorded."""
TINY = 1e-300
NEXT_TO_NOTHING = 1e-12
"""Size of the disturbance, in l."""


def at_rest(scene: Scene) -> Scene:
    """Return the scene without driving, with friction too strong for slip."""
    top, k_f = scene.top, None if scene.prescribed else float(np.max(scene.k_f))
    none = {"T": 0.0, "T_protocol": (), "protocol": (), "tau": 0.0, "push": ()}
    own = {field.name for field in dataclasses.fields(top)}
    top = dataclasses.replace(top, **{name: none[name] for name in none if name in own})
    return dataclasses.replace(
        scene,
        top=top,
        driver=dataclasses.replace(scene.driver, V=0.0, protocol=()),
        interface=Interface(mu_s=1e6, mu_k=0.0, k_f=k_f),
    )


def measured_limit(scene: Scene, stepper: str, around: float) -> float:
    """Return the largest step at which a disturbance does not grow, in s.

    Nothing slips in the scene, which is at rest (V = 0). The step is searched between 0.7 and 1.4
    times `around` (s).
    """
    low, high = 0.7 * around, 1.4 * around
    for _ in range(HALVINGS):
        dt = math.sqrt(low * high)
        low, high = (low, dt) if grows(scene, stepper, dt) else (dt, high)
    return math.sqrt(low * high)


def grows(scene: Scene, stepper: str, dt: float) -> bool:
    """Whether a disturbance grows by `GROWTH` within `STEPS` steps, stuck or lifted off."""
    found = _shaken(scene, stepper, dt, LOOKS // 10)
    return any(not sizes[-1] < GROWTH * sizes[0] for sizes in found)


def growth(scene: Scene, stepper: str, dt: float) -> float:
    """Return the growth of a disturbance in a step, ln(after/before); negative means decay."""
    rates = []
    for sizes in _shaken(scene, stepper, dt, LOOKS):
        half = (len(sizes) - 1) // 2
        steps = (len(sizes) - 1 - half) * (STEPS // LOOKS)
        ratio = max(sizes[-1], TINY) / max(sizes[half], TINY)
        rate = math.log(ratio) / steps
        rates.append(rate if sizes[-1] > sizes[0] else min(rate, 0.0))  # growth is rounding
    return max(rates)


def _shaken(scene: Scene, stepper: str, dt: float, looks: int) -> Iterator[list[float]]:
    """Yield lists of the largest speed (m/s) over time: for the slider stuck, then lifted off.

    A list ends early if the speed has grown far too large.
    """
    rest = loaded_state(scene)
    chain, lifting = scene.N_z == 1, not scene.prescribed
    for lifted in (False, True) if lifting and not chain else (lifting,):
        state, rng = rest.state(scene, dt), np.random.default_rng(1)
        model = core.model(scene, "linear", rest.u_drv0)
        if lifted:
            model = core.springs(scene, "linear", viscous=True)
            state.y[:], state.rod[:], state.mode[:] = 0.0, 0.0, OPEN
        size = NEXT_TO_NOTHING * scene.slider.l / math.sqrt(scene.m / scene.slider.k)
        moved = slice(0 if chain else 1, None if lifted or not scene.rigid else -1)
        if scene.walls.top == "held":
            moved = slice(1, -1)
        state.y[moved, 2:] = size * rng.standard_normal(state.y[moved, 2:].shape)
        if chain:
            state.y[:, 3] = 0.0
        log, sizes = core.Log(scene.N_x), [float(np.abs(state.y[:, 2:]).max())]
        while len(sizes) <= looks and sizes[-1] < GROWTH**10 * sizes[0]:
            core.advance(model, state, log, STEPS // looks, stepper=stepper, budget=False)
            with np.errstate(all="ignore"):
                now = float(np.abs(state.y[:, 2:]).max())
            sizes.append(now if math.isfinite(now) else GROWTH**10 * sizes[0])
        yield sizes


@at_once()
def stability(
    scene: SceneLike, *, budget: float = 60.0, say: Callable[[str], None] = lambda _: None
) -> pd.DataFrame:
    """Compute and measure the largest stable steps of a scene, and growth at longer steps.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        budget: processor time (s), after which measurements end.
        say: function that receives the name of the next step.

    Returns:
        One row for each stepper and step: stepper, computed and measured (largest stable step, s),
        ratio (measured over computed), share (step over the computed limit), dt (s), growth (ln of
        the factor by which a disturbance grows in a step). NaN means that the budget ended before
        the measurement.

    Raises:
        SceneError: `scene` is no scene, or has no loaded state.
    """
    scene, begin, rows = as_scene(scene), time.process_time(), []
    still = at_rest(scene)
    for stepper in LIMITED:
        computed, measured = float(stability_limit(scene, stepper)[0]), math.nan
        say(f"{stepper}: growth of a disturbance")
        for share in BEYOND:
            late = time.process_time() - begin > budget
            rate = math.nan if late else growth(still, stepper, share * computed)
            about = {"stepper": stepper, "computed": computed, "share": share}
            rows.append(about | {"dt": share * computed, "growth": rate})
        if time.process_time() - begin < budget:
            say(f"{stepper}: largest stable step")
            measured = measured_limit(still, stepper, computed)
        for row in rows[-len(BEYOND) :]:
            row |= {"measured": measured, "ratio": measured / computed}
    names = ["stepper", "computed", "measured", "ratio", "share", "dt", "growth"]
    return pd.DataFrame(rows)[names]


def report(table: pd.DataFrame) -> str:
    """Return the table as text: a line for each stepper."""
    about = ["stepper", "computed", "measured", "ratio"]
    beyond = (
        table[table["share"] >= 0.98].set_index([*about, "share"])["growth"].unstack(sort=False)
    )
    return (
        "largest stable step (s), and ln of growth in a step at steps over the computed limit\n"
        f"{beyond.reset_index().to_string(index=False, float_format='{:.3g}'.format)}\n"
        "runs with steps beyond the computed limit are refused; adaptive has no limit"
    )


def figure(table: pd.DataFrame) -> DataFigure:
    """Draw growth in a step against the step, one line for each stepper."""
    fig = DataFigure(figsize=(4.6, 3.2))
    axes, colours = fig.subplots(), ("#0072B2", "#009E73", "#D55E00")
    for (stepper, rows), colour in zip(table.groupby("stepper", sort=False), colours, strict=True):
        text = f"{stepper.replace('_', ' ')}: limit {rows['computed'].iloc[0]:.3g} s"
        axes.plot(rows["share"], rows["growth"], "o-", color=colour, ms=3.5, lw=1.1, label=text)
        axes.axvline(rows["ratio"].iloc[0], color=colour, lw=0.8, ls=":")
    axes.axhline(0.0, color="0.6", lw=0.7)
    axes.axvline(1.0, color="0.6", lw=0.7)
    axes.set_yscale("symlog", linthresh=1e-2)
    axes.set_ylim(bottom=min(-5e-3, table["growth"].min()))
    axes.set_xlabel("step over the computed limit", fontsize=8)
    axes.set_ylabel("ln of growth in a step", fontsize=8)
    axes.tick_params(labelsize=7, direction="in", which="both")
    axes.legend(fontsize=7, frameon=False)
    fig.caption = (
        "Growth per step of a small disturbance of the slider at rest, against the step, for each "
        "explicit stepper. Dotted: the largest step at which none was measured. Above 0 a run "
        "diverges; such steps are refused."
    )
    fig.tables = {"growth": table}
    return fig
