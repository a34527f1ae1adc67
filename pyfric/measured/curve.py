"""A measured curve: times, forces or their ratio, displacements, in SI units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from pyfric.display import Shown
from pyfric.measured.meanings import MEANINGS
from pyfric.measured.sensors import displacement
from pyfric.record import T_GAP, Record
from pyfric.values import SceneError, check_number, check_whole, usage

FORCES = frozenset({"F_T", "tau", "mu"})
SIGNALS = FORCES | {"slip"}
"""Columns in which events are found; a curve has at least one of them."""
KNOWN = tuple(name for name, meaning in MEANINGS.items() if not meaning.sums)
"""Columns that a curve may have."""
STILL = 0.5
"""Largest accepted share of samples with the same time as the previous sample."""
OTHER_SIGN = 0.1
"""Ratio of the largest force to the magnitude of the most negative force, below which forces have
the opposite sign."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Curve(Shown):
    """A curve as measured. `read` makes a curve from a file, `Curve.of` from arrays.

    Attributes:
        table: a row for each sample, with columns t (s) and some of F_T, F_N (N), tau, sigma_n
            (Pa), mu (1), load_point, slip and normal_displacement (m). NaN is a gap. Times do not
            decrease.
        F_N: normal force, N, if the table has none; None means unknown.
        area: area of the interface, m^2; None means unknown.
        noise: standard deviation of the noise of F_T/F_N, or of slip (m) in a curve without forces;
            None means unknown.
        t_gap: longest pause between falls of one event in a curve without noise, s.
        source: file or origin of the curve.
        notes: meanings and units of the columns of the file, and other remarks.
    """

    table: pd.DataFrame
    F_N: float | None = None
    area: float | None = None
    noise: float | None = None
    t_gap: float = 0.0
    source: str = ""
    notes: tuple[str, ...] = field(default=())

    @classmethod
    def of(
        cls,
        *,
        F_N: float | str | ArrayLike | None = None,
        area: float | str | None = None,
        source: str = "",
        notes: Sequence[str] = (),
        copy: bool = True,
        **columns: ArrayLike,
    ) -> Curve:
        """Return the curve given by arrays in SI units, under the names of its columns.

        Args:
            F_N: normal force, N, > 0; a number, a quantity such as "400 N", or one for each sample.
            area: area of the interface, m^2, > 0, or a quantity.
            source, notes: see `Curve`.
            copy: whether to copy the arrays, so that later changes of them do not change the curve.
            columns: t and others, equal lengths, at least 3 samples.

        Raises:
            SceneError: a name is unknown; lengths differ; times decrease, stand still or are not
                finite; there is neither force nor slip; the median normal force or stress is not
                above 0; forces are negative throughout; or F_N or area is refused.
        """
        if np.ndim(F_N) > 0:
            columns, F_N = columns | {"F_N": F_N}, None
        if unknown := sorted(set(columns) - set(KNOWN)):
            raise SceneError("columns", unknown[0], "", ", ".join(KNOWN), "unknown column")
        found: dict[str, np.ndarray] = {}
        for name, values in columns.items():
            try:
                found[name] = np.asarray(values, dtype=float)
            except (TypeError, ValueError):
                raise SceneError(name, type(values).__name__, "", "numbers", "") from None
            if found[name].shape != found[next(iter(found))].shape or found[name].ndim != 1:
                shape = str(found[name].shape)
                raise SceneError(name, shape, "", "one row of numbers, all of one length", "shape")
        if "t" not in found:
            raise SceneError("t", None, "s", "times", "missing")
        if not SIGNALS & set(found):
            raise SceneError("F_T", None, "N", "one of F_T, tau, mu and slip", "no force")
        t = found["t"]
        later = np.isfinite(t) & np.append(True, np.diff(t) >= 0)
        allowed = "three or more finite times that do not decrease"
        if len(t) < 3:
            raise SceneError("t", len(t), "", allowed, "samples")
        if not later.all():
            row = int(np.argmin(later))
            raise SceneError(f"t[{row}]", float(t[row]), "s", allowed)
        if (still := float(np.mean(np.diff(t) == 0))) > STILL:
            allowed = 'times that increase; intervals between samples are columns={"step": ...} of '
            allowed += "pyfric.measured.read, and a clock coarser than the samples is replaced by "
            allowed += 'step="..."'
            reason = f"{still:.0%} of the samples have the time of the one before"
            raise SceneError("t", None, "s", allowed, "all are the same" if still == 1 else reason)
        for name in {"F_N", "sigma_n"} & set(found):
            median = float(np.nanmedian(found[name]))
            if not median > 0:
                _refuse_sign(name, median, "> 0 in compression", "the median")
        for name in FORCES & set(found):
            ends = np.nanmin(found[name], initial=0.0), np.nanmax(found[name], initial=-np.inf)
            if ends[1] < -OTHER_SIGN * ends[0] and np.nanmedian(found[name]) < 0:
                wanted = "> 0 where the driver pushes"
                _refuse_sign(name, float(ends[0]), wanted, "negative throughout")
        given: dict[str, Any] = {"F_N": F_N, "area": area}
        for name, unit in (("F_N", "N"), ("area", "m^2")):
            if given[name] is not None:
                given[name] = check_number(name, given[name], unit, gt=0.0)
        table = pd.DataFrame(found, copy=copy)
        return cls(table=table, source=source, notes=tuple(notes), **given)

    @property
    def t(self) -> np.ndarray:
        """Times, s, shape (n,)."""
        return self.table["t"].to_numpy()

    @property
    def has_forces(self) -> bool:
        """Whether there are forces; a curve of a slip sensor may have none."""
        return bool(FORCES & set(self.table))

    @property
    def over_F_N(self) -> np.ndarray:
        """F_T/F_N, shape (n,): mu, else F_T over F_N, else tau over sigma_n.

        The ratio is NaN, a gap, where F_N or sigma_n is not above 0.

        Raises:
            SceneError: both F_N and sigma_n are unknown, or the curve has no forces.
        """
        if not self.has_forces:
            raise SceneError("F_T", None, "N", "a curve with F_T, tau or mu", "no force")
        if "mu" in self.table:
            return self.table["mu"].to_numpy()
        if "F_T" in self.table:
            return self.table["F_T"].to_numpy() / self._normal("F_N", "normal force")
        if "sigma_n" in self.table:
            return self.table["tau"].to_numpy() / _above_zero(self.table["sigma_n"])
        if self.area is None:
            allowed = 'the area, such as area="100 mm^2", and F_N; or a column sigma_n'
            raise SceneError("area", None, "m^2", allowed, "missing, and tau is no force")
        return self.table["tau"].to_numpy() * self.area / self._normal("F_N", "normal force")

    def force(self, F_N: float | None = None) -> np.ndarray:
        """Return F_T, N, shape (n,).

        Args:
            F_N: normal force, N; None means the normal force of the curve.

        Raises:
            SceneError: the curve has no forces in N, and the normal force is unknown.
        """
        if "F_T" in self.table:
            return self.table["F_T"].to_numpy()
        if F_N is None:
            return self.over_F_N * self._normal("F_N", "normal force")
        return self.over_F_N * check_number("F_N", F_N, "N", gt=0.0)

    def _normal(self, name: str, text: str) -> Any:
        if name in self.table:
            return _above_zero(self.table[name])
        if self.F_N is None:
            allowed = f'the {text}, such as F_N="400 N", or a column of it'
            raise SceneError(name, None, "N", allowed, "missing")
        return self.F_N

    def __str__(self) -> str:
        t = self.t
        lines = [
            f"{self.source or 'curve'}: {len(t)} samples, {t[0]:.6g} to {t[-1]:.6g} s",
            *(
                f"  {name} ({MEANINGS[name].unit or '1'}): {values.min():.4g} to {values.max():.4g}"
                + f", {values.isna().sum()} gaps" * bool(values.isna().any())
                for name, values in self.table.items()
                if name != "t"
            ),
            *self.notes,
        ]
        return "\n".join(lines)

    __repr__ = __str__


