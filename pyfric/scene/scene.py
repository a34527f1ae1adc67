"""Scenes: what is simulated, checked on construction, in SI units.

A scene is a slider on a frictional interface, loaded from above and pushed from one side.
Source of the model, the symbols and the presets: J. Trømborg, J. Scheibert, D. S. Amundsen,
K. Thøgersen, A. Malthe-Sørenssen, Phys. Rev. Lett. 107, 074301 (2011), "the paper" below.

Every refusal, whatever its origin, is a `SceneError`.
"""

import functools
import math
import os
from collections.abc import Mapping
from dataclasses import InitVar
from typing import Any, ClassVar, Literal, Self

import numpy as np

from pyfric.display import html
from pyfric.scene import toml
from pyfric.scene.change import changed
from pyfric.scene.checked import part, quantities
from pyfric.scene.files import write
from pyfric.scene.friction import Law
from pyfric.scene.junctions import JunctionLaw
from pyfric.scene.parts import (
    CHAIN_NOTE,
    FIELDS,
    DistributedLoad,
    Driver,
    Interface,
    PrescribedLoad,
    Rod,
    Slider,
    Walls,
    steps_in,
)
from pyfric.scene.protocol import Leg, Piece, legs, piece_at, pieces
from pyfric.scene.spread import Spread
from pyfric.scene.text import scene_text
from pyfric.scene.units import SceneError

__all__ = ["Scene"]

MAX_NAME = 200
"""Largest number of characters in the name of a scene."""


