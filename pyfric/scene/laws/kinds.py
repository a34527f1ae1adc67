"""What a friction law is: up to four tables, and the registry of kinds.

A kind is a frozen dataclass under `@law`. Its methods say what differs from Amontons-Coulomb
friction, each as a `Table`:

    hold    what mu_s has gained         over the time since the block stuck, s
    slide   share of mu_s - mu_k left    over slip/d_c
    speed   factor of mu                 over |v|, m/s
    age     factor of mu                 over the time since slip began, s
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from pyfric.scene.laws.table import Table
from pyfric.scene.units import SceneError

__all__ = ["KINDS", "UNITS", "FrictionLaw", "Means", "Tables", "check_tables", "law"]

Kind = TypeVar("Kind", bound="type[FrictionLaw]")

KINDS: dict[str, type[FrictionLaw]] = {}
"""Kinds of laws by name."""

STRAIGHT = Table((0.0, 1.0), (1.0, 0.0))


class Means(NamedTuple):
    """Means of an interface's mu_s, mu_k and d_c (m)."""

    mu_s: float
    mu_k: float
    d_c: float


class Tables(NamedTuple):
    """The tables of a law; None where there is nothing to say."""

    hold: Table | None = None
    slide: Table | None = None
    speed: Table | None = None
    age: Table | None = None


class FrictionLaw:
    """A kind of friction law; as it stands, friction weakens linearly over d_c.

    Attributes:
        kind: its name in scene files.
        rests: whether a block can stick.
        fields: names of its parameters that are fields: a number, a list or a `Spread`.
        example: values of its parameters, with mu_k = 0.45; the tests run every kind with them.
    """

    kind: ClassVar[str]
    rests: ClassVar[bool] = True
    fields: ClassVar[tuple[str, ...]] = ()
    example: ClassVar[dict[str, Any]] = {}
    _section: ClassVar[str] = "interface.law"
    _allowed: ClassVar[dict[str, str]] = {}

    @classmethod
    def read_files(cls, table: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Return the table [interface.law] of a scene file in `folder`, with what files hold."""
        return table

    def hold(self, of: Means) -> Table | None:
        """Return what mu_s gains over the time since the block stuck (s)."""

    def slide(self, of: Means) -> Table | None:
        """Return the share of mu_s - mu_k that is left, over slip/d_c."""
        return STRAIGHT if of.d_c > 0 else None

    def speed(self, of: Means) -> Table | None:
        """Return the factor of mu over |v| (m/s)."""

    def age(self, of: Means) -> Table | None:
        """Return the factor of mu over the time since slip began (s)."""

    def __repr__(self) -> str:
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        set_values = (
            f"{name}={_short(value)}" for name, value in values.items() if value is not None
        )
        return f"{type(self).__name__}({', '.join(set_values)})"

    def tables(self, of: Means) -> Tables:
        """Return the tables of an interface with these means."""
        return Tables(self.hold(of), self.slide(of), self.speed(of), self.age(of))


def _short(value: Any) -> str:
    """Return a value, or of a long list its length and ends."""
    if isinstance(value, tuple) and len(value) > 4:
        return f"<{len(value)} values, {value[0]:.4g} to {value[-1]:.4g}>"
    return repr(value)


def law(kind: Kind) -> Kind:
    """Add a kind to the registry, by its attribute `kind`."""
    KINDS[kind.kind] = kind
    kind.__repr__ = FrictionLaw.__repr__
    return kind


UNITS = Tables("s", "", "m/s", "s")
"""Units of what the tables are over."""


def check_tables(tables: Tables) -> None:
    """Check what the core and the contact rules rely on.

    A stuck block gains strength or keeps it. One that comes to rest bears at most mu_s p, or it
    could neither slip on nor stick.

    Raises:
        SceneError: a table is not in order, negative, falls or rises where it must not.
    """
    for name, table in tables._asdict().items():
        if table is None:
            continue
        field, unit = f"interface.law.{name}", getattr(UNITS, name)
        y = np.array(table.checked(field, unit).y)
        if y.min() < 0:
            n = int(np.argmin(y))
            raise SceneError(field, float(y[n]), "", "at least 0", f"knot {n + 1}: negative")
        if name == "hold" and (y[0] or (np.diff(y) < 0).any()):
            n = int(np.argmax(np.diff(y) < 0)) + 1 if not y[0] else 0
            allowed = "a gain that starts at 0 and does not fall"
            raise SceneError(field, float(y[n]), "", allowed, f"knot {n + 1}: no gain of mu_s")
        at_rest = {"slide": y.max(), "speed": y[0], "age": y.max()}.get(name, 0.0)
        if at_rest > 1:
            allowed = "at most 1 where a block comes to rest, which bears no more than mu_s p"
            raise SceneError(field, float(at_rest), "", allowed, "too large")
