"""Processes that work for this one: one that dies takes only its job along, and all end with it.

Each worker is a `ProcessPoolExecutor` of one spawned process, so that it is known which job a
process took along. It never sees the signals that end a command: it inherits a mask that blocks
them. It holds one end of a pipe whose other end only this process has. When that closes, because
this process is gone, however it went, the worker ends too.
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
        """Call a function in the worker of this thread."""
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
        self._speaks.close()  # ends a process that is just being started
        for process in [process for worker in self._workers for process in worker.processes]:
            if process.pid is not None:
                process.kill()
        self._threads.shutdown(cancel_futures=True)
        for worker in self._workers:
            worker.pool.shutdown()
        self._hears.close()


class _Worker(SpawnContext):
    """A pool of one process, and the context that makes its processes, which it remembers."""

    def __init__(self, hears: Connection) -> None:
        self.processes: list[BaseProcess] = []
        self.pool = ProcessPoolExecutor(1, self, _begin, (hears,))
        # In this thread, which starts the process; its tracker of resources has just been started,
        # after which Python unblocks SIGINT and SIGTERM.
        signal.pthread_sigmask(signal.SIG_BLOCK, set(SIGNALS) - {signal.SIGXCPU})

    def Process(self, *args: Any, **kwargs: Any) -> BaseProcess:
        process = _WithoutScript(*args, **kwargs)
        self.processes.append(process)
        return process


class _WithoutScript(SpawnProcess):
    """A process that does not run the script of this one: it needs no ``__main__``.

    Python would run it again, from its first line on, whether its calls are guarded or not.
    """

    @staticmethod
    def _Popen(process: BaseProcess) -> Any:
        main = sys.modules["__main__"]
        with _STARTING:
            own = main.__spec__
            main.__spec__ = ModuleSpec("__main__", None)  # which a spawned process leaves alone
            try:
                return SpawnProcess._Popen(process)
            finally:
                main.__spec__ = own


_STARTING = threading.Lock()


class InThisProcess(Executor):
    """Makes each call where its result is asked for."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
        def result(timeout: float | None = None) -> Any:
            return function(*args, **kwargs)

        return SimpleNamespace(result=result, done=lambda: True, cancel=lambda: True)


def _begin(hears: Connection) -> None:
    """Prepare a worker process."""
    threadpool_limits(1)
    threading.Thread(target=_leave, args=(hears,), daemon=True).start()


def _leave(hears: Connection) -> None:
    """End this process with the one that it works for."""
    hears.poll(None)
    os._exit(1)
