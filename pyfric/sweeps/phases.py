"""Phase diagrams: labels of runs over two fields of a scene, and the lines between labels.

    found = phase_diagram()                      # the chain of Thøgersen et al.: alpha and tau_bar
    found = phase_diagram(scene, x=("interface.alpha", values), y=("driver.h", values), t_end=0.1)
    found.table                                  # one row for each point
    found.lines                                  # where labels change, along y at each x

Each point is one run. Lines are found between neighbouring points of the map (`pyfric.boundary`).
Where the pace changes, a line is the root of a speed minus its limit. All other lines are found by
bisection, and each point is predicted from the previous points. Finished runs are stored, so that a
diagram that was stopped goes on.

Source: K. Thøgersen et al., Phys. Rev. E 100, 043004 (2019), for the chain and its two numbers.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from pyfric.display import Shown
from pyfric.engines import Options
from pyfric.record import SLOW, Record, pace_limits
from pyfric.scene import PRESETS, Number, SceneLike, as_scene, chain, full_name, once, scene_fields
from pyfric.signals import at_once
from pyfric.sweeps.boundaries import boundary
from pyfric.sweeps.runs import Job, run_all
from pyfric.sweeps.shared import Shared, sharing
from pyfric.sweeps.store import Cache
from pyfric.sweeps.varied import Scale, Span
from pyfric.values import SceneError, check_number, check_whole, usage

Labels = Mapping[str, Callable[[Record], Hashable]]
Axis = tuple[str, Sequence[Number] | np.ndarray | Span]

ALPHA = np.logspace(-3, 1, 20)
"""Values of alpha/sqrt(k m) in the paper's diagram of the chain."""
TAU_BAR = np.logspace(-3, -0.01, 20)
"""Values of the scaled prestress in the paper's diagram."""
BLOCKS = 100
"""Number of blocks of the paper's chain."""
STEP = 0.17
"""Longest step of chains, in sqrt(m/k). Half of this step changes speeds by 2e-5."""
MORE = 1e-9
"""Force by which the first block of a chain is pushed beyond its threshold, over the threshold."""

LABELS: Labels = {
    "kind": lambda record: record.rupture_class().kind,
    "pace": lambda record: record.rupture_class().pace,
}
"""Default labels of a run: kind and pace of its class of rupture."""


PACES: Mapping[frozenset[str], tuple[float, int]] = {
    frozenset({"slow", "sub-Rayleigh"}): (SLOW, 0),
    frozenset({"sub-Rayleigh", "supershear"}): (1.0, 0),
    frozenset({"sub-Rayleigh", "beyond c_R"}): (1.0, 0),
    frozenset({"beyond c_R", "supershear"}): (1.0, 1),
}
"""Two paces -> the speed between them: its share of a speed limit of the scene, and which limit."""

MEASURED = ("speed", "speed_over_c", "reached", "status")
"""Columns of each point that are not labels."""

Pair = tuple[Hashable, ...]
"""Labels below and above a line."""
Row = dict[str, Any]
"""A row of the table: the fields, the labels, and numbers of the front."""


@dataclass(frozen=True, repr=False)
class PhaseDiagram(Shown):
    """Labels of the runs of a scene over two of its fields, and the lines between labels.

    Attributes:
        x, y: names of the fields.
        table: a row for each point: the fields, the labels, ``speed`` of the front (m/s),
            ``speed_over_c`` with c = l sqrt(k/m), ``reached`` (blocks), ``status``.
        lines: points at which a label changes along y. The columns are the name of the ``label``
            and its values ``below`` and ``above``; the fields, with y in the middle of the last
            bracket; the ends ``low`` and ``high`` of this bracket; and the number of ``runs``.
        units: SI units of the fields; "" without one, and for the numbers of a function.
        report: number of runs at each level, and their measured errors; "" if the runs share no
            verification (`pyfric.Shared`).
    """

    x: str
    y: str
    table: pd.DataFrame
    lines: pd.DataFrame
    units: tuple[str, str] = ("", "")
    report: str = ""

    def __repr__(self) -> str:
        runs = len(self.table) + int(self.lines["runs"].sum())
        points = f"{len(self.table)} points, {len(self.lines)} points of lines, {runs} runs"
        return f"Phase diagram over {self.x} and {self.y}: {points}"


