"""Common parts of commands: exit codes, parameters, options, output."""

from __future__ import annotations

import enum
import functools
import hashlib
import json
import os
import shlex
import signal
import socket
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
from click.shell_completion import CompletionItem

if TYPE_CHECKING:
    import pandas as pd

    from pyfric.figures import DataFigure
    from pyfric.record import Record
    from pyfric.scene import Scene


CLAIM = ".running"
"""End of the name of a file that is locked while a command makes the output beside it."""


class Exit(enum.IntEnum):
    """Exit codes. If signal n ends a command, its exit code is 128 + n."""

    COMPLETE = 0
    FAILED = 1
    BAD_INPUT = 2
    INTERRUPTED = 128 + signal.SIGINT


EXIT_CODES = """\b
Exit codes:
    0  complete
    1  a run failed or a file could not be written
    2  bad input; nothing was started
  130  interrupted by Ctrl-C
128+n  the same by another signal: 143 SIGTERM, 129 SIGHUP, 138 SIGUSR1
Finished runs are kept, and --out of pyfric run holds the results until a failure or a signal.
"""


def stop(code: int, message: str = "") -> NoReturn:
    if message:
        click.echo(message, err=True)
    raise click.exceptions.Exit(int(code))


def signalled() -> int:
    """Return the exit code of a command that a signal has asked to stop."""
    from pyfric.signals import asked_to_stop

    # If KeyboardInterrupt ended a text that Python executed, as imports of libraries do, `python
    # -m` would end by SIGINT. Executing another text prevents this.
    eval("0")
    return 128 + (asked_to_stop() or signal.SIGINT)


def stop_unless_complete(record: Record, hint: str) -> None:
    if record.status == "interrupted":
        t = record.curve["t"].iloc[-1]
        stop(signalled(), f"interrupted at t = {t:.6g} s; {hint}")
    if not record.done:
        stop(Exit.FAILED, f"Error: {record.status.removeprefix('failed: ')}")


# --- parameters ----------------------------------------------------------------------------------


