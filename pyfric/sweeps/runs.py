"""Many runs: independent scenes in parallel, and storage of finished runs.

    jobs = [Job(scene=preset("fig1", h=h), t_end=0.9) for h in (2.5e-3, 5e-3, 10e-3)]
    records = run_all(jobs)

A complete run is stored as a record file. Its name is a hash of all that determines the run: the
scene (without its name), the time of the end, the options of `pyfric.simulate` and the code itself;
see `pyfric.sweeps.store`. If pyfric's own folder outgrows `MAX_BYTES`, the least recently used
records are deleted. Folders that the user names are never trimmed. The reason why a run failed is
stored, too. Processes and machines may share the folder.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import pickle
import secrets
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np
import scipy

from pyfric import core
from pyfric.display import jobs_bar
from pyfric.engines import Options
from pyfric.planning import simulate
from pyfric.record import Record
from pyfric.scene import Number, Scene, SceneLike, __version__, as_scene
from pyfric.signals import at_once, saved_first
from pyfric.sweeps.shared import Point, Shared
from pyfric.sweeps.store import MAX_BYTES, Cache, Store
from pyfric.sweeps.workers import InThisProcess, Workers
from pyfric.values import SceneError, check_number, check_whole, unknown, usage

OPTIONS = tuple(name for name, known in Options.declared().items() if known.owner != "machine")
"""Options that a job may have. Options of the machine do not change the result of a run."""
DEFAULTS = Options()
ROOMS = ("scene", "theory", "core", "statics", "record", "engines", "planning")
"""Subpackages whose code determines the result of a run."""
POLL = 0.05
"""Time between two checks of runs in other processes, s."""
MAX_LOSSES = 10
"""Largest number of times that a lost job is given to an executor again."""


class JobError(RuntimeError):
    """A run failed.

    Attributes:
        job: its job.
        error: the exception; a `RunError` has the record up to the failure. If the run failed in an
            earlier call, the stored reason as text.
    """

    def __init__(self, job: Job, error: Exception | str) -> None:
        super().__init__(job, error)
        self.job, self.error = job, error

    @property
    def reason(self) -> str:
        """The message of the error, after its type."""
        if isinstance(self.error, str):
            return self.error
        return f"{type(self.error).__name__}: {self.error}"

    def __str__(self) -> str:
        return f"{self.job}: {self.reason}"


@dataclass(frozen=True, init=False)
class Job:
    """One run: the arguments of `pyfric.simulate`.

    Args:
        scene: a scene, the name of a preset, or the path of a scene file, which is read at once.
        t_end: time of the end, in s.
        options: an `Options`, or a mapping from names in `OPTIONS` to values.

    Raises:
        SceneError: a value is refused, or an option is unknown.
    """

    scene: Scene
    t_end: float
    options: Options

    def __init__(
        self, scene: SceneLike, t_end: Number, options: Options | Mapping[str, Any] = DEFAULTS
    ) -> None:
        scene, t_end = as_scene(scene), check_number("t_end", t_end, "s", ge=0.0)
        if not isinstance(options, Options | Mapping):
            raise SceneError("options", options, "", "Options, or a mapping")
        given = options.given() if isinstance(options, Options) else options
        for name, value in given.items():
            if name not in OPTIONS:
                raise unknown(f"options.{name}", value, str(name), OPTIONS)
        options = options if isinstance(options, Options) else Options(**options)
        options.check_sample(t_end)
        vars(self).update(scene=scene, t_end=t_end, options=options)

    def __repr__(self) -> str:
        return f"Job: {self}"

    def __str__(self) -> str:
        options = "".join(f", {name} = {value}" for name, value in self.options.given().items())
        return f"{self.scene.name or 'scene'} to t = {self.t_end:g} s{options}"

    def made(self, progress: Callable[..., None]) -> Record:
        """Return the record of a run with these arguments."""
        return simulate(self.scene, self.t_end, self.options, threads=1, progress=progress)

    def answered(self, _: Record) -> bool:
        """Return whether a stored record is sufficient."""
        return True

    @functools.cached_property
    def key(self) -> str:
        """Hash of scene (without its name), end, options and code, which determine the record.

        The number of points that chose the level of a point is left out. The record holds this
        number.
        """
        scene = dataclasses.replace(self.scene, name="").to_toml()
        options = {name: getattr(self.options, name) for name in OPTIONS}
        content = json.dumps([scene, self.t_end, options, code_version()], sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()[:40]


@functools.cache
def code_version() -> str:
    """Return a hash of the code of runs: `ROOMS`, the compiled core, NumPy and SciPy."""
    versions = (__version__, np.__version__, scipy.__version__)  # static states use LAPACK
    found = hashlib.sha256(" ".join(versions).encode())
    package = Path(__file__).parents[1]
    for path in sorted(package.rglob("*")):
        inside = path.relative_to(package).parts
        if path.suffix == ".so" or (path.suffix == ".py" and inside[0] in ROOMS):
            name = path.relative_to(package).as_posix().encode()
            found.update(name + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()


# --- many runs -----------------------------------------------------------------------------------


@overload
def run_all(
    jobs: Sequence[Job],
    workers: int | None = None,
    cache: Cache = True,
    progress: bool | Callable[[int, int], None] | None = None,
    errors: Literal["raise"] = "raise",
    executor: Any = None,
    shared: Shared | None = None,
) -> list[Record]: ...


@overload
def run_all(
    jobs: Sequence[Job],
    workers: int | None = None,
    cache: Cache = True,
    progress: bool | Callable[[int, int], None] | None = None,
    *,
    errors: Literal["return"],
    executor: Any = None,
    shared: Shared | None = None,
) -> list[Record | JobError]: ...


@usage("run_all([pyfric.Job(scene, t_end=1.0)], workers=2)")
@at_once()
def run_all(
    jobs: Sequence[Job],
    workers: int | None = None,
    cache: Cache = True,
    progress: bool | Callable[[int, int], None] | None = None,
    errors: Literal["raise", "return"] = "raise",
    executor: Any = None,
    shared: Shared | None = None,
) -> Any:
    """Run jobs side by side, in their order, each on one thread of a process of its own.

    Worker processes do not run the calling script. Jobs with objects of classes that the script
    defines, such as a friction law, are therefore made in this process, one by one. Ctrl-C stops
    all workers; finished runs stay in the cache.

    Args:
        jobs: the jobs; put long ones first. Equal jobs are run once.
        workers: largest number of runs at a time; None means one for each processor. With 1, or
            with one job, all runs are made in this process.
        cache: True stores and reuses finished runs, in the user's cache folder or in the folder
            that PYFRIC_CACHE names. A path names another folder. False or None stores nothing.
        progress: True for a bar on stderr, a function of (number done, number of all), False for
            nothing; None shows the bar if stderr is a terminal.
        errors: "raise" stops at the first run that fails. "return" makes the other runs, and
            returns the `JobError` in place of the record.
        executor: makes the runs instead of `workers`. Its `submit(function, *arguments)` returns a
            future with `done()`, `result()` and `cancel()`, like that of `concurrent.futures`,
            `distributed.Client` or `submitit.AutoExecutor`. The executor stays open. All its
            machines must see the folder of `cache`, through which a run that has begun can be
            stopped. Without a cache, runs that have begun continue to their end.
        shared: results of earlier jobs with the option verify = "shared". Such jobs of this call
            share one verification with the earlier jobs. None means that only jobs of this call
            share.

    Returns:
        The records, in the order of the jobs. `timings["processor"]` is the processor time of the
        run and its plan, in s.

    Raises:
        SceneError: an argument is refused; nothing has been done.
        JobError: with errors = "raise", a run failed or its process ended. The other runs are
            stopped. Complete runs are in the cache.
        KeyboardInterrupt: after Ctrl-C.
    """
    if not isinstance(jobs, Iterable):
        raise SceneError("jobs", jobs, "", "a list of Job")
    jobs = list(jobs)
    for job in jobs:
        if not isinstance(job, Job):
            raise SceneError("jobs", job, "", "a list of Job")
    if errors not in ("raise", "return"):
        raise SceneError("errors", errors, "", "'raise' or 'return'")
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise SceneError("executor", executor, "", "an object with submit, or None")
    if executor is not None and workers is not None:
        raise SceneError("workers", workers, "", "None with an executor, which makes the runs")
    if not isinstance(shared, Shared | None):
        raise SceneError("shared", shared, "", "a pyfric.Shared, or None")
    _count(workers)
    store = Store.at(cache)
    by_key = {job.key: job for job in jobs}
    found: dict[str, Any] = {key: store.load(key, job.scene) for key, job in by_key.items()}
    stage = {key: job for key, job in by_key.items() if job.options.verify != "shared"}
    done = 0
    with jobs_bar(progress, len(by_key)) as show:
        for points in (shared or Shared()).stages(by_key, found):
            stage |= points
            todo = {
                key: each
                for key, each in stage.items()
                if found[key] is None or not each.answered(found[key])
            }
            done += len(stage) - len(todo)
            stage = {}
            show(done, len(by_key))
            with closing(_outcomes(todo, workers, store, executor)) as outcomes:
                for key, made in outcomes:
                    if isinstance(made, Exception):
                        error = JobError(by_key[key], made)
                        store.note_failure(key, error.reason)
                        if errors == "raise":
                            raise error from made
                    elif not made.done:
                        raise KeyboardInterrupt
                    found[key] = made
                    done += 1
                    show(done, len(by_key))
    return [
        JobError(job, made)
        if isinstance(made := found[job.key], Exception)
        else made.replace(scene=job.scene)
        for job in jobs
    ]


def side_by_side(jobs: Sequence[Job | Point], workers: int | None) -> Workers | InThisProcess:
    """Return worker processes for jobs, or an executor in this process if one suffices."""
    count = min(_count(workers), len({job.key for job in jobs}))
    with suppress(Exception):  # a job that cannot be sent fails later
        if count > 1 and b"__main__" in pickle.dumps(jobs):
            return InThisProcess()
    return Workers(count) if count > 1 else InThisProcess()


def _count(workers: int | None) -> int:
    if workers is None:
        return core.processors()
    return check_whole("workers", workers, 1, note=", or None")


# --- running -------------------------------------------------------------------------------------


def _outcomes(
    todo: Mapping[str, Job | Point], workers: int | None, store: Store, executor: Any
) -> Iterator[tuple[str, Any]]:
    """Yield the key and the record, or the error, of each job as it ends.

    Executors are polled, because some do not call back. Lost jobs are submitted again.
    """
    with ExitStack() as stack:
        if todo:
            stack.callback(store.prune, MAX_BYTES if store.own else None)
        wanted = ""
        if executor is None:
            executor = stack.enter_context(side_by_side([*todo.values()], workers))
        elif not isinstance(executor, Workers | InThisProcess):  # the caller stops these
            key = secrets.token_hex(20)
            wanted = key if stack.enter_context(store.reserved(key, "", lambda: None)) else ""

        def begun(key: str) -> Any:
            return executor.submit(_made, todo[key], store, key, wanted)

        futures, losses = {key: begun(key) for key in todo}, dict.fromkeys(todo, 0)
        stack.callback(lambda: [future.cancel() for future in futures.values()])
        while futures:
            ended = [key for key, future in futures.items() if future.done()]
            for key in ended:
                try:
                    made: Any = futures.pop(key).result()
                except Exception as error:
                    made = error
                if isinstance(made, CancelledError) and losses[key] < MAX_LOSSES:
                    losses[key] += 1
                    futures[key] = begun(key)
                else:
                    yield key, made
            if not ended:
                time.sleep(POLL)


class Unwanted(Exception):
    """Stops a run that is not needed, because its caller has stopped."""


def _made(job: Job | Point, store: Store, key: str, wanted: str) -> Record:
    """Return the record of a job from the store, or make it and store it.

    `wanted` is the key of a lock file that exists while the run is needed; "" means always.
    """

    def look(_: Any = None) -> None:
        if wanted and not store.lock_file(wanted).exists():
            raise Unwanted

    look()
    with store.reserved(key, str(job), look):
        record = store.load(key, job.scene)
        if record is None or not job.answered(record):
            with saved_first():
                start = time.process_time()
                record = job.made(look)
                took = {"processor": time.process_time() - start}
                record = record.replace(timings={**record.timings, **took})
                if record.done:
                    store.save(key, record)
    return record
