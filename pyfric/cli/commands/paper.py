"""The paper: its figures, its claims, and strips of events."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    EXIT_CODES,
    Registered,
    SceneName,
    Seconds,
    Tell,
    check_folder,
    check_out,
    figure_ends,
    file_option,
    folder_option,
    overwrite_option,
    record_of,
    running,
    scene_of,
    set_option,
    stop_unless_complete,
    telling,
)

if TYPE_CHECKING:
    from pyfric.record import Record


def _figures() -> list[str]:
    from pyfric.figures import FIGURES

    return [*sorted(FIGURES), "all"]


@main.command(section="The paper", epilog=EXIT_CODES)
@click.argument("names", nargs=-1, type=Registered("figure", _figures))
@folder_option(
    "--out", metavar="DIR", default="figures", show_default=True, help="Folder for the files."
)
@running
@telling
def reproduce(names: tuple[str, ...], out: Path, tell: Tell, **how: Any) -> None:
    """Make the paper's figures from runs of the model: all, or those named.

    Each figure is PNG and PDF with its caption and data; index.html shows them. Runs are made in
    parallel. Finished ones are kept in the user's cache folder, or the one that PYFRIC_CACHE names,
    and used again; see `pyfric cache`.
    """
    from pyfric.paper import reproduce

    check_folder(out)
    chosen = () if "all" in names else names
    tell.files(reproduce(chosen, out, progress=tell.progress, **how))


@main.command(section="The paper", epilog=EXIT_CODES)
@click.argument("numbers", nargs=-1, metavar="[N]...")
@folder_option("--out", metavar="DIR", help="Also write claims.json and claims.csv there.")
@running
@telling
def claims(numbers: tuple[str, ...], out: Path | None, tell: Tell, **how: Any) -> None:
    """Measure the claims of the paper: all, or those named (1 to 16, E1 to E10, 3a).

    A value outside its band is a miss and stays in the table; the exit code is 0 all the same. If
    the page of `pyfric reproduce` is in --out, it shows the claims too.
    """
    from pyfric.paper import claims, write_index

    check_folder(out)
    found = claims.measure(numbers or None, progress=tell.progress, **how)
    files = [] if out is None else claims.save(found, out)
    if out is not None and (out / "index.html").is_file():
        files.append(write_index(out))
    told = [claims.report(found), *map(str, files)]
    tell.result(claims.table(found), lambda: "\n".join(told))


def of_event(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command what says of which event it is."""
    for add in (
        click.argument("source", metavar="SCENE|RECORD", type=SceneName()),
        click.option(
            "--event",
            type=click.IntRange(1),
            required=True,
            metavar="N",
            help="Number of the event, from 1, as `pyfric info` and tables have it.",
        ),
        click.option(
            "--t-end",
            type=Seconds(),
            default=1.0,
            help="End time of the run of a scene. [default: 1 s]",
        ),
        set_option,
    )[::-1]:
        command = add(command)
    return command


@main.command(section="Look")
@of_event
@file_option("--out", metavar="STEM", help="Names of the files. [default: event_N]")
@click.option("--mp4", is_flag=True, help="Also write STEM.mp4, a film; that needs ffmpeg.")
@click.option("--gif", is_flag=True, help="Also write STEM.gif, a film that needs no ffmpeg.")
@overwrite_option
@telling
def movie(
    source: str,
    event: int,
    t_end: float,
    changes: tuple[str, ...],
    out: Path | None,
    mp4: bool,
    gif: bool,
    overwrite: bool,
    tell: Tell,
) -> None:
    """Draw one event as a strip of frames: velocity field, with the interface below it.

    SCENE is a preset or a TOML file; RECORD (.nc) comes from the hybrid or dynamic engine with rk4
    and begins at the loaded state. The event is run again with full dynamics from a state just
    before it.
    """
    from pyfric import figures

    stem = out or Path(f"event_{event}")
    films = [end for end, wanted in ((".mp4", mp4), (".gif", gif)) if wanted]
    check_out(stem, overwrite, ends=(*figure_ends("interface", "field"), *films), reads=[source])
    if mp4 and not figures.has_ffmpeg():
        raise click.UsageError("--mp4 needs ffmpeg or the extra 'movies'; --gif needs neither.")
    record = _run_of(source, event, t_end, changes, tell)
    files = figures.save_figure(figures.event_strip(record, event), stem)
    for end in films:
        files.append(figures.event_movie(record, event, stem.with_name(stem.name + end)))
    tell.files(files)


@main.command(section="Look")
@of_event
@file_option("--out", metavar="STEM", help="Names of the files. [default: spacetime_N]")
@overwrite_option
@telling
def spacetime(
    source: str,
    event: int,
    t_end: float,
    changes: tuple[str, ...],
    out: Path | None,
    overwrite: bool,
    tell: Tell,
) -> None:
    """Draw the slip rate of one event over space and time, with wave speeds and theory as lines.

    From a scene or a record, as in `pyfric movie`. The suffix .png of a name may be left out. The
    event is run again with full dynamics from a state just before it.
    """
    from pyfric import figures

    stem = out or Path(f"spacetime_{event}")
    stem = stem.with_suffix("") if stem.suffix == ".png" else stem
    ends = figure_ends("slip_rate", "lines", "front")
    check_out(stem, overwrite, ends=ends, reads=[source])
    record = _run_of(source, event, t_end, changes, tell)
    tell.files(figures.save_figure(figures.space_time(record, event), stem))


def _run_of(
    source: str,
    event: int,
    t_end: float,
    changes: tuple[str, ...],
    tell: Tell,
) -> Record:
    """Return the record in a file, or that of a scene; say by which method it was made.

    Raises:
        SceneError: it has no such event.
    """
    import pyfric

    if source.lower().endswith(".nc"):
        if changes:
            raise click.UsageError(f"--set changes scenes; {source} is a record.")
        record = record_of(source)
    else:
        scene = scene_of(source, changes)
        engine = "hybrid" if scene.has_rests and scene.law.rests else "dynamic"
        record = pyfric.simulate(scene, t_end, fidelity=engine, progress=tell.progress)
        stop_unless_complete(record, "")
    record.row(event)
    if not tell.quiet:
        click.echo(f"{record.method}; the event again with full dynamics", err=True)
    return record
