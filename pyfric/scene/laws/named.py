"""Laws that other packages offer as tables: entry points of the group `pyfric.laws`."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import entry_points

from pyfric.scene.laws.tabulated import TabulatedLaw
from pyfric.values import SceneError, naming, unknown

GROUP = "pyfric.laws"


def named(name: str) -> TabulatedLaw:
    """Return the law that an installed package offers under this name.

    The package has an entry point of this name in the group `pyfric.laws`. The entry point leads to
    a `TabulatedLaw`, or to its columns in SI units: {"slip": [...], "mu": [...]}.

    Raises:
        SceneError: no package, or more than one, offers this name; or what it offers cannot be
            loaded, or is no such law.
    """
    points = entry_points(group=GROUP)
    if name not in points.names:
        raise unknown("law", name, str(name), sorted(points.names))
    offered = tuple(points.select(name=name))
    by = ", ".join(sorted({point.dist.name if point.dist else point.value for point in offered}))
    if len(offered) > 1:
        raise SceneError("law", name, "", "a name that one package offers", f"offered by {by}")
    try:
        law = offered[0].load()
    except (ImportError, AttributeError) as error:
        allowed = f"what {by} can load: {offered[0].value}"
        raise SceneError("law", name, "", allowed, str(error)) from error
    if isinstance(law, Mapping):
        with naming(where=f"{name} of {by}"):
            law = TabulatedLaw(**law)
    if not isinstance(law, TabulatedLaw):
        allowed = "a TabulatedLaw, or a dict of its columns"
        raise SceneError("law", type(law).__name__, "", allowed, f"{name} of {by} is no table")
    return law
