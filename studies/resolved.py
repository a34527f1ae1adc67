"""Fig. 4(b) with a resolved cohesive zone: does the prestress set the speed of fronts?

The events are the last `LAST` precursors of runs 1 to 4 (l = 1.25 mm, d_c = 1 um). Each event is
run with three values of d_c, and with the paper's viscosity and little viscosity. With d_c > 0
stable slip lasts for tens of milliseconds before a front runs, and loading continues. So each front
starts from the slip just before the event, with the driver at its position when the front begins in
the run (`finer.held`). The static tractions of this state are the prestress. Then a fully weakened
crack over blocks 1 to a is released at once. Tractions, a, time and geometry are the same for all
variants of an event.

This rule was fixed before the runs, when no share was known. Pilot runs of the last precursor of
run 1 chose d_c, l and the time of runs.

Crack      a is `BEGIN` times the shortest length at which the energy release of static states
           exceeds the fracture energy at the largest d_c on three successive blocks (of 1.25 mm).
Lattice    l = `SPACING` d_c/um (twice that in run 4, whose zone is twice as long), about eleven
           blocks in X_c0 at p = F_N/N_x.
End        A run ends one transit of a shear wave along the slider after the release.
Places     Places are 1.25 mm apart. v_c is 2.5 mm over the time between passages 1.25 mm before and
           behind a place. v_c is defined where times of passage increase over this stretch.
Cut ends   A place counts if it is X_c0 (at p = F_N/N_x) or more from the end of the released crack
           and from the first block that the front does not pass.
Zone       Blocks between the tip, when it passes a place, and the nearest block behind it that has
           slipped by d_c. A variant is resolved if half of its places or more have `RESOLVED`
           blocks or more in the zone.
Shares     Shares of the variance of ln v_c as in claim 13 (`pyfric.paper.claims.shares`), with a
           bootstrap over events, and shares in synthetic speeds that depend on the position along
           the front alone. Both are computed for all places of a variant, and for the places that
           all variants of an event have.
Verdict    The verdict is on resolved variants with little viscosity, on all of their places. A
           variant keeps the collapse if the lower end of the share of the prestress exceeds 0.5 and
           the upper end for synthetic speeds. A variant loses the collapse if the upper end of its
           share is below 0.5, or its value is below the upper end for synthetic speeds. Otherwise
           the data are inconclusive. The paper's collapse survives if all three variants keep it,
           and does not survive if all three lose it.

The study also gives the share that G/Gamma explains, the ratio of energy release in static states
to fracture energy.

Source: PRL 107, 074301 (2011), Fig. 4; L. B. Freund, Dynamic Fracture Mechanics (1990).
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from finer import held, moved
from fronts import COLLAPSE, kept, main_events
from sizes import size

from pyfric.engines import step_size
from pyfric.planning import simulate
from pyfric.record import analysis
from pyfric.record.zones import material_of, zone_at_rest
from pyfric.scene import preset
from pyfric.signals import at_once
from pyfric.values import write

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from pyfric.record import Record
    from pyfric.scene import Scene
    from pyfric.statics import Equilibrium

__all__ = ["D_C", "VISCOSITIES", "Event", "checks", "front", "study"]

L = size(1.25e-3, 5e-3)
"""Lattice constant of the runs that give the tractions, and distance between places, m."""
OF_RUNS = 1e-6
"""Slip of weakening of the runs that give the tractions, m."""
LAST = size(2, 1)
"""Number of precursors, the last of each run, that the study repeats."""
D_C = size((4e-6, 3e-6, 2e-6), (1e-6,))
"""Slip of weakening of the released cracks, m."""
SPACING = size(
    {"run1": 0.625e-3 / 3, "run2": 0.625e-3 / 3, "run3": 0.625e-3 / 3, "run4": 1.25e-3 / 3},
    {"run1": 5e-3},
)
"""Lattice constant for each um of d_c, m."""
VISCOSITIES: dict[str, dict[str, Any]] = {
    "0.001 k m, along bonds": {"damping": 1e-3, "dashpots": "along"},
    "the paper's": {},
}
"""eta^2 and kind of dashpots -> fields of the slider."""
BEGIN = 1.05
"""Length of the released crack, in units of the critical length."""
TRANSITS = 1.0
"""Time of a run, in units of L/c_S."""
SAMPLE = 5e-7
"""Time between stored points of slip, s."""
CHECKED = "run1"
"""Run whose last precursor is repeated with other settings."""


# --- one front -----------------------------------------------------------------------------------


class Event:
    """A precursor of a run: the time at which its front begins, and its static states.

    Args:
        run: the run on the coarse lattice.
        name: its preset.
        event: number of the precursor in this run.

    Attributes:
        t: time at which the front begins, s.
        G: energy release, as in `analysis.energy_release`.
    """

    def __init__(self, run: Record, name: str, event: int) -> None:
        self.run, self.name, self.event = run, name, event
        self.t = float(np.nanmin(run.rupture_times[run.row(event)]))
        self.G = analysis.energy_release(run, event)
        self._held: tuple[float, Any] = (0.0, None)

    def scene(self, d_c: float, viscosity: str, l: float | None) -> Scene:
        """Return the scene with d_c (m), one of `VISCOSITIES`, and l (m) or that of the rule."""
        l = SPACING[self.name] * d_c / 1e-6 if l is None else l
        return preset(self.name, l=l, d_c=d_c, **VISCOSITIES[viscosity])

    def held(self, scene: Scene) -> Callable[[float], Equilibrium]:
        """Return states of rest of a scene (`finer.held`), which depend on l alone."""
        if self._held[0] != scene.slider.l:
            self._held = scene.slider.l, held(self.run, self.event, scene)
        return self._held[1]

    @property
    def critical(self) -> float:
        """Length of the shortest crack that grows at the largest d_c, m."""
        G = self.G
        grows = (G["Gamma"] > 0) & (G["G"] > G["Gamma"] * max(D_C) / OF_RUNS)
        in_turn = grows & grows.shift(-1) & grows.shift(-2)
        return int(G["n"][in_turn].iloc[0]) * L


def front(
    event: Event,
    d_c: float,
    viscosity: str,
    *,
    l: float | None = None,
    share: float = 1.0,
    geometry: str = "linear",
    begin: float = BEGIN,
) -> pd.DataFrame:
    """Return a front of an event, on places along the interface.

    Args:
        event: the precursor.
        d_c: slip of weakening, m.
        viscosity: one of `VISCOSITIES`.
        l: lattice constant, m; None means that of the rule.
        share: step, in units of the usual step.
        geometry: "linear" or "finite".
        begin: length of the released crack, in units of the critical length.

    Returns:
        One row for each place that the front passes. Columns: x (m) from the trailing edge; t (s)
        since the release; v_c (m/s), NaN where times do not increase; scaled, the scaled prestress;
        zone, measured blocks; X_c0_over_l; release, G/Gamma; inside, whether the place counts; v_R
        and v_L, v_c over c_R and c_L; reached (m), the length of the front; seconds of the run.
    """
    scene, t = event.scene(d_c, viscosity, l), event.t
    l, at = scene.slider.l, event.held(scene)
    dt = min(step_size(event.scene(d_c, one, l)) for one in VISCOSITIES)
    state = moved(at, scene, t, share * dt)
    first = int(np.ceil(begin * event.critical / l))
    state.mode[:first], state.s_0[:first] = scene.d, 2 * d_c - scene.d * state.y[0, 0, :first]
    material = material_of(scene)
    how: dict[str, Any] = {"fidelity": "dynamic", "switching": "located", "energies": False}
    how |= {"geometry": geometry, "t_gap": 1e3, "sample": SAMPLE, "threshold": 1e-3}
    how |= {"initial": state, "dt": state.dt, "progress": False, "threads": 1}
    record = simulate(scene, t + TRANSITS * scene.slider.L / material.c_S, **how)
    passed = record.rupture_times[0] - t
    reached = int(np.argmax(np.append(np.isnan(passed[first:]), True))) + first
    rest, before = _at_rest(scene), at(t)
    table = _places(passed, reached, l)
    x, own = table["x"].to_numpy(), np.arange(scene.N_x) * l
    pressed = np.where(before.p > 0, before.p, np.nan)
    ratio = (scene.d * before.tau / pressed - scene.law.static.slide(1.0)) / scene.law.static.drop
    G, coarse = event.G, event.G["n"].to_numpy() * L - L
    return table.assign(
        scaled=np.interp(x, own, ratio),
        zone=np.interp(x, own, _zones(record, first, reached, d_c)),
        X_c0_over_l=np.interp(x, own, zone_at_rest(scene, before.p)),
        release=np.interp(x, coarse, (G["G"] / G["Gamma"]).to_numpy()) * OF_RUNS / d_c,
        inside=(x >= (first - 1) * l + rest) & (x <= reached * l - rest),
        v_R=table["v_c"] / material.c_R,
        v_L=table["v_c"] / material.c_P,
        reached=reached * l,
        seconds=record.timings["stepping"],
    )


def _at_rest(scene: Scene) -> float:
    """Return X_c0 at p = F_N/N_x, m."""
    return float(zone_at_rest(scene, np.array([scene.F_N / scene.N_x]))[0]) * scene.slider.l


def _places(passed: np.ndarray, reached: int, l: float) -> pd.DataFrame:
    """Return times of passage and speeds on places `L` apart, up to the end of the front."""
    own = np.arange(len(passed)) * l
    x = np.arange(int(own[reached - 1] / L + 1e-9) + 1) * L
    t = np.interp(x, own[:reached], passed[:reached])
    rises = np.append(np.diff(passed[:reached]) > 0, False)
    begin, end = np.rint((x - L) / l).astype(int), np.rint((x + L) / l).astype(int)
    v_c = np.full(x.shape, np.nan)
    for n, (a, b) in enumerate(zip(begin, end, strict=True)):
        if a >= 0 and b < reached and rises[a:b].all():
            v_c[n] = 2 * L / (np.interp(x[n] + L, own, passed) - np.interp(x[n] - L, own, passed))
    return pd.DataFrame({"x": x, "t": t, "v_c": v_c})


def _zones(record: Record, first: int, reached: int, d_c: float) -> np.ndarray:
    """Return the blocks in the zone when the tip is at each block, NaN beyond the front."""
    times = record.curve["t"].to_numpy()
    slip = record.scene.d * (record.motion["u_x"] - record.motion["u_x"][0])
    full = np.full(record.scene.N_x, np.inf)
    full[:first] = -np.inf
    for i in range(first, reached):
        if (after := np.flatnonzero(slip[:, i] >= d_c)).size:
            k = after[0]
            part = (d_c - slip[k - 1, i]) / (slip[k, i] - slip[k - 1, i])
            full[i] = times[k - 1] + part * (times[k] - times[k - 1])
    blocks = np.full(record.scene.N_x, np.nan)
    for i, t in enumerate(record.rupture_times[0][:reached]):
        if i >= first:
            blocks[i] = i - np.flatnonzero(full[:i] <= t)[-1]
    return blocks


# --- all of them ---------------------------------------------------------------------------------


@at_once()
def study(
    runs: Path,
    names: Sequence[str] = tuple(SPACING),
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Return the fronts: scene, event, d_c (m), viscosity, and the columns of `front`.

    Args:
        runs: folder in which runs and fronts are kept; it is made if missing.
        names: some of the runs 1 to 4.
        say: called with the name of the next run.
    """
    return pd.concat(_fronts(runs, names, say), ignore_index=True)


