"""`pyfric sweep`."""

from __future__ import annotations

from pathlib import Path

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    SHORT_EXIT_CODES,
    Exit,
    Tell,
    check_folder,
    folder_option,
    no_cache_option,
    stop,
    telling,
    workers_option,
)


@main.command(section="Simulate", epilog=SHORT_EXIT_CODES)
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--dry-run", is_flag=True, help="Say how many runs, what they cost, and run nothing.")
@click.option(
    "--status", is_flag=True, help="Say which points are finished or failed, and run nothing."
)
@folder_option("--out", metavar="DIR", help="Write the table there: CSV, netCDF and Parquet.")
@workers_option
@no_cache_option
@telling
def sweep(
    file: Path,
    dry_run: bool,
    status: bool,
    out: Path | None,
    workers: int | None,
    no_cache: bool,
    tell: Tell,
) -> None:
    """Run the scene of FILE (TOML) at many points.

    Finished runs are kept in the user's cache folder, or where PYFRIC_CACHE says: after Ctrl-C, or
    with more points, the same command goes on. Points that fail are named with their reason.
    """
    from pyfric.sweeps import Sweep
    from pyfric.sweeps.store import MAX_BYTES, own

    if dry_run and status:
        raise click.UsageError("--dry-run and --status exclude each other.")
    check_folder(out)
    what, cache = Sweep.from_toml(file), not no_cache
    if dry_run:
        found = what.estimate(cache)
        text = str(found)
        if own(cache) and found.GB > MAX_BYTES / 1e9:
            most = f"{MAX_BYTES / 1e9:.2g} GB"
            text += f"\nOnly {most} of finished runs are kept: name a folder in PYFRIC_CACHE."
        tell.result(found._asdict(), lambda: text)
        return
    how = {"workers": workers, "progress": tell.progress}
    results = what.status(cache) if status else what.run(cache, **how)
    files = [] if out is None else results.save(out)
    table = results.table
    counts = table["status"].value_counts().to_dict()
    failed = {int(n): row for n, row in results.failed.iterrows()}
    reasons = {n: row["reason"] for n, row in failed.items()}
    names = [str(path) for path in files]
    said = ", ".join(f"{count} {name}" for name, count in counts.items())
    found = {"status": counts, "failed": reasons, "files": names}
    tell.result(found, lambda: "\n".join([said, *names]))
    for n, row in failed.items():
        where = ", ".join(
            f"{name} = {row[name]:g}" if isinstance(row[name], float) else f"{name} = {row[name]}"
            for name in what.over
        )
        click.echo(f"point {n} ({where}) {row['status']}: {row['reason']}", err=True)
    if failed and not status:
        stop(Exit.FAILED)
