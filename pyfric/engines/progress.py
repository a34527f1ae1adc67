"""Display of the progress of runs."""

from __future__ import annotations

import functools
import math
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

    from tqdm import tqdm

    from pyfric.scene import Scene


class Progress(NamedTuple):
    """State of a run: times in s, F_T over F_N, events so far, steps per second."""

    t: float
    t_begin: float
    t_end: float
    force: float
    events: int
    rate: float


@contextmanager
def _bar(
    progress: bool | Callable[..., None] | None,
    show: Callable[..., None],
    first: str,
    **layout: Any,
) -> Iterator[Callable[..., None]]:
    """Yield the function that shows progress: the caller's own, a bar on stderr, or nothing.

    `first` is the text of the bar before the first update.
    """
    if callable(progress):
        yield progress
        return
    if progress is None:
        progress = sys.stderr is not None and sys.stderr.isatty()
    if not progress:
        yield lambda *_: None
        return
    from tqdm import tqdm

    seldom = 0.1 if sys.stderr.isatty() else 1.0  # a log needs fewer lines
    with tqdm(file=sys.stderr, mininterval=seldom, **layout) as bar:
        if first:
            bar.set_postfix_str(first)
        yield functools.partial(show, bar)


def run_bar(
    progress: bool | Callable[[Progress], None] | None, scene: Scene, t_begin: float, t_end: float
) -> AbstractContextManager[Callable[[Progress], None]]:
    """Yield the function that shows the progress of one run."""

    def show(bar: tqdm, now: Progress) -> None:
        text = f"F_T/F_N {now.force:.3f}, {now.events} events"
        if math.isfinite(now.rate):
            text += f", {now.rate:.3g} steps/s"
        bar.set_postfix_str(text, refresh=False)
        bar.update(min(now.t, t_end) - bar.n)

    times = "{n:.4f}/{total:.4f} s [{elapsed}<{remaining}{postfix}]"
    layout = "{desc}: {percentage:3.0f}%|{bar}| " + times
    first = "set-up: static states and modes"
    name = scene.name or "run"
    return _bar(progress, show, first, total=t_end, initial=t_begin, desc=name, bar_format=layout)


def jobs_bar(
    progress: bool | Callable[[int, int], None] | None, total: int
) -> AbstractContextManager[Callable[[int, int], None]]:
    """Yield the function that shows how many of several runs are done."""

    def show(bar: tqdm, done: int, _: int) -> None:
        bar.update(done - bar.n)

    return _bar(progress, show, "", total=total, desc="runs", unit="run")
