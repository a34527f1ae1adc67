"""The compiled core: which build runs, how a scene is handed over, what its codes mean.

The same Fortran sources are built for several instruction sets. The best one this processor runs
is taken at import; the environment variable ``PYFRIC_VARIANT`` names another one. All give the
same bits.
"""

from __future__ import annotations

import enum
import functools
import importlib
import importlib.util
import math
import os
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

import numpy as np

from pyfric.core.state import OPEN
from pyfric.scene import Geometry, check_geometry

if TYPE_CHECKING:
    from collections.abc import Callable

    from pyfric.core.state import State
    from pyfric.scene import Scene

__all__ = [
    "EVALUATIONS",
    "STEPPERS",
    "VARIANT",
    "Forces",
    "Log",
    "Model",
    "Status",
    "Stepper",
    "Switching",
    "additions",
    "advance",
    "bond_forces",
    "build_info",
    "energies",
    "evaluate",
    "load_variant",
    "model",
    "room_of_step",
    "springs",
    "useful_threads",
    "variants",
]

ENVIRONMENT = "PYFRIC_VARIANT"
CORNER_SHARE = 0.02
"""Slip that starts with less than this share of F_N/N_x is a corner episode."""
BLOCKS_PER_THREAD = 5_000
"""Smallest share of the lattice for which one more thread pays (`pyfric bench threads`)."""

Stepper = Literal["rk4", "symplectic_euler", "verlet", "adaptive"]
Switching = Literal["step_end", "located"]
STEPPERS: dict[str, int] = {"rk4": 0, "symplectic_euler": 1, "verlet": 2, "adaptive": 3}
"""Explicit steppers, and their numbers in the core (pyfric_nystrom)."""
EVALUATIONS = {"rk4": 4, "symplectic_euler": 1, "verlet": 2, "adaptive": 5}
"""Force evaluations of each step or sub-step."""

ENERGIES = (
    "kinetic_blocks",
    "kinetic_rod",
    "elastic_bonds",
    "elastic_foundation",
    "elastic_mattress",
    "elastic_driver",
)
"""Order of the energies that leave the core. In a chain, "elastic_mattress" is that of k_top."""


class Status(enum.IntEnum):
    """Codes of the core (pyfric_status in Fortran); `message` says what they mean."""

    DONE = 0
    LOG_FULL = 1
    ENDLESS = 2
    TOO_SHORT = 3

    @property
    def message(self) -> str:
        return {
            Status.DONE: "all steps were made",
            Status.LOG_FULL: "stopped early: the log has no room for one more step",
            Status.ENDLESS: "stopped inside a step: contacts switch too often in it",
            Status.TOO_SHORT: "stopped inside a step: its error stays too large",
        }[self]


# --- builds --------------------------------------------------------------------------------------


def variants() -> dict[str, bool]:
    """Return the variants that are installed, best first, and whether this processor runs them."""
    found = {"X86_V2"}
    simd = np.show_config(mode="dicts").get("SIMD Extensions", {})  # what NumPy found at import
    for names in simd.values():
        if names is not simd.get("not found"):
            found.update(names)
    runs = {
        "v4": bool(found & {"X86_V4", "AVX512_SKX"}),
        "v3": bool(found & {"X86_V3"}) or {"AVX2", "FMA3"} <= found,
        "v2": True,
        "baseline": True,
    }
    here = {
        name: importlib.util.find_spec(f"pyfric.core._core_{name}") is not None for name in runs
    }
    return {name: runs[name] for name in runs if here[name]}


@functools.cache
def load_variant(name: str) -> Any:
    """Return the extension module of one variant.

    Raises:
        ImportError: it is not installed, or this processor cannot run it.
    """
    known = variants()
    if name not in known:
        listed = ", ".join(known) or "none"
        raise ImportError(f"{ENVIRONMENT} = {name!r}: not installed (installed: {listed})")
    if not known[name]:
        raise ImportError(f"{ENVIRONMENT} = {name!r}: this processor lacks its instructions")
    return importlib.import_module(f"pyfric.core._core_{name}")


