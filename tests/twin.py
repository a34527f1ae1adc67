"""The model in plain Python loops, as an oracle for the fast code.

The twin follows the paper (J. Trømborg et al., Phys. Rev. Lett. 107, 074301 (2011)) line by line,
and takes about 10 us per block and evaluation. The twin shares no code with the package.

A scene is any object with the attributes of `pyfric.Scene`. The state is

    y[j, c, i]   row j (0 = bottom), column i (0 = left), c = u_x, u_z, v_x, v_z; m and m/s
    rod          X, Z, phi, X', Z', phi' of the rod (setup 1): m, rad and their rates
    mode[i]      contact of bottom block i: STUCK, +1 or -1 (slips to +x or -x), OPEN
    slip[i]      path that bottom block i has slipped since it last stuck, m; None means 0
    u_drv0       u_x of the driven block where F_T = 0, m; of several, one number for each, upward

Forces act on the blocks, positive to the right and up. Under a rod the top row of y follows from
the rod, and its values in y are ignored.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field as member
from itertools import pairwise
from math import sqrt
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

STUCK, RIGHT, LEFT, OPEN = 0, 1, -1, 2

NEIGHBOURS = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)]
"""Columns and rows from a block to its four nearest and four next-nearest neighbours."""

WORKS = ("bonds", "friction", "driver", "load")
"""Names of the powers, and of their integrals over time; see `right_hand_side`."""


class Slab(SimpleNamespace):
    """A scene by its attributes. Data of bonds must not change, because `_bonds` caches them."""

    __hash__ = object.__hash__


def bond_forces(scene: Any, y: np.ndarray, geometry: str) -> np.ndarray:
    """Return the forces F[j, 0 or 1, i] in N of all springs and dashpots, shape (N_z, 2, N_x).

    finite: k_ij (r - l_ij) (d + du)/r with r = |d + du|;  linear: k_ij n (n . du) with n = d/|d|;
    both with eta (v_j - v_i). d is the reference vector from block i to block j.
    """
    F = np.zeros((scene.N_z, 2, scene.N_x))
    u_x, u_z, v_x, v_z = (y[:, c, :].tolist() for c in range(4))
    eta, only_along = scene.eta, along(scene)
    for (j, i), bonds in _bonds(scene).items():
        F_x = F_z = 0.0
        for j2, i2, sign, part_of, k, l, d_x, d_z in bonds:
            du_x, du_z = u_x[j2][i2] - u_x[j][i], sign * u_z[j2][i2] - u_z[j][i]
            if geometry == "linear":
                n_x, n_z = d_x / l, d_z / l
                tension = k * (n_x * du_x + n_z * du_z)
            else:
                elongation, r = _elongation(l, d_x, d_z, du_x, du_z)
                n_x, n_z = (d_x + du_x) / r, (d_z + du_z) / r
                tension = k * elongation
            dv_x, dv_z = v_x[j2][i2] - v_x[j][i], sign * v_z[j2][i2] - v_z[j][i]
            if only_along:
                dv = n_x * dv_x + n_z * dv_z
                dv_x, dv_z = dv * n_x, dv * n_z
            F_x += part_of * (tension * n_x + eta * dv_x)
            F_z += part_of * (tension * n_z + eta * dv_z)
        F[j, :, i] = F_x, F_z
    return F


@functools.cache
def _bonds(scene: Any) -> dict[tuple[int, int], list[tuple]]:
    """Return the bonds of each block: neighbour, share of each bond that exists, and geometry."""
    found = {(j, i): [] for j in range(scene.N_z) for i in range(scene.N_x)}
    for (j, i), bonds in found.items():
        for a, b in NEIGHBOURS:
            if there := neighbour(scene, j + b, i + a):
                bonds.append((*there, share(scene, j, i, a, b), *_bond(scene, a, b)))
    return found


def along(scene: Any) -> bool:
    """Return whether dashpots act only along the bonds, in their present direction."""
    return getattr(scene.slider, "dashpots", "full") == "along"


def neighbour(scene: Any, j: int, i: int) -> tuple[int, int, int] | None:
    """Return row, column and the sign of u_z of the block at (j, i); None if there is none.

    Beyond a mirrored side or top, (j, i) is the image of the block at the same distance inside.
    """
    N_x, N_z = scene.N_x, scene.N_z
    if 0 <= i < N_x and 0 <= j < N_z:
        return j, i, 1
    walls, sign = getattr(scene, "walls", None), 1
    if i in (-1, N_x):
        if walls is None or (walls.left if i < 0 else walls.right) != "mirrored":
            return None
        i, sign = (0 if i < 0 else N_x - 1), -sign
    if j == N_z:
        if walls is None or walls.top != "mirrored":
            return None
        j, sign = N_z - 1, -sign
    return None if j < 0 else (j, i, sign)


def prescribed(scene: Any) -> bool:
    """Return whether p is given and there is no foundation."""
    return getattr(scene, "prescribed", False)


def absorbing(scene: Any, y: np.ndarray) -> np.ndarray:
    """Return the forces of the dashpots of absorbing walls, (N_z, 2, N_x), in N.

    The traction is rho c_P v along the normal and rho c_S v across it (except in corners of two
    walls). The face of a block is m/(rho l), and c_P = l sqrt(3 k/(2 m)), c_S = l sqrt(k/(2 m)).
    """
    F, walls = np.zeros_like(y[:, :2]), getattr(scene, "walls", None)
    if walls is None:
        return F
    z_p, z_s = sqrt(1.5 * scene.slider.k * scene.m), sqrt(0.5 * scene.slider.k * scene.m)
    for side, i in ((walls.left, 0), (walls.right, scene.N_x - 1)):
        if side == "absorbing":
            for j in range(scene.N_z):
                face = 0.5 if cut(scene, j, i)[0] else 1.0
                F[j, 0, i] -= face * z_p * y[j, 2, i]
                F[j, 1, i] -= 0 if all(cut(scene, j, i)) and j else face * z_s * y[j, 3, i]
    if walls.top == "absorbing":
        for i in range(scene.N_x):
            face = 0.5 if cut(scene, scene.N_z - 1, i)[1] else 1.0
            F[-1, 0, i] -= 0 if face < 1 else face * z_s * y[-1, 2, i]
            F[-1, 1, i] -= face * z_p * y[-1, 3, i]
    return F


def cut(scene: Any, j: int, i: int) -> tuple[bool, bool]:
    """Return whether the slider is cut along row j, and along column i."""
    if not prescribed(scene):
        return False, False
    walls = scene.walls
    row = j == 0 or (j == scene.N_z - 1 and walls.top == "absorbing")
    left = i == 0 and walls.left == "absorbing"
    return row, left or (i == scene.N_x - 1 and walls.right == "absorbing")


def part(scene: Any, j: int, i: int) -> float:
    """Return the share of a block that exists: 1/2 on a cut, 1/4 where two cuts cross."""
    row, column = cut(scene, j, i)
    return (0.5 if row else 1.0) * (0.5 if column else 1.0)


def share(scene: Any, j: int, i: int, a: int, b: int) -> float:
    """Return the share of the bond by (a, b) of block (j, i): 1/2 along a cut."""
    row, column = cut(scene, j, i)
    return 0.5 if (row and b == 0) or (column and a == 0) else 1.0


def _bond(scene: Any, a: int, b: int) -> tuple[float, float, float, float]:
    """Return stiffness k_ij, length l_ij and reference vector of the bond by (a, b) blocks."""
    k, l = scene.slider.k, scene.slider.l
    if a != 0 and b != 0:
        return k / 2, sqrt(2) * l, a * l, b * l
    return k, l, a * l, b * l


def _elongation(l: float, d_x: float, d_z: float, du_x: float, du_z: float) -> tuple[float, float]:
    """Return r - l = (2 d.du + |du|^2)/(r + l), free of cancellation, and r = |d + du|."""
    r = sqrt((d_x + du_x) ** 2 + (d_z + du_z) ** 2)
    return (2 * (d_x * du_x + d_z * du_z) + du_x**2 + du_z**2) / (r + l), r


def with_rod(scene: Any, y: np.ndarray, rod: np.ndarray) -> np.ndarray:
    """Return y with the top row glued to the rod: u_x = X, u_z = Z + phi x_i, and the rates."""
    y = y.copy()
    if scene.rigid:
        X, Z, phi, dX, dZ, dphi = rod
        y[-1, 0], y[-1, 1] = X, Z + phi * scene.x
        y[-1, 2], y[-1, 3] = dX, dZ + dphi * scene.x
    return y


def rod_inertia(scene: Any) -> tuple[float, float]:
    """Return mass (kg) and moment of inertia (kg m^2) of the rod with the top blocks."""
    mass = scene.M_rod + scene.N_x * scene.m
    inertia = scene.M_rod * scene.slider.L**2 / 12 + scene.m * sum(x * x for x in scene.x)
    return mass, inertia


def driver_forces(scene: Any, t: float, y: np.ndarray, u_drv0: Any) -> dict[tuple[int, int], float]:
    """Return the force of the driver in N by row and column: (K/n) (V t - x) on each of n blocks.

    x is the displacement of the block along the drive. A plate drives all blocks up to h_top, or
    the top.
    """
    top = getattr(scene.driver, "h_top", None)
    last = scene.j_h if top is None else round(top / scene.slider.l)
    blocks = [(j, scene.i_h) for j in range(scene.j_h, last + 1)]
    if getattr(scene.driver, "side", "left") == "top":
        blocks = [(scene.N_z - 1, i) for i in range(scene.N_x)]
    home, forces = list(np.ravel(u_drv0)), {}
    for (j, i), rest in zip(blocks, home, strict=True):
        x = scene.d * (y[j, 0, i] - rest)
        forces[j, i] = scene.driver.K / len(blocks) * (scene.driver.V * t - x)
    return forces


def field(scene: Any, name: str, default: float = 0.0) -> list[float]:
    """Return mu_s, mu_k, d_c (m), alpha (N s/m) or k_f (N/m) of each block, left to right.

    A list of the interface begins at the trailing edge, on the driven side.
    """
    given = getattr(scene.interface, name, default)
    if given is None or isinstance(given, float):
        return [default if given is None else given] * scene.N_x
    return list(given) if scene.driver.side == "left" else list(given)[::-1]


def normal_forces(scene: Any, y: np.ndarray) -> np.ndarray:
    """Return p_i = k_f |z| (N) of blocks pressed into the foundation, otherwise 0; or given p."""
    if prescribed(scene):
        return np.array(scene.p_prescribed)
    return np.array([k * -z if z < 0 else 0.0 for k, z in foundation(scene, y)])


def foundation(scene: Any, y: np.ndarray) -> list[tuple[float, float]]:
    """Return k_f (N/m) and z = u_z + gap (m) of each block; k_f is 0 without contact."""
    k_f, gap = field(scene, "k_f", scene.slider.k), field(scene, "gap")
    contact = getattr(scene.interface, "contact", None)
    touches = [True] * scene.N_x if contact is None else list(contact)
    touches = touches if contact is None or scene.driver.side == "left" else touches[::-1]
    if not hasattr(scene.interface, "k_f"):  # a `Slab`, which gives k_f directly
        k_f = [scene.k_f] * scene.N_x
    return [(k_f[i] * touches[i], u_z + gap[i]) for i, u_z in enumerate(y[0, 1])]


def bare(scene: Any, i: int) -> bool:
    """Return whether a block has no friction, although others have some."""
    none = [not (a or b) for a, b in zip(field(scene, "mu_s"), field(scene, "alpha"), strict=True)]
    return none[i] and not all(none)


class Forces(NamedTuple):
    """The result of `right_hand_side`."""

    dydt: np.ndarray
    drod: np.ndarray
    dslip: np.ndarray
    f: np.ndarray
    p: np.ndarray
    F_T: float
    rates: dict[str, float]


def all_but_friction(
    scene: Any, geometry: str, t: float, y: np.ndarray, u_drv0: Any
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the forces on all blocks without friction (N_z, 2, N_x), p (N_x,) and F_T, in N."""
    F = bond_forces(scene, y, geometry)
    pushes = driver_forces(scene, t, y, u_drv0)
    for (j, i), push in pushes.items():
        F[j, 0, i] += scene.d * push
    F_T = sum(pushes.values())
    p = normal_forces(scene, y)
    F += absorbing(scene, y)
    if prescribed(scene):
        F[0, 0] += scene.shear
        if scene.walls.top == "held":
            F[-1] = 0.0
        return F, p, F_T
    F[0, 1] += p
    if not scene.rigid:
        F[-1, 1] -= scene.load
        F[-1, 0] += scene.shear - scene.k_top * y[-1, 0]
    return F, p, F_T


