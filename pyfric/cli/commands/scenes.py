"""Scenes: show, plan."""

from __future__ import annotations

from pathlib import Path

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    SceneName,
    Seconds,
    Tell,
    check_out,
    file_option,
    overwrite_option,
    scene_of,
    set_option,
    telling,
    tolerance_option,
    want_option,
)


@main.command(section="Simulate")
@click.argument("scene", type=SceneName())
@set_option
@file_option("--out", metavar="FILE", help="Write a file instead of stdout.")
@overwrite_option
def scene(scene: str, changes: tuple[str, ...], out: Path | None, overwrite: bool) -> None:
    """Print SCENE as TOML, to be changed."""
    what = scene_of(scene, changes)
    check_out(out, overwrite, reads=[scene])
    text = what.to_toml(out)
    if out is None:
        click.echo(text, nl=False)


@main.command(section="Simulate")
@click.argument("scene", type=SceneName())
@click.option("--t-end", type=Seconds(), default=1.0, help="End time. [default: 1 s]")
@set_option
@want_option
@tolerance_option
@click.option("--stop-when", multiple=True, metavar="CONDITION", help="As in pyfric run.")
@telling
def plan(
    scene: str,
    t_end: float,
    changes: tuple[str, ...],
    want: str,
    tolerance: float,
    stop_when: tuple[str, ...],
    tell: Tell,
) -> None:
    """Choose the model of SCENE that meets a tolerance, with reasons and cost."""
    import dataclasses

    import pyfric

    how = {"t_end": t_end, "stop_when": stop_when or None}
    found = pyfric.plan(scene_of(scene, changes), want, tolerance, **how)
    listed = [one._asdict() | {"holds": one.holds} for one in found.assumptions]
    tell.result(dataclasses.asdict(found) | {"assumptions": listed}, lambda: str(found))
