"""`pyfric resolve`."""

from __future__ import annotations

from typing import Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    EXIT_CODES,
    SceneName,
    Seconds,
    Tell,
    running,
    scene_of,
    set_option,
    telling,
)


@main.command(section="Simulate", epilog=EXIT_CODES)
@click.argument("scene", type=SceneName())
@click.option("--t-end", type=Seconds(), default=3.0, help="Latest end time. [default: 3 s]")
@set_option
@click.option(
    "--levels",
    type=click.IntRange(2, 5),
    default=2,
    show_default=True,
    help="Number of lattices: l, l/2, l/4 and so on.",
)
@click.option(
    "--fidelity",
    type=click.Choice(["quasistatic", "hybrid", "dynamic"]),
    default="quasistatic",
    show_default=True,
    help="Model; quasistatic takes seconds.",
)
@running
@telling
def resolve(
    scene: str,
    t_end: float,
    changes: tuple[str, ...],
    levels: int,
    fidelity: str,
    tell: Tell,
    **how: Any,
) -> None:
    """Measure which results of SCENE change with the size of its blocks, and by how much.

    The same slab is run with blocks of l, l/2 and so on, up to the first event of the whole
    interface. Finished runs are kept: after Ctrl-C the same command goes on.
    """
    import pyfric
    from pyfric.display import plain

    found = pyfric.resolve(
        scene_of(scene, changes),
        t_end,
        levels=levels,
        options={"fidelity": fidelity},
        progress=tell.progress,
        **how,
    )
    rows = plain(found.table.to_dict("index"))
    tell.result({"quantities": rows, "notes": list(found.notes)}, lambda: str(found))
