"""`pyfric sweep`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    EXIT_CODES,
    Exit,
    Tell,
    check_folder,
    folder_option,
    running,
    stop,
    telling,
)

if TYPE_CHECKING:
    from pyfric.sweeps import Estimate


@main.command(section="Simulate", epilog=EXIT_CODES)
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

    Finished runs are kept in the user's cache folder, or in PYFRIC_CACHE: after Ctrl-C, or
    with more points, the same command goes on. Points that fail are named with their reason.
    """
    from pyfric.sweeps import Sweep

    if dry_run and status:
        raise click.UsageError("--dry-run and --status exclude each other.")
    check_folder(out)
    what = Sweep.from_toml(file)
    if dry_run or status:
        results = what.status(cache)
    else:
        results = what.run(cache, workers=workers, progress=tell.progress)
    table, failed = results.table, results.failed
    if dry_run:
        failed = failed[failed["status"] == "refused"]
    reasons = {int(n): reason for n, reason in failed["reason"].items()}
    if dry_run:
        found = what.estimate(cache)
        lines, result = [str(found), *_too_large(found, cache)], found._asdict()
    else:
        counts = table["status"].value_counts().to_dict()
        names = [] if out is None else [str(path) for path in results.save(out)]
        lines = [", ".join(f"{count} {name}" for name, count in counts.items()), *names]
        result = {"status": counts, "files": names}
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
    most = f"{MAX_BYTES / 1e9:.2g} GB"
    return [f"Only {most} of finished runs are kept: name a folder in PYFRIC_CACHE."]


def _short(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
