"""`pyfric bench`: timings, and a benchmark of fronts."""

from __future__ import annotations

from pathlib import Path

import click

from pyfric.cli.app import main
from pyfric.cli.shared import Tell, check_out, file_option, overwrite_option, telling


@main.group()
def bench() -> None:
    """Measure the speed of the core on this machine, and its fronts against a benchmark."""


_quick_option = click.option("--quick", is_flag=True, help="Fewer sizes and shorter timings.")


@bench.command()
@telling
@_quick_option
def kernel(tell: Tell, quick: bool) -> None:
    """Time per block and force evaluation, beside peers where they are installed."""
    from pyfric.checks import studies

    tell.table(studies.bench.kernel(quick=quick, progress=tell.progress), studies.bench.report)


@bench.command()
@telling
@_quick_option
def threads(tell: Tell, quick: bool) -> None:
    """Gain from more threads, by the size of the lattice."""
    from pyfric.checks import studies

    tell.table(studies.bench.threads(quick=quick, progress=tell.progress), studies.bench.report)


@bench.command()
@telling
@_quick_option
def limit(tell: Tell, quick: bool) -> None:
    """How near the core is to what this processor can do."""
    from pyfric.checks import studies

    tell.table(studies.bench.limit(quick=quick), studies.bench.report)


@bench.command()
@telling
@_quick_option
def scenes(tell: Tell, quick: bool) -> None:
    """Gain from several processes on independent runs."""
    from pyfric.checks import studies

    tell.table(studies.bench.scenes(quick=quick, progress=tell.progress), studies.bench.report)


@bench.command()
@telling
def fidelity(tell: Tell) -> None:
    """Every engine on the Fig. 1 scene: time, work, agreement with full dynamics (2 minutes)."""
    from pyfric.checks import studies

    tell.table(studies.fidelity.fidelity(progress=tell.progress), studies.fidelity.report)


@bench.command()
@file_option("--out", metavar="FILE", help="Write the table as CSV.")
@overwrite_option
@telling
@click.option("--quick", is_flag=True, help="Lattices of 100 and 50 m only.")
def tpv3(out: Path | None, overwrite: bool, tell: Tell, quick: bool) -> None:
    """TPV3, a benchmark of earthquake rupture: rupture times against its reference (two minutes).

    Beside --out, a CSV file, goes its provenance.
    """
    from pyfric.checks import studies
    from pyfric.record import provenance
    from pyfric.scene import write

    about = None if out is None else out.with_name(f"{out.stem}_provenance.toml")
    check_out(out, overwrite)
    check_out(about, overwrite)
    frame = studies.tpv3.tpv3(quick=quick, progress=tell.progress)
    if out is not None:
        write(out, frame.to_csv(index=False, float_format="%.6g").encode())
        provenance(about, "pyfric bench tpv3")
    tell.table(frame, studies.tpv3.report)


@bench.command()
@telling
def large(tell: Tell) -> None:
    """Seconds and memory of the Fig. 1 scene on 561 x 301 blocks (minutes, 3 GB)."""
    from pyfric.checks import studies

    tell.table(studies.large.large(), studies.large.report)
