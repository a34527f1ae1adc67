"""One block on a spring that is held or pulled, in pyfric and in other programs.

A block of mass m under the weight p lies on a plane; the end of its spring K is held at a share of
the threshold mu_s p, or pulled at V. In closed form, with w = sqrt(K/m):

held      the block does not move
pulled    it slips from mu_s p on; the force is mu_k p + (mu_s - mu_k) p cos wt + (K V/w) sin wt,
          between mu_k p + r and mu_k p - r with r^2 = ((mu_s - mu_k) p)^2 + (K V/w)^2. For slow
          pulling these are mu_s p and (2 mu_k - mu_s) p, where the block stops

The other programs run in an environment of their own (`sticks_peers.py`).
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp
from sticks_peers import MU_K, MU_S, RAMP, SAMPLE, START, K, M, P, V, end_of_spring

import pyfric
from pyfric import core, figures
from pyfric.scene import chain
from pyfric.statics import loaded_state

if TYPE_CHECKING:
    from pyfric.figures import DataFigure

__all__ = ["COLUMNS", "PEERS", "exact", "figure", "held", "pulled", "study"]

ROOT = Path(__file__).parents[1]
ENVIRONMENT = ROOT / ".venv" / "sticks"
DEBIAN = "/usr/bin/python3"
HELD = (0.5, 0.999)
"""Shares of the threshold at which the spring is held."""
HOLD, PULL = 10.0, 4.0
"""Times after the ramp, s. Slip begins after 3 s of pulling and takes 0.3 s."""
STEPS = (5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
OF_HOLDING = 1e-3
"""Steps, s, of pulling and of holding."""
COLUMNS = [
    *("program", "version", "settings", "coefficients", "step", "creep_half", "creep_near"),
    *("F_max", "F_min", "error", "seconds"),
]


class Peer(NamedTuple):
    """One program with its settings.

    Attributes:
        name, settings: for readers.
        run: takes step (s), t_end (s) and share (None: pulled); returns times, displacements,
            processor time and version.
        two: whether it has mu_k as well.
        steps: steps, or what stands for them.
    """

    name: str
    settings: str
    run: Callable[..., tuple[np.ndarray, np.ndarray, float, str]]
    two: bool = False
    steps: tuple[float, ...] = STEPS


# --- programs ------------------------------------------------------------------------------------


def block(share: float | None) -> Any:
    """Return three equal blocks with the mass, weight and springs of one; they move as one.

    The ramp is left out: at its end, which is t = 0 here, they are under its force, at rest.
    """
    held = (START if share is None else share) * MU_S * P / 3
    ramp = tuple((n, 0.0, 0.0, math.inf, K * V / 3) for n in (1, 2, 3))
    own = {"L": 5e-3, "M": M, "p": P / 3, "tau": held, "k_top": K / 3, "k": 1.0, "K": 1e-30}
    own |= {"V": 0.0, "mu_s": MU_S, "mu_k": MU_K, "eta": 0.0}
    return chain(push=ramp if share is None else (), **own)


def of_pyfric(step: float, t_end: float, share: float | None) -> Any:
    scene = block(share)
    state = loaded_state(scene, "linear").state(scene, step)
    model, log = core.model(scene, "linear", state.u_drv0), core.Log(scene.N_x)
    every = max(1, round(SAMPLE / step))
    ts, us, begin = [0.0, RAMP], [0.0, 0.0], time.process_time()
    for _ in range(round((t_end - RAMP) / step / every)):
        status = core.advance(model, state, log, every, switching="located", budget=False)
        assert status == core.Status.DONE, status.name
        ts.append(RAMP + state.t)
        us.append(state.y[0, 0].mean())
    return np.array(ts), np.array(us), time.process_time() - begin, pyfric.__version__


def of_solve_ivp(rtol: float, t_end: float, share: float | None) -> Any:
    """DOP853 with an event for each switch, which has a direction; atol is far below u in m."""
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
        # The ramp has a corner: no step goes over it.
        stop = RAMP if t < RAMP else t_end
        how = {"method": "DOP853", "rtol": rtol, "atol": rtol * 1e-3}
        inside = samples[samples < stop - SAMPLE / 2]
        how |= {"events": stops if slips else starts, "t_eval": np.append(inside, stop)}
        found = solve_ivp(rates, (t, stop), y, **how)
        ts.append(found.t)
        us.append(found.y[0] if len(found.t) else np.zeros(0))
        if found.status == 1:
            t, y, slips = found.t_events[0][0], found.y_events[0][0], not slips
            y = np.array([y[0], 1e-300 if slips else 0.0])  # just past the root
        else:
            t, y = stop, found.y[:, -1]
    return (*map(np.concatenate, (ts, us)), time.process_time() - begin, scipy.__version__)


def outside(peer: str, python: str | Path | None = None, **how: Any) -> Callable[..., Any]:
    """Return a function that runs a peer of `sticks_peers` with its interpreter."""
    script = Path(__file__).with_name("sticks_peers.py")

    def run(step: float, t_end: float, share: float | None) -> Any:
        asked = {"peer": peer, "dt": step, "t_end": t_end, "share": share, "how": how}
        words = [str(python or ENVIRONMENT / "bin" / "python"), "-P", str(script)]
        done = subprocess.run([*words, json.dumps(asked)], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{peer}: {done.stderr.strip().splitlines()[-1]}")
        found = json.loads(done.stdout.splitlines()[-1])
        return np.array(found["t"]), np.array(found["u"]), found["seconds"], found["version"]

    return run


NO_SLIP = 'noslip_iterations="50"'
STIFF = 'cone="elliptic" impratio="100"'
PEERS = (
    Peer("pyfric", "located switches, RK4", of_pyfric, two=True),
    Peer("solve_ivp", "DOP853, events", of_solve_ivp, True, (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
    Peer("Siconos", "Moreau–Jean, theta 0.5", outside("siconos", DEBIAN)),
    Peer("OpenSees", "flatSliderBearing, kInit 1e6 N/m, Newmark", outside("opensees")),
    Peer("MuJoCo", "defaults", outside("mujoco")),
    Peer("MuJoCo, elliptic", "elliptic cone, impratio 100", outside("mujoco", options=STIFF)),
    Peer("MuJoCo, no slip", "noslip_iterations 50", outside("mujoco", options=NO_SLIP)),
    Peer("Drake, discrete", "defaults", outside("drake"), steps=STEPS[:4]),
    Peer(
        *("Drake, continuous", "defaults, accuracy 1e-3"),
        *(outside("drake", accuracy=1e-3), True, (1e-3,)),
    ),
)


def install(say: Callable[[str], None]) -> None:
    """Make the environment of the other programs, once."""
    if not (ENVIRONMENT / "done").exists():
        say("installing the other programs")
        subprocess.run([sys.executable, "-m", "venv", "--clear", ENVIRONMENT], check=True)
        wanted = Path(__file__).with_name("sticks_requirements.txt")
        words = ["-m", "pip", "install", "--quiet", "-r", wanted]
        subprocess.run([ENVIRONMENT / "bin" / "python", *words], check=True)
        (ENVIRONMENT / "done").touch()
    if subprocess.run([DEBIAN, "-c", "import siconos"], capture_output=True).returncode:
        subprocess.run(["apt-get", "install", "-y", "-qq", "python3-siconos"], check=True)


# --- what is compared ----------------------------------------------------------------------------


def exact(t: np.ndarray, two: bool) -> np.ndarray:
    """Return the force of a pulled block at times t (s) in closed form, in N.

    With one coefficient the block swings about mu_s p, by K V/w, and its speed only touches zero.
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
    """Return version, forces (N), their error over p, and the processor time in s.

    Forces are the largest one, and the least one after it. The error is the largest difference from
    the closed form at any sampled time.
    """
    t, u, seconds, known = peer.run(step, RAMP + PULL, None)
    F = K * (np.array([end_of_spring(None)(one) for one in t]) - u)
    top, error = int(F.argmax()), float(np.abs(F - exact(t, peer.two)).max()) / P
    forces = {"F_max": float(F[top]), "F_min": float(F[top:].min())}
    return {"version": known, **forces, "error": error, "seconds": seconds}


