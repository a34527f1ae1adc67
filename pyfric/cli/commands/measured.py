"""Measurements: fit a scene to a curve, and show the effects of its parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pyfric.cli.app import main
from pyfric.cli.shared import (
    SceneName,
    Seconds,
    Tell,
    check_out,
    fidelity_option,
    figure_ends,
    overwrite_option,
    scene_of,
    set_option,
    stem_option,
    telling,
)

FITTED = figure_ends("events", "profiles")
TORNADO = figure_ends("sensitivity")


def _pairs(name: str, texts: tuple[str, ...], form: str) -> dict[str, str]:
    """Return NAME -> VALUE of texts NAME=VALUE.

    Raises:
        click.UsageError: an entry has no "=".
    """
    pairs = [text.partition("=") for text in texts]
    if wrong := next(
        (text for text, (_, sign, _) in zip(texts, pairs, strict=True) if not sign), ""
    ):
        raise click.UsageError(f"{name} {wrong}: write {form}.")
    return {key.strip(): value.strip() for key, _, value in pairs}


def _columns(texts: tuple[str, ...]) -> dict[str, str | int] | None:
    found = _pairs("--column", texts, "MEANING=NAME, such as F_T='Shear force'")
    return {key: int(v) if v.isdigit() else v for key, v in found.items()} or None


def _bounds(texts: tuple[str, ...]) -> dict[str, tuple[float | str, float | str]]:
    form = "NAME=LOW:HIGH, such as mu_k=0.3:0.6 or 'F_N=3 kN:4 kN'"
    found: dict[str, tuple[float | str, float | str]] = {}
    for name, text in _pairs("--vary", texts, form).items():
        low, sign, high = text.partition(":")
        if not (sign and low.strip() and high.strip()):
            raise click.UsageError(f"--vary {name}={text}: write {form}.")
        found[name] = _plain(low), _plain(high)
    return found


def _calibration(texts: tuple[str, ...]) -> dict[str, str | tuple[str, float]]:
    form = "MEANING=QUANTITY or MEANING=QUANTITY@ZERO, such as F_T='0.12 N@2048'"
    found: dict[str, str | tuple[str, float]] = {}
    for name, text in _pairs("--calibration", texts, form).items():
        each, sign, zero = (part.strip() for part in text.partition("@"))
        try:
            found[name] = (each, float(zero)) if sign else each
        except ValueError:
            raise click.UsageError(f"--calibration {name}={text}: write {form}.") from None
    return found


def _wraps(texts: tuple[str, ...]) -> dict[str, float]:
    form = "MEANING=PERIOD, such as load_point=65536"
    found = {}
    for name, text in _pairs("--wrap", texts, form).items():
        try:
            found[name] = float(text)
        except ValueError:
            raise click.UsageError(f"--wrap {name}={text}: write {form}.") from None
    return found


def _valid(texts: tuple[str, ...]) -> dict[str, tuple[float | str, float | str]]:
    form = "MEANING=LOW:HIGH, such as F_T='-5 kN:5 kN' or mu=0:1"
    found: dict[str, tuple[float | str, float | str]] = {}
    for name, text in _pairs("--valid", texts, form).items():
        low, sign, high = (part.strip() for part in text.partition(":"))
        if not sign:
            raise click.UsageError(f"--valid {name}={text}: write {form}.")
        found[name] = _plain(low), _plain(high)
    return found


def _plain(text: str) -> float | str:
    """Return text as a number if it is one, otherwise unchanged."""
    try:
        return float(text)
    except ValueError:
        return text


@main.command(
    section="Measure",
    example="pyfric fit scene.toml curve.csv --vary mu_k=0.3:0.6 --normal '400 N'",
)
@click.argument("scene", type=SceneName())
@click.argument("curve", metavar="FILE", type=click.Path())
@click.option(
    "--vary",
    multiple=True,
    required=True,
    metavar="NAME=LOW:HIGH",
    help="A parameter and its bounds, such as 'F_N=3 kN:4 kN'; numbers without unit are SI; may be "
    "repeated. Also offset and drift.",
)
@click.option(
    "--column",
    multiple=True,
    metavar="MEANING=NAME",
    help="Name or number of the column of t, step, F_T, F_N, tau, sigma_n, mu or load_point.",
)
@click.option("--unit", multiple=True, metavar="MEANING=UNIT", help="Unit of a column.")
@click.option(
    "--calibration",
    multiple=True,
    metavar="MEANING=QUANTITY[@ZERO]",
    help="What 1 in a column stands for, such as F_T='0.12 N', and the number for zero.",
)
@click.option(
    "--step", type=_plain, metavar="TIME", help="Time between samples of a file without times."
)
@click.option("--group", default="", help="Beginning of the names in a container.")
@click.option("--head", type=click.IntRange(0), default=0, help="Lines at the top to leave out.")
@click.option("--decimal", type=click.Choice([".", ","]), help="Decimal mark, if it is not clear.")
@click.option("--gap", multiple=True, metavar="WORD", help="A word that stands for a gap.")
@click.option(
    "--wrap", multiple=True, metavar="MEANING=PERIOD", help="Period of a counter that starts anew."
)
@click.option(
    "--valid",
    multiple=True,
    metavar="MEANING=LOW:HIGH",
    help="Ends of what a sensor tells, such as F_T='-5 kN:5 kN'.",
)
@click.option(
    "--restarts", metavar="join|N", help="Where times start anew: join them, or take part N."
)
@click.option(
    "--normal", "F_N", type=_plain, metavar="FORCE", help="Normal force, such as '400 N'."
)
@click.option(
    "--area", type=_plain, metavar="AREA", help="Area of the interface, such as '6 cm^2'."
)
@click.option(
    "--noise",
    type=_plain,
    metavar="NUMBER",
    help="Noise of the force over F_N. [default: estimated]",
)
@click.option(
    "--model-error",
    type=_plain,
    metavar="NUMBER",
    default=0.0,
    help="Error of forces of the model over F_N.",
)
@fidelity_option("hybrid", "Engine of the runs.")
@click.option(
    "--part",
    type=click.Choice(["onset", "all"]),
    default="onset",
    help="Events that are compared one by one; others by their mean forces.",
    show_default=True,
)
@set_option
@stem_option("--out", help="Names of the files of the figure. [default: fit_SCENE]")
@overwrite_option
@telling
def fit(
    scene: str,
    curve: str,
    vary: tuple[str, ...],
    column: tuple[str, ...],
    unit: tuple[str, ...],
    calibration: tuple[str, ...],
    step: float | str | None,
    group: str,
    head: int,
    decimal: Any,
    gap: tuple[str, ...],
    wrap: tuple[str, ...],
    valid: tuple[str, ...],
    restarts: str | None,
    F_N: float | str | None,
    area: float | str | None,
    noise: float | str | None,
    model_error: float | str,
    fidelity: str,
    part: str,
    changes: tuple[str, ...],
    out: Path | None,
    overwrite: bool,
    tell: Tell,
) -> None:
    """Fit parameters of SCENE to the events of the measured curve in FILE.

    FILE may be of any kind that pyfric.measured.read takes. The figure shows data over model,
    residuals, and a profile for each parameter.
    """
    import dataclasses

    import pyfric
    from pyfric import figures, measured
    from pyfric.display import plain

    stem = out or Path(f"fit_{Path(scene).stem}")
    check_out(stem, overwrite, ends=FITTED, reads=[scene, curve])
    bounds, what = _bounds(vary), scene_of(scene, changes)
    units = _pairs("--unit", unit, "MEANING=UNIT, such as F_T=N")
    part_of: Any = int(restarts) if restarts and restarts.isdigit() else restarts
    read: Any = measured.read(
        curve,
        _columns(column),
        units=units,
        calibration=_calibration(calibration),
        F_N=F_N,
        area=area,
        step=step,
        group=group,
        head=head,
        decimal=decimal,
        gaps=gap,
        wraps=_wraps(wrap),
        valid=_valid(valid),
        restarts=part_of,
    )
    read = dataclasses.replace(read, noise=noise)
    how: Any = {"model_error": model_error, "fidelity": fidelity, "part": part}
    found = pyfric.fit(what, read, bounds, **how, progress=tell.step)
    figures.save_figure(figures.fit_page(found), stem)
    told = {"values": dict(found.values), "intervals": dict(found.intervals)}
    told |= {"chi2": found.chi2, "dof": found.dof, "probability": found.probability}
    told |= {"missing": found.missing, "extra": found.extra, "model_error": found.model_error}
    tell.result(plain(told), lambda: f"{read}\n{found}")


@main.command(section="Measure")
@click.argument("scene", type=SceneName())
@click.option("--t-end", type=Seconds(), default=1.5, help="End of the runs. [default: 1.5 s]")
@click.option(
    "--step",
    multiple=True,
    metavar="NAME=STEP",
    help="A parameter and its change: 'F_N=10 N', mu_k=0.01, K=5%. [default: six of them]",
)
@fidelity_option("quasistatic", "Engine of the runs; only the last two have fronts.")
@set_option
@stem_option("--out", help="Names of the files of the figure. [default: sensitivity_SCENE]")
@overwrite_option
@telling
def sensitivity(
    scene: str,
    t_end: float,
    step: tuple[str, ...],
    fidelity: str,
    changes: tuple[str, ...],
    out: Path | None,
    overwrite: bool,
    tell: Tell,
) -> None:
    """Say and draw how much forces, lengths, counts and speeds change with parameters of SCENE."""
    import pyfric
    from pyfric import figures

    stem = out or Path(f"sensitivity_{Path(scene).stem}")
    check_out(stem, overwrite, ends=TORNADO, reads=[scene])
    given = _pairs("--step", step, "NAME=STEP, such as mu_k=0.01 or K=5%")
    steps = {name: _plain(text) for name, text in given.items()}
    found = pyfric.sensitivity(scene_of(scene, changes), t_end, steps or None, fidelity=fidelity)
    figures.save_figure(figures.tornado(found), stem)
    tell.table(found.table, lambda table: str(found))
