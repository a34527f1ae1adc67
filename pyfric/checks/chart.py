"""Error against cost of every engine and stepper, for any scene and question.

The scene runs once with each method: each engine (static states, quasi-static sequence, hybrid,
full dynamics), geometry, stepper and step. Each record is compared, event by event, with full
dynamics at a small step (`pyfric.record.differences`). Cost is processor time. Methods that refuse
the scene are listed with the reason. Methods too slow for the budget are listed with their expected
time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from pyfric.engines import (
    RunError,
    default_stepper,
    default_switching,
    full_work,
    machine_speed,
)
from pyfric.figures import DataFigure
from pyfric.planning import simulate
from pyfric.record import Record, differences, material_of
from pyfric.scene import Scene, SceneLike, as_scene, default_geometry
from pyfric.signals import at_once
from pyfric.statics import EquilibriumError, stability_limit
from pyfric.values import SceneError, check_number

WANTS = {
    "loading_curve": "loading curve: RMS of F_T over F_N",
    "precursors": "start and arrest forces over F_N, or rupture times; worst",
    "stress": "stresses before and after events: RMS over F_N/N_x, worst event",
    "front_speed": "front speeds: 95th percentile of relative differences",
}
"""Question -> definition of its error."""
EVENTS = 2
"""Default length of runs, in main events of the quasi-static sequence."""
TRANSITS = 2.0
"""Default length of runs of a scene without a quasi-static sequence, in times of a shear wave along
the slider."""
FINEST = 1 / 16
"""Smallest step of the reference, over the stability limit. Half of the budget may require a larger
step."""


class Method(NamedTuple):
    """One method to run a scene; `share` is its time step over the stability limit."""

    fidelity: str
    geometry: str | None = None
    switching: str | None = None
    share: float | None = None
    stepper: str = "rk4"


def methods(scene: Scene) -> list[Method]:
    """Return all methods, the cheapest engine first."""
    found = [Method("equilibrium"), Method("quasistatic")]
    six = default_stepper(scene, "located")
    for geometry in ("linear", "finite"):
        for share in (0.9, 0.7, 0.5, 0.25):
            found.append(Method("hybrid", geometry, "located", share, six))
    own = default_geometry(scene)
    other = "linear" if own == "finite" else "finite"
    for geometry in (own, other):
        for stepper in dict.fromkeys((six, "rk4", "verlet", "symplectic_euler")):
            for switching in ("step_end", "located"):
                for share in (0.9, 0.25) if geometry == own else (0.9,):
                    found.append(Method("dynamic", geometry, switching, share, stepper))
        found.append(Method("dynamic", geometry, "located", 1.0, "adaptive"))
    return found


@at_once()
def chart(
    scene: SceneLike,
    t_end: float | None = None,
    *,
    budget: float = 60.0,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Run a scene by every engine and stepper.

    Args:
        scene: the scene, the name of a preset, or the path of a scene file.
        t_end: end of the runs (s). None means just after the second main event of the quasi-static
            sequence, or two transits of a shear wave if there is no sequence.
        budget: processor time (s). Half of it is for the reference, whose step is as small as this
            time allows.
        say: function that receives the name of the next step.

    Returns:
        One row for each method, the reference first. Columns: fidelity, geometry, switching,
        stepper, share (step over its stability limit), dt and t_end (s), seconds (processor time),
        the errors of `WANTS` (NaN if nothing could be compared), covered (share of the time that
        the record covers), events, and status: "reference", "ok", or the reason why there is no
        result.

    Raises:
        SceneError: no scene, or t_end is refused.
        RunError: the reference left the range of numbers.
    """
    scene, begin = as_scene(scene), time.process_time()
    t_end = _default_end(scene) if t_end is None else check_number("t_end", t_end, "s", gt=0.0)
    finest = _reference(scene, t_end, budget / 2)
    say(f"reference: {_named(finest)}, up to {t_end:.3g} s")
    truth, seconds = run(scene, t_end, finest, _step(scene, finest))
    about = {"seconds": seconds, "status": "reference", "covered": 1.0, "events": len(truth.events)}
    rows = [finest._asdict() | {"dt": _step(scene, finest), "t_end": t_end} | about]
    for method in methods(scene):
        left = max(budget - (time.process_time() - begin), 0.0)
        say(f"{_named(method)}; {left:.0f} s are left")
        about = method._asdict() | {"dt": _step(scene, method), "t_end": t_end}
        rows.append(about | _measured(scene, t_end, method, truth, left))
    return pd.DataFrame(rows)