@part
class Scene:
    """What is simulated: slider, top boundary, driver, interface, walls. Immutable and hashable.

    Args:
        slider: a `Slider`.
        top: a `Rod` (setup 1), a `DistributedLoad` (setup 2) or a `PrescribedLoad` (a chain, or a
            prescribed interface in two dimensions).
        driver: a `Driver`; its h must be on a row of the slider above the bottom one, or 0 for a
            chain.
        interface: an `Interface`.
        name: free text of at most `MAX_NAME` characters.
        walls: what is beyond sides and top of a slider on a prescribed interface, `Walls`.
        draws: names of fields that are a `Spread` to what had been drawn, N_x numbers each from the
            trailing edge on, so that it is not drawn again; kept beside the scene by records.

    Raises:
        SceneError: a part is missing, unknown or of the wrong type, h is not on a row, prescribed
            forces do not fit the blocks, or walls or parts do not go together.

    `replace` changes values; all checks are repeated.
    Arrays run along the interface from the leftmost block to the rightmost one.

    Source: PRL 107, 074301 (2011).
    """

    slider: Slider
    top: Rod | DistributedLoad | PrescribedLoad
    driver: Driver
    interface: Interface
    name: str = ""
    walls: Walls = Walls()
    draws: InitVar[Mapping[str, Any] | None] = None

    _section: ClassVar[str] = ""
    _allowed: ClassVar[dict[str, str]] = {
        "slider": "a Slider",
        "top": "a Rod, a DistributedLoad or a PrescribedLoad",
        "driver": "a Driver",
        "interface": "an Interface",
        "name": f"text of at most {MAX_NAME} characters",
        "walls": "Walls",
    }

    def __post_init__(self, draws: Mapping[str, Any] | None) -> None:
        object.__setattr__(self, "_draws", {})
        self._know(draws or {})
        encodable = self.name.encode("utf-8", "replace").decode() == self.name
        if len(self.name) > MAX_NAME or not encodable:
            allowed = self._allowed["name"]
            raise SceneError("name", self.name, "", allowed, "too long or not UTF-8")
        self._check_fields()
        if isinstance(self.top, PrescribedLoad):
            self._check_prescribed()
        if isinstance(self.top, PrescribedLoad) and self.N_z == 1:
            return
        h, l, H = self.driver.h, self.slider.l, self.slider.H
        if self.N_z == 1:
            allowed = f"a multiple of l = {l!r} m, >= l{CHAIN_NOTE}"
            reason = f"too small where top.kind = {self.top.kind!r}"
            raise SceneError("slider.H", H, "m", allowed, reason)
        steps = steps_in(h, l)
        if steps is None or not 1 <= steps < self.slider.N_z:
            allowed = f"a multiple of l = {l!r} m, from l to H = {H!r} m"
            reason = "not on a row" if steps is None else "not on a row that can be driven"
            raise SceneError("driver.h", h, "m", allowed, reason)
        self._check_walls()

    def _know(self, draws: Mapping[str, Any]) -> None:
        """Take over draws of fields."""
        for name, values in draws.items():
            known = np.asarray(values, dtype=float)
            known_name = name in (*FIELDS, *self.interface.law.fields)
            drawn = known_name and isinstance(self._given(name), Spread)
            if not (drawn and known.shape == (self.N_x,) and np.isfinite(known).all()):
                allowed = f"{self.N_x} finite numbers for a field that is a Spread"
                raise SceneError(f"draws.{name}", values, "", allowed)
            self._draws[name] = tuple(known.tolist())

    def _check_fields(self) -> None:
        """Check the fields of the interface block by block, from the trailing edge on."""
        law = self.interface.law
        marks = quantities(Interface) | {n: quantities(type(law))[n] for n in law.fields}
        for name, mark in marks.items():
            given = self._given(name)
            if given is None and name in law.fields:
                continue
            if isinstance(given, tuple) and len(given) != self.N_x:
                allowed = f"{mark.allowed}: here {self.N_x}"
                reason = f"{len(given)} numbers"
                raise SceneError(f"interface.{name}", given, mark.unit, allowed, reason)
            field = self.field(name)
            low = (field < 0) | ((field == 0) & (mark.gt is not None))
            if isinstance(given, Spread) and low.any():
                n = int(self.n_of_i[np.argmax(low)])
                reason = f"the spread reaches this at block {n} from the trailing edge"
                value = float(field[low][0])
                raise SceneError(f"interface.{name}", value, mark.unit, mark.allowed, reason)
        mu_s, mu_k = self.field("mu_s"), self.field("mu_k")
        above = mu_k > mu_s
        if above.any():
            i = int(np.argmax(above))
            allowed = f"0 <= mu_k <= mu_s = {float(mu_s[i])!r} there"
            reason = f"mu_k exceeds mu_s at block {self.n_of_i[i]} from the trailing edge"
            raise SceneError("interface.mu_k", float(mu_k[i]), "", allowed, reason)
        if not law.rests:
            JunctionLaw.of(self)

    def _check_walls(self) -> None:
        """Refuse what only a prescribed interface in two dimensions has, or does not have."""
        if not self.prescribed:
            for side in ("left", "right", "top"):
                if (beyond := getattr(self.walls, side)) != "free":
                    reason = "walls need top.kind = 'prescribed' and at least two rows"
                    raise SceneError(f"walls.{side}", beyond, "", "'free'", reason)
            if self.driver.K == 0:
                reason = "only a prescribed interface in two dimensions goes without a driver"
                raise SceneError("driver.K", 0.0, "N/m", "> 0 N/m", reason)
            return
        if self.top.k_top:
            reason = "a chain has springs to a rigid top; here walls.top = 'held'"
            raise SceneError("top.k_top", self.top.k_top, "N/m", "0 N/m", reason)
        if self.interface.k_f is not None:
            reason = "a prescribed interface has no foundation"
            raise SceneError("interface.k_f", self.interface.k_f, "N/m", "None", reason)
        if self.walls.top == "held" and self.j_h == self.N_z - 1:
            h, most = self.driver.h, (self.N_z - 2) * self.slider.l
            raise SceneError("driver.h", h, "m", f"at most {most!r} m", "the top row is held")

    def _check_prescribed(self) -> None:
        top = self.top
        if self.N_z == 1:
            self._check_walls()
            if self.driver.h:
                reason = "a chain is driven at its only row"
                raise SceneError("driver.h", self.driver.h, "m", "0 m", reason)
        for name in ("p", "tau"):
            value = getattr(top, name)
            if isinstance(value, tuple) and len(value) != self.N_x:
                allowed = f"one number in N, or {self.N_x} of them, one for each block"
                raise SceneError(f"top.{name}", value, "N", allowed, f"{len(value)} numbers")
        if self.prescribed:  # blocks that carry more than mu_s p slip from t = 0 on
            return
        p, tau = np.atleast_1d(top.p), np.atleast_1d(top.tau)
        most, tau = np.broadcast_arrays(self.law.hold(p), tau)
        margin = most - np.abs(tau)
        if (margin < 0).any():
            i = int(np.argmax(margin < 0))
            allowed = f"|tau| <= mu_s p = {float(most[i])!r} N"
            reason = f"block {i + 1} from the trailing edge would slip"
            raise SceneError("top.tau", float(tau[i]), "N", allowed, reason)

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
        """Mass of a block of the bottom row, in kg: m, or m/2 on a prescribed interface."""
        return self.m / 2 if self.prescribed else self.m

    @property
    def eta(self) -> float:
        """Viscosity of every bond in N s/m; sqrt(0.1 k m) unless the slider sets it."""
        given = self.slider.eta
        return math.sqrt(0.1 * self.slider.k * self.m) if given is None else given

    @functools.cached_property
    def k_f(self) -> float | np.ndarray:
        """Stiffness of the foundation per block in N/m; k unless the interface sets it.

        A number, or one for each column, left to right, shape (N_x,); 0 for a prescribed interface
        in two dimensions, which has none.
        """
        if self.prescribed:
            return 0.0
        return self.given_field("k_f")

    @functools.cached_property
    def law(self) -> Law:
        """The friction law; its fields are numbers, or arrays of shape (N_x,), left to right."""
        if not self.interface.law.rests:
            return JunctionLaw.of(self)
        tables = self.interface.tables
        mu_s, mu_k, d_c, alpha = map(self.given_field, ("mu_s", "mu_k", "d_c", "alpha"))
        if tables.slide is not None and not np.any(d_c):
            d_c = 1.0  # the table is over slip in m
        return Law(mu_s, mu_k, d_c, alpha, tables)

    def field(self, name: str) -> np.ndarray:
        """Return a field of the interface, left to right, shape (N_x,).

        Args:
            name: "mu_s", "mu_k", "d_c" (m), "alpha" (N s/m) or "k_f" (N/m); or one of the friction
                law's own.
        """
        return np.broadcast_to(np.asarray(self.given_field(name), dtype=float), (self.N_x,))

    @property
    def drawn(self) -> dict[str, tuple[float, ...]]:
        """What was drawn for fields that are a `Spread`, from the trailing edge on."""
        spreads = [one for one in self.fields if isinstance(self._given(one), Spread)]
        return {name: self._draw(name) for name in spreads}

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of what may vary along the interface."""
        own = self.interface.law.fields
        return (*FIELDS, *(name for name in own if self._given(name) is not None))

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the fields that vary along the interface."""
        return tuple(name for name in self.fields if np.ptp(self.field(name)) > 0)

    def _given(self, name: str) -> Any:
        """Return a field as the interface or its friction law says it."""
        return getattr(self.interface if name in FIELDS else self.interface.law, name)

    def given_field(self, name: str) -> float | np.ndarray:
        """Return a field as a number, or as an array from left to right."""
        given = self._given(name)
        given = self.slider.k if given is None else given
        if isinstance(given, float):
            return given
        found = self._by_column(self._draw(name) if isinstance(given, Spread) else given)
        found.flags.writeable = False
        return found

    def _draw(self, name: str) -> tuple[float, ...]:
        """Return what was drawn for a field; it is drawn once."""
        if name not in self._draws:
            values = self._given(name).draw(self.N_x, self.slider.l)
            self._draws[name] = tuple(values.tolist())
        return self._draws[name]

    @property
    def F_N(self) -> float:
        """Total normal force in N."""
        if isinstance(self.top, PrescribedLoad):
            p = self.top.p
            return math.fsum(p) if isinstance(p, tuple) else self.N_x * p
        return self.top.F_N

    @property
    def d(self) -> int:
        """Direction of driving: +1 (pushed from the left) or -1 (from the right)."""
        return 1 if self.driver.side == "left" else -1

    def driver_force(self, drive: float, u_h: float, u_drv0: float) -> float:
        """Return F_T = K (drive - d (u_h - u_drv0)) in N.

        Args:
            drive: displacement V t of the driver since t = 0, in m.
            u_h: u_x of the driven block, in m.
            u_drv0: the same where drive = 0 gives F_T = 0, in m.
        """
        return float(self.driver.K * (drive - self.d * (u_h - u_drv0)))

    @functools.cached_property
    def corners(self) -> tuple[float, ...]:
        """Times at which a protocol has a corner, in s, in order."""
        lists = [self.driver.protocol, getattr(self.top, "protocol", ())]
        lists.append(getattr(self.top, "T_protocol", ()))
        return tuple(sorted({t for corners in lists for t, _ in corners if t > 0}))

    @property
    def follows_protocol(self) -> bool:
        """True if speed, normal force or shear force change with time."""
        top = self.top
        both = getattr(top, "protocol", ()), getattr(top, "T_protocol", ())
        return bool(self.driver.protocol or any(both))

    @functools.cached_property
    def _courses(self) -> dict[str, list[Piece]]:
        top = self.top
        return {
            "V": pieces(self.driver.V, self.driver.protocol),
            "F_N": pieces(self.F_N, getattr(top, "protocol", ())),
            "T": pieces(getattr(top, "T", 0.0), getattr(top, "T_protocol", ())),
        }

    def piece(self, what: Literal["V", "F_N", "T"], t: float) -> Piece:
        """Return the piece of a protocol that begins at or before t (s): V, F_N or T."""
        return piece_at(self._courses[what], t)

    def load_at(self, t: float) -> tuple[float, float] | None:
        """Return F_N and T (N) at t (s), None where a protocol changes neither."""
        top = self.top
        if not (getattr(top, "protocol", ()) or getattr(top, "T_protocol", ())):
            return None
        return self.piece("F_N", t).at(t), self.piece("T", t).at(t)

    def legs(self, t_end: float) -> list[Leg]:
        """Return the stretches of time up to t_end (s) in which the driver moves one way."""
        return legs(self._courses["V"], t_end)

    def drive(self, t: float) -> float:
        """Return the displacement of the driver at t (s) since t = 0, in m: V t where V stays."""
        return self.piece("V", t).integral_at(t)

    @property
    def i_h(self) -> int:
        """Column of the driven block, counted from 0: 0 or N_x - 1."""
        return 0 if self.driver.side == "left" else self.N_x - 1

    @property
    def j_h(self) -> int:
        """Row of the driven block, counted from 0 at the bottom: h / l."""
        return round(self.driver.h / self.slider.l)

    @property
    def x(self) -> np.ndarray:
        """Reference positions of the columns from the centre, shape (N_x,), in m."""
        return (np.arange(self.N_x) - (self.N_x - 1) / 2) * self.slider.l

    @property
    def n_of_i(self) -> np.ndarray:
        """Block numbers from the trailing edge (1 … N_x), left to right, shape (N_x,), int."""
        n = np.arange(1, self.N_x + 1)
        return n if self.driver.side == "left" else n[::-1].copy()

    @property
    def load(self) -> np.ndarray:
        """Downward forces on the top blocks, left to right, shape (N_x,), in N.

        0 for a rod, and for a prescribed interface in two dimensions.
        """
        if self.rigid or self.prescribed:
            return np.zeros(self.N_x)
        if isinstance(self.top, PrescribedLoad):
            return self._by_column(self.top.p)
        slope = (2 * self.n_of_i - self.N_x - 1) / (self.N_x - 1)
        return self.F_N / self.N_x * (1 + self.top.theta * slope)

    @property
    def shear(self) -> np.ndarray:
        """Forces in +x on blocks of row j_shear, left to right, shape (N_x,), in N, at t = 0.

        d tau_i for a `PrescribedLoad`, d T/N_x for a `DistributedLoad`.
        """
        if isinstance(self.top, DistributedLoad) and self.top.T:
            return np.full(self.N_x, self.d * self.top.T / self.N_x)
        if not isinstance(self.top, PrescribedLoad):
            return np.zeros(self.N_x)
        return self.d * self._by_column(self.top.tau) + 0.0  # no -0.0

    @property
    def j_shear(self) -> int:
        """Row on which `shear` acts, counted from 0 at the bottom."""
        return 0 if self.prescribed else self.N_z - 1

    @property
    def prescribed(self) -> bool:
        """True if the interface is prescribed in two dimensions: p is given, no foundation."""
        return isinstance(self.top, PrescribedLoad) and self.N_z > 1

    @property
    def p_prescribed(self) -> np.ndarray:
        """Given p of the bottom blocks, left to right, shape (N_x,), in N; 0 where there is none.

        It is that of a `PrescribedLoad`.
        """
        if not isinstance(self.top, PrescribedLoad):
            return np.zeros(self.N_x)
        return self._by_column(self.top.p)

    def _by_column(self, values: float | tuple[float, ...]) -> np.ndarray:
        """Return numbers that run from the trailing edge as an array from left to right."""
        if isinstance(values, tuple):
            return np.array(values)[self.n_of_i - 1]
        return np.full(self.N_x, values)

    @property
    def k_top(self) -> float:
        """Stiffness that holds each top block of a chain at u_x = 0, its place at t = 0, in N/m."""
        return self.top.k_top if isinstance(self.top, PrescribedLoad) else 0.0

    @property
    def rigid(self) -> bool:
        """True if the top row is glued to a rod (setup 1)."""
        return isinstance(self.top, Rod)

    @property
    def M_rod(self) -> float:
        """Mass of the rod in kg; 0 without a rod."""
        return self.top.mass if isinstance(self.top, Rod) else 0.0

    @property
    def kappa(self) -> float:
        """Torque of the mattress per tilt, mattress L^2 / 12, in N m; 0 without a rod."""
        return self.top.mattress * self.slider.L**2 / 12 if isinstance(self.top, Rod) else 0.0

    def __repr__(self) -> str:
        return scene_text(self)

    def _repr_html_(self) -> str:
        return html(self)

    def replace(self, changes: Mapping[str, Any] | None = None, /, **keywords: Any) -> Self:
        """Return the scene with other values; all checks are repeated.

        Args:
            changes: names of fields to values: "driver.h", or "h" where one part alone has it;
                a part as a whole; "name". A value is a number in SI units, text with a unit such
                as "5 mm", or a quantity of a library of units, such as pint.
            **keywords: the same, for names without a dot.

        Raises:
            SceneError: a name is unknown or in several parts, or a value is refused.

        >>> pyfric.preset("fig1").replace({"driver.h": "7.5 mm"}, mu_s=0.6).driver.h
        0.0075
        """
        return changed(self, {**(changes or {}), **keywords})

    def to_toml(self, path: str | os.PathLike[str] | None = None) -> str:
        """Return the scene as TOML; with `path`, also write it to that file in one step.

        Quantities are written in SI units with all digits: `from_toml` gives an equal scene,
        bit for bit. Values left at None are left out.

        Raises:
            OSError: the file cannot be written; an existing file is then unchanged.
        """
        parts = self.slider, self.top, self.driver, self.interface, self.walls
        text = toml.text(self.name, [part for part in parts if part != Walls()])
        if path is not None:
            write(path, text.encode())
        return text

    @classmethod
    def from_toml(
        cls, source: str | os.PathLike[str], *, draws: Mapping[str, Any] | None = None
    ) -> Self:
        """Return the scene in a TOML file or text.

        Args:
            source: path of a file, or the TOML text itself. A string with a line break is
                taken as text, any other one as a path.
            draws: see `Scene`.

        Quantities are text with a unit, such as "5 mm"; any unit of the right dimension will
        do. Pure numbers (mu_s, mu_k, theta) are bare numbers. A table `[top]` has
        kind = "rod", "distributed" or "prescribed"; in the last one, p and tau may be lists.

        Raises:
            SceneError: the file cannot be read, is not TOML or larger than 1 MiB, or anything in
                it is missing, unknown, without or with a wrong unit, or out of range. All problems
                found are listed.
        """
        found, errors = toml.read(source)
        if not errors:
            return cls(**found, draws=draws)
        name = found["name"]
        if not isinstance(name, str):
            errors.append(SceneError("name", name, "", cls._allowed["name"], "not text"))
        raise SceneError.joined(errors)