def right_hand_side(
    scene: Any,
    geometry: str,
    t: float,
    y: np.ndarray,
    rod: np.ndarray,
    mode: np.ndarray,
    u_drv0: Any,
    slip: np.ndarray | None = None,
) -> Forces:
    """Return the time derivative of the state while no contact changes its mode.

    Stuck: v_x = 0, a_x = 0, and f balances all other horizontal forces. Slipping to s = +-1:
    f = -s mu p, with mu from `friction_coefficient`; the slip grows at the rate s v_x. Open: f = 0.

    Returns:
        dydt (N_z, 4, N_x); drod (6,); dslip (N_x,), m/s; f (N_x,), the friction force on the
        blocks in +x, N; p (N_x,), N; F_T, N; rates, W: "bonds" (dissipated by the dashpots),
        "friction" (heat), "driver" (work of its moving end), "load" (work of F_N, or of load and
        shear). The energy of `energies` grows at the rate driver + load - bonds - friction.
    """
    y = with_rod(scene, y, rod)
    F, p, F_T = all_but_friction(scene, geometry, t, y, u_drv0)
    f, dslip = np.zeros(scene.N_x), np.zeros(scene.N_x)
    for i in range(scene.N_x):
        if mode[i] == STUCK:
            f[i] = -F[0, 0, i]
        elif mode[i] != OPEN:
            v = mode[i] * y[0, 2, i]
            mu = friction_coefficient(scene, 0.0 if slip is None else slip[i], i, v)
            f[i] = -mode[i] * (mu * p[i] + field(scene, "alpha")[i] * v)
            dslip[i] = mode[i] * y[0, 2, i]
    F[0, 0] += f

    dydt = np.zeros_like(y)
    dydt[:, 0:2] = y[:, 2:4]
    dydt[:, 2:4] = F / scene.m
    for j in range(scene.N_z):
        for i in range(scene.N_x):
            dydt[j, 2:4, i] /= part(scene, j, i)
    for i in range(scene.N_x):
        if mode[i] == STUCK:
            dydt[0, 0, i] = dydt[0, 2, i] = 0.0

    drod = np.zeros(6)
    if scene.rigid:
        mass, inertia = rod_inertia(scene)
        drod[0:3] = rod[3:6]
        drod[3] = sum(F[-1, 0]) / mass
        drod[4] = (sum(F[-1, 1]) - scene.F_N) / mass
        drod[5] = (sum(scene.x * F[-1, 1]) - scene.kappa * rod[2]) / inertia
        dydt[-1, 2], dydt[-1, 3] = drod[3], drod[4] + drod[5] * scene.x

    rates = {
        "bonds": bond_dissipation(scene, y) - np.sum(absorbing(scene, y) * y[:, 2:]),
        "friction": -sum(f * y[0, 2]),
        "driver": F_T * scene.driver.V,
        "load": -scene.F_N * rod[4]
        if scene.rigid
        else sum(scene.shear * y[getattr(scene, "j_shear", -1), 2] - scene.load * y[-1, 3]),
    }
    return Forces(dydt, drod, dslip, f, p, F_T, rates)


