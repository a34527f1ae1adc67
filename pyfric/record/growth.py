"""Onset of unstable slip and energy release of fronts, from static states before an event.

**Nucleation.** From the state of rest before an event, stable slip is followed as a path of static
states (`pyfric.statics.creep`). The path ends where no static state is nearby. There, an eigenvalue
of the slipping part passes zero, by itself or because one more block has to slip. The extent of the
blocks that slip there is the nucleation length. The nucleation length follows from statics alone,
for records of every engine. For a long interface in an infinite body and linear weakening, the
nucleation length does not depend on the distribution of load. For two bodies, 2 h_n = 1.158 mu* /W
with mu* = E'/2 and W = (mu_s - mu_k) p/D_c.

**Energy release** of a front that grows from the trailing edge, without inertia. The front starts
from the static state just before its event. The driver has the position that it has at the end of
the front. Blocks 1, 2, ... are released one after the other. Blocks behind carry mu_k p, and blocks
ahead are held. Block n is held by the force f before its release, and moves by du. In linear
geometry its excess force falls from f - mu_k p to 0 in proportion to the displacement. The energy
released is

    G_n = (f - mu_k p) du/2 .

G_n divided by the area l B of a block is the energy release rate G(a) at a = n l. The front grows
while G exceeds the fracture energy Gamma_n = (mu_s - mu_k) p d_c/2 (Griffith). With inertia, the
speed of the front is the root of g_II(v) G = Gamma, if waves from the sides of the slider are
neglected.

Source: K. Uenishi and J. R. Rice, J. Geophys. Res. 108, 2042 (2003); L. B. Freund, Dynamic Fracture
Mechanics (1990), chapters 5 and 7; the virtual crack closure of E. F. Rybicki and M. F. Kanninen,
Eng. Fract. Mech. 9, 931 (1977).
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from pyfric.core import OPEN, STUCK
from pyfric.record.data import RecordData
from pyfric.record.zones import material_of
from pyfric.statics import (
    LARGE,
    Contact,
    ContactProblem,
    Creep,
    EquilibriumError,
    loaded_state,
)
from pyfric.theory import g_II
from pyfric.values import SceneError

SPEEDS = 2001
"""Number of speeds up to c_R at which g_II is tabulated. The error of a root is below c_R/2000."""
ROUNDING = 1e-9
"""Stable slip is followed from this share of the driver's displacement before the first slip. The
share exceeds rounding, which is 1e-16 in the displacement and up to 1e-11 in derived quantities."""


def _condensed(record: RecordData) -> tuple[ContactProblem, float]:
    """Return the condensed slider of a record, and the driver's position at t = 0, in m."""
    scene, u_drv0 = record.scene, getattr(record.final_state, "u_drv0", None)
    u_drv0 = loaded_state(scene).u_drv0 if u_drv0 is None else u_drv0
    return ContactProblem(scene, u_drv0), scene.d * float(np.mean(u_drv0))


# --- nucleation ----------------------------------------------------------------------------------


def nucleations(record: RecordData) -> pd.DataFrame:
    """Return the states at which slip before each event becomes unstable; see the module.

    Finite geometry is treated as linear.

    Returns:
        One row for each event before which all blocks are stuck. Columns: event; t (s) and F_T (N)
        at the end of stable slip; first_block, last_block and n_blocks of the blocks that slip
        then, counted from the trailing edge; length (m) from first to last block. n_blocks is 0 and
        other columns are NaN if slip stays stable, the driver does not move on, or loads differ
        from the loads at t = 0.

    Raises:
        SceneError: friction does not weaken with slip alone over a length; or the interface has
            gaps or blocks without friction.
    """
    scene = record.scene
    if not scene.law.creeps:
        raise SceneError(
            "interface.d_c", scene.interface.d_c, "m", "> 0, and a law of slip alone",
            "slip does not lose stability",
        )  # fmt: skip
    if not scene.whole:
        raise SceneError(
            "interface.gap", "gaps", "", "a flat interface on which all blocks rub",
            "static paths of slip leave out gaps and blocks without friction",
        )  # fmt: skip
    problem, begin = _condensed(record)
    rows = []
    for event, row in record.events["quiet_start"].items():
        if row >= 0:
            t = float(record.events["t_start"].loc[event])
            rows.append({"event": event} | _nucleation(problem, record, int(row), begin, t))
    names = ["event", "t", "F_T", "first_block", "last_block", "n_blocks", "length"]
    return pd.DataFrame(rows, columns=names)


def nucleation_lengths(record: RecordData) -> np.ndarray | None:
    """Return `length` of `nucleations` for each event, (n_events,), in m; NaN if undefined.

    Return None if friction does not weaken with slip alone, or if static states are unknown. On
    lattices of more than `LARGE` unknowns None is returned, too, because condensation takes long.
    """
    scene = record.scene
    known = scene.law.creeps and scene.has_rests and scene.whole
    if not known or 2 * scene.N_x * scene.N_z > LARGE:
        return None
    lengths = np.full(len(record.events), np.nan)
    if len(lengths):
        table = nucleations(record)
        lengths[table["event"].to_numpy(dtype=int) - 1] = table["length"]
    return lengths


