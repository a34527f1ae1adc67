"""`pyfric bench`: timings."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from pyfric.cli.app import main
from pyfric.cli.shared import json_option

if TYPE_CHECKING:
    import pandas as pd


@main.group()
def bench() -> None:
    """Measure the speed of the core on this machine."""


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


def _show(frame: pd.DataFrame, as_json: bool, report: Callable[[pd.DataFrame], str]) -> None:
    click.echo(frame.to_json(orient="records") if as_json else report(frame))