def friction_coefficient(scene: Any, slip: float, i: int = 0, v: float = 0.0) -> float:
    """Return mu(s) = mu_s - (mu_s - mu_k) min(s/d_c, 1) of a block that slips; mu_k if d_c = 0.

    A law of speed multiplies mu by a factor, linear between the given speeds.

    Within a step that ends a slip the block can move back beyond its start: s < 0 counts as 0.
    """
    mu_s, mu_k, d_c = (field(scene, name)[i] for name in ("mu_s", "mu_k", "d_c"))
    law, factor = getattr(scene.interface, "law", None), 1.0
    if getattr(law, "kind", "linear") == "speed":
        v = abs(v)
        factor = law.factor[-1] if v > law.v[-1] else law.factor[0]
        for (a, at_a), (b, at_b) in pairwise(zip(law.v, law.factor, strict=True)):
            if a < v <= b:
                factor = at_a + (at_b - at_a) * (v - a) / (b - a)
    if d_c == 0:
        return mu_k * factor
    return (mu_s - (mu_s - mu_k) * min(max(slip, 0.0) / d_c, 1.0)) * factor


def over_walls(scene: Any) -> list[tuple[int, int, int, int]]:
    """Return the bonds across mirrored walls, as (j, i, a, b). Each counts by one half."""
    walls = getattr(scene, "walls", None)
    if walls is None or "mirrored" not in (walls.left, walls.right, walls.top):
        return []
    return [
        (j, i, a, b)
        for j in range(scene.N_z)
        for i in range(scene.N_x)
        for a, b in NEIGHBOURS
        if not (0 <= i + a < scene.N_x and 0 <= j + b < scene.N_z)
        and neighbour(scene, j + b, i + a)
    ]


