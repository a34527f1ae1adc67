"""Fig. 4(b) with weakening: the same fronts on two lattices, with much viscosity and with little.

The last precursors of runs 1 to 4 with d_c = 1 um are those of whole runs at l = 1.25 mm. On each
lattice they begin from the tractions at the first slip (`finer`). Slip then grows stably, for up to
50 ms, and the driver goes on: what the front meets is not what the first slip met. So the state
just before the front breaks out is kept, and from it four runs of full dynamics begin: d_c = 1 um
or 0, with the paper's viscosity or with eta^2 = 0.001 k m along the bonds, which `cracks` asks for.
On one lattice all four have the same prestress, that of the kept state.

How much of ln v_c the scaled prestress and the position along the front explain is measured as in
claim 13 (`pyfric.paper.claims.shares`), with a bootstrap over fronts and beside data that know the
position alone.

Source: PRL 107, 074301 (2011), Fig. 4.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from finer import refined
from matplotlib.backends.backend_agg import FigureCanvasAgg

from pyfric import core
from pyfric.core import State
from pyfric.engines import simulate, step_size
from pyfric.figures import DataFigure
from pyfric.paper.claims.shares import shares
from pyfric.record import analysis, zone_at_rest
from pyfric.scene import preset, write
from pyfric.sweeps import Job, run_all

if TYPE_CHECKING:
    from pyfric.record import Record
    from pyfric.scene import Scene

__all__ = ["CASES", "Case", "figure", "study", "summary"]

ENDS = {"run1": 0.56, "run2": 0.63, "run3": 0.7, "run4": 0.77}
"""Runs of Fig. 4(b) and their ends, s: seven tenths of the time to the first event over all."""
SOURCE = 1.25e-3
"""Lattice constant of the whole runs, m."""
SPACINGS = (1.25e-3, 0.625e-3)
"""Lattice constants on which their precursors are run again, m."""
LAST = 4
"""Precursors of each run, the last ones."""
D_C = 1e-6
"""Slip of weakening, m."""
WAIT = 3e-3, 10
"""Pieces in which a run goes on until its front breaks out, s, and how many at most."""
FRONT_BLOCKS = 8
"""Fewest blocks of a front."""
BEFORE = 5e-5
"""Time before the front at which the state is kept, s: a wave crosses a third of the slider."""
LONG = 5e-4
"""Time in which every front has passed, s."""
RESOLVED = 6
"""Blocks in the cohesive zone that resolve a front (`cracks`)."""
HYBRID = {"fidelity": "hybrid", "geometry": "linear", "switching": "located"}
QUIET = HYBRID | {"progress": False}
DYNAMIC = QUIET | {"fidelity": "dynamic", "budget": False, "t_gap": 1.0}


class Case(NamedTuple):
    """How a front is run: eta^2/(k m), what the dashpots resist, and d_c in m."""

    eta2: float
    dashpots: str
    d_c: float

    def __str__(self) -> str:
        viscosity = "paper's viscosity" if self.dashpots == "full" else "little viscosity"
        return f"d_c = {1e6 * self.d_c:g} um, {viscosity}"

    def scene(self, name: str, l: float) -> Scene:
        scene = preset(name, l=l, d_c=self.d_c)
        eta = math.sqrt(self.eta2 * scene.slider.k * scene.m)
        slider = dataclasses.replace(scene.slider, eta=eta, dashpots=self.dashpots)
        return dataclasses.replace(scene, slider=slider)


CASES = [Case(*how, d_c) for d_c in (D_C, 0.0) for how in ((0.1, "full"), (1e-3, "along"))]
PAPER = CASES[0]


def study(
    folder: Path,
    ends: dict[str, float] = ENDS,
    spacings: Sequence[float] = SPACINGS,
    last: int = LAST,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Return the speeds of all fronts: run, event, l, eta2, dashpots, d_c and those of `_front`.

    Args:
        folder: where finished runs and fronts are kept; the next call goes on from them.
        ends: run -> its end, s.
        spacings: lattice constants, m.
        last: precursors of each run.
        say: told what is being run.
    """
    tables = []
    for name, t_end in ends.items():
        say(f"{name} at l = {1e3 * SOURCE:g} mm")
        job = Job(scene=PAPER.scene(name, SOURCE), t_end=t_end, options=HYBRID)
        (source,) = run_all([job], workers=1, cache=folder, progress=False)
        whole = source.events["is_main"] & source.events["finished"]
        for event in np.flatnonzero(whole)[-last:]:
            for l in spacings:
                path = folder / f"{name}_{event}_{1e3 * l:g}.csv"
                if not path.is_file():
                    say(f"{name}, event {event}, l = {1e3 * l:g} mm")
                    table = _fronts(source, int(event), name, l)
                    write(path, table.to_csv(index=False).encode())
                tables.append(pd.read_csv(path).assign(run=name, event=event, l=l))
    return pd.concat(tables, ignore_index=True)