def _chosen() -> str:
    wanted = os.environ.get(ENVIRONMENT, "")
    if wanted:
        return wanted
    usable = [name for name, runs in variants().items() if runs]
    if not usable:
        raise ImportError("pyfric is not built: install it with `pip install .`")
    return usable[0]


VARIANT = _chosen()
"""Name of the variant in use."""
_core = load_variant(VARIANT)


def build_info(name: str = VARIANT) -> dict[str, Any]:
    """Return compiler, flags and openmp (bool) of one variant."""
    compiler, options, openmp = load_variant(name).build_info()
    flags = [
        f for f in options.decode().split() if f.startswith(("-O", "-m", "-f", "-std", "--param"))
    ]
    kept = [f for f in dict.fromkeys(flags) if not f.startswith(("-fpre-include", "-fdiagnostics"))]
    return {
        "compiler": compiler.decode().strip(),
        "flags": " ".join(kept),
        "openmp": bool(openmp),
    }


def useful_threads(n_blocks: int, threads: int | None = None) -> int:
    """Return the number of threads that pays for a lattice of n_blocks.

    Args:
        n_blocks: N_x N_z.
        threads: the most to use; None means all processors this process may run on.
    """
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    most = (available or 1) if threads is None else threads
    if not build_info()["openmp"]:
        return 1
    return max(1, min(most, n_blocks // BLOCKS_PER_THREAD))


def additions(n: int, variant: str = VARIANT) -> int:
    """Make n additions to each of some sums in registers; return how many there were in all."""
    width, total = load_variant(variant).additions(n)
    assert total == n * width * (width + 1) // 2
    return n * width


# --- calls ---------------------------------------------------------------------------------------


class Model(NamedTuple):
    """A scene as the core takes it; made by `model`, which is where it is checked."""

    finite: int
    rigid: int
    i_h: int
    j_h: int
    constants: np.ndarray
    x: np.ndarray
    load: np.ndarray
    shear: np.ndarray


def model(scene: Scene, geometry: Geometry, u_drv0: float) -> Model:
    """Return the scene as the core takes it.

    Args:
        scene: the scene (its values were checked when it was made).
        geometry: "linear" or "finite".
        u_drv0: u_x of the driven block at which F_T = 0 at t = 0, in m.

    Raises:
        ValueError: unknown geometry, or a derived constant is not finite.
        SceneError: finite geometry for a chain.
    """
    check_geometry(geometry, scene)
    slider, driver, interface = scene.slider, scene.driver, scene.interface
    m_top = scene.M_rod + scene.N_x * scene.m
    i_rod = scene.M_rod * slider.L**2 / 12
    constants = np.array(
        [
            slider.l,
            slider.k,
            scene.eta,
            scene.m,
            scene.k_f,
            interface.mu_s,
            interface.mu_k,
            scene.F_N,
            scene.M_rod,
            i_rod,
            m_top,
            i_rod + scene.m * np.sum(scene.x**2),
            scene.kappa,
            scene.d,
            driver.K,
            driver.V,
            u_drv0,
            CORNER_SHARE * scene.F_N / scene.N_x,
            scene.k_top,
            interface.d_c,
        ]
    )
    rows = {name: np.ascontiguousarray(getattr(scene, name)) for name in ("x", "load", "shear")}
    for name, values in {"constants": constants, **rows}.items():
        if not np.isfinite(values).all():
            raise ValueError(f"{name} of the scene are not finite: {values}")
    return Model(
        int(geometry == "finite"),
        int(scene.rigid),
        scene.i_h + 1,
        scene.j_h + 1,
        constants,
        **rows,
    )


def springs(
    scene: Scene, geometry: Geometry, m: float | None = None, *, viscous: bool = False
) -> Model:
    """Return the free lattice, without foundation, loads, driver and rod.

    Args:
        scene: gives the lattice.
        geometry: "linear" or "finite".
        m: mass of a block, in kg; None means the scene's.
        viscous: with the dashpots of the bonds.
    """
    whole = model(scene, geometry, 0.0)
    constants = np.zeros_like(whole.constants)
    constants[:2] = whole.constants[:2]
    constants[2] = scene.eta if viscous else 0.0
    constants[3] = scene.m if m is None else m
    nothing = np.zeros(scene.N_x)
    return whole._replace(rigid=0, constants=constants, load=nothing, shear=nothing)


def room_of_step(N_x: int, switching: Switching) -> tuple[int, int]:
    """Return the most switches and quiet transitions that one step may log (pyfric_location)."""
    return (8 * N_x + 200, 64) if switching == "located" else (N_x, 1)


class Log:
    """Room for switches and quiet transitions that the core fills (see `pyfric.record.catalogue`).

    Attributes:
        tried: steps and sub-steps that the last call computed, also those it did not accept.
        block: where the last call failed, the block, counted from 0, else -1.
        t: and the time, in s.
    """

    def __init__(self, N_x: int, switches: int | None = None, quiet: int = 256) -> None:
        switches = 16 * N_x + 1024 if switches is None else switches
        self.N_x, self.tried, self.block, self.t = N_x, 0, -1, math.nan
        self.switch_i = np.zeros((4, switches), dtype=np.int32, order="F")
        self.switch_r = np.zeros((4, switches), order="F")
        self.quiet_i = np.zeros((N_x + 1, quiet), dtype=np.int32, order="F")
        self.quiet_r = np.zeros((N_x + 3, quiet), order="F")
        self.n_switch = self.n_quiet = 0

    def switches(self) -> dict[str, np.ndarray]:
        """Return the columns of the switch log, as copies."""
        i, r = self.switch_i[:, : self.n_switch], self.switch_r[:, : self.n_switch]
        return {
            "step": r[0].astype(np.int64),
            "block": i[0].astype(np.int64),
            "old": i[1].copy(),
            "new": i[2].copy(),
            "corner": i[3].astype(bool),
            "t": r[1].copy(),
            "u_x": r[2].copy(),
            "p": r[3].copy(),
        }

    def quiet(self) -> dict[str, np.ndarray]:
        """Return the columns of the quiet log, as copies."""
        i, r = self.quiet_i[:, : self.n_quiet], self.quiet_r[:, : self.n_quiet]
        return {
            "step": r[0].astype(np.int64),
            "t": r[1].copy(),
            "kind": i[0].copy(),
            "F_T": r[2].copy(),
            "u_x": r[3:].T.copy(order="C"),
            "mode": i[1:].T.copy(order="C"),
        }


def advance(
    model: Model,
    state: State,
    log: Log,
    n_steps: int,
    *,
    method: Stepper = "rk4",
    switching: Switching = "step_end",
    rtol: float = 1.0,
    budget: bool = True,
    threads: int = 1,
    variant: str = VARIANT,
) -> Status:
    """Make up to n_steps; the state changes in place.

    Args:
        model: from `model`, for the scene the state belongs to.
        state: where to start; on return, where the core stopped (`state.step` counts).
        log: filled from its beginning. Where it could overflow, the core stops early.
        n_steps: steps to make, at least 0.
        method: stepper, one of `STEPPERS`.
        switching: "step_end", or "located": contacts switch inside the step, at the root of what
            makes them switch, and the step is finished from there.
        rtol: for "adaptive": largest error of a sub-step, over F_N/(N_x s) for displacements and
            over F_N/(N_x sqrt(s m)) for velocities, s the largest of k, k_f and k_top.
        budget: integrate works and dissipations.
        threads: threads to use; results do not depend on it.
        variant: build to use; results do not depend on it.

    Returns:
        What ended the call. After `ENDLESS` and `TOO_SHORT` the state lies inside a step and is not
        to be gone on from; `log.block` and `log.t` say where.

    Raises:
        ValueError: arrays do not fit the model, or a number is out of range.
    """
    N_x = len(model.x)
    state.check(N_x)
    room = log.switch_r.shape[1], log.quiet_r.shape[1]
    if log.N_x != N_x or any(
        a < b for a, b in zip(room, room_of_step(N_x, switching), strict=True)
    ):
        raise ValueError(f"log: room for {log.N_x} blocks, expected {N_x}")
    if method not in STEPPERS or switching not in get_args(Switching) or not rtol > 0:
        raise ValueError(f"method = {method!r}, switching = {switching!r}, rtol = {rtol}")
    if not 0 <= n_steps < 2**31:
        raise ValueError(f"n_steps = {n_steps}: must be in 0 … {2**31 - 1}")
    if not 1 <= threads <= 4096:
        raise ValueError(f"threads = {threads}: must be in 1 … 4096")
    step, h = np.array([float(state.step)]), np.array([state.h or state.dt])
    n_log, tried, block, log.t, status = load_variant(variant).advance(
        *model,
        STEPPERS[method],
        int(switching == "located"),
        rtol,
        state.t0,
        state.dt,
        n_steps,
        min(threads, state.y.shape[0]),
        int(budget),
        step,
        h,
        state.y.T,
        state.rod,
        state.mode,
        state.corner,
        state.slack,
        state.loss,
        state.s_0,
        state.dissipated,
        state.heat,
        state.work,
        log.switch_i,
        log.switch_r,
        log.quiet_i,
        log.quiet_r,
    )
    state.step, log.tried, log.block = int(step[0]), int(tried), block - 1
    if method == "adaptive":
        state.h = float(h[0])
    log.n_switch, log.n_quiet = int(n_log[0]), int(n_log[1])
    return Status(status)


class Forces(NamedTuple):
    """One evaluation of the right-hand side, contact states frozen.

    Attributes:
        a: accelerations, shape (N_z, 2, N_x), in m/s^2.
        a_rod: of X, Z (m/s^2) and phi (rad/s^2), shape (3,).
        f: friction force on each bottom block in +x, shape (N_x,), in N.
        p: foundation force, shape (N_x,), in N.
        F_T: driver force, in N.
        dissipated: power in the bonds that start in each row, shape (N_z,), in W.
        heat: friction power of each bottom block, shape (N_x,), in W.
        work: powers of the driver and of the forces on the top (load, shear), shape (2,), in W.
    """

    a: np.ndarray
    a_rod: np.ndarray
    f: np.ndarray
    p: np.ndarray
    F_T: float
    dissipated: np.ndarray
    heat: np.ndarray
    work: np.ndarray


def evaluate(
    model: Model, state: State, t: float, variant: str = VARIANT, n_times: int = 1
) -> Forces:
    """Return all forces at time t (s); the state does not change.

    Args:
        model: from `model`, for the scene the state belongs to.
        state: the state.
        t: time, in s.
        variant: build to use; results do not depend on it.
        n_times: evaluations to make, for timing.

    Raises:
        ValueError: arrays do not fit the model, or n_times is less than 1.
    """
    state.check(len(model.x))
    if not 1 <= n_times < 2**31:
        raise ValueError(f"n_times = {n_times}: must be in 1 … {2**31 - 1}")
    a, *rest = load_variant(variant).evaluate(
        *model, t, n_times, state.y.T, state.rod, state.mode, state.s_0
    )
    return Forces(a.T, *rest)


def bond_forces(scene: Scene, geometry: Geometry) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function from displacements to the forces of all springs on the blocks.

    The function takes u, shape (N_z, 2, N_x) or flat, in m, and returns forces in N in that shape.
    """
    bare, nothing = springs(scene, geometry, 1.0), np.zeros(scene.N_x)  # accelerations are forces
    y, rod = np.zeros((scene.N_z, 4, scene.N_x)), np.zeros(6)
    mode = np.full(scene.N_x, OPEN, dtype=np.int32)

    def forces(u: np.ndarray) -> np.ndarray:
        y[:, :2] = u.reshape(scene.N_z, 2, scene.N_x)
        return _core.evaluate(*bare, 0.0, 1, y.T, rod, mode, nothing)[0].T.reshape(u.shape)

    return forces


def energies(model: Model, state: State, t: float) -> dict[str, float]:
    """Return the energies of a state at time t (s), in J, by the names of `ENERGIES`.

    Raises:
        ValueError: arrays do not fit the model.
    """
    state.check(len(model.x))
    values = _core.energy(*model, t, state.y.T, state.rod)
    return dict(zip(ENERGIES, map(float, values), strict=True))