def chain_job(alpha: float, tau_bar: float, blocks: int = BLOCKS) -> Job:
    """Return the run of a chain whose first block is always pushed just beyond its threshold.

    The chain is setup 1 lumped into one row, with another length and without bond viscosity. The
    run ends when the front arrests or reaches the last block.

    Args:
        alpha: viscosity of slip over sqrt(k m), > 0.
        tau_bar: prestress (tau/p - mu_k)/(mu_s - mu_k), between 0 and 1, the same on all blocks.
        blocks: number of blocks, at least 20.

    Raises:
        SceneError: a value is refused.
    """
    alpha = check_number("alpha", alpha, "sqrt(k m)", gt=0.0)
    tau_bar = check_number("tau_bar", tau_bar, "", gt=0.0, lt=1.0)
    blocks = check_whole("blocks", blocks, 20)
    base = chain()
    k, m, l, p = base.slider.k, base.m, base.slider.l, base.F_N / base.N_x
    mu_s, mu_k = 0.7, 0.45
    tau = (mu_k + (mu_s - mu_k) * tau_bar) * p
    scene = chain(
        L=(blocks - 1) * l,
        l=l,
        k=k,
        M=blocks * m,
        p=p,
        tau=tau,
        push=((1, mu_s * p * (1 + MORE) - tau),),
        K=0.0,
        V=0.0,
        eta=0.0,
        alpha=alpha * math.sqrt(k * m),
        mu_s=mu_s,
        mu_k=mu_k,
        name="pushed chain",
    )
    # Slow fronts take N/v with v > tau_bar/(alpha (1 - tau_bar)), fast ones less than 20 N; creep
    # behind an arrested front decays as exp(-(pi/2)^2 t/(alpha N^2)), or faster.
    slow = 3 * (1 - tau_bar) / tau_bar + 4 * blocks
    t_end = blocks * (20 + alpha * slow) * math.sqrt(m / k)
    end = f"reached = {(blocks - 1) * l!r}"
    options = {"fidelity": "dynamic", "energies": False, "verify": "none", "sample": t_end / 1000}
    dt = min(STEP, 2 / alpha) * math.sqrt(m / k)
    return Job(
        scene=scene, t_end=t_end, options=options | {"dt": dt, "stop_when": ("arrested", end)}
    )


@usage('phase_diagram(scene, x=("mu_s", [0.6, 0.7]), y=("h", ["5 mm", "10 mm"]), t_end="1 s")')
@at_once()
def phase_diagram(
    scene: SceneLike | Callable[[float, float], Job] | None = None,
    *,
    x: Axis | None = None,
    y: Axis | None = None,
    label: Callable[[Record], Hashable] | Labels | None = None,
    t_end: Number | None = None,
    options: Options | Mapping[str, Any] | None = None,
    changes: Mapping[str, Any] | None = None,
    lines: bool = True,
    tolerance: float = 1e-3,
    cache: Cache = True,
    **how: Any,
) -> PhaseDiagram:
    """Return the labels of a scene over two of its fields, and the lines where they change.

    Args:
        scene: a scene, the name of a preset or the path of a scene file, or a function of x and y
            that returns a `Job`. None means `chain_job`. With the name of a preset, each point is
            `preset(name, values)`, so that values which the preset derives from l or L change with
            them.
        x, y: the name of a field, such as "driver.h", and its values, rising, in SI or as text such
            as "5 mm", or a `Span`. The fields of the chain are "alpha" and "tau_bar", in either
            order. None means alpha along x and tau_bar along y as in the paper, 20 values each.
        label: a function of a record that labels the run, or several functions by name. None means
            kind and pace of `Record.rupture_class`, or "nothing slipped" without events.
        t_end: end of the runs of a scene, s; None for the chain and for a function.
        options: options of the runs of a scene, as in a `Sweep`; None for the chain and for a
            function.
        changes: name of another field of a scene -> its value; None for the chain and for a
            function.
        lines: whether to find the lines on which labels change, along y.
        tolerance: largest error of lines, in decades if y is spaced logarithmically, otherwise over
            the range of y.
        cache, how: as in `run_all`: workers, progress, executor.

    Raises:
        SceneError: an argument is refused; nothing has been run.
        JobError: a run failed.

    Source: see the module.
    """
    tolerance = check_number("tolerance", tolerance, "", gt=0.0, lt=0.5)
    job, axes, units = _jobs(scene, x, y, t_end, options, changes)
    (x_name, xs), (y_name, ys) = axes
    labels = LABELS if label is None else label
    labels = labels if isinstance(labels, Mapping) else {"label": labels}
    for name in labels:
        if name in (taken := (x_name, y_name, *MEASURED)):
            raise SceneError("label", name, "", f"a name other than {', '.join(taken)}")
    points = [(a, b) for a in xs for b in ys]
    shared = Shared()
    records = run_all([job(a, b) for a, b in points], cache=cache, shared=shared, **how)
    rows: dict[tuple[float, float], Row] = {}

    def enter(a: float, b: float, record: Record) -> None:
        slider, front = record.scene.slider, record.rupture_class()
        rows[a, b] = {
            **{x_name: a, y_name: b},
            **{name: of(record) for name, of in labels.items()},
        }
        over_c = front.speed / (slider.l * math.sqrt(slider.k / record.scene.m))
        measured = front.speed, over_c, front.reached, record.status
        rows[a, b] |= dict(zip(MEASURED, measured, strict=True))

    def run(a: float, b: float) -> Row:
        if (a, b) not in rows:
            enter(a, b, *run_all([job(a, b)], 1, cache, progress=False, shared=shared))
        return rows[a, b]

    def line(name: str, pair: Pair, cells: Mapping[float, tuple[float, float]]) -> pd.DataFrame:
        """Return the line between two labels; at each x of `cells`, y lies between two points.

        If there is a third label between them, the line is where the lower label ends. The line
        uses all finished runs, including the runs of other lines.
        """

        def below(b: float, a: float) -> bool:
            return bool(run(a, b)[name] == pair[0])

        def limit(b: float, a: float) -> float:
            """Return a number that changes sign between two paces; NaN for other labels."""
            if labels is not LABELS or frozenset(pair) not in PACES:
                return math.nan
            share, which = PACES[frozenset(pair)]
            return math.log(run(a, b)["speed"] / (share * pace_limits(job(a, b).scene)[which]))

        inside = [(b, a) for a, b in rows if a in cells and cells[a][0] <= b <= cells[a][1]]
        known = [(b, a, below(b, a), limit(b, a)) for b, a in inside]
        found = boundary(
            below,
            along=(ys[0], ys[-1]),
            over=list(cells),
            scale=even_scale(np.array(ys)),
            over_scale=even_scale(np.array(xs)),
            tolerance=tolerance,
            known=pd.DataFrame(known, columns=["along", "over", "label", "measure"]),
            measure=limit,
        )
        ends = zip(found["over"], found["high"], strict=True)
        above = [rows.get(end, {name: pair[1]})[name] for end in ends]
        found = found.assign(label=name, below=[pair[0]] * len(found), above=above)
        return found.rename(columns={"over": x_name, "along": y_name})

    for point, record in zip(points, records, strict=True):
        enter(*point, record)
    table, found = pd.DataFrame(rows.values()), []
    for name in labels if lines else ():
        changes: dict[Pair, dict[float, tuple[float, float]]] = {}
        for a, cell in itertools.product(xs, itertools.pairwise(ys)):
            pair = tuple(rows[a, b][name] for b in cell)
            if pair[0] != pair[1]:
                changes.setdefault(pair, {}).setdefault(a, cell)
        found += [line(name, pair, changes[pair]) for pair in sorted(changes, key=str)]
    columns = ["label", "below", "above", x_name, y_name, "low", "high", "runs"]
    joined = pd.concat([pd.DataFrame(columns=columns), *found], ignore_index=True)
    return PhaseDiagram(x_name, y_name, table, joined[columns].infer_objects(), units, str(shared))


