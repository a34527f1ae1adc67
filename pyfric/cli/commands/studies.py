"""Studies: error and cost, stable steps, resolution, and where methods fail."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    Exit,
    check_folder,
    check_out,
    file_option,
    folder_option,
    json_option,
    number,
    overwrite_option,
    quiet_option,
    show_files,
    stop,
)

_study_out = folder_option(
    "--out", metavar="DIR", default=".", show_default=True, help="Folder of the files."
)


@main.command()
@_study_out
@quiet_option
def chart(out: Path, quiet: bool) -> None:
    """Chart what accuracy costs, and what the planner takes (about five minutes).

    DIR gets chart.png, chart.pdf, the points as CSV, and their provenance.
    """
    _save_study("chart", lambda study: study.chart(progress=not quiet), out, quiet)


@main.command()
@_study_out
@quiet_option
def methods(out: Path, quiet: bool) -> None:
    """Measure how every method converges on one event, and beside other programs (two minutes).

    DIR gets methods.png, methods.pdf, the points and measured orders as CSV, and their provenance.
    """
    _save_study("methods", lambda study: study.table(progress=not quiet), out, quiet)


@main.command()
@_study_out
@quiet_option
def stability(out: Path, quiet: bool) -> None:
    """Map the largest stable step of every stepper, computed and measured (about two minutes)."""
    _save_study("stability", lambda study: study.stability_map(progress=not quiet), out, quiet)


@main.command()
@_study_out
@quiet_option
def resolution(out: Path, quiet: bool) -> None:
    """Refine the lattice of the Fig. 1 scene and show what converges (several minutes)."""
    progress = False if quiet else None
    _save_study("resolution", lambda study: study.study(progress=progress), out, quiet)


@main.command()
@_study_out
@folder_option("--runs", metavar="DIR", help="Folder of its runs. [default: runs in --out]")
@click.option(
    "--l",
    "spacings",
    multiple=True,
    help="Lattice constant of the Fig. 1 scene, such as '1.25 mm'; several may be given.",
)
@click.option(
    "--collapse", multiple=True, help="Lattice constant of runs 1 to 4, without which they are out."
)
@quiet_option
def fronts(
    out: Path,
    runs: Path | None,
    spacings: tuple[str, ...],
    collapse: tuple[str, ...],
    quiet: bool,
) -> None:
    """Show when front speeds are physical: cracks, lengths, a resolved Fig. 4 (about 15 minutes).

    Runs are kept in --runs; the next call goes on where this one was stopped. What each lattice is
    planned to take is said before it starts: 8 times the one before it.
    """
    folder = out / "runs" if runs is None else runs
    given = {"collapse": [number("collapse", one, "m", gt=0.0) for one in collapse]}
    if spacings:
        given["spacings"] = [number("l", one, "m", gt=0.0) for one in spacings]
    say = (lambda _: None) if quiet else (lambda text: click.echo(text, err=True))
    _save_study("fronts", lambda study: study.study(folder, **given, say=say), out, quiet)


def _save_study(name: str, make: Callable[[Any], Any], out: Path, quiet: bool) -> None:
    """Make a study's figure and save it with its provenance."""
    from pyfric import figures
    from pyfric.checks import studies
    from pyfric.record import provenance

    check_folder(out)
    study = getattr(studies, name)
    files = figures.save_figure(study.figure(make(study)), out / name)
    files.append(provenance(out / f"{name}_provenance.toml", f"pyfric {name}"))
    show_files(files, quiet)


@main.command()
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@json_option
def regimes(out: Path | None, overwrite: bool, as_json: bool) -> None:
    """Run the model where methods fail and say what happens there (about 15 s).

    Beside --out, a CSV file, goes its provenance. The exit code is 1 if something is not as stated.
    """
    from pyfric import checks
    from pyfric.record import provenance
    from pyfric.scene import write

    about = None if out is None else out.with_name(f"{out.stem}_provenance.toml")
    check_out(out, overwrite)
    check_out(about, overwrite)
    table = checks.regimes.observe(progress=lambda name: as_json or click.echo(name, err=True))
    if out is not None:
        write(out, table.to_csv(index=False, float_format="%.3g").encode())
        provenance(about, "pyfric regimes")
    click.echo(table.to_json(orient="records") if as_json else checks.regimes.report(table))
    if not table["as_stated"].all():
        stop(Exit.FAILED, "Error: not everything is as stated")


@main.command("check-plans")
@click.option("--trials", type=click.IntRange(1), default=200, show_default=True, help="How many.")
@click.option("--first", type=click.IntRange(0), default=0, help="Number of the first trial.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the draws.")
@click.option(
    "--verify",
    type=click.Choice(["sample", "full"]),
    help="How runs measure their errors.  [default: as planned runs do]",
)
@file_option("--out", metavar="FILE", help="Rows are appended to this CSV. [default: plans.csv]")
@click.option(
    "--stored",
    nargs=2,
    metavar="FOLDER SET",
    help="In place of trials: a planned run for front speeds beside stored full dynamics.",
)
@quiet_option
def check_plans(
    trials: int,
    first: int,
    seed: int,
    verify: str | None,
    out: Path | None,
    stored: tuple[str, str] | None,
    quiet: bool,
) -> None:
    """Draw scenes, wants and tolerances and see whether plans keep what they promise.

    A trial takes some seconds; those whose rows are in FILE are not made again.
    """
    from pyfric.checks import studies

    if stored is not None:
        for name, value in studies.plans.stored(stored[1], Path(stored[0])).items():
            click.echo(f"{name} = {value:.4g}" if isinstance(value, float) else f"{name} = {value}")
        return
    out = out or Path("plans.csv")
    check_folder(out.parent)
    numbers = range(first, first + trials)
    rows = studies.plans.run(out, numbers, seed, progress=not quiet, verify=verify)
    click.echo(studies.plans.table(rows).to_string(index=False))
