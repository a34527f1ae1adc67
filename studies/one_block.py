"""One block on junctions, moved at a given speed, against closed forms.

A block under constant p stands on 1e5 junctions. These break at the stretch u_s, slip for a time
t_R and pin again. With q = v t_R/u_s and w = 1/(1 + q):

steady      F/p = (mu_s/2 + mu_d q)/(1 + q), for any distribution of t_R
start-up    share of slipping junctions, from all pinned: sum over n of G_n(t - (n + 1) t_p)
            - G_(n + 1)(t - (n + 1) t_p), t_p = u_s/v, G_n the distribution of the sum of n draws
hold        F/p = w mu_s/2 + (1 - w) mu_d exp(-t/t_R), for exponential times
slide       after a long hold: F/p = (1 - w) mu_s y + w (mu_s (1 - y^2)/2 + mu_d y), with
            y = displacement/u_s up to 1, so fast that no junction pins

Source of the law: J. Trømborg et al., Proc. Natl. Acad. Sci. 111, 8764 (2014).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.interpolate import BSpline
from sizes import size

from pyfric import core, figures
from pyfric.scene import chain
from pyfric.scene.laws import Junctions
from pyfric.statics import loaded_state

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.figures import DataFigure

__all__ = ["MU_D", "MU_S", "U_S", "Dragged", "figure", "slipping_share", "study"]

MU_S, MU_D, U_S = 0.4, 0.17, 1e-6
T_R, T_R_STD = 1e-3, 0.3e-3
QS = size((0.25, 0.5, 1.0, 2.0, 4.0), (1.0,))
"""Values of q at which sliding is steady."""


class Dragged:
    """Three blocks so heavy that friction does not slow them, each on a third of 1e5 junctions.

    Attributes:
        t: time, in s.
    """

    STEPS = 400
    """Steps up to the stretch u_s, so junctions break late by 1/800 of u_s on average."""

    def __init__(
        self, t_R: float, t_R_std: float = 0.0, n_s: int = size(33_334, 100), **how: Any
    ) -> None:
        law = Junctions(n_s=n_s, u_s=U_S, t_R=t_R, t_R_std=t_R_std, **how)
        own = {"L": 5e-3, "p": 1.0, "M": 1e15, "k": 1.0, "K": 1e-9, "V": 0.0, "eta": 0.0}
        self.scene = chain(mu_s=MU_S, mu_k=MU_D, law=law, **own)
        assert self.scene.N_x == 3
        self.state = loaded_state(self.scene, "linear").state(self.scene, 1.0)
        self.model = core.model(self.scene, "linear", self.state.u_drv0)

    @property
    def t(self) -> float:
        return self.state.t

    def move(self, v: float, n: int, dt: float, every: int = 1) -> np.ndarray:
        """Move at v (m/s) for n steps of dt (s); return F/p after every `every` steps."""
        self.state = self.state.with_dt(dt)
        self.state.y[:, 2] = v
        log, found = core.Log(3), []
        for _ in range(n // every):
            how: dict[str, Any] = {"budget": False, "stepper": "symplectic_euler"}
            assert core.advance(self.model, self.state, log, every, **how) == core.Status.DONE
            found.append(-core.evaluate(self.model, self.state, self.t).f.mean())
        return np.array(found)

    def slide(self, v: float, distance: float, every: int = 10) -> np.ndarray:
        """Slide at v over a distance in u_s; return F/p after every `every` steps."""
        return self.move(v, round(distance * self.STEPS), U_S / v / self.STEPS, every)

    def pinned(self) -> float:
        return float(self.state.pinned.mean())


def irwin_hall(n: int) -> BSpline:
    """Return the distribution of the sum of 12 n uniform numbers."""
    return BSpline.basis_element(np.arange(12 * n + 1)).antiderivative()


def slipping_share(t: float, t_p: float, t_R: float, std: float) -> float:
    """Return the share of slipping junctions at a time after the start, when all are pinned.

    Args:
        t: time, s, less than 5 t_p.
        t_p: time to the stretch u_s, s.
        t_R, std: mean and standard deviation of the time of slip, s.
    """

    def ended(n: int, t: float) -> float:
        """Return the probability that the sum of n random times of slip is at most t."""
        if n == 0:
            return float(t >= 0)
        x = (t - n * t_R) / std + 6 * n
        return float(irwin_hall(n)(np.clip(x, 0, 12 * n)))

    late = [t - (n + 1) * t_p for n in range(4)]
    return sum(ended(n, one) - ended(n + 1, one) for n, one in enumerate(late))


def exponential(distance: float, q: float) -> tuple[Dragged, float]:
    """Return a block with exponential t_R after sliding over a distance in u_s, and steady F/p."""
    block, v = Dragged(T_R, T_R, t_R_distribution="gamma", stretch=1.0), q * U_S / T_R
    block.slide(v, distance - 2, every=80)
    return block, float(block.slide(v, 2, every=40).mean())


def study(say: Callable[[str], None] = lambda _: None) -> dict[str, pd.DataFrame]:
    """Return measured and exact values for each motion: columns x, block and exact."""
    found = {}
    rows = []
    for q in QS:
        say(f"steady sliding at q = {q:g}")
        _, ratio = exponential(12 if q < 1 else 6, q)
        rows.append((q, ratio, (MU_S / 2 + MU_D * q) / (1 + q)))
    found["steady"] = rows
    say("start-up")
    block, v, rows = Dragged(T_R, T_R_STD), U_S / T_R, []
    block.slide(v, 0.025)  # so no point is at the first break
    for _ in range(59):
        block.slide(v, 0.05, every=20)
        share = slipping_share(block.t, T_R, T_R, T_R_STD)
        rows.append((block.t * v / U_S, 1 - block.pinned(), share))
    found["start-up"] = rows
    say("hold and slide")
    (block, _), rows = exponential(6, 1.0), []
    begin, w = block.t, block.pinned()
    for _ in range(30):
        ratio, t = block.move(0.0, 1, 1e-4)[-1], (block.t - begin) / T_R
        rows.append((t, ratio, MU_S / 4 + MU_D / 2 * np.exp(-t)))
    found["hold"] = rows
    block.move(0.0, 1, 20 * T_R)  # all junctions have pinned
    ratio = block.slide(1e3 * U_S / T_R, 0.975)
    y = np.arange(1, len(ratio) + 1) * 10 / Dragged.STEPS
    exact = (1 - w) * MU_S * y + w * (MU_S * (1 - y**2) / 2 + MU_D * y)
    found["slide"] = list(zip(y, ratio, exact, strict=True))
    columns = ["x", "block", "exact"]
    return {name: pd.DataFrame(rows, columns=columns) for name, rows in found.items()}


def figure(tables: dict[str, pd.DataFrame]) -> DataFigure:
    """Return the four motions, blocks as points and closed forms as lines."""
    fig = figures.DataFigure(figsize=(6.8, 5.0), layout="constrained")
    axes = fig.subplots(2, 2).ravel()
    labels = {
        "steady": (r"$q = v t_R/u_s$", "$F/p$"),
        "start-up": ("displacement, in $u_s$", "share of slipping junctions"),
        "hold": ("time of hold, in $t_R$", "$F/p$"),
        "slide": ("displacement of a fast slide, in $u_s$", "$F/p$"),
    }
    for (name, table), one, letter in zip(tables.items(), axes, "abcd", strict=True):
        one.plot(table["x"], table["exact"], color="#0072B2", label="closed form")
        one.plot(table["x"], table["block"], "o", ms=3, color="#D55E00", label="1e5 junctions")
        one.set(xlabel=labels[name][0], ylabel=labels[name][1], title=f"({letter}) {name}")
    axes[0].set_xscale("log", base=2)
    axes[0].set_xticks(QS, [f"{q:g}" for q in QS])
    axes[0].legend(frameon=False)
    off = max(float((one["block"] - one["exact"]).abs().max()) for one in tables.values())
    fig.caption = (
        "One block moved at a given speed, on 1e5 junctions. (a) Steady friction. (b) Start-up "
        "with all junctions pinned, t_R = u_s/v in the mean, its standard deviation 0.3 of that. "
        "(c) A hold after steady sliding at q = 1, exponential times. (d) A fast slide after a "
        f"long hold. Largest difference: {off:.1g}."
    )
    fig.tables = tables
    return fig
