"""How objects show themselves: a few lines in a terminal, with a drawing in a notebook.

Rooms above this one draw. `pyfric.figures` registers what draws an object of a class in `DRAWINGS`
when it is imported, and `html` imports it by name when something is shown.
"""

from __future__ import annotations

import base64
import dataclasses
import html as markup
import importlib
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyfric.scene.checked import quantities

if TYPE_CHECKING:
    from collections.abc import Callable

    import jinja2

    from pyfric.scene.scene import Scene

__all__ = ["DRAWINGS", "html", "page_of", "scene_text", "template"]

DRAWINGS: dict[type, Callable[[Any], Any]] = {}
"""Class -> function that returns a figure with a caption."""


def html(shown: Any) -> str:
    """Return the text of an object as HTML, below its drawing where there is one."""
    importlib.import_module("pyfric.figures")
    text = f'<pre style="white-space: pre-wrap">{markup.escape(str(shown))}</pre>'
    draw = DRAWINGS.get(type(shown))
    return text if draw is None else _image(draw(shown)) + text


def _image(figure: Any) -> str:
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=150)
    data = base64.b64encode(picture.getvalue()).decode()
    alt = markup.escape(figure.caption, quote=True)
    return f'<img alt="{alt}" src="data:image/png;base64,{data}" style="max-width:100%">'


def page_of(record: Any) -> str:
    """Return a page about a record, drawn by a room above this one."""
    return importlib.import_module("pyfric.figures").record_page(record)


def template(beside: str, name: str) -> jinja2.Template:
    """Return the template of this name that lies beside a file, or beside this one.

    Its tests know `numeric`. ``head.html`` here is how every page begins, up to its own style.
    """
    import jinja2  # slow to import

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([Path(beside).parent, Path(__file__).parent]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.tests["numeric"] = _is_number
    return environment.get_template(name)


def _is_number(value: Any) -> bool:
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def scene_text(scene: Scene) -> str:
    """Return a scene in a line for each part, numbers in SI units."""
    lines = [f"Scene {scene.name or 'without a name'}: {scene.N_x} x {scene.N_z} blocks"]
    for name in ("slider", "top", "driver", "interface"):
        part = getattr(scene, name)
        units = {key: one.unit for key, one in quantities(type(part)).items()}
        values = {one.name: getattr(part, one.name) for one in dataclasses.fields(part)}
        told = [
            f"{key} = {_short(value)} {units.get(key, '')}".rstrip()
            for key, value in values.items()
            if value is not None and value != ()
        ]
        lines.append(f"  {type(part).__name__}: {', '.join(told)}")
    return "\n".join(lines)


def _short(value: Any) -> str:
    if isinstance(value, tuple):
        return f"{len(value)} values"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
