"""Studies: error and cost, stable steps, resolution, and where methods fail."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    Exit,
    Tell,
    check_folder,
    check_out,
    file_option,
    folder_option,
    number,
    overwrite_option,
    stop,
    telling,
)

_study_out = folder_option(
    "--out", metavar="DIR", default=".", show_default=True, help="Folder of the files."
)


@main.command()
@_study_out
@telling
def chart(out: Path, tell: Tell) -> None:
    """Chart what accuracy costs, and what the planner takes (about five minutes).

    DIR gets chart.png, chart.pdf, the points as CSV, and their provenance.
    """
    _save_study("chart", lambda study: study.chart(progress=tell.progress), out, tell)


@main.command()
@_study_out
@telling
def methods(out: Path, tell: Tell) -> None:
    """Measure how every method converges on one event, and beside other programs (two minutes).

    DIR gets methods.png, methods.pdf, the points and measured orders as CSV, and their provenance.
    """
    _save_study("methods", lambda study: study.table(progress=tell.progress), out, tell)


@main.command()
@_study_out
@telling
def stability(out: Path, tell: Tell) -> None:
    """Map the largest stable step of every stepper, computed and measured (about two minutes)."""
    _save_study("stability", lambda study: study.stability_map(progress=tell.progress), out, tell)


@main.command()
@_study_out
@telling
def resolution(out: Path, tell: Tell) -> None:
    """Refine the lattice of the Fig. 1 scene and show what converges (several minutes)."""
    _save_study("resolution", lambda study: study.study(progress=tell.progress), out, tell)


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
@click.option(
    "--finer", multiple=True, help="Lattice constant that starts from the run with twice of it."
)
@telling
def fronts(
    out: Path,
    runs: Path | None,
    spacings: tuple[str, ...],
    collapse: tuple[str, ...],
    finer: tuple[str, ...],
    tell: Tell,
) -> None:
    """Show when front speeds are physical: cracks, lengths, a resolved Fig. 4 (about 15 minutes).

    Runs are kept in --runs; the next call goes on where this one was stopped. What each lattice is
    planned to take is said before it starts: 8 times the one before it. Precursors on a lattice of
    --finer start just before the first slip, from the tractions of the run with twice the l.
    """
    folder = out / "runs" if runs is None else runs
    given = {"collapse": [number("collapse", one, "m", gt=0.0) for one in collapse]}
    given["finer"] = [number("finer", one, "m", gt=0.0) for one in finer]
    if spacings:
        given["spacings"] = [number("l", one, "m", gt=0.0) for one in spacings]
    names = {"--l": spacings, "--collapse": collapse, "--finer": finer}
    words = [word for name, values in names.items() for one in values for word in (name, one)]

    def make(study: Any) -> Any:
        return study.study(folder, **given, say=tell.step)

    _save_study("fronts", make, out, tell, words)


@main.command()
@_study_out
@folder_option("--runs", metavar="DIR", help="Folder of its runs. [default: runs in --out]")
@telling
def disorder(out: Path, runs: Path | None, tell: Tell) -> None:
    """Break two collapses of the paper by disorder of mu_s: lengths, front speeds (a minute).

    Runs are kept in --runs; the next call goes on where this one was stopped.
    """
    folder = out / "runs" if runs is None else runs
    _save_study("disorder", lambda study: study.study(folder, say=tell.step), out, tell)


def _save_study(
    name: str, make: Callable[[Any], Any], out: Path, tell: Tell, options: Sequence[str] = ()
) -> None:
    """Make a study's figure and save it with its provenance: the command and its options."""
    from pyfric import figures
    from pyfric.checks import studies
    from pyfric.record import provenance

    check_folder(out)
    study = getattr(studies, name)
    files = figures.save_figure(study.figure(make(study)), out / name)
    about = out / f"{name}_provenance.toml"
    files.append(provenance(about, shlex.join(["pyfric", name, *options])))
    tell.files(files)


@main.command()
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
def regimes(out: Path | None, overwrite: bool, tell: Tell) -> None:
    """Run the model where methods fail and say what happens there (about 15 s).

    Beside --out, a CSV file, goes its provenance. The exit code is 1 if something is not as stated.
    """
    from pyfric import checks
    from pyfric.record import provenance
    from pyfric.scene import write

    about = None if out is None else out.with_name(f"{out.stem}_provenance.toml")
    check_out(out, overwrite)
    check_out(about, overwrite)
    table = checks.regimes.observe(progress=tell.step)
    if out is not None:
        write(out, table.to_csv(index=False, float_format="%.3g").encode())
        provenance(about, "pyfric regimes")
    tell.table(table, checks.regimes.report)
    if not table["as_stated"].all():
        stop(Exit.FAILED, "Error: not everything is as stated")


@main.command("check-plans")
@click.option("--trials", type=click.IntRange(1), default=200, show_default=True, help="How many.")
@click.option("--first", type=click.IntRange(0), default=0, help="Number of the first trial.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Of the draws.")
@click.option(
    "--viscosity",
    nargs=2,
    type=click.FloatRange(0, min_open=True),
    default=(0.1, 2.0),
    show_default=True,
    metavar="LOW HIGH",
    help="Draw eta from these shares of the default.",
)
@click.option(
    "--verify",
    type=click.Choice(["sample", "full"]),
    help="How runs measure their errors.  [default: as planned runs do]",
)
@file_option("--out", metavar="FILE", help="Write the rows as CSV. [default: plans.csv]")
@overwrite_option
@click.option("--resume", is_flag=True, help="Go on with the rows in --out.")
@click.option(
    "--stored",
    nargs=2,
    metavar="FOLDER SET",
    help="In place of trials: a planned run for front speeds beside stored full dynamics.",
)
@telling
def check_plans(
    trials: int,
    first: int,
    seed: int,
    viscosity: tuple[float, float],
    verify: str | None,
    out: Path | None,
    overwrite: bool,
    resume: bool,
    stored: tuple[str, str] | None,
    tell: Tell,
) -> None:
    """Draw scenes, wants and tolerances and see whether plans keep what they promise.

    A trial takes some seconds; with --resume, those whose rows are in FILE are not
    made again.
    """
    from pyfric.checks import studies

    if stored is not None:
        found = studies.plans.stored(stored[1], Path(stored[0]))
        tell.result(found, lambda: "\n".join(f"{k} = {_short(v)}" for k, v in found.items()))
        return
    out = out or Path("plans.csv")
    check_out(out, overwrite or resume)
    if not resume:
        out.unlink(missing_ok=True)
    numbers = range(first, first + trials)
    how = {"progress": tell.progress, "verify": verify, "viscosity": viscosity}
    rows = studies.plans.run(out, numbers, seed, **how)
    tell.table(studies.plans.table(rows), lambda table: table.to_string(index=False))


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
