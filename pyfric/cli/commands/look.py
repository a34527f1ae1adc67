"""Pictures and pages: records, scenes, events."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    SceneName,
    Seconds,
    Tell,
    check_out,
    figure_ends,
    file_option,
    overwrite_option,
    record_of,
    scene_of,
    set_option,
    stem_option,
    stop_unless_complete,
    telling,
)

if TYPE_CHECKING:
    from pyfric.record import Record


@main.command(section="Look")
@click.argument("record", type=click.Path())
@file_option("--out", metavar="FILE", help="The page. [default: name of the record, .html]")
@overwrite_option
@telling
def show(record: str, out: Path | None, overwrite: bool, tell: Tell) -> None:
    """Write an HTML page of RECORD (.nc): loading curve, slip, events, stresses, method.

    The page is one file of at most 2 MB. Open it with a browser; it needs no network.
    """
    out = out or Path(f"{Path(record).stem}.html")
    check_out(out, overwrite, suffix=".html", reads=[record])
    found = record_of(record)
    tell.files([found.to_html(out)], record=record, events=len(found.events))


@main.command(section="Look")
@click.argument("scene", type=SceneName())
@set_option
@stem_option("--out", help="Names of the files. [default: sketch_SCENE]")
@overwrite_option
@telling
def draw(
    scene: str, changes: tuple[str, ...], out: Path | None, overwrite: bool, tell: Tell
) -> None:
    """Draw a sketch of SCENE, to scale: STEM.png and STEM.pdf, with caption and data."""
    from pyfric import figures

    what = scene_of(scene, changes)
    stem = out or Path(f"sketch_{Path(scene).stem}")
    check_out(stem, overwrite, ends=figure_ends("columns"), reads=[scene])
    tell.files(figures.save_figure(figures.sketch(what), stem))


source_argument = click.argument("source", metavar="SCENE|RECORD", type=SceneName())
event_option = click.option(
    "--event",
    type=click.IntRange(1),
    required=True,
    metavar="N",
    help="Number of the event, from 1, as `pyfric info` and tables have it.",
)
t_end_option = click.option(
    "--t-end", type=Seconds(), help="End time of the run of a scene. [default: 1 s]"
)


@main.command(section="Look")
@source_argument
@event_option
@t_end_option
@set_option
@stem_option("--out", help="Names of the files. [default: event_N]")
@click.option("--mp4", is_flag=True, help="Also write STEM.mp4, a film; that needs ffmpeg.")
@click.option("--gif", is_flag=True, help="Also write STEM.gif, a film that needs no ffmpeg.")
@overwrite_option
@telling
def movie(
    source: str,
    event: int,
    out: Path | None,
    mp4: bool,
    gif: bool,
    overwrite: bool,
    tell: Tell,
    **how: Any,
) -> None:
    """Draw one event as a strip of frames: velocity field, with the interface below it.

    SCENE is a preset or a TOML file. RECORD (.nc) must come from the hybrid or dynamic engine with
    rk4, and begin at the loaded state. The event is run again with full dynamics from a state just
    before it.
    """
    from pyfric import figures

    stem = out or Path(f"event_{event}")
    films = [end for end, wanted in ((".mp4", mp4), (".gif", gif)) if wanted]
    check_out(stem, overwrite, ends=(*figure_ends("interface", "field"), *films), reads=[source])
    if mp4 and not figures.has_ffmpeg():
        raise click.UsageError("--mp4 needs ffmpeg or the extra 'movies'; --gif needs neither.")
    record = _run_of(source, event, tell, **how)
    files = figures.save_figure(figures.event_strip(record, event), stem)
    for end in films:
        files.append(figures.event_movie(record, event, stem.with_name(stem.name + end)))
    tell.files(files)


@main.command(section="Look")
@source_argument
@event_option
@t_end_option
@set_option
@stem_option("--out", help="Names of the files. [default: spacetime_N]")
@overwrite_option
@telling
def spacetime(
    source: str, event: int, out: Path | None, overwrite: bool, tell: Tell, **how: Any
) -> None:
    """Draw the slip rate of one event over space and time, with wave speeds and theory as lines.

    SCENE and RECORD are as in `pyfric movie`. The event is run again with full dynamics from a
    state just before it.
    """
    from pyfric import figures

    stem = out or Path(f"spacetime_{event}")
    ends = figure_ends("slip_rate", "pinned", "lines", "front")
    check_out(stem, overwrite, ends=ends, reads=[source])
    record = _run_of(source, event, tell, **how)
    tell.files(figures.save_figure(figures.space_time(record, event), stem))


def _run_of(
    source: str, event: int, tell: Tell, t_end: float | None, changes: tuple[str, ...]
) -> Record:
    """Return the record in a file, or of a scene; print its method.

    Raises:
        SceneError: the record has no such event.
    """
    import pyfric

    if source.lower().endswith(".nc"):
        if changes or t_end is not None:
            raise click.UsageError(f"--set and --t-end are of scenes, but {source} is a record.")
        record = record_of(source)
    else:
        scene = scene_of(source, changes)
        engine = "dynamic" if pyfric.engines.ENGINES["hybrid"].cannot(scene) else "hybrid"
        t_end = 1.0 if t_end is None else t_end
        record = pyfric.simulate(scene, t_end, fidelity=engine, progress=tell.progress)
        stop_unless_complete(record, "")
    record.row(event)
    if not tell.quiet:
        click.echo(f"{record.method}; the event again with full dynamics", err=True)
    return record