def difference(scene: Any, q: np.ndarray, j: int, i: int, a: int, b: int) -> np.ndarray:
    """Return the change of a field q (N_z, 2, N_x) over a bond, shape (2,)."""
    j2, i2, sign = neighbour(scene, j + b, i + a)
    return q[j2, :, i2] * (1, sign) - q[j, :, i]


def each_bond(scene: Any) -> list[tuple[int, int, int, int]]:
    """Return every bond once, as (j, i, a, b): from block (j, i) by (a, b) blocks."""
    N_x, N_z = scene.N_x, scene.N_z
    return [
        (j, i, a, b)
        for j in range(N_z)
        for i in range(N_x)
        for a, b in [(1, 0), (0, 1), (1, 1), (-1, 1)]
        if 0 <= i + a < N_x and j + b < N_z
    ]


def bond_dissipation(scene: Any, y: np.ndarray) -> float:
    """Return the power lost in the dashpots, the sum of eta |v_j - v_i|^2 over the bonds, in W."""
    total = 0.0
    eta, v_x, v_z = scene.eta, y[:, 2].tolist(), y[:, 3].tolist()
    for j, i, a, b in each_bond(scene):
        dv_x, dv_z = v_x[j + b][i + a] - v_x[j][i], v_z[j + b][i + a] - v_z[j][i]
        total += share(scene, j, i, a, b) * eta * (dv_x * dv_x + dv_z * dv_z)
    for j, i, a, b in over_walls(scene):
        dv = difference(scene, y[:, 2:], j, i, a, b)
        total += share(scene, j, i, a, b) * scene.eta * np.sum(dv**2) / 2
    return total