class Listed(click.Choice[str]):
    """Choices from a registry, which is imported only when needed."""

    def __init__(self, names: Callable[[], Iterable[str]]) -> None:
        self.names, self.case_sensitive = names, True

    @property
    def choices(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return tuple(self.names())


def _with_events() -> list[str]:
    from pyfric.engines import ENGINES

    return [name for name, engine in ENGINES.items() if engine.has("verify", None)]


def fidelity_option(default: str, text: str) -> Callable[[Any], Any]:
    """Add --fidelity, for commands whose runs need events."""
    kind = Listed(_with_events)
    return click.option("--fidelity", type=kind, default=default, help=text, show_default=True)


class SceneName(click.ParamType):
    """A preset or a file, which shells can complete."""

    name = "scene"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        if value == "-":
            self.fail("scenes are not read from stdin: name a preset or a file.", param, ctx)
        return os.path.expanduser(value)

    def shell_complete(self, ctx: Any, param: Any, incomplete: str) -> list[CompletionItem]:
        from pyfric.scene import PRESETS

        found = [CompletionItem(name) for name in PRESETS if name.startswith(incomplete)]
        return [*found, CompletionItem(incomplete, type="file")]


def _keys(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
    """Return completions of --set for the preset on the command line, or for setup 1."""
    from pyfric.scene import PRESETS, settings

    words = [*ctx.params.values(), *ctx.args]
    scene = next((word for word in words if isinstance(word, str) and word in PRESETS), "setup1")
    return [f"{key}=" for key in settings(scene) if key.startswith(incomplete)]


class Seconds(click.ParamType):
    """A time: a bare number in s, or a quantity with its unit."""

    name = "time"

    def __init__(self, *words: str) -> None:
        self.words = words

    def convert(self, value: Any, param: Any, ctx: Any) -> float | str:
        from pyfric.values import check_number, spoken

        if value in self.words:
            return value
        return check_number(param.name, spoken(value), "s", ge=0.0)


def scene_of(name: str, changes: tuple[str, ...]) -> Scene:
    """Return the preset, or the scene in a file, called `name`, with the changes of --set.

    Raises:
        SceneError: there is no preset or file `name`, or a changed value is refused.
    """
    from pyfric.scene import as_scene

    if name.lower().endswith(".nc"):
        goes_on = f"pyfric run SCENE --t-end TIME --resume {name} continues it"
        raise click.UsageError(f"{name} is a record: {goes_on}, and pyfric show {name} draws it.")
    return as_scene(name, changes_of(changes))


def changes_of(changes: tuple[str, ...]) -> dict[str, Any]:
    """Return name -> value of each --set."""
    from pyfric.scene import once
    from pyfric.values import spoken

    values = []
    for change in changes:
        key, equals, text = (part.strip() for part in change.partition("="))
        if not (key and equals):
            raise click.UsageError(f"--set {change}: write KEY=VALUE, such as 'h=7.5 mm'.")
        values.append((key, text if key == "name" else spoken(text)))
    return once(values)


def record_of(path: str) -> Record:
    """Return the record in the file `path`.

    Raises:
        RecordError: the file is not a record.
    """
    import pyfric
    from pyfric.scene import PRESETS

    try:
        return pyfric.Record.load(path)
    except FileNotFoundError as error:
        if path in PRESETS:
            raise click.UsageError(f"{path} is a scene: pyfric scene {path} prints it.") from None
        raise pyfric.RecordError(str(error)) from None


def check_out(
    out: Path | None,
    overwrite: bool = False,
    *,
    option: str = "--out",
    ends: tuple[str, ...] = ("",),
    suffix: str = "",
    reads: Iterable[str | Path | None] = (),
) -> None:
    """Refuse an output before anything starts. All commands use this rule.

    The output is the file `out`, in the format of `suffix`, or several files with this stem and
    different `ends`. All files must be writable (`pyfric.scene.check_writable`). A file is replaced
    only with --overwrite. A file that the command `reads` is never replaced.
    """
    if out is None:
        return
    read = [Path(path) for path in reads if path is not None and Path(path).exists()]
    for end in ends:
        path = out.with_name(out.name + end)
        _check_writable(path, path, option, suffix)
        if path.exists() and any(path.samefile(path_read) for path_read in read):
            raise click.UsageError(f"{option} {path}: this file is read by the same command.")
        if path.exists() and not overwrite:
            raise click.UsageError(f"{option} {path}: the file exists; --overwrite replaces it.")


def check_folder(out: Path | None, option: str = "--out") -> None:
    """Refuse a folder of outputs before anything starts, as `check_out` refuses a file.

    A missing folder is made. Existing files with the names of outputs are replaced, as the help of
    `pyfric` says.
    """
    if out is not None:
        _check_writable(out, (out if os.path.lexists(out) else out.parent) / "file", option)


def _check_writable(out: Path, path: Path, option: str, suffix: str = "") -> None:
    """Refuse an output if its file `path` cannot be written."""
    from pyfric.values import check_writable, naming

    try:
        with naming(option):
            check_writable(path, suffix=suffix)
    except OSError as error:
        raise click.UsageError(f"{option} {out}: {error.strerror}.") from None


@contextmanager
def claimed(out: Path | None, what: object, option: str = "--out") -> Iterator[None]:
    """Claim an output in a with block; refuse it if another process makes different results there.

    A file beside the output is locked while this process lives. Without locks in the folder,
    nothing is refused. `what` describes the inputs of the output.
    """
    if out is None:
        yield
        return
    from filelock import FileLock, Timeout  # slow to import

    path = Path(os.path.abspath(out))
    path = path.parent / f".{path.name}{CLAIM}"
    own = hashlib.sha256(repr(what).encode()).hexdigest()
    lock = FileLock(path, timeout=0, fallback_to_soft=False)
    try:
        lock.acquire()
        path.write_text(f"{own} {os.getpid()} of {socket.gethostname()}")
    except Timeout:
        with suppress(OSError):
            other, _, process = path.read_text().partition(" ")
            if other != own:
                who = f"process {process}" if process else "another process"
                reason = f"{who} writes other results there; name another place, or wait"
                raise click.UsageError(f"{option} {out}: {reason}.") from None
    except OSError:
        pass
    try:
        yield
    finally:
        if lock.is_locked:
            with suppress(OSError):
                path.unlink()
            lock.release()


def figure_ends(*tables: str) -> tuple[str, ...]:
    """Return the endings of the file names of a figure with these tables."""
    return (".png", ".pdf", ".txt", *(f"_{name}.csv" for name in tables))


set_option = click.option(
    "--set",
    "changes",
    metavar="KEY=VALUE",
    multiple=True,
    shell_complete=_keys,
    help="Change a value of SCENE, such as 'h=7.5 mm' or interface.mu_k=0.4; repeatable. A key "
    "is a field of the scene's TOML, with its table if the name is ambiguous. Numbers without unit "
    "are SI.",
)
overwrite_option = click.option("--overwrite", is_flag=True, help="Replace files that exist.")


def running(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of `pyfric.run_all`: --workers and --no-cache."""
    workers = click.option(
        "--workers",
        type=click.IntRange(1, 4096),
        help="Largest number of runs at a time. [default: processors]",
    )
    cache = click.option(
        "--no-cache",
        "cache",
        flag_value=False,
        default=True,
        help="Repeat all runs and store none.",
    )
    return workers(cache(command))


class _Folder(click.Path):
    """The path of a folder."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        return super().convert(_named(self, value, param, ctx), param, ctx)


def _named(kind: click.ParamType, value: Any, param: Any, ctx: Any) -> str:
    """Return a path with the home folder for ~, which shells do not expand inside quotes."""
    text = os.fspath(value)
    if text == "-":
        kind.fail("results are not written to stdout: name a place for them.", param, ctx)
    return os.path.expanduser(text)


class _File(click.Path):
    """The path of a file or the stem of a figure; not empty, and not a folder."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        text = os.fspath(value)
        if not Path(text).name or text.endswith(("/", os.sep)):
            self.fail(f"{text!r} does not name a file.", param, ctx)
        return super().convert(_named(self, value, param, ctx), param, ctx)


class _Stem(_File):
    """The stem of the names of a figure's files; the suffix .png or .pdf may follow it."""

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        from pyfric.values import figure_stem, naming

        with naming(param.opts[0]):
            return figure_stem(super().convert(value, param, ctx))


def file_option(name: str, **rest: Any) -> Callable[..., Any]:
    return click.option(name, type=_File(path_type=Path), **rest)


def stem_option(name: str, **rest: Any) -> Callable[..., Any]:
    return click.option(name, type=_Stem(path_type=Path), metavar="STEM", **rest)


def folder_option(name: str, **rest: Any) -> Callable[..., Any]:
    return click.option(name, type=_Folder(path_type=Path), **rest)


figure_out_option = folder_option(
    "--out", metavar="DIR", default=".", show_default=True, help="Folder for the files."
)


# --- output --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tell:
    """The output of a command: the result on stdout, as JSON with --json, nothing with --quiet.

    Progress is shown on stderr, if stderr is a terminal.
    """

    quiet: bool
    as_json: bool

    @property
    def progress(self) -> bool:
        """Whether to show progress."""
        return not (self.quiet or self.as_json) and sys.stderr is not None and sys.stderr.isatty()

    def step(self, text: str) -> None:
        """Print the name of the next step."""
        if self.progress:
            click.echo(text, err=True)

    def result(self, value: Any, text: Callable[[], str]) -> None:
        """Print a result: `value` as JSON, or else `text`."""
        if self.as_json:
            click.echo(json.dumps(value, indent=2, allow_nan=False))
        elif not self.quiet:
            click.echo(text())

    def table(self, frame: pd.DataFrame, report: Callable[[pd.DataFrame], str]) -> None:
        """Print a table; unknown numbers are null."""
        from pyfric.display import plain

        self.result(plain(frame.to_dict("records")), lambda: report(frame))

    def files(self, files: Iterable[Path], **more: Any) -> None:
        """Print the names of the written files."""
        names = [str(path) for path in files]
        self.result(more | {"files": names}, lambda: "\n".join(names))


def telling(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options --quiet and --json, and the argument `tell`."""

    @click.option("--quiet", is_flag=True, help="Print nothing but errors.")
    @click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
    @functools.wraps(command)
    def told(*args: Any, quiet: bool, as_json: bool, **rest: Any) -> Any:
        return command(*args, tell=Tell(quiet, as_json), **rest)

    return told


def _provenance_of(table: Path) -> Path:
    return table.with_name(f"{table.stem}_provenance.toml")


def check_table(out: Path | None, overwrite: bool) -> None:
    """Refuse a table or its provenance file before anything starts, as `check_out` does."""
    if out is not None:
        check_out(out, overwrite, suffix=".csv")
        check_out(_provenance_of(out), overwrite)


def command_line() -> str:
    """Return the command line as given, for `provenance`."""
    return shlex.join(["pyfric", *sys.argv[1:]])


def save_table(table: pd.DataFrame, out: Path | None, command: str, digits: str) -> None:
    """If `out` is given, save a table as CSV, and beside it the command that makes it."""
    from pyfric.record import provenance
    from pyfric.values import write

    if out is not None:
        write(out, table.to_csv(index=False, float_format=digits).encode())
        provenance(_provenance_of(out), command)


def save_figure(figure: DataFigure, stem: Path, command: str, tell: Tell) -> None:
    """Save a figure and its provenance (the command that makes it), and print their names.

    A missing folder is made.
    """
    from pyfric import figures
    from pyfric.record import provenance

    stem.parent.mkdir(parents=True, exist_ok=True)
    files = figures.save_figure(figure, stem)
    files.append(provenance(stem.with_name(f"{stem.name}_provenance.toml"), command))
    tell.files(files)
