"""Changes of measured quantities of a scene with each parameter.

Each parameter is increased and decreased by its uncertainty in a good experiment. The number of
events jumps, and forces and lengths jump with it. Changes are therefore differences of runs.

J is the matrix of changes of quantities with parameters, over the errors of the quantities. A
change is half of the difference between the increased and the decreased parameter. With independent
errors, the standard error of parameter j is 1/|J_j| if all others are known. With the others free,
the standard error is the root of the j-th diagonal entry of the inverse of J'J. This error is
larger, because changes of other parameters can compensate a change of j.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from pyfric.display import Shown
from pyfric.engines import Asked, Options, has_outline, outlines
from pyfric.planning import check_run, simulate
from pyfric.record import Outline, Record, front_speed
from pyfric.scene import Number, Scene, SceneLike, as_scene, full_name, scene_fields
from pyfric.values import SceneError, check_number, usage

STEPS = {"mu_s": 0.01, "mu_k": 0.01, "F_N": "1 %", "V": "1 %", "K": "5 %", "k": "5 %"}
"""Default steps: uncertainties of parameters in a good experiment (a choice)."""
QUANTITIES = {
    "first_force": ("1", "F_T/F_N at the start of the first main event"),
    "largest_force": ("1", "largest F_T/F_N at the start of a main event"),
    "largest_drop": ("1", "largest drop of F_T/F_N in a main event"),
    "precursors": ("1", "number of precursors before the first system-size event"),
    "longest": ("1", "L_p/L of the longest of them"),
    "system_size": ("1", "number of system-size events"),
    "recurrence": ("s", "mean time between system-size events"),
    "front_speed": ("m/s", "median speed of fronts; not without dynamics"),
}
"""Quantity -> unit and meaning. A quantity that a run lacks is NaN."""
COUNTS = ("precursors", "system_size")
NOISE = 1e-3
"""Default relative error of measured forces, over F_N, and of the recurrence (a choice)."""
ROUNDED = 1e-9
"""Singular values over the largest, and components of singular vectors, that count as rounding."""


@dataclass(frozen=True, kw_only=True)
class Sensitivity(Shown):
    """Changes of measured quantities with parameters.

    Attributes:
        table: a row for each parameter and quantity, with columns parameter, value and step (SI
            units), quantity, and low, base, high: the quantity at the value minus the step, at the
            value, and at the value plus the step.
        scene: the scene.
    """

    table: pd.DataFrame
    scene: Scene

    def __str__(self) -> str:
        lines = []
        for quantity, part in self.table.groupby("quantity", sort=False):
            base = part["base"].iloc[0]
            if not np.isfinite(base):
                continue
            unit, text = QUANTITIES[str(quantity)]
            lines.append(f"{quantity} = {base:.4g}{f' {unit}' * (unit != '1')}: {text}")
            size = np.nanmax(np.abs(part[["low", "high"]].sub(base, axis=0)), axis=1)
            for row in part.assign(size=size).sort_values("size", ascending=False).itertuples():
                jump = quantity in COUNTS and row.size >= 1
                lines.append(
                    f"  {row.parameter} -/+ {row.step:.4g}: {row.low - base:+.3g}, "
                    f"{row.high - base:+.3g}" + ", a jump" * jump
                )
        lines.append(f"standard errors, forces known to {NOISE:g} F_N: alone, with the others free")
        for row in self.known().itertuples():
            alone, free = (f"{x:.2g}" if np.isfinite(x) else "unknown" for x in row[2:])
            lines.append(f"  {row.parameter}: {alone}, {free}")
        return "\n".join(lines)

    __repr__ = __str__

    def known(self, noise: float = NOISE) -> pd.DataFrame:
        """Return the standard error of each parameter that the quantities allow.

        Counts and front speeds are left out. The error of lengths is one block.

        Args:
            noise: standard error of forces over F_N, and relative standard error of the recurrence.

        Returns:
            A row for each parameter. Columns: parameter; alone, its relative standard error if it
            is the only unknown; others_free, its relative standard error if all others are unknown,
            too; inf if the quantities do not determine it.

        Raises:
            SceneError: noise is refused.
        """
        noise = check_number("noise", noise, "", gt=0.0)
        of = self.table.assign(J=(self.table["high"] - self.table["low"]) / 2 / self.table["step"])
        base = of.groupby("quantity")["base"].first()
        errors = {name: noise for name in ("first_force", "largest_force", "largest_drop")}
        errors |= {"longest": 1 / self.scene.N_x, "recurrence": noise * base["recurrence"]}
        J = of.pivot_table("J", "quantity", "parameter", sort=False).reindex(list(errors))
        J = J.div(pd.Series(errors), axis=0).dropna()
        value = of.groupby("parameter", sort=False)["value"].first().abs()
        J = J.reindex(columns=value.index).fillna(0.0).to_numpy() * value.to_numpy()
        size = np.linalg.norm(J, axis=0)
        _, s, rows = np.linalg.svd(J / np.where(size > 0, size, 1.0))
        s = np.append(s, np.zeros(len(rows) - len(s)))
        lost = s <= ROUNDED * s.max(initial=0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            alone = 1 / size
            free = np.linalg.norm(rows[~lost] / s[~lost, None], axis=0) / size
        free[(np.abs(rows[lost]) > ROUNDED).any(axis=0)] = np.inf
        return pd.DataFrame({"parameter": value.index, "alone": alone, "others_free": free})


@usage('sensitivity(scene, "1 s", {"mu_k": 0.01, "F_N": "10 N", "K": "5 %"})')
def sensitivity(
    scene: SceneLike,
    t_end: Number,
    steps: Mapping[str, float | str] | None = None,
    **options: Any,
) -> Sensitivity:
    """Return the changes of forces, lengths, counts and speeds with the parameters of a scene.

    Args:
        scene: a scene, the name of a preset, or the path of a scene file.
        t_end: end of each run, s.
        steps: name of a parameter -> its step up and down, in SI units, as text such as "10 N", or
            relative, such as "5 %". None: mu_s and mu_k by 0.01, F_N and V by 1 %, K and k by 5 %;
            parameters that the scene lacks are left out.
        options: options of the runs, as in `pyfric.simulate`; fidelity = "quasistatic" by default.

    Raises:
        SceneError: an argument is refused.
    """
    scene = as_scene(scene, {})
    t_end = check_number("t_end", t_end, "s", gt=0.0)
    options = {"fidelity": "quasistatic", "progress": False} | options
    known, rows = _steps(scene, steps), []
    ends = [{name: value + way * step} for name, (value, step) in known.items() for way in (-1, 1)]
    base, *found = _all_quantities([scene, *map(scene.replace, ends)], t_end, options)
    for n, (name, (value, step)) in enumerate(known.items()):
        for quantity, now in base.items():
            low, high = (end[quantity] for end in found[2 * n : 2 * n + 2])
            row = {"parameter": name, "value": value, "step": step, "quantity": quantity}
            rows.append(row | {"low": low, "base": now, "high": high})
    return Sensitivity(table=pd.DataFrame(rows), scene=scene)


def _steps(scene: Scene, steps: Mapping[str, float | str] | None) -> dict[str, tuple[float, float]]:
    """Return values and steps of parameters, in SI units."""
    found = {}
    if not isinstance(steps, Mapping | None):
        raise SceneError("steps", str(steps), "", 'names and steps, such as {"mu_k": 0.01}')
    for name, step in (STEPS if steps is None else steps).items():
        value = _value(scene, name)
        if not isinstance(value, float | int) or isinstance(value, bool):
            if steps is None:
                continue
            raise SceneError(
                f"steps.{name}", name, "", "names of numbers of the scene", "no number"
            )
        if isinstance(step, str):
            number, sign, rest = step.partition("%")
            if sign and not rest.strip():
                step = abs(value) * 0.01 * check_number(f"steps.{name}", number, "")
            else:
                unit = scene_fields(scene)[full_name(scene, name)].unit
                step = check_number(f"steps.{name}", step, unit, note=", or a share in %")
        found[name] = float(value), check_number(f"steps.{name}", step, "", gt=0.0)
    return found


def _value(scene: Scene, name: str) -> Any:
    """Return the value of a field by its name; None if no part, or more than one, has the field.

    A field left at None, such as k_f, has the value that the scene derives.
    """
    part, _, end = name.rpartition(".")
    parts = {"slider": scene.slider, "top": scene.top, "driver": scene.driver}
    parts["interface"] = scene.interface
    found = [
        getattr(of, end) for key, of in parts.items() if part in ("", key) and hasattr(of, end)
    ]
    if len(found) != 1:
        return None
    return getattr(scene, end, None) if found[0] is None else found[0]


def _all_quantities(
    scenes: Sequence[Scene], t_end: float, options: Mapping[str, Any]
) -> list[dict[str, float]]:
    """Return the quantities of a run of each scene."""
    rest = {name: value for name, value in options.items() if name != "progress"}
    asked = Options(**rest)
    if not all(has_outline(scene, asked) for scene in scenes):
        return [quantities(simulate(scene, t_end, **options)) for scene in scenes]
    for scene in scenes:
        check_run(scene, asked)
    found = []
    for run in outlines(Asked(scene, t_end, asked.t_gap) for scene in scenes):
        if isinstance(run, Exception):
            raise run
        found.append(_quantities(run))
    return found


def quantities(record: Record) -> dict[str, float]:
    """Return the `QUANTITIES` of a run."""
    found = _quantities(Outline.of_record(record))
    if record.method.engine != "quasistatic":
        main, scene = record.columns("events")["is_main"], record.scene
        speed = front_speed(record.rupture_times[main], scene.slider.l, scene.ahead)
        if np.isfinite(speed).any():
            found["front_speed"] = float(np.nanmedian(speed))
    return found


def _quantities(run: Outline) -> dict[str, float]:
    """Return the quantities of a run, without speeds of fronts."""
    main, events, F_N = run.events["is_main"], run.events, run.scene.F_N
    start, arrest = events["F_T_start"][main] / F_N, events["F_T_arrest"][main] / F_N
    drops = (start - arrest)[np.isfinite(arrest)]
    return {
        "first_force": run["F_first"] / F_N,
        "largest_force": float(start.max()) if len(start) else math.nan,
        "largest_drop": float(drops.max()) if len(drops) else math.nan,
        "precursors": run["n_precursors"],
        "longest": run["L_p_max"],
        "system_size": run["n_system_size"],
        "recurrence": run["recurrence"],
        "front_speed": math.nan,
    }
