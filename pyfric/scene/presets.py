"""Scenes by name: scenes of the paper, a chain, a slab on a prescribed interface, a benchmark.

Source: PRL 107, 074301 (2011).
"""

import dataclasses
import math
import os
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypedDict, Unpack

from pyfric.scene.change import changed, full_name, joined, once, scene_fields
from pyfric.scene.laws import FrictionLaw, Junctions, RateAndState
from pyfric.scene.parts import (
    PARTS,
    DistributedLoad,
    Driver,
    Interface,
    PrescribedLoad,
    Rod,
    Slider,
    Walls,
)
from pyfric.scene.profile import Profile
from pyfric.scene.scene import Scene
from pyfric.scene.spread import Spread
from pyfric.values import GO_ON, SceneError, check_number, naming, unknown, usage

Number = float | str
"""A number in SI units, text with a unit such as "5 mm", or a quantity of a unit library."""
Numbers = Number | Sequence[Number]
Field = Numbers | Spread | Profile
Corners = Sequence[tuple[Number, Number]]


class Fields(TypedDict, total=False):
    """Keyword arguments of `preset`, `setup1` and so on: fields of a scene with unique names."""

    L: Number
    H: Number
    l: Number
    k: Number
    M: Number | None
    eta: Number | None
    damping: float | None
    dashpots: Literal["full", "along"]
    edges: Literal["whole", "half"]
    g: Number
    F_N: Number
    mass: Number
    mattress: Number
    theta: float
    T: Number
    T_protocol: Corners
    p: Numbers
    tau: Numbers
    k_top: Number | None
    V_top: Number | None
    push: Any
    K: Number
    V: Number
    h: Number
    h_top: Number | None
    side: Literal["left", "right", "pull left", "pull right", "top"]
    mu_s: Field | None
    mu_k: Field | None
    k_f: Field | None
    d_c: Field
    alpha: Field
    gap: Field | None
    contact: bool | Sequence[bool] | None
    slip: Field | None
    limit: Corners
    limit_from: Field | None
    slip_since: Literal["stick", "start"]
    law: FrictionLaw
    left: Literal["free", "mirrored", "absorbing"]
    right: Literal["free", "mirrored", "absorbing"]
    slider: Slider
    top: Rod | DistributedLoad | PrescribedLoad
    driver: Driver
    interface: Interface
    walls: Walls
    name: str
    stop_when: str | Sequence[str]


SETTABLE = tuple(Fields.__annotations__)
"""Names of all fields of all kinds of scenes."""
Changes = Mapping[str, Any] | None
"""Names of fields to values; a name that several parts share needs its part: "driver.protocol"."""
Rule = Callable[[Slider], Any]
"""Function that computes a default value from the slider."""

_PAPER = Interface(mu_s=0.7, mu_k=0.45)
_SETUP1 = Scene(
    slider=Slider(L=0.14, H=0.075, l=2.5e-3, k=13.5e6, M=0.0756),
    top=Rod(F_N=3500.0),
    driver=Driver(K=4e6, V=0.7875e-3, h=5e-3),
    interface=_PAPER,
    name="setup1",
)
_SETUP2 = Scene(
    slider=Slider(L=0.1, H=0.02, l=1e-3, k=9.375e6, M=0.012),
    top=DistributedLoad(F_N=400.0),
    driver=Driver(K=0.8e6, V=0.45e-3, h=2e-3),
    interface=_PAPER,
    name="setup2",
)
_SLOW = Scene(
    slider=Slider(L=0.14, H=0.075, l=2.5e-3, k=13.5e6, M=0.0756),
    top=Rod(F_N=1920.0),
    driver=Driver(K=4e6, V=0.4e-3, h=5e-3),
    interface=Interface(
        mu_s=0.4,
        mu_k=0.17,
        k_f=6.75e6,
        law=Junctions(
            n_s=100, u_s=0.4 * math.sqrt(1920.0 / 57 / (100 * 39.2e9)), t_R=2e-3, t_R_std=0.6e-3
        ),
    ),
    name="slow",
)
_RATED = Scene(
    slider=Slider(L=0.14, H=0.075, l=2.5e-3, k=13.5e6, M=0.0756),
    top=Rod(F_N=3500.0),
    driver=Driver(K=4e6, V=4e-4, h=5e-3),
    interface=Interface(law=RateAndState(a=0.01, b=0.015, D_c=2e-7)),
    name="rate_and_state",
)
_RATED_PMMA = Scene(
    slider=_RATED.slider,
    top=_RATED.top,
    driver=_RATED.driver,
    interface=Interface(
        law=RateAndState(a=0.005, b=0.0214, D_c=5e-7, f_star=0.49, V_star=1e-7, V_c=5e-7 / 3.3e-4)
    ),
    name="rate_and_state_pmma",
)
_CHAIN = Scene(
    slider=Slider(L=0.14, H=0.0, l=2.5e-3, k=5.4e8, M=0.0756),
    top=PrescribedLoad(p=3500.0 / 57),
    driver=Driver(K=4e6, V=0.7875e-3, h=0.0),
    interface=_PAPER,
    name="chain",
)

