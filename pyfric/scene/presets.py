"""The paper's scenes, a chain, and a slab on a prescribed interface.

Source: PRL 107, 074301 (2011).
"""

import dataclasses
import math
import os
from collections.abc import Callable, Sequence
from types import MappingProxyType
from typing import Any, Literal

from pyfric.scene.laws.junctions import Junctions
from pyfric.scene.parts import (
    DistributedLoad,
    Driver,
    Interface,
    PrescribedLoad,
    Rod,
    Slider,
    Walls,
)
from pyfric.scene.scene import Scene
from pyfric.scene.units import SceneError, check_quantity, unknown

__all__ = [
    "PRESETS",
    "SceneLike",
    "as_scene",
    "chain",
    "fig1",
    "names_file",
    "paper_step",
    "preset",
    "run1",
    "run2",
    "run3",
    "run4",
    "settings",
    "setup1",
    "setup2",
    "setup2_minus",
    "setup2_plus",
    "slab",
    "tpv3",
]


def setup1(
    *,
    L: float = 0.14,
    h: float = 5e-3,
    F_N: float = 3500.0,
    mu_s: float = 0.7,
    mu_k: float = 0.45,
    M: float | None = None,
    l: float = 2.5e-3,
    H: float = 0.075,
    k: float = 13.5e6,
    K: float = 4e6,
    V: float = 0.7875e-3,
    side: Literal["left", "right"] = "left",
    mass: float = 0.0756,
    mattress: float = 0.4e6,
    eta: float | None = None,
    k_f: float | None = None,
    d_c: float = 0.0,
    name: str = "setup1",
) -> Scene:
    """Return setup 1 of the paper: the top row glued to a rigid rod.

    Arguments are the fields of the parts, in SI units. Where l is changed, k stays
    (k = 3 B E / 4 does not depend on l) and the block mass follows from M / (N_x N_z).

    M = None means 0.54 kg/m times L: 75.6 g at L = 140 mm, 108 g at L = 200 mm. The paper's
    caption gives 75.6 g; only at L = 140 mm does this lead to its wave speeds (1677 and
    968 m/s), so the density is kept. Pass M=0.0756 for the literal mass at every L.

    Raises:
        SceneError: a value is of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), Fig. 1 and its caption.
    """
    if M is None:
        M = 0.0756 * (check_quantity("slider.L", L, "m", gt=0.0) / 0.14)  # 0.54 kg/m
    return Scene(
        slider=Slider(L=L, H=H, l=l, k=k, M=M, eta=eta),
        top=Rod(F_N=F_N, mass=mass, mattress=mattress),
        driver=Driver(K=K, V=V, h=h, side=side),
        interface=Interface(mu_s=mu_s, mu_k=mu_k, k_f=k_f, d_c=d_c),
        name=name,
    )


def setup2(
    *,
    theta: float = 0.0,
    h: float = 2e-3,
    F_N: float = 400.0,
    mu_s: float = 0.7,
    mu_k: float = 0.45,
    L: float = 0.1,
    H: float = 0.02,
    l: float = 1e-3,
    k: float = 9.375e6,
    M: float = 0.012,
    K: float = 0.8e6,
    V: float = 0.45e-3,
    side: Literal["left", "right"] = "left",
    eta: float | None = None,
    k_f: float | None = None,
    d_c: float = 0.0,
    name: str = "setup2",
) -> Scene:
    """Return setup 2 of the paper: a free top row under a distributed load with slope theta.

    Arguments are the fields of the parts, in SI units; theta in [-1, 1] (the paper uses 0.833,
    0 and -0.833). Where l is changed, k stays and the block mass follows from M / (N_x N_z).

    Raises:
        SceneError: a value is of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), setup 2.
    """
    return Scene(
        slider=Slider(L=L, H=H, l=l, k=k, M=M, eta=eta),
        top=DistributedLoad(F_N=F_N, theta=theta),
        driver=Driver(K=K, V=V, h=h, side=side),
        interface=Interface(mu_s=mu_s, mu_k=mu_k, k_f=k_f, d_c=d_c),
        name=name,
    )


