"""Published results: figures and claims of the paper, and cases of others."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from pyfric.cli.app import main
from pyfric.cli.shared import (
    EXIT_CODES,
    Listed,
    Tell,
    check_folder,
    claimed,
    command_line,
    folder_option,
    running,
    telling,
)


def _figures() -> list[str]:
    from pyfric.figures import FIGURES

    return [*sorted(FIGURES), "all"]


@main.command(section="The paper", epilog=EXIT_CODES)
@click.argument("names", nargs=-1, type=Listed(_figures))
@folder_option(
    "--out", metavar="DIR", default="figures", show_default=True, help="Folder for the files."
)
@running
@telling
def reproduce(names: tuple[str, ...], out: Path, tell: Tell, **how: Any) -> None:
    """Make the figures of the paper from runs of the model: all, or those that you name.

    Each figure is PNG and PDF with its caption and data; index.html shows all figures. Runs are
    made in parallel. Finished runs are kept and used again (see `pyfric cache`). Kept runs are in
    the user's cache folder, or in the folder that PYFRIC_CACHE names.
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

    A value outside its band is a miss. A miss stays in the table, and the exit code is still 0. If
    the page of `pyfric reproduce` is in --out, this page shows the claims, too.
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


class CaseName(click.ParamType):
    """The name of a case, which shells can complete."""

    name = "case"

    def convert(self, value: Any, param: Any, ctx: Any) -> str:
        from pyfric.paper import cases

        if value not in cases.CASES:
            near = difflib.get_close_matches(value, cases.CASES, 1)
            hint = f" Did you mean {near[0]}?" if near else ""
            self.fail(f"no case {value!r}.{hint} `pyfric case` lists all.", param, ctx)
        return value

    def shell_complete(self, ctx: Any, param: Any, incomplete: str) -> list[CompletionItem]:
        from pyfric.paper import cases

        return [CompletionItem(name) for name in cases.CASES if name.startswith(incomplete)]


@main.command(section="The paper", epilog=EXIT_CODES)
@click.argument("names", nargs=-1, metavar="[NAME]...", type=CaseName())
@click.option("--all", "every", is_flag=True, help="Run all cases.")
@folder_option(
    "--out", metavar="DIR", default="cases", show_default=True, help="Folder for the files."
)
@running
@telling
def case(names: tuple[str, ...], every: bool, out: Path, tell: Tell, **how: Any) -> None:
    """Reproduce published results: the cases that you name, or all. Without a name, list them.

    Each case has a number or a trend with its target, and a figure. A value outside its band is a
    miss, and the exit code is still 0. index.html in --out shows the cases of the folder, misses
    first.
    """
    from pyfric.paper import cases

    if not (names or every):
        about = {name: entry.title for name, entry in cases.CASES.items()}
        tell.result(about, cases.listed)
        return
    check_folder(out)
    chosen = () if every else names
    with claimed(out, ("cases", sorted(chosen))):
        found = []
        for result in cases.run(chosen, progress=tell.progress, **how):
            result.save(out, command_line())
            cases.write_page(out)
            found.append(result)
    texts = [*map(str, found), str(out / "index.html")]
    tell.result([result.as_dict() for result in found], lambda: "\n\n".join(texts))