def _fronts(source: Record, event: int, name: str, l: float) -> pd.DataFrame:
    """Return the fronts of all cases that begin from one event of a whole run."""
    state = _before_the_front(source, event, PAPER.scene(name, l))
    return pd.concat(
        [_front(case.scene(name, l), state).assign(**case._asdict()) for case in CASES],
        ignore_index=True,
    )


def _before_the_front(source: Record, event: int, scene: Scene) -> State:
    """Return the state of a lattice just before the front of an event breaks out."""
    begin = refined(source, event, scene)
    run: Any = begin
    piece, most = WAIT
    for n in range(1, most + 1):
        t_end = float(source.events["t_stop"].iloc[event]) + n * piece
        run = simulate(scene, t_end, initial=run, dt=begin.dt, **QUIET)
        if run.events["n_front"].max() >= FRONT_BLOCKS:
            break
    front = int(run.events["n_front"].argmax())
    t_end = max(float(np.nanmin(run.rupture_times[front])) - BEFORE, begin.t + begin.dt)
    return simulate(scene, t_end, initial=begin, dt=begin.dt, **QUIET).final_state


def _front(scene: Scene, state: State) -> pd.DataFrame:
    """Return the front that runs from a state on: columns of `analysis.front`, place.

    tau_over_p and scaled are those of the state.
    """
    dt = step_size(scene)
    record = simulate(scene, state.t + LONG, initial=state, dt=dt, **DYNAMIC)
    table = analysis.front(record, int(record.events["n_front"].argmax()))
    forces = core.evaluate(core.model(scene, "linear", state.u_drv0), state, state.t)
    block = table["n"].to_numpy() - 1
    p, f = forces.p[block], forces.f[block]
    ratio = np.divide(-scene.d * f, p, out=np.full(p.shape, np.nan), where=p > 0)
    place = (table["n"] - table["n"].min()) / np.ptp(table["n"])
    return table.assign(
        tau_over_p=ratio,
        scaled=scene.law.mean.scaled(ratio),
        X_c0_over_l=zone_at_rest(scene, forces.p)[block],
        place=place,
    )


# --- what it comes to ----------------------------------------------------------------------------


def _points(table: pd.DataFrame) -> pd.DataFrame:
    """The blocks that have a speed and a prestress."""
    known = table["v_c"].notna() & table["scaled"].notna()
    front = table["run"] + " " + table["event"].astype(str)
    return table.assign(front=front)[known].reset_index(drop=True)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the numbers of each case: what, case, value, and its interval where there is one."""
    rows = []
    for (d_c, eta2, l), part in _points(table).groupby(["d_c", "eta2", "l"], sort=False):
        which = next(case for case in CASES if (case.d_c, case.eta2) == (d_c, eta2))
        case, found = f"{which}, l = {1e3 * l:g} mm", shares(part, "scaled")
        c_L = math.sqrt(1.5) * l * math.sqrt(preset("run1", l=l).slider.k / preset("run1", l=l).m)
        rows += [
            ("points", case, len(part), np.nan, np.nan),
            ("fronts", case, part["front"].nunique(), np.nan, np.nan),
            ("share of blocks with 6 or more in X_c0", case, (part["X_c0_over_l"] >= RESOLVED).mean(), np.nan, np.nan),
            ("share of blocks with 6 or more in X_c(v)", case, (part["X_c_over_l"] >= RESOLVED).mean(), np.nan, np.nan),
            ("share of v_c above c_L", case, (part["v_c"] > c_L).mean(), np.nan, np.nan),
        ]
    return pd.DataFrame(rows)
