"""Methods: their error and cost, stable steps, and limits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    Exit,
    SceneName,
    Seconds,
    Tell,
    check_folder,
    check_table,
    command_line,
    figure_out_option,
    file_option,
    overwrite_option,
    save_figure,
    save_table,
    scene_of,
    set_option,
    stop,
    telling,
)

if TYPE_CHECKING:
    import pandas as pd


budget_option = click.option(
    "--budget",
    type=Seconds(),
    default=60.0,
    help="Limit of processor time; methods beyond it are listed as not run. [default: 60 s]",
)


@main.command(section="Methods")
@click.argument("scene", metavar="SCENE", type=SceneName())
@click.option(
    "--t-end", type=Seconds(), help="End time of the runs. [default: after two main events]"
)
@budget_option
@set_option
@figure_out_option
@telling
def chart(
    scene: str,
    t_end: float | None,
    budget: float,
    changes: tuple[str, ...],
    out: Path,
    tell: Tell,
) -> None:
    """Measure error and cost of every fidelity and stepper for SCENE, for every question.

    The reference is full dynamics at a small step. Methods that refuse SCENE are listed with
    the reason. The files in DIR are chart.png, chart.pdf, the points as CSV, and their provenance.
    """
    check_folder(out)
    from pyfric.checks import chart as made

    table = made.chart(scene_of(scene, changes), t_end, budget=budget, say=tell.step)
    _tell(made, table, out / "chart", tell)


@main.command(section="Methods")
@click.argument("scene", metavar="SCENE", type=SceneName())
@budget_option
@set_option
@figure_out_option
@telling
def stability(scene: str, budget: float, changes: tuple[str, ...], out: Path, tell: Tell) -> None:
    """Measure each stepper's largest stable step for SCENE, and how errors grow beyond it.

    The files in DIR are stability.png, stability.pdf, the table as CSV, and their provenance.
    """
    check_folder(out)
    from pyfric.checks import stability as made

    table = made.stability(scene_of(scene, changes), budget=budget, say=tell.step)
    _tell(made, table, out / "stability", tell)


def _tell(made: Any, table: pd.DataFrame, stem: Path, tell: Tell) -> None:
    """Print a table, and save its figure without printing the names of its files."""
    save_figure(made.figure(table), stem, command_line(), Tell(quiet=True, as_json=False))
    tell.table(table, made.report)


@main.command(section="Methods")
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
def regimes(out: Path | None, overwrite: bool, tell: Tell) -> None:
    """Run scenes at the edges of the model and report what happens (about 15 s).

    The provenance is written beside the table. The exit code is 1 if a result is not as expected.
    """
    check_table(out, overwrite)
    from pyfric.checks import regimes as made

    table = made.observe(progress=tell.step)
    save_table(table, out, command_line(), "%.3g")
    tell.table(table, made.report)
    if not table["as_stated"].all():
        stop(Exit.FAILED, "Error: not everything is as stated")
