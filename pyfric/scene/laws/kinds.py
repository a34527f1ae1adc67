"""Friction laws as up to four tables, and the registry of their kinds.

A kind is a frozen dataclass under `@law`. Its method `tables` returns the deviations from
Amontons-Coulomb friction, each as a `Table`:

    hold    gain of mu_s                 over the time since the block stuck, s
    slide   share of mu_s - mu_k left    over slip/d_c
    speed   factor of mu                 over |v|, m/s
    age     factor of mu                 over the time since slip began, s
"""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar, NamedTuple, TypeVar, dataclass_transform

import numpy as np

from pyfric.scene.checked import part
from pyfric.scene.errors import SceneError
from pyfric.scene.laws.table import Table

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
    """The tables of a law; None means no effect."""

    hold: Table | None = None
    slide: Table | None = None
    speed: Table | None = None
    age: Table | None = None


class FrictionLaw:
    """Base class of friction laws. By default, friction weakens linearly over d_c.

    Attributes:
        kind: name of the law in scene files.
        rests: whether blocks can stick under this law.
        fields: names of parameters that are fields: a number, a list or a `Spread`.
        example: values of the parameters for tests, with mu_k = 0.45.
    """

    kind: ClassVar[str]
    rests: ClassVar[bool] = True
    fields: ClassVar[tuple[str, ...]] = ()
    example: ClassVar[dict[str, Any]] = {}
    _section: ClassVar[str] = "interface.law"

    def tables(self, of: Means) -> Tables:
        """Return the tables of the law for an interface with these means."""
        return Tables(slide=STRAIGHT if of.d_c > 0 else None)

    def ends(self) -> tuple[float, float] | None:
        """Return the first and the last mu if the law is a table of mu, None otherwise."""

    def text(self) -> str:
        """Return the law as one line of text."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        shown = (f"{name}={_short(x)}" for name, x in values.items() if x is not None)
        return f"{type(self).__name__}({', '.join(shown)})"


def _short(value: Any) -> str:
    """Return the text of a value; for a long list, its length and ends."""
    if isinstance(value, tuple) and len(value) > 4:
        return f"<{len(value)} values, {value[0]:.4g} to {value[-1]:.4g}>"
    return repr(value)


@dataclass_transform(frozen_default=True, kw_only_default=True)
def law(kind: Kind) -> Kind:
    """Make a class a part (`pyfric.scene.checked`), and register it by its attribute `kind`."""
    kind = part(kind)
    KINDS[kind.kind] = kind
    kind.__repr__ = kind.text
    return kind


UNITS = Tables("s", "", "m/s", "s")
"""Units of the arguments of the tables."""


def check_tables(tables: Tables) -> None:
    """Check the conditions on which the core and the contact rules rely.

    A stuck block may not lose strength. Friction of a block that comes to rest may not exceed
    mu_s p, because such a block could neither continue to slip nor stick.

    Raises:
        SceneError: a table is out of order, negative, or violates one of these conditions.
    """
    for name, table in tables._asdict().items():
        if table is None:
            continue
        y = np.array(table.checked(f"interface.law.{name}", getattr(UNITS, name)).y)
        falls = np.append(y[:1] != 0, np.diff(y) < 0) & (name == "hold")
        at_rest = (y > 1) & ((name in ("slide", "age")) | ((name == "speed") & (y == y[0])))
        for wrong, allowed, reason in (
            (y < 0, "at least 0", "negative"),
            (falls, "a gain that starts at 0 and does not fall", "no gain of mu_s"),
            (at_rest, "at most 1 where a block comes to rest, which bears mu_s p", "too large"),
        ):
            if wrong.any():
                n = int(np.argmax(wrong))
                reason = f"{table.place(n)}: {reason}"
                raise SceneError(f"interface.law.{name}", float(y[n]), "", allowed, reason)
