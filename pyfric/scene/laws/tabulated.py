"""Friction laws given by tables, from lists, files or functions."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pyfric.scene.laws.columns import Measured, from_csv
from pyfric.scene.laws.kinds import (
    UNITS,
    FrictionLaw,
    Means,
    Table,
    Tables,
    law,
    sampled,
)
from pyfric.values import (
    NotNegative,
    SceneError,
    check_number,
    from_entries,
    naming,
    unknown,
    with_prefix,
)

COLUMNS = {
    "slide": ("slip", "mu"),
    "hold": ("contact_time", "gain"),
    "speed": ("v", "speed_factor"),
    "age": ("age_time", "age_factor"),
}
"""Table -> names of its two lists."""
IN_UNITS = UNITS._replace(slide="m")
"""SI units of the first list of each table."""

Source = str | Path | Measured | tuple[Callable[[float], float], float | str]
"""A CSV file, a measured curve, or a pair of a function and the end of its table."""
Seconds = Annotated[tuple[float, ...] | None, NotNegative("s", listed=True, optional=True)]
Numbers = Annotated[tuple[float, ...] | None, NotNegative("", listed=True, optional=True)]


@law
class TabulatedLaw(FrictionLaw):
    """A law given by tables: each one by two lists of equal length, linear between knots.

    Args:
        slip, mu: mu of a slipping block over its slip since the last stick, m. The last mu is the
            interface's mu_k. If mu_s, mu_k or d_c are fields, the table holds for their means and
            is scaled for each block. With d_c = 0 slip is not scaled.
        contact_time, gain: gain of mu_s over the time since the block stuck, s.
        v, speed_factor: factor of mu over the speed, m/s.
        age_time, age_factor: factor of mu over the time since slip began, s.

    Tables start at 0. Omitted tables have no effect. In a scene file, slide, hold, speed and age
    name CSV files relative to its folder (`from_csv`). slide may also be a measured curve:
    {measured = "curve.csv", knots = 30} (`Measured`).
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

    def __post_init__(self) -> None:
        tables: dict[str, Table] = {}
        for name, columns in COLUMNS.items():
            lists = [getattr(self, column) for column in columns]
            if lists.count(None) == 1:
                missing = f"interface.law.{columns[lists.index(None)]}"
                raise SceneError(missing, None, "", "a list of numbers", "missing")
            if None not in lists:
                unit = getattr(IN_UNITS, name)
                tables[name] = Table(*lists).checked(f"interface.law.{columns[0]}", unit)
        object.__setattr__(self, "_tables", tables)

    @classmethod
    def of(cls, **tables: Source) -> Self:
        """Return a law with tables from files or functions.

        Args:
            tables: hold, slide, speed or age. Each table is the path of a CSV file of two columns
                (see `from_csv`), or a pair of a function and the end of its table, a number in SI
                units or text such as "3 um". slide may also be a `Measured` curve.

        Raises:
            SceneError: a table is unknown, a file cannot be used, or a function is not a valid law.
        """
        for name in tables:
            if name not in COLUMNS:
                raise unknown(name, tables[name], name, COLUMNS)
        return cls._made({name: _made(name, source) for name, source in tables.items()}, {})

    @classmethod
    def from_file(cls, entries: Mapping[str, Any], folder: Path | None) -> Self:
        """Return the law from a table of a scene file, which may name CSV files in its folder.

        Raises:
            SceneError: a file cannot be used, or a file is named although there is no folder.
        """
        rest, tables = dict(entries), {}
        for name, columns in COLUMNS.items():
            if name not in rest:
                continue
            source, field = rest.pop(name), f"interface.law.{name}"
            if folder is None:
                allowed = "lists of numbers: this text names no files"
                raise SceneError(field, source, "", allowed, "a file")
            if twice := [column for column in columns if column in rest]:
                allowed = f"either {name}, or {' and '.join(columns)}"
                raise SceneError(f"interface.law.{twice[0]}", rest[twice[0]], "", allowed, "twice")
            known = isinstance(source, dict) and source.keys() <= {"measured", "knots"}
            path = source.get("measured") if known else source
            if not isinstance(path, str):
                allowed = "the path of a CSV file, from the scene file on, or {measured = path}"
                raise SceneError(field, source, "", allowed, "no path")
            how = {"knots": source["knots"]} if known and "knots" in source else {}
            path = folder / path
            tables[name] = _made(name, Measured(path=path, **how) if known else path)
        return cls._made(tables, rest)

    @classmethod
    def _made(cls, tables: dict[str, Table], entries: dict[str, Any]) -> Self:
        """Return the law with these tables, and other entries of a scene file."""
        lists = {}
        for name, table in tables.items():
            lists |= zip(COLUMNS[name], (table.x, table.y), strict=True)
        made = from_entries(cls, entries, None, **lists)
        made._tables.update(tables)  # with the places of their knots
        return made

    def text(self) -> str:
        """Return a summary of the tables: "slip 0 to 3 um, 4 knots, mu 0.700 to 0.450"."""
        parts = []
        for name, table in self._tables.items():
            x, y = (column.replace("_", " ") for column in COLUMNS[name])
            end = with_prefix(table.x[-1], getattr(IN_UNITS, name))
            ends = f"{y} {table.y[0]:.3f} to {table.y[-1]:.3f}"
            parts.append(f"{x} 0 to {end}, {len(table.x)} knots, {ends}")
        return f"TabulatedLaw({'; '.join(parts)})"

    def ends(self) -> tuple[float, float] | None:
        """Return the first and the last mu of the table over slip."""
        return None if self.mu is None else (self.mu[0], self.mu[-1])

    def tables(self, of: Means) -> Tables:
        """Return the tables."""
        found = Tables(**self._tables)
        slide = _shares(found.slide, of) if found.slide else super().tables(of).slide
        return found._replace(slide=slide)


