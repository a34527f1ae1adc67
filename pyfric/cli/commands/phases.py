"""`pyfric phase-diagram`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    EXIT_CODES,
    SceneName,
    Seconds,
    Tell,
    check_folder,
    command_line,
    figure_out_option,
    running,
    save_figure,
    scene_of,
    set_option,
    telling,
)


@main.command("phase-diagram", section="Simulate", epilog=EXIT_CODES)
@click.argument("scene", type=SceneName(), required=False)
@set_option
@click.option("--x", metavar="FIELD=FROM:TO:N[:log]", help="Field along x, with its values in SI.")
@click.option("--y", metavar="FIELD=FROM:TO:N[:log]", help="Field along y, likewise.")
@click.option("--t-end", type=Seconds(), help="End time of the runs of SCENE.")
@click.option("--stop-when", multiple=True, metavar="CONDITION", help="As in pyfric run.")
@click.option("--lines/--no-lines", default=True, help="Find where labels change. [default: yes]")
@figure_out_option
@running
@telling
def phase_diagram(
    scene: str | None,
    changes: tuple[str, ...],
    x: str | None,
    y: str | None,
    t_end: float | None,
    stop_when: tuple[str, ...],
    out: Path,
    tell: Tell,
    **how: Any,
) -> None:
    """Map the largest rupture of SCENE over two fields: its class and its speed.

    Without SCENE: the chain of Thogersen et al. (2019), over alpha/sqrt(k m) and tau_bar. DIR gets
    phases.png, phases.pdf and the points and lines as CSV. Finished runs are kept, so that the same
    command continues a stopped map.
    """
    import pyfric
    from pyfric import figures

    if scene is None and (changes or stop_when or t_end is not None):
        raise click.UsageError("--set, --t-end and --stop-when need a SCENE.")
    check_folder(out)
    if scene is not None:
        how |= {"t_end": t_end, "options": {"stop_when": stop_when or None}}
    what = None if scene is None else scene_of(scene, changes)
    axes = {side: given and _axis(side, given) for side, given in (("x", x), ("y", y))}
    found = pyfric.phase_diagram(what, **axes, progress=tell.progress, **how)
    save_figure(figures.phase_map(found), out / "phases", command_line(), tell)


def _axis(side: str, given: str) -> tuple[str, list[float]]:
    """Return the name of a field and its values, from the text of an option."""
    from pyfric.scene import SceneError
    from pyfric.sweeps import Span

    name, _, values = given.partition("=")
    parts = values.split(":")
    try:
        start, stop, n, scale = [*parts, *["linear"] * (len(parts) == 3)]
        start, stop, n = float(start), float(stop), int(n)
    except ValueError:
        allowed = "FIELD=FROM:TO:N, or FIELD=FROM:TO:N:log, numbers in SI"
        raise SceneError(side, given, "", allowed, "not a range of this form") from None
    return name.strip(), Span(start=start, stop=stop, n=n, scale=scale).values(name)
