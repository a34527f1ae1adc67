"""Threads of BLAS: one for small problems and products, which more threads only slow down."""

from __future__ import annotations

import functools
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from threadpoolctl import ThreadpoolController

from pyfric.scene import as_scene

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

__all__ = ["SMALL", "one_thread", "one_thread_if_small"]

SMALL = 250
"""Matrices of up to twice this size run on one thread."""
ARITHMETIC = {"divide": "warn", "over": "warn", "under": "ignore", "invalid": "warn"}
"""NumPy's defaults."""

F = TypeVar("F", bound="Callable[..., Any]")


@functools.cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[Any]:
    """Let BLAS use one thread in a block."""
    return cast("AbstractContextManager[Any]", _controller().limit(limits=1, user_api="blas"))


def one_thread_if_small(function: F) -> F:
    """Let BLAS use one thread in a function of a scene (its first argument) with few columns.

    The function gets the scene where its caller gives the name of a preset or a file. Arithmetic
    follows NumPy's defaults there, whatever the caller's `numpy.seterr` says.
    """

    @functools.wraps(function)
    def limited(scene: Any, *args: Any, **kwargs: Any) -> Any:
        scene = as_scene(scene)
        small = scene.N_x <= SMALL
        with np.errstate(**ARITHMETIC), one_thread() if small else nullcontext():
            return function(scene, *args, **kwargs)

    return cast("F", limited)
