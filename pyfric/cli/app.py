"""Command line: runs, scenes, figures, claims and timings.

Every command ends with a code of `Exit`; refusals and failures are one message on stderr, without
a traceback. SIGTERM acts as Ctrl-C does.
"""

from __future__ import annotations

import enum
import errno
import json
import math
import os
import shlex
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
from click.core import ParameterSource

if TYPE_CHECKING:
    import pandas as pd

    from pyfric.figures import DataFigure
    from pyfric.record import Record
    from pyfric.scene import Scene

__all__ = ["Exit", "main"]


class Exit(enum.IntEnum):
    """Exit codes."""

    COMPLETE = 0
    FAILED = 1
    BAD_INPUT = 2
    INTERRUPTED = 130


EXIT_CODES = """\b
Exit codes:
    0  complete
    1  the run failed; what was done is in --out
    2  bad input; nothing was started
  130  interrupted by Ctrl-C or SIGTERM; what was done is in --out
"""
SHORT_EXIT_CODES = """\b
Exit codes:
    0  complete
    1  a run failed or a file could not be written
    2  bad input; nothing was started
  130  interrupted by Ctrl-C or SIGTERM; finished runs are kept
"""


def _stop(code: Exit, message: str = "") -> NoReturn:
    if message:
        click.echo(message, err=True)
    raise click.exceptions.Exit(int(code))


class _Commands(click.Group):
    """A group that ends with `Exit` codes."""

    def invoke(self, ctx: click.Context) -> Any:
        import pyfric

        refusals = (pyfric.SceneError, pyfric.StateError, pyfric.RecordError)
        try:
            with _sigterm_as_ctrl_c():
                return super().invoke(ctx)
        except KeyboardInterrupt:
            _stop(Exit.INTERRUPTED, "interrupted")
        except refusals as error:
            _stop(Exit.BAD_INPUT, f"Error: {error}")
        except (pyfric.RunError, pyfric.JobError, pyfric.EquilibriumError, MemoryError) as error:
            _stop(Exit.FAILED, f"Error: {str(error) or 'out of memory'}")
        except OSError as error:
            if error.errno == errno.EPIPE:  # the reader of stdout has left: click ends quietly
                raise
            _stop(Exit.FAILED, f"Error: {error}")


@contextmanager
def _sigterm_as_ctrl_c() -> Iterator[None]:
    """Let the first SIGTERM do what Ctrl-C does; further ones do nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came = False

    def handler(number: int, frame: Any) -> None:
        nonlocal came
        if came:
            return
        came = True
        ctrl_c = signal.getsignal(signal.SIGINT)
        if not callable(ctrl_c):
            raise KeyboardInterrupt
        ctrl_c(signal.SIGINT, frame)

    old = signal.signal(signal.SIGTERM, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, old)


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="pyfric")
def main() -> None:
    """Simulate how an elastic block starts to slide on a frictional surface."""


# --- parameters ----------------------------------------------------------------------------------


class _Seconds(click.ParamType):
    """A time: a bare number in s, or a quantity with its unit."""

    name = "time"

    def __init__(self, *words: str) -> None:
        self.words = words

    def convert(self, value: Any, param: Any, ctx: Any) -> float | str:
        return value if value in self.words else _number(param.name, value, "s", ge=0.0)


def _number(field: str, text: str, unit: str, **limits: float | None) -> float:
    """Return a bare SI number, or a quantity with its unit, as a number in SI.

    Raises:
        SceneError: it is neither, or outside the limits.
    """
    from pyfric.scene import SceneError, check_number, parse_quantity, range_text

    allowed = range_text(unit, **limits)
    try:
        number = float(text)
    except ValueError:
        if not unit:
            raise SceneError(field, text, "", allowed, "not a number") from None
        number = parse_quantity(field, text, unit, allowed=allowed)
    return check_number(field, number, unit, **limits)


def _units() -> dict[str, str]:
    """Return the SI units of all numbers in a scene, by the names that the presets use."""
    import typing

    from pyfric.scene import DistributedLoad, Driver, Interface, PrescribedLoad, Rod, Slider

    return {
        name: mark.unit
        for part in (Slider, Rod, DistributedLoad, PrescribedLoad, Driver, Interface)
        for name, hint in typing.get_type_hints(part, include_extras=True).items()
        for mark in getattr(hint, "__metadata__", ())
    }


def _scene(name: str, changes: tuple[str, ...]) -> Scene:
    """Return the preset of this name, or the scene in this file.

    Raises:
        SceneError: no such preset or file, or a value is refused.
    """
    import pyfric

    looks_like_file = os.sep in name or "/" in name or name.lower().endswith(".toml")
    if name not in pyfric.PRESETS and (looks_like_file or Path(name).is_file()):
        if changes:
            raise click.UsageError(f"--set changes presets; {name} is a file: change it there.")
        return pyfric.Scene.from_toml(Path(name))
    units, values = _units(), {}
    for change in changes:
        key, equals, text = (part.strip() for part in change.partition("="))
        if not (key and equals):
            raise click.UsageError(f"--set {change}: write KEY=VALUE, such as 'h=7.5 mm'.")
        values[key] = _number(key, text, units[key]) if key in units else text
    return pyfric.preset(name, **values)


def _writable(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made first if it is missing."""
    here = folder.absolute()
    while not here.exists():
        here = here.parent
    try:
        with tempfile.TemporaryFile(dir=here):
            return True
    except OSError:
        return False


