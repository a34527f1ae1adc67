"""What follows from the parts of a scene: blocks, springs, friction, loads, path of the driver."""

import functools
import math
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from pyfric.scene.ends import Conditions
from pyfric.scene.friction import Law
from pyfric.scene.parts import (
    FIELDS,
    OPTIONAL,
    PARTS,
    DistributedLoad,
    Driver,
    Interface,
    PrescribedLoad,
    Rod,
    Slider,
    Walls,
)
from pyfric.scene.protocol import Leg, Piece, legs, piece_at, pieces
from pyfric.scene.restless import WITHOUT_REST
from pyfric.values import Name, naming, part

OnDriven = float | np.ndarray
"""A number for one driven block, or an array for several."""
NO_LIMIT = float(np.finfo(float).max)
"""Limit of the friction coefficient of a block that has none."""
MAX_NAME = 200
"""Largest number of characters in the name of a scene."""


@part
class Composed:
    """The parts of a scene, and what follows from them; see `Scene`."""

    slider: Annotated[Slider, PARTS["slider"]]
    top: Annotated[Rod | DistributedLoad | PrescribedLoad, PARTS["top"]]
    driver: Annotated[Driver, PARTS["driver"]]
    interface: Annotated[Interface, PARTS["interface"]]
    name: Annotated[str, Name(MAX_NAME)] = ""
    walls: Annotated[Walls, PARTS["walls"]] = Walls()
    stop_when: Annotated[tuple[str, ...], Conditions()] = ()

    _section: ClassVar[str] = ""

    @property
    def N_x(self) -> int:
        """Number of columns, L/l + 1."""
        return self.slider.N_x

    @property
    def N_z(self) -> int:
        """Number of rows, H/l + 1."""
        return self.slider.N_z

    @property
    def m(self) -> float:
        """Mass of one block, M / (N_x N_z), in kg."""
        return self.slider.m

    @property
    def m_interface(self) -> float:
        """Mass of a block of the bottom row, in kg: m, or m/2 where it consists of half blocks."""
        return self.m * float(self.shares[0][0])

    @property
    def resolving_step(self) -> float:
        """Longest step that resolves weakening, in s (`Law.resolving_step`)."""
        return self.law.resolving_step(self.F_N / self.N_x, self.m_interface)

    @functools.cached_property
    def shares(self) -> tuple[np.ndarray, np.ndarray]:
        """Share of whole blocks in each row, shape (N_z,), and in each column, shape (N_x,).

        It is 1, or 1/2 along a prescribed interface, along absorbing walls and, if the slider has
        half blocks, along all edges that are not mirrored. The share of a block is the product of
        both. Bonds along such a row or column have half of their strength.
        """
        rows, columns = np.ones(self.N_z), np.ones(self.N_x)
        half = self.slider.edges == "half"
        cut = ("absorbing", "free", "held") if half else ("absorbing",)
        ends = [("left", columns, 0), ("right", columns, -1), ("top", rows, -1)]
        for name, of, end in ends[: 3 if self.N_z > 1 else 2]:
            if getattr(self.walls, name) in cut:
                of[end] = 0.5
        if self.prescribed or (half and self.N_z > 1):
            rows[0] = 0.5
        return rows, columns

    @property
    def top_shares(self) -> np.ndarray:
        """Share of whole blocks in the top row, shape (N_x,)."""
        return self.shares[0][-1] * self.shares[1]

    @functools.cached_property
    def weights(self) -> np.ndarray:
        """Weights of the blocks, shape (N_z, N_x), in N."""
        return self.m * self.slider.g * np.outer(*self.shares)

    @property
    def pressing(self) -> float:
        """What the interface carries at rest, in N: F_N and the weights of blocks and rod."""
        return self.F_N + float(self.weights.sum()) + self.M_rod * self.slider.g

    @property
    def eta(self) -> float:
        """Viscosity of every bond in N s/m; by default sqrt(0.1 k m)."""
        given, damping = self.slider.eta, self.slider.damping
        damping = 0.1 if damping is None else damping
        return math.sqrt(damping * self.slider.k * self.m) if given is None else given

    @functools.cached_property
    def k_f(self) -> float | np.ndarray:
        """Stiffness of the foundation per block in N/m, by default k.

        A number, or an array from left to right, shape (N_x,). It is 0 under blocks without
        contact, and for a prescribed interface in two dimensions, which has no foundation.
        """
        if self.prescribed:
            return 0.0
        given = self.given_field("k_f")
        if self.slider.edges == "half":
            given = given * self.shares[1]
        return given if self.touches.all() else np.where(self.touches, given, 0.0)

    @functools.cached_property
    def touches(self) -> np.ndarray:
        """Blocks that can touch the foundation, left to right, shape (N_x,), bool."""
        given = self.interface.contact
        return self._by_column(True if given is None else given)

    @functools.cached_property
    def gap(self) -> float | np.ndarray:
        """Height of the undeformed blocks over the foundation, a number or (N_x,), in m."""
        return 0.0 if self.interface.gap is None else self.given_field("gap")

    @functools.cached_property
    def home(self) -> np.ndarray:
        """Positions u_x of the blocks at which they stick at the start, shape (N_x,), in m."""
        slip = self.interface.slip
        return np.zeros(self.N_x) if slip is None else self.d * self.field("slip")

    @functools.cached_property
    def bare(self) -> np.ndarray:
        """Blocks that can touch the foundation, but have no friction, shape (N_x,), bool."""
        return self.touches & self.law.bare

    @property
    def whole(self) -> bool:
        """True if all blocks can touch the foundation, without gaps, and have friction."""
        return bool(self.touches.all() and not np.any(self.gap) and not self.bare.any())

    @functools.cached_property
    def law(self) -> Law:
        """The friction law; its fields are numbers, or arrays of shape (N_x,), left to right."""
        if (own := WITHOUT_REST.get(type(self.interface.law))) is not None:
            V, p = self.piece("V", 0.0).at(0.0), self.F_N / self.N_x
            return own.of(self.interface.law, self.given_field, p, V)
        tables = self.interface.tables
        mu_s, mu_k, d_c, alpha = map(self.given_field, ("mu_s", "mu_k", "d_c", "alpha"))
        if np.any(alpha) and self.shares[1].min() < 1:
            alpha = alpha * self.shares[1]
        if tables.slide is not None and not np.any(d_c):
            d_c = 1.0  # the table is over slip in m
        return Law(mu_s, mu_k, d_c, alpha, tables)

    def field(self, name: str) -> np.ndarray:
        """Return a field of the interface, left to right, shape (N_x,).

        Args:
            name: "mu_s", "mu_k", "d_c" (m), "alpha" (N s/m), "k_f" (N/m), "gap" (m), "slip" (m) or
                "limit_from" (s), or a field of the friction law.
        """
        return np.broadcast_to(np.asarray(self.given_field(name), dtype=float), (self.N_x,))

    def interface_on(self, N_x: int) -> Interface:
        """Return the interface of the same slider with N_x blocks.

        Fields are interpolated, and those drawn in space stay as they are; alpha of a block is
        proportional to its length. A block touches the foundation where the nearest one did.
        """
        at, now = np.linspace(0, 1, N_x), np.linspace(0, 1, self.N_x)
        order = np.argsort(self.n_of_i)
        new = {
            name: tuple(np.interp(at, now, self.field(name)[order]).tolist())
            for name in self.fields
            if not isinstance(given := self._given(name), float | None)
            and (name == "alpha" or not getattr(given, "in_space", False))
        }
        law = {name: new.pop(name) for name in self.interface.law.fields if name in new}
        share = (self.N_x - 1) / (N_x - 1)
        alpha = np.multiply(new.get("alpha", self.interface.alpha), share).tolist()
        new["alpha"] = tuple(alpha) if isinstance(alpha, list) else alpha
        if isinstance(given := self.interface.contact, tuple):
            nearest = np.rint(at * (self.N_x - 1)).astype(int)
            new["contact"] = tuple(given[n] for n in nearest.tolist())
        return replace(self.interface, law=replace(self.interface.law, **law), **new)

    @functools.cached_property
    def drawn(self) -> dict[str, tuple[float, ...]]:
        """Values of fields that are a `Spread` or a `Profile`, from the trailing edge on."""
        given = {name: self._given(name) for name in self.fields}
        spreads = {name: field for name, field in given.items() if hasattr(field, "draw")}
        found, coefficient = {}, self.interface.law.coefficient
        for name, spread in spreads.items():
            stream = coefficient if coefficient and name in ("mu_s", "mu_k") else name
            with naming(f"{self._owner(name)._section}.{name}", type(spread).__name__):
                found[name] = tuple(spread.draw(self.N_x, self.slider.l, stream).tolist())
        return found

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields that may vary along the interface."""
        given = (n for n in (*OPTIONAL, *self.interface.law.fields) if self._given(n) is not None)
        return (*FIELDS[: -len(OPTIONAL)], *given)

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the fields that vary along the interface."""
        return tuple(
            name for name in self.fields if self.field(name).min() < self.field(name).max()
        )

    def _given(self, name: str) -> Any:
        """Return a field as given in the interface or its friction law."""
        return getattr(self._owner(name), name)

    def _owner(self, name: str) -> Any:
        """Return the interface, or its friction law if that has the field."""
        return self.interface if name in FIELDS else self.interface.law

    def given_field(self, name: str) -> float | np.ndarray:
        """Return a field as a number, or as an array from left to right."""
        given = self._given(name)
        given = self.slider.k if given is None else given
        if isinstance(given, float):
            return given
        found = self._by_column(self.drawn.get(name, given))
        found.flags.writeable = False
        return found

    @functools.cached_property
    def F_N(self) -> float:
        """Total normal force in N."""
        prescribed = isinstance(self.top, PrescribedLoad)
        return math.fsum(self.p_prescribed) if prescribed else self.top.F_N

    @property
    def d(self) -> int:
        """Direction of the drive: +1 (pushed from the left, pulled at the right, or from the top)
        or -1."""
        return -1 if self.driver.side in ("right", "pull left") else 1

    @property
    def ahead(self) -> int:
        """Direction in which blocks are numbered: +1 from the left, -1 from a driven right side."""
        return -1 if self.driver.side in ("right", "pull right") else 1

    def driver_force(self, drive: float, u_h: OnDriven, u_drv0: OnDriven) -> float:
        """Return F_T = K (drive - d (u_h - u_drv0)) in N.

        Args:
            drive: displacement V t of the driver since t = 0, in m.
            u_h: u_x of the driven blocks, as `u_driven` returns it, or their mean, in m.
            u_drv0: value of u_h at which drive = 0 gives F_T = 0, in m.
        """
        return float(self.driver.K * (drive - self.d * np.mean(u_h - u_drv0)))

    def u_driven(self, u: np.ndarray) -> OnDriven:
        """Return u_x of the driven block, or of several, row by row, (n_driven,), in m.

        Args:
            u: displacements, or a state, shape (N_z, 2 or 4, N_x), in m.
        """
        if self.n_driven == 1:
            return float(u[self.j_h, 0, self.i_h])
        return u[self.driven].ravel()

    @property
    def driven(self) -> tuple[slice, int, slice]:
        """Index of u_x of the driven blocks in u, shape (N_z, 2 or 4, N_x)."""
        return slice(self.j_h, self.j_h_top + 1), 0, slice(self.i_h, self.i_h_end + 1)

    @functools.cached_property
    def corners(self) -> tuple[float, ...]:
        """Times of the breakpoints of protocols and pushes, in s, in order."""
        lists = self.driver.protocol, self.top.protocol, self.top.T_protocol
        times = {t for corners in lists for t, _ in corners}
        times |= {t + t_0 for t, _ in self.interface.limit for t_0 in self._limits_from.tolist()}
        times |= {t for push in self.top.push for t in (push.begin, push.end)}
        return tuple(sorted(t for t in times if 0 < t < math.inf))

    @functools.cached_property
    def _pieces(self) -> dict[str, list[Piece]]:
        rate = self.N_x * self.k_top * self.V_top
        return {
            "V": pieces(self.driver.V, self.driver.protocol),
            "F_N": pieces(self.F_N, self.top.protocol),
            "T": [piece.plus(rate) for piece in pieces(self.top.T, self.top.T_protocol)],
        }

    def piece(self, what: Literal["V", "F_N", "T"], t: float) -> Piece:
        """Return the piece of a protocol that begins at or before t (s): V, F_N or T."""
        return piece_at(self._pieces[what], t)

    @functools.cached_property
    def _limits_from(self) -> np.ndarray:
        """Times from which the limits of friction count, left to right, shape (N_x,), in s."""
        given = self.interface.limit_from
        return np.zeros(self.N_x) if given is None else self.field("limit_from")

    def limit_at(self, t: float, now: float | None = None) -> np.ndarray:
        """Return the largest friction coefficients of the blocks, left to right, and their rates.

        Args:
            t: time that selects the pieces of `Interface.limit`, in s.
            now: time at which they are evaluated, in s; None means t.

        Returns:
            Coefficients, `NO_LIMIT` where there is none, and rates (1/s), shape (2, N_x).
        """
        found = np.array([np.full(self.N_x, NO_LIMIT), np.zeros(self.N_x)])
        if not (corners := self.interface.limit):
            return found
        times, mu = np.array(corners).T
        lasts = np.diff(times, append=np.inf)
        slopes = np.divide(np.diff(mu, append=mu[-1]), lasts, out=0 * mu, where=lasts > 0)
        begins = times[:, None] + self._limits_from  # rounded like `corners`
        n = np.sum(t >= begins, axis=0) - 1
        on = np.flatnonzero(n >= 0)
        n, since = n[on], (t if now is None else now) - begins[n[on], on]
        found[:, on] = mu[n] + slopes[n] * since, slopes[n]
        return found

    def load_at(self, t: float) -> tuple[float, float] | None:
        """Return F_N and T (N) at t (s), or None if no protocol changes them."""
        if not (self.top.protocol or self.top.T_protocol or self.V_top):
            return None
        return self.piece("F_N", t).at(t), self.piece("T", t).at(t)

    def legs(self, t_end: float) -> list[Leg]:
        """Return the intervals up to t_end (s) in which the driver moves in one direction."""
        return legs(self._pieces["V"], t_end)

    def drive(self, t: float) -> float:
        """Return the displacement of the driver from 0 to t (s), in m: V t if V is constant."""
        return self.piece("V", t).integral_at(t)

    @property
    def i_h(self) -> int:
        """First column of driven blocks, counted from 0: 0 or N_x - 1."""
        return 0 if self.ahead > 0 else self.N_x - 1

    @property
    def i_h_end(self) -> int:
        """Last column of driven blocks, counted from 0."""
        return self.N_x - 1 if self.driver.side == "top" else self.i_h

    @property
    def j_h(self) -> int:
        """Row of the (lowest) driven block, counted from 0 at the bottom: h / l."""
        return round(self.driver.h / self.slider.l)

    @property
    def j_h_top(self) -> int:
        """Row of the highest driven block, counted from 0 at the bottom: h_top / l."""
        top = self.driver.h_top
        return self.j_h if top is None else round(top / self.slider.l)

    @property
    def n_driven(self) -> int:
        """Number of driven blocks, 1 for a spring at a side without a plate."""
        return (self.j_h_top - self.j_h + 1) * (self.i_h_end - self.i_h + 1)

    @functools.cached_property
    def x(self) -> np.ndarray:
        """Reference positions of the columns from the centre, shape (N_x,), in m."""
        x = (np.arange(self.N_x) - (self.N_x - 1) / 2) * self.slider.l
        x.flags.writeable = False
        return x

    @property
    def n_of_i(self) -> np.ndarray:
        """Block numbers from the trailing edge (1 … N_x), left to right, shape (N_x,), int."""
        n = np.arange(1, self.N_x + 1)
        return n if self.ahead > 0 else n[::-1].copy()

    @property
    def load(self) -> np.ndarray:
        """Downward forces on the top blocks, left to right, shape (N_x,), in N.

        They are 0 for a rod, and for a prescribed interface in two dimensions.
        """
        if self.rigid or self.prescribed:
            return np.zeros(self.N_x)
        if isinstance(self.top, PrescribedLoad):
            return self.p_prescribed
        slope = (2 * self.n_of_i - self.N_x - 1) / (self.N_x - 1)
        columns = self.shares[1]
        return self.F_N / columns.sum() * (1 + self.top.theta * slope) * columns

    @property
    def shear(self) -> np.ndarray:
        """Forces in +x on blocks of row j_shear at t = 0, left to right, shape (N_x,), in N.

        They are d tau_i for a `PrescribedLoad`, and d T/N_x for a `DistributedLoad`. A half block
        at a side has half of this force.
        """
        prescribed, columns = isinstance(self.top, PrescribedLoad), self.shares[1].sum()
        tau = self.top.tau if prescribed else self.top.T / columns
        return self.d * self._by_column(tau) * self.shares[1] + 0.0  # no -0.0

    def push_at(self, t: float, now: float | None = None) -> np.ndarray:
        """Return the pushes on the bottom blocks along +x, left to right, and their rates.

        Args:
            t: time that selects the active pushes, in s.
            now: time at which they are evaluated, in s; None means t.

        Returns:
            Forces (N) and their rates (N/s), shape (2, N_x).
        """
        found = np.zeros((2, self.N_x))
        for push in self.top.push:
            if push.begin <= t < push.end:
                found[:, push.block - 1] += push.at(t if now is None else now), push.rate
        return self.d * found[:, self.n_of_i - 1] + 0.0  # no -0.0

    @property
    def j_shear(self) -> int:
        """Row on which `shear` acts, counted from 0 at the bottom."""
        return 0 if self.prescribed else self.N_z - 1

    @property
    def prescribed(self) -> bool:
        """True if the interface is prescribed in two dimensions: p is given, no foundation."""
        return isinstance(self.top, PrescribedLoad) and self.N_z > 1

    @property
    def has_rests(self) -> bool:
        """True if the driver leads to static states other than the start, for any friction law."""
        return not (self.prescribed or self.top.push or self.driver.K == 0)

    @property
    def p_prescribed(self) -> np.ndarray:
        """Prescribed p of the bottom blocks, left to right, shape (N_x,), in N.

        It is 0 without a `PrescribedLoad`. A half block at a side has half of p.
        """
        if not isinstance(self.top, PrescribedLoad):
            return np.zeros(self.N_x)
        return self._by_column(self.top.p) * self.shares[1]

    def _by_column(self, values: Any) -> np.ndarray:
        """Return values given from the trailing edge on as an array from left to right."""
        if isinstance(values, tuple):
            return np.array(values)[self.n_of_i - 1]
        return np.full(self.N_x, values)

    @property
    def k_top(self) -> float:
        """Stiffness between each block of a chain, or of a free top, and a plate, in N/m."""
        return self.top.k_top or 0.0

    @property
    def V_top(self) -> float:
        """Speed of that plate in the drive direction, in m/s; its displacement loads as T."""
        return self.top.V_top or 0.0

    @property
    def rigid(self) -> bool:
        """True if the top row is glued to a rod (setup 1)."""
        return isinstance(self.top, Rod)

    @property
    def M_rod(self) -> float:
        """Mass of the rod in kg; 0 without a rod."""
        return self.top.mass

    @property
    def kappa(self) -> float:
        """Torque of the mattress per tilt, mattress L^2 / 12, in N m; 0 without a rod."""
        return self.top.mattress * self.slider.L**2 / 12