def study(say: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """Return one row for each program and step, with `COLUMNS`."""
    install(say)
    rows = []
    for peer in PEERS:
        say(f"{peer.name}: held")
        half, near = (held(peer, share) for share in HELD)
        about = {"program": peer.name, "settings": peer.settings}
        about |= {"coefficients": "mu_s, mu_k" if peer.two else "one"}
        for step in peer.steps:
            say(f"{peer.name}: pulled, {step:g}")
            found = {"step": step, "creep_half": half, "creep_near": near}
            rows.append(about | found | pulled(peer, step))
    return pd.DataFrame(rows)[COLUMNS]


# --- picture -------------------------------------------------------------------------------------

LEAST = 1e-12
"""Creep below which a bar is not drawn longer, m."""


def figure(table: pd.DataFrame) -> DataFigure:
    """Return error against cost, and creep."""
    fig = figures.DataFigure(figsize=(7.2, 3.6), layout="constrained")
    left, right = fig.subplots(1, 2, width_ratios=[1.25, 1])
    names = list(dict.fromkeys(table["program"]))
    colours = dict(zip(names, [f"C{n}" for n in range(len(names))], strict=True))
    for name, rows in table.groupby("program", sort=False):
        mark = "o-" if rows["coefficients"].iloc[0] != "one" else "s--"
        left.loglog(rows["seconds"], rows["error"], mark, ms=3.5, lw=1, color=colours[name])
        creep, at = rows["creep_half"].iloc[0], names.index(name)
        right.barh([at], [max(creep, LEAST)], 0.6, color=colours[name])
        if creep < LEAST:
            right.text(2 * LEAST, at, "none", va="center", fontsize=8, color=colours[name])
    left.set(
        xlabel="processor time of the pulled block (s)",
        ylabel="largest error of the force over $p$",
    )
    left.set_title("(a) slip: circles have $\\mu_s$ and $\\mu_k$", loc="left", fontsize=9)
    right.set(xscale="log", xlabel=r"creep in 10 s at $\mu_s p/2$ (m)")
    right.set_xlim(LEAST, 0.1)
    right.set_yticks(range(len(names)), names)
    right.invert_yaxis()
    right.set_title("(b) stick", loc="left", fontsize=9)
    fig.caption = (
        "One block on a spring. (a) Largest error of the force in a slow pull to slip and on, over "
        "steps or tolerances, in programs with two coefficients (circles) or with one "
        "(squares). (b) Displacement in 10 s while the spring is held; none means "
        "rounding or exactly zero."
    )
    fig.tables = {"programs": table}
    return fig
