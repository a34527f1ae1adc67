"""A two-sided crack under a uniform stress drop against fracture mechanics, for `fronts`."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from sizes import size

from pyfric import theory
from pyfric.engines import step_size
from pyfric.planning import simulate
from pyfric.record import Record, viscous_error
from pyfric.scene import Walls, slab
from pyfric.statics import loaded_state
from pyfric.values import write

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pyfric.scene import Scene

__all__ = ["FROM", "TO", "Crack", "crack", "kept_crack", "viscosity", "viscous"]

WINDOW = 250.0
"""Half of the length over which speeds of a crack are averaged, m."""
FROM, TO = 3e3, 12e3
"""Half lengths of a crack at which speeds are compared, m."""
VISCOSITIES: tuple[tuple[float, float, Literal["along", "full"]], ...] = size(
    (
        *((6.0, eta2, "full") for eta2 in (1.0, 0.1, 0.01, 1e-3, 1e-4)),
        *((blocks, eta2, "full") for blocks in (3.0, 4.0, 8.0) for eta2 in (0.1, 0.01)),
        *((blocks, eta2, "along") for blocks in (4.0, 6.0, 8.0) for eta2 in (0.1, 0.01)),
        (6.0, 1e-3, "along"),
    ),
    ((2.0, 0.1, "full"),),
)
"""Blocks in X_c0, eta^2/(k m) and dashpots of the cracks of `viscosity`."""
ROCK = theory.Material(c_P=3464 * math.sqrt(3), c_S=3464.0, rho=2670.0)
"""The material of the cracks: lambda = mu."""


@dataclass(frozen=True, kw_only=True)
class Crack:
    """A two-sided crack under a uniform stress drop: one of the two bodies, per m of thickness.

    Attributes:
        blocks: X_c0/l.
        eta2: (bond viscosity)^2/(k m): 0.1 in the paper.
        dashpots: "full" if dashpots resist rotation, as in the paper.
        S: strength excess.
        X_c0: cohesive zone at rest, m.
        a_end, H: half width and height of the slab, m.
        begin: half length that is released at once, in units of the critical half length.
    """

    blocks: float
    eta2: float = 1e-3
    dashpots: Literal["along", "full"] = "along"
    S: float = 3.0
    X_c0: float = 207.0
    a_end: float = 13e3
    H: float = 8e3
    begin: float = 1.02
    material: theory.Material = ROCK
    mu_s: float = 0.677
    mu_k: float = 0.525
    p: float = 120e6

    @property
    def spacing(self) -> float:
        """Lattice constant l, m."""
        return self.X_c0 / self.blocks

    @property
    def dtau(self) -> float:
        """Stress drop, Pa."""
        return (self.mu_s - self.mu_k) * self.p / (1 + self.S)

    @property
    def d_c(self) -> float:
        """Slip of weakening of one body, m."""
        return self.X_c0 / theory.cohesive_zone(self.material, self.mu_s, self.mu_k, self.p, 1.0)

    @property
    def Gamma(self) -> float:
        """Fracture energy of one body, J/m^2."""
        return theory.fracture_energy(self.mu_s, self.mu_k, self.p, self.d_c)

    def scene(self) -> Scene:
        """Return the scene: half of the slab around the crack."""
        l, k = self.spacing, 0.75 * self.material.E_prime
        m, N_x, N_z = self.material.rho * l**2, round(self.a_end / l), round(self.H / l) + 1
        return slab(
            p=self.p * l,
            tau=(self.mu_k * self.p + self.dtau) * l,
            L=(N_x - 1) * l,
            H=(N_z - 1) * l,
            l=l,
            k=k,
            M=m * N_x * N_z,
            mu_s=self.mu_s,
            mu_k=self.mu_k,
            d_c=self.d_c,
            eta=math.sqrt(self.eta2 * k * m),
            dashpots=self.dashpots,
            walls=Walls(left="mirrored", right="absorbing", top="absorbing"),
            name="crack",
        )

    def speed(self, a: np.ndarray) -> np.ndarray:
        """Return the speed that fracture mechanics gives at the half length a (m), m/s."""
        return theory.crack_speed(self.material, a, self.dtau, self.Gamma, bodies=1)


def crack(which: Crack, **options: Any) -> tuple[pd.DataFrame, Record]:
    """Run a crack, and compare its speed with fracture mechanics.

    Returns:
        A table: a (m), v and v_theory (m/s) from `FROM` to `TO`, up to the end of the crack; and
        the record.
    """
    scene, material = which.scene(), which.material
    critical = theory.crack_length(material, 0.0, which.dtau, which.Gamma, bodies=1)
    first = int(which.begin * critical / which.spacing)
    state = loaded_state(scene).state(scene, step_size(scene))
    state.mode[:first], state.s_0[:first] = 1, which.d_c
    t_end = which.a_end / (0.75 * material.c_S) + 1.5
    how = {"fidelity": "dynamic", "switching": "located", "energies": False, "t_gap": 1e3}
    how |= {"initial": state, "dt": state.dt, "progress": False, "threads": 1}
    record = simulate(scene, t_end, **how | options)
    t = record.rupture_times[0]
    known, at = np.isfinite(t), (np.arange(scene.N_x) + 0.5) * which.spacing
    a = np.arange(FROM, min(TO, at[known].max() - WINDOW) + 1, 2 * WINDOW)
    late, early = (np.interp(a + d, at[known], t[known]) for d in (WINDOW, -WINDOW))
    v = 2 * WINDOW / (late - early)
    return pd.DataFrame({"a": a, "v": v, "v_theory": which.speed(a)}), record


def viscosity(
    cases: Sequence[tuple[float, float, Literal["along", "full"]]] = VISCOSITIES,
    say: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Return the relative change of crack speed by dashpots, against fracture mechanics.

    Returns:
        One row for each crack: blocks in X_c0, eta2, dashpots; mean and worst of v/v_theory - 1
        from `FROM` to `TO`; formula, the value of `pyfric.record.viscous_error`.
    """
    rows = []
    for blocks, eta2, dashpots in cases:
        say(f"crack with {viscous(blocks, eta2, dashpots)}")
        which = Crack(blocks=blocks, eta2=eta2, dashpots=dashpots)
        table, _ = crack(which)
        off = table["v"] / table["v_theory"] - 1
        row = {"blocks": blocks, "eta2": eta2, "dashpots": dashpots, "mean": off.mean()}
        row |= {"worst": off[off.abs().idxmax()]}
        rows.append(row | {"formula": -viscous_error(which.scene(), blocks)})
    return pd.DataFrame(rows)


def kept_crack(path: Path, which: Crack) -> pd.DataFrame:
    """Return the table of a crack with its cost, from its file if the file exists."""
    if path.is_file():
        return pd.read_csv(path)
    begin = time.process_time()
    table, record = crack(which)
    table["evaluations"] = record.counts["block_evaluations"]
    table["seconds"] = time.process_time() - begin
    write(path, table.to_csv(index=False).encode())
    return table


def viscous(n: float, eta2: float, dashpots: str) -> str:
    return f"{n:g} blocks in X_c0, eta^2 = {eta2:g} k m, {dashpots}"
