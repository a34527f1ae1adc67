"""A law of one's own: tables from lists, files or functions."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pyfric.scene.checked import NotNegative, part
from pyfric.scene.errors import SceneError
from pyfric.scene.laws.kinds import UNITS, FrictionLaw, Means, law
from pyfric.scene.laws.table import Table, from_csv, sampled

__all__ = ["TabulatedLaw"]

PAIRS = {
    "hold": ("contact_time", "gain"),
    "slide": ("slip", "mu"),
    "speed": ("v", "speed_factor"),
    "age": ("age_time", "age_factor"),
}
"""Table -> the two lists that make it."""
FILE_UNITS = UNITS._replace(slide="m")
"""Units of the first columns of files."""


def _read(name: str, path: Path) -> Table:
    return from_csv(path, f"interface.law.{name}", getattr(FILE_UNITS, name))


Seconds = Annotated[tuple[float, ...] | None, NotNegative("s", listed=True, optional=True)]
Numbers = Annotated[tuple[float, ...] | None, NotNegative("", listed=True, optional=True)]


@law
@part
class TabulatedLaw(FrictionLaw):
    """A law given by lists of knots, each table by two lists of equal length; straight between.

    Args:
        slip, mu: mu of a slipping block over its slip since the last stick, m. The last mu is the
            interface's mu_k. Where mu_s, mu_k or d_c are fields, the table belongs to their
            means and is scaled for each block; a d_c of 0 leaves slip as it is.
        contact_time, gain: what mu_s has gained over the time since the block stuck, s.
        v, speed_factor: factor of mu over the speed, m/s.
        age_time, age_factor: factor of mu over the time since slip began, s.

    Tables start at 0. Those that are left out change nothing.
    """

    slip: Annotated[tuple[float, ...] | None, NotNegative("m", listed=True, optional=True)] = None
    mu: Numbers = None
    contact_time: Seconds = None
    gain: Numbers = None
    v: Annotated[tuple[float, ...] | None, NotNegative("m/s", listed=True, optional=True)] = None
    speed_factor: Numbers = None
    age_time: Seconds = None
    age_factor: Numbers = None

    kind: ClassVar[str] = "table"
    example: ClassVar[dict[str, Any]] = {
        "slip": (0.0, 5e-7, 1.1e-6, 3e-6),
        "mu": (0.7, 0.64, 0.66, 0.45),
        "contact_time": (0.0, 1e-4),
        "gain": (0.0, 0.02),
        "v": (0.0, 0.02, 0.1),
        "speed_factor": (1.0, 0.8, 0.9),
        "age_time": (0.0, 2e-5, 5e-5),
        "age_factor": (1.0, 0.6, 0.9),
    }

    @classmethod
    def of(cls, **tables: str | Path | tuple[Callable[[float], float], float]) -> Self:
        """Return a law whose tables are made from files or functions.

        Args:
            tables: hold, slide, speed or age: the path of a CSV file of two columns, see
                `from_csv`, or a function of a number and the end of its table.

        Raises:
            SceneError: an unknown table, a file that is none, a function that is no law.
        """
        lists: dict[str, Any] = {}
        for name, source in tables.items():
            if name not in PAIRS:
                raise SceneError(name, source, "", f"one of {', '.join(PAIRS)}", "unknown")
            file = isinstance(source, str | Path)
            table = _read(name, Path(source)) if file else sampled(*source)
            lists |= zip(PAIRS[name], (table.x, table.y), strict=True)
        return cls(**lists)

    @classmethod
    def from_file(cls, table: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Return the table of a scene file with lists in place of the CSV files that it names."""
        rest = dict(table)
        for name in PAIRS:
            source = rest.pop(name, None)
            if source is None:
                continue
            if not isinstance(source, str):
                allowed = "the path of a CSV file, from the scene file on"
                raise SceneError(f"interface.law.{name}", source, "", allowed, "not text")
            if twice := [column for column in PAIRS[name] if column in rest]:
                allowed = f"either {name}, or {' and '.join(PAIRS[name])}"
                raise SceneError(f"interface.law.{twice[0]}", rest[twice[0]], "", allowed, "twice")
            read, unit = _read(name, folder / source), getattr(FILE_UNITS, name)
            x = [f"{x!r} {unit}" for x in read.x]
            rest |= zip(PAIRS[name], (x, list(read.y)), strict=True)
        return rest

    def _table(self, name: str) -> Table | None:
        x, y = (getattr(self, column) for column in PAIRS[name])
        if x is None and y is None:
            return None
        if x is None or y is None:
            missing = PAIRS[name][x is not None]
            raise SceneError(f"interface.law.{missing}", None, "", "a list of numbers", "missing")
        return Table(x, y)

    def hold(self, of: Means) -> Table | None:
        """Return the gain of mu_s."""
        return self._table("hold")

    def slide(self, of: Means) -> Table | None:
        """Return the share of mu_s - mu_k that is left, over slip/d_c, or over slip if d_c = 0."""
        table = self._table("slide")
        if table is None:
            return super().slide(of)
        drop = of.mu_s - of.mu_k
        if not drop > 0 or table.y[-1] != of.mu_k:
            allowed = f"mu_k = {of.mu_k!r}, the end of the table, and less than mu_s = {of.mu_s!r}"
            raise SceneError("interface.law.mu", table.y[-1], "", allowed, "another end")
        unit = of.d_c or 1.0
        return Table(tuple(x / unit for x in table.x), tuple((y - of.mu_k) / drop for y in table.y))

    def speed(self, of: Means) -> Table | None:
        """Return the factor of the speed."""
        return self._table("speed")

    def age(self, of: Means) -> Table | None:
        """Return the factor of the time since slip began."""
        return self._table("age")