def _fronts(runs: Path, names: Sequence[str], say: Callable[[str], None]) -> Iterator[pd.DataFrame]:
    runs.mkdir(parents=True, exist_ok=True)
    for name in names:
        say(f"{name}, l = {L * 1e3:g} mm")
        run = kept(_path(runs, name), preset(name, l=L, d_c=OF_RUNS), COLLAPSE[name])
        for event in main_events(run)[-LAST:].tolist():
            one = Event(run, name, event)
            for d_c in D_C:
                for viscosity in VISCOSITIES:
                    about = {"scene": name, "event": event, "d_c": d_c, "viscosity": viscosity}
                    say(", ".join(map(str, about.values())))
                    file = f"resolved_{name}_{event}_{d_c * 1e6:g}_{viscosity[:3].strip()}.csv"
                    make = functools.partial(front, one, d_c, viscosity)
                    yield kept_table(runs / file, make).assign(**about)


def _path(runs: Path, name: str) -> Path:
    """Return the file of a run on the coarse lattice."""
    return runs / f"{name}_{L * 1e3:g}_{OF_RUNS * 1e6:g}.nc"


def kept_table(path: Path, make: Callable[[], pd.DataFrame]) -> pd.DataFrame:
    """Return a table to six digits, from its file if the file exists."""
    if not path.is_file():
        write(path, make().to_csv(index=False).encode())
    return pd.read_csv(path).map(lambda one: float(f"{one:.6g}") if isinstance(one, float) else one)