def chain(
    *,
    p: float | Sequence[float] | None = None,
    tau: float | Sequence[float] = 0.0,
    k_top: float = 0.0,
    mu_s: float = 0.7,
    mu_k: float = 0.45,
    L: float = 0.14,
    l: float = 2.5e-3,
    k: float | None = None,
    M: float | None = None,
    K: float = 4e6,
    V: float = 0.7875e-3,
    side: Literal["left", "right"] = "left",
    eta: float | None = None,
    k_f: float | None = None,
    d_c: float = 0.0,
    name: str = "chain",
) -> Scene:
    """Return a chain (N_z = 1): by default setup 1 of the paper, lumped into one row.

    Arguments are the fields of the parts, in SI units; p and tau are numbers or sequences of N_x
    numbers from the trailing edge on. Each block stands for a column of setup 1:

    - p = None means 3500 N / N_x, the normal force of setup 1, spread evenly;
    - k = None means E B H / l = 1.35 MN / l, 540 MN/m at l = 2.5 mm, so that a uniform stretch
      takes the same force; E B = 4 k/3 with k = 13.5 MN/m, H = 75 mm;
    - M = None means 0.54 kg/m times L, as in `setup1`.

    Waves then travel at l sqrt(k/m) = 1595 m/s, the speed of long waves in a rod, sqrt(E/rho).
    Driver and friction are those of setup 1; tau = 0 and k_top = 0 leave a plain chain.

    Raises:
        SceneError: a value is of the wrong type or out of range.

    Source: PRL 107, 074301 (2011), setup 1.
    """
    L = check_quantity("slider.L", L, "m", gt=0.0)
    l = check_quantity("slider.l", l, "m", gt=0.0)
    slider = Slider(
        L=L,
        H=0.0,
        l=l,
        k=1.35e6 / l if k is None else k,
        M=0.0756 * (L / 0.14) if M is None else M,  # 0.54 kg/m
        eta=eta,
    )
    return Scene(
        slider=slider,
        top=PrescribedLoad(p=3500.0 / slider.N_x if p is None else p, tau=tau, k_top=k_top),
        driver=Driver(K=K, V=V, h=0.0, side=side),
        interface=Interface(mu_s=mu_s, mu_k=mu_k, k_f=k_f, d_c=d_c),
        name=name,
    )


Profile = float | Sequence[float] | Callable[[float], float]
"""Forces along an interface: one number, a list, or a function of x."""


def slab(
    *,
    p: Profile,
    tau: Profile = 0.0,
    L: float,
    H: float,
    l: float,
    k: float = 13.5e6,
    M: float | None = None,
    mu_s: float = 0.7,
    mu_k: float = 0.45,
    K: float = 0.0,
    V: float = 0.0,
    h: float | None = None,
    side: Literal["left", "right"] = "left",
    walls: Walls | None = None,
    eta: float | None = None,
    dashpots: Literal["full", "along"] = "full",
    k_f: None = None,
    d_c: float = 0.0,
    name: str = "slab",
) -> Scene:
    """Return a slab on a prescribed interface: p(x) and tau(x) are given, in linear geometry.

    Arguments are the fields of the parts, in SI units, with these differences:

    - p and tau are numbers, lists of N_x numbers from the trailing edge on, or functions of x, the
      distance (m) of a block from the first one at the trailing edge, or from the plane of the
      mirror where that side is mirrored; they return N;
    - M = None means the mass per area of `setup1`, 6.845 kg/m^2 times (L + l) (H + l); M/(N_x N_z)
      is the mass of each block but those of the bottom row, which are half blocks;
    - K = 0 leaves the driver out; h = None means l;
    - walls = None means that sides and top are free.

    Raises:
        SceneError: a value is of the wrong type or out of range.
    """
    L, H, l = (
        check_quantity(f"slider.{n}", v, "m", gt=0.0) for n, v in zip("LHl", (L, H, l), strict=True)
    )
    walls = Walls() if walls is None else walls
    if M is None:
        M = 0.0756 / (0.1425 * 0.0775) * (L + l) * (H + l)
    slider = Slider(L=L, H=H, l=l, k=k, M=M, eta=eta, dashpots=dashpots)
    begin = l / 2 if isinstance(walls, Walls) and getattr(walls, side, "") == "mirrored" else 0.0
    x = [begin + l * i for i in range(slider.N_x)]
    return Scene(
        slider=slider,
        top=PrescribedLoad(
            p=[p(one) for one in x] if callable(p) else p,
            tau=[tau(one) for one in x] if callable(tau) else tau,
        ),
        driver=Driver(K=K, V=V, h=l if h is None else h, side=side),
        interface=Interface(mu_s=mu_s, mu_k=mu_k, k_f=k_f, d_c=d_c),
        name=name,
        walls=walls,
    )


