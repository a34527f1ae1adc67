"""`pyfric bench`: timings, and a benchmark of fronts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pyfric.cli.app import main
from pyfric.cli.shared import check_out, file_option, json_option, overwrite_option

if TYPE_CHECKING:
    import pandas as pd


@main.group()
def bench() -> None:
    """Measure the speed of the core on this machine, and its fronts against a benchmark."""


_quick_option = click.option("--quick", is_flag=True, help="Fewer sizes and shorter timings.")


@bench.command()
@json_option
@_quick_option
def kernel(as_json: bool, quick: bool) -> None:
    """Time per block and force evaluation, beside peers where they are installed."""
    from pyfric.checks import studies

    _show(studies.bench.kernel(quick=quick, progress=not as_json), as_json, studies.bench.report)


@bench.command()
@json_option
@_quick_option
def threads(as_json: bool, quick: bool) -> None:
    """Gain from more threads, by the size of the lattice."""
    from pyfric.checks import studies

    _show(studies.bench.threads(quick=quick, progress=not as_json), as_json, studies.bench.report)


@bench.command()
@json_option
@_quick_option
def limit(as_json: bool, quick: bool) -> None:
    """How near the core is to what this processor can do."""
    from pyfric.checks import studies

    _show(studies.bench.limit(quick=quick), as_json, studies.bench.report)


@bench.command()
@json_option
@_quick_option
def scenes(as_json: bool, quick: bool) -> None:
    """Gain from several processes on independent runs."""
    from pyfric.checks import studies

    _show(studies.bench.scenes(quick=quick, progress=not as_json), as_json, studies.bench.report)


@bench.command()
@json_option
def fidelity(as_json: bool) -> None:
    """Every engine on the Fig. 1 scene: time, work, agreement with full dynamics (2 minutes)."""
    from pyfric.checks import studies

    _show(studies.fidelity.fidelity(progress=not as_json), as_json, studies.fidelity.report)


@bench.command()
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@json_option
@click.option("--quick", is_flag=True, help="Lattices of 100 and 50 m only.")
def tpv3(out: Path | None, overwrite: bool, as_json: bool, quick: bool) -> None:
    """TPV3, a benchmark of earthquake rupture: rupture times against its reference (two minutes).

    Beside --out, a CSV file, goes its provenance.
    """
    from pyfric.checks import studies
    from pyfric.record import provenance
    from pyfric.scene import write

    about = None if out is None else out.with_name(f"{out.stem}_provenance.toml")
    check_out(out, overwrite)
    check_out(about, overwrite)
    frame = studies.tpv3.tpv3(quick=quick, progress=not as_json)
    if out is not None:
        write(out, frame.to_csv(index=False, float_format="%.6g").encode())
        provenance(about, "pyfric bench tpv3")
    _show(frame, as_json, studies.tpv3.report)


@bench.command()
@json_option
def large(as_json: bool) -> None:
    """Seconds and memory of the Fig. 1 scene on 561 x 301 blocks (minutes, 4 GB)."""
    from pyfric.checks import studies

    _show(studies.large.large(), as_json, studies.large.report)


def _show(frame: pd.DataFrame, as_json: bool, report: Callable[[pd.DataFrame], str]) -> None:
    click.echo(frame.to_json(orient="records") if as_json else report(frame))