def after_events(scene: Scene, events: int) -> float | None:
    """Return a time (s) after `events` main events of a driven scene; None if there are fewer."""
    t_end = 2.0 * scene.F_N / (scene.driver.K * scene.driver.V)
    how = {"stop_when": f"main_events = {events + 1}", "progress": False}
    found = simulate(scene, t_end, fidelity="quasistatic", **how).events
    starts = found["t_start"][found["is_main"]].to_list()
    return float(np.mean(starts[events - 1 : events + 1])) if len(starts) > events else None


def _default_end(scene: Scene) -> float:
    """Return a time just after the second main event, or two transits of a shear wave, s."""
    t_end = None
    if scene.has_rests and scene.law.rests and scene.driver.V > 0:
        t_end = after_events(scene, EVENTS)
    return TRANSITS * scene.slider.L / material_of(scene).c_S if t_end is None else t_end


def _reference(scene: Scene, t_end: float, budget: float) -> Method:
    """Return full dynamics with the time step halved as often as the budget allows."""
    geometry, switching = default_geometry(scene), default_switching(scene)
    finest = Method("dynamic", geometry, switching, 0.5, default_stepper(scene))
    while finest.share > FINEST:
        finer = finest._replace(share=finest.share / 2)
        if _expected(scene, t_end, finer) > budget:
            break
        finest = finer
    return finest


def _expected(scene: Scene, t_end: float, method: Method) -> float:
    """Return the expected time of a run with full dynamics, s; 0 for the faster engines."""
    if method.fidelity != "dynamic" or method.share is None:
        return 0.0
    dt = _step(scene, method)
    geometry = method.geometry or default_geometry(scene)
    return full_work(scene, geometry, dt, t_end, method.stepper) * machine_speed()


def _step(scene: Scene, method: Method) -> float | None:
    """Return the time step of a method, s; None for a method without steps."""
    if method.share is None:
        return None
    return method.share * stability_limit(scene, method.stepper)[0]


def run(
    scene: Scene, t_end: float, method: Method, dt: float | None = None
) -> tuple[Record, float]:
    """Return the record of a method with steps dt (s), and its processor time, s.

    Raises:
        SceneError: the method refuses the scene.
        RunError: the run left the range of numbers.
    """
    how: dict[str, Any] = {"fidelity": method.fidelity, "progress": False}
    if dt is not None:
        how |= {"dt": dt, "geometry": method.geometry, "switching": method.switching, "threads": 1}
        how |= {"stepper": method.stepper}
        how |= {"energies": False} if method.fidelity == "dynamic" else {}
    begin = time.process_time()
    record = simulate(scene, t_end, **how)
    return record, time.process_time() - begin


def _measured(
    scene: Scene, t_end: float, method: Method, truth: Record, left: float
) -> dict[str, Any]:
    """Return time, status and errors of a method; without a result, the reason as status."""
    expected = _expected(scene, t_end, method)
    if expected > left or not left:
        why = f"not run: about {expected:.2g} s, and {left:.2g} s of the budget are left"
        return {"status": why}
    try:
        record, seconds = run(scene, t_end, method, _step(scene, method))
    except (SceneError, RunError, EquilibriumError) as error:
        return {"status": str(error)}
    errors = _errors(record, truth, t_end) if record.done else {"status": record.status}
    return {"seconds": seconds} | errors


def _errors(record: Record, truth: Record, t_end: float) -> dict[str, Any]:
    """Return the errors of `WANTS`; NaN if nothing could be compared."""
    off = differences(record, truth)
    worst = {name: math.nan if error is None else error for name, error in off.errors().items()}
    t = truth.curve["t"].to_numpy()
    t = t[t <= off.covered]
    apart = [np.interp(t, run.curve["t"], run.curve["F_T"]) for run in (record, truth)]
    curve = float(np.sqrt(np.mean((apart[0] - apart[1]) ** 2))) / truth.scene.F_N
    stepped, forces = record.method.dt is not None, np.fmax(worst["start"], worst["arrest"])
    found = {
        "loading_curve": curve if truth.scene.driver.K else math.nan,
        "precursors": float(forces if np.isfinite(forces) or not stepped else worst["rupture"]),
        "stress": float(worst["stress"]),
        "front_speed": float(worst["speed_95"]) if stepped else math.nan,
    }
    covered = off.covered / float(t_end)
    return found | {"covered": covered, "events": len(record.events), "status": "ok"}


