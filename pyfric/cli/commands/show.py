"""`pyfric show`: one page for a record."""

from __future__ import annotations

from pathlib import Path

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    check_out,
    file_option,
    json_option,
    overwrite_option,
    print_json,
    quiet_option,
    record_of,
    show_files,
)


@main.command()
@click.argument("record")
@file_option("--out", metavar="FILE", help="The page. [default: name of the record, .html]")
@overwrite_option
@quiet_option
@json_option
def show(record: str, out: Path | None, overwrite: bool, quiet: bool, as_json: bool) -> None:
    """Make one page of RECORD (.nc): loading, slip, each event, stresses, numbers, what made it.

    The page is one file of at most 2 MB that needs no network: open it with a browser.
    """
    out = out or Path(f"{Path(record).stem}.html")
    check_out(out, overwrite, reads=[record])
    found = record_of(record)
    path = found.to_html(out)
    if as_json:
        print_json({"record": record, "events": len(found.events), "files": [str(path)]})
    else:
        show_files([path], quiet)
