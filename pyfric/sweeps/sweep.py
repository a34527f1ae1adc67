"""Many runs: independent scenes side by side, and finished runs kept by content.

    jobs = [Job(scene=preset("fig1", h=h), t_end=0.9) for h in (2.5e-3, 5e-3, 10e-3)]
    records = run_all(jobs)

A complete run is kept as a record file whose name is a hash of all that determines it: the scene
(its name aside), the time of the end, the options of `pyfric.simulate` and the code itself; see
`pyfric.sweeps.store`. In pyfric's own folder, but not in one that the user names, the
records that were used least recently go when it outgrows `MAX_BYTES`. Why a run failed is noted.
Processes and machines may share the folder: who makes a run reserves it there.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import os
import secrets
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
import scipy

from pyfric import core
from pyfric.engines import Options, jobs_bar, simulate
from pyfric.record import Record
from pyfric.scene import (
    Scene,
    SceneError,
    __version__,
    as_scene,
    at_once,
    check_number,
    saved_first,
    unknown,
)
from pyfric.sweeps.reservation import clear, give_up, given_up, reserved
from pyfric.sweeps.store import MAX_BYTES, cache_folder, keep, kept, note_failure, own, prune
from pyfric.sweeps.workers import Workers, stopping

__all__ = ["Job", "JobError", "each", "run_all", "side_by_side"]

T = TypeVar("T")

POLL = 0.05
"""Time between two looks at the runs of others, s."""
MOST_LOST = 10
"""An executor is given a job that it lost again at most so often."""
ELSEWHERE = ("threads", "checkpoint", "checkpoint_every")
"""Options that do not change what a run gives; jobs leave them to `run_all`."""
OPTIONS = [one.name for one in dataclasses.fields(Options) if one.name not in ELSEWHERE]
"""Options that a job may have."""
ROOMS = ("scene", "theory", "core", "statics", "record", "engines")
"""Rooms whose code determines what a run gives."""


class JobError(RuntimeError):
    """A run failed.

    Attributes:
        job: its job.
        error: what went wrong; a `RunError` has the record until then.
    """

    def __init__(self, job: Job, error: Exception) -> None:
        super().__init__(job, error)
        self.job, self.error = job, error

    def __str__(self) -> str:
        return f"{self.job}: {type(self.error).__name__}: {self.error}"


@dataclass(frozen=True, kw_only=True)
class Job:
    """One run: what `pyfric.simulate` is called with.

    Args:
        scene: what is simulated: a scene, the name of a preset, or the path of a scene file, which
            is read once, here.
        t_end: time of the end, in s.
        options: an `Options`, or a mapping of names among `OPTIONS` to values, which becomes one.

    Raises:
        SceneError: a value is refused, or an option is unknown.
    """

    scene: Scene
    t_end: float
    options: Options = field(default_factory=Options)

    def __repr__(self) -> str:
        return f"Job: {self}"

    def __post_init__(self) -> None:
        object.__setattr__(self, "scene", as_scene(self.scene))
        object.__setattr__(self, "t_end", check_number("t_end", self.t_end, "s", ge=0.0))
        options = self.options
        if isinstance(options, Mapping):
            for name, value in options.items():
                if name not in OPTIONS:
                    raise unknown(f"options.{name}", value, str(name), OPTIONS)
            options = Options(**options)
            object.__setattr__(self, "options", options)
        if not isinstance(options, Options):
            raise SceneError("options", options, "", "Options, or a mapping")
        options.check_sample(self.t_end)
        for name in options.given().keys() & ELSEWHERE:
            raise unknown(f"options.{name}", getattr(options, name), name, OPTIONS)

    @property
    def key(self) -> str:
        """Hash of all that determines the record: scene, end, options, code."""
        scene = dataclasses.replace(self.scene, name="").to_toml()
        options = {name: getattr(self.options, name) for name in OPTIONS}
        content = json.dumps([scene, self.t_end, options, code_version()], sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()[:40]

    @property
    def weight(self) -> float:
        """Rough measure of the work, to start long runs first.

        Blocks times rise of the force; more where little load on the trailing edge lets it lift.
        """
        scene, options = self.scene, self.options
        rise = scene.driver.K * scene.driver.V * self.t_end / scene.F_N
        factor = {"dynamic": 100.0, "quasistatic": 0.1}.get(options.fidelity, 1.0)
        factor *= 5.0 if options.geometry == "finite" else 1.0
        factor /= max(1.0 - getattr(scene.top, "theta", 0.0), 0.1)
        return factor * scene.N_x * scene.N_z * rise

    def __str__(self) -> str:
        options = "".join(f", {name} = {value}" for name, value in self.options.given().items())
        return f"{self.scene.name or 'scene'} to t = {self.t_end:g} s{options}"


@functools.cache
def code_version() -> str:
    """Return a hash of what computes a run: `ROOMS`, the compiled core, NumPy and SciPy."""
    versions = (__version__, np.__version__, scipy.__version__)  # static states go through LAPACK
    found = hashlib.sha256(" ".join(versions).encode())
    here = Path(__file__).parents[1]
    for path in sorted(here.rglob("*")):
        inside = path.relative_to(here).parts
        if path.suffix in (".so", ".pyd") or (path.suffix == ".py" and inside[0] in ROOMS):
            name = path.relative_to(here).as_posix().encode()
            found.update(name + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()


@at_once()
def run_all(
    jobs: Sequence[Job],
    workers: int | None = None,
    cache: bool | str | os.PathLike[str] = True,
    progress: bool | Callable[[int, int], None] | None = None,
    errors: Literal["raise", "return"] = "raise",
    executor: Any = None,
) -> list[Record] | list[Record | JobError]:
    """Run jobs side by side, each on one thread of a process of its own; longest first.

    Worker processes are spawned: a script that is run as a file needs its calls below
    ``if __name__ == "__main__":``. Ctrl-C stops all workers; what was finished stays in the cache.

    Args:
        jobs: what to run. Equal jobs are run once.
        workers: most runs at a time; None means one for each processor. With 1, or one job, all is
            done in this process.
        cache: True reuses and keeps finished runs in `cache_folder()`, False does neither; a path
            names another folder.
        progress: True for a bar on stderr, a function of (number done, number of all), False for
            nothing; None shows the bar where stderr is a terminal.
        errors: "raise" stops at the first run that fails; "return" goes on, and gives its
            `JobError` in the place of its record.
        executor: what makes the runs, in place of `workers`: anything whose `submit(function,
            *arguments)` gives a future with `done()`, `result()` and `cancel()`, such as those of
            `concurrent.futures`, a `distributed.Client` or a `submitit.AutoExecutor`. It stays
            open. The folder of `cache` has to be the same one on all its machines; through it, runs
            learn that they are no longer wanted. With cache = False those under way go on.

    Returns:
        The records, in the order of the jobs. `timings["processor"]` is the processor time of the
        run and its plan, in s.

    Raises:
        SceneError: an argument is refused; nothing has been done.
        JobError: a run failed, or its process ended; with errors = "raise". The others are
            stopped; those that were complete are in the cache.
        KeyboardInterrupt: after Ctrl-C.
    """
    jobs = list(jobs)
    for job in jobs:
        if not isinstance(job, Job):
            raise SceneError("jobs", job, "", "a list of Job")
    workers = _count(workers)
    if errors not in ("raise", "return"):
        raise SceneError("errors", errors, "", "'raise' or 'return'")
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise SceneError("executor", executor, "", "an object with submit, or None")
    folder = None
    if cache is not False:
        folder = cache_folder() if cache is True else Path(cache)

    by_key = {job.key: job for job in jobs}
    found: dict[str, Record | JobError | None]
    found = {key: folder and kept(folder, key, job.scene) for key, job in by_key.items()}
    todo = {key: job for key, job in by_key.items() if found[key] is None}
    todo = dict(sorted(todo.items(), key=lambda item: -item[1].weight))
    with jobs_bar(progress, len(by_key)) as show:
        done = len(by_key) - len(todo)
        show(done, len(by_key))
        with closing(_outcomes(todo, min(workers, len(todo)), folder, executor)) as outcomes:
            for key, made in outcomes:
                if isinstance(made, Exception):
                    if folder is not None:
                        note_failure(folder, key, f"{type(made).__name__}: {made}")
                    if errors == "raise":
                        raise JobError(todo[key], made) from made
                    made = JobError(todo[key], made)
                elif not made.done:
                    raise KeyboardInterrupt
                found[key] = made
                done += 1
                show(done, len(by_key))
    if folder is not None and todo:
        clear(folder)
        prune(folder, MAX_BYTES if own(cache) else None)
    return [_belonging(found[job.key], job) for job in jobs]


def _count(workers: int | None) -> int:
    if workers is None:
        return core.processors()
    if isinstance(workers, bool) or not (isinstance(workers, int) and workers >= 1):
        raise SceneError("workers", workers, "", "a whole number >= 1, or None")
    return workers


@contextmanager
def side_by_side(jobs: Sequence[Job], workers: int | None) -> Iterator[Workers | None]:
    """Give an executor for jobs and for what is done with their records, stopped at the end.

    None stands for this process, where `run_all` would make the runs in it.
    """
    count = min(_count(workers), len({job.key for job in jobs}))
    if count <= 1:
        yield None
        return
    with Workers(count) as pool:
        yield pool


def each(pool: Executor | None, function: Callable[..., T], calls: Sequence[tuple]) -> Iterator[T]:
    """Yield what a function gives for each tuple of arguments, made side by side, in order."""
    if pool is None:
        yield from (function(*call) for call in calls)
        return
    futures = [pool.submit(function, *call) for call in calls]
    yield from (future.result() for future in futures)


def _belonging(found: Record | JobError, job: Job) -> Record | JobError:
    """Return what was found for a job, under the name of its own scene."""
    if isinstance(found, JobError):
        return JobError(job, found.error)
    return dataclasses.replace(found, scene=job.scene)


# --- running -------------------------------------------------------------------------------------


def _outcomes(
    todo: Mapping[str, Job], workers: int, folder: Path | None, executor: Any
) -> Iterator[tuple[str, Record | Exception]]:
    """Yield key and record, or what went wrong, of each job as it ends."""
    if executor is not None:
        own_ones = isinstance(executor, Workers)  # who made them stops them
        yield from _ended(todo, folder, executor, "" if own_ones else secrets.token_hex(20))
    elif workers <= 1:
        for key, job in todo.items():
            try:
                yield key, _made(job, folder, key)
            except Exception as error:
                yield key, error
    else:
        with Workers(workers) as pool:
            yield from _ended(todo, folder, pool, "")


def _ended(
    todo: Mapping[str, Job], folder: Path | None, executor: Any, sweep: str
) -> Iterator[tuple[str, Record | Exception]]:
    """Yield key and record, or what went wrong, of each job that an executor is given.

    It is asked now and then, because not every one calls back. What it lost is given to it again.
    `sweep` is the name by which runs in the processes of others learn that they are not wanted.
    """
    futures = {key: executor.submit(_made, job, folder, key, sweep) for key, job in todo.items()}
    lost = dict.fromkeys(futures, 0)
    try:
        while futures:
            ended = [key for key, future in futures.items() if future.done()]
            for key in ended:
                made = _result(futures.pop(key))
                if isinstance(made, CancelledError) and lost[key] < MOST_LOST:
                    lost[key] += 1
                    futures[key] = executor.submit(_made, todo[key], folder, key, sweep)
                else:
                    yield key, made
            if not ended:
                time.sleep(POLL)
    finally:
        for future in futures.values():
            future.cancel()
        if sweep and futures and folder is not None:
            give_up(folder, sweep, lambda: all(future.done() for future in futures.values()))


def _result(future: Any) -> Record | Exception:
    try:
        return future.result()
    except Exception as error:
        return error


class _Stopped(Exception):
    """Nobody wants this run any more."""


@contextmanager
def _without_locks_of_dask() -> Iterator[None]:
    """Let xarray write into memory in a worker of dask as elsewhere.

    It would ask dask's scheduler for a lock, whose name is that of the file.
    """
    if "dask" not in sys.modules:
        yield
        return
    with sys.modules["dask"].config.set(scheduler="synchronous"):
        yield


@_without_locks_of_dask()
def _made(job: Job, folder: Path | None, key: str, sweep: str = "") -> Record:
    """Return the record of a job from the folder, or make it and keep it there.

    Who finds that another process or machine makes it just now, waits for it. What the sweep of
    this name gave up is not made.
    """

    def look(_: Any = None) -> None:
        if stopping() or (sweep and folder is not None and given_up(folder, sweep)):
            raise _Stopped

    look()
    while folder is not None:
        with reserved(folder, key) as ours:
            record = kept(folder, key, job.scene)
            if record is None and ours:
                with saved_first():
                    record = _simulated(job, look)
                    if record.done:
                        keep(folder, key, record)
        if record is not None:
            return record
        time.sleep(POLL)
        look()
    return _simulated(job, look)


def _simulated(job: Job, look: Callable[[Any], None]) -> Record:
    start = time.process_time()
    record = simulate(job.scene, job.t_end, job.options, threads=1, progress=look)
    timings = {**record.timings, "processor": time.process_time() - start}
    return dataclasses.replace(record, timings=timings)
