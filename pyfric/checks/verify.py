"""Checks of an installed package that a user can run in a minute.

Runs are compared with exact solutions, with other variants bit by bit, and with stored full
dynamics (`pyfric.checks.regression`).
"""

from __future__ import annotations

import hashlib
import math
import re
import signal
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pyfric import core
from pyfric.checks import regression
from pyfric.checks.regression import DYNAMIC, HYBRID, STEP_END, Check, Tolerances
from pyfric.paper.claims import CLAIMS, shaken
from pyfric.planning import simulate
from pyfric.record import Record
from pyfric.scene import chain, laws, setup1
from pyfric.signals import at_once

STEPS, SWITCHES = 300, 50
"""Number of steps of the runs whose bits are compared, and least number of contact switches in a
run."""
RUNS = (
    ("linear", "finite", "step_end"),
    ("linear", "linear", "located"),
    ("table", "linear", "located"),
)
"""Kind of law, geometry and switching of the runs whose bits are compared."""


class _OutOfTime(Exception):
    """The checks took longer than `LIMIT`."""


LIMIT = 50.0
"""Largest processor time of all checks together, s: five times the time measured with a correct
build. A wrong build might run without end."""
ERRORS = (RuntimeError, ValueError, ArithmeticError, ImportError, OSError, _OutOfTime)
"""Exceptions of a wrong build, which make the check fail."""


@at_once()
def verify(progress: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """Make all checks, in groups.

    Args:
        progress: function that receives the name of each group of checks before it begins.

    Returns:
        One row for each check. Columns: group, the compared results; name, value, tolerance, unit
        and why (`pyfric.checks.regression.Check`); holds; note, remarks on the group, such as
        skipped checks; seconds, wall time of the group.
    """
    rows, begin = [], time.process_time()
    for group, make in _all():
        progress(group)
        start = time.perf_counter()
        try:
            with _limited(LIMIT - (time.process_time() - begin)):
                checks, note = make()
        except ERRORS as error:
            what = f"could not be made ({type(error).__name__})"
            checks, note = [Check(what, math.nan, 0)], str(error)
        about = {"note": note, "seconds": time.perf_counter() - start}
        for check in checks:
            rows.append({"group": group, **vars(check), "holds": check.holds, **about})
    return pd.DataFrame(rows).astype({"value": float, "tolerance": float})


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """End a with block after `seconds` of processor time; only the main thread has this limit."""
    text = f"not run: all checks together may take {LIMIT:g} s of processor time"
    if seconds <= 0:
        raise _OutOfTime(text)
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(*_: Any) -> None:
        raise _OutOfTime(text)

    old = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, old)


def report(table: pd.DataFrame) -> str:
    """Return the table as text: check, value, tolerance, verdict."""
    lines, whole = [f"{'check':<66}  {'value':>9}  {'tolerance':>9}  verdict"], 0.0
    for (group, seconds, note), checks in table.groupby(["group", "seconds", "note"], sort=False):
        whole += seconds
        lines += ["", f"{group} ({seconds:.1f} s)"]
        for check in checks.itertuples():
            name = f"  {check.name}" + (f" ({check.unit})" if check.unit else "")
            verdict = "holds" if check.holds else "FAILS"
            lines.append(f"{name:<66}  {check.value:>9.2g}  {check.tolerance:>9.2g}  {verdict}")
        lines += [f"  note: {note}"] if note else []
    failed, count = int((~table["holds"]).sum()), len(table)
    last = f"all {count} checks hold" if not failed else f"{failed} of {count} FAIL"
    return "\n".join([*lines, "", f"{last} ({whole:.0f} s)"])


Made = tuple[list[Check], str]


def _all() -> Iterator[tuple[str, Callable[[], Made]]]:
    yield "build", _build
    yield "bits of a short run with slip", _bits
    yield "exact answers", _exact
    for name in ("fig1_linear", "run1_linear", "setup2_linear", "fig1_finite"):
        made = partial(_stored, name, regression.hybrid, HYBRID)
        yield f"{name}: hybrid engine against stored full dynamics", made
    at_ends = partial(regression.hybrid, switching="step_end")
    made = partial(_stored, "fig1_linear", at_ends, {"linear": STEP_END})
    yield "fig1_linear: switching at step ends", made
    for event in (5, 37):  # a short and a long event
        made = partial(_stored, "fig1_linear", partial(regression.dynamic, event=event), DYNAMIC)
        yield f"fig1_linear: full dynamics of event {event}, from a hybrid state before it", made
    yield "fig1_linear: quasi-static sequence", _ladder


def _build() -> Made:
    checks, notes = [], []
    for name, runs in core.variants().items():
        if not runs:
            continue
        build = core.build_info(name)
        unsafe = {"-ffast-math", "-Ofast", "-funsafe-math-optimizations", "-ffp-contract=fast"}
        wrong = len(unsafe & set(build["flags"].split()))
        known = re.search("GCC|flang", build["compiler"])
        wrong += bool(known) and "-ffp-contract=off" not in build["flags"].split()
        checks.append(Check(f"variant {name}: flags that change sums", wrong, 0))
        notes.append(f"{name}: {build['compiler']}, OpenMP {'on' if build['openmp'] else 'off'}")
    return checks, "; ".join([f"in use: {core.VARIANT}", *notes, *core.lacks()])