# --- reading -------------------------------------------------------------------------------------


def _named(method: Any) -> str:
    """Return a method in words."""
    if not method.share or math.isnan(method.share):
        return method.fidelity
    how = (method.fidelity, method.geometry, method.stepper, method.switching)
    return f"{' '.join(how)} {method.share:.3g}"


def report(table: pd.DataFrame) -> str:
    """Return the chart as text: methods by cost, then methods without a result."""
    lines = [
        f"errors compared with full dynamics at a small step, up to {table['t_end'].iloc[0]:.3g} s",
        "method, its step over the limit, processor time (s), and the share of the time compared",
    ]
    ran = table[table["status"].isin(["ok", "reference"])].sort_values("seconds")
    names = [
        f"{_named(row)}{' (reference)' * (row.status == 'reference')}" for row in ran.itertuples()
    ]
    shown = ran.reindex(columns=["seconds", *WANTS, "covered"]).set_axis(names)
    lines.append(shown.to_string(na_rep="-", float_format="{:.2g}".format))
    without = table[~table["status"].isin(["ok", "reference"])]
    for status, rows in without.groupby("status", sort=False):
        names = "; ".join(_named(row) for row in rows.itertuples())
        lines.append(f"no answer: {names}: {status}")
    return "\n".join(lines)


LOOKS = {
    "equilibrium": ("s", "0.4"),
    "quasistatic": ("D", "#E69F00"),
    "hybrid": ("o", "#0072B2"),
    "dynamic rk46": ("X", "#000000"),
    "dynamic rk46_waves": ("X", "#000000"),
    "dynamic imex": ("X", "#000000"),
    "dynamic rk4": ("^", "#D55E00"),
    "dynamic verlet": ("v", "#009E73"),
    "dynamic symplectic_euler": ("<", "#CC79A7"),
    "dynamic adaptive": (">", "#56B4E9"),
}
"""Engine and stepper -> marker and colour. Markers of linear geometry are hollow."""


def figure(table: pd.DataFrame) -> DataFigure:
    """Draw error over processor time, one panel for each question with a result."""
    wants = [want for want in WANTS if want in table and table[want].notna().any()]
    rows = math.ceil(max(len(wants), 1) / 2)
    fig = DataFigure(figsize=(7.2, 3.0 * rows + 0.4))
    panels = fig.subplots(rows, 2, sharex=True, squeeze=False).ravel()
    ran, shown = table[table["status"] == "ok"], {}
    for want, axes in zip(wants, panels, strict=False):
        for row in ran.itertuples():
            dynamic = f" {row.stepper}" * (row.fidelity == "dynamic")
            marker, colour = LOOKS[row.fidelity + dynamic]
            full = colour if row.geometry == "finite" or math.isnan(row.share) else "none"
            error = getattr(row, want)
            if not error > 0:  # a logarithm cannot show an error of zero
                continue
            (point,) = axes.loglog(row.seconds, error, marker, color=colour, mfc=full, ms=5)
            shown.setdefault((row.fidelity + dynamic).replace("_", " "), point)
        axes.axvline(table["seconds"].iloc[0], color="0.6", lw=0.8, ls=":")
        axes.set_title(WANTS[want], fontsize=7, loc="left")
        axes.tick_params(labelsize=7, direction="in", which="both")
    for axes in panels[len(wants) :]:
        axes.set_axis_off()
    for axes in panels[: len(wants)][-2:]:
        axes.set_xlabel("processor time (s)", fontsize=8)
        axes.tick_params(which="both", labelbottom=True, labelsize=6)
    fig.supylabel("error", fontsize=8)
    look = {"ncols": 4, "fontsize": 7, "frameon": False}
    fig.legend(shown.values(), shown, loc="outside lower center", **look)
    first = table.iloc[0]
    fig.caption = (
        f"Error over cost of every level and stepper, up to t = {first['t_end']:.3g} s. Full: "
        f"finite geometry; hollow: linear. Dotted: cost of the reference, {_named(first)}. "
        f"{(table['status'] != 'ok').sum() - 1} methods gave no answer; the table says why."
    )
    fig.tables = {"points": table}
    return fig
