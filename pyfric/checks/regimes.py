"""Regimes at the edge of the model in which methods fail, and the behaviour of pyfric there.

Each regime is a small scene, its stated behaviour, and a function that runs it and returns the
observed behaviour. `observe` makes the table of all regimes. `pyfric regimes` prints the table, and
the tests run it, too. Stated behaviour is one of

refusal   a `SceneError` before anything starts
stop      a `RunError` that names step, time and block; the record until then is kept
warning   a note in the record, with the number
switch    another method than the cheapest one, which the notes of the record name, with the reason
answer    a correct result, measured against an oracle: an exact solution, full dynamics, a budget

Source of the scenes: PRL 107, 074301 (2011), setups 1 and 2, cut to few blocks and driven faster.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd

from pyfric.core import OPEN
from pyfric.engines import RunError, default_stepper, folded, prediction_curve
from pyfric.planning import simulate
from pyfric.record import budget_error
from pyfric.scene import Scene, chain, setup1, setup2
from pyfric.signals import at_once
from pyfric.statics import StaticSolver, stability_limit
from pyfric.values import SceneError

Behaviour = Literal["refusal", "stop", "warning", "switch", "answer"]

FORCE = 1e-6
"""Largest difference of forces of events between hybrid engine and full dynamics, over F_N, in
linear geometry."""
BUDGET = 1e-6
"""Largest error of the energy budget, over the largest energy exchanged."""


class Observed(NamedTuple):
    """An observation: behaviour, text and, for an answer, a quantity with its value and limit."""

    behaviour: str
    text: str
    quantity: str = ""
    value: float = np.nan
    limit: float = np.nan


@dataclass(frozen=True)
class Regime:
    """One regime.

    Attributes:
        name: the extreme property of the scene.
        scene: function that makes the scene.
        behaviour: the stated behaviour.
        text: the stated behaviour in words.
        look: function that runs the scene and returns an `Observed`.
    """

    name: str
    scene: partial[Scene]
    behaviour: Behaviour
    text: str
    look: Callable[[Callable[[], Scene]], Observed]


# --- scenes --------------------------------------------------------------------------------------


def _scene(setup: Callable[..., Scene], small: dict[str, float], **changes: float) -> Scene:
    return setup(**small | changes)


rod = partial(_scene, setup1, {"L": 0.02, "H": 0.0125, "F_N": 400.0, "V": 0.05})
free = partial(_scene, setup2, {"L": 0.012, "H": 0.005, "F_N": 50.0, "V": 0.05})
links = partial(_scene, chain, {"L": 0.02, "V": 0.05})
cascade = partial(_scene, setup1, {}, h=7.5e-3)


def _changes(scene: partial[Scene]) -> str:
    """Return the changes of a scene in words."""
    setup, _ = scene.args
    kept = ", ".join(f"{key} = {value:g}" for key, value in scene.keywords.items())
    return f"{setup.__name__}: {kept}" if kept else setup.__name__


# --- observations --------------------------------------------------------------------------------

_run = partial(simulate, progress=False, threads=1)


def _refused(scene: Callable[[], Scene], *, field: str, **how) -> Observed:
    """Observe whether a scene is refused by an error that names a field."""
    try:
        _run(scene(), 1e-3, **how)
    except SceneError as error:
        named = [str(refusal) for refusal in error.flat() if refusal.field == field]
        return Observed("refusal", named[0]) if named else Observed("other refusal", str(error))
    return Observed("silence", "the run is complete")


def _above_limit(scene: Callable[[], Scene]) -> Observed:
    what = scene()
    limit = stability_limit(what, default_stepper(what))[0]
    return _refused(scene, field="dt", dt=1.001 * limit)


def _stopped(scene: Callable[[], Scene], *, t_end: float) -> Observed:
    """Observe whether a run stops with step, time and block, and keeps its record until then."""
    try:
        _run(scene(), t_end, fidelity="dynamic")
    except RunError as error:
        record, text = error.record, str(error)
        named = all(word in text for word in ("at step", "t = ", "block in column"))
        kept = record.final_state.step > 0 and np.isfinite(record.curve.to_numpy()).all()
        sound = folded(record.scene, record.final_state.y[:, :2]) is None
        return Observed("stop" if named and kept and sound else "something missing", text)
    return Observed("silence", "the run is complete")


def _noted(scene: Callable[[], Scene], *, note: str, t_end: float = 1e-5, **how) -> Observed:
    """Observe whether the record of a run has a note with the text `note`."""
    notes = _run(scene(), t_end, **how).notes
    found = [text for text in notes if note in text]
    return Observed("warning", found[0]) if found else Observed("silence", f"notes: {notes}")


def _moved_up(scene: Callable[[], Scene], *, t_end: float, finer: int) -> Observed:
    """Observe a change to full dynamics, with a note, and the energy budget at a finer step."""
    record = _run(scene(), t_end, verify="none")
    said = next((note for note in record.notes if "integrated like in full dynamics" in note), "")
    if record.method.engine != "dynamic" and not said:
        return Observed("silence", f"{record.method.engine}: {record.notes}")
    how = {"fidelity": "dynamic", "geometry": record.method.geometry}
    full = _run(scene(), t_end, **how, dt=record.method.dt / finer)
    error, text = budget_error(full.curve), said or "full dynamics"
    return Observed("switch", text, f"budget error at dt/{finer}", error, BUDGET)


def _same(
    scene: Callable[[], Scene], *, t_end: float, least: int = 1, opens: bool = False
) -> Observed:
    """Compare the events of the hybrid engine one by one with full dynamics."""
    how = {"geometry": "linear"}
    a = _run(scene(), t_end, fidelity="dynamic", energies=False, **how)
    # With slip weakening, slip grows before rupture, and so do errors of jumps.
    weakens = {"accuracy": 1e-8} if scene().law.weakens else {}
    b = _run(scene(), t_end, fidelity="hybrid", **weakens, **how)
    n = len(a.events)
    text = f"{n} events, dt = {a.method.dt:g} s"
    names = ("first_block", "last_block", "nucleation_block", "n_episodes")
    same = n == len(b.events) and all((a.events[x] == b.events[x]).all() for x in names)
    opened = bool((a.switches["new"] == OPEN).any())
    if not same or n < least or (opens and not opened) or not np.isfinite(a.curve).all(axis=None):
        return Observed("wrong answer", text)
    apart = [(a.events[x] - b.events[x]).abs().max() for x in ("F_T_start", "F_T_arrest")]
    quantity = "force of events, hybrid - dynamic, over F_N"
    return Observed("answer", text, quantity, float(np.nanmax(apart)) / a.scene.F_N, FORCE)


def _continuous(scene: Callable[[], Scene], *, t_end: float) -> Observed:
    """Compare dynamics without a drop of friction with slip that grows in equilibrium."""
    record = _run(scene(), t_end, fidelity="dynamic", geometry="linear", energies=False)
    curve = prediction_curve(scene()).curve
    within = (record.curve["t"] <= curve["t"].iloc[-1]).to_numpy()
    t, F_T = record.curve["t"][within], record.curve["F_T"][within]
    apart = np.abs(F_T - np.interp(t, curve["t"], curve["F_T"])).max() / record.scene.F_N
    slipped = len(np.unique(record.switches["block"]))
    quantity = "F_T, dynamics - equilibrium, over F_N"
    text = f"{slipped} of {record.scene.N_x} blocks slip, {len(record.switches['t'])} switches"
    seen = "answer" if slipped > 2 else "nothing slips"
    return Observed(seen, text, quantity, float(apart), 5e-3)


def _nothing_slips(scene: Callable[[], Scene], *, t_end: float) -> Observed:
    """Observe a driver too soft to make a block slip, for which F_T = K V t."""
    record = _run(scene(), t_end, fidelity="hybrid", geometry="linear")
    driver, curve = record.scene.driver, record.curve
    exact = driver.K * driver.V * curve["t"]
    apart = float(np.abs(curve["F_T"] - exact).max() / exact.iloc[-1])
    seen = "answer" if not len(record.events) else "something slips"
    return Observed(seen, f"to {exact.iloc[-1]:.2g} N", "F_T against K V t, relative", apart, 1e-6)


def _cascade(scene: Callable[[], Scene], *, t_end: float) -> Observed:
    """Observe whether a run records the many micro-slips by which a corner opens, and goes on."""
    record = _run(scene(), t_end, fidelity="hybrid", geometry="linear")
    ladder = _run(scene(), t_end, fidelity="quasistatic")
    steps, spared = record.counts["steps"], record.counts["steps_spared"]
    opened = int((record.switches["new"] == OPEN).sum())
    single = int((record.events["n_blocks"] == 1).sum() + record.episodes["corner"].sum())
    ends = [run.curve["F_T"].iloc[-1] / run.scene.F_N for run in (record, ladder)]
    text = (
        f"{single} single-block slips, {opened} openings, "
        f"{100 * steps / (steps + spared):.2g} % of the time integrated"
    )
    seen = "answer" if opened and single > 5 and steps < 0.2 * (steps + spared) else "no cascade"
    quantity = "F_T at the end, hybrid - quasi-static, over F_N"
    return Observed(seen, text, quantity, abs(ends[0] - ends[1]), 0.03)


def _at_once(scene: Callable[[], Scene]) -> Observed:
    """Compare the slip of a chain pulled by k_top, all blocks at one instant, with its solution.

    m u'' = tau - k_top u - mu_k p from u = u_0 at rest: u swings about u_e = (tau - mu_k p)/k_top
    and stops at 2 u_e - u_0 after half a period.
    """
    what = scene()
    top, law = what.top, what.law.static
    omega = math.sqrt(what.k_top / what.m)
    half = math.pi / omega
    dt, u_0 = half / 4000, -0.4 * top.p / what.k_top
    state = StaticSolver(what, "linear").loaded.state(what, dt)
    state.y[0, 0] = u_0
    stop = 2 * (top.tau - law.slide(top.p)) / what.k_top - u_0
    record = _run(what, 1.2 * half, initial=state, fidelity="dynamic", dt=dt)
    first = record.switches["t"][record.switches["old"] == 0]
    together = len(first) == what.N_x and (first == first[0]).all() and len(record.events) == 1
    apart = float(np.abs(record.final_state.y[0, 0] / stop - 1).max())
    text = f"{len(first)} blocks released in the same step, {len(record.events)} event"
    seen = "answer" if together else "not at once"
    return Observed(seen, text, "displacement at arrest, relative", apart, 1e-5)


def _pulled(scene: Callable[[], Scene], *, force: float, t_end: float) -> Observed:
    """Compare F_T at rest, after a sudden pull by -force F_N, with static equilibrium."""
    what, dt = scene(), 2e-7  # resolves the waves of the sudden pull
    loaded = StaticSolver(what, "linear")
    state = loaded.loaded.state(what, dt)
    state.u_drv0 -= what.d * force * what.F_N / what.driver.K
    record = _run(what, t_end, initial=state, fidelity="dynamic", geometry="linear", dt=dt)
    end = record.final_state
    static = StaticSolver(what, "linear", u_drv0=state.u_drv0)
    rest = static.solve(end.y[0, 0], what.driver.V * end.t)
    F_T = record.curve["F_T"]
    apart = abs(F_T.iloc[-1] - rest.F_T) / what.F_N
    slipped = int((np.abs(record.switches["new"]) == 1).sum())
    moved = what.d * float(np.mean(end.y[0, 0] - loaded.loaded.u[0, 0]))
    begin, last = F_T.iloc[0] / what.F_N, F_T.iloc[-1] / what.F_N
    text = (
        f"F_T/F_N from {begin:.2g} to {last:.2g}, {slipped} slips, on average {moved * 1e6:.2g} um"
    )
    fine = (
        last < 0 and budget_error(record.curve) < BUDGET and (moved < 0 if slipped else moved == 0)
    )
    seen = "answer" if fine else "wrong answer"
    return Observed(seen, text, "F_T at rest against statics, over F_N", float(apart), 1e-5)


# --- the table -----------------------------------------------------------------------------------

STATED: dict[Any, Behaviour] = {
    _refused: "refusal", _above_limit: "refusal", _stopped: "stop", _noted: "warning",
    _moved_up: "switch",
}  # fmt: skip
"""Function of a regime -> its stated behaviour; "answer" for all others."""
_same_events = "hybrid engine and full dynamics agree event by event"
_linear = {"fidelity": "hybrid", "geometry": "linear"}
_ladder = {"fidelity": "quasistatic"}

# fmt: off
REGIMES = tuple(
    Regime(name, partial(make, **changes), STATED.get(look, "answer"), text, partial(look, **how))
    for name, make, changes, text, look, how in (
        ("dt above the limit", rod, {}, "the limit is named", _above_limit, {}),
        ("k_f >> k", rod, {"k_f": 1.35e10}, f"the step falls as 1/sqrt(k_f); {_same_events}",
         _same, {"t_end": 3e-3}),
        ("eta = 0", rod, {"eta": 0.0},
         "nothing decays: full dynamics; the notes say why",
         _moved_up, {"t_end": 3e-3, "finer": 16}),
        ("eta limits dt", rod, {"eta": 300.0}, f"the step falls as 1/eta; {_same_events}",
         _same, {"t_end": 3e-3}),
        ("mu_s = mu_k", rod, {"mu_s": 0.45, "V": 2e-3},
         "slip grows with the driver; dynamics follows the equilibrium curve",
         _continuous, {"t_end": 0.03}),
        ("mu_s just above mu_k", rod, {"mu_s": 0.45 + 1e-6, "V": 2e-3}, "the same",
         _continuous, {"t_end": 0.03}),
        ("mu_s just above mu_k, quasi-static", rod, {"mu_s": 0.45 + 1e-6},
         "slip is taken as continuous, and the notes say so",
         _noted, {"note": "slip is continuous", "t_end": 3e-3, **_ladder}),
        ("mu_k = 0", free, {"mu_k": 0.0}, _same_events, _same, {"t_end": 4e-3}),
        ("lift-off", rod, {"h": 0.0125},
         f"blocks open, carry no friction, and land; {_same_events}",
         _same, {"t_end": 6e-3, "opens": True}),
        ("corner cascade", cascade, {},
         "micro-slips of the corner are recorded; forces as in the quasi-static sequence",
         _cascade, {"t_end": 0.9}),
        ("all blocks at once", links,
         {"tau": 272.0, "k_top": 1e8, "p": 400.0, "K": 1e-20, "V": 0.0},
         "released in one step, as one event; motion in closed form", _at_once, {}),
        ("all blocks at their threshold", links, {"tau": 280.0, "p": 400.0}, _same_events,
         _same, {"t_end": 1e-3}),
        ("V too high for jumps", rod, {"V": 1.0},
         "the slider is never at rest: full dynamics, and the notes say so",
         _moved_up, {"t_end": 4e-3, "finer": 4}),
        ("V too high for quasi-static states", rod, {"V": 1.0},
         "a note says that the slider does not come to rest between events",
         _noted, {"note": "does not come to rest", **_ladder}),
        ("load that folds the lattice", rod, {"F_N": 4e5}, "the block that folds is named",
         _refused, {"field": "top.F_N"}),
        ("load that folds it, linear geometry", rod, {"F_N": 4e5}, "the notes give the strain",
         _noted, {"note": "strains reach about", **_linear}),
        ("driver that folds the lattice", rod, {"V": 300.0},
         "step, time and block are named; the record before is kept", _stopped, {"t_end": 1e-3}),
        ("d_c > 0", rod, {"V": 2e-3, "d_c": 2e-7}, f"stable slip before rupture; {_same_events}",
         _same, {"t_end": 0.05, "least": 2}),
        ("d_c too short for the step", rod, {"d_c": 1e-9},
         "the notes name the step that would resolve it",
         _noted, {"note": "do not resolve weakening", **_linear}),
        ("d_c > 0, quasi-static", rod, {"V": 2e-3, "d_c": 2e-6},
         "the quasi-static sequence knows slip at mu_k only",
         _refused, {"field": "interface.d_c", **_ladder}),
        ("F_T pulls", rod, {"V": 0.0},
         "the driver's spring also pulls: the slider comes to rest where statics predicts",
         _pulled, {"force": 0.2, "t_end": 0.012}),
        ("F_T pulls the slider back", rod, {"V": 0.0},
         "blocks slip away from the slider's front; statics at the end",
         _pulled, {"force": 0.9, "t_end": 0.025}),
        ("F_N = 0", rod, {"F_N": 0.0}, "nothing would touch", _refused, {"field": "top.F_N"}),
        ("F_N = 0, chain", links, {"p": 0.0}, "nothing would touch", _refused, {"field": "top.p"}),
        ("K very large", rod, {"K": 1e11, "V": 0.02},
         f"the step falls as 1/sqrt(K); {_same_events}", _same, {"t_end": 2e-3}),
        ("K very small", rod, {"K": 1e-3}, "F_T = K V t and nothing slips",
         _nothing_slips, {"t_end": 0.01}),
        ("one row under a rod", rod, {"H": 0.0, "h": 0.0},
         "one row is a chain with prescribed forces", _refused, {"field": "slider.H"}),
        ("one row", links, {}, _same_events, _same, {"t_end": 0.02}),
        ("two rows under a rod", rod, {"H": 2.5e-3, "h": 2.5e-3}, _same_events,
         _same, {"t_end": 4e-3}),
        ("two rows", free, {"H": 1e-3, "h": 1e-3}, _same_events, _same, {"t_end": 4e-3}),
    )
)
# fmt: on
"""All regimes, in the order in which the table shows them."""


@at_once()
def observe(
    regimes: Iterable[Regime] = REGIMES, progress: Callable[[str], None] = lambda _: None
) -> pd.DataFrame:
    """Run regimes and return a table with one row for each.

    Args:
        regimes: the regimes to run.
        progress: called with the name of each regime before it runs.

    Returns:
        Columns regime, scene, stated (behaviour), text, observed (behaviour), quantity ("" if
        nothing is measured), value and limit (NaN if nothing is measured), as_stated (behaviour as
        stated and value within the limit), seconds (processor time) and says (the message of
        pyfric, or a summary of the run).
    """
    rows = []
    for regime in regimes:
        progress(regime.name)
        start = time.process_time()
        with warnings.catch_warnings(action="ignore"):
            seen = regime.look(regime.scene)
        within = seen.value <= seen.limit or not seen.quantity
        rows.append(
            {
                "regime": regime.name,
                "scene": _changes(regime.scene),
                "stated": regime.behaviour,
                "text": regime.text,
                "observed": seen.behaviour,
                "quantity": seen.quantity,
                "value": seen.value,
                "limit": seen.limit,
                "as_stated": seen.behaviour == regime.behaviour and within,
                "seconds": time.process_time() - start,
                "says": " ".join(seen.text.split()),
            }
        )
    return pd.DataFrame(rows)


def report(table: pd.DataFrame) -> str:
    """Return the table as text."""
    lines = []
    for row in table.itertuples():
        mark = "as stated" if row.as_stated else f"NOT AS STATED ({row.observed})"
        lines.append(f"{row.regime} [{row.scene}]: {row.stated}, {mark}; {row.seconds:.1f} s")
        lines.append(f"    {row.text}")
        if row.quantity:
            lines.append(f"    {row.quantity}: {row.value:.2g} (limit {row.limit:g}); {row.says}")
        else:
            lines.append(f"    {row.says}")
    lines.append(f"{int(table['as_stated'].sum())} of {len(table)} as stated")
    return "\n".join(lines)