_PULLED = Scene(
    slider=Slider(L=0.2475, H=0.0, l=2.5e-3, k=5.4e8, M=0.0756 * 0.2475 / 0.14),
    top=PrescribedLoad(p=3500.0 / 57),
    driver=Driver(K=1.35e10, V=1e-8, h=0.0, side="top"),
    interface=Interface(mu_s=Spread(mean=0.7, range=0.2, seed=3), mu_k=0.4),
    name="burridge_knopoff",
)


def _mass(slider: Slider) -> float:
    """Return the mass at the density of the paper's setup 1, 0.54 kg/m, in kg."""
    return 0.0756 * (slider.L / 0.14)


def _lands(slider: Slider) -> tuple[bool, ...]:
    """Return whether each block is on a land of 10 mm, not in a groove of 10 mm, (N_x,)."""
    return tuple(int(n * slider.l / 10e-3 + 1e-9) % 2 == 0 for n in range(slider.N_x))


def _waves(slider: Slider) -> tuple[float, ...]:
    """Return gaps (m) with a wavelength of 35 mm and a height of 20 um from crest to trough."""
    wave = 2 * math.pi * slider.l / 35e-3
    return tuple(10e-6 * (1 - math.cos(wave * n)) for n in range(slider.N_x))


def _made(base: Scene, given: Mapping[str, Any], **rules: Rule) -> Scene:
    """Return a scene with changes; `rules`, named like slider_M, compute fields left out."""
    for part in given.keys() & PARTS:
        with naming(part):
            PARTS[part].check(given[part])
    parts = {part: given.get(part, getattr(base, part)) for part in PARTS}
    given = once((full_name(parts, n, v), v) for n, v in given.items())
    named = {name.replace("_", ".", 1): rule for name, rule in rules.items()}
    given = {n: v for n, v in given.items() if n not in named or v is not None}
    named = {n: rule for n, rule in named.items() if n.partition(".")[0] not in given}
    size = {n.partition(".")[2]: v for n, v in given.items() if n.startswith("slider.")}
    slider = dataclasses.replace(parts["slider"], **size)
    try:
        return changed(base, {n: rule(slider) for n, rule in named.items()} | given)
    except SceneError as error:
        field = error.field
        if not given or error.others or "." not in field:
            raise
        if any(field == name or field.startswith(f"{name}.") for name in given):
            raise
        reason = f"{error.reason}; {field} is that of the preset: set it, too"
        raise SceneError(field, error.value, error.unit, error.allowed, reason) from None


