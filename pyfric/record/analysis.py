"""Quantities of the paper from a record: lengths, stresses, front speeds, friction coefficients.

Functions take a `pyfric.Record` of any engine. Tables are in the paper's normalised quantities.
Blocks are numbered n = 1 ... N_x from the trailing edge, the driven side, and are at
x/L = (n-1)/(N_x-1). Tables list blocks in this order, whichever side is driven. Forces are over
F_N, interface forces over F_N/N_x. ``event`` is the number of an event, counted from 1: the index
of ``record.events``.

tau is positive where friction resists the drive. The *scaled prestress* is
(tau/p - mu_k)/(mu_s - mu_k): 0 at the kinetic and 1 at the static threshold. tau/p and the scaled
prestress are NaN where a block is open (p = 0). The scaled prestress is NaN where mu_s = mu_k.

Source: PRL 107, 074301 (2011).
"""

from __future__ import annotations

import os
import sys
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import pandas as pd
import scipy
from numpy.typing import ArrayLike

from pyfric.record.balance import extent, potency_history
from pyfric.record.data import RecordData
from pyfric.record.growth import energy_release, griffith_length, nucleations
from pyfric.record.held import counted, of_record
from pyfric.record.recurrence import Sizes, b_value, sizes
from pyfric.record.rupture import front_speed
from pyfric.scene import Scene
from pyfric.values import SceneError, check_number, check_whole, no_attribute

__all__ = [
    "Beside",
    "Collapse",
    "FrictionCoefficients",
    "Sizes",
    "b_value",
    "budget_error",
    "budget_left",
    "collapse_spread",
    "compare_curve",
    "energy_release",
    "extent",
    "friction_coefficients",
    "front",
    "fronts",
    "griffith_length",
    "mean_force",
    "nucleations",
    "potency_history",
    "precursor_lengths",
    "precursors",
    "sizes",
    "stress_profile",
    "system_size_events",
]


def __getattr__(name: str) -> Any:
    """Raise AttributeError with the nearest known name."""
    raise no_attribute("analysis", name, sys.modules[__name__], known=__all__)


When = Literal["before", "after"]

BINS = 20
"""Default number of bins of `collapse_spread`."""

SHIFTS = 2001
"""Number of time shifts that `compare_curve` tries. The best shift is then refined."""

ROUNDED = 1e-7
"""Exchanged energy counts as almost zero below this share of the stored energy. Sums of about 1e3
terms have a rounding error of 1e-13, so that smaller changes have errors above 1e-6."""

PER_BIN = 5
"""Smallest number of points for each bin of `collapse_spread`. The median of five points lies in
the middle half of their distribution with a probability of four fifths (binomial)."""


def budget_left(curve: pd.DataFrame | RecordData) -> pd.Series:
    """Return the residual of the energy budget since the first point, in J, an error of time steps.

    Args:
        curve: a run with energies = True, or its loading curve.

    Raises:
        SceneError: the curve has no energy budget.
    """
    stored, given, lost = _moved(curve)
    return stored - given + lost


def budget_error(curve: pd.DataFrame | RecordData) -> float:
    """Return the largest residual of an energy budget, over the largest energy exchanged.

    If almost no energy was exchanged, the residual is divided by `ROUNDED` times the stored energy.

    Args:
        curve: a run with energies = True, or its loading curve.

    Raises:
        SceneError: the curve has no energy budget.
    """
    curve = getattr(curve, "curve", curve)
    moved = max(term.abs().max() for term in _moved(curve))
    moved = max(moved, ROUNDED * curve[_energies(curve)].abs().sum(axis=1).max())
    return float(budget_left(curve).abs().max() / moved) if moved > 0 else 0.0


def _energies(curve: pd.DataFrame) -> list[str]:
    return [name for name in curve if name.startswith(("kinetic_", "elastic_"))]


def _moved(curve: pd.DataFrame | RecordData) -> tuple[pd.Series, pd.Series, pd.Series]:
    """Return energy stored, work and heat since the first point, in J.

    In a run that starts from a state, sums of work and heat at the first point need not be 0.
    """
    curve = getattr(curve, "curve", curve)
    if "work_driver" not in curve:
        raise SceneError("curve", ", ".join(curve), "", "that of a run with energies = True")
    stored = curve[_energies(curve)].sum(axis=1)
    work, lost = curve["work_driver"] + curve["work_load"], curve["dissipated_bonds"]
    for name in (name for name in counted("given") if name in curve):
        work = work + curve[name]
    for name in (name for name in counted("lost") if name in curve):
        lost = lost + curve[name]
    return stored - stored.iloc[0], work - work.iloc[0], lost - lost.iloc[0]