def bond_energy(scene: Any, geometry: str, y: np.ndarray) -> float:
    """Return the elastic energy of the springs in J: k (r - l)^2 / 2, or k (n . du)^2 / 2."""
    total = 0.0
    for j, i, a, b in each_bond(scene):
        k, l, d_x, d_z = _bond(scene, a, b)
        du_x, du_z = y[j + b, 0:2, i + a] - y[j, 0:2, i]
        if geometry == "linear":
            elongation = (d_x * du_x + d_z * du_z) / l
        else:
            elongation, _ = _elongation(l, d_x, d_z, du_x, du_z)
        total += share(scene, j, i, a, b) * k * elongation**2 / 2
    for j, i, a, b in over_walls(scene):
        k, l, d_x, d_z = _bond(scene, a, b)
        elongation = np.dot((d_x, d_z), difference(scene, y[:, :2], j, i, a, b)) / l
        total += share(scene, j, i, a, b) * k * elongation**2 / 4
    return total


def energies(
    scene: Any, geometry: str, y: np.ndarray, rod: np.ndarray, t: float, u_drv0: Any
) -> dict[str, float]:
    """Return the energies in J; they are disjoint, and "total" is their sum.

    "kinetic_blocks": the blocks that move on their own, all but the top row under a rod;
    "kinetic_top": the top row under a rod, else 0; "kinetic_rod": the rod without it; "bonds",
    "foundation", "mattress" (k_top without a rod), "driver": elastic.
    """
    y = with_rod(scene, y, rod)
    blocks = np.array([[part(scene, j, i) for i in range(scene.N_x)] for j in range(scene.N_z)])
    speed2 = np.sum(blocks[:, None] * y[:, 2:4] ** 2, axis=(1, 2))
    own = speed2[:-1] if scene.rigid else speed2
    pushes = driver_forces(scene, t, y, u_drv0).values()
    parts = {
        "kinetic_blocks": scene.m * sum(own) / 2,
        "kinetic_top": scene.m * speed2[-1] / 2 if scene.rigid else 0.0,
        "kinetic_rod": 0.0,
        "bonds": bond_energy(scene, geometry, y),
        "foundation": 0.0 if prescribed(scene) else _pressed_energy(scene, y),
        "mattress": 0.0 if scene.rigid else scene.k_top * sum(y[-1, 0] ** 2) / 2,
        "driver": sum(push**2 for push in pushes) * len(pushes) / (2 * (scene.driver.K or 1.0)),
    }
    if scene.rigid:
        _, _, phi, dX, dZ, dphi = rod
        spin = scene.slider.L**2 / 12 * dphi**2
        parts["kinetic_rod"] = scene.M_rod * (dX**2 + dZ**2 + spin) / 2
        parts["mattress"] = scene.kappa * phi**2 / 2
    return {name: float(value) for name, value in parts.items()} | {
        "total": float(sum(parts.values()))
    }