def tpv3(
    *,
    l: float = 100.0,
    L: float = 18e3,
    H: float = 12e3,
    eta: float | None = None,
    dashpots: Literal["full", "along"] = "along",
    d_c: float = 0.2,
    name: str = "tpv3",
) -> Scene:
    """Return the benchmark TPV3 of earthquake rupture in two dimensions, in plane, 1 m thick.

    One quarter of it: a half space, since p stays what it is by symmetry, and x > 0 of the shear
    crack that starts from the middle. Slip is half of that between two bodies, and so is d_c. The
    blocks beyond the fault's end at 15 km carry ten times p, which no front overcomes.

    Args:
        l: lattice constant, m; it divides 1.5 km.
        L, H: size, m, rounded to whole blocks; top and right side absorb.
        eta: viscosity of the bonds, N s/m; None means sqrt(0.001 k m), a tenth of the usual one.
        dashpots: "along" the bonds only, or "full", which resists rotation and delays fronts.
        d_c: slip over which friction weakens, m.

    Raises:
        SceneError: a value is of the wrong type or out of range.

    Source: R. A. Harris et al., Seismol. Res. Lett. 80, 119 (2009), and the SCEC benchmarks.
    """
    l = check_quantity("slider.l", l, "m", gt=0.0, le=1500.0)
    blocks = [
        round(check_quantity(f"slider.{n}", v, "m", ge=2 * l) / l) for n, v in (("L", L), ("H", H))
    ]
    rho, c_S, p = 2670.0, 3464.0, 120e6 * l
    k, m = 2 * rho * c_S**2, rho * l**2
    return slab(
        p=lambda x: p if x < 15e3 else 10 * p,
        tau=lambda x: (81.6e6 if x < 1.5e3 else 70e6) * l,
        L=(blocks[0] - 1) * l,
        H=(blocks[1] - 1) * l,
        l=l,
        k=k,
        M=m * blocks[0] * blocks[1],
        mu_s=0.677,
        mu_k=0.525,
        eta=math.sqrt(0.001 * k * m) if eta is None else eta,
        dashpots=dashpots,
        d_c=d_c,
        walls=Walls(left="mirrored", right="absorbing", top="absorbing"),
        name=name,
    )


def fig1(**changes: Any) -> Scene:
    """Return the scene of Figs 1, 3 and 4(a): setup 1 as it stands.

    Keyword arguments replace those of `setup1`, here and in the other named scenes.
    """
    return setup1(**{"name": "fig1"} | changes)


def run1(**changes: Any) -> Scene:
    """Return run 1 of Fig. 4(b): setup 1 with mu_s = 0.5, mu_k = 0.2."""
    return setup1(**{"mu_s": 0.5, "mu_k": 0.2, "name": "run1"} | changes)


def run2(**changes: Any) -> Scene:
    """Return run 2 of Fig. 4(b): setup 1 with mu_s = 0.55, mu_k = 0.3."""
    return setup1(**{"mu_s": 0.55, "mu_k": 0.3, "name": "run2"} | changes)


def run3(**changes: Any) -> Scene:
    """Return run 3 of Fig. 4(b): setup 1 with h = 7.5 mm."""
    return setup1(**{"h": 7.5e-3, "name": "run3"} | changes)


def run4(**changes: Any) -> Scene:
    """Return run 4 of Fig. 4(b): setup 1 with L = 200 mm, F_N = 2700 N, h = 10 mm.

    The mass is 108 g (constant density); M=0.0756 gives the literal value of the caption.
    """
    return setup1(**{"L": 0.2, "F_N": 2700.0, "h": 10e-3, "name": "run4"} | changes)


def setup2_plus(**changes: Any) -> Scene:
    """Return setup 2 with theta = 0.833: little load on the trailing edge."""
    return setup2(**{"theta": 0.833, "name": "setup2+"} | changes)


def setup2_minus(**changes: Any) -> Scene:
    """Return setup 2 with theta = -0.833: much load on the trailing edge."""
    return setup2(**{"theta": -0.833, "name": "setup2-"} | changes)


SLOW_C, SLOW_N_S = 39.2e9, 100
"""The constant in k_j = sqrt(C p/n_s) of the scene of slow fronts, N/m^2, and its junctions."""