class FrictionCoefficients(NamedTuple):
    """Friction of the slider as a whole.

    Attributes:
        mu_s_macro: largest static (F_T + T)/F_N at the start of an event, or the peak of
            (F_T + T)/F_N in steady sliding.
        mu_k_macro: mean F_T + T over mean F_N, over whole stick-slip cycles; NaN with fewer than
            two system-size events, or if the driver moves back between them.
        R: (mu_s_macro - mu_k)/(mu_s - mu_k): 0 if mu_k limits the force, 1 if mu_s limits it; NaN
            if mu_s = mu_k.
    """

    mu_s_macro: float
    mu_k_macro: float
    R: float


class Collapse(NamedTuple):
    """Spread of points about one curve.

    Attributes:
        rms: root mean square of ln y (or y) minus the median of its bin.
        n: number of points.
        edges: edges of the bins in x, between points, shape (bins + 1,).
        median: median of y in each bin, shape (bins,); NaN in a bin that is empty due to equal x.
    """

    rms: float
    n: int
    edges: np.ndarray
    median: np.ndarray


# --- events --------------------------------------------------------------------------------------


@of_record
def precursors(record: RecordData) -> pd.DataFrame:
    """Return the precursors: finished main events with 0 < L_p < L, at any time of the run.

    Returns:
        One row for each precursor, in order of time. Columns: ``event``; all columns of
        ``record.events``; ``force_start`` and ``force_arrest``, static forces at first slip and
        last stick over F_N.
    """
    events = record.events
    return _chosen(record, events["is_main"] & events["finished"] & events["is_precursor"])


@of_record
def system_size_events(record: RecordData) -> pd.DataFrame:
    """Return the finished main events with L_p = L; columns as in `precursors`."""
    events = record.events
    return _chosen(record, events["is_main"] & events["finished"] & (events["L_p_over_L"] == 1))


@of_record
def precursor_lengths(record: RecordData) -> pd.DataFrame:
    """Return length against force of the precursors, as in the paper's Fig. 2.

    Only precursors before the first system-size event count, because later precursors start from
    another state of the interface.

    Returns:
        ``event``; ``force``, the static F_T/F_N after arrest; ``L_p_over_L``.
    """
    table = precursors(record).rename(columns={"force_arrest": "force"})
    sliding = system_size_events(record)["event"]
    table = table[table["event"] < sliding.min()] if len(sliding) else table
    return table[["event", "force", "L_p_over_L"]]


# --- stresses ------------------------------------------------------------------------------------


@of_record
def stress_profile(
    record: RecordData, event: int | None = None, when: When = "before"
) -> pd.DataFrame:
    """Return the static stresses along the interface, as in the paper's Fig. 3.

    Args:
        event: number of the event, from 1; None means the loaded slider at F_T = 0.
        when: "before" means the state at the event's first slip, "after" the state at its last
            stick. `when` is ignored if `event` is None.

    Returns:
        One row per block. Columns: n; x_over_L; tau and p over F_N/N_x; tau_over_p;
        p_over_p_initial, p over p at F_T = 0, NaN for 0/0; scaled, the scaled prestress; region, 1
        slipped in the event, 2 corner slip or open in the event, 0 neither.

    Raises:
        SceneError: no such event, the event did not reach this state, or unknown ``when``.
    """
    if when not in get_args(When):
        raise SceneError("when", when, "", " or ".join(map(repr, get_args(When))))
    order, unit = np.argsort(record.scene.n_of_i), record.scene.F_N / record.scene.N_x
    if event is None:
        tau, p = record.tau_initial, record.p_initial
        region = np.zeros(record.scene.N_x, dtype=np.int8)
    else:
        row = record.row(event)
        tau, p = (record.arrays[f"{name}_{when}"][row] for name in ("tau", "p"))
        region = record.region[row]
        if not np.isfinite(p).all():
            reason = f"the record holds no static state {when} event {event}"
            raise SceneError("event", event, "", "a finished event with static states", reason)
    tau, p, p_initial = tau[order], p[order], record.p_initial[order]
    tau_over_p = _ratio(tau, p)
    return pd.DataFrame(
        {
            **_positions(record),
            "tau": tau / unit,
            "p": p / unit,
            "tau_over_p": tau_over_p,
            "p_over_p_initial": _ratio(p, p_initial),
            "scaled": _scaled(record, tau_over_p),
            "region": region[order],
        }
    )


# --- fronts --------------------------------------------------------------------------------------