def _nucleation(
    problem: ContactProblem, record: RecordData, row: int, begin: float, t: float
) -> dict[str, float]:
    """Return the row of `nucleations` for one event."""
    scene, none = record.scene, np.zeros(record.scene.N_x)
    u_x, mode = (record.transitions[name][row] for name in ("u_x", "mode"))
    creep = Creep(problem, u_x, none, mode != OPEN, none)
    none = dict.fromkeys(("t", "F_T", "first_block", "last_block"), np.nan)
    none |= {"n_blocks": 0, "length": np.nan}
    legs = scene.legs(float(record.curve["t"].iloc[-1]))
    leg = next(leg for leg in reversed(legs) if leg.t <= t)
    if leg.way < 1 or scene.load_at(t) != scene.load_at(0.0):
        return none
    near = max(scene.drive(t) - ROUNDING * abs(scene.drive(t)), leg.first)
    try:
        path, changes = creep.nucleate(begin + near, begin + leg.last)
    except EquilibriumError:  # no block supports the slider
        return none
    n = np.sort(scene.n_of_i[creep.way != 0])
    if changes[-1].what != "unstable" or not path or not n.size:
        return none
    return {
        "t": leg.time_at(path[-1].drive - begin),
        "F_T": path[-1].F_T,
        "first_block": int(n[0]),
        "last_block": int(n[-1]),
        "n_blocks": n.size,
        "length": (n[-1] - n[0] + 1) * scene.slider.l,
    }


# --- energy release ------------------------------------------------------------------------------


def energy_release(record: RecordData, event: int) -> pd.DataFrame:
    """Return the energy release along the interface; see the module.

    Args:
        event: number of the event, from 1.

    Returns:
        One row per block. Columns: n; x_over_L; G and Gamma of the block, in J (over l B in J/m^2);
        v, the speed in m/s at which g_II(v) G = Gamma. G and Gamma are NaN where the block is open
        or slips already. v is 0 where G < Gamma, and NaN for a chain.

    Raises:
        SceneError: no such event; the record holds no state just before the event; or no block
            rests under the law of friction, so that the fracture energy is not defined.
    """
    scene, reason = record.scene, "its fracture energy is not defined"
    law = scene.resting_law(reason, "a law under which blocks rest")
    contact, order = _before(record, event), np.argsort(scene.n_of_i)
    G, Gamma = np.full(scene.N_x, np.nan), np.full(scene.N_x, np.nan)
    for n, i in enumerate(order):
        if contact.free[i]:
            continue
        now = contact.values()
        contact.change(i, scene.d)
        excess = -scene.d * now.f[i] - law.slide(now.p)[i]
        G[n] = excess * scene.d * (contact.values().u_x[i] - now.u_x[i]) / 2
        Gamma[n] = law.fracture_energy(now.p)[i]
    n = np.arange(1, scene.N_x + 1)
    at = {"n": n, "x_over_L": (n - 1) / (scene.N_x - 1)}
    return pd.DataFrame(at | {"G": G, "Gamma": Gamma, "v": _speeds(record, G, Gamma)})


def griffith_length(table: pd.DataFrame) -> float:
    """Return L_p/L of a front without inertia; 0 if the front cannot start.

    The front stops at the end of the longest row of blocks in which G exceeds Gamma.

    Args:
        table: the table of `energy_release`.
    """
    pays = (table["G"] > table["Gamma"]).to_numpy()
    ends = np.flatnonzero(np.diff(np.concatenate([[False], pays, [False]]).astype(int)))
    if not ends.size:
        return 0.0
    first, last = ends[::2], ends[1::2]
    return int(last[np.argmax(last - first)]) / len(table)


def _before(record: RecordData, event: int) -> Contact:
    """Return the interface just before an event, with blocks in contact held, open blocks free."""
    scene, of_event = record.scene, record.row(event)
    row = int(record.events["quiet_start"].loc[event])
    if row < 0:
        allowed = "an event before which all blocks are stuck"
        raise SceneError("event", event, "", allowed, "the record holds no state before it")
    u_x, mode = (record.transitions[name][row] for name in ("u_x", "mode"))
    times = record.rupture_times[of_event]
    known = times[np.isfinite(times)]
    t = known.max() if known.size else record.events["t_start"].loc[event]
    if scene.load_at(0.0) is not None:
        reason = "static states under a changing F_N or T are not computed"
        raise SceneError("top.protocol", scene.load_at(float(t)), "N", "none", reason)
    problem, begin = _condensed(record)
    return Contact(problem, u_x, begin + scene.drive(float(t)), np.where(mode == OPEN, OPEN, STUCK))


def _speeds(record: RecordData, G: np.ndarray, Gamma: np.ndarray) -> np.ndarray:
    """Return the roots of g_II(v) G = Gamma, m/s."""
    scene = record.scene
    if scene.N_z == 1:
        return np.full(G.shape, np.nan)
    material = material_of(scene)
    v = np.linspace(0, material.c_R, SPEEDS)
    with np.errstate(divide="ignore", invalid="ignore"):
        need = np.where(G > 0, Gamma / G, np.where(np.isnan(G), np.nan, np.inf))
    return np.interp(-need, -g_II(material, v), v, left=0.0)
