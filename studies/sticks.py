"""One block on a spring that is held or pulled, in pyfric and in other programs.

A block of mass m and weight p lies on a plane. The end of its spring K is held at a share of the
threshold mu_s p, or pulled at V. In closed form, with w = sqrt(K/m):

held      the block does not move
pulled    the block slips from mu_s p on; the force is mu_k p + (mu_s - mu_k) p cos wt + (K V/w) sin
          wt, between mu_k p + r and mu_k p - r with r^2 = ((mu_s - mu_k) p)^2 + (K V/w)^2. For slow
          pulling these limits are mu_s p and (2 mu_k - mu_s) p, where the block stops

A chain of ten such blocks is pulled at its first block until all slide. The reference for the chain
is the loop around `solve_ivp` with its finest tolerance.

The other programs run in a separate environment (`sticks_peers.py`), two of them in Node.js
(`sticks_peers.cjs`).
"""

from __future__ import annotations

import functools
import json
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib
import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp
from sizes import size, tiny
from sticks_peers import (
    ETA,
    K_BOND,
    MU_K,
    MU_S,
    RAMP,
    SAMPLE,
    SETTLED,
    START,
    T_CHAIN,
    V_CHAIN,
    K,
    M,
    N,
    P,
    V,
    end_of_spring,
)

import pyfric
from pyfric import core, figures
from pyfric.scene import chain
from pyfric.statics import loaded_state

if TYPE_CHECKING:
    from pyfric.figures import DataFigure

__all__ = ["CHAINS", "COLUMNS", "PEERS", "chained", "exact", "figure", "held", "pulled", "study"]

ROOT = Path(__file__).parents[1]
ENVIRONMENT = ROOT / ".venv" / "sticks"
DEBIAN = "/usr/bin/python3"
MODULES = ENVIRONMENT / "node"
WANTED = Path(__file__).with_name("sticks_requirements.txt")
SCENE = {"M": M, "P": P, "K": K, "V": V, "MU_S": MU_S}
SCENE |= {"START": START, "RAMP": RAMP, "SAMPLE": SAMPLE, "SETTLED": SETTLED}
"""Parameters for programs in Node.js, in SI."""
HELD = (0.5, 0.999)
"""Shares of the threshold at which the spring is held."""
HOLD, PULL = size((10.0, 4.0), (0.1, 3.5))
"""Times after the ramp, s. Slip begins after 3 s of pulling and takes 0.3 s."""
STEPS = size((5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4), (5e-3,))
OF_HOLDING = 1e-3
"""Steps, s, of pulling and of holding."""
RTOLS = size((1e-4, 1e-6, 1e-8, 1e-10, 1e-12), (1e-4,))
"""Tolerances of programs that choose their steps."""
COLUMNS = [
    *("program", "version", "settings", "coefficients", "step", "creep_half", "creep_near"),
    *("F_max", "F_min", "error", "seconds"),
]

IN_CHAIN = ["program", "version", "settings", "coefficients", "step", "error", "seconds"]
FINEST = size(1e-12, 1e-6)
"""Tolerance of the reference of chains."""


class Peer(NamedTuple):
    """One program with its settings.

    Attributes:
        name, settings: texts in the tables.
        run: takes step (s), t_end (s) and share (None: pulled); returns times, displacements,
            processor time and version.
        two: whether the program has mu_k as well as mu_s.
        steps: steps, or the tolerances that set them.
    """

    name: str
    settings: str
    run: Callable[..., tuple[np.ndarray, np.ndarray, float, str]]
    two: bool = False
    steps: tuple[float, ...] = STEPS


# --- programs ------------------------------------------------------------------------------------


def block(share: float | None) -> Any:
    """Return three equal blocks with the mass, weight and springs of one; they move as one.

    The run starts at the end of the ramp, at t = 0, with the blocks at rest under its force.
    """
    held = (START if share is None else share) * MU_S * P / 3
    ramp = tuple((n, 0.0, 0.0, math.inf, K * V / 3) for n in (1, 2, 3))
    own = {"L": 5e-3, "M": M, "p": P / 3, "tau": held, "k_top": K / 3, "k": 1.0, "K": 1e-30}
    own |= {"V": 0.0, "mu_s": MU_S, "mu_k": MU_K, "eta": 0.0}
    return chain(push=ramp if share is None else (), **own)