def switch(
    scene: Any,
    geometry: str,
    t: float,
    y: np.ndarray,
    rod: np.ndarray,
    mode: np.ndarray,
    u_drv0: Any,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the modes after a step, y with the stopped blocks at v_x = 0, and the kinetic energy
    removed by stopping them (the switching loss, J).

    First the blocks that slip against their direction, s v_x <= 0, are stopped, all at once. Then
    the forces are evaluated. The forces decide the state of every block, with `other` the sum of
    its horizontal forces without friction.

        p <= 0, or no friction          open (the block keeps its velocity)
        slipping, not stopped           unchanged
        open, p > 0 and v_x /= 0        slips along v_x
        stuck, stopped, open at rest    stuck if |other| <= mu_s p, else slips along `other`
    """
    y = with_rod(scene, y, rod)
    p = normal_forces(scene, y)
    loss = 0.0
    for i in range(scene.N_x):
        slipping = mode[i] in (LEFT, RIGHT)
        if slipping and p[i] > 0 and mode[i] * y[0, 2, i] <= 0:
            loss += part(scene, 0, i) * scene.m * y[0, 2, i] ** 2 / 2
            y[0, 2, i] = 0.0

    other = all_but_friction(scene, geometry, t, y, u_drv0)[0][0, 0]
    new = np.array(mode)
    for i in range(scene.N_x):
        v_x = y[0, 2, i]
        if p[i] <= 0 or bare(scene, i):
            new[i] = OPEN
        elif v_x == 0:
            most = field(scene, "mu_s")[i] * p[i]
            new[i] = STUCK if abs(other[i]) <= most else _sign(other[i])
        elif mode[i] == OPEN:
            new[i] = _sign(v_x)
    return new, y, float(loss)


def _pressed_energy(scene: Any, y: np.ndarray) -> float:
    """Return the elastic energy of the foundation, in J."""
    return sum(k * z**2 / 2 for k, z in foundation(scene, y) if z < 0)


def _sign(value: float) -> int:
    return RIGHT if value > 0 else LEFT


def rk4_step(*args: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, float]]:
    """Return y, rod, slip and the works of the step (J, `WORKS`): classical RK4, modes fixed."""
    rows = [], [1 / 2], [0, 1 / 2], [0, 0, 1]
    return _runge_kutta_step(rows, [1 / 6, 1 / 3, 1 / 3, 1 / 6], *args)


def rk46_step(*args: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, float]]:
    """Return a step as in `rk4_step`, with R(z) = 1 + z + ... + z^6/720."""
    c = 0.215698616936814233, 0.589123227484637551, 0.887069754615658149, 0.1643, 0.8179633309290967
    b = 0.0327885706189006, 0.282159545482237559, 0.296320423971946809, 0.194766711269656088
    return _nested_step(c, (*b, 0.102282590685891691), *args)


def rk46_waves_step(*args: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, float]]:
    """Return a step as in `rk4_step`, with R(z) of Berland, Bogey and Bailly."""
    c = 0.465515130665907016, 0.123614612658358104, 0.44338770386844224, 0.9222, 0.5321417524599334
    b = 0.137085190131006644, 0.024058266856017584, 0.0245763656183909, 0.491341862869562718
    return _nested_step(c, (*b, 0.246267357324908651), *args)


def _nested_step(
    c: Sequence[float], b: Sequence[float], *args: Any
) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, float]]:
    """Return a step as in `rk4_step`, by stages that each follow from the previous one alone."""
    rows = [], *([0] * k + [share] for k, share in enumerate(c))
    return _runge_kutta_step(rows, [*b, 1 - sum(b)], *args)


def imex_step(*args: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, float]]:
    """Return a step by the explicit part of the implicit-explicit method, of order 3."""
    rows = [], [1 / 2], [11 / 18, 1 / 18], [5 / 6, -5 / 6, 1 / 2]
    return _runge_kutta_step(rows, [1 / 4, 7 / 4, 3 / 4, -7 / 4], *args)


def _runge_kutta_step(
    rows: Sequence[Sequence[float]],
    weights: Sequence[float],
    scene: Any,
    geometry: str,
    t: float,
    y: np.ndarray,
    rod: np.ndarray,
    mode: np.ndarray,
    u_drv0: Any,
    dt: float,
    slip: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, float]]:
    def slope(t: float, *state: np.ndarray) -> tuple[np.ndarray, ...]:
        y, rod, slip = state
        F = right_hand_side(scene, geometry, t, y, rod, mode, u_drv0, slip)
        return F.dydt, F.drod, F.dslip, np.array([F.rates[name] for name in WORKS])

    def moved(shares: Sequence[float]) -> list[np.ndarray]:
        return [
            a + sum((dt * share * k[n] for share, k in zip(shares, slopes, strict=False)), 0 * a)
            for n, a in enumerate(state)
        ]

    state = with_rod(scene, y, rod), rod, np.zeros(scene.N_x) if slip is None else slip
    slopes: list[tuple[np.ndarray, ...]] = []
    for row in rows:
        slopes.append(slope(t + sum(row) * dt, *moved(row)))
    y, rod, slip = moved(weights)
    works = sum(dt * share * k[3] for share, k in zip(weights, slopes, strict=True))
    return with_rod(scene, y, rod), rod, slip, dict(zip(WORKS, works.tolist(), strict=True))


def symplectic_euler_step(
    scene: Any,
    geometry: str,
    t: float,
    y: np.ndarray,
    rod: np.ndarray,
    mode: np.ndarray,
    u_drv0: Any,
    dt: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return y and rod after v' = v + dt a(u, v), u' = u + dt v'."""
    y = with_rod(scene, y, rod)
    F = right_hand_side(scene, geometry, t, y, rod, mode, u_drv0)
    y, rod = y.copy(), rod.copy()
    y[:, 2:] += dt * F.dydt[:, 2:]
    rod[3:] += dt * F.drod[3:]
    y[:, :2] += dt * y[:, 2:]
    rod[:3] += dt * rod[3:]
    return with_rod(scene, y, rod), rod


def verlet_step(
    scene: Any,
    geometry: str,
    t: float,
    y: np.ndarray,
    rod: np.ndarray,
    mode: np.ndarray,
    u_drv0: Any,
    dt: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return y and rod after a kick of dt/2, a drift of dt, and a kick of dt/2.

    The second kick uses the forces at the new positions and the velocities v + dt a.
    """
    y = with_rod(scene, y, rod)
    F = right_hand_side(scene, geometry, t, y, rod, mode, u_drv0)
    half, half_rod = y.copy(), rod.copy()
    half[:, 2:] += dt / 2 * F.dydt[:, 2:]
    half_rod[3:] += dt / 2 * F.drod[3:]
    half[:, :2] += dt * half[:, 2:]
    half_rod[:3] += dt * half_rod[3:]
    guess, guess_rod = half.copy(), half_rod.copy()
    guess[:, 2:] += dt / 2 * F.dydt[:, 2:]
    guess_rod[3:] += dt / 2 * F.drod[3:]
    F = right_hand_side(scene, geometry, t + dt, guess, guess_rod, mode, u_drv0)
    half[:, 2:] += dt / 2 * F.dydt[:, 2:]
    half_rod[3:] += dt / 2 * F.drod[3:]
    return with_rod(scene, half, half_rod), half_rod


@dataclass
class Run:
    """The state after `steps` steps, with works and switches.

    works: integrals of the powers (J) plus "switching", the switching loss.
    switches: (step, block, old mode, new mode), the step counted from 1.
    """

    y: np.ndarray
    rod: np.ndarray
    mode: np.ndarray
    slip: np.ndarray
    steps: int = 0
    works: dict[str, float] = member(
        default_factory=lambda: dict.fromkeys((*WORKS, "switching"), 0)
    )
    switches: list[tuple[int, int, int, int]] = member(default_factory=list)


def run(
    scene: Any,
    geometry: str,
    y: np.ndarray,
    rod: np.ndarray,
    mode: np.ndarray,
    u_drv0: Any,
    dt: float,
    steps: int,
    first: int = 0,
    slip: np.ndarray | None = None,
) -> Run:
    """Return the run of `steps` RK4 steps from t = first dt, contacts switched at step ends."""
    slip = np.zeros(scene.N_x) if slip is None else slip
    now = Run(with_rod(scene, y, rod), np.array(rod, dtype=float), np.array(mode), slip.copy())
    for n in range(first, first + steps):
        now.y, now.rod, now.slip, works = rk4_step(
            scene, geometry, n * dt, now.y, now.rod, now.mode, u_drv0, dt, now.slip
        )
        end = (n + 1) * dt
        new, now.y, loss = switch(scene, geometry, end, now.y, now.rod, now.mode, u_drv0)
        for i in np.flatnonzero(new != now.mode):
            now.switches.append((n + 1, int(i), int(now.mode[i]), int(new[i])))
        now.mode = new
        now.slip[new == STUCK] = 0.0
        now.steps += 1
        for name in WORKS:
            now.works[name] += works[name]
        now.works["switching"] += loss
    return now
