"""Does the spacing matter, with 3 to 12 blocks in L_b?

A block of 15 L_b by 6 L_b slides steadily at 1 nm/s, and its load grows. In its middle, over one
L_b, theta is 0.9 of that elsewhere. Slip without inertia accelerates in the middle until a block
reaches 0.1 m/s. The table has the time of this acceleration in units of D_c/V, the slip of the
middle in units of D_c, and the width in which speeds are above half the largest speed. On finer
lattices l and p of a block are smaller; L_b, D_c and the stresses are the same.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from sizes import size

import pyfric
from pyfric import core
from pyfric.engines.linearised import Linearised
from pyfric.scene import laws
from pyfric.statics import StaticSolver, loaded_state

if TYPE_CHECKING:
    from collections.abc import Callable

BLOCKS, RATIOS = size(((1, 3, 6, 12), (0.35, 0.5, 0.7)), ((1, 2), (0.5,)))
"""Numbers of blocks in L_b, and values of a/b."""
L_B, B, P, K = 12e-3, 0.015, 2.5, 13.5e6
"""L_b (m), b, p of a block for each mm of l (N), and k (N/m)."""
V, LOADING, FASTEST = 1e-9, 1e-3, 0.1
"""Speed at first (m/s), growth of tau/p (1/s), and speed at the end (m/s)."""
ACCURACY = 1e-7
"""Error of a step, relative in displacements and absolute in ln theta."""


def case(blocks: int, ratio: float) -> tuple[float, ...]:
    """Return time in D_c/V, slip of the middle in D_c, and width in L_b, on a lattice."""
    l, a = L_B / blocks, ratio * B
    p = P * l * 1e3
    D_c = blocks * 3 * B * p / (4 * K)
    columns = 15 * blocks + 1
    law = laws.RateAndState(a=a, b=B, D_c=D_c, theta_0=D_c / V)
    size = {"L": (columns - 1) * l, "H": 6 * L_B, "l": l, "k": K, "F_N": p * columns, "V": 0.0}
    scene = pyfric.preset(
        "setup2", {**size, "K": 1.0, "h": l, "interface": pyfric.Interface(law=law)}
    )
    known = StaticSolver(scene, "linear")
    elastic, *_ = Linearised(known, ~known.loaded.open).by_u
    x, none = np.arange(columns) * l, np.zeros(columns)
    shares = np.clip((L_B / 2 - np.abs(x - x[-1] / 2)) / l + 0.5, 0.0, 1.0)  # in the middle part
    start = np.log(D_c / V) + np.log(0.9) * shares
    load = p * (law.f_star + (a - B) * np.log(V / law.V_star))
    limits = {"end": 1e4, "dt": 1e-9, "relative": ACCURACY, "u": ACCURACY * D_c}
    limits |= {"log_theta": ACCURACY, "speed": FASTEST}
    model = core.model(scene, "linear", loaded_state(scene).state(scene, 1e-7).u_drv0)
    forces = (np.column_stack([none + load, none + LOADING * p, none]), elastic)
    pressed = np.column_stack([none + p, none, none]), 0 * elastic
    found = core.slow_slip(model, forces, pressed, start, core.SlowLimits(**limits))
    fine = np.linspace(x[0], x[-1], 10_001)
    v = np.interp(fine, x, found.v)
    width = float(np.ptp(fine[v > 0.5 * v.max()]))
    return found.t * V / D_c, float(found.u[columns // 2]) / D_c, width / L_B


def study(
    blocks: tuple[int, ...] = BLOCKS, say: Callable[[str], None] = lambda _: None
) -> pd.DataFrame:
    """Return one row for each a/b and number of blocks in L_b."""
    rows = []
    for ratio in RATIOS:
        for n in blocks:
            rows.append((ratio, n, *case(n, ratio)))
            say(f"a/b = {ratio:g}, {n} blocks in L_b")
    names = ["a_over_b", "blocks_in_L_b", "time_V_over_D_c", "slip_over_D_c", "width_over_L_b"]
    return pd.DataFrame(rows, columns=names)


def report(frame: pd.DataFrame) -> str:
    """Return a line for each a/b: time, slip and width on the lattices."""
    lines = ["a/b: time V/D_c, slip/D_c, width/L_b with 1, 3, ... blocks in L_b"]
    for ratio, part in frame.groupby("a_over_b", sort=False):
        shown = (", ".join(f"{value:.4g}" for value in part[name]) for name in frame.columns[2:])
        lines.append(f"{ratio:g}: " + "; ".join(shown))
    return "\n".join(lines)
