"""Measured errors of a run, their comparison with a tolerance, and their text.

An error that was not measured is None, which never counts as within a tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from pyfric.record.method import Model

NOTHING = "not measured: nothing was compared"
NOT_VERIFIED = "errors not measured (a planned run, or verify = 'sample', measures them)"
"""Text of a record that was not verified."""
COVERED = 1e-6
"""Share of a run at its end that need not be compared, because runs end at whole steps."""
SAID = {
    "start": ("force at start", "F_N", "events"),
    "arrest": ("force at arrest", "F_N", "events"),
    "curve": ("force", "F_N", "points without slip"),
    "length": ("slipped length", "L", "events"),
    "stress": ("stresses", "F_N/N_x", "events"),
    "rupture": ("rupture times", "of the time of the front", "events"),
    "speed_median": ("front speed", "of the speed at half of the blocks", "blocks"),
    "speed_95": ("front speed", "of the speed at 95 % of the blocks", "blocks"),
    "speed_worst": ("front speed", "of the speed at the worst block", "blocks"),
}
"""Texts for errors: the quantity, the unit, and the kind of objects compared."""
FORCES = ("start", "arrest")
PROMISED = {"stress": (*FORCES, "stress"), "front_speed": ("speed_95",)}
"""Errors that the tolerance bounds, for each value of `want`; the last error has to be measured.
Missing values of `want` have `FORCES`."""
INSTEAD = {"loading_curve": ("curve", "rupture"), "motion": ("curve", "rupture")}
"""Errors that the tolerance bounds, for each value of `want`, if no start force was compared.
Missing values of `want`, except "front_speed", have rupture times."""


@dataclass(frozen=True, kw_only=True)
class Errors:
    """The errors of a run, measured by comparison with runs of more, or less, complete models.

    Forces of main events are over F_N, lengths over L. Stresses are root mean squares over the
    interface, over F_N/N_x. Rupture times are root mean squares over a front, over the time that
    the front takes. Front speeds are relative. Each error is the largest error of all events,
    except the median and the 95th percentile of front speeds. For events that
    have not ended when the run ends, `arrest` compares the forces during the event. `curve` is the
    error of forces in runs without any slip. None means not measured.

    Attributes:
        want, tolerance: of the plan; None without a plan.
        start, arrest, curve, length, stress, rupture, speed_median, speed_95, speed_worst: the
            errors.
        compared: name of an error -> number of events, or of blocks of fronts, compared.
        events: number of events compared: main events, or all if there are no main events.
        factor: ratio of the errors to the differences of the two runs.
        covered: time up to which the runs were compared, s.
        t_end: end of the run, s; None means `covered`.
        until: time from which single events cannot be trusted, s; None if there is no such time.
            Errors belong to earlier events, or to all events if earlier events leave the wanted
            error unknown.
        statistics: means over the events after `until` and their errors, by name.
        by: the models that the run was compared with.
        chosen_at: number of other parameter points whose errors selected the level, if the errors
            of this run were not measured; otherwise 0.
    """

    want: str | None = None
    tolerance: float | None = None
    start: float | None = None
    arrest: float | None = None
    curve: float | None = None
    length: float | None = None
    stress: float | None = None
    rupture: float | None = None
    speed_median: float | None = None
    speed_95: float | None = None
    speed_worst: float | None = None
    compared: Mapping[str, int] = field(default_factory=dict)
    events: int = 0
    factor: float = 1.0
    covered: float = 0.0
    t_end: float | None = None
    until: float | None = None
    statistics: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    by: tuple[Model, ...] = ()
    chosen_at: int = 0

    __pydantic_config__: ClassVar[Any] = {"extra": "forbid"}  # of files

    def measured(self, want: str | None = None) -> float | None:
        """Return the error that a tolerance bounds, None if not measured.

        `PROMISED` gives the errors that count for `want`. If no start force was compared, as on a
        prescribed interface, `INSTEAD` gives these errors.
        """
        want = want or self.want or ""
        names = PROMISED.get(want, FORCES)
        if want != "front_speed" and self.start is None:
            names = INSTEAD.get(want, ("rupture",))
        values = [getattr(self, name) for name in names]
        if want in PROMISED and values[-1] is None:
            return None
        return max((value for value in values if value is not None), default=None)

    @property
    def holds(self) -> bool | None:
        """Whether the measured error of all events is within the tolerance.

        The result is None if the error was not measured over the whole run, or without a tolerance.
        """
        error = self.measured()
        if error is None or self.tolerance is None:
            return None
        if error > self.tolerance:
            return False
        return None if self.partly or self.until is not None else True

    @property
    def partly(self) -> bool:
        """Whether only a part of the run was compared."""
        whole = self.t_end is None or self.covered >= self.t_end * (1 - COVERED)
        return not whole and self.until is None

    @property
    def verdict(self) -> str:
        """The result of `holds` in words; "" without a tolerance."""
        if self.tolerance is None:
            return ""
        if self.measured() is None:
            none = self.want == "front_speed" and self.events
            why = "no front has a speed" if none else "nothing was compared"
            why += f" up to {self.covered:.6g} s" * (none and self.partly)
            if self.chosen_at:
                why = f"its level was chosen at {self.chosen_at} other points"
            return f"for {self.want} within {self.tolerance:g}: NOT MEASURED, {why}"
        said = "does not hold, BEYOND" if self.holds is False else "within"
        text = f"for {self.want}: measured {self.measured():.2g}, {said} {self.tolerance:g}"
        if self.holds is None and self.partly:
            text += f", up to {self.covered:.6g} s; NOT MEASURED from there to {self.t_end:.6g} s"
        elif self.holds is None:
            text += f", up to {self.until:.6g} s"
        return text

    def __str__(self) -> str:
        said, unknown = [], []
        for name, (quantity, unit, what) in {} if self.chosen_at else SAID.items():
            of = f" ({self.compared[name]} {what})" if name in self.compared else ""
            value = getattr(self, name)
            if value is None:
                unknown.append(quantity)
            else:
                said.append(f"  {quantity} within {value:.2g} {unit}{of}")
        lines = []
        if said:
            lines = [f"measured errors, up to {self.covered:.6g} s ({self.events} events):", *said]
        if unknown:
            lines.append(f"{', '.join(dict.fromkeys(unknown))} {NOTHING}")
        if self.verdict:
            lines.append(self.verdict)
        if self.until is not None:
            lines.append(f"single events cannot be trusted from {self.until:.6g} s on")
            lines += [f"  {k}: {v:.4g} +- {e:.2g}" for k, (v, e) in self.statistics.items()]
        times = f", differences times {self.factor:.2g}" * (self.factor != 1)
        return "\n".join([*lines, *(f"by {run}{times}" for run in self.by)])
