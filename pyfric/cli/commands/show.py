"""`pyfric show`: one page for a record."""

from __future__ import annotations

from pathlib import Path

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    Tell,
    check_out,
    file_option,
    overwrite_option,
    record_of,
    telling,
)


@main.command(section="Look")
@click.argument("record", type=click.Path())
@file_option("--out", metavar="FILE", help="The page. [default: name of the record, .html]")
@overwrite_option
@telling
def show(record: str, out: Path | None, overwrite: bool, tell: Tell) -> None:
    """Write an HTML page of RECORD (.nc): loading curve, slip, events, stresses, method.

    The page is one file of at most 2 MB that needs no network: open it with a browser.
    """
    out = out or Path(f"{Path(record).stem}.html")
    check_out(out, overwrite, reads=[record])
    found = record_of(record)
    tell.files([found.to_html(out)], record=record, events=len(found.events))
