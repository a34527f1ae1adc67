"""H. Sakaguchi and S. Morita, 2013: sizes of slips in a chain whose friction falls with speed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pyfric.figures import BLACK, BLUE, VERMILION, DataFigure, legend, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.record import b_value
from pyfric.scene import Scene, chain, laws
from pyfric.sweeps import Job

if TYPE_CHECKING:
    from pyfric.record import Record

ALPHA = (1.0, 1.5, 2.5)
"""Weakening with speed: 2 alpha v/v_0 = 1 - sigma halves the friction, v_0 = F_0/sqrt(k_p m)."""
SIGMA, STIFFER = 0.01, 100.0
F_0, K_P, M, V = 10.0, 1e5, 1e-3, 1e-9
PERIODS = 4.0
"""Duration of a run over F_0/(k_p V)."""


@case(
    "A chain under a plate whose friction falls with speed: sizes of events",
    "H. Sakaguchi, S. Morita, 2013, arXiv:1309.4583",
    "trend",
    {
        "b": "close to 2/3 where the weakening is intermediate, on percolation clusters (abstract)",
        "friction": "F_0 (1 - sigma)/(1 + 2 alpha v/((1 - sigma) v_0)) (Carlson and Langer); "
        "sigma = 0.01: choice",
        "chain": "80 blocks without clusters, k = 100 k_p; choice: clusters need bonds that are "
        "absent",
        "alpha": "1, 1.5 and 2.5; choice",
    },
)
def event_sizes(
    run: Runner, *, alpha: tuple[float, ...] = ALPHA, N: int = 80, periods: float = PERIODS
) -> Found:
    """Measure the exponent of event sizes against weakening, without events of one block."""
    t_end = periods * F_0 / (K_P * V)
    options = {"fidelity": "hybrid", "switching": "step_end", "t_gap": 1e-3}
    jobs = [Job(_weakening(a, N), t_end, options) for a in alpha]
    sizes = {a: _sizes(record) for a, record in zip(alpha, run(jobs), strict=True)}
    rows = []
    for a, size in sizes.items():
        b, error = b_value(np.log10(size))
        rows.append({"alpha": a, "events": len(size), "b": b, "b_error": error})
    table = pd.DataFrame(rows)
    middle = table.iloc[len(table) // 2]
    parts = [
        Claim(
            "event_sizes a",
            "the exponent of sizes is close to 2/3 where the weakening is intermediate",
            float(middle["b"]),
            Band(2 / 3 - 0.1, 2 / 3 + 0.1, "close to 2/3; the width is a choice"),
            "b of the potency of events of two to N/2 blocks, at the middle alpha",
            [given("alpha = 4", alpha=(4.0,))],
            f"Standard error {middle['b_error']:.2g}. Without percolation clusters, on which the "
            "source has it.",
        )
    ]
    return Found(parts, lambda: _drawn(table, sizes))


def _weakening(alpha: float, N: int) -> Scene:
    """Return the chain with random initial stress of 0.88 to 0.98 of the strength."""
    v_0 = F_0 / np.sqrt(K_P * M)
    v = np.concatenate([[0.0], np.geomspace(1e-3, 10, 40)])
    factor = 1 / (1 + 2 * alpha * v / (1 - SIGMA))
    tau = F_0 * (0.98 - 0.1 * np.random.default_rng(1).random(N))
    return chain(
        L=(N - 1) * 1e-3,
        l=1e-3,
        p=F_0,
        tau=tau.tolist(),
        k=STIFFER * K_P,
        eta=0.0,
        M=N * M,
        side="top",
        K=N * K_P,
        V=V,
        mu_s=1.0,
        mu_k=1 - SIGMA,
        law=laws.SpeedDependent(v=tuple((v * v_0).tolist()), factor=tuple(factor.tolist())),
    )


def _sizes(record: Record) -> np.ndarray:
    """Return the potency (m^2) of finished events of two to N/2 blocks, ascending."""
    events = record.events
    inside = events["finished"] & events["n_blocks"].between(2, record.scene.N_x // 2)
    return np.sort(events.loc[inside, "potency"].to_numpy())


def _drawn(table: pd.DataFrame, sizes: dict[float, np.ndarray]) -> DataFigure:
    """Draw the number of events of at least each potency against potency."""
    fig, (axes,) = panels(2.6)
    for (a, size), colour in zip(sizes.items(), (BLACK, BLUE, VERMILION), strict=False):
        number = np.arange(size.size, 0, -1)
        b, error = table.loc[table["alpha"] == a, ["b", "b_error"]].to_numpy()[0]
        label = rf"$\alpha$ = {a:g}: b = {b:.2f} $\pm$ {error:.2f}"
        axes.loglog(size, number, color=colour, lw=1.0, label=label)
    x = np.array([1e-10, 1e-8])
    axes.loglog(x, 300 * (x / x[0]) ** (-2 / 3), "--", color="0.5", label="slope -2/3")
    axes.set(xlabel=r"potency S (m$^2$)", ylabel="events of at least S", ylim=(0.7, None))
    legend(axes, loc="lower left")
    fig.caption = (
        "Number of events of two to N/2 blocks of at least a potency, for three strengths of "
        "weakening with speed."
    )
    fig.tables = {"b": table}
    return fig