def slow(**changes: Any) -> Scene:
    """Return setup 1 on an interface of junctions, whose fronts may slow down to 1 % of c_S.

    Keyword arguments are those of `setup1` and `pyfric.laws.Junctions`. u_s = 1.17 um is that of
    C = 39.2 GN/m^2 with 100 junctions a block; another n_s keeps it.

    Source: J. Trømborg et al., Proc. Natl. Acad. Sci. 111, 8764 (2014).
    """
    own = {one.name for one in dataclasses.fields(Junctions)}
    of_setup = {"F_N": 1920.0, "V": 0.4e-3, "mu_s": 0.4, "mu_k": 0.17, "name": "slow"}
    scene = setup1(**of_setup | {k: v for k, v in changes.items() if k not in own})
    if changes.get("k_f") is None:
        scene = scene.replace(k_f=scene.slider.k / 2)
    times = {"n_s": SLOW_N_S, "t_R": 2e-3, "t_R_std": 0.6e-3}
    if "C" not in changes:
        times["u_s"] = 0.4 * math.sqrt(1920.0 / 57 / (SLOW_N_S * SLOW_C))
    law = Junctions(**times | {k: v for k, v in changes.items() if k in own})
    return scene.replace({"interface.law": law})


PRESETS: MappingProxyType[str, Callable[..., Scene]] = MappingProxyType(
    {
        "fig1": fig1,
        "run1": run1,
        "run2": run2,
        "run3": run3,
        "run4": run4,
        "setup1": setup1,
        "setup2": setup2,
        "setup2+": setup2_plus,
        "setup2-": setup2_minus,
        "chain": chain,
        "tpv3": tpv3,
        "slow": slow,
    }
)
"""The paper's scenes, `chain` and `tpv3` by name; functions take the arguments of their setup."""


def preset(name: str, /, **changes: Any) -> Scene:
    """Return the named scene, with changes.

    Args:
        name: a key of `PRESETS`.
        changes: keyword arguments of `setup1`, `setup2`, `chain` or `tpv3`: numbers in SI units,
            text with a unit such as "5 mm", or quantities of a library of units, such as pint.

    Raises:
        SceneError: an unknown name or keyword (the nearest known one is given, or which setups
            know it), or a value that is refused.

    >>> scene = pyfric.preset("fig1", h="7.5 mm")
    >>> scene.N_x, scene.N_z, scene.driver.h
    (57, 31, 0.0075)
    >>> pyfric.preset("fig1", h=-1.0)
    Traceback (most recent call last):
    ...
    pyfric.scene.units.SceneError: driver.h = -1.0 m: ...
    """
    if not isinstance(name, str) or name not in PRESETS:
        raise unknown("preset", name, name if isinstance(name, str) else "", PRESETS)
    known = settings(name)
    for key, value in changes.items():
        if key not in known:
            others = [one for one in (setup1, setup2, chain) if key in one.__kwdefaults__]
            if others:  # and so no word that is spelled wrong
                reason = f"unknown here, known to {' and '.join(o.__name__ for o in others)}"
                raise SceneError(key, value, "", f"one of {', '.join(known)}", reason)
            raise unknown(key, value, key, known)
    return PRESETS[name](**changes)


def settings(name: str) -> list[str]:
    """Return the keyword arguments that a preset takes."""
    setups = {"chain": chain, "tpv3": tpv3}
    setup = setups.get(name, setup2 if name.startswith("setup2") else setup1)
    own = [one.name for one in dataclasses.fields(Junctions)] if name == "slow" else []
    return [*setup.__kwdefaults__, *own]


SceneLike = Scene | str | os.PathLike[str]
"""A scene, the name of a preset, or the path of a scene file."""


def paper_step(scene: Scene) -> float | None:
    """Return the time step of the paper for the scene's setup, in s; None for another.

    Source: PRL 107, 074301 (2011), 0.2 us for setup 1 and 0.09 us for setup 2.
    """
    return {Rod: 0.2e-6, DistributedLoad: 0.09e-6}.get(type(scene.top))


def as_scene(scene: SceneLike) -> Scene:
    """Return the scene itself, the preset of this name, or the scene in this file.

    Raises:
        SceneError: no scene, no such preset or file, or a file that holds none.
    """
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, str) and not names_file(scene):
        return preset(scene)
    if isinstance(scene, str | os.PathLike):
        return Scene.from_toml(scene)
    raise SceneError("scene", scene, "", f"a Scene, a scene file, or one of {', '.join(PRESETS)}")


def names_file(name: str) -> bool:
    """Whether a text that may name a preset names a scene file, or is the text of one."""
    looks = os.sep in name or "/" in name or "\n" in name or name.lower().endswith(".toml")
    return name not in PRESETS and (looks or os.path.isfile(name))
