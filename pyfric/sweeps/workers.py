"""Worker processes. If a worker dies, only its job is lost; all workers end with this process.

Each worker is a `ProcessPoolExecutor` of one spawned process, so that the job of a dead process is
known. A worker inherits a mask that blocks the signals that end a command. Each worker holds the
reading end of a pipe; only this process has the writing end. When this process ends, for any
reason, the pipe closes and the worker ends, too.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib.machinery import ModuleSpec
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from types import SimpleNamespace
from typing import Any

from threadpoolctl import threadpool_limits

from pyfric.signals import SIGNALS, held_back


class Workers(Executor):
    """Worker processes of one thread each. A job whose process dies raises ChildProcessError.

    `shutdown`, and so the end of a with block, stops them.
    """

    def __init__(self, count: int) -> None:
        self._hears, self._speaks = SpawnContext().Pipe(duplex=False)
        self._workers: list[_Worker] = []
        self._of_thread = threading.local()
        self._threads = ThreadPoolExecutor(count, "pyfric")

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future:
        return self._threads.submit(self._run, function, args, kwargs)

    def _run(self, function: Callable[..., Any], args: Any, kwargs: Any) -> Any:
        """Return the result of a function called in the worker of this thread."""
        if not hasattr(self._of_thread, "worker"):
            self._of_thread.worker = _Worker(self._hears)
            self._workers.append(self._of_thread.worker)
        worker = self._of_thread.worker
        try:
            return worker.pool.submit(function, *args, **kwargs).result()
        except BrokenProcessPool:
            del self._of_thread.worker
            worker.pool.shutdown()
            raise ChildProcessError(
                f"a worker process ended by itself (exit code {worker.processes[-1].exitcode}; out "
                "of memory?)"
            ) from None

    @held_back()
    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        self._speaks.close()  # ends a process that is still starting
        for process in [process for worker in self._workers for process in worker.processes]:
            if process.pid is not None:
                process.kill()
        self._threads.shutdown(cancel_futures=True)
        for worker in self._workers:
            worker.pool.shutdown()
        self._hears.close()


class _Worker(SpawnContext):
    """A pool of one process, and the context that makes its processes and remembers them."""

    def __init__(self, hears: Connection) -> None:
        self.processes: list[BaseProcess] = []
        self.pool = ProcessPoolExecutor(1, self, _begin, (hears,))
        # Signals are blocked in this thread, which starts the process. Starting the tracker of
        # resources, just before, has unblocked SIGINT and SIGTERM.
        signal.pthread_sigmask(signal.SIG_BLOCK, set(SIGNALS) - {signal.SIGXCPU})

    def Process(self, *args: Any, **kwargs: Any) -> BaseProcess:
        process = _WithoutScript(*args, **kwargs)
        self.processes.append(process)
        return process


class _WithoutScript(SpawnProcess):
    """A process that does not run the script of its parent, because it needs no ``__main__``.

    By default Python would run the script again, with or without a guard on ``__name__``.
    """

    @staticmethod
    def _Popen(process: BaseProcess) -> Any:
        main = sys.modules["__main__"]
        with _STARTING:
            own = main.__spec__
            main.__spec__ = ModuleSpec("__main__", None)  # not run by a spawned process
            try:
                return SpawnProcess._Popen(process)
            finally:
                main.__spec__ = own


_STARTING = threading.Lock()


class InThisProcess(Executor):
    """An executor that makes each call in this process, when its result is requested."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
        def result(timeout: float | None = None) -> Any:
            return function(*args, **kwargs)

        return SimpleNamespace(result=result, done=lambda: True, cancel=lambda: True)


def _begin(hears: Connection) -> None:
    """Limit a worker process to one thread, and end it when its parent ends."""
    threadpool_limits(1)
    threading.Thread(target=_leave, args=(hears,), daemon=True).start()


def _leave(hears: Connection) -> None:
    """Wait for the end of the parent process, then end this process."""
    hears.poll(None)
    os._exit(1)
