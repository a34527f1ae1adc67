"""Prices of operations, their times (`pyfric.engines.cost`), measured again on this machine.

Runs of many kinds are timed. Their expected work is linear in the prices, and in the inverse of
FLOPS. Least squares of the relative errors then give each price, to compare with the stored price.
A price that hardly contributes to any run stays near the stored price.
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from sizes import size

import pyfric
from pyfric.engines import cost, step_size
from pyfric.scene import preset, setup1

if TYPE_CHECKING:
    from pyfric.record import Record
    from pyfric.scene import Scene

PRICES = (
    *("EVALUATION", "BOTTOM", "BLOCK", "CLOSED", "JUNCTION", "CALL", "ATTEMPT", "LANDING"),
    *("SLIDE", "RUN", "RATED", "SLOW_STEP", "RELEASE", "STATIC_EVENT", "UNKNOWN", "MODES", "FLOPS"),
)
RATE = "FLOPS"
"""Price in operations per time; all other prices are times."""
SMALL = 1e-3
"""Relative change of a price that shows its contribution."""
HELD = 0.05
"""Weight of relative distances from stored prices, against relative errors of runs."""
REPEATS, SHARE, EVERY = size((3, 1.0, 1), (1, 0.02, 5))
"""Repeats of a run, part of its time that is run, and interval between the runs that are made."""


class Case(NamedTuple):
    """A run to be timed."""

    scene: Scene
    t_end: float
    engine: str
    geometry: str
    more: dict[str, Any]

    def run(self) -> Record:
        """Make the run on one thread."""
        fixed = {"fidelity": self.engine, "energies": False, "progress": False, "threads": 1}
        if self.engine != "quasistatic":
            fixed["geometry"] = self.geometry
        return pyfric.simulate(self.scene, SHARE * self.t_end, **(fixed | self.more))


def cases() -> list[Case]:
    """Return the runs that are timed, for all scenes, engines and options of the study."""
    small = setup1(L=0.02, H=0.0125, F_N=400.0, V=2e-3)
    scenes = [
        (small, 0.12),
        (preset("fig1", l=5e-3), 0.3),
        (preset("fig1"), 0.3),
        (preset("fig1", l=1.25e-3), 0.1),
        (preset("setup2", l=2e-3), 0.3),
        (preset("setup2"), 0.3),
    ]
    found = [Case(one, t, "quasistatic", "linear", {}) for one, t in scenes]
    for geometry in ("linear", "finite"):
        found += [Case(one, t, "hybrid", geometry, {}) for one, t in scenes]
        for one, _ in scenes:  # each takes some 0.2 s
            steps = 2e8 / (24 * one.N_x * one.N_z + 5e3)
            found.append(Case(one, steps * step_size(one), "dynamic", geometry, {}))
    heavy, slow, creeping = preset("fig1", F_N=4e4), preset("slow"), small.replace({"d_c": 5e-6})
    found += [
        Case(heavy, 2e-3, "dynamic", "finite", {}),
        Case(slow, 2e-3, "dynamic", "finite", {}),
        Case(creeping, 0.12, "hybrid", "linear", {}),
        Case(preset("fig1", l=1.25e-3, d_c=1e-6), 0.26, "hybrid", "linear", {}),
        Case(small, 0.02, "dynamic", "linear", {"stop_when": "reached = 20 mm"}),
        Case(small, 1e-4, "dynamic", "linear", {}),
        Case(preset("fig1", l=0.625e-3), 0.02, "hybrid", "linear", {}),
    ]
    rated, rod = preset("rate_and_state"), preset("rate_and_state", l=5e-3)
    for one in (rated, rod):
        found.append(Case(one, 3e-3, "dynamic", "linear", {}))
        found.append(Case(one, 0.8, "hybrid", "linear", {"accuracy": 1e-3}))
    return found


def expected(case: Case, record: Record) -> float:
    """Return the expected work of a run, in s."""
    counts = dict(record.counts)
    if case.engine == "dynamic":
        options = pyfric.Options(stop_when=case.more.get("stop_when"))
        counts["calls"] = min(options.calls_on(case.scene), counts["steps"])
    made = cost.RUN + cost.work(case.scene, case.geometry, counts)
    if case.engine == "quasistatic":
        made += cost.set_up(case.scene, case.engine, case.geometry).work
    return made


def scaled(price: Any, factor: float) -> Any:
    """Return a price, or a collection of prices, multiplied by a factor."""
    if isinstance(price, dict):
        return {name: scaled(one, factor) for name, one in price.items()}
    if isinstance(price, tuple):
        return tuple(scaled(one, factor) for one in price)
    return factor * price


def shares(case: Case, record: Record) -> np.ndarray:
    """Return the work that each price contributes to a run, in s."""
    found, before = [], expected(case, record)
    for name in PRICES:
        price = getattr(cost, name)
        setattr(cost, name, scaled(price, 1 / (1 + SMALL) if name == RATE else 1 + SMALL))
        cost.prices.cache_clear()
        found.append((expected(case, record) - before) / SMALL)
        setattr(cost, name, price)
        cost.prices.cache_clear()
    return np.array(found)


def measured(*, progress: bool = False) -> pd.DataFrame:
    """Return measured over stored prices, and the largest share of each in the time of a run."""
    rows, taken = [], []
    for case in cases()[::EVERY]:
        seconds = []
        for _ in range(REPEATS):
            start = time.process_time()
            record = case.run()
            seconds.append(time.process_time() - start)
        rows.append(shares(case, record))
        taken.append(min(seconds) / cost.machine_speed())
        if progress:
            ratio = taken[-1] / expected(case, record)
            what = f"{case.scene.name}, {case.scene.N_x} x {case.scene.N_z} blocks"
            print(f"{what}, {case.engine}, {case.geometry}: {ratio:.2f}", file=sys.stderr)
    parts = np.array(rows) / np.array(taken)[:, None]
    held = HELD * np.eye(len(PRICES))
    ratio, *_ = np.linalg.lstsq(
        np.vstack([parts, held]), np.append(np.ones(len(parts)), HELD * np.ones(len(PRICES)))
    )
    return pd.DataFrame(
        {"price": PRICES, "times_stored": ratio, "largest_share": parts.max(axis=0)}
    )


def report(table: pd.DataFrame) -> str:
    """Return the table as text."""
    return table.to_string(index=False, float_format="%.2f")
