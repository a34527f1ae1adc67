"""Studies of pyfric, each a command: `python studies NAME` in the folder of the sources.

Studies take long or need other programs, so pyfric is installed without them.
"""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import Any

import click
from sizes import TINY, tiny

from pyfric.cli.app import Commands
from pyfric.cli.shared import (
    Tell,
    check_folder,
    check_out,
    check_table,
    figure_out_option,
    file_option,
    folder_option,
    overwrite_option,
    save_figure,
    save_table,
    telling,
)


def made_by(*words: object) -> str:
    """Return the command line that files state as their origin."""
    run = ["python", "studies", *(["--tiny"] if tiny() else [])]
    return shlex.join([*run, *map(str, words)])


def _tiny(_: object, __: object, given: bool) -> None:
    if given:
        os.environ[TINY] = "1"


@click.group(
    cls=Commands,
    sections=("Speed", "Methods", "Physics"),
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.option(
    "--tiny",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_tiny,
    help="Make each study with sizes at which it ends in seconds; its numbers mean nothing.",
)
def main() -> None:
    """Measure the speed of pyfric, the convergence of its methods, and results of the model.

    --out is a folder or a file. In a folder, files with the names of the outputs are replaced.
    A file is replaced only with --overwrite. --json prints the result as JSON, and --quiet
    prints only errors.
    """


# --- speed ---------------------------------------------------------------------------------------

_quick_option = click.option("--quick", is_flag=True, help="Fewer sizes and shorter timings.")
_beside_option = click.option(
    "--beside",
    "commits",
    multiple=True,
    metavar="COMMIT",
    help="Take turns with the build of a commit; may be repeated.",
)


@main.command(section="Speed")
@telling
@_quick_option
def kernel(tell: Tell, quick: bool) -> None:
    """Time per block and force evaluation, compared with other programs that are installed."""
    import bench

    tell.table(bench.kernel(quick=quick, progress=tell.progress), bench.report)


@main.command(section="Speed")
@telling
@_quick_option
def threads(tell: Tell, quick: bool) -> None:
    """Gain in speed from more threads, for each size of the lattice."""
    import bench

    tell.table(bench.threads(quick=quick, progress=tell.progress), bench.report)


@main.command(section="Speed")
@telling
def limit(tell: Tell) -> None:
    """Speed of the core, as a share of the highest speed that this processor allows."""
    import bench

    tell.table(bench.limit(), bench.report)


@main.command(section="Speed")
@telling
@_quick_option
def scenes(tell: Tell, quick: bool) -> None:
    """Gain in speed from several processes on independent runs."""
    import bench

    tell.table(bench.scenes(quick=quick, progress=tell.progress), bench.report)


@main.command(section="Speed")
@telling
def fidelity(tell: Tell) -> None:
    """Every engine on the Fig. 1 scene: time, work, agreement with full dynamics (2 minutes)."""
    import fidelity

    tell.table(fidelity.fidelity(progress=tell.progress), fidelity.report)


@main.command(section="Speed")
@telling
def work(tell: Tell) -> None:
    """Prices of operations (their times), measured again on this machine (one minute)."""
    import work

    tell.table(work.measured(progress=tell.progress), work.report)


@main.command(section="Speed")
@telling
def large(tell: Tell) -> None:
    """Seconds and memory of the Fig. 1 scene on 561 x 301 blocks (20 minutes, 9 GB)."""
    import large

    tell.table(large.large(), large.report)


@main.command(section="Speed")
@click.option("--case", "cases", multiple=True, help="Only this case; may be repeated.")
@_beside_option
@click.option(
    "--errors",
    is_flag=True,
    help="Measure errors of steps and of jumps of hybrid runs, too (seconds to minutes a case).",
)
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
@_quick_option
def finer(
    cases: tuple[str, ...],
    commits: tuple[str, ...],
    errors: bool,
    out: Path | None,
    overwrite: bool,
    tell: Tell,
    quick: bool,
) -> None:
    """Processor time, steps and memory of short runs on finer and finer lattices (five minutes).

    --out is a CSV file; its provenance is written beside it.
    """
    check_table(out, overwrite)
    import fine

    if unknown := [name for name in cases if name not in fine.CASES]:
        raise click.BadParameter(f"{unknown[0]!r}; known are {', '.join(fine.CASES)}")
    names = cases or (fine.QUICK if quick else fine.USUAL)
    more = {"repeats": 1} if quick else {}
    frame = fine.finer(names, commits=commits, errors=errors, say=tell.step, **more)
    words = [word for name in cases for word in ("--case", name)] + ["--errors"] * errors
    words += [word for commit in commits for word in ("--beside", commit)]
    save_table(frame, out, made_by("finer", *words), "%.4g")
    tell.table(frame, fine.report)


@main.command(section="Speed")
@click.option("--case", "cases", multiple=True, help="Only this case; may be repeated.")
@_beside_option
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
@_quick_option
def many(
    cases: tuple[str, ...],
    commits: tuple[str, ...],
    out: Path | None,
    overwrite: bool,
    tell: Tell,
    quick: bool,
) -> None:
    """Costs of records, ensembles, diagrams and fits of quasi-static runs (some minutes).

    --out is a CSV file; its provenance is written beside it.
    """
    check_table(out, overwrite)
    import many

    if unknown := [name for name in cases if name not in many.CASES]:
        raise click.BadParameter(f"{unknown[0]!r}; known are {', '.join(many.CASES)}")
    names = cases or tuple(many.QUICK if quick else many.CASES)
    more = {"repeats": 1} if quick else {}
    frame = many.costs(names, commits=commits, quick=quick, say=tell.step, **more)
    words = [word for name in cases for word in ("--case", name)]
    words += [word for commit in commits for word in ("--beside", commit)]
    save_table(frame, out, made_by("many", *words), "%.4g")
    tell.table(frame, many.report)


@main.command(section="Speed")
@folder_option("--out", required=True, metavar="DIR", help="Folder of its files.")
@_beside_option
@telling
def lattices(out: Path, commits: tuple[str, ...], tell: Tell) -> None:
    """Processor time against l, without weakening and with d_c = 1 um (two minutes)."""
    check_folder(out)
    import fine

    cases = [name for line in fine.LINES.values() for name in line]
    frame = fine.finer(cases, commits=commits, say=tell.step)
    words = [word for commit in commits for word in ("--beside", commit)]
    command = made_by("lattices", *words)
    save_figure(fine.figure(frame), out / "lattices", command, tell)
    tell.table(frame, fine.report)


# --- methods -------------------------------------------------------------------------------------


@main.command(section="Methods")
@figure_out_option
@telling
def chart(out: Path, tell: Tell) -> None:
    """Chart error over cost of methods, plans and LAMMPS in four scenes (ten minutes)."""
    check_folder(out)
    import accuracy
    import pandas as pd
    from beside import chart_points

    points = accuracy.chart(progress=tell.progress)
    points = pd.concat([points, pd.DataFrame(chart_points(points))], ignore_index=True)
    save_figure(accuracy.figure(points), out / "chart", made_by("chart"), tell)


@main.command(section="Methods")
@figure_out_option
@telling
def stability(out: Path, tell: Tell) -> None:
    """Map the largest stable step of every stepper, computed and measured (about two minutes)."""
    check_folder(out)
    import limits

    figure = limits.figure(limits.stability_map(progress=tell.progress))
    save_figure(figure, out / "stability", made_by("stability"), tell)


@main.command(section="Methods")
@figure_out_option
@telling
def price(out: Path, tell: Tell) -> None:
    """Draw accuracy and cost of methods in one panel, for the Fig. 1 scene (five minutes)."""
    check_folder(out)
    import price

    figure = price.figure(price.points(progress=tell.progress))
    save_figure(figure, out / "price", made_by("price"), tell)


@main.command(section="Methods")
@figure_out_option
@telling
def methods(out: Path, tell: Tell) -> None:
    """Measure how every method converges on one event, and compare other programs (two minutes).

    Writes methods.png, methods.pdf, points and orders as CSV, and their provenance to DIR.
    """
    check_folder(out)
    import methods

    figure = methods.figure(methods.table(progress=tell.progress))
    save_figure(figure, out / "methods", made_by("methods"), tell)


@main.command(section="Methods")
@click.option("--trials", type=click.IntRange(1), help="How many.  [default: 200]")
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
@click.option("--wide", is_flag=True, help="Draw from far more kinds of scenes.")
@click.option("--weakening", is_flag=True, help="Leave out scenes with d_c = 0.")
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
def plans(
    trials: int | None,
    first: int,
    seed: int,
    viscosity: tuple[float, float],
    wide: bool,
    weakening: bool,
    verify: str | None,
    out: Path | None,
    overwrite: bool,
    resume: bool,
    stored: tuple[str, str] | None,
    tell: Tell,
) -> None:
    """Test whether plans of random scenes, wants and tolerances keep their tolerances.

    A trial takes some seconds. With --resume, trials with a row in FILE are left out.
    """
    import plans

    if stored is not None:
        found = plans.stored(stored[1], Path(stored[0]))
        tell.result(found, lambda: "\n".join(f"{k} = {_short(v)}" for k, v in found.items()))
        return
    out = out or Path("plans.csv")
    check_out(out, overwrite or resume)
    if not resume:
        out.unlink(missing_ok=True)
    numbers = range(first, first + (trials or plans.TRIALS))
    how = {"progress": tell.progress, "verify": verify, "viscosity": viscosity}
    how |= {"wide": wide, "weakening": weakening}
    rows = plans.run(out, numbers, seed, **how)
    tell.table(plans.table(rows), lambda table: table.to_string(index=False))


@main.command(section="Methods")
@click.argument("cases", nargs=-1)
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
def promises(cases: tuple[str, ...], out: Path | None, overwrite: bool, tell: Tell) -> None:
    """Compare records with true values in scenes where a tolerance is hard to keep (four minutes).

    CASES are names of cases; without names all cases run. Provenance is written beside --out.
    """
    check_table(out, overwrite)
    import promises

    if unknown := sorted(set(cases) - set(promises.CASES)):
        raise click.BadParameter(f"{unknown[0]}: one of {', '.join(promises.CASES)}")
    frame = promises.table(cases or promises.CASES)
    save_table(frame, out, made_by("promises", *cases), "%.3g")
    tell.table(frame, lambda table: table.drop(columns="scene").to_string(index=False))


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


# --- physics -------------------------------------------------------------------------------------


@main.command(section="Physics")
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
@click.option("--quick", is_flag=True, help="Lattices of 100 and 50 m only.")
def tpv3(out: Path | None, overwrite: bool, tell: Tell, quick: bool) -> None:
    """TPV3, a benchmark of earthquake rupture: rupture times against its reference (two minutes).

    --out is a CSV file; its provenance is written beside it.
    """
    check_table(out, overwrite)
    import tpv3

    frame = tpv3.tpv3(quick=quick, progress=tell.progress)
    save_table(frame, out, made_by("tpv3"), "%.6g")
    tell.table(frame, tpv3.report)


@main.command(section="Physics")
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
def viscosity(out: Path | None, overwrite: bool, tell: Tell) -> None:
    """Measure by how much dashpots slow down cracks, against fracture mechanics (five minutes).

    --out is a CSV file; its provenance is written beside it.
    """
    check_table(out, overwrite)
    import cracks

    frame = cracks.viscosity(say=tell.step)
    save_table(frame, out, made_by("viscosity"), "%.6g")
    tell.table(frame, lambda table: table.to_string(index=False))


@main.command(section="Physics")
@figure_out_option
@telling
def resolution(out: Path, tell: Tell) -> None:
    """Refine the lattice of the Fig. 1 scene and show which results converge (several minutes)."""
    check_folder(out)
    import resolution

    figure = resolution.figure(resolution.study(progress=tell.progress))
    save_figure(figure, out / "resolution", made_by("resolution"), tell)


@main.command(section="Physics")
@figure_out_option
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
    """Test when front speeds are physical: cracks, lengths, a resolved Fig. 4 (about 15 minutes).

    Runs are kept in --runs; the next call continues from there. The expected time of each lattice
    is printed before it starts: 8 times that of the previous lattice. Precursors on a lattice of
    --finer start just before the first slip, from the tractions of the run with twice the l.
    """
    from pyfric.values import check_number, spoken

    folder = out / "runs" if runs is None else runs
    given = {"collapse": [check_number("collapse", spoken(one), "m", gt=0.0) for one in collapse]}
    given["finer"] = [check_number("finer", spoken(one), "m", gt=0.0) for one in finer]
    if spacings:
        given["spacings"] = [check_number("l", spoken(one), "m", gt=0.0) for one in spacings]
    names = {"--l": spacings, "--collapse": collapse, "--finer": finer}
    words = [word for name, values in names.items() for one in values for word in (name, one)]

    check_folder(out)
    import fronts
    import fronts_found

    figure = fronts_found.figure(fronts.study(folder, **given, say=tell.step))
    save_figure(figure, out / "fronts", made_by("fronts", *words), tell)


@main.command(section="Physics")
@folder_option("--runs", required=True, metavar="DIR", help="Folder of its runs.")
@folder_option("--out", required=True, metavar="DIR", help="Folder of its files.")
@telling
def resolved(runs: Path, out: Path, tell: Tell) -> None:
    """Separate effects of prestress and position for a resolved cohesive zone (half an hour).

    Runs are kept in --runs; the next call continues from there.
    """
    check_folder(out)
    import resolved
    import resolved_found

    fronts = resolved.study(runs, say=tell.step)
    found = resolved_found.figure(fronts, resolved.checks(runs, say=tell.step))
    save_figure(found, out / "resolved", made_by("resolved"), tell)
    tell.table(found.tables["summary"], resolved_found.report)


@main.command(section="Physics")
@folder_option("--out", required=True, metavar="DIR", help="Folder of its files.")
@telling
def rated(out: Path, tell: Tell) -> None:
    """Precursors with rate-and-state friction, for three decades of speed (an hour)."""
    check_folder(out)
    import rated

    frame = rated.study(say=tell.step)
    save_figure(rated.draw(frame), out / "rated", made_by("rated"), tell)
    tell.table(frame, rated.report)


@main.command("rated-spacing", section="Physics")
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
def rated_spacing(out: Path | None, overwrite: bool, tell: Tell) -> None:
    """Nucleation with rate-and-state friction on lattices of four spacings (a minute)."""
    check_table(out, overwrite)
    import rated_spacing as own

    frame = own.study(say=tell.step)
    save_table(frame, out, made_by("rated-spacing"), "%.5g")
    tell.table(frame, own.report)


@main.command("rated-ruptures", section="Physics")
@folder_option("--out", required=True, metavar="DIR", help="Folder of its files.")
@telling
def rated_ruptures(out: Path, tell: Tell) -> None:
    """Slip speeds, stress drops and slow fronts with rate-and-state friction (half an hour)."""
    check_folder(out)
    import rated_ruptures as own

    frame = own.study(say=tell.step)
    figure = own.draw(frame, own.regimes(say=tell.step), own.coulomb())
    save_figure(figure, out / "rated", made_by("rated-ruptures"), tell)
    tell.table(frame, own.report)


@main.command(section="Physics")
@click.argument("fronts", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
def collapse(fronts: Path, out: Path | None, overwrite: bool, tell: Tell) -> None:
    """Separate effects of prestress and position on front speeds, from runs of `fronts`.

    --out is a CSV file; its provenance is written beside it.
    """
    check_table(out, overwrite)
    import collapse
    import pandas as pd

    frame = collapse.collapse(pd.read_csv(fronts))
    save_table(frame, out, made_by("collapse", fronts), "%.6g")
    tell.table(frame, collapse.report)


@main.command(section="Methods")
@figure_out_option
@telling
def fits(out: Path, tell: Tell) -> None:
    """Fit runs of random parameters, and count intervals that hold them (an hour and a half).

    The next call continues where this one was stopped.
    """
    check_folder(out)
    import fits

    from pyfric.record import provenance

    out.mkdir(parents=True, exist_ok=True)
    table = fits.study(out / "fits.csv", say=tell.step)
    pulls = fits.pulls(say=tell.step)
    pulls.to_csv(out / "pulls.csv", index=False, float_format="%.6g")
    provenance(out / "fits_provenance.toml", made_by("fits"))
    tell.step(fits.report_of_pulls(pulls))
    tell.table(table, fits.report)


@main.command(section="Methods")
@figure_out_option
@telling
def velocity_steps(out: Path, tell: Tell) -> None:
    """Fit a, b, D_c, f* and stiffness to velocity steps of random parameters (15 minutes).

    The next call continues where this one was stopped.
    """
    check_folder(out)
    import velocity_steps

    from pyfric.record import provenance

    table = velocity_steps.study(out / "velocity_steps.csv", say=tell.step)
    provenance(out / "velocity_steps_provenance.toml", made_by("velocity-steps"))
    tell.table(table, velocity_steps.report)


@main.command(section="Physics")
@figure_out_option
@folder_option("--data", metavar="DIR", help="Folder data_raw of the repository of the curves.")
@telling
def curves(out: Path, data: Path | None, tell: Tell) -> None:
    """Fit nine public curves of paper on paper, and one law to all of them (ten minutes).

    pyfric does not include the curves. Without the folder of curves, the command prints where they
    are. The next call continues where this one was stopped.
    """
    check_folder(out)
    import curves

    from pyfric.record import provenance

    if absent := curves.wanted(data):
        tell.result({"skipped": absent}, lambda: absent)
        return
    out.mkdir(parents=True, exist_ok=True)
    table = curves.study(data, out, say=tell.step)
    laws = curves.one_law(table)
    laws.to_csv(out / "laws.csv", index=False, float_format="%.4g")
    curves.add_source(provenance(out / "curves_provenance.toml", made_by("curves")))
    tell.table(table, lambda frame: f"{curves.report(frame)}\n{curves.report_of_laws(laws)}")


@main.command(section="Physics")
@figure_out_option
@folder_option("--runs", metavar="DIR", help="Folder of its runs. [default: runs in --out]")
@telling
def disorder(out: Path, runs: Path | None, tell: Tell) -> None:
    """Let mu_s vary at random, and measure lengths and front speeds (a minute).

    Runs are kept in --runs; the next call continues from there.
    """
    folder = out / "runs" if runs is None else runs
    check_folder(out)
    import disorder

    figure = disorder.figure(disorder.study(folder, say=tell.step))
    save_figure(figure, out / "disorder", made_by("disorder"), tell)


@main.command(section="Physics")
@figure_out_option
@telling
def scatter(out: Path, tell: Tell) -> None:
    """Scatter of strength and first precursor, and sizes, in 10 000 disordered runs (a minute).

    Numbers of finished runs are kept, as by `pyfric.ensemble`.
    """
    check_folder(out)
    import scatter

    figure = scatter.figure(scatter.study(say=tell.step))
    save_figure(figure, out / "scatter", made_by("scatter"), tell)


@main.command(section="Physics")
@figure_out_option
@folder_option("--runs", metavar="DIR", help="Folder of its runs. [default: runs in --out]")
@click.option("--seeds", type=click.IntRange(2), help="Of each point.  [default: 3]")
@telling
def precursors(out: Path, runs: Path | None, seeds: int | None, tell: Tell) -> None:
    """Number and length of precursors over the nucleation length, and their end (16 minutes).

    Runs are kept in --runs; the next call continues from there.
    """
    folder = out / "runs" if runs is None else runs
    check_folder(out)
    import precursors
    import precursors_found

    found = precursors.study(folder, seeds=seeds or precursors.SEEDS, say=tell.step)
    found = precursors_found.tables(found, precursors.checks(folder, say=tell.step))
    words = ["--seeds", seeds] if seeds else []
    command = made_by("precursors", *words)
    save_figure(precursors_found.figure(found), out / "precursors", command, tell)
    tell.result({"report": precursors_found.report(found)}, lambda: precursors_found.report(found))


@main.command(section="Physics")
@figure_out_option
@folder_option("--runs", metavar="DIR", help="Folder of its runs. [default: runs in --out]")
@click.option("--case", "cases", multiple=True, help="Only this case; may be repeated.")
@telling
def slow(out: Path, runs: Path | None, cases: tuple[str, ...], tell: Tell) -> None:
    """Slow fronts on junctions with other seeds, step, spread, n_s and t_R (20 minutes).

    Runs are kept in --runs; the next call continues from there.
    """
    folder = out / "runs" if runs is None else runs
    check_folder(out)
    import slow

    if unknown := [name for name in cases if name not in slow.CASES]:
        raise click.BadParameter(f"{unknown[0]!r}; known are {', '.join(slow.CASES)}")
    records = slow.study(folder, cases or tuple(slow.CASES), say=tell.step)
    save_figure(slow.figure(records), out / "slow", made_by("slow"), tell)
    name, record = next(iter(records.items()))
    fig = slow.speed_figure(record.scene, slow.slip_speeds(record), name)
    save_figure(fig, out / "speeds", made_by("slow"), tell)


@main.command(section="Physics")
@figure_out_option
@folder_option("--runs", metavar="DIR", help="Folder of its runs. [default: runs in --out]")
@telling
def prepared(out: Path, runs: Path | None, tell: Tell) -> None:
    """Fast, slow and arrested fronts on prepared interfaces of junctions (five minutes).

    Runs are kept in --runs; the next call continues from there.
    """
    folder = out / "runs" if runs is None else runs
    check_folder(out)
    import prepared

    figure = prepared.figure(prepared.diagram(folder), prepared.checks(folder))
    save_figure(figure, out / "prepared", made_by("prepared"), tell)


@main.command(section="Physics")
@figure_out_option
@folder_option("--runs", metavar="DIR", help="Folder of its runs. [default: runs in --out]")
@telling
def creeping(out: Path, runs: Path | None, tell: Tell) -> None:
    """Slow fronts of viscous slip in slabs, compared with a chain (four minutes).

    Runs are kept in --runs; the next call continues from there.
    """
    folder = out / "runs" if runs is None else runs
    check_folder(out)
    import creeping

    figure = creeping.figure(creeping.study(folder, say=tell.step))
    save_figure(figure, out / "creeping", made_by("creeping"), tell)


@main.command(section="Physics")
@figure_out_option
@telling
def one_block(out: Path, tell: Tell) -> None:
    """One block on junctions, moved at a given speed, against closed forms (a minute)."""
    check_folder(out)
    import one_block as study

    figure = study.figure(study.study(say=tell.step))
    save_figure(figure, out / "one_block", made_by("one-block"), tell)


@main.command(section="Physics")
@figure_out_option
@click.option(
    "--only",
    metavar="PROGRAM",
    multiple=True,
    help="Only this program, such as DART; other rows of the folder stay. May be repeated.",
)
@telling
def sticks(out: Path, only: tuple[str, ...], tell: Tell) -> None:
    """One block and ten on a spring, in pyfric and in programs with friction: creep, forces, cost.

    The command first installs the other programs in a separate environment (five minutes).
    """
    check_folder(out)
    import pandas as pd
    import sticks as study

    known = [peer.name for peer in study.PEERS]
    if unknown := sorted({*only} - {*known}):
        raise click.BadParameter(f"{unknown[0]!r}; known are {', '.join(known)}")
    rows = study.study(say=tell.step, only=only)
    if only:
        rows = study.renewed(pd.read_csv(out / "sticks_programs.csv"), rows)
        chains = pd.read_csv(out / "sticks_chain.csv")
    else:
        chains = study.chains(say=tell.step)
    figure = study.figure(rows, chains)
    how = [word for program in only for word in ("--only", program)]
    save_figure(figure, out / "sticks", made_by("sticks", *how), tell)


if __name__ == "__main__":
    main(prog_name="studies")
