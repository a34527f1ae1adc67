"""The paper: its figures and its claims."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    EXIT_CODES,
    Tell,
    check_folder,
    claimed,
    folder_option,
    running,
    telling,
)

FIGURES = ("fig1a", "fig1b", "fig2a", "fig2b", "fig3a", "fig3b", "fig4a", "fig4b", "all")


@main.command(section="The paper", epilog=EXIT_CODES)
@click.argument("names", nargs=-1, type=click.Choice(FIGURES))
@folder_option(
    "--out", metavar="DIR", default="figures", show_default=True, help="Folder for the files."
)
@running
@telling
def reproduce(names: tuple[str, ...], out: Path, tell: Tell, **how: Any) -> None:
    """Make the figures of the paper from runs of the model: all, or those that you name.

    Each figure is PNG and PDF with its caption and data; index.html shows all figures. Runs are
    made in parallel. Finished runs are kept and used again (see `pyfric cache`). They are in the
    user's cache folder, or in the folder that PYFRIC_CACHE names.
    """
    from pyfric.paper import reproduce

    check_folder(out)
    chosen = () if "all" in names else names
    with claimed(out, ("figures", sorted(chosen))):
        tell.files(reproduce(chosen, out, progress=tell.progress, **how))


@main.command(section="The paper", epilog=EXIT_CODES)
@click.argument("numbers", nargs=-1, metavar="[N]...")
@folder_option("--out", metavar="DIR", help="Also write claims.json and claims.csv there.")
@running
@telling
def claims(numbers: tuple[str, ...], out: Path | None, tell: Tell, **how: Any) -> None:
    """Measure the claims of the paper: all, or those that you name (1 to 16, E1 to E10, 3a).

    A value outside its band is a miss. It stays in the table, and the exit code is still 0. If the
    page of `pyfric reproduce` is in --out, this page shows the claims, too.
    """
    from pyfric.paper import claims, write_index

    check_folder(out)
    with claimed(out, ("claims", sorted(numbers))):
        found = claims.measure(numbers or None, progress=tell.progress, **how)
        files = [] if out is None else claims.save(found, out)
        if out is not None and (out / "index.html").is_file():
            files.append(write_index(out))
    told = [claims.report(found), *map(str, files)]
    tell.result(claims.table(found), lambda: "\n".join(told))