def setup1(changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return setup 1 of the paper, its top row glued to a rigid rod, with changes.

    L = 140 mm, H = 75 mm, l = 2.5 mm, k = 13.5 MN/m, M = 75.6 g, F_N = 3500 N, K = 4 MN/m,
    V = 0.7875 mm/s, h = 5 mm, mu_s = 0.7, mu_k = 0.45. If l is changed, k = 3 B E / 4 stays the
    same, and the block mass follows from M / (N_x N_z).

    If L is changed and M is not given, M is 0.54 kg/m times L, which is 108 g at L = 200 mm. The
    caption of the paper gives 75.6 g. This mass leads to the paper's wave speeds (1677 and 968 m/s)
    only at L = 140 mm; therefore the density stays the same. M=0.0756 gives the mass of the caption
    at every L. If H is changed and M is not given, M stays, and the density changes; records say
    so.

    Changes and errors are those of `preset`.

    Source: PRL 107, 074301 (2011), Fig. 1 and its caption.
    """
    return _made(_SETUP1, joined(changes, fields), slider_M=_mass)


def slow(changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return setup 1 on an interface of junctions, with fronts as slow as 1 % of c_S.

    L = 140 mm, H = 75 mm, l = 2.5 mm, k = 13.5 MN/m, M = 75.6 g, F_N = 1920 N, K = 4 MN/m,
    V = 0.4 mm/s, h = 5 mm, mu_s = 0.4, mu_k = 0.17, and k_f = k/2 by default. Each block has 100
    junctions with u_s = 1.17 um, which corresponds to C = 39.2 GN/m^2. Junctions slip for 2 ms,
    with a standard deviation of 0.6 ms. n_s, u_s, t_R and other parameters of
    `pyfric.laws.Junctions` can be changed by name, too. If n_s is changed, u_s stays the same.

    Changes and errors are those of `preset`.

    Source: J. Trømborg et al., Proc. Natl. Acad. Sci. 111, 8764 (2014).
    """
    given = joined(changes, fields)
    return _made(_SLOW, given, slider_M=_mass, interface_k_f=lambda slider: slider.k / 2)


def rate_and_state(changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return setup 1 with rate-and-state friction of rock.

    L = 140 mm, H = 75 mm, l = 2.5 mm, k = 13.5 MN/m, M = 75.6 g, F_N = 3500 N, K = 4 MN/m, h = 5 mm
    as in `setup1`, V = 0.4 mm/s. a = 0.01, b = 0.015, f* = 0.6 and V* = 1 um/s are the values of
    the velocity-weakening part of the benchmark problem BP1. BP1 has D_c = 8 mm. Here D_c is 0.2
    um, so that weakening acts over four blocks and precursors grow. Parameters of
    `pyfric.laws.RateAndState` can be changed by name, too.

    Changes and errors are those of `preset`.

    Source: B. A. Erickson et al., Seismol. Res. Lett. 91, 874 (2020), problem BP1.
    """
    return _made(_RATED, joined(changes, fields), slider_M=_mass)


def rate_and_state_pmma(changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return setup 1 with rate-and-state friction of PMMA.

    Values of the test of cRacklet for PMMA: a = 0.005, b = 0.075 f_0 = 0.0214 with f_0 = 0.285, D_c
    = 0.5 um, V* = 0.1 um/s. The test has f = f_0 + a ln(1 + v/V*) + b ln(1 + theta/phi*) with phi*
    = 0.33 ms, so that f* = f_0 + b ln(D_c/(V* phi*)) = 0.49, and steady friction rises again near
    the cut-off speed V_c = D_c/phi* = 1.5 mm/s. Other values are those of `rate_and_state`.
    Parameters of `pyfric.laws.RateAndState` can be changed by name, too.

    Changes and errors are those of `preset`.

    Source: T. Roch et al., J. Open Source Softw. 7, 3724 (2022), test_rate_and_state_PMMA.
    """
    return _made(_RATED_PMMA, joined(changes, fields), slider_M=_mass)


def grooves(changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return setup 1 with grooves across its interface: lands of 10 mm and grooves of 10 mm.

    Blocks less than 10 mm, or 20 to 30 mm and so on, from the trailing edge touch the substrate. l
    should divide 10 mm. All other blocks have no contact and bear no load. Blocks with mu_s = mu_k
    = 0 would bear load without friction. The default l is 2.5 mm; other values are those of
    `setup1`.

    Changes and errors are those of `preset`.
    """
    return _made(_SETUP1, joined(changes, fields), slider_M=_mass, interface_contact=_lands)


def wavy(changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return setup 1 on a wavy interface, g(x) = 10 um (1 - cos(2 pi x/35 mm)).

    x is the distance from the trailing edge, which is a crest. Under F_N = 3500 N blocks between
    crests do not touch the substrate. Other values are those of `setup1`.

    Changes and errors are those of `preset`.
    """
    return _made(_SETUP1, joined(changes, fields), slider_M=_mass, interface_gap=_waves)


def setup2(changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return setup 2 of the paper: a free top row under a distributed load of slope theta.

    L = 100 mm, H = 20 mm, l = 1 mm, k = 9.375 MN/m, M = 12 g, F_N = 400 N, theta = 0 (the paper has
    0.833, 0 and -0.833), K = 0.8 MN/m, V = 0.45 mm/s, h = 2 mm, mu_s = 0.7, mu_k = 0.45. If l is
    changed, k and M stay the same.

    Changes and errors are those of `preset`.

    Source: PRL 107, 074301 (2011), setup 2.
    """
    return _made(_SETUP2, joined(changes, fields))


def chain(changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return a chain (N_z = 1): by default setup 1 of the paper, lumped into one row.

    Each block represents a column of setup 1. The defaults are:

    - p = 3500 N / N_x, the normal force of setup 1, spread evenly; F_N="2 kN" spreads 2 kN;
    - k = E B H / l = 1.35 MN / l, which is 540 MN/m at l = 2.5 mm. The force of a uniform strain is
      then that of setup 1, where E B = 4 k/3 with k = 13.5 MN/m, and H = 75 mm;
    - M = 0.54 kg/m times L, as in `setup1`.

    Waves then travel at l sqrt(k/m) = 1595 m/s, the speed sqrt(E/rho) of long waves in a rod.
    Driver and friction are those of setup 1, with tau = 0 and k_top = 0.

    Changes and errors are those of `preset`.

    Source: PRL 107, 074301 (2011), setup 1.
    """
    given = joined(changes, fields)
    rules: dict[str, Rule] = {"slider_k": lambda slider: 1.35e6 / slider.l, "slider_M": _mass}
    return _made(_CHAIN, given, **rules, top_p=lambda slider: 3500.0 / slider.N_x)


def burridge_knopoff(changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return a chain whose blocks are all pulled by springs from a moving plate.

    100 blocks with l = 2.5 mm, p = 61.4 N, k = 1.35 MN/l and the density of `chain`. Each spring of
    the plate has k/4, so that K = N_x k/4. V = 10 nm/s. mu_s is random, uniform from 0.5 to 0.9,
    and mu_k = 0.4. Events are then small and large; in a narrower range of mu_s, all blocks slip in
    each event.

    Changes and errors are those of `preset`.

    Source: R. Burridge, L. Knopoff, Bull. Seismol. Soc. Am. 57, 341 (1967), for the chain.
    """
    given = joined(changes, fields)
    rules: dict[str, Rule] = {
        "slider_k": lambda slider: 1.35e6 / slider.l,
        "slider_M": _mass,
        "top_p": lambda slider: 3500.0 / 57,
        "driver_K": lambda slider: 1.35e6 / slider.l / 4 * slider.N_x,
    }
    return _made(_PULLED, given, **rules)


Profile = Numbers | Callable[[float], float]
"""Forces along an interface: one number, a list, or a function of x."""


def slab(
    *,
    p: Profile,
    tau: Profile = 0.0,
    L: Number,
    H: Number,
    l: Number,
    **fields: Unpack[Fields],
) -> Scene:
    """Return a slab on a prescribed interface: p(x) and tau(x) are given, in linear geometry.

    Args:
        p, tau: forces in N: numbers, lists of N_x numbers from the trailing edge on, or functions
            of x (m). x is the distance from the first block at the trailing edge. If that side is
            mirrored, x is the distance from the mirror plane, l/2 before this block.
        L, H, l: length, height and lattice constant of the `Slider`, m.
        **fields: other fields of a scene. By default the interface is that of the paper, k is that
            of `setup1`, and M is its mass per area, 6.845 kg/m^2, times (L + l) (H + l). A block
            has the mass M/(N_x N_z), except in the bottom row, which has half blocks. There is no
            driver unless K is given. The driver's h is l. Sides and top are free. eta is sqrt(0.001
            k m), a tenth of the paper's, and dashpots are "along" the bonds. Dashpots that are
            stronger, or "full" and so resist rotation, delay fronts.

    Raises:
        SceneError: a name is unknown or in several parts, or a value is refused.
    """
    slider = Slider(L=L, H=H, l=l, k=13.5e6, M=1.0, dashpots="along")
    base = Scene(
        slider=slider,
        top=PrescribedLoad(p=1.0),
        driver=Driver(K=0.0, V=0.0, h=slider.l),
        interface=_PAPER,
        name="slab",
    )
    per_area = 0.0756 / (0.1425 * 0.0775)
    base = _made(base, fields, slider_M=lambda s: per_area * (s.L + s.l) * (s.H + s.l))
    if base.slider.eta is None and base.slider.damping is None:
        base = base.replace({"slider.eta": math.sqrt(0.001 * base.slider.k * base.m)})
    near = "left" if base.ahead > 0 else "right"
    begin = base.slider.l / 2 if getattr(base.walls, near) == "mirrored" else 0.0
    x = [begin + base.slider.l * i for i in range(base.N_x)]
    forces = {"p": p, "tau": tau}
    return base.replace({n: [*map(f, x)] if callable(f) else f for n, f in forces.items()})


def tpv3(changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return the benchmark TPV3 of earthquake rupture in two dimensions, in plane, 1 m thick.

    The scene is one quarter of the benchmark: the upper half space, because symmetry keeps p
    constant, and the half x > 0 of the shear crack that starts from the middle. Slip is half of the
    slip between two bodies, and so is d_c. Blocks beyond the end of the fault at 15 km carry ten
    times p, which stops every front.

    l = 100 m, L = 18 km and H = 12 km, rounded to whole blocks; l should divide 1.5 km. Top and
    right side are absorbing. eta and dashpots are those of `slab`. d_c = 0.2 m.

    Changes and errors are those of `preset`.

    Source: R. A. Harris et al., Seismol. Res. Lett. 80, 119 (2009), and the SCEC benchmarks.
    """
    own = joined(changes, fields).items()
    own = once((str(n).removeprefix("slider."), v) for n, v in own)
    given = {"l": 100.0, "L": 18e3, "H": 12e3} | own
    l = check_number("slider.l", given.pop("l"), "m", gt=0.0, le=1500.0)
    N_x, N_z = (
        round(check_number(f"slider.{n}", given.pop(n), "m", ge=2 * l) / l) for n in ("L", "H")
    )
    rho, c_S, p = 2670.0, 3464.0, 120e6 * l
    k, m = 2 * rho * c_S**2, rho * l**2
    base = slab(
        p=lambda x: p if x < 15e3 else 10 * p,
        tau=lambda x: (81.6e6 if x < 1.5e3 else 70e6) * l,
        L=(N_x - 1) * l,
        H=(N_z - 1) * l,
        l=l,
        k=k,
        M=m * N_x * N_z,
        mu_s=0.677,
        mu_k=0.525,
        d_c=0.2,
        walls=Walls(left="mirrored", right="absorbing", top="absorbing"),
        name="tpv3",
    )
    return base.replace({n: v for n, v in given.items() if not (n == "eta" and v is None)})


class Preset(NamedTuple):
    """A named scene: its setup, the changed values and a description."""

    setup: Callable[..., Scene]
    values: Mapping[str, Any]
    about: str

    def __call__(self, changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
        """Return the scene with changes; see `preset`."""
        given = joined(changes, fields)
        own = {n: v for n, v in self.values.items() if given.keys().isdisjoint(_named(n))}
        return self.setup(own | given)


def _named(field: str) -> tuple[str, ...]:
    """Return the names for a field such as "driver.h": "driver.h", "h" and "driver"."""
    part, _, end = field.partition(".")
    return field, end, part


PRESETS: MappingProxyType[str, Preset] = MappingProxyType(
    {
        name: Preset(setup, {"name": name} | values, about)
        for name, setup, values, about in (
            ("fig1", setup1, {}, "Figs 1, 3 and 4(a) of the paper: setup 1"),
            ("run1", setup1, {"interface": Interface(mu_s=0.5, mu_k=0.2)}, "run 1 of Fig. 4(b)"),
            ("run2", setup1, {"interface": Interface(mu_s=0.55, mu_k=0.3)}, "run 2 of Fig. 4(b)"),
            ("run3", setup1, {"driver.h": 7.5e-3}, "run 3 of Fig. 4(b): pushed at 7.5 mm"),
            (
                "run4",
                setup1,
                {"slider.L": 0.2, "top.F_N": 2700.0, "driver.h": 10e-3},
                "run 4 of Fig. 4(b): 200 mm long, of 108 g; M=0.0756 is the caption's mass",
            ),
            ("setup1", setup1, {}, "a slider under a rod"),
            ("setup2", setup2, {}, "a slider under a distributed load"),
            ("setup2+", setup2, {"top.theta": 0.833}, "little load on the trailing edge"),
            ("setup2-", setup2, {"top.theta": -0.833}, "much load on the trailing edge"),
            ("grooves", grooves, {}, "setup 1 with lands and grooves of 10 mm"),
            ("wavy", wavy, {}, "setup 1 on waves of 35 mm, 20 um high"),
            ("chain", chain, {}, "setup 1 lumped into one row"),
            ("burridge_knopoff", burridge_knopoff, {}, "a chain under springs from a plate"),
            ("slow", slow, {}, "setup 1 on junctions that break and pin again: slow fronts"),
            ("rate_and_state", rate_and_state, {}, "setup 1 with rate-and-state friction of rock"),
            (
                "rate_and_state_pmma",
                rate_and_state_pmma,
                {},
                "setup 1 with rate-and-state friction of PMMA",
            ),
            ("tpv3", tpv3, {}, "a benchmark of earthquake rupture"),
        )
    }
)
"""Named scenes, as functions that take changes."""


@usage('preset("fig1", F_N="2 kN", mu_s=0.6)')
def preset(name: str, changes: Changes = None, /, **fields: Unpack[Fields]) -> Scene:
    """Return the named scene, with changes.

    Args:
        name: a key of `PRESETS`.
        changes: names of fields to values, as in `Scene.replace`: "driver.h", or "h" if only one
            part has it, or a whole part. A value is a number in SI units, text with a unit such as
            "5 mm", or a quantity of a unit library, such as pint.
        **fields: changes of fields whose names have no dot.

    Raises:
        SceneError: a name is unknown (the most similar known name is suggested) or in several
            parts, or a value is refused.

    >>> scene = pyfric.preset("fig1", h="7.5 mm")
    >>> scene.N_x, scene.N_z, scene.driver.h
    (57, 31, 0.0075)
    >>> pyfric.preset("fig1", h=-1.0)
    Traceback (most recent call last):
    ...
    pyfric.values.errors.SceneError: driver.h = -1.0 m: ...
    """
    if not isinstance(name, str) or name not in PRESETS:
        raise unknown("preset", name, name if isinstance(name, str) else "", PRESETS)
    return PRESETS[name](changes, **fields)


def presets() -> dict[str, str]:
    """Return the names of presets and a description of each."""
    return {name: scene.about for name, scene in PRESETS.items()}


UNSAID = 0.05
"""Largest relative change of the density that needs no note (a choice)."""


def density_notes(scene: Scene) -> tuple[str, ...]:
    """Return a note on a scene that has the name of a preset, but another density.

    Densities are compared as mass per area. If only the height is changed, M stays and the density
    changes.
    """
    if scene.name not in PRESETS:
        return ()
    own, now = PRESETS[scene.name]().slider, scene.slider
    areas = [s.L * (s.H or 1.0) for s in (own, now)]
    kept = own.M * areas[1] / areas[0]
    if bool(own.H) != bool(now.H) or math.isclose(now.M, kept, rel_tol=UNSAID):
        return ()
    ratio = now.M / kept
    return (
        f"M = {now.M:.6g} kg makes the density {ratio:.3g} times that of {scene.name}, and waves "
        f"{ratio**-0.5:.3g} times as fast for the same k; M = {kept:.6g} kg keeps it",
    )


def settings(name: str) -> list[str]:
    """Return the names of the fields of a preset, without the part if the name is unique."""
    names = [full for full in scene_fields(PRESETS[name]()) if full.count(".") == 1]
    ends = {full: full.partition(".")[2] for full in names}
    taken = [*PARTS, *ends.values()]
    return [*(end if taken.count(end) == 1 else full for full, end in ends.items()), "name"]


SceneLike = Scene | str | os.PathLike[str]
"""A scene, the name of a preset, or the path of a scene file."""


def paper_step(scene: Scene) -> float | None:
    """Return the time step of the paper for the scene's setup, in s; None for other scenes.

    Source: PRL 107, 074301 (2011), 0.2 us for setup 1 and 0.09 us for setup 2.
    """
    return {Rod: 0.2e-6, DistributedLoad: 0.09e-6}.get(type(scene.top))


def as_scene(scene: SceneLike, changes: Changes = None) -> Scene:
    """Return the scene itself, the preset with this name, or the scene in this file, with changes.

    Raises:
        SceneError: not a scene, no such preset or file, a file without a scene, or a refused
            change.
    """
    named = isinstance(scene, str | os.PathLike)
    if isinstance(scene, str) and not names_file(scene):
        return preset(scene, changes)
    if named and os.fspath(scene).endswith(".nc"):
        raise SceneError("scene", os.fspath(scene), "", GO_ON, "a record is no scene")
    if named:
        scene = Scene.from_toml(scene)
    if not isinstance(scene, Scene):
        if hasattr(scene, "scene"):
            raise SceneError("scene", type(scene).__name__, "", GO_ON, "a record is no scene")
        allowed = f"a Scene, a scene file, or one of {', '.join(PRESETS)}"
        raise SceneError("scene", scene, "", allowed)
    return scene.replace(changes) if changes else scene


def names_file(name: str) -> bool:
    """Return whether a text is the name or content of a scene file, and no name of a preset."""
    looks = os.sep in name or "/" in name or "\n" in name or name.lower().endswith(".toml")
    return name not in PRESETS and (looks or os.path.isfile(name))
