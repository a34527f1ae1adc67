"""A scene in the form that the core takes: a vector of integers and a vector of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pyfric.scene import CoulombLaw, Geometry, JunctionLaw, RateStateLaw, check_geometry

if TYPE_CHECKING:
    from pyfric.scene import OnDriven, Scene

CORNER_SHARE = 0.02
"""Normal force, over F_N/N_x, below which a start of slip is a corner episode."""
BEYOND = {"free": 0, "mirrored": 1, "absorbing": 2, "held": 3}
"""Codes of the core for boundary conditions at the sides and the top (pyfric_model in Fortran)."""


class Counts(NamedTuple):
    """Integers that the core takes, in the order of `counts_t` (pyfric_model in Fortran)."""

    nx: int
    nz: int
    finite: int
    rigid: int
    i_h: int
    i_h_end: int
    j_h: int
    j_h_top: int
    prescribed: int
    left: int
    right: int
    top: int
    along: int
    law: int
    n_memory: int
    n_own: int = 0
    n_hold: int = 0
    n_slide: int = 0
    n_speed: int = 0
    n_age: int = 0
    keeps: int = 0
    halved: int = 0


class Constants(NamedTuple):
    """Numbers that the core takes, in SI units, in the order of `constants_t`.

    pyfric_model in Fortran describes each number and its unit.
    """

    l: float
    k: float
    eta: float
    m: float
    F_N: float
    m_rod: float
    i_rod: float
    m_top: float
    i_top: float
    kappa: float
    d: float
    k_drv: float
    v_drv: float
    u_mean: float
    p_corner: float
    k_top: float
    t_seg: float
    x_drv: float
    a_drv: float
    load_rate: float
    shear_rate: float
    g: float = 0.0


OF_BLOCKS = (
    *("x", "load", "shear", "push", "push_rate", "k_f", "gap"),
    *("mu_s", "mu_k", "d_c", "alpha", "bare", "limit", "limit_rate"),
)
"""Names of the numbers that a `Model` has for each block of the interface, in order. From mu_s on,
they are the fields of `CoulombLaw`; other laws have other fields."""


class Model(NamedTuple):
    """A scene in the form that the core takes, from the function `model`.

    Attributes:
        counts: `Counts`, int32.
        numbers: five groups of numbers, one after the other. First, `Constants`. Second, u_drv0 of
            each driven block minus the mean of u_drv0 (m). Third, `OF_BLOCKS`, N_x numbers each: x
            (m), load (p if prescribed) and shear (N), pushes on the bottom row at t_seg (N) and
            their rates (N/s), k_f (N/m), gap (m), and fields of the friction law, with limits of mu
            at t_seg and their rates (1/s). Fourth, other numbers of the law. Fifth, x and y of each
            knot of the law's tables.
    """

    counts: np.ndarray
    numbers: np.ndarray

    @property
    def N_x(self) -> int:
        return int(self.counts[0])

    def drive(self, t: float) -> float:
        """Return the displacement of the driver at t (s) in this piece of the protocol, in m."""
        own = Constants(*self.numbers[: len(Constants._fields)])
        since = t - own.t_seg
        return float(own.x_drv + (own.v_drv + 0.5 * own.a_drv * since) * since)

    @property
    def n_memory(self) -> int:
        """Number of state variables of the friction law for each block."""
        return int(self.counts[Counts._fields.index("n_memory")])

    @property
    def flows(self) -> bool:
        """Whether the law is rate-and-state friction."""
        return bool(self.counts[Counts._fields.index("law")] == RateStateLaw.code)

    @property
    def on_junctions(self) -> bool:
        """Whether the interface consists of junctions."""
        return bool(self.counts[Counts._fields.index("law")] == JunctionLaw.code)


def check_driven(scene: Scene, u_drv0: OnDriven) -> None:
    """Raise ValueError if the shape of u_drv0 does not fit the driven blocks of a scene."""
    expected = () if scene.n_driven == 1 else (scene.n_driven,)
    if np.shape(u_drv0) != expected:
        raise ValueError(
            f"u_drv0: shape {np.shape(u_drv0)}, expected {expected}: the driver pushes "
            f"{scene.n_driven} blocks"
        )


def _packed(counts: Counts, constants: Constants, *rows: Sequence[float] | np.ndarray) -> Model:
    return Model(np.array(counts, dtype=np.int32), np.concatenate([constants, *rows]))


def _counts(scene: Scene, geometry: Geometry) -> Counts:
    return Counts(
        scene.N_x,
        scene.N_z,
        int(geometry == "finite"),
        int(scene.rigid),
        scene.i_h + 1,
        scene.i_h_end + 1,
        scene.j_h + 1,
        scene.j_h_top + 1,
        int(scene.prescribed),
        *(BEYOND[getattr(scene.walls, side)] for side in ("left", "right", "top")),
        int(scene.slider.dashpots == "along"),
        scene.law.code,
        scene.law.memory.itemsize // 8,
        keeps=int(scene.interface.slip_since == "start"),
        halved=int(scene.slider.edges == "half"),
    )


def model(scene: Scene, geometry: Geometry, u_drv0: OnDriven, t: float = 0.0) -> Model:
    """Return the scene in the form that the core takes.

    Args:
        scene: the scene.
        geometry: "linear" or "finite".
        u_drv0: u_x of the driven block at which F_T = 0 at t = 0, in m. For several driven blocks,
            shape (n_driven,), the u_x at which no spring is strained.
        t: a time that selects the piece of the protocols, in s.

    Raises:
        ValueError: unknown geometry, wrong shape of u_drv0, or a derived constant is not finite.
        SceneError: finite geometry for a chain.
    """
    check_geometry(geometry, scene)
    check_driven(scene, u_drv0)
    slider, home = scene.slider, np.atleast_1d(u_drv0)
    i_rod = scene.M_rod * slider.L**2 / 12
    V, F_N, T = (scene.piece(what, t) for what in ("V", "F_N", "T"))
    changing = scene.top.push or scene.interface.limit
    begins = (corner for corner in scene.corners if changing and corner <= t)
    begin = max(V.t, F_N.t, T.t, *begins)
    now = F_N.at(begin)
    constants = Constants(
        l=slider.l,
        k=slider.k,
        eta=scene.eta,
        m=scene.m,
        F_N=now,
        m_rod=scene.M_rod,
        i_rod=i_rod,
        m_top=scene.M_rod + scene.m * np.sum(scene.top_shares),
        i_top=i_rod + scene.m * np.sum(scene.top_shares * scene.x**2),
        kappa=scene.kappa,
        d=scene.d,
        k_drv=scene.driver.K / scene.n_driven,
        v_drv=V.at(begin),
        u_mean=float(np.mean(home)),
        p_corner=CORNER_SHARE * scene.F_N / scene.N_x,
        k_top=scene.k_top,
        t_seg=begin,
        x_drv=V.integral_at(begin),
        a_drv=V.slope,
        load_rate=F_N.slope / now,
        shear_rate=scene.d * T.slope / scene.N_x,
        g=slider.g,
    )
    load = scene.p_prescribed if scene.prescribed else scene.load * (now / scene.F_N)
    shear = scene.shear + scene.d * (T.at(begin) - getattr(scene.top, "T", 0.0)) / scene.N_x
    push = scene.push_at(t, begin)
    rows, n_knots, knots = _interface(scene, t, begin)
    own = [*scene.law.core_numbers.values()]
    counts = _counts(scene, geometry)._replace(n_own=len(own), **n_knots)
    aside = home - constants.u_mean
    packed = _packed(counts, constants, aside, scene.x, load, shear, *push, *rows, own, *knots)
    if not np.isfinite(packed.numbers).all():
        raise ValueError(f"constants of the scene are not finite: {constants}")
    return packed


def _interface(
    scene: Scene, t: float, begin: float
) -> tuple[list[np.ndarray], dict[str, int], list[np.ndarray]]:
    """Return fields of the interface, numbers of knots of the law's tables, and the knots."""
    law, N_x = scene.law, scene.N_x
    fields = (scene.k_f, scene.gap, *law.core_fields(scene.limit_at(t, begin)))
    rows = [np.broadcast_to(np.asarray(field, dtype=float), (N_x,)) for field in fields]
    tables = {name: table for name, table in law.core_tables._asdict().items() if table is not None}
    n_knots = {f"n_{name}": len(table.x) for name, table in tables.items()}
    return rows, n_knots, [np.column_stack([table.x, table.y]).ravel() for table in tables.values()]


def springs(
    scene: Scene, geometry: Geometry, m: float | None = None, *, viscous: bool = False
) -> Model:
    """Return the model of the free lattice, without foundation, loads, driver and rod.

    Args:
        scene: the scene with the lattice.
        geometry: "linear" or "finite".
        m: mass of a block, in kg; None means `scene.m`.
        viscous: whether to include the dashpots of the bonds.
    """
    check_geometry(geometry, scene)
    constants = Constants(*np.zeros(len(Constants._fields)))._replace(
        l=scene.slider.l,
        k=scene.slider.k,
        eta=scene.eta if viscous else 0.0,
        m=scene.m if m is None else m,
    )
    free = {"rigid": 0, "prescribed": 0, "left": 0, "right": 0, "top": 0}
    counts = _counts(scene, geometry)._replace(
        law=CoulombLaw.code, n_memory=CoulombLaw.memory.itemsize // 8, **free
    )
    none = np.zeros(scene.n_driven)
    return _packed(counts, constants, none, scene.x, np.zeros((len(OF_BLOCKS) - 1) * scene.N_x))
