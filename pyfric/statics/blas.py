"""Threads of BLAS. One thread is faster than several threads for small problems and products."""

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

SMALL = 250
"""Largest N_x for which BLAS uses one thread; matrices have 2 N_x rows."""

F = TypeVar("F", bound="Callable[..., Any]")


@functools.cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[Any]:
    """Return a context manager in which BLAS uses one thread."""
    return cast("AbstractContextManager[Any]", _controller().limit(limits=1, user_api="blas"))


def one_thread_if_small(function: F) -> F:
    """Decorate a function of a scene so that BLAS uses one thread if N_x is small.

    The scene is the first argument. If the caller passes the name of a preset or a file, the
    function gets the scene. Floating-point warnings follow NumPy's defaults, independent of the
    caller's `numpy.seterr`.
    """

    @functools.wraps(function)
    def limited(scene: Any, *args: Any, **kwargs: Any) -> Any:
        scene = as_scene(scene)
        small = scene.N_x <= SMALL
        usual = np.errstate(divide="warn", over="warn", under="ignore", invalid="warn")
        with usual, one_thread() if small else nullcontext():
            return function(scene, *args, **kwargs)

    return cast("F", limited)
