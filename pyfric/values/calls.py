"""Errors for calls with wrong arguments, which contain the correct call."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import ParamSpec, TypeVar

from pyfric.values.errors import SceneError
from pyfric.values.words import line, meant

P = ParamSpec("P")
T = TypeVar("T")
NAMED = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
"""Kinds of arguments that the correct call in an error contains."""


def usage(written: str = "") -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Decorate a function so that errors for wrong arguments contain the correct call.

    Args:
        written: the correct call; "" means the function with its required arguments.

    Raises:
        SceneError: an argument is missing, given twice, or unknown.
    """

    def of(function: Callable[P, T]) -> Callable[P, T]:
        signature = inspect.signature(function)
        given = signature.parameters.values()
        needed = [arg.name for arg in given if arg.default is arg.empty and arg.kind in NAMED]
        example = written or f"{function.__name__}({', '.join(needed)})"

        @functools.wraps(function)
        def called(*args: P.args, **keywords: P.kwargs) -> T:
            try:
                signature.bind(*args, **keywords)
            except TypeError as error:
                raise _misfit(example, str(error), signature, keywords) from None
            return function(*args, **keywords)

        return called

    return of


def _misfit(
    written: str, reason: str, signature: inspect.Signature, keywords: Mapping[str, object]
) -> SceneError:
    """Return the error for a call with wrong arguments; `inspect` gives the reason."""
    strange = [name for name in keywords if name not in signature.parameters]
    takes_more = any(arg.kind is arg.VAR_KEYWORD for arg in signature.parameters.values())
    for name in strange if takes_more else ():  # options of runs, or fields of scenes
        if instead := line(name):
            return SceneError(name, keywords[name], "", instead, "unknown here")
    name = reason.partition("'")[2].partition("'")[0]
    if name in strange:
        found = meant(name, signature.parameters)
        reason = "unknown" + f", did you mean {found!r}?" * bool(found)
    reason = "missing" if reason.startswith("missing") else reason
    return SceneError(name or "arguments", keywords.get(name), "", written, reason)
