"""Scenes: the simulated systems, in SI units, checked on construction.

A scene is a slider on a frictional interface, loaded from above and pushed from one side.
Source of the model, the symbols and the presets: J. Trømborg, J. Scheibert, D. S. Amundsen,
K. Thøgersen, A. Malthe-Sørenssen, Phys. Rev. Lett. 107, 074301 (2011), "the paper" below.

Every refused value raises `SceneError`.
"""

import os
from collections.abc import Mapping
from operator import attrgetter
from pathlib import Path
from typing import Any, ClassVar, Self

import tomli_w

from pyfric.display import Shown
from pyfric.scene.change import changed, full_name, joined
from pyfric.scene.composed import Composed
from pyfric.scene.consistency import check
from pyfric.scene.text import scene_text
from pyfric.values import SceneError, from_entries, line, no_attribute, parsed, part, table, write


@part
class Scene(Composed, Shown):
    """The simulated system: slider, top boundary, driver, interface, walls.

    A scene is immutable and hashable. `replace` changes values and repeats all checks. Arrays run
    along the interface from left to right.

    Args:
        slider: a `Slider`.
        top: a `Rod` (setup 1), a `DistributedLoad` (setup 2) or a `PrescribedLoad` (a chain, or a
            prescribed interface in two dimensions).
        driver: a `Driver`; its h and h_top must be on rows of the slider above the bottom row, or 0
            for a chain.
        interface: an `Interface`.
        name: free text of at most `MAX_NAME` characters.
        walls: boundary conditions of a slider on a prescribed interface, `Walls`.
        stop_when: one or several conditions, such as "arrested", that end runs without conditions
            of their own; see `pyfric.Options`.

    Raises:
        SceneError: a part is missing, unknown or of the wrong type, h or h_top is not on a row,
            prescribed forces do not fit the blocks, or parts or walls cannot be combined.

    Source: PRL 107, 074301 (2011).
    """

    _example: ClassVar[str] = 'pyfric.preset("fig1"), or pyfric.Scene.from_toml("scene.toml")'

    def __post_init__(self) -> None:
        check(self)

    def __repr__(self) -> str:
        return scene_text(self)

    def __getattr__(self, name: str) -> Any:
        """Raise AttributeError for an unknown name, and suggest where its value is."""
        if name.startswith("_"):
            raise AttributeError(f"a scene has no {name!r}", name=name, obj=self)
        if instead := line(name, "scene"):
            raise no_attribute("scene", name, self, instead)
        try:
            instead = f"scene.{full_name(self, name)}"
        except (SceneError, AttributeError):
            instead = ""
        raise no_attribute("scene", name, self, instead, dir(type(self)))

    def __getitem__(self, name: str) -> Any:
        """Return the value of a field by its name, as in `replace`.

        >>> pyfric.preset("fig1")["driver.h"]
        0.005
        """
        return attrgetter(full_name(self, name))(self)

    def replace(self, changes: Mapping[str, Any] | None = None, /, **keywords: Any) -> Self:
        """Return the scene with changed values; all checks are repeated.

        Args:
            changes: names of fields to values: "driver.h", or "h" if only one part has it, or a
                whole part, or "name". A value is a number in SI units, text with a unit such as
                "5 mm", or a quantity of a unit library, such as pint.
            **keywords: changes of fields whose names have no dot.

        Raises:
            SceneError: a name is unknown or in several parts, or a value is refused.

        >>> pyfric.preset("fig1").replace({"driver.h": "7.5 mm"}, mu_s=0.6).driver.h
        0.0075
        """
        return changed(self, joined(changes, keywords))

    def to_toml(self, path: str | os.PathLike[str] | None = None) -> str:
        """Return the scene as TOML; with `path`, also write it to that file.

        Quantities are written in SI units with all digits, so that `from_toml` returns an equal
        scene, bit for bit. Values of None are omitted.

        Raises:
            OSError: the file cannot be written; an existing file is then unchanged.
            SceneError: the name ends like that of another format, such as .nc.
        """
        text = tomli_w.dumps(table(self))
        if path is not None:
            write(path, text.encode(), ".toml")
        return text

    @classmethod
    def from_toml(
        cls,
        source: str | os.PathLike[str],
        *,
        files: bool | Path = True,
    ) -> Self:
        """Return the scene in a TOML file or text; `pyfric.values.toml` describes the format.

        Args:
            source: path of a file, or the text itself, which contains a line break.
            files: whether a friction law may name files. True reads such files from the folder of
                the source (for a text, the current folder). A path names another folder.

        Raises:
            SceneError: the file cannot be read, is not TOML or is larger than 1 MiB; or an entry is
                missing, unknown, without or with a wrong unit, or out of range. All problems found
                are listed.
        """
        missing = dict.fromkeys(("slider", "top", "driver", "interface"))
        entries, beside = parsed(source)
        return from_entries(cls, missing | entries, beside if files is True else files or None)
