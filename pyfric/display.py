"""How objects of all rooms show themselves in notebooks and as pages.

What draws them, `pyfric.figures`, stands above them. It is imported when something is drawn.
"""

from __future__ import annotations

import base64
import html as markup
import math
from typing import Any

__all__ = ["drawing", "html", "page", "plain"]

figures: Any = None
"""A function that imports and returns `pyfric.figures`; `pyfric` sets it."""


def drawing(shown: Any) -> Any:
    """Return the figure of an object, None for what has no drawing."""
    return figures().drawing(shown)


def html(shown: Any) -> str:
    """Return the text of an object as HTML, below its drawing where there is one."""
    text = f'<pre style="white-space: pre-wrap">{markup.escape(str(shown))}</pre>'
    figure = drawing(shown)
    if figure is None:
        return text
    data = base64.b64encode(figure._repr_png_()).decode()
    alt = markup.escape(figure.caption, quote=True)
    image = f'<img alt="{alt}" src="data:image/png;base64,{data}" style="max-width:100%">'
    return image + text


def page(record: Any) -> str:
    """Return a page about a record, as HTML."""
    return figures().record_page(record)


def plain(value: Any) -> Any:
    """Return a value as JSON can hold it, in full precision; None for a number that is not finite.

    Dicts and lists are converted with all that they hold, scalars of NumPy to those of Python.
    """
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
