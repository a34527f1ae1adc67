"""Processes that work for this one: one that dies takes only its job along, and all end with it.

Every worker is a spawned process at the end of a pipe of its own, and knows the end of one pipe of
which only this process holds the beginning. When that closes, because work is to stop or because
this process is gone, however it went, a worker stops what it does or ends in the middle.
"""

from __future__ import annotations

import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from threadpoolctl import threadpool_limits

from pyfric.scene import held_back

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

__all__ = ["Workers", "stopping"]

GRACE = 1.5
"""Time in which a worker that is to stop can do so by itself, s."""

_spawn = multiprocessing.get_context("spawn")
_stop = threading.Event()


def stopping() -> bool:
    """Whether this is a worker process that is to stop."""
    return _stop.is_set()


class Workers(Executor):
    """Worker processes of one thread each, which never see Ctrl-C and SIGTERM.

    At the end of a with block they are stopped. A job whose process dies raises ChildProcessError.
    """

    def __init__(self, count: int) -> None:
        self._stop, self._beginning = _spawn.Pipe(duplex=False)
        self._lanes = [_Lane(self._stop) for _ in range(count)]
        with _signals_blocked():
            for lane in self._lanes:
                lane.start()
        self._free: queue.SimpleQueue[_Lane] = queue.SimpleQueue()
        for lane in self._lanes:
            self._free.put(lane)
        self._threads = ThreadPoolExecutor(count, "pyfric", _block_signals)

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future:
        return self._threads.submit(self._run, function, args, kwargs)

    def _run(self, *call: Any) -> Any:
        lane = self._free.get()
        try:
            return lane.run(call)
        finally:
            self._free.put(lane)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers when they have done what they were given."""
        self._threads.shutdown(cancel_futures=cancel_futures)
        for lane in self._lanes:
            lane.end()
        self._beginning.close()
        self._stop.close()

    @held_back()
    def __exit__(self, *_: Any) -> None:
        self._beginning.close()
        killer = threading.Timer(GRACE, lambda: [lane.kill() for lane in self._lanes])
        killer.start()
        self.shutdown(cancel_futures=True)
        killer.cancel()


class _Lane:
    """One worker process at a time, and this end of its pipe."""

    def __init__(self, stop: Connection) -> None:
        self.stop, self.process = stop, None

    def start(self) -> None:
        self.pipe, far = _spawn.Pipe()
        self.process = _spawn.Process(target=_serve, args=(far, self.stop))
        self.process.start()
        far.close()

    def run(self, call: tuple[Any, ...]) -> Any:
        """Return what a call gives in the process, or raise what it raises there."""
        if self.process is None:
            self.start()
        try:
            self.pipe.send(call)
            value, error = self.pipe.recv()
        except (EOFError, ConnectionError):
            self.end()
            raise ChildProcessError(
                f"a worker process ended by itself (exit code {self.code}: out of memory, or a "
                'script without if __name__ == "__main__":)'
            ) from None
        if error is not None:
            raise error
        return value

    def end(self) -> None:
        """Wait for the process, which ends when its pipe does."""
        if self.process is not None:
            self.pipe.close()
            self.process.join()
            self.code = self.process.exitcode
            self.process.close()
            self.process = None

    def kill(self) -> None:
        with suppress(AttributeError, ValueError):  # it has just ended
            self.process.kill()


def _serve(jobs: Connection, stop: Connection) -> None:
    """Do one call after another, in a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    threadpool_limits(1)
    busy = threading.Lock()
    threading.Thread(target=_leave, args=(stop, busy), daemon=True).start()
    while True:
        try:
            function, args, kwargs = jobs.recv()
        except EOFError:
            return
        with busy:
            try:
                answer = function(*args, **kwargs), None
            except Exception as error:
                answer = None, error
            try:
                jobs.send(answer)
            except OSError:  # nobody is there any more
                return
            except Exception as error:
                jobs.send((None, RuntimeError(f"the answer cannot be pickled: {error}")))


def _leave(stop: Connection, busy: threading.Lock) -> None:
    """End this process when it is to stop: at once if it is idle, or else after a while."""
    stop.poll(None)
    _stop.set()
    busy.acquire(timeout=GRACE)
    os._exit(0)


def _block_signals() -> None:
    """Let Ctrl-C and SIGTERM pass this thread, and processes that it starts."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait until the end of the block."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    _block_signals()
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