@at_once()
def checks(runs: Path, say: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """Return changes of one front's speeds with settings, for little viscosity and the largest d_c.

    Args:
        runs: folder of `study` with its runs.
        say: called with the name of the next run.

    Returns:
        One row for each change: case; points, places that count in both fronts; median and rms of
        the change of ln v_c; median_change, with its sign; reached, the change of the length over
        L. The last row compares the spontaneous front on the coarse lattice with a front that is
        released on the same lattice.
    """
    name, L_x = CHECKED, preset(CHECKED).slider.L
    run = kept(_path(runs, name), preset(name, l=L, d_c=OF_RUNS), COLLAPSE[name])
    event, viscosity = Event(run, name, int(main_events(run)[-1])), next(iter(VISCOSITIES))
    largest = max(D_C)
    cases: dict[str, dict[str, Any]] = {
        "the rule": {},
        "half the step": {"share": 0.5},
        "half of l": {"l": SPACING[name] * largest / 2e-6},
        "finite geometry": {"geometry": "finite"},
        "longer crack": {"begin": 1.5 * BEGIN},
    }
    tables = {}
    for case, how in cases.items():
        say(case)
        make = functools.partial(front, event, largest, viscosity, **how)
        tables[case] = kept_table(runs / f"resolved_check_{case.replace(' ', '_')}.csv", make)
    rows = [_change(case, table, tables["the rule"], L_x) for case, table in tables.items()]
    say("a front that is released, and one that began by itself")
    released = front(event, OF_RUNS, "the paper's", l=L)
    passed = run.rupture_times[run.row(event.event)] - event.t
    begun = np.where(np.isnan(passed), 0.0, passed)  # after stable slip
    reached = int(np.flatnonzero(np.isfinite(passed))[-1]) + 1
    natural = _places(begun, reached, L).assign(reached=reached * L)
    rows.append(_change("began by itself", natural, released, L_x))
    return pd.DataFrame(rows[1:])


def _change(case: str, table: pd.DataFrame, other: pd.DataFrame, L_x: float) -> dict[str, Any]:
    """Return the differences of ln v_c and of length between two fronts."""
    kept_there = other[other["inside"] & other["v_c"].notna()]
    both = kept_there.assign(key=(kept_there["x"] / L).round()).merge(
        table.assign(key=(table["x"] / L).round()), on="key", suffixes=("", "_new")
    )
    change = np.log(both["v_c_new"] / both["v_c"]).dropna()
    row = {"case": case, "points": len(change), "median": change.abs().median()}
    row |= {"rms": float(np.sqrt(np.mean(change**2))), "median_change": change.median()}
    return row | {"reached": (table["reached"].iloc[0] - other["reached"].iloc[0]) / L_x}