@of_record
def front(record: RecordData, event: int) -> pd.DataFrame:
    """Return the rupture front of one event, as in the paper's Fig. 4.

    Args:
        record: a run planned for want = "front_speed", because front speeds need small steps.
        event: number of the event, from 1.

    Returns:
        One row per block of the front. Columns: n; x_over_L; t, rupture time in s; v_c, speed
        averaged over five blocks in m/s; tau_over_p and scaled, of the static state just before
        the event; X_c0_over_l and X_c_over_l, blocks in the cohesive zone at rest and at v_c.

        v_c is NaN within two blocks of either end, and where the five times do not increase.
        X_c_over_l is NaN where v_c is NaN or, in two dimensions, at least c_R. Six or more blocks
        in X_c0 resolve a front. With fewer blocks, the lattice sets the front speed.

    Raises:
        SceneError: no such event.
    """
    return _fronts(record, np.array([record.row(event)])).drop(columns="event")


@of_record
def fronts(record: RecordData) -> pd.DataFrame:
    """Return fronts of all finished main events, with the columns of `front` and ``event``."""
    events = record.events
    return _fronts(record, np.flatnonzero(events["is_main"] & events["finished"]))


def _fronts(record: RecordData, rows: np.ndarray) -> pd.DataFrame:
    """Return one table with the fronts of events in the given rows, counted from 0."""
    order, shape = np.argsort(record.scene.n_of_i), (len(rows), record.scene.N_x)
    names = ("rupture_times", "tau_before", "p_before", "X_c0_over_l", "X_c_over_l")
    t, tau, p, at_rest, moving = (record.arrays[name][rows][:, order] for name in names)
    tau_over_p = _ratio(tau, p)
    columns = {
        "event": np.broadcast_to(rows[:, None] + 1, shape),
        **{name: np.broadcast_to(values, shape) for name, values in _positions(record).items()},
        "t": t,
        "v_c": front_speed(t, record.scene.slider.l),
        "tau_over_p": tau_over_p,
        "scaled": _scaled(record, tau_over_p),
        "X_c0_over_l": at_rest,
        "X_c_over_l": moving,
    }
    inside = np.isfinite(t)
    return pd.DataFrame({name: values[inside] for name, values in columns.items()})


# --- beside a measurement ------------------------------------------------------------------------


class Beside(NamedTuple):
    """Difference of a measured curve from a run.

    Attributes:
        rms: root mean square of the difference in force, N.
        shift: time added to the measured times for the smallest rms, s.
        rms_shifted: the smallest rms, N.
        n: number of measured points within the run at this shift.
    """

    rms: float
    shift: float
    rms_shifted: float
    n: int


def compare_curve(
    record: RecordData,
    t: ArrayLike,
    F_T: ArrayLike | None = None,
    *,
    largest_shift: float | None = None,
) -> Beside:
    """Return the difference of a measured loading curve from a run, with and without a time shift.

    The force of the run is linear between its points. Measured points outside the run do not count,
    and a shift leaves at least half of the measured points inside. Masked points, such as gaps of
    netCDF4, are left out. In stick-slip, a small difference of the period makes the rms large.
    Compare events with `pyfric.measured.events` instead.

    Args:
        t, F_T: measured times, s, increasing, and forces, N, shape (n,), n >= 2.
        largest_shift: largest absolute shift, s; None means half of the measured time.

    Returns:
        `Beside`; its rms is NaN if no measured point lies within the run.

    Raises:
        SceneError: times and forces differ in shape, no shift leaves half of the points inside, or
            largest_shift is refused.
    """
    if F_T is None or isinstance(t, str | os.PathLike):
        what = t if isinstance(t, str | os.PathLike) else type(t).__name__
        reason = "not numbers: give two arrays; pandas.read_csv reads them from a file"
        raise SceneError("t", what, "", 'compare_curve(record, table["t"], table["F_T"])', reason)
    t, F_T = _without_gaps(_numbers("t", t), _numbers("F_T", F_T))
    _check_measured(t, F_T)
    known, forces = (record.curve[name].to_numpy() for name in ("t", "F_T"))
    widest = 0.5 * (t[-1] - t[0]) if largest_shift is None else largest_shift
    widest = check_number("largest_shift", widest, "s", ge=0.0)

    def apart(shift: float) -> np.ndarray:
        found = np.interp(t + shift, known, forces, np.nan, np.nan) - F_T
        return found[np.isfinite(found)]

    def rms(shift: float, least: float = 0.5) -> float:
        off = apart(shift)
        too_few = not len(off) or len(off) < least * len(t)
        return np.inf if too_few else float(np.sqrt(np.mean(off**2)))

    shifts = np.linspace(-widest, widest, SHIFTS)
    tried = [rms(shift) for shift in shifts]
    n = int(np.argmin(tried))
    if not np.isfinite(tried[n]):
        allowed = f"times of which half lie within the run, {known[0]:g} to {known[-1]:g} s"
        raise SceneError("t", float(t[0]), "s", allowed, "outside the run")
    ends = shifts[max(n - 1, 0)], shifts[min(n + 1, SHIFTS - 1)]
    found = scipy.optimize.minimize_scalar(  # imported at first use, which is slow
        rms, bounds=ends, method="bounded", options={"xatol": 1e-9 * widest}
    )
    shift, least = (found.x, found.fun) if found.fun < tried[n] else (shifts[n], tried[n])
    now = rms(0.0, 0.0)
    return Beside(now if now < np.inf else np.nan, float(shift), least, len(apart(shift)))


