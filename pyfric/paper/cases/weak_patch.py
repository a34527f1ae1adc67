"""Y. Faure and E. Bayart, 2024: a weak patch on an interface nucleates ruptures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from pyfric.figures import BLACK, VERMILION, DataFigure, legend, panels
from pyfric.paper.cases.case import Found, Runner, case
from pyfric.paper.claims.claim import Band, Claim
from pyfric.paper.claims.damage import given
from pyfric.scene import preset
from pyfric.sweeps import Job

if TYPE_CHECKING:
    from pyfric.record import Record

T_END = 0.8
"""End of runs, just after the second rupture of the interface without a patch, s."""
HALF = 0.1
"""Half length of the patch over L."""
WEAK = 0.4, 0.38
"""mu_s and mu_k of the patch."""


@case(
    "A weak patch: ruptures start there, come earlier, and at less shear",
    "Y. Faure, E. Bayart, Nat. Commun. 15, 8217 (2024), doi:10.1038/s41467-024-52492-2",
    "trend",
    {
        "trend": "the patch reduces the shear resistance and is where ruptures start (abstract)",
        "patch": "a fifth of the interface, mu_s 0.4, mu_k 0.38 instead of 0.7, 0.45; choice",
        "slider": "setup 2 of the paper of pyfric, l = 2 mm, sheared at its top; choice",
    },
)
def weak_patch(run: Runner, *, weak: tuple[float, float] = WEAK, l: float = 2e-3) -> Found:
    """Measure ruptures without a patch, and with a patch that has mu_s and mu_k in `weak`."""
    without, with_patch = run([_job(None, l), _job(weak, l)])
    forces = [record.events["F_T_start"].max() for record in (without, with_patch)]
    N = with_patch.scene.N_x
    first = with_patch.events[with_patch.events["n_blocks"] > HALF * N].iloc[0]
    away = abs(float(first["nucleation_block"]) - (N + 1) / 2) / N - HALF
    damages = [given("a patch as strong as the rest", weak=(0.7, 0.45))]
    parts = [
        Claim(
            "weak_patch a",
            "trend: the interface breaks at less shear",
            float(forces[1] / forces[0] - 1),
            Band(None, -0.05, "abstract; the size is a choice"),
            "change of the largest shear force by the patch",
            damages,
            "At l = 1 mm the change is -0.077.",
        ),
        Claim(
            "weak_patch b",
            "trend: ruptures start in the patch",
            away,
            Band(None, 0.0, "abstract", "L"),
            "distance of the start of the first event beyond half the patch from its edge, > 0 "
            "outside",
            damages,
        ),
    ]
    return Found(parts, lambda: _drawn({"without": without, "with a patch": with_patch}))


def _job(weak: tuple[float, float] | None, l: float) -> Job:
    scene = preset("setup2", side="top", h="20 mm", l=l)
    changes: dict[str, Any] = {}
    if weak is not None:
        n = np.arange(1, scene.N_x + 1)
        inside = abs(n - (scene.N_x + 1) / 2) <= HALF * scene.N_x
        values = zip(("mu_s", "mu_k"), weak, (0.7, 0.45), strict=True)
        changes = {name: np.where(inside, low, high).tolist() for name, low, high in values}
    how = {"fidelity": "hybrid", "geometry": "linear", "verify": "none"}
    return Job(scene.replace(changes), T_END, how)


def _drawn(records: dict[str, Record]) -> DataFigure:
    fig, (axes,) = panels(2.3)
    tables = []
    for (name, record), colour in zip(records.items(), (BLACK, VERMILION), strict=True):
        curve, F_N = record.curve, record.scene.F_N
        axes.plot(curve["t"], curve["F_T"] / F_N, color=colour, lw=0.8, label=name)
        events = record.events[["t_start", "F_T_start", "first_block", "last_block"]]
        tables.append(events.assign(interface=name))
    axes.set(xlabel="t (s)", ylabel="$F_T/F_N$")
    legend(axes, loc="lower right")
    fig.caption = (
        "Shear force over time, without and with a weak patch in the middle of the interface. "
        "The slider is sheared at its top."
    )
    fig.tables = {"events": pd.concat(tables)}
    return fig
