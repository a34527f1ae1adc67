"""Many runs: sweeps, phase diagrams, and lattices of other block sizes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    EXIT_CODES,
    Exit,
    SceneName,
    Seconds,
    Tell,
    changes_of,
    check_folder,
    claimed,
    command_line,
    fidelity_option,
    figure_out_option,
    folder_option,
    running,
    save_figure,
    scene_of,
    set_option,
    stop,
    telling,
)

if TYPE_CHECKING:
    from pyfric.sweeps import Estimate


@main.command(
    section="Simulate", epilog=EXIT_CODES, example="pyfric sweep sweep.toml --out results"
)
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--dry-run",
    is_flag=True,
    help="Show the number of runs, their cost and refused points; run nothing.",
)
@click.option(
    "--status", is_flag=True, help="Show which points are finished or failed; run nothing."
)
@folder_option("--out", metavar="DIR", help="Write the table there: CSV, netCDF and Parquet.")
@running
@telling
def sweep(
    file: Path,
    dry_run: bool,
    status: bool,
    out: Path | None,
    workers: int | None,
    cache: bool,
    tell: Tell,
) -> None:
    """Run the scene of FILE (TOML) at many points.

    \b
    FILE names a scene, the end of its runs, and what varies over which values:
        scene = "fig1"           # a preset, a scene file, or a table [scene]
        t_end = "1 s"
        points = "grid"          # or list; or random, sobol, halton, latin
                                 # with n = 100 and seed = 1
        [over]                   # fields of the scene, t_end, or options
        mu_s = [0.6, 0.7]
        h = { from = "5 mm", to = "10 mm", step = "2.5 mm" }
        [options]                # those of pyfric run; may be left out
        fidelity = "quasistatic"
        [limits]                 # a larger estimate is refused; may be left out
        max_hours = 1

    Finished runs are kept in the user's cache folder, or in PYFRIC_CACHE. After Ctrl-C, or if
    points are added, the same command continues the sweep. Failed points are listed with reasons.
    """
    from pyfric.sweeps import Sweep

    if dry_run and (status or out):
        raise click.UsageError("--dry-run excludes --status and --out.")
    if (dry_run or status) and workers:
        raise click.UsageError("--workers: --dry-run and --status run nothing.")
    check_folder(out)
    what = Sweep.from_toml(file)
    with claimed(out, [getattr(job, "key", job) for job in what.jobs]):
        if dry_run or status:
            results = what.status(cache)
        else:
            results = what.run(cache, workers=workers, progress=tell.progress)
        names = [] if out is None else results.save(out)
    table, failed = results.table, results.failed
    if dry_run:
        failed = failed[failed["status"] == "refused"]
    reasons = {int(n): reason for n, reason in failed["reason"].items()}
    if dry_run:
        found = what.estimate(cache)
        lines, result = [str(found), *_too_large(found, cache)], found._asdict()
    else:
        counts = table["status"].value_counts().to_dict()
        said, names = results.report.splitlines(), [*map(str, names)]
        lines = [", ".join(f"{count} {name}" for name, count in counts.items()), *said, *names]
        result = {"status": counts, "report": said, "files": names}
    tell.result(result | {"failed": reasons}, lambda: "\n".join(lines))
    for n, row in failed.iterrows():
        where = ", ".join(f"{name} = {_short(row[name])}" for name in what.over)
        click.echo(f"point {n} ({where}) {row['status']}: {row['reason']}", err=True)
    if (table["status"] == "refused").all():
        stop(Exit.BAD_INPUT, "Error: all points are refused")
    if len(failed) and not (dry_run or status):
        stop(Exit.FAILED)


def _too_large(found: Estimate, cache: bool) -> list[str]:
    from pyfric.sweeps import MAX_BYTES, Store

    if not Store.at(cache).own or found.GB <= MAX_BYTES / 1e9:
        return []
    kept = f"{MAX_BYTES / 1e9:.2g} GB"
    return [f"Only {kept} of finished runs are kept: name a folder in PYFRIC_CACHE."]


def _short(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


@main.command("phase-diagram", section="Simulate", epilog=EXIT_CODES)
@click.argument("scene", type=SceneName(), required=False)
@set_option
@click.option(
    "--x",
    metavar="FIELD=FROM:TO:N[:log]",
    help="Field along x and its values, such as 'h=5 mm:10 mm:3'; numbers without unit are SI.",
)
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
    """Map the class and the speed of the largest rupture of SCENE over two fields.

    Without SCENE, map the chain of Thogersen et al. (2019) over alpha/sqrt(k m) and tau_bar. The
    files in DIR are phases.png, phases.pdf, and the points and lines as CSV. Finished runs are
    kept, so the same command continues a stopped map.
    """
    import pyfric
    from pyfric import figures

    if scene is None and (changes or stop_when or t_end is not None):
        raise click.UsageError("--set, --t-end and --stop-when need a SCENE.")
    check_folder(out)
    if scene is not None:
        how |= {"t_end": t_end, "options": {"stop_when": stop_when or None}}
        how["changes"] = changes_of(changes)
    axes = {side: given and _axis(side, given) for side, given in (("x", x), ("y", y))}
    with claimed(out, (scene, axes, how)):
        found = pyfric.phase_diagram(scene, **axes, progress=tell.progress, **how)
        save_figure(figures.phase_map(found), out / "phases", command_line(), tell)


def _axis(side: str, given: str) -> tuple[str, Any]:
    """Return the name of a field and its range, from the text of an option."""
    from pyfric.sweeps import Span
    from pyfric.values import SceneError, spoken

    name, _, values = given.partition("=")
    parts = values.split(":")
    try:
        start, stop, n, scale = [*parts, *["linear"] * (len(parts) == 3)]
        n = int(n)
    except ValueError:
        allowed = "FIELD=FROM:TO:N, or FIELD=FROM:TO:N:log, such as 'h=5 mm:10 mm:3'"
        raise SceneError(side, given, "", allowed, "not a range of this form") from None
    return name.strip(), Span(start=spoken(start), stop=spoken(stop), n=n, scale=scale)


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
@fidelity_option("quasistatic", "Model; quasistatic takes seconds.")
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
    interface. Finished runs are kept, so the same command continues after Ctrl-C.
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
