"""Declaration of an option: its owner, meaning, unit, allowed values and default, in one place.

From these declarations follow the documentation of `pyfric.Options` and the options of the command
line. The declarations also decide which options an engine refuses, and which options a continued
run takes over.
"""

from __future__ import annotations

import dataclasses
import os
import textwrap
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pyfric.engines.step_sizes import is_auto
from pyfric.scene import Conditions
from pyfric.values import Annotation, Quantity, SceneError, Words, check_number, check_whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.record import Method
    from pyfric.values import Written

Owner = Literal["plan", "run", "events", "steps", "energies", "machine"]
"""Owner of an option, which decides the runs that have the option. "plan": the choice of the
engine. "run": every run. "events", "steps", "energies": runs that find events, make time steps, or
can compute energies. "machine": every run; the option does not change results."""
LACKS: dict[Owner, str] = {
    "run": "does not have it",
    "events": "finds no event whose error could be measured",
    "steps": "makes no time steps",
    "energies": "does not follow all energies",
}
"""Owner -> reason, in words, why an engine lacks the owner's options. All engines have the options
of the other owners."""
REGISTERED: dict[str, Any] = {}
"""All engines by name; see `ENGINES`."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Option:
    """Declaration of an option.

    Args:
        owner: the owner of the option.
        meaning: text of its meaning. The help of the command line shows the first sentence.
        unless: meaning of None; "" if obvious.
        nothing: a value with the same effect as None.
        kept: function that returns the value of the option in a continued run, from the method of
            the record; None if a continued run may change the option.
        default: the default of the option.
        mark: annotation of the values of the option.
    """

    owner: Owner
    meaning: str
    unless: str = ""
    nothing: Any = None
    kept: Callable[[Method], Any] | None = None
    default: Any = None
    mark: Annotation = dataclasses.field(default_factory=Annotation)

    @property
    def of_engine(self) -> bool:
        """Whether some engines lack the option."""
        return self.owner in LACKS

    def asks(self, value: Any) -> bool:
        """Return whether a value differs from None, from the default and from `nothing`."""
        return value is not None and value not in (self.default, self.nothing)

    @property
    def lack(self) -> str:
        """Reason, in words, why an engine lacks the option."""
        return LACKS[self.owner]

    @property
    def text(self) -> str:
        """Meaning of the option and of None."""
        return self.meaning + f" None means {self.unless}." * bool(self.unless)

    @property
    def short(self) -> str:
        """Meaning of the option in one sentence, with its default."""
        default = self.unless or self.default
        shown = "" if default in (None, "") else f" [default: {default}]"
        return self.meaning.partition(". ")[0].rstrip(".") + "." + shown


def option(default: Any, owner: Owner, meaning: str, **more: Any) -> Any:
    """Return the field of a dataclass that declares an option; see `Option`."""
    meaning = " ".join(meaning.split())
    more = {"nothing": default, **more}
    made = Option(owner=owner, meaning=meaning, default=default, **more)
    return dataclasses.field(default=default, metadata={"option": made})


def documented(head: str, options: dict[str, Option], tail: str) -> str:
    """Return the docstring of a class: `head`, a list of the options, and `tail`."""
    lines = [
        textwrap.fill(
            f"{name}: {declared.text}", 100, initial_indent=" " * 8, subsequent_indent=" " * 12
        )
        for name, declared in options.items()
    ]
    return "\n".join([head, "", "    Args:", *lines, "", tail])


# --- values --------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Step(Quantity):
    """Annotation of a time step, or "auto"."""

    unit: str = "s"
    gt: float | None = 0.0
    note: str = ", or 'auto'"

    def check(self, value: Any, written: Written | None = None) -> Any:
        return value if is_auto(value) else super().check(value, written)


class EngineName(Annotation):
    """Annotation of the name of an engine, or "auto"."""

    @property
    def words(self) -> tuple[str, ...]:
        return ("auto", *REGISTERED)

    @property
    def allowed(self) -> str:
        return Words(self.words).allowed

    def check(self, value: Any, written: Written | None = None) -> Any:
        return Words(self.words).check(value, written)


class YesNo(Annotation):
    """Annotation of True, False or None."""

    allowed = "True, False or None"

    def check(self, value: Any, written: Written | None = None) -> bool | None:
        if not isinstance(value, bool | np.bool | None):
            raise SceneError("", value, "", self.allowed)
        return None if value is None else bool(value)


@dataclasses.dataclass(frozen=True)
class Budget(Quantity):
    """Annotation of a processor time, or of a multiple of the time of a run, such as "3 x"."""

    unit: str = "s"
    gt: float | None = 0.0
    optional: bool = True
    note: str = ", or a multiple such as '3 x'"

    def check(self, value: Any, written: Written | None = None) -> Any:
        if isinstance(value, bool | np.bool):
            allowed = f"{self.allowed}; energies = True keeps the energy budget"
            raise SceneError("", value, "", allowed)
        times = multiple(value)
        if times is None:
            return super().check(value, written)
        return f"{check_number('', times, '', ge=1.0):g} x"


def multiple(budget: Any) -> float | None:
    """Return the factor in a multiple such as "3 x"; None if the value is no such text."""
    if not (isinstance(budget, str) and budget.rstrip().endswith("x")):
        return None
    try:
        return float(budget.rstrip()[:-1])
    except ValueError:
        return None


@dataclasses.dataclass(frozen=True)
class Count(Annotation):
    """Annotation of an integer from 1 to a largest value, or None."""

    largest: int

    def check(self, value: Any, written: Written | None = None) -> int | None:
        return None if value is None else check_whole("", value, 1, self.largest, note=" or None")


class FilePath(Annotation):
    """Annotation of the path of a file, or None."""

    allowed = "a path or None"

    def check(self, value: Any, written: Written | None = None) -> Any:
        if not isinstance(value, str | os.PathLike | None):
            raise SceneError("", value, "", self.allowed)
        return value


class Ends(Conditions):
    """Annotation of conditions that end a run, or None."""

    def check(self, value: Any, written: Written | None = None) -> tuple[str, ...] | None:
        return None if value is None else super().check(value, written)
