"""The parts of a scene: slider, top boundary, driver, interface.

Symbols and boundaries follow PRL 107, 074301 (2011). Every part, `Material` and `Spread` raise
SceneError if a value is missing, unknown, of the wrong type or out of range.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np

from pyfric.scene.laws import (
    KINDS,
    FrictionLaw,
    LinearWeakening,
    Means,
    Tables,
    check_tables,
)
from pyfric.scene.materials import Material
from pyfric.scene.profile import Profile
from pyfric.scene.protocol import Corners, Protocol, Pushed, Pushes
from pyfric.scene.spread import BLOCKS, FIELD, Field, Spread
from pyfric.values import (
    NotNegative,
    OneOf,
    Positive,
    Quantity,
    SceneError,
    Switches,
    Written,
    annotations,
    from_entries,
    part,
    usage,
)

MAX_BLOCKS = 20_000_000
"""Largest number of blocks N_x N_z. The limit prevents a mistyped l from exhausting the memory."""
MAYBE = {"optional": True, **FIELD}
MULTIPLE_RTOL = 1e-9
"""Relative tolerance of "L, H and h are multiples of l"."""
OPTIONAL = ("gap", "slip", "limit_from")
FIELDS = ("mu_s", "mu_k", "d_c", "alpha", "k_f", *OPTIONAL)
"""Names of the fields of an interface; the `OPTIONAL` fields are rarely given."""
A_LAW = "a friction law, such as pyfric.laws.Ageing, or [interface.law] in a scene file"
CHAIN_NOTE = ", or 0 for a chain under a prescribed load"


A_SLIDER = (
    'Slider, such as Slider.of_material("PMMA", width="6 mm", L="140 mm", H="75 mm", l="2.5 mm")'
)


def steps_in(length: float, l: float) -> int | None:
    """Return length / l if it is a whole number within `MULTIPLE_RTOL`, else None."""
    n = round(length / l)
    return n if abs(length / l - n) <= MULTIPLE_RTOL * n else None


@part
class Slider:
    """The slider: a square lattice of N_x by N_z blocks, or a chain (N_z = 1).

    Args:
        L: length along the interface, m; a multiple of l, at least 2 l.
        H: height, m; a multiple of l, at least l, or 0 for a chain under a `PrescribedLoad`.
        l: lattice constant, m; N_x N_z may not exceed `MAX_BLOCKS`.
        k: stiffness of the nearest-neighbour springs, N/m (3 B E / 4, independent of l).
        M: mass, kg. `replace` and sweeps over L or H leave M as it is: the density changes, and
            with it the wave speeds.
        eta: viscosity of every bond, N s/m, >= 0, independent of l. None means sqrt(damping k m),
            which falls with l.
        damping: eta^2/(k m) if eta is None, >= 0; None means 0.1, as in the paper.
        dashpots: "full", as in the paper: the dashpot of a bond resists the full relative velocity
            of its blocks, including rotation. "along": it resists only the component along the
            bond, so that rotation is free.
        edges: "whole", as in the paper: M/(N_x N_z) in each block and springs of full stiffness
            along the edges. "half": blocks along free edges are half blocks, quarters in corners,
            with half of the mass, half of the stiffness of springs along the edge, and half of the
            foundation and the loads of a column. Mass and stiffness then converge to second order
            in l. In a chain both end blocks are half blocks. "half" needs linear geometry, no
            driven top and no junctions.
        g: gravity, m/s^2, >= 0, downward on all blocks and the rod, in addition to F_N. In setup 1
            9.81 m/s^2 adds 4e-4 F_N, half of it the weight of the rod.

    Source: PRL 107, 074301 (2011), model section.
    """

    L: Annotated[float, Positive("m")]
    H: Annotated[float, NotNegative("m")]
    l: Annotated[float, Positive("m")]
    k: Annotated[float, Positive("N/m")]
    M: Annotated[float, Positive("kg")]
    eta: Annotated[float | None, NotNegative("N s/m", optional=True)] = None
    damping: Annotated[float | None, NotNegative("", optional=True)] = None
    dashpots: Literal["full", "along"] = "full"
    edges: Literal["whole", "half"] = "whole"
    g: Annotated[float, NotNegative("m/s^2")] = 0.0

    _section: ClassVar[str] = "slider"
    _elsewhere: ClassVar[dict[str, str]] = dict.fromkeys(
        ("E", "nu", "rho", "density", "B", "width", "viscosity", "material"),
        "k and M; Slider.of_material(E=..., density=..., width=..., L=..., H=..., l=...) finds "
        "them from a material. Poisson's ratio is 1/3, or 1/4 with plane='strain', in this lattice",
    )

    @classmethod
    @usage('of_material("PMMA", width="6 mm", L="140 mm", H="75 mm", l="2.5 mm")')
    def of_material(
        cls,
        name: str | Material = "",
        *,
        width: float | str | None = None,
        E: float | str | None = None,
        density: float | str | None = None,
        viscosity: float | str | None = None,
        plane: str = "stress",
        **fields: Any,
    ) -> Self:
        """Return a slab of a material: k = 3 B E/4 and M = rho B L H; see `Material`.

        Blocks at the edges are whole blocks, so that M/(N_x N_z) is less than rho B l^2. Waves are
        therefore faster than in the material, by the factor sqrt((1 + l/L)(1 + l/H)). With
        edges="half" waves are as fast as in the material.

        Args:
            name: a key of `pyfric.MATERIALS`, for values that are not given, or a `Material`.
            width, E, density, viscosity, plane: see `Material`. `dashpots` decides which waves
                decay at the rate of the viscosity.
            **fields: L, H, l and other fields of the slider, except k and M.

        >>> slab = {"L": "140 mm", "H": "75 mm", "l": "2.5 mm"}
        >>> pyfric.Slider.of_material(E="3 GPa", width="6 mm", density=1200.0, **slab).k
        13500000.0
        """
        values = {"width": width, "E": E, "density": density, "viscosity": viscosity}
        given = {key: value for key, value in values.items() if value is not None}
        given |= {} if plane == "stress" else {"plane": plane}
        for field in ("L", "H", "l"):
            if field not in fields:
                raise SceneError(f"slider.{field}", None, "m", A_SLIDER, "missing")
        material = name
        if not isinstance(material, Material):
            material = Material(name=material, **given)
        elif given:
            material = dataclasses.replace(material, **given)
        return cls._of(material, fields)

    @classmethod
    def _of(cls, material: Material, fields: Mapping[str, Any]) -> Self:
        for name in ("k", "M", *(("eta",) if material.viscosity is not None else ())):
            if name in fields:
                reason = "given by the material"
                value = getattr(fields[name], "value", fields[name])
                raise SceneError(f"slider.{name}", value, "", "one of both", reason)
        slab = cls(k=material.k, M=1.0, **fields)
        if not slab.H:
            raise SceneError("slider.H", slab.H, "m", "> 0 m", "a slab has a height")
        M = material.density * material.width * slab.L * slab.H
        eta = material.eta(slab.dashpots)
        return dataclasses.replace(slab, M=M, **({} if eta is None else {"eta": eta}))

    @classmethod
    def from_file(cls, entries: Mapping[str, Any], folder: Path | None) -> Self:
        """Return the slider that a table of a scene file describes, possibly by its material."""
        if "material" not in entries:
            return from_entries(cls, entries, folder)
        material = OneOf(Material).check(entries["material"], Written(entries))
        marks = annotations(cls)
        rest = {n: Written(v) if n in marks else v for n, v in entries.items() if n != "material"}
        return cls._of(material, rest)

    def __post_init__(self) -> None:
        errors = []
        if self.eta is not None and self.damping is not None:
            raise SceneError("slider.damping", self.damping, "", "None", "eta is given, too")
        blocks = (round(self.L / self.l) + 1) * (round(self.H / self.l) + 1)
        if blocks > MAX_BLOCKS:
            allowed = f"a length in m that gives at most {MAX_BLOCKS} blocks"
            raise SceneError("slider.l", self.l, "m", allowed, f"{blocks:.3g} blocks")
        for name, length, least, note in (("L", self.L, 2, ""), ("H", self.H, 0, CHAIN_NOTE)):
            steps = steps_in(length, self.l)
            if steps is None or steps < least:
                n = least or 1
                allowed = f"a multiple of l = {self.l!r} m, >= {n} l = {n * self.l!r} m{note}"
                reason = "too small" if steps is not None else "not a multiple of l"
                errors.append(SceneError(f"slider.{name}", length, "m", allowed, reason))
        if errors:
            raise SceneError.joined(errors)

    @property
    def N_x(self) -> int:
        """Number of columns, L/l + 1."""
        return round(self.L / self.l) + 1

    @property
    def N_z(self) -> int:
        """Number of rows, H/l + 1."""
        return round(self.H / self.l) + 1

    @property
    def m(self) -> float:
        """Mass of a whole block in kg: M / (N_x N_z), or M l^2 / (L H) with half blocks."""
        if self.edges == "whole":
            return self.M / (self.N_x * self.N_z)
        return self.M / ((self.N_x - 1) * max(self.N_z - 1, 1))


class Top:
    """Base class of top boundaries, without rod, springs, shear forces and protocols."""

    mass = mattress = T = 0.0
    k_top = V_top = None
    protocol = T_protocol = push = ()

    _section: ClassVar[str] = "top"

    if TYPE_CHECKING:
        F_N: float  # not for a prescribed load
    else:

        def __getattr__(self, name: str) -> Any:
            hint = "; scene.F_N is the normal force of any scene" * (name == "F_N")
            text = f"{type(self).__name__} has no {name!r}{hint}"
            raise AttributeError(text, name=name, obj=self)


@part
class Rod(Top):
    """Top boundary of setup 1: the top row is glued to a rigid rod that can tilt.

    Args:
        F_N: normal force at the centre of the rod, N, > 0.
        mass: mass of the rod without the top blocks, kg, >= 0.
        mattress: total stiffness of the spring mattress that resists the tilt, N/m, >= 0.
        protocol: breakpoints (t, F_N) of a changing normal force, in s and N, > 0; see `Driver`.
        push: forces in the drive direction on blocks of the interface; see `PrescribedLoad`.

    F_N = 0 is refused, because F_N is the unit of force and presses the blocks into contact.

    Source: PRL 107, 074301 (2011), setup 1.
    """

    F_N: Annotated[float, Positive("N")]
    mass: Annotated[float, NotNegative("kg")] = 0.0756
    mattress: Annotated[float, NotNegative("N/m")] = 0.4e6
    protocol: Annotated[Corners, Protocol("N", gt=0.0)] = ()
    push: Annotated[Pushed, Pushes()] = ()

    kind: ClassVar[str] = "rod"


@part
class DistributedLoad(Top):
    """Top boundary of setup 2: a free top row under vertical forces.

    The block with number n from the trailing edge carries
    (F_N/N_x) (1 + theta (2n - N_x - 1)/(N_x - 1)), downward.

    Args:
        F_N: total normal force, N, > 0.
        theta: slope of the load, in [-1, 1]; positive means little load on the trailing edge.
        T: total shear force in the drive direction, spread evenly over the top blocks, N.
        protocol: breakpoints (t, F_N) of a changing normal force, in s and N, > 0; see `Driver`.
        T_protocol: breakpoints (t, T) of a changing shear force, in s and N.
        push: forces in the drive direction on blocks of the interface; see `PrescribedLoad`.
        k_top: shear stiffness between each block of the top row and a plate, N/m, >= 0; the springs
            are relaxed at u_x = 0, before F_N is applied. None means 0.
        V_top: speed of this plate in the drive direction, m/s; None means 0. The plate is a second
            drive: its force is a part of T, not of F_T.

    F_N = 0 is refused, because F_N is the unit of force and presses the blocks into contact.

    Source: PRL 107, 074301 (2011), setup 2.
    """

    F_N: Annotated[float, Positive("N")]
    theta: Annotated[float, Quantity("", ge=-1.0, le=1.0)] = 0.0
    T: Annotated[float, Quantity("N")] = 0.0
    protocol: Annotated[Corners, Protocol("N", gt=0.0)] = ()
    T_protocol: Annotated[Corners, Protocol("N")] = ()
    push: Annotated[Pushed, Pushes()] = ()
    k_top: Annotated[float | None, NotNegative("N/m", optional=True)] = None
    V_top: Annotated[float | None, Quantity("m/s", optional=True)] = None

    kind: ClassVar[str] = "distributed"


@part
class PrescribedLoad(Top):
    """A prescribed interface: given forces on its blocks.

    Sequences have N_x numbers, from the trailing edge on; they become tuples. A block of the bottom
    row has a constant normal force p_i. A constant force tau_i acts on it in the drive direction;
    friction balances this force at t = 0. The geometry is linear. Displacements count from t = 0.

    In a chain (N_z = 1), k_top times the displacement pulls each block back. In two dimensions
    (N_z > 1) there is no foundation: p_i only sets friction, and the bottom row moves freely along
    z, like the surface of one half of a symmetric body under shear. The bottom row is a plane of
    symmetry. Its blocks therefore have the mass m/2, and its springs and dashpots half of their
    strength. With whole blocks the surface would be too heavy by l/2, and fronts too slow. `Walls`
    defines the other boundaries. |tau_i| may exceed mu_s p_i; such blocks slip from t = 0 on.

    Args:
        p: normal force on each block, N, > 0; one number or a sequence of N_x.
        tau: friction force on each block at t = 0, N, positive against the drive direction; one
            number or a sequence of N_x. In a chain |tau_i| <= mu_s p_i.
        k_top: shear stiffness between each block of a chain and a rigid top, N/m, >= 0.
        V_top: speed of the rigid top; see `DistributedLoad`.
        push: additional forces in the drive direction that start slip. Each push is a block number,
            a force (N), and optionally start and end times (s) and a growth rate (N/s). Examples:
            ((1, 0.2),) without end, ((1, 0.2, 0.0, 1e-3),) for 1 ms, ((1, 0.0, 0.0, inf, 50.0),)
            for a ramp. With tau, a push has to exceed the strength of its block.

    Source: D. S. Amundsen et al., Phys. Rev. E 92, 032406 (2015), fronts in a chain with
    prescribed stresses.
    """

    p: Annotated[float | tuple[float, ...], Positive("N", **BLOCKS)]
    tau: Annotated[float | tuple[float, ...], Quantity("N", **BLOCKS)] = 0.0
    k_top: Annotated[float, NotNegative("N/m")] = 0.0
    push: Annotated[Pushed, Pushes()] = ()
    V_top: Annotated[float | None, Quantity("m/s", optional=True)] = None

    kind: ClassVar[str] = "prescribed"


@part
class Walls:
    """Boundary conditions at the sides and the top of a slider on a prescribed interface.

    "free": no forces. "mirrored": the slider continues half a bond further as its image, with the
    same u_x and the opposite u_z. On a side, the image is the other half of a shear crack that
    starts there. On the top, the image has a second interface under the same forces. "absorbing":
    dashpots on half blocks, with the impedances of plane waves, rho c_P along the normal and rho
    c_S across it. In a corner of two absorbing walls only rho c_P acts. At an absorbing side the
    end block has half of p and tau. "held": the top row does not move.

    Energies, work and heat are those of the blocks of the scene, without images. Energy absorbed by
    walls is part of the energy dissipated in bonds. The column `radiated` has the absorbed energy
    alone.

    Args:
        left, right: "free", "mirrored" or "absorbing".
        top: "free", "held", "mirrored" or "absorbing".

    Raises:
        SceneError: a value is unknown.

    Source: J. Lysmer, R. L. Kuhlemeyer, J. Eng. Mech. Div. ASCE 95, 859 (1969), for dashpots.
    """

    left: Literal["free", "mirrored", "absorbing"] = "free"
    right: Literal["free", "mirrored", "absorbing"] = "free"
    top: Literal["free", "held", "mirrored", "absorbing"] = "free"

    _section: ClassVar[str] = "walls"

    @property
    def absorb(self) -> bool:
        """Whether a side or the top absorbs waves."""
        return "absorbing" in (self.left, self.right, self.top)


@part
class Driver:
    """The springs that push or pull a side or the top; their far end moves at a given speed.

    The spring pushes the block at height h. With h_top, a rigid plate pushes all n blocks from h to
    h_top by springs of stiffness K/n, which are relaxed after F_N is applied. With side "top", each
    of the N_x top blocks, or blocks of a chain, has a spring of stiffness K/N_x to a moving plate.
    F_T = K (X - x_h), with X the displacement of the far end and x_h the mean displacement of the
    driven blocks.

    The speed is V, or changes linearly from (0, V) through the breakpoints of a protocol, and is
    constant after the last breakpoint. Two breakpoints at the same time are a jump:
    ((1, V), (1, 0), (2, 0), (2, V)) is a hold of one second. Negative speeds reverse the driver.
    Time steps end at breakpoints.

    Args:
        K: stiffness, N/m, > 0, or 0 for no driver on a prescribed interface.
        V: speed of the far end at t = 0, m/s, >= 0 (0 holds the driver); towards the slider, or
            away from a side that is pulled.
        h: height of the driven block above the interface, or of the plate's lower edge, m; a
            multiple of l, l <= h <= H; H on the top; 0 in a chain.
        side: "left" or "right", the side that is pushed (the trailing edge); "pull left" or "pull
            right", the side that is pulled; or "top", whose plate moves to the right. Blocks are
            numbered from the driven side; on the top, from the left.
        protocol: breakpoints (t, V) of a changing speed, in s (in order) and m/s.
        h_top: height of the plate's upper edge, m; a multiple of l, h <= h_top <= H. None means
            one driven block.

    Source: PRL 107, 074301 (2011), F_T = K (V t - x_h), for one block.
    """

    K: Annotated[float, NotNegative("N/m")]
    V: Annotated[float, NotNegative("m/s")]
    h: Annotated[float, NotNegative("m", note=", a multiple of l up to H")]
    side: Literal["left", "right", "pull left", "pull right", "top"] = "left"
    protocol: Annotated[Corners, Protocol("m/s")] = ()
    h_top: Annotated[
        float | None, NotNegative("m", optional=True, note=", a multiple of l from h to H")
    ] = None

    _section: ClassVar[str] = "driver"

    @property
    def fastest(self) -> float:
        """Largest speed in either direction, in m/s."""
        return max([self.V, *(abs(V) for _, V in self.protocol)])


@part
class Interface:
    """The frictional interface under the bottom row.

    Args:
        mu_s: static friction coefficient, >= 0; None means the first mu of a law that is a table.
        mu_k: kinetic friction coefficient, 0 <= mu_k <= mu_s; None means the last mu of the table.
        k_f: stiffness of the elastic foundation per block, N/m, > 0; None means k.
        d_c: slip over which friction weakens, m, >= 0; 0 is Amontons-Coulomb friction.
        alpha: viscosity of slip, N s/m, >= 0: a slipping block has the additional force alpha v.
        law: dependence of friction on slip, time and speed; see `pyfric.laws`. The default weakens
            linearly over d_c.
        gap: height of the undeformed bottom over the foundation, m, >= 0; None means 0. A block
            carries p = k_f (-u_z - gap) if this value is positive.
        contact: whether blocks can touch the foundation: True or False, or N_x such values from the
            trailing edge on. None means True.
        slip: initial slip along the drive, m; may be negative. Blocks stick after this slip, and
            the slider above is in equilibrium. None means 0.
        limit: breakpoints (t, mu), in s and >= 0, of the largest friction coefficient, whether a
            block sticks or slips. The limit is linear between breakpoints and constant after the
            last breakpoint. There is no limit before the first breakpoint.
        limit_from: time from which t of `limit` counts, s, >= 0; inf for blocks without limit. None
            means 0.
        slip_since: "stick": the slip of the law counts from the last stick on. "start": the slip
            counts from the start of the run, so that friction of slipping blocks stays weakened.
            Stuck blocks still bear mu_s p.

    mu_s, mu_k, k_f, d_c, alpha, gap, slip and limit_from are fields: a number, N_x numbers from the
    trailing edge on, a `Spread`, or a `Profile`. A table with the key "file" stands for the profile
    in this file.

    With limit = ((0, mu_s), (t_0, mu_k)) friction weakens over slip or over the time t_0 after
    `limit_from`, whichever is sooner, as in the forced ruptures of the SCEC benchmarks. Blocks
    whose |tau| exceeds mu_s p after a given slip begin to slip at t = 0.

    A block without contact is a part of the free surface. A block with mu_s = 0 and alpha = 0
    carries p and moves freely along the interface; records show it as open. Blocks of both kinds
    neither stick nor slip, and take no part in events.

    With the default law, a block that has slipped by s since it last stuck resists with mu(s) p,
    mu(s) = mu_s - (mu_s - mu_k) min(s/d_c, 1). If slip reverses without sticking, s continues to
    grow. Weakening acts as a negative stiffness of magnitude (mu_s - mu_k) p/d_c. If the slider is
    stiffer, slip is stable and follows the driver, until the slipping zone is too long. Steps
    resolve weakening if dt sqrt((mu_s - mu_k) p/(m d_c)) is below 1, with p = F_N/N_x; otherwise
    the record carries a note.

    Source: PRL 107, 074301 (2011), interface law, and its remark on slip weakening; R. A. Harris et
    al., Seismol. Res. Lett. 89, 1146 (2018), benchmarks with forced rupture.
    """

    mu_s: Annotated[Field, NotNegative("", optional=True, **FIELD)] = None  # set by __post_init__
    mu_k: Annotated[Field, NotNegative("", optional=True, **FIELD)] = None
    k_f: Annotated[Field | None, Positive("N/m", optional=True, **FIELD)] = None
    d_c: Annotated[Field, NotNegative("m", **FIELD)] = 0.0
    alpha: Annotated[Field, NotNegative("N s/m", **FIELD)] = 0.0
    law: Annotated[FrictionLaw, OneOf(FrictionLaw, kinds=KINDS, allowed=A_LAW)] = LinearWeakening()
    gap: Annotated[Field | None, NotNegative("m", optional=True, **FIELD)] = None
    contact: Annotated[bool | tuple[bool, ...] | None, Switches()] = None
    slip: Annotated[Field | None, Quantity("m", **MAYBE)] = None
    limit: Annotated[Corners, Protocol("", ge=0.0)] = ()
    limit_from: Annotated[Field | None, NotNegative("s", endless=True, **MAYBE)] = None
    slip_since: Literal["stick", "start"] = "stick"

    _section: ClassVar[str] = "interface"

    def __post_init__(self) -> None:
        missing, ends = [], self.law.ends() or (None, None)
        for name, end in zip(("mu_s", "mu_k"), ends, strict=True):
            if getattr(self, name) is None and end is None:
                allowed = annotations(Interface)[name].allowed
                missing.append(SceneError(f"interface.{name}", None, "", allowed, "missing"))
            elif getattr(self, name) is None:
                object.__setattr__(self, name, end)
        if missing:
            raise SceneError.joined(missing)
        check_tables(self.tables)

    def coulomb(self) -> Self:
        """Return the interface with Amontons-Coulomb friction, as used for static states."""
        plain = {"law": LinearWeakening(), "d_c": 0.0, "alpha": 0.0}
        plain |= {"limit": (), "limit_from": None, "slip_since": "stick"}
        return dataclasses.replace(self, **plain)

    @property
    def tables(self) -> Tables:
        """Tables of the friction law for the means of mu_s, mu_k and d_c."""
        return self.law.tables(Means(*map(_mean, (self.mu_s, self.mu_k, self.d_c))))


def _mean(field: Field) -> float:
    """Return the mean of a field, or 0 for an empty list, which the scene refuses."""
    if isinstance(field, Spread | Profile):
        return field.mean
    return 0.0 if field == () else float(np.mean(field))


PARTS = {
    "slider": OneOf(Slider, allowed=A_SLIDER),
    "top": OneOf(Rod, DistributedLoad, PrescribedLoad),
    "driver": OneOf(Driver),
    "interface": OneOf(Interface),
    "walls": OneOf(Walls),
}
"""Names of the parts of a scene, and their classes."""