def _shares(table: Table, of: Means) -> Table:
    """Return the remaining share of mu_s - mu_k over slip/d_c, or over slip if d_c = 0."""
    if table.y[-1] != of.mu_k:
        last = f"{table.y[-1]!r}, at {table.place(len(table.y) - 1)}"
        allowed = f"the last mu of the table, {last}; or none: it is taken from there"
        raise SceneError("interface.mu_k", of.mu_k, "", allowed, "the table ends elsewhere")
    n = max(range(len(table.y)), key=table.y.__getitem__)
    drop = of.mu_s - of.mu_k
    if not drop > 0 or table.y[n] > of.mu_s:
        slip = with_prefix(table.x[n], "m")
        reason = f"mu too large, or too small to weaken: slip {slip}, {table.place(n)}"
        allowed = f"at most mu_s = {of.mu_s!r}, which is more than mu_k = {of.mu_k!r}"
        raise SceneError("interface.law.mu", table.y[n], "", allowed, reason)
    unit = of.d_c or 1.0
    x = tuple(slip / unit for slip in table.x)
    return Table(x, tuple((mu - of.mu_k) / drop for mu in table.y), table.places)


def _made(name: str, source: Source) -> Table:
    """Return the table of a source."""
    field, unit = f"interface.law.{name}", getattr(IN_UNITS, name)
    if isinstance(source, Measured):
        if name != "slide":
            raise SceneError(field, source, "", "a file or a function", "measured mu is slide")
        return source.table(field, unit)
    if isinstance(source, str | Path):
        return from_csv(source, field, unit)
    if not (isinstance(source, tuple | list) and len(source) == 2 and callable(source[0])):
        allowed = f"a CSV file, a function with the end of its table in {unit}, or a Measured curve"
        raise SceneError(field, source, "", allowed)
    function, end = source
    end = check_number(f"{field}.end", end, unit, gt=0.0)
    with naming(field):
        return sampled(function, end, unit)
