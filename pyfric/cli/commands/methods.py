"""Methods: error and cost, stable steps, and where they fail."""

from __future__ import annotations

from pathlib import Path

from pyfric.cli.app import main
from pyfric.cli.shared import (
    Exit,
    Tell,
    check_folder,
    check_table,
    figure_out_option,
    file_option,
    overwrite_option,
    save_figure,
    save_table,
    stop,
    telling,
)


@main.command(section="Methods")
@figure_out_option
@telling
def chart(out: Path, tell: Tell) -> None:
    """Plot error against cost, for all methods and the planner (about five minutes).

    DIR gets chart.png, chart.pdf, the points as CSV, and their provenance.
    """
    check_folder(out)
    from pyfric import checks

    figure = checks.chart.figure(checks.chart.chart(progress=tell.progress))
    save_figure(figure, out / "chart", "pyfric chart", tell)


@main.command(section="Methods")
@figure_out_option
@telling
def stability(out: Path, tell: Tell) -> None:
    """Map the largest stable step of every stepper, computed and measured (about two minutes)."""
    check_folder(out)
    from pyfric import checks

    figure = checks.stability.figure(checks.stability.stability_map(progress=tell.progress))
    save_figure(figure, out / "stability", "pyfric stability", tell)


@main.command(section="Methods")
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
def regimes(out: Path | None, overwrite: bool, tell: Tell) -> None:
    """Run scenes at the edges of the model and report what happens (about 15 s).

    The provenance is written next to --out. The exit code is 1 if a result is not as stated.
    """
    check_table(out, overwrite)
    from pyfric import checks

    table = checks.regimes.observe(progress=tell.step)
    save_table(table, out, "pyfric regimes", "%.3g")
    tell.table(table, checks.regimes.report)
    if not table["as_stated"].all():
        stop(Exit.FAILED, "Error: not everything is as stated")