def _refuse_sign(name: str, value: float, wanted: str, reason: str) -> None:
    """Refuse forces or normal forces of the wrong sign.

    Raises:
        SceneError: always.
    """
    unit = MEANINGS[name].unit
    each = f'"-1 {unit}"' if unit else "-1"
    allowed = f'{wanted}; with the other sign, calibration={{"{name}": {each}}} of '
    raise SceneError(name, value, unit, f"{allowed}pyfric.measured.read", reason)


def _above_zero(values: pd.Series) -> np.ndarray:
    """Return an array of the values, with NaN for values that are not above 0."""
    return values.where(values > 0).to_numpy()


@usage()
def sampled(
    record: Record,
    step: float | str | None = None,
    *,
    noise: float | str = 0.0,
    seed: int = 0,
    x: float | str | None = None,
) -> Curve:
    """Return the loading curve of a run, or slip at a place, as an instrument would sample it.

    Args:
        record: a run.
        step: time between samples, s, > 0, or a quantity such as "0.5 ms"; None means the samples
            of the record.
        noise: standard deviation of the noise of the force, over F_N, >= 0; with x, noise of slip,
            m.
        seed: seed of the noise.
        x: distance of a slip sensor from the trailing edge, m; None means the force.

    Returns:
        A curve with t, F_T, F_N and load_point, the displacement of the driver; with x a curve with
        t and slip (`pyfric.measured.sensors`).

    Raises:
        SceneError: step, noise, seed or x is refused.
    """
    noise = check_number("noise", noise, "" if x is None else "m", ge=0.0)
    check_whole("seed", seed, 0)
    if x is not None:
        t, slip = displacement(record, x)
        if step is not None:
            t, slip = _at_steps(t, slip, check_number("step", step, "s", gt=0.0))
        slip = slip + noise * np.random.default_rng(seed).standard_normal(len(t))
        table = pd.DataFrame({"t": t, "slip": slip})
        return Curve(table=table, noise=noise, t_gap=T_GAP, source=f"a run, slip sampled at {x}")
    t, F_T = (record.curve[name].to_numpy() for name in ("t", "F_T"))
    if step is not None:
        t, F_T = _at_steps(t, F_T, check_number("step", step, "s", gt=0.0))
    scene = record.scene
    loads = [scene.load_at(time) for time in t] if scene.load_at(0.0) is not None else []
    F_N = np.array([load[0] for load in loads]) if loads else np.full(len(t), scene.F_N)
    F_T = F_T + noise * F_N * np.random.default_rng(seed).standard_normal(len(t))
    steady = not scene.driver.protocol
    load_point = scene.piece("V", 0).integral_at(t) if steady else [scene.drive(at) for at in t]
    columns = {"t": t, "F_T": F_T, "load_point": load_point}
    table = pd.DataFrame(columns | ({"F_N": F_N} if loads else {}))
    normal = None if loads else scene.F_N
    return Curve(table=table, F_N=normal, noise=noise, t_gap=T_GAP, source="a run, sampled")


def _at_steps(t: np.ndarray, F_T: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times at equal steps (s), and forces (N); at a drop, the force after the drop."""
    times = t[0] + step * np.arange(int((t[-1] - t[0]) / step) + 1)
    at = np.searchsorted(t, times, side="right") - 1
    ahead = np.minimum(at + 1, len(t) - 1)
    share = np.zeros(len(times))
    np.divide(times - t[at], t[ahead] - t[at], out=share, where=t[ahead] > t[at])
    return times, F_T[at] + share * (F_T[ahead] - F_T[at])
