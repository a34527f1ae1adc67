"""`pyfric cache`: the store of finished runs."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import Exit, Tell, stop, telling

if TYPE_CHECKING:
    from pyfric.sweeps import Entry, Store

MB = 10**6


@main.group(section="Simulate")
def cache() -> None:
    """List, check, size and prune the finished runs that are kept.

    Runs are in the user's cache folder, or in the folder that PYFRIC_CACHE names. Other processes
    may use this folder at the same time.
    """


@cache.command(name="list")
@telling
def list_(tell: Tell) -> None:
    """List the runs, the most recently used first."""
    rows = [_row(entry) for entry in _store().entries()]
    tell.result(rows, lambda: "\n".join(map(_line, rows)) or "no finished runs")


@cache.command()
@telling
def check(tell: Tell) -> None:
    """Compare every file with its hash. The exit code is 1 if a file is damaged."""
    rows = [_row(entry) for entry in _store().entries()]
    damaged = [row for row in rows if "problem" in row]
    last = f"{len(rows)} runs, {len(damaged)} damaged"
    tell.result(damaged, lambda: "\n".join([*map(_line, damaged), last]))
    if damaged:
        stop(Exit.FAILED)


@cache.command()
@telling
def size(tell: Tell) -> None:
    """Show the folder, the number of runs and their size."""
    store = _store()
    sizes = [entry.size for entry in store.entries()]
    found = {"folder": str(store.folder), "runs": len(sizes), "bytes": sum(sizes)}
    text = f"{store.folder}: {len(sizes)} runs, {sum(sizes) / MB:.1f} MB"
    tell.result(found, lambda: text)


@cache.command()
@click.option("--older-than", type=click.FloatRange(0), metavar="DAYS", help="Not used for DAYS.")
@click.option(
    "--most", type=click.FloatRange(0), metavar="MB", help="Used least recently, beyond MB in all."
)
@click.option("--damaged", is_flag=True, help="Damaged, or of another version.")
@telling
def prune(older_than: float | None, most: float | None, damaged: bool, tell: Tell) -> None:
    """Delete unfinished files of killed processes, and the runs that the options select."""
    from pyfric.values import check_number

    for name, value in (("older-than", older_than), ("most", most)):
        if value is not None:
            check_number(f"--{name}", value, "", ge=0.0)
    max_bytes = None if most is None else int(most * MB)
    gone, drafts = _store().prune(max_bytes, older_than, damaged)
    size = sum(entry.size for entry in gone)
    text = f"deleted: {len(gone)} runs, {size / MB:.1f} MB; {drafts} unfinished files"
    tell.result({"runs": len(gone), "bytes": size, "drafts": drafts}, lambda: text)


def _store() -> Store:
    from pyfric.sweeps import Store

    store = Store.at(True)
    if store.folder is not None and store.folder.exists() and not store.folder.is_dir():
        raise click.UsageError(f"PYFRIC_CACHE names a file, not a folder: {store.folder}.")
    return store


def _row(entry: Entry) -> dict[str, Any]:
    """Return the entries of a file in the list."""
    row: dict[str, Any] = {"key": entry.path.stem, "bytes": entry.size, "used": entry.used}
    found = entry.read()
    if isinstance(found, str):
        return row | {"problem": found}
    if isinstance(found, dict):
        return row | {"runs": len(found["status"])}
    return row | {
        "scene": found.scene.name,
        "t": float(found.curve["t"].iloc[-1]),
        "engine": found.method.engine,
        "events": len(found.events),
    }


def _line(row: dict[str, Any]) -> str:
    used = time.strftime("%Y-%m-%d %H:%M", time.localtime(row["used"]))
    what = (
        row.get("problem")
        or ("runs" in row and f"numbers of {row['runs']} runs")
        or (
            f"{row['scene'] or 'scene'} to t = {row['t']:.4g} s, {row['engine']}, "
            f"{row['events']} events"
        )
    )
    return f"{row['key'][:12]}  {used}  {row['bytes'] / MB:7.2f} MB  {what}"