def _check_measured(t: np.ndarray, F_T: np.ndarray) -> None:
    """Raise SceneError if times (s) and forces (N) are no measured curve."""
    if t.ndim != 1 or t.shape != F_T.shape or len(t) < 2:
        allowed = "two or more times, and as many forces"
        raise SceneError("t", f"{t.shape} beside {F_T.shape}", "", allowed, "shapes do not fit")
    later = np.append(True, t[1:] > t[:-1])
    for name, unit, values, allowed, right in (
        ("t", "s", t, "finite times that increase", np.isfinite(t) & later),
        ("F_T", "N", F_T, "finite forces", np.isfinite(F_T)),
    ):
        if not right.all():
            row = int(np.argmin(right))
            raise SceneError(f"{name}[{row}]", float(values[row]), unit, allowed)


# --- numbers -------------------------------------------------------------------------------------


@of_record
def friction_coefficients(record: RecordData) -> FrictionCoefficients:
    """Return the friction coefficients of the slider as a whole.

    The friction force is the sum of the driver's force and the shear force T. If the first
    system-size event is not finished, the largest force is the peak of the curve.

    Args:
        record: a run in which all blocks slip in one event.

    Raises:
        SceneError: the run ended before such an event, or before the peak of the force.
    """
    scene, events, sliding = record.scene, record.events, system_size_events(record)
    mu_s_macro = float(_over_load(scene, events["t_start"], events["F_T_start"]).max())
    if sliding.empty:
        mu_s_macro = float(np.fmax(mu_s_macro, _peak(record)))
    mean = np.nan
    if len(sliding) > 1:
        begin, end = sliding["t_start"].iloc[[0, -1]]
        speeds = [V for t, V in scene.driver.protocol if begin <= t <= end]
        if min([*speeds, *(scene.piece("V", t).at(t) for t in (begin, end))]) >= 0:
            F_N, T = (_mean_load(scene, what, begin, end) for what in ("F_N", "T"))
            mean = (mean_force(record, begin, end) + T) / F_N
    return FrictionCoefficients(mu_s_macro, mean, float(scene.law.static.mean.scaled(mu_s_macro)))


def _over_load(scene: Scene, t: pd.Series, F_T: pd.Series) -> pd.Series:
    """Return (F_T + T)/F_N, with F_N and T at the times (s) of F_T (N)."""
    F_N, T = ([scene.piece(what, at).at(at) for at in t] for what in ("F_N", "T"))
    return (F_T + T) / F_N


def _peak(record: RecordData) -> float:
    """Return the largest (F_T + T)/F_N of the curve from the first system-size event on.

    Raises:
        SceneError: there is no such event, or the force rises up to the end of the run.
    """
    events, curve = record.events, record.curve
    whole = events["t_start"][events["L_p_over_L"] == 1]
    t_end = float(curve["t"].iloc[-1]) if len(curve) else 0.0
    if whole.empty:
        reason, allowed = "the run ended before one: raise t_end", "a run with a system-size event"
        raise SceneError("record", t_end, "s", allowed, reason)
    curve = curve[curve["t"] >= whole.iloc[0]]
    forces = _over_load(record.scene, curve["t"], curve["F_T"])
    if forces.empty or forces.idxmax() == forces.index[-1]:
        reason = "all blocks slip, and the force still rises: raise t_end"
        raise SceneError("record", t_end, "s", "a run beyond the peak of the force", reason)
    return float(forces.max())


