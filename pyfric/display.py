"""Display of objects in notebooks and as pages, and progress bars.

`pyfric.figures`, which is imported at the first drawing, draws the objects.
"""

from __future__ import annotations

import base64
import functools
import html as markup
import math
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager

    from tqdm import tqdm

figures: Any = None
"""A function, set by `pyfric`, that imports and returns `pyfric.figures`."""


def drawing(shown: Any, *given: Any, **named: Any) -> Any:
    """Return the figure of an object, None if it has no drawing; other arguments are refused."""
    return figures().drawing(shown, *given, **named)


def html(shown: Any) -> str:
    """Return an object as HTML: its drawing, if it has a drawing, and its text below."""
    text = f'<pre style="white-space: pre-wrap">{markup.escape(str(shown))}</pre>'
    figure = drawing(shown)
    if figure is None:
        return text
    data = base64.b64encode(figure._repr_png_()).decode()
    alt = markup.escape(figure.caption, quote=True)
    image = f'<img alt="{alt}" src="data:image/png;base64,{data}" style="max-width:100%">'
    return image + text


class Shown:
    """A result that a notebook shows as a picture, with its text below."""

    def plot(self, *given: Any, **named: Any) -> Any:
        """Return the picture, a figure that `pyfric.figures.save_figure` writes.

        Raises:
            SceneError: any argument is given.
        """
        return drawing(self, *given, **named)

    _repr_html_ = html


def page(record: Any) -> str:
    """Return a page about a record, as HTML."""
    return figures().record_page(record)


def plain(value: Any) -> Any:
    """Return a value for JSON, in full precision; numbers that are not finite become None.

    Dicts and lists are converted recursively. Scalars of NumPy become scalars of Python.
    """
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


class Progress(NamedTuple):
    """State of a run: times in s, F_T over F_N, number of events so far, steps per second."""

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
    """Yield the function that shows progress: the caller's function, a bar, or no display.

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

    seldom = 0.1 if sys.stderr.isatty() else 1.0  # fewer lines in a log
    with tqdm(file=sys.stderr, mininterval=seldom, **layout) as bar:
        if first:
            bar.set_postfix_str(first)
        yield functools.partial(show, bar)


def run_bar(
    progress: bool | Callable[[Progress], None] | None, name: str, t_begin: float, t_end: float
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
    how = {"total": t_end, "initial": t_begin, "desc": name or "run", "bar_format": layout}
    return _bar(progress, show, first, **how)


def jobs_bar(
    progress: bool | Callable[[int, int], None] | None, total: int
) -> AbstractContextManager[Callable[[int, int], None]]:
    """Yield the function that shows the number of finished runs."""

    def show(bar: tqdm, done: int, _: int) -> None:
        bar.update(done - bar.n)

    return _bar(progress, show, "", total=total, desc="runs", unit="run")