def _jobs(
    scene: Any, x: Axis | None, y: Axis | None, t_end: Any, options: Any, changes: Any
) -> tuple[Callable[[float, float], Job], tuple[Axis, Axis], tuple[str, str]]:
    """Return the function from x and y to jobs, the axes with checked values, and their units."""
    own = scene is None
    units: dict[str, str] = {}
    if not (own or callable(scene)):
        base = scene if isinstance(scene, str) and scene in PRESETS else as_scene(scene)
        example = as_scene(base, changes)
        fields = scene_fields(example)
        units = {
            axis[0]: fields[full_name(example, axis[0])].unit
            for axis in (x, y)
            if isinstance(axis, tuple) and axis and isinstance(axis[0], str)
        }
    if own:
        x, y = x or ("alpha", ALPHA), y or ("tau_bar", TAU_BAR)
    checked = []
    for side, axis in (("x", x), ("y", y)):
        if not (isinstance(axis, tuple) and len(axis) == 2 and isinstance(axis[0], str)):
            raise SceneError(side, axis, "", "the name of a field and its values")
        name, unit, values = f"{side} {axis[0]}", units.get(axis[0], ""), axis[1]
        if isinstance(values, Span):
            values = values.in_si(name, unit).values(name)
        if not np.iterable(values) or isinstance(values, str):
            raise SceneError(side, values, "", "at least two values, rising", "not a list")
        values = [check_number(name, value, unit) for value in values]
        if len(values) < 2 or not (np.diff(values) > 0).all():
            raise SceneError(side, axis[1], "", "at least two values, rising")
        checked.append((axis[0], values))
    if checked[0][0] == checked[1][0]:
        raise SceneError("y", checked[1][0], "", "another field than that of x")
    names = [name for name, _ in checked]
    if own and set(names) != {"alpha", "tau_bar"}:
        raise SceneError("x, y", names, "", "'alpha' and 'tau_bar', the numbers of the chain")
    if own or callable(scene):
        for name, value in (("t_end", t_end), ("options", options), ("changes", changes)):
            if value is not None:
                raise SceneError(name, value, "", "None without a scene: the jobs have their own")
        chains = lambda a, b: chain_job(**{names[0]: a, names[1]: b})  # noqa: E731
        return chains if own else scene, tuple(checked), ("", "")
    if t_end is None:
        raise SceneError("t_end", None, "s", "the end of the runs of a scene", "missing")

    def job(a: float, b: float) -> Job:
        given = once([*(changes or {}).items(), *zip(names, (a, b), strict=True)])
        found = Job(scene=as_scene(base, given), t_end=t_end, options=options or Options())
        return dataclasses.replace(found, options=sharing(found.options))

    return job, tuple(checked), tuple(units[name] for name in names)


def even_scale(values: np.ndarray) -> Scale:
    """Return the scale in which values are more evenly spaced."""
    if values[0] <= 0 or len(values) < 3:
        return "linear"
    linear, log = np.diff(values), np.diff(np.log(values))
    return "log" if np.ptp(log) / log.mean() < np.ptp(linear) / linear.mean() else "linear"
