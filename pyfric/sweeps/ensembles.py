"""Ensembles: one scene with random fields, run many times.

    found = ensemble("fig1", {"mu_s": Spread(mean=0.7, std=0.035)}, 10_000, t_end=0.9)
    found.table              # one row for each seed
    found.statistics()       # means with standard errors, quantiles
    found.record(17)         # the run of one seed as a record

An ensemble is a `Sweep` over seeds that returns numbers of its runs (`pyfric.sweeps.measures`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from pyfric.engines import Options
from pyfric.scene import Number, SceneLike, Spread, as_scene, full_name
from pyfric.signals import at_once
from pyfric.sweeps.measures import Ensemble
from pyfric.sweeps.store import Cache
from pyfric.sweeps.sweep import Sweep
from pyfric.sweeps.varied import MAX_POINTS, Span, drawn
from pyfric.values import SceneError, check_whole


@at_once()
def ensemble(
    scene: SceneLike,
    vary: Mapping[str, Any],
    n: int,
    t_end: Number,
    *,
    columns: Sequence[str] | None = None,
    events: Sequence[str] = (),
    seed: int = 0,
    options: Options | Mapping[str, Any] | None = None,
    cache: Cache = True,
    threads: int | None = None,
    progress: bool | Callable[[int, int], None] | None = None,
) -> Ensemble:
    """Run a scene many times with random fields, and return numbers of all runs in one table.

    Args:
        scene: a scene, the name of a preset, or the path of a scene file.
        vary: name of a field -> how it varies. A `Spread` is drawn along the interface, with the
            seed of the run in place of its own. A `Span` gives each run a number in a range. A list
            gives the values of all runs.
        n: number of runs.
        t_end: time of the end, in s.
        columns: numbers of each run, names in `pyfric.RUN_COLUMNS`; None means all.
        events: columns of events, such as "F_T_start" or "n_blocks", for a table of the events of
            all runs.
        seed: seed of the first run; the next runs have the next seeds. Numbers in ranges are drawn
            with this seed, too.
        options: options of all runs, as in `Sweep`; None means quasi-static sequences.
        cache: as in `run_all`, for parts of the table.
        threads: largest number of threads; None means one for each processor. Results do not depend
            on threads.
        progress: as in `run_all`.

    Returns:
        The `Ensemble`. Labels of its table are the seeds.

    Raises:
        SceneError: an argument is refused, and nothing has been run.
        KeyboardInterrupt: after Ctrl-C; finished parts are kept, and the next call goes on.

    >>> scene = pyfric.setup1(L="30 mm", H="15 mm")
    >>> vary = {"mu_s": pyfric.Spread(mean=0.7, std=0.035)}
    >>> found = pyfric.ensemble(scene, vary, 8, 0.6, columns=["F_first"], cache=False)
    >>> bool(found.record(5).events["F_T_start"].iloc[0] <= found.table["F_first"][5])
    True
    """
    n, seed = check_whole("n", n, 1, MAX_POINTS), check_whole("seed", seed, 0)
    if not isinstance(vary, Mapping) or not vary:
        allowed = "a mapping from names of fields to a Spread, a Span or a list"
        raise SceneError("vary", vary, "", allowed)
    names = {full_name(as_scene(scene), name, of): of for name, of in vary.items()}
    if all(name.startswith("interface.") for name in names):
        scene = as_scene(scene)  # other values of a preset do not depend on its interface
    over: dict[str, list[Any]] = {}
    spans = {name: of for name, of in names.items() if isinstance(of, Span)}
    draws = np.array(drawn(list(spans.values()), "random", n, seed)).reshape(n, -1)
    for name, of in names.items():
        if isinstance(of, Spread):
            over[name] = [dataclasses.replace(of, seed=seed + i) for i in range(n)]
        elif name in spans:
            over[name] = draws[:, [*spans].index(name)].tolist()
        elif isinstance(of, list | tuple | np.ndarray) and len(of) == n:
            over[name] = list(of)
        else:
            raise SceneError(f"vary.{name}", of, "", f"a Spread, a Span, or a list of {n} values")
    options = {"fidelity": "quasistatic"} if options is None else options
    sweep = Sweep(scene=scene, t_end=t_end, over=over, points="list", options=options)
    how = {"columns": columns, "events": events, "cache": cache}
    found = sweep.measure(**how, threads=threads, progress=progress)
    seeds = pd.RangeIndex(seed, seed + n, name="seed")
    of_all = found.events
    if of_all is not None:
        of_all = of_all.rename(columns={"point": "seed"}).assign(seed=of_all["point"] + seed)
    seeded = [f"{name}.seed" for name, of in names.items() if isinstance(of, Spread)]
    return Ensemble(sweep, found.table.drop(columns=seeded).set_axis(seeds), of_all)