def _check_folder(out: Path) -> None:
    if not _writable(out):
        raise click.UsageError(f"--out {out}: files cannot be written there.")


def _check_out(out: Path | None, overwrite: bool) -> None:
    if out is None:
        return
    if not out.parent.is_dir():
        raise click.UsageError(f"--out {out}: there is no folder {out.parent}.")
    if out.is_dir():
        raise click.UsageError(f"--out {out}: this is a folder.")
    if not _writable(out.parent):
        raise click.UsageError(f"--out {out}: the folder {out.parent} is not writable.")
    if out.exists() and not overwrite:
        raise click.UsageError(f"--out {out}: the file exists; --overwrite replaces it.")


_set_option = click.option(
    "--set",
    "changes",
    metavar="KEY=VALUE",
    multiple=True,
    help="Change a value of a preset, such as 'h=7.5 mm' or mu_k=0.4; repeatable. "
    "Keys are the arguments of pyfric.setup1, setup2 or chain; numbers without unit are SI.",
)
_overwrite_option = click.option("--overwrite", is_flag=True, help="Replace the file in --out.")
_json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


_want_option = click.option(
    "--want",
    type=click.Choice(["loading_curve", "precursors", "stress", "front_speed", "motion"]),
    default="precursors",
    show_default=True,
    help="What the run is made for.",
)
_tolerance_option = click.option(
    "--tolerance",
    type=click.FloatRange(0, 1, min_open=True),
    default=0.01,
    show_default=True,
    help="Accepted error, over F_N; relative for front speeds.",
)

_workers_option = click.option(
    "--workers", type=click.IntRange(1, 4096), help="Most runs at a time. [default: processors]"
)
_no_cache_option = click.option(
    "--no-cache", is_flag=True, help="Make all runs again, and keep none."
)


def _file_option(name: str, **rest: Any) -> Callable[..., Any]:
    return click.option(name, type=click.Path(path_type=Path), **rest)


def _print_json(value: Any) -> None:
    click.echo(json.dumps(value, indent=2, allow_nan=False))


# --- run -----------------------------------------------------------------------------------------


HERE = "\0"  # value of --resume without a file