def _mean_load(scene: Scene, what: str, begin: float, end: float) -> float:
    """Return the mean of a load, "F_N" or "T", between two times (s), in N."""
    if not (scene.top.protocol or scene.top.T_protocol):
        return scene.piece(what, begin).at(begin)
    first, last = (scene.piece(what, t).integral_at(t) for t in (begin, end))
    return (last - first) / (end - begin)


@of_record
def mean_force(record: RecordData, begin: float, end: float) -> float:
    """Return the mean of F_T between two times (s) of a run, in N; F_T is linear between samples.

    For equal times, return F_T at this time.

    Raises:
        SceneError: the times are not in order, or not in the run.
    """
    t, F_T = (record.curve[name].to_numpy() for name in ("t", "F_T"))
    begin = check_number("begin", begin, "s", ge=float(t[0]), le=float(t[-1]))
    end = check_number("end", end, "s", ge=begin, le=float(t[-1]))
    times = np.concatenate([[begin], t[(t > begin) & (t < end)], [end]])
    forces = np.interp(times, t, F_T)
    return float(np.trapezoid(forces, times) / (end - begin) if end > begin else forces[0])


def collapse_spread(
    x: np.ndarray, y: np.ndarray, *, bins: int = BINS, log: bool = True
) -> Collapse:
    """Return the spread of points about one curve, which is the median of y in bins of x.

    Bins hold equal numbers of points, up to a remainder and points of equal x. Points that are NaN
    or masked in x or y are left out.

    Args:
        x, y: the points, equal shapes.
        bins: number of bins.
        log: whether ln y is used, so that the spread is relative; y then has to be positive.

    Raises:
        SceneError: bins is not an integer >= 1, there are fewer than 5 points per bin, or y is not
            positive with log.
    """
    x, y = np.broadcast_arrays(
        *(np.ma.filled(_numbers(*pair), np.nan) for pair in (("x", x), ("y", y)))
    )
    kept = np.isfinite(x) & np.isfinite(y)
    x, y = x[kept], y[kept]
    bins = check_whole("bins", bins, 1)
    if x.size < PER_BIN * bins:
        reason = f"{x.size} points are too few"
        raise SceneError("bins", bins, "", f"1 to n/{PER_BIN} for n points", reason)
    if log and not (y > 0).all():
        raise SceneError("y", float(y.min()), "", "positive values, or log=False")
    values = np.log(y) if log else y
    edges = np.quantile(x, np.linspace(0, 1, bins + 1))
    points = np.sort(x)  # edges are midway between points, so that rounding of x changes no bin
    after = np.clip(np.searchsorted(points, edges[1:-1]), 1, len(x) - 1)
    edges[1:-1] = (points[after - 1] + points[after]) / 2
    in_bin = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
    median = pd.Series(values).groupby(in_bin).median().reindex(range(bins)).to_numpy()
    rms = float(np.sqrt(np.mean((values - median[in_bin]) ** 2)))
    return Collapse(rms, int(x.size), edges, np.exp(median) if log else median)


# --- parts ---------------------------------------------------------------------------------------


def _numbers(name: str, values: ArrayLike) -> np.ndarray:
    """Return numbers as an array; a masked array keeps its mask."""
    try:
        return np.asanyarray(values, dtype=float)
    except (TypeError, ValueError):
        raise SceneError(name, values, "", "a list of numbers", "not numbers") from None


def _without_gaps(*arrays: np.ndarray) -> list[np.ndarray]:
    """Return arrays of equal shape without the points that are masked in any array."""
    if len({array.shape for array in arrays}) == 1 and any(map(np.ma.is_masked, arrays)):
        kept = ~np.logical_or.reduce([np.ma.getmaskarray(array) for array in arrays])
        arrays = tuple(array[kept] for array in arrays)
    return [np.asarray(array) for array in arrays]


def _chosen(record: RecordData, mask: pd.Series) -> pd.DataFrame:
    table = record.events[mask].reset_index()
    table["force_start"] = table["F_T_start"] / record.scene.F_N
    table["force_arrest"] = table["F_T_arrest"] / record.scene.F_N
    return table


def _positions(record: RecordData) -> dict[str, np.ndarray]:
    n = np.arange(1, record.scene.N_x + 1)
    return {"n": n, "x_over_L": (n - 1) / (record.scene.N_x - 1)}


def _ratio(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a/b, NaN where b is 0."""
    return np.divide(a, b, out=np.full(a.shape, np.nan), where=b != 0)


def _scaled(record: RecordData, tau_over_p: np.ndarray) -> np.ndarray:
    return record.scene.law.static.at(np.argsort(record.scene.n_of_i)).scaled(tau_over_p)
