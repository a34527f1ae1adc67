"""Friction laws as up to four tables, the registry of their kinds, and laws of few parameters.

Tables are linear between knots and constant beyond the last one. A kind is a frozen dataclass with
the decorator `@law`. Its method `tables` returns the deviations from Amontons-Coulomb friction:

    hold    gain of mu_s                 over the time since the block stuck, s
    slide   share of mu_s - mu_k left    over slip/d_c
    speed   factor of mu                 over |v|, m/s
    age     factor of mu                 over the time since slip began, s
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar, dataclass_transform

import numpy as np

from pyfric.values import NotNegative, Positive, SceneError, annotations, check_number, naming, part

Kind = TypeVar("Kind", bound="type[FrictionLaw]")

KINDS: dict[str, type[FrictionLaw]] = {}
"""Kinds of laws by name."""
MAX_KNOTS = 1000
"""Largest number of knots of a table."""
CLOSE = 1e-3
"""Error of `sampled`, over the range of the function."""
FAR = 8.0
"""End of the exponentials in units of d_c or t_c; there exp(-8) = 3.4e-4 of them is left."""
PER_DECADE, DECADES = 32, 9
"""Knots for each decade of time after t_c, and the number of decades of the table of `Ageing`."""


@dataclasses.dataclass(frozen=True)
class Table:
    """Knots x, which increase from 0, and values y.

    For messages, `places` gives the origin of each knot, such as "friction.csv, row 3".
    """

    x: tuple[float, ...]
    y: tuple[float, ...]
    places: tuple[str, ...] = dataclasses.field(default=(), compare=False)

    def __repr__(self) -> str:
        return f"<table of {len(self.x)} knots up to {self.x[-1]:.4g}>"

    def place(self, n: int) -> str:
        """Return the origin of knot n, counted from 0."""
        return self.places[n] if self.places else f"knot {n + 1}"

    def __call__(self, x: Any) -> Any:
        """Return the values at x, of any shape."""
        return np.interp(x, self.x, self.y)

    @property
    def slopes(self) -> np.ndarray:
        """Slopes between neighbouring knots."""
        return np.diff(self.y) / np.diff(self.x)

    @property
    def area(self) -> float:
        """Integral over all knots."""
        return float(np.trapezoid(self.y, self.x))

    def checked(self, name: str, unit: str) -> Table:
        """Return the table after a check of its knots and values.

        Raises:
            SceneError: the knots are not in order, or a value is not finite.
        """
        if len(self.x) != len(self.y) or not 2 <= len(self.x) <= MAX_KNOTS:
            allowed = f"2 to {MAX_KNOTS} knots, each with one value"
            raise SceneError(name, [len(self.x), len(self.y)], "", allowed, "lengths do not fit")
        for n, (x, y) in enumerate(zip(self.x, self.y, strict=True)):
            with naming(where=self.place(n)):
                check_number(name, x, unit, ge=0.0)
                check_number(name, y, "")
        if self.x[0] != 0:
            reason = f"{self.place(0)}: tables start at 0"
            raise SceneError(name, self.x[0], unit, f"0 {unit}".strip(), reason)
        if (np.diff(self.x) <= 0).any():
            n = int(np.argmax(np.diff(self.x) <= 0)) + 1
            allowed = f"more than {self.x[n - 1]!r} {unit}".strip() + ": laws do not jump"
            reason = f"{self.place(n)}: not beyond the one before"
            raise SceneError(name, self.x[n], unit, allowed, reason)
        return self


def sampled(function: Callable[[float], float], end: float, unit: str = "") -> Table:
    """Return a table that follows a function on [0, end].

    Intervals are halved until the chord is close to the function. The chord is compared at the
    quarters of an interval, and at those of 17 points of the whole range that lie inside it. The
    allowed error is `CLOSE` times the range of the function on these points.

    Args:
        function: a function of one number.
        end: end of the table, in the unit of the argument.
        unit: this unit, for messages.

    Raises:
        SceneError: a value is not a finite number, or more than `MAX_KNOTS` would be needed. The
            error does not name the field.
    """
    end = check_number("end", end, "", gt=0.0)

    def value(x: float) -> float:
        with naming(where=f"the function at {x:.6g} {unit}".rstrip()):
            return check_number("", function(x), "")

    coarse = [end * n / 16 for n in range(17)]
    found = [value(known) for known in coarse]
    allowed = CLOSE * (max(found) - min(found))
    x, y, todo = [0.0], [found[0]], [(0.0, end)]
    while todo:
        a, b = todo.pop()
        y_a, y_b = value(a), value(b)
        shares = [0.25, 0.5, 0.75, *((known - a) / (b - a) for known in coarse if a < known < b)]
        off = max(abs(value(a + share * (b - a)) - (y_a + share * (y_b - y_a))) for share in shares)
        if off > allowed and len(x) + len(todo) > MAX_KNOTS:
            reason = f"below {b:.6g} {unit}".rstrip() + ": it jumps, or is too rough"
            raise SceneError("", function, "", f"what {MAX_KNOTS} knots can follow", reason)
        if off > allowed:
            todo += [((a + b) / 2, b), (a, (a + b) / 2)]
        else:
            x.append(b)
            y.append(y_b)
    return Table(tuple(x), tuple(y))


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


class Variable(NamedTuple):
    """A quantity of each block under a law: a field, a state variable, or a recorded quantity.

    Attributes:
        name, unit: its name, and its SI unit, "1" without one.
        meaning: its meaning, as written to files.
        dtype: type in records.
    """

    name: str
    unit: str
    meaning: str
    dtype: str = "f8"


class FrictionLaw:
    """Base class of friction laws. By default, friction weakens linearly over d_c.

    Attributes:
        kind: name of the law in scene files.
        fields: parameters that are fields, a number, a list or a `Spread`, and their meanings.
        coefficient: name of the field that both mu_s and mu_k are, "" if there is none.
        example: values of the parameters for tests, with mu_k = 0.45.
    """

    kind: ClassVar[str]
    fields: ClassVar[dict[str, str]] = {}
    coefficient: ClassVar[str] = ""
    example: ClassVar[dict[str, Any]] = {}
    _section: ClassVar[str] = "interface.law"

    @classmethod
    def variables(cls) -> tuple[Variable, ...]:
        """Return the fields with their units and meanings."""
        units = annotations(cls)
        return tuple(Variable(n, units[n].unit or "1", said) for n, said in cls.fields.items())

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
    """Make a class a part (`pyfric.values.checked`), and register it by its attribute `kind`."""
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


# --- laws of few parameters ----------------------------------------------------------------------


@law
class LinearWeakening(FrictionLaw):
    """mu = mu_s - (mu_s - mu_k) min(s/d_c, 1); with d_c = 0 it is Amontons-Coulomb friction.

    Source: PRL 107, 074301 (2011), interface law, and its remark on slip weakening.
    """

    kind: ClassVar[str] = "linear"


@law
class ExponentialWeakening(FrictionLaw):
    """mu = mu_k + (mu_s - mu_k) exp(-s/d_c), within 1e-3 (mu_s - mu_k), up to s = 8 d_c.

    For larger slip mu = mu_k.

    Source: S. Abercrombie, J. Rice, Geophys. J. Int. 162, 406 (2005), laws of slip weakening.
    """

    kind: ClassVar[str] = "exponential"

    def tables(self, of: Means) -> Tables:
        """Return the exponential; its last value is 0."""
        if not of.d_c > 0:
            allowed = "a finite number > 0 m with an exponential law"
            raise SceneError("interface.d_c", of.d_c, "m", allowed, "nothing to decay over")
        return Tables(slide=_decay())


@law
class Ageing(FrictionLaw):
    """mu_s + B log10(1 + t/t_c) after a block has stuck for t; it slips like `LinearWeakening`.

    Args:
        B: gain of mu_s for each decade of time, >= 0.
        t_c: time at which the gain begins, s, > 0.

    The table has 32 knots for each decade, so that the gain in a decade is right within 3e-4 B. The
    table ends at t = 1e9 t_c.

    Source: J. H. Dieterich, J. Geophys. Res. 77, 3690 (1972), time-dependent friction.
    """

    B: Annotated[float, NotNegative("")]
    t_c: Annotated[float, Positive("s")]

    kind: ClassVar[str] = "ageing"
    example: ClassVar[dict[str, float]] = {"B": 0.02, "t_c": 1e-5}

    def tables(self, of: Means) -> Tables:
        """Return the tables, with the gain on knots evenly spaced in log(1 + t/t_c)."""
        decades = [n / PER_DECADE for n in range(PER_DECADE * DECADES + 1)]
        x = (self.t_c * (10.0**n - 1) for n in decades)
        gain = Table(tuple(x), tuple(self.B * n for n in decades)) if self.B else None
        return super().tables(of)._replace(hold=gain)


@law
class ExponentialHealing(FrictionLaw):
    """mu_s + gain (1 - exp(-t/t_c)) after a block has stuck for t, within 1e-3 gain.

    A block then slips as in `LinearWeakening`.

    Args:
        gain: gain of mu_s after a long contact time, >= 0.
        t_c: time scale of the gain, s, > 0.

    Source: A. Yu. Ishlinskii, I. V. Kragelskii, Zh. Tekh. Fiz. 14, 276 (1944), static friction
    that grows with the time of contact and saturates.
    """

    gain: Annotated[float, NotNegative("")]
    t_c: Annotated[float, Positive("s")]

    kind: ClassVar[str] = "healing"
    example: ClassVar[dict[str, float]] = {"gain": 0.05, "t_c": 1e-4}

    def tables(self, of: Means) -> Tables:
        """Return the tables, with the gain."""
        unit = _decay()
        x = tuple(self.t_c * time for time in unit.x)
        gain = Table(x, tuple(self.gain * (1 - left) for left in unit.y)) if self.gain else None
        return super().tables(of)._replace(hold=gain)


@law
class SpeedDependent(FrictionLaw):
    """`LinearWeakening` with mu of a slipping block multiplied by a factor that depends on speed.

    Args:
        v: speeds, m/s, from 0 on, increasing.
        factor: factor of mu at each speed, >= 0; linear between speeds, constant after the last.

    Source: J. H. Dieterich, J. Geophys. Res. 84, 2161 (1979): friction changes with speed.
    """

    v: Annotated[tuple[float, ...], NotNegative("m/s", listed=True)]
    factor: Annotated[tuple[float, ...], NotNegative("", listed=True)]

    kind: ClassVar[str] = "speed"
    example: ClassVar[dict[str, Any]] = {"v": (0.0, 0.02, 0.1), "factor": (1.0, 0.7, 0.85)}

    def tables(self, of: Means) -> Tables:
        """Return the tables, with the factor."""
        return super().tables(of)._replace(speed=Table(self.v, self.factor))


@functools.cache
def _decay() -> Table:
    end = math.exp(-FAR)
    return sampled(lambda x: (math.exp(-x) - end) / (1 - end), FAR)
