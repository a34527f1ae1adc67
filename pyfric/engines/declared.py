"""Declaration of an option: its owner, meaning, unit, allowed values and default, in one place.

The documentation of `pyfric.Options` and the options of the command line follow from declarations.
So does which options an engine refuses, which a continued run keeps, and which a job may have.
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
"""What an option belongs to: the choice of the engine; every run; runs that find events, make time
steps, or can keep energies; or the machine, on which the result does not depend."""
LACKS: dict[Owner, str] = {
    "run": "does not have it",
    "events": "finds no event whose error could be measured",
    "steps": "makes no time steps",
    "energies": "does not follow all energies",
}
"""What an engine does that does not have the options of an owner; engines decide on no others."""
REGISTERED: dict[str, Any] = {}
"""All engines by name; see `ENGINES`."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Option:
    """Declaration of an option.

    Args:
        owner: what it belongs to.
        meaning: its meaning, in sentences, of which the first one is for the command line.
        unless: what None means; "" if it needs no words.
        nothing: value that asks for nothing, in words of messages; beside it None does, too.
        kept: function of the method of a record that returns the value that a continued run has;
            None if it may change.
        default: its default.
        mark: annotation of its values.
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
        """Whether engines decide if a run can have it."""
        return self.owner in LACKS

    def asks(self, value: Any) -> bool:
        """Return whether a value asks for something."""
        return value is not None and value not in (self.default, self.nothing)

    @property
    def lack(self) -> str:
        """What an engine does that does not have the option."""
        return LACKS[self.owner]

    @property
    def text(self) -> str:
        """Its meaning, with that of None."""
        return self.meaning + f" None means {self.unless}." * bool(self.unless)

    @property
    def short(self) -> str:
        """Its meaning in a sentence, with its default."""
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
    """Return the documentation of a class with these options."""
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
    """Annotation of a processor time, or of a multiple of that of a run, such as "3 x"."""

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
    """Return the number of a multiple such as "3 x", None for anything else."""
    if not (isinstance(budget, str) and budget.rstrip().endswith("x")):
        return None
    try:
        return float(budget.rstrip()[:-1])
    except ValueError:
        return None


@dataclasses.dataclass(frozen=True)
class Count(Annotation):
    """Annotation of a whole number from 1 to a largest one, or None."""

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
