"""One run: its scene, its plan, and the run."""

from __future__ import annotations

import contextlib
import secrets
import shlex
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from pyfric.cli.app import main
from pyfric.cli.options import OptionsCommand
from pyfric.cli.shared import (
    EXIT_CODES,
    Exit,
    SceneName,
    Seconds,
    Tell,
    check_folder,
    check_out,
    claimed,
    figure_ends,
    file_option,
    folder_option,
    overwrite_option,
    record_of,
    scene_of,
    set_option,
    signalled,
    stem_option,
    stop,
    stop_unless_complete,
    telling,
)

if TYPE_CHECKING:
    from pyfric.record import Record
    from pyfric.scene import Scene


HERE = "\0"  # value of --resume without a file
DRAWN = figure_ends("curve", "slip")
"""Endings of the names of the files that --figure writes."""


@main.command(section="Simulate")
@click.argument("scene", type=SceneName())
@set_option
@file_option("--out", metavar="FILE", help="Write a file instead of stdout.")
@overwrite_option
def scene(scene: str, changes: tuple[str, ...], out: Path | None, overwrite: bool) -> None:
    """Print SCENE as a TOML file that you can change."""
    what = scene_of(scene, changes)
    check_out(out, overwrite, suffix=".toml", reads=[scene])
    text = what.to_toml(out)
    if out is None:
        click.echo(text, nl=False)


@main.command(
    section="Simulate",
    cls=OptionsCommand,
    options=("want", "tolerance", "stop_when"),
    example="pyfric plan fig1 --t-end '400 ms'",
)
@click.argument("scene", type=SceneName())
@click.option("--t-end", type=Seconds(), default=1.0, help="End time. [default: 1 s]")
@set_option
@telling
def plan(
    scene: str,
    t_end: float,
    changes: tuple[str, ...],
    want: str,
    tolerance: float,
    stop_when: tuple[str, ...],
    tell: Tell,
) -> None:
    """Print the levels at which SCENE is run until two agree within a tolerance, and their cost."""
    import dataclasses

    import pyfric

    how = {"t_end": t_end, "stop_when": stop_when or None}
    found = pyfric.plan(scene_of(scene, changes), want, tolerance, **how)
    tell.result(dataclasses.asdict(found), lambda: str(found))


@main.command(
    section="Simulate",
    epilog=EXIT_CODES,
    cls=OptionsCommand,
    before="out",
    example="pyfric run fig1 --t-end '400 ms' --out run.nc",
)
@click.argument("scene", type=SceneName())
@click.option(
    "--t-end", type=Seconds(), required=True, help="End time, such as '900 ms'; a number is in s."
)
@set_option
@file_option(
    "--out", metavar="FILE", help="Save the record here, also once a minute during the run."
)
@overwrite_option
@click.option(
    "--resume",
    is_flag=False,
    flag_value=HERE,
    metavar="[FILE]",
    help="Continue the record in FILE, or in --out if no FILE is given; SCENE may have another "
    "speed or load from there on.",
)
@stem_option("--figure", help="Draw STEM.png and STEM.pdf, with caption and data.")
@folder_option("--csv", metavar="DIR", help="Write the tables of the record as CSV.")
@telling
@click.pass_context
def run(
    ctx: click.Context,
    scene: str,
    t_end: float,
    changes: tuple[str, ...],
    out: Path | None,
    overwrite: bool,
    resume: str | None,
    figure: Path | None,
    csv: Path | None,
    tell: Tell,
    **how: Any,
) -> None:
    """Simulate SCENE: a preset, such as fig1, or a TOML file.

    Figure and CSV are written if the run is complete. The result is printed even if the run fails
    or stops. `pyfric scene` shows a scene as TOML.
    """
    from pyfric.engines import check_kept
    from pyfric.signals import asked_to_stop

    what = scene_of(scene, changes)
    if resume == HERE:
        if out is None:
            raise click.UsageError("--resume without a file continues the one in --out: name it.")
        resume = str(out)
    goes_on = bool(out and resume) and Path(resume).resolve() == out.resolve()
    reads = [scene, None if goes_on else resume]
    check_out(out, overwrite or goes_on, suffix=".nc", reads=reads)
    reads = [scene, resume, out]
    check_out(figure, overwrite, option="--figure", ends=DRAWN, reads=reads)
    check_folder(csv, "--csv")
    named = ParameterSource.COMMANDLINE
    how = {name: how[name] for name in how if ctx.get_parameter_source(name) is named}
    before = None if resume is None else record_of(resume)
    if before is not None:
        check_kept(what, before.method, how)
    with claimed(out, (what.to_toml(), t_end, resume, how)):
        record, files = _run(what, t_end, before, out, tell.progress, how)
    if record.done and not asked_to_stop():
        if figure is not None:
            from pyfric import figures  # slow to import, so only after the record is saved

            files += figures.save_figure(figures.fig1b(record), figure)
        files += [] if csv is None else record.to_csv(csv)
    from pyfric.record import summary, text

    found = summary(record, files)
    tell.result(found, lambda: text(found))
    stop_unless_complete(record, _hint(scene, changes, t_end, out))


def _run(
    scene: Scene,
    t_end: float,
    before: Record | None,
    out: Path | None,
    progress: bool,
    how: dict[str, Any],
) -> tuple[Record, list[Path]]:
    """Return the record and a list with its file. Ctrl-C after the run does not prevent saving."""
    from pyfric.signals import saved_first

    files: list[Path] = []
    try:
        with saved_first():
            record = before
            if record is None or not _is_done(record, scene, t_end):
                record = _simulate(scene, t_end, before, out, progress, how)
            if out is not None:
                files.append(_saved(record, out))
    except KeyboardInterrupt:
        if not files:
            raise
        stop(signalled(), f"interrupted after the run had ended; the record is in {out}")
    return record, files


def _saved(record: Record, out: Path) -> Path:
    """Write the record and return its path; after an error, write it elsewhere, and stop."""
    try:
        return record.save(out, overwrite=True)  # the command has checked overwriting
    except OSError as error:
        with contextlib.suppress(OSError):
            path = record.save(Path(tempfile.gettempdir(), f"{out.stem}-{secrets.token_hex(4)}.nc"))
            stop(Exit.FAILED, f"Error: {error}; the record is in {path}")
        raise


def _hint(scene: str, changes: tuple[str, ...], t_end: float, out: Path | None) -> str:
    """Return the command that continues an incomplete run."""
    if out is None:
        return "nothing was saved, because there is no --out"
    arguments = ["pyfric", "run", scene, *(f"--set={change}" for change in changes)]
    arguments += ["--t-end", repr(t_end), "--out", str(out), "--resume"]
    return f"continue with: {shlex.join(arguments)}"


def _is_done(record: Record, scene: Scene, t_end: float) -> bool:
    """Whether a complete record of the scene ends at t_end, or within the step beyond it."""
    from pyfric.scene import followed_by

    t = float(record.curve["t"].iloc[-1])
    ends = record.status == "complete" and t - (record.method.dt or 0.0) < t_end <= t
    return ends and followed_by(record.scene, scene, t) is not None


def _simulate(
    scene: Scene,
    t_end: float,
    initial: Record | None,
    out: Path | None,
    progress: bool,
    how: dict[str, Any],
) -> Record:
    """Return the record of a run, whether it is complete, interrupted or failed."""
    import pyfric

    if out is not None:
        import h5py  # noqa: F401  # slow to import, and needed after Ctrl-C
    how = {"initial": initial, "progress": progress, "checkpoint": out, **how}
    try:
        return pyfric.simulate(scene, t_end, **how)
    except pyfric.RunError as error:
        return error.record