def of_pyfric(step: float, t_end: float, share: float | None) -> Any:
    ts, us, seconds = advanced(block(share), step, t_end - RAMP)
    ts, us = np.append(0.0, RAMP + ts), np.append(0.0, us.mean(axis=1))
    return ts, us, seconds, pyfric.__version__


def chain_of_pyfric(step: float, t_end: float, share: None) -> Any:
    own = {"L": 2.5e-3 * (N - 1), "M": N * M, "p": P, "k": K_BOND, "eta": ETA, "K": K, "V": V_CHAIN}
    ts, us, seconds = advanced(chain(mu_s=MU_S, mu_k=MU_K, **own), step, t_end)
    return ts, us[:, 0], seconds, pyfric.__version__


def advanced(scene: Any, step: float, t_end: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return times (s), displacements along the interface (times x blocks, m), processor time."""
    state = loaded_state(scene, "linear").state(scene, step)
    model, log = core.model(scene, "linear", state.u_drv0), core.Log(scene.N_x)
    every = max(1, round(SAMPLE / step))
    ts, us, begin = [0.0], [state.y[0, 0].copy()], time.process_time()
    for _ in range(round(t_end / step / every)):
        status = core.advance(model, state, log, every, switching="located", budget=False)
        assert status == core.Status.DONE, status.name
        ts.append(state.t)
        us.append(state.y[0, 0].copy())
    return np.array(ts), np.array(us), time.process_time() - begin


def of_solve_ivp(rtol: float, t_end: float, share: float | None) -> Any:
    """Run DOP853 with a directed event for each switch; atol is far below u in m."""
    import scipy

    end = end_of_spring(share)

    def force(t: float, y: np.ndarray) -> float:
        return K * (end(t) - y[0])

    def starts(t: float, y: np.ndarray) -> float:
        return force(t, y) - MU_S * P

    def stops(_: float, y: np.ndarray) -> float:
        return y[1]

    starts.direction, stops.direction = 1, -1
    starts.terminal = stops.terminal = True
    ts, us, t, y, slips = [np.zeros(1)], [np.zeros(1)], 0.0, np.zeros(2), False
    begin = time.process_time()
    while t < t_end:

        def rates(t: float, y: np.ndarray, slips: bool = slips) -> list[float]:
            return [y[1], (force(t, y) - MU_K * P) / M if slips else 0.0]

        samples = np.arange(math.floor(t / SAMPLE) + 1, round(t_end / SAMPLE) + 1) * SAMPLE
        # No step goes over the corner of the ramp.
        stop = RAMP if t < RAMP else t_end
        how = {"method": "DOP853", "rtol": rtol, "atol": rtol * 1e-3}
        inside = samples[samples < stop - SAMPLE / 2]
        how |= {"events": stops if slips else starts, "t_eval": np.append(inside, stop)}
        found = solve_ivp(rates, (t, stop), y, **how)
        ts.append(found.t)
        us.append(found.y[0] if len(found.t) else np.zeros(0))
        if found.status == 1:
            t, y, slips = found.t_events[0][0], found.y_events[0][0], not slips
            y = np.array([y[0], 1e-300 if slips else 0.0])  # start just past the root
        else:
            t, y = stop, found.y[:, -1]
    return (*map(np.concatenate, (ts, us)), time.process_time() - begin, scipy.__version__)


def chain_of_solve_ivp(rtol: float, t_end: float, share: None, mu_k: float = MU_K) -> Any:
    """Run the loop of `of_solve_ivp` for a chain: each block sticks (0) or slips (1 or -1).

    `solve_ivp` looks for signs that change from one end of a step to the other. The loop misses a
    block that stops for a moment within a step, so coarse tolerances miss some stops.
    """
    import scipy

    slips = np.zeros(N)

    def force(t: float, y: np.ndarray) -> np.ndarray:
        bonds = K_BOND * np.diff(y[:N]) + ETA * np.diff(y[N:])
        return np.r_[K * (V_CHAIN * t - y[0]), -bonds] + np.r_[bonds, 0.0]

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        a = np.where(slips != 0, (force(t, y) - slips * mu_k * P) / M, 0.0)
        return np.concatenate([y[N:], a])

    def switch(n: int) -> Callable[[float, np.ndarray], float]:
        def far(t: float, y: np.ndarray) -> float:
            return slips[n] * y[N + n] if slips[n] else MU_S * P - abs(force(t, y)[n])

        far.terminal, far.direction = True, -1
        return far

    switches = [switch(n) for n in range(N)]
    t, y, ts, us = 0.0, np.zeros(2 * N), [np.zeros(1)], [np.zeros(1)]
    begin = time.process_time()
    while t < t_end:
        samples = np.arange(math.floor(t / SAMPLE) + 1, round(t_end / SAMPLE) + 1) * SAMPLE
        how = {"method": "DOP853", "rtol": rtol, "atol": rtol * 1e-3, "t_eval": samples}
        found = solve_ivp(rates, (t, t_end), y, events=switches, **how)
        ts.append(found.t)
        us.append(found.y[0] if len(found.t) else np.zeros(0))
        if found.status != 1:
            break
        n = next(n for n, one in enumerate(found.t_events) if len(one))
        t, y = found.t_events[n][0], found.y_events[n][0].copy()
        pushed = force(t, y)[n]
        if slips[n]:  # the block stops, or reverses if the force exceeds friction
            slips[n] = np.sign(pushed) if abs(pushed) > MU_S * P else 0.0
        else:
            slips[n] = np.sign(pushed)
        y[N + n] = slips[n] * 1e-300
    return *map(np.concatenate, (ts, us)), time.process_time() - begin, scipy.__version__


def outside(peer: str, python: str | Path | None = None, **how: Any) -> Callable[..., Any]:
    """Return a function that runs a peer of `sticks_peers` with its interpreter."""
    script = Path(__file__).with_name("sticks_peers.py")
    return answered(peer, [python or ENVIRONMENT / "bin" / "python", "-P", script], how)


def in_node(peer: str, **how: Any) -> Callable[..., Any]:
    """Return a function that runs a peer of `sticks_peers.cjs`."""
    script = Path(__file__).with_name("sticks_peers.cjs")
    return answered(peer, ["node", script], how, of=SCENE)


def answered(peer: str, words: list[Any], how: dict[str, Any], **more: Any) -> Callable[..., Any]:
    """Return a function that runs a command, and returns the result of a peer."""

    def run(step: float, t_end: float, share: float | None) -> Any:
        asked = {"peer": peer, "dt": step, "t_end": t_end, "share": share, "how": how} | more
        env = os.environ | {"NODE_PATH": str(MODULES / "node_modules")}
        command = [*map(str, words), json.dumps(asked)]
        done = subprocess.run(command, capture_output=True, text=True, env=env)
        if done.returncode:
            raise RuntimeError(f"{peer}: {done.stderr.strip().splitlines()[-1]}")
        found = json.loads(done.stdout.splitlines()[-1])
        return np.array(found["t"]), np.array(found["u"]), found["seconds"], found["version"]

    return run


NO_SLIP = 'noslip_iterations="50"'
STIFF = 'cone="elliptic" impratio="100"'
PEERS = (
    Peer("pyfric", "located switches, RK4", of_pyfric, two=True),
    Peer("solve_ivp", "DOP853, events", of_solve_ivp, True, RTOLS),
    Peer("CVODE", "Adams, events", outside("cvode"), True, RTOLS),
    Peer("Siconos", "Moreau–Jean, theta 0.5", outside("siconos", DEBIAN)),
    Peer("OpenSees", "flatSliderBearing, kInit 1e6 N/m, Newmark", outside("opensees")),
    Peer(
        *("LAMMPS", "wall/gran, linear_history, k_n 1e6 N/m", outside("lammps")),
        steps=(2e-4, 1e-4, 5e-5),
    ),
    Peer("MuJoCo", "defaults", outside("mujoco")),
    Peer("MuJoCo, elliptic", "elliptic cone, impratio 100", outside("mujoco", options=STIFF)),
    Peer("MuJoCo, no slip", "noslip_iterations 50", outside("mujoco", options=NO_SLIP)),
    Peer("Drake, discrete", "defaults", outside("drake"), steps=STEPS[:4]),
    Peer(
        *("Drake, continuous", "defaults, accuracy 1e-3"),
        *(outside("drake", accuracy=1e-3), True, (1e-3,)),
    ),
    Peer("exudyn", "joint friction, bristle 1e6 N/m, decay 1 mm/s", outside("exudyn"), True),
    Peer(
        *("exudyn, stiff", "joint friction, bristle 1e8 N/m, decay 10 um/s"),
        *(outside("exudyn", k=1e8, decay=1e-5), True),
    ),
    Peer("DART", "defaults", outside("dart")),
    Peer("pymunk", "defaults", outside("pymunk")),
    Peer("Rapier", "defaults, does not turn", in_node("rapier")),
    Peer("Rapier, turning", "defaults", in_node("rapier", turns=True), steps=(2e-4, 1e-4, 5e-5)),
    Peer("matter-js", "defaults, no air, 100 px/m", in_node("matter")),
    Peer("Newton", "XPBD, defaults", outside("newton"), steps=(5e-3, 2e-3)),
    Peer("Newton, 20", "XPBD, 20 iterations", outside("newton", iterations=20), steps=(5e-3,)),
)

COARSE = STEPS[:3]
CHAINS = (
    Peer("pyfric", "located switches, RK4", chain_of_pyfric, two=True),
    Peer("solve_ivp", "DOP853, events", chain_of_solve_ivp, True, RTOLS[:4]),
    Peer("Siconos", "Moreau–Jean, theta 0.5", outside("siconos_chain", DEBIAN), steps=COARSE),
    Peer("MuJoCo", "defaults", outside("mujoco_chain"), steps=COARSE),
    Peer(
        *("MuJoCo, elliptic", "elliptic cone, impratio 100"),
        *(outside("mujoco_chain", options=STIFF), False, COARSE),
    ),
)
"""Programs that pull a chain of ten blocks."""
PEERS, CHAINS = size((PEERS, CHAINS), (PEERS[:2], CHAINS[:2]))  # installed programs


def install(say: Callable[[str], None]) -> None:
    """Make the environment of the other programs, unless it exists."""
    if tiny():
        return
    if not (ENVIRONMENT / "done").exists():
        say("installing the other programs")
        subprocess.run([sys.executable, "-m", "venv", "--clear", ENVIRONMENT], check=True)
        words = ["-m", "pip", "install", "--quiet", "-r", WANTED]
        subprocess.run([ENVIRONMENT / "bin" / "python", *words], check=True)
        modules = re.findall(r"^# npm: (.+)$", WANTED.read_text(encoding="utf-8"), re.MULTILINE)
        words = ["npm", "install", "--silent", "--no-save", "--prefix", MODULES, *modules]
        subprocess.run(words, check=True)
        (ENVIRONMENT / "done").touch()
    if subprocess.run([DEBIAN, "-c", "import siconos"], capture_output=True).returncode:
        subprocess.run(["apt-get", "install", "-y", "-qq", "python3-siconos"], check=True)


# --- what is compared ----------------------------------------------------------------------------


def exact(t: np.ndarray, two: bool) -> np.ndarray:
    """Return the force of a pulled block at times t (s) in closed form, in N.

    With one coefficient the force swings about mu_s p by K V/w, and the speed touches zero.
    """
    w, mean = math.sqrt(K / M), (MU_K if two else MU_S) * P
    swing, drop = K * V / w, MU_S * P - mean
    after = np.maximum(t - RAMP - (1 - START) * MU_S * P / (K * V), 0.0)
    stop = 2 * (math.pi - math.atan2(drop, swing)) / w if two else math.inf
    s = np.minimum(after, stop)
    slipping = mean + drop * np.cos(w * s) + swing * np.sin(w * s) + K * V * (after - s)
    return np.where(after > 0, slipping, K * np.array([end_of_spring(None)(one) for one in t]))


def held(peer: Peer, share: float) -> float:
    """Return by how much a block creeps in `HOLD` after the ramp, in m."""
    step = OF_HOLDING if OF_HOLDING in peer.steps else peer.steps[-1]
    t, u, _, _ = peer.run(step, RAMP + HOLD, share)
    return float(abs(u[-1] - np.interp(RAMP, t, u)))


def pulled(peer: Peer, step: float) -> dict[str, Any]:
    """Return version, forces (N), their error in units of p, and the processor time in s.

    Forces are the largest force, and the least force after it. The error is the largest difference
    from the closed form at any sampled time.
    """
    t, u, seconds, known = peer.run(step, RAMP + PULL, None)
    F = K * (np.array([end_of_spring(None)(one) for one in t]) - u)
    top, error = int(F.argmax()), float(np.abs(F - exact(t, peer.two)).max()) / P
    forces = {"F_max": float(F[top]), "F_min": float(F[top:].min())}
    return {"version": known, **forces, "error": error, "seconds": seconds}


@functools.cache
def fine(two: bool) -> Any:
    """Return the reference of chains with two coefficients, or with one."""
    return chain_of_solve_ivp(FINEST, T_CHAIN, None, MU_K if two else MU_S)


def chained(peer: Peer, step: float) -> dict[str, Any]:
    """Return version, the largest error of the force in units of p, and the processor time in s."""
    t, u, seconds, known = peer.run(step, T_CHAIN, None)
    t_fine, u_fine, *_ = fine(peer.two)
    error = float(np.abs(np.interp(t, t_fine, u_fine) - u).max()) * K / P
    return {"version": known, "error": error, "seconds": seconds}


def coefficients(peer: Peer) -> dict[str, str]:
    """Return the first columns of a row: the program and its settings."""
    about = {"program": peer.name, "settings": peer.settings}
    return about | {"coefficients": "mu_s, mu_k" if peer.two else "one"}


def chains(say: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """Return one row for each program that pulls a chain and each step, with columns `IN_CHAIN`."""
    install(say)
    rows = []
    for peer in CHAINS:
        for step in peer.steps:
            say(f"{peer.name}: chain, {step:g}")
            rows.append(coefficients(peer) | {"step": step} | chained(peer, step))
    return pd.DataFrame(rows)[IN_CHAIN]


def renewed(table: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """Return a table with rows of some programs replaced by new rows, in the order of `PEERS`."""
    kept = table[~table["program"].isin(rows["program"])]
    place = {peer.name: n for n, peer in enumerate(PEERS)}
    found = pd.concat([kept, rows], ignore_index=True)
    return found.sort_values("program", key=lambda names: names.map(place), kind="stable")


def study(say: Callable[[str], None] = lambda _: None, only: tuple[str, ...] = ()) -> pd.DataFrame:
    """Return one row for each program, or for some, and each step, with columns `COLUMNS`."""
    install(say)
    rows = []
    for peer in (peer for peer in PEERS if peer.name in only or not only):
        say(f"{peer.name}: held")
        half, near = (held(peer, share) for share in HELD)
        for step in peer.steps:
            say(f"{peer.name}: pulled, {step:g}")
            found = {"step": step, "creep_half": half, "creep_near": near}
            rows.append(coefficients(peer) | found | pulled(peer, step))
    return pd.DataFrame(rows)[COLUMNS]


# --- picture -------------------------------------------------------------------------------------

LEAST = 1e-12
"""Least creep that is drawn as a bar, m."""


def figure(table: pd.DataFrame, chain_table: pd.DataFrame) -> DataFigure:
    """Return error against cost of one block, its creep, and error against cost of a chain."""
    fig = figures.DataFigure(figsize=(7.2, 6.0), layout="constrained")
    grid = fig.add_gridspec(2, 2)
    left, below = fig.add_subplot(grid[0, 0]), fig.add_subplot(grid[1, 0])
    right = fig.add_subplot(grid[:, 1])
    names = list(dict.fromkeys(table["program"]))
    shades = matplotlib.colormaps["tab20"]
    colours = {name: shades(2 * (n % 10) + n // 10) for n, name in enumerate(names)}
    for axes, rows_of in ((left, table), (below, chain_table)):
        for name, rows in rows_of.groupby("program", sort=False):
            mark = "o-" if rows["coefficients"].iloc[0] != "one" else "s--"
            axes.loglog(rows["seconds"], rows["error"], mark, ms=3.5, lw=1, color=colours[name])
        axes.set(xlabel="processor time (s)", ylabel="largest error of the force over $p$")
    for at, name in enumerate(names):
        creep = table.loc[table["program"] == name, "creep_half"].iloc[0]
        right.barh([at], [max(creep, LEAST)], 0.6, color=colours[name])
        if creep < LEAST:
            right.text(2 * LEAST, at, "none", va="center", fontsize=8, color=colours[name])
    left.set_title("(a) one block, pulled", loc="left", fontsize=9)
    below.set_title("(b) ten blocks, pulled", loc="left", fontsize=9)
    right.set(xscale="log", xlabel=r"creep in 10 s at $\mu_s p/2$ (m)")
    right.set_xlim(LEAST, 0.1)
    right.set_yticks(range(len(names)), names)
    right.invert_yaxis()
    right.set_title("(c) one block, held; colours of all panels", loc="left", fontsize=9)
    fig.caption = (
        "Blocks on a spring. (a, b) Largest error of the force in a slow pull to slip and on, over "
        "steps or tolerances, in programs with two coefficients (circles) or with one "
        "(squares): one block against its closed form, and a chain of ten against the loop around "
        "solve_ivp with a relative tolerance of 1e-12. (c) Displacement of one block in 10 s while "
        "the spring is held; none means rounding or exactly zero."
    )
    fig.tables = {"programs": table, "chain": chain_table}
    return fig
