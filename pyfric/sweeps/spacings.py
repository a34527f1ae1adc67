"""Results of a slab on lattices with different l."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from pyfric.display import Shown
from pyfric.engines import Options
from pyfric.record import Record, analysis
from pyfric.scene import Number, PrescribedLoad, Scene, SceneLike, as_scene
from pyfric.sweeps.runs import Job, JobError, run_all
from pyfric.sweeps.store import Cache
from pyfric.values import SceneError, check_whole

AT = 0.5
"""L_p/L at which forces after arrest are compared, as in Fig. 2 of the paper."""
QUANTITIES = {
    "precursors": False,
    "L_p/L of the first precursor": False,
    "F_T/F_N where it starts": False,
    f"F_T/F_N after L_p/L = {AT:g}": True,
    "F_T/F_N at onset of sliding": True,
}
"""Compared quantities, and whether they have a limit for small l if friction has no length
scale."""
WHY = (
    "Amontons-Coulomb friction has no length: stress at the corner grows as l falls. Short "
    "precursors then begin at other forces, along the same curve of length against force. Compare "
    "curves, not counts."
)


@dataclass(frozen=True)
class Resolution(Shown):
    """Results of the same slab for l and finer lattices.

    Attributes:
        table: one row for each quantity. Columns: its value at each l (m); ``change``, its relative
            change from the last l but one to the last; ``converges``, whether it has a limit for
            small l. NaN means that a run lacks the quantity.
        records: one `Record` for each l.
    """

    table: pd.DataFrame
    records: tuple[Record, ...]

    def __str__(self) -> str:
        def shown(values: pd.Series, form: str) -> list[str]:
            return [format(value, form) if math.isfinite(value) else "-" for value in values]

        table = self.table
        texts = {f"{1e3 * l:g}": shown(table[l], ".4g") for l in table.columns[:-2]}
        texts["change"] = shown(table["change"], "+.1%")
        limits = table["converges"].map({True: "yes", False: "no"})
        texts["converges"] = limits.where(np.isfinite(table["change"]), "-")
        text = pd.DataFrame(texts, index=table.index).rename_axis(columns="l (mm)").to_string()
        return "\n".join([text, "", *self.notes])

    __repr__ = __str__

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on engine, viscosity, counts that depend on l, and runs that ended early."""
        record = self.records[0]
        engine = record.method.engine
        notes = [f"engine: {engine}; {_viscosity(record)}"]
        if record.scene.law.weakens:
            notes.append("Where l resolves the cohesive zone of fronts (X_c/l), counts converge.")
        else:
            notes.append(WHY)
        for record in self.records:
            if analysis.system_size_events(record).empty:
                t, l = record.curve["t"].iloc[-1], record.scene.slider.l
                notes.append(f"l = {l * 1e3:g} mm: no system-size event before t = {t:g} s")
        return tuple(notes)


def _viscosity(record: Record) -> str:
    """Return a note on the change of viscosity with l."""
    if record.method.engine == "quasistatic":
        return "static states, in which viscosity plays no part"
    slider = record.scene.slider
    if slider.eta is not None:
        return f"eta = {slider.eta:.4g} N s/m at every l: the viscosity of the bulk stays"
    share = 0.1 if slider.damping is None else slider.damping
    return f"eta = sqrt({share:g} k m): the viscosity of the bulk falls with l"


def resolve(
    scene: SceneLike,
    t_end: Number = 3.0,
    *,
    levels: int = 2,
    options: Options | Mapping[str, Any] | None = None,
    workers: int | None = None,
    cache: Cache = True,
    progress: bool | None = None,
) -> Resolution:
    """Return the results of a slab with blocks of l, l/2, l/4 and so on.

    Size, stiffness k, mass, loads and driver stay the same, and so do k_f of each block and a given
    eta. alpha of each block falls. Fields that vary along the interface are interpolated. Each run
    goes on to its first system-size event.

    Args:
        scene: a scene, the name of a preset, or the path of a scene file.
        t_end: latest end time, in s.
        levels: number of lattices, 2 to 5.
        options: see `pyfric.Job`; None means fidelity = "quasistatic".
        workers, cache, progress: see `pyfric.run_all`.

    Raises:
        SceneError: an argument is refused, the interface is prescribed, or an engine refuses the
            scene; the quasi-static sequence has no friction that depends on time or speed.
        JobError: a run failed.

    >>> found = pyfric.resolve("fig1", workers=1, cache=False, progress=False)
    >>> print(*found.table.loc["precursors"])  # at l, at l/2, change, whether it converges
    14.0 14.0 0.0 False
    """
    scene = as_scene(scene)
    if isinstance(scene.top, PrescribedLoad):
        reason = "forces on single blocks are defined for one l only"
        raise SceneError("top.kind", scene.top.kind, "", "'rod' or 'distributed'", reason)
    levels = check_whole("levels", levels, 2, 5)
    options = {"fidelity": "quasistatic"} if options is None else options
    given = Job(scene=scene, t_end=t_end, options=options).options.given()
    how = {"stop_when": "system_size"} | given
    jobs = [Job(scene=_finer(scene, 2**n), t_end=t_end, options=how) for n in range(levels)]
    try:
        records = run_all(jobs, workers=workers, cache=cache, progress=progress)
    except JobError as error:
        if isinstance(error.error, SceneError):
            raise error.error from None
        raise
    columns = {record.scene.slider.l: _measured(record) for record in records}
    table = pd.DataFrame(columns, index=list(QUANTITIES))
    before, last = (table.iloc[:, n] for n in (-2, -1))
    limits = [known or bool(scene.law.weakens) for known in QUANTITIES.values()]
    table = table.assign(change=(last - before) / before, converges=limits)
    return Resolution(table, tuple(records))


def _finer(scene: Scene, n: int) -> Scene:
    """Return the scene with blocks of l/n."""
    if n == 1:
        return scene
    slider = dataclasses.replace(scene.slider, l=scene.slider.l / n)
    return dataclasses.replace(scene, slider=slider, interface=scene.interface_on(slider.N_x))


def _measured(record: Record) -> list[float]:
    """Return the `QUANTITIES` of a record."""
    found, sliding = analysis.precursor_lengths(record), analysis.system_size_events(record)
    L_p, force = (found[name].to_numpy() for name in ("L_p_over_L", "force"))
    order = np.argsort(L_p, kind="stable")
    among = len(L_p) > 1 and L_p.min() <= AT <= L_p.max()
    return [
        float(len(found)),
        float(L_p[0]) if len(L_p) else np.nan,
        _start(record, int(found["event"].iloc[0])) if len(L_p) else np.nan,
        float(np.interp(AT, L_p[order], force[order])) if among else np.nan,
        _start(record, int(sliding["event"].iloc[0])) if len(sliding) else np.nan,
    ]


def _start(record: Record, event: int) -> float:
    """Return F_T/F_N at which an event starts."""
    return float(record.events["F_T_start"].loc[event] / record.scene.F_N)