def _bits() -> Made:
    """Compare all variants, numbers of threads and two halves with a usual run, bit by bit."""
    checks, skipped = (
        [],
        [f"{n} (not on this processor)" for n, r in core.variants().items() if not r],
    )
    others = {f"variant {n}, 1 thread": (n, 1) for n, r in core.variants().items() if r}
    if core.build_info()["openmp"]:
        others |= {f"variant {core.VARIANT}, {n} threads": (core.VARIANT, n) for n in (2, 4)}
    else:
        skipped.append("2 and 4 threads (built without OpenMP)")
    others |= {"saved and continued": (core.VARIANT, 1, True)}
    switches = []
    for law, geometry, switching in RUNS:
        run = partial(digest, law, geometry, switching)
        first, n = run(core.VARIANT, 1)
        switches.append(n)
        how = f"{geometry}, {switching.replace('_', ' ')}, law {law!r}"
        for name, other in others.items():
            checks.append(Check(f"{name}, {how}: other bits", run(*other)[0] != first, 0))
    checks.append(
        Check(f"runs with fewer than {SWITCHES} switches", sum(n < SWITCHES for n in switches), 0)
    )
    return checks, f"skipped: {', '.join(skipped)}" if skipped else ""


def digest(
    law: str,
    geometry: str,
    switching: str,
    variant: str,
    threads: int,
    halves: bool = False,
) -> tuple[str, int]:
    """Return a checksum of all results of a short run, and its number of contact switches.

    The loaded slider is shaken, at 20 m/s, so that its blocks slip at once. In `halves`, the state
    is saved and loaded after half of the steps.
    """
    kind = laws.KINDS[law]
    scene = setup1(L=0.05, H=0.025).replace({"interface.law": kind(**kind.example)})
    state, log = shaken(scene, geometry, 4e-7, 20.0), core.Log(scene.N_x)
    model = core.model(scene, geometry, state.u_drv0)
    how = {"switching": switching, "variant": variant, "threads": threads}
    logged, switches = defaultdict(list), 0
    for stop in (STEPS // 2, STEPS) if halves else (STEPS,):
        if state.step:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "state.npz"
                state.save(path)
                state = core.State.load(path)
        while state.step < stop:
            status = core.advance(model, state, log, stop - state.step, **how)
            if status not in (core.Status.DONE, core.Status.LOG_FULL):
                raise RuntimeError(f"{geometry} geometry, variant {variant}: {status.name}")
            for kind, table in (("switch", log.switches()), ("quiet", log.quiet())):
                for name, values in table.items():
                    logged[kind, name].append(values.copy())
            switches += log.n_switch
    content = hashlib.sha256()
    for values in logged.values():
        content.update(np.concatenate(values).tobytes())
    for values in (state.y, state.rod, state.mode, state.heat, state.loss, state.t_0):
        content.update(values.tobytes())
    return content.hexdigest(), switches


def _exact() -> Made:
    """Check the claims E1, E3, E4, E7, E8 and E9, and the heat of weakening, by exact answers."""
    numbers = ("E1", "E3", "E4", "E7", "E8", "E9")
    found = [(claim, claim.band) for number in numbers for claim in CLAIMS[number]({})]
    checks = [
        Check(claim.text, claim.value, band.high, band.unit, band.source) for claim, band in found
    ]
    text = "heat above mu_k p, of a chain whose friction weakens over d_c"
    source = "(mu_s - mu_k) p d_c (1 - (1 - slip/d_c)^2)/2 of a block"
    return [*checks, Check(text, _weakening(), 1e-4, "relative", source)], ""


def _weakening() -> float:
    """Return the relative error of the heat by which friction weakens, over three events."""
    scene = chain(L=0.02, d_c=1e-6, V=0.05)
    run = simulate(scene, 12e-3, fidelity="dynamic", switching="located", progress=False)
    mean, episodes = scene.law.static.mean, run.episodes
    left = 1 - np.minimum(np.abs(episodes["slip"]) / mean.d_c, 1.0)
    heat = (mean.mu_s - mean.mu_k) * episodes["p_start"] * mean.d_c * (1 - left**2) / 2
    return abs(run.curve["weakening_heat"].iloc[-1] / heat.sum() - 1)


def _stored(
    name: str, run: Callable[[regression.Reference], Record], within: dict[str, Tolerances]
) -> Made:
    """Compare a run of a stored scene with the stored reference."""
    known = regression.load(name)
    allowed = within[known.about["geometry"]]
    return regression.compare(known, run(known), allowed), allowed.why


def _ladder() -> Made:
    known = regression.load("fig1_linear")
    return regression.ladder(known, regression.quasistatic(known), 2), ""