@main.command(epilog=EXIT_CODES)
@click.argument("scene")
@click.option("--t-end", type=_Seconds(), required=True, help="Time of the end: '900 ms', or s.")
@_set_option
@click.option(
    "--fidelity",
    type=click.Choice(["auto", "equilibrium", "quasistatic", "hybrid", "dynamic"]),
    default="auto",
    show_default=True,
    help="What is modelled; auto takes what is enough (see pyfric plan).",
)
@_want_option
@_tolerance_option
@click.option(
    "--geometry",
    type=click.Choice(["finite", "linear"]),
    help="Bonds that rotate, as in the paper, or linear ones. "
    "[default: finite; linear for a chain]",
)
@click.option(
    "--method",
    type=click.Choice(["rk4", "verlet", "symplectic_euler", "adaptive"]),
    default="rk4",
    show_default=True,
    help="Stepper; all but rk4 need full dynamics.",
)
@click.option(
    "--switching",
    type=click.Choice(["step_end", "located"]),
    help="Contacts switch at the end of a step, as in the paper, or where they do inside it. "
    "[default: as planned, or step_end]",
)
@click.option(
    "--rtol", type=float, help="Error of a sub-step of --method adaptive. [default: 1e-6]"
)
@click.option(
    "--dt",
    type=_Seconds("auto"),
    default="auto",
    show_default=True,
    help="Time step: '0.2 us', s, or auto, about half the stability limit.",
)
@click.option(
    "--sample",
    type=_Seconds(),
    help="Time between two points of the curve. [default: 1/5000 of the run]",
)
@click.option("--t-gap", type=_Seconds(), help="Longest pause inside an event. [default: 1 ms]")
@click.option(
    "--threads", type=click.IntRange(1, 4096), help="Most threads to use. [default: all that pay]"
)
@click.option(
    "--budget/--no-budget",
    default=None,
    help="Keep the energy budget: full dynamics only. [default: with --fidelity dynamic]",
)
@_file_option("--out", metavar="FILE", help="Save the record here, and once a minute on the way.")
@_overwrite_option
@click.option(
    "--resume",
    is_flag=False,
    flag_value=HERE,
    metavar="[FILE]",
    help="Continue the record in FILE, or in --out if no FILE is given.",
)
@_file_option("--figure", metavar="STEM", help="Draw STEM.png and STEM.pdf, with caption and data.")
@_file_option("--csv", metavar="FOLDER", help="Write the tables of the record as CSV.")
@click.option("--quiet", is_flag=True, help="Show nothing but errors.")
@click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON object, also if the run fails or stops."
)
@click.pass_context
def run(
    ctx: click.Context,
    scene: str,
    t_end: float,
    changes: tuple[str, ...],
    fidelity: str,
    want: str,
    tolerance: float,
    geometry: str | None,
    method: str,
    switching: str | None,
    rtol: float | None,
    dt: float | str,
    sample: float | None,
    t_gap: float | None,
    threads: int | None,
    budget: bool | None,
    out: Path | None,
    overwrite: bool,
    resume: str | None,
    figure: Path | None,
    csv: Path | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Simulate SCENE: a preset, such as fig1, or a TOML file.

    Figure and CSV are written when the run is complete. `pyfric scene` shows a scene as TOML.
    """
    from pyfric.record import T_GAP

    what = _scene(scene, changes)
    if resume == HERE:
        if out is None:
            raise click.UsageError("--resume without a file continues the one in --out: name it.")
        resume = str(out)
    _check_out(out, overwrite or _same_file(out, resume))
    for option, folder in (("--figure", figure and figure.parent), ("--csv", csv)):
        if folder is not None and not _writable(folder):
            raise click.UsageError(f"{option}: files cannot be written in {folder}.")
    before = None if resume is None else _record_to_continue(resume, what, ctx)
    if before is not None and _is_done(before, t_end):
        record = before
    else:
        record = _simulate(
            what,
            t_end,
            out,
            initial=before,
            geometry=geometry,
            method=method,
            switching=switching,
            rtol=rtol,
            dt=dt,
            sample=sample,
            t_gap=T_GAP if t_gap is None else t_gap,
            budget=budget,
            threads=threads,
            fidelity=fidelity,
            want=want,
            tolerance=tolerance,
            progress=not (quiet or as_json),
        )
    files = [] if out is None else [record.save(out)]
    if record.status == "complete":
        files += [] if figure is None else _draw(record, figure)
        files += [] if csv is None else record.to_csv(csv)
    summary = _summary(record, files)
    if as_json:
        _print_json(summary)
    elif not quiet:
        click.echo(_text(summary))
    if out is None:
        hint = "nothing was saved, because there is no --out"
    else:
        arguments = ["pyfric", "run", scene, *(f"--set={change}" for change in changes)]
        arguments += ["--t-end", repr(t_end), "--out", str(out), "--resume"]
        hint = f"continue with: {shlex.join(arguments)}"
    _stop_unless_complete(record, hint)


def _stop_unless_complete(record: Record, hint: str) -> None:
    if record.status == "interrupted":
        t = record.curve["t"].iloc[-1]
        _stop(Exit.INTERRUPTED, f"interrupted at t = {t:.6g} s; {hint}")
    if record.status != "complete":
        _stop(Exit.FAILED, f"Error: {record.status.removeprefix('failed: ')}")


def _same_file(one: Path | None, other: str | None) -> bool:
    if one is None or other is None:
        return False
    return one.exists() and Path(other).exists() and one.samefile(other)


def _record_to_continue(path: str, scene: Scene, ctx: click.Context) -> Record:
    """Return the record of this scene; options that were given have to agree with it.

    Raises:
        RecordError: no record, or one of another scene.
        SceneError: an option differs.
    """
    import pyfric

    try:
        before = pyfric.Record.load(path)
    except FileNotFoundError as error:
        raise pyfric.RecordError(str(error)) from None
    if before.scene != scene:
        raise pyfric.RecordError(f"{path}: the record of another scene cannot be continued")
    method = before.method

    def same(name: str, value: Any) -> bool:
        if name == "fidelity":
            return value in ("auto", method.engine)
        if name == "dt":
            return pyfric.step_size(scene, value, method.stepper) == method.dt
        if name == "sample":
            return max(1, round(value / (method.dt or math.inf))) == method.sample
        return value == {
            "geometry": method.geometry,
            "method": method.stepper or "rk4",
            "switching": method.switching.replace(" ", "_") or "step_end",
            "rtol": method.rtol,
            "t_gap": method.t_gap,
            "budget": method.budget,
        }.get(name, value)

    for name, value in ctx.params.items():
        given = ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if given and not same(name, value):
            allowed = "what the record that is continued was made with, or no such option"
            unit = "s" if isinstance(value, float) and name != "rtol" else ""
            raise pyfric.SceneError(name, value, unit, allowed, "cannot change")
    return before


def _is_done(record: Record, t_end: float) -> bool:
    """Whether a complete record ends at t_end, or within the step beyond it."""
    t = record.curve["t"].iloc[-1]
    return record.status == "complete" and t - (record.method.dt or 0.0) < t_end <= t


def _simulate(scene: Scene, t_end: float, out: Path | None, **how: Any) -> Record:
    """Return the record of a run, whether it is complete, interrupted or failed."""
    import pyfric

    if out is not None:  # xarray is slow when it is used first, and that is not for after Ctrl-C
        import xarray as xr

        xr.Dataset({"a": ("x", [0.0])}, {"x": [0.0]}).to_netcdf(engine="h5netcdf")
    try:
        return pyfric.simulate(scene, t_end, checkpoint=out, **how)
    except pyfric.RunError as error:
        return error.record


def _draw(record: Record, stem: Path) -> list[Path]:
    from pyfric import figures

    return figures.save_figure(figures.fig1b(record), stem)


MAIN_COLUMNS = (
    "t_start",
    "t_stop",
    "L_p_over_L",
    "F_T_start_over_F_N",
    "F_T_arrest_over_F_N",
    "n_blocks",
    "nucleation_block",
    "is_precursor",
)


def _summary(record: Record, files: list[Path]) -> dict[str, Any]:
    """Return what `pyfric run` reports; None stands for numbers that are not known."""
    events, F_N = record.events, record.scene.F_N
    main = events[events["is_main"]]
    for name in ("F_T_start", "F_T_arrest"):
        main = main.assign(**{f"{name}_over_F_N": main[name] / F_N})
    last = record.curve.iloc[-1]
    return {
        "scene": record.scene.name,
        "status": record.status,
        "t": float(last["t"]),
        "F_T_over_F_N": float(last["F_T"] / F_N),
        "events": {
            "all": len(events),
            "main": len(main),
            "precursors": int(main["is_precursor"].sum()),
            "micro": len(events) - len(main),
        },
        "main_events": [
            {name: _plain(row[name]) for name in MAIN_COLUMNS} for _, row in main.iterrows()
        ],
        "timings": {name: float(value) for name, value in record.timings.items()},
        "method": {
            "engine": record.method.engine,
            "geometry": record.method.geometry,
            "dt": record.method.dt,
            "threads": record.method.threads,
            "variant": record.method.variant,
        },
        "counts": dict(record.counts),
        "notes": list(record.notes),
        "files": [str(path) for path in files],
    }


def _plain(value: Any) -> Any:
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _text(summary: dict[str, Any]) -> str:
    events, timings, method = summary["events"], dict(summary["timings"]), summary["method"]
    per_step = timings.pop("per_block_and_step", None)
    took = ", ".join(f"{name} {value:.2f} s" for name, value in timings.items())
    status = summary["status"].partition(":")[0]
    lines = [
        f"{summary['scene'] or 'run'}: {status} at t = {summary['t']:.6g} s, "
        f"F_T/F_N = {summary['F_T_over_F_N']:.4f}",
        f"events: {events['main']} main, of which {events['precursors']} precursors; "
        f"{events['micro']} micro-slips",
    ]
    if summary["main_events"]:
        lines += ["", f"{'t (s)':>10}  {'L_p/L':>6}  {'F_T/F_N':>8}  {'blocks':>6}"]
    for event in summary["main_events"]:
        force = event["F_T_start_over_F_N"]
        lines.append(
            f"{event['t_start']:>10.6f}  {event['L_p_over_L']:>6.3f}  "
            f"{'-' if force is None else f'{force:.4f}':>8}  {event['n_blocks']:>6}"
        )
    if summary["main_events"]:
        lines.append("")
    lines.append(
        ", ".join(
            [f"{method['engine']} engine", f"{method['geometry']} geometry"]
            + ([] if method["dt"] is None else [f"dt = {method['dt']:g} s"])
            + ([f"variant {method['variant']}"] if method["variant"] else [])
            + [f"{method['threads']} thread{'s' if method['threads'] > 1 else ''}"]
        )
    )
    lines.append(f"time taken: {took}")
    if per_step is not None:
        lines.append(f"per block and step: {per_step * 1e9:.1f} ns")
    lines += [f"note: {note}" for note in summary["notes"]]
    return "\n".join([*lines, *(f"written: {path}" for path in summary["files"])])


# --- plan ----------------------------------------------------------------------------------------


@main.command()
@click.argument("scene")
@click.option("--t-end", type=_Seconds(), default=1.0, help="Time of the end. [default: 1 s]")
@_set_option
@_want_option
@_tolerance_option
@_json_option
def plan(
    scene: str, t_end: float, changes: tuple[str, ...], want: str, tolerance: float, as_json: bool
) -> None:
    """Say which model of SCENE is enough for a question, why, and what it will cost."""
    import dataclasses

    import pyfric

    found = pyfric.plan(_scene(scene, changes), want, tolerance, t_end=t_end)
    if not as_json:
        click.echo(str(found))
        return
    listed = [one._asdict() | {"holds": one.holds} for one in found.assumptions]
    _print_json(dataclasses.asdict(found) | {"assumptions": listed})


# --- scene and info ------------------------------------------------------------------------------


@main.command()
@click.argument("scene")
@_set_option
@_file_option("--out", metavar="FILE", help="Write a file instead of stdout.")
@_overwrite_option
def scene(scene: str, changes: tuple[str, ...], out: Path | None, overwrite: bool) -> None:
    """Show SCENE as TOML: a start for a scene of your own."""
    what = _scene(scene, changes)
    _check_out(out, overwrite)
    text = what.to_toml(out)
    if out is None:
        click.echo(text, nl=False)


@main.command()
@_json_option
def info(as_json: bool) -> None:
    """Show version, compiler, instruction sets and threads."""
    import platform

    import numpy as np

    from pyfric import core
    from pyfric.scene import __version__

    build = core.build_info()
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    found = {
        "pyfric": __version__,
        "variant": core.VARIANT,
        "variants": core.variants(),
        "environment": core.ENVIRONMENT,
        **build,
        "processors": available,
        "blocks_per_thread": core.BLOCKS_PER_THREAD,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": platform.machine(),
    }
    if as_json:
        _print_json(found)
        return
    installed = [
        name if runs else f"{name} (not on this processor)"
        for name, runs in found["variants"].items()
    ]
    if os.environ.get(core.ENVIRONMENT):
        how = f"from {core.ENVIRONMENT}"
    else:
        how = f"the best one here; {core.ENVIRONMENT} names another"
    threads = f"one for every {core.BLOCKS_PER_THREAD} blocks, at most {available}"
    rows = {
        "pyfric": __version__,
        "variant": f"{core.VARIANT} ({how})",
        "installed": ", ".join(installed),
        "compiler": build["compiler"],
        "flags": build["flags"],
        "OpenMP": "yes" if build["openmp"] else "no",
        "processors": available,
        "threads": threads if build["openmp"] else "1",
        "python": found["python"],
        "numpy": found["numpy"],
    }
    for name, value in rows.items():
        click.echo(f"{name:<11} {value}")


@main.command(
    epilog="""\b
Exit codes:
    0  all checks hold
    1  a check fails
"""
)
@_json_option
def verify(as_json: bool) -> None:
    """Check this build (a minute): bits, exact answers, stored full dynamics."""
    from pyfric import checks

    show = None if as_json else lambda group: click.echo(f"{group.name} ...", err=True)
    groups = checks.verify.verify(progress=show)
    if as_json:
        _print_json(checks.verify.table(groups))
    else:
        click.echo(checks.verify.report(groups))
    if not all(group.holds for group in groups):
        _stop(Exit.FAILED)


# --- figures -------------------------------------------------------------------------------------


_names = click.Choice(["fig1b", "fig2a", "fig2b", "fig3a", "fig3b", "fig4a", "fig4b", "all"])


@main.command(epilog=SHORT_EXIT_CODES)
@click.argument("names", nargs=-1, type=_names)
@_file_option(
    "--out", metavar="DIR", default="figures", show_default=True, help="Folder of the files."
)
@_workers_option
@_no_cache_option
@click.option("--quiet", is_flag=True, help="Show nothing but errors.")
def reproduce(
    names: tuple[str, ...], out: Path, workers: int | None, no_cache: bool, quiet: bool
) -> None:
    """Make the paper's figures from runs of the model: all, or those named.

    Each figure is PNG and PDF with its caption and data; index.html shows them. Runs are made side
    by side. Finished ones are kept in the user's cache folder, or where PYFRIC_CACHE says, and used
    again; delete that folder to clear it.
    """
    from pyfric.paper import reproduce

    _check_folder(out)
    chosen = () if "all" in names else names
    progress = False if quiet else None
    files = reproduce(chosen, out, workers=workers, cache=not no_cache, progress=progress)
    _show_files(files, quiet)


@main.command()
@click.argument("scene")
@_set_option
@_file_option("--out", metavar="STEM", help="Names of the files. [default: sketch_SCENE]")
@click.option("--quiet", is_flag=True, help="Show nothing but errors.")
def draw(scene: str, changes: tuple[str, ...], out: Path | None, quiet: bool) -> None:
    """Draw a sketch of SCENE, to scale: STEM.png and STEM.pdf, with caption and data."""
    from pyfric import figures

    what = _scene(scene, changes)
    stem = out or Path(f"sketch_{Path(scene).stem}")
    _check_folder(stem.parent)
    _show_files(figures.save_figure(figures.sketch(what), stem), quiet)


@main.command()
@click.argument("source", metavar="SCENE|RECORD")
@click.option(
    "--event",
    type=click.IntRange(1),
    required=True,
    metavar="N",
    help="Main event (at least 4 blocks), counted from 1.",
)
@click.option(
    "--t-end", type=_Seconds(), default=1.0, help="Time of the end of a scene's run. [default: 1 s]"
)
@_set_option
@_file_option("--out", metavar="STEM", help="Names of the files. [default: event_N]")
@click.option("--gif", is_flag=True, help="Also write STEM.gif, an animation.")
@click.option("--quiet", is_flag=True, help="Show nothing but errors.")
def movie(
    source: str,
    event: int,
    t_end: float,
    changes: tuple[str, ...],
    out: Path | None,
    gif: bool,
    quiet: bool,
) -> None:
    """Draw one event as a strip of frames: velocity field, with the interface below it.

    From a scene (a preset or a TOML file), or from a record of the hybrid or dynamic engine
    with rk4 that began with the loaded slider (.nc). The event is run again with full dynamics
    from a state just before it.
    """
    import numpy as np

    import pyfric
    from pyfric import figures

    stem = out or Path(f"event_{event}")
    _check_folder(stem.parent)
    if source.lower().endswith(".nc"):
        if changes:
            raise click.UsageError(f"--set changes presets; {source} is a record.")
        try:
            record = pyfric.Record.load(source)
        except FileNotFoundError as error:
            raise pyfric.RecordError(str(error)) from None
    else:
        progress = False if quiet else None
        scene = _scene(source, changes)
        record = pyfric.simulate(scene, t_end, fidelity="hybrid", progress=progress)
        _stop_unless_complete(record, "")
    main_events = np.flatnonzero(record.events["is_main"])
    if event > len(main_events):
        t = record.curve["t"].iloc[-1]
        allowed = f"1 to {len(main_events)}, the main events up to t = {t:.4g} s"
        raise pyfric.SceneError("event", event, "", allowed, "no such event")
    row = int(main_events[event - 1])
    files = figures.save_figure(figures.event_strip(record, row), stem)
    if gif:
        files.append(figures.event_movie(record, row, stem.with_name(stem.name + ".gif")))
    _show_files(files, quiet)


def _show_files(files: list[Path], quiet: bool) -> None:
    if not quiet:
        for path in files:
            click.echo(path)


# --- claims --------------------------------------------------------------------------------------


@main.command(epilog=SHORT_EXIT_CODES)
@click.argument("numbers", nargs=-1, metavar="[N]...")
@_file_option("--out", metavar="DIR", help="Also write claims.json and claims.csv there.")
@_workers_option
@_no_cache_option
@_json_option
def claims(
    numbers: tuple[str, ...], out: Path | None, workers: int | None, no_cache: bool, as_json: bool
) -> None:
    """Measure what the paper says: all claims, or those named (1 to 16, E1 to E10).

    A value outside its band is a miss and stays in the table; the exit code is 0 all the same. If
    the page of `pyfric reproduce` is in --out, it shows the claims too.
    """
    from pyfric.paper import claims, write_index

    if out is not None:
        _check_folder(out)
    progress = False if as_json else None
    found = claims.measure(numbers or None, workers=workers, cache=not no_cache, progress=progress)
    files = [] if out is None else claims.save(found, out)
    if out is not None and (out / "index.html").is_file():
        files.append(write_index(out))
    if as_json:
        _print_json(claims.table(found))
    else:
        click.echo(claims.report(found))
        _show_files(files, quiet=False)


# --- studies -------------------------------------------------------------------------------------


_study_out = _file_option(
    "--out", metavar="DIR", default=".", show_default=True, help="Folder of the files."
)


@main.command()
@_study_out
@click.option("--quiet", is_flag=True, help="Show nothing but errors.")
def chart(out: Path, quiet: bool) -> None:
    """Chart the error of every method against its cost (about five minutes).

    DIR gets chart.png, chart.pdf, the points and measured orders as CSV, and their provenance.
    """
    from pyfric import checks

    study = checks.chart
    _save_study("chart", lambda: study.figure(study.chart(progress=not quiet)), out, quiet)


@main.command()
@_study_out
@click.option("--quiet", is_flag=True, help="Show nothing but errors.")
def stability(out: Path, quiet: bool) -> None:
    """Map the largest stable step of every stepper, computed and measured (about two minutes)."""
    from pyfric import checks

    study = checks.stability
    made = lambda: study.figure(study.stability_map(progress=not quiet))  # noqa: E731
    _save_study("stability", made, out, quiet)


@main.command()
@_study_out
@click.option("--quiet", is_flag=True, help="Show nothing but errors.")
def resolution(out: Path, quiet: bool) -> None:
    """Refine the lattice of the Fig. 1 scene and show what converges (several minutes)."""
    from pyfric import checks

    study = checks.resolution
    made = lambda: study.figure(study.study(progress=False if quiet else None))  # noqa: E731
    _save_study("resolution", made, out, quiet)


def _save_study(name: str, make: Callable[[], DataFigure], out: Path, quiet: bool) -> None:
    """Make a study's figure and save it with its provenance."""
    from pyfric import figures
    from pyfric.record import provenance

    _check_folder(out)
    files = figures.save_figure(make(), out / name)
    files.append(provenance(out / f"{name}_provenance.toml", f"pyfric {name}"))
    _show_files(files, quiet)


# --- regimes -------------------------------------------------------------------------------------


@main.command()
@_file_option("--out", metavar="FILE", help="Write the table as CSV.")
@_overwrite_option
@_json_option
def regimes(out: Path | None, overwrite: bool, as_json: bool) -> None:
    """Run the model where methods fail and say what happens there (about 15 s).

    Beside --out, a CSV file, goes its provenance. The exit code is 1 if something is not as stated.
    """
    from pyfric import checks
    from pyfric.record import provenance
    from pyfric.scene import written

    _check_out(out, overwrite)
    table = checks.regimes.observe(progress=lambda name: as_json or click.echo(name, err=True))
    if out is not None:
        with written(out) as draft:
            table.to_csv(draft, index=False, float_format="%.3g")
        provenance(out.with_name(f"{out.stem}_provenance.toml"), "pyfric regimes")
    click.echo(table.to_json(orient="records") if as_json else checks.regimes.report(table))
    if not table["as_stated"].all():
        _stop(Exit.FAILED, "Error: not everything is as stated")


# --- bench ---------------------------------------------------------------------------------------


@main.group()
def bench() -> None:
    """Measure the speed of the core on this machine."""


_quick_option = click.option("--quick", is_flag=True, help="Fewer sizes and shorter timings.")


@bench.command()
@_json_option
@_quick_option
def kernel(as_json: bool, quick: bool) -> None:
    """Time per block and force evaluation, beside peers where they are installed."""
    from pyfric import checks

    _show(checks.bench.kernel(quick=quick, progress=not as_json), as_json)


@bench.command()
@_json_option
@_quick_option
def threads(as_json: bool, quick: bool) -> None:
    """Gain from more threads, by the size of the lattice."""
    from pyfric import checks

    _show(checks.bench.threads(quick=quick, progress=not as_json), as_json)


@bench.command()
@_json_option
@_quick_option
def limit(as_json: bool, quick: bool) -> None:
    """How near the core is to what this processor can do."""
    from pyfric import checks

    _show(checks.bench.limit(quick=quick), as_json)


@bench.command()
@_json_option
@_quick_option
def scenes(as_json: bool, quick: bool) -> None:
    """Gain from several processes on independent runs."""
    from pyfric import checks

    _show(checks.bench.scenes(quick=quick, progress=not as_json), as_json)


@bench.command()
@_json_option
def fidelity(as_json: bool) -> None:
    """Every engine on the Fig. 1 scene: time, work, agreement with full dynamics (2 minutes)."""
    from pyfric import checks

    found = checks.bench_fidelity.fidelity(progress=not as_json)
    click.echo(found.to_json(orient="records") if as_json else checks.bench_fidelity.report(found))


def _show(frame: pd.DataFrame, as_json: bool) -> None:
    from pyfric import checks

    click.echo(frame.to_json(orient="records") if as_json else checks.bench.report(frame))


if __name__ == "__main__":
    sys.exit(main())
