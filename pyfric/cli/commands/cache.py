"""`pyfric cache`: the store of finished runs."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import Exit, json_option, print_json, stop

if TYPE_CHECKING:
    from pyfric.sweeps import Entry, Store

MB = 10**6


@main.group(section="Simulate")
def cache() -> None:
    """List, check, size and prune the finished runs that are kept.

    They are in the user's cache folder, or in the one that PYFRIC_CACHE names. Other processes may
    use it at the same time.
    """


@cache.command(name="list")
@json_option
def list_(as_json: bool) -> None:
    """List the runs, those used last first."""
    _show([_row(entry) for entry in _entries()], as_json)


@cache.command()
@json_option
def check(as_json: bool) -> None:
    """Compare every file with its hash; the exit code is 1 if one is damaged."""
    rows = [_row(entry) for entry in _entries()]
    damaged = [row for row in rows if "problem" in row]
    _show(damaged, as_json)
    if not as_json:
        click.echo(f"{len(rows)} runs, {len(damaged)} damaged")
    if damaged:
        stop(Exit.FAILED)


@cache.command()
@json_option
def size(as_json: bool) -> None:
    """Show the folder, the number of runs and their size."""
    store, found = _store(), _entries()
    folder, size = store.folder, sum(entry.size for entry in found)
    if as_json:
        print_json({"folder": str(folder), "runs": len(found), "bytes": size})
    else:
        click.echo(f"{folder}: {len(found)} runs, {size / MB:.1f} MB")


@cache.command()
@click.option("--older-than", type=click.FloatRange(0), metavar="DAYS", help="Not used for DAYS.")
@click.option(
    "--most", type=click.FloatRange(0), metavar="MB", help="Used least recently, beyond MB in all."
)
@click.option("--damaged", is_flag=True, help="Damaged, or of another version.")
@json_option
def prune(older_than: float | None, most: float | None, damaged: bool, as_json: bool) -> None:
    """Delete what killed processes left behind, and the runs named by the options."""
    from pyfric.scene import check_number

    for name, value in (("older-than", older_than), ("most", most)):
        if value is not None:
            check_number(f"--{name}", value, "", ge=0.0)
    most = None if most is None else int(most * MB)
    gone, drafts = _store().prune(most, older_than, damaged)
    size = sum(entry.size for entry in gone)
    if as_json:
        print_json({"runs": len(gone), "bytes": size, "drafts": drafts})
    else:
        click.echo(f"deleted: {len(gone)} runs, {size / MB:.1f} MB; {drafts} unfinished files")


def _store() -> Store:
    from pyfric.sweeps import Store

    return Store.at(True)


def _entries() -> list[Entry]:
    return _store().entries()


def _row(entry: Entry) -> dict[str, Any]:
    """Return what there is to say about a file."""
    row: dict[str, Any] = {"key": entry.path.stem, "bytes": entry.size, "used": entry.used}
    found = entry.read()
    if isinstance(found, str):
        return row | {"problem": found}
    return row | {
        "scene": found.scene.name,
        "t": float(found.curve["t"].iloc[-1]),
        "engine": found.method.engine,
        "events": len(found.events),
    }


def _show(rows: list[dict[str, Any]], as_json: bool) -> None:
    if as_json:
        print_json(rows)
        return
    for row in rows:
        used = time.strftime("%Y-%m-%d %H:%M", time.localtime(row["used"]))
        what = row.get("problem") or (
            f"{row['scene'] or 'scene'} to t = {row['t']:.4g} s, {row['engine']}, "
            f"{row['events']} events"
        )
        click.echo(f"{row['key'][:12]}  {used}  {row['bytes'] / MB:7.2f} MB  {what}")
