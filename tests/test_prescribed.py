"""A prescribed interface in two dimensions: scenes, forces, walls, waves, whole runs."""

import dataclasses
import functools
import tomllib

import numpy as np
import pytest
import tomli_w
import twin
from helpers import ENERGY_IN, ENERGY_OUT, advance, bits, budget_error, operators, refused, same_run
from tolerances import ROUNDING

import pyfric
from pyfric import core
from pyfric.core import STUCK
from pyfric.scene import Scene, Walls, setup1, setup2, slab
from pyfric.statics import ContactProblem, loaded_state, stability_limit

simulate = functools.partial(pyfric.simulate, fidelity="dynamic")

WALLS = [
    {},
    {"left": "mirrored"},
    {"right": "mirrored", "top": "held"},
    {"left": "mirrored", "right": "mirrored", "top": "mirrored"},
    {"left": "absorbing", "right": "mirrored", "top": "absorbing"},
    {"left": "free", "right": "absorbing", "top": "mirrored"},
    {"left": "absorbing", "right": "absorbing", "top": "absorbing"},
]


def small(N_x=7, N_z=4, walls=(), **changes):
    l, rest = 2.5e-3, {"p": lambda x: 60 + 1e3 * x, "tau": lambda x: 20 - 2e3 * x}
    size = {"L": (N_x - 1) * l, "H": (N_z - 1) * l, "l": l, "K": 4e6, "V": 0.02}
    rest |= {"dashpots": "full"}  # dashpots of the twin
    return slab(**size | rest | {"walls": Walls(**dict(walls))} | changes)


def shaken(scene, seed=0):
    """Return a state away from rest in which blocks are stuck and slip either way."""
    rng = np.random.default_rng(seed)
    state = loaded_state(scene).state(scene, 0.2 * stability_limit(scene)[0])
    size = scene.F_N / scene.N_x / scene.slider.k
    state.y[:, :2] = 0.3 * size * rng.standard_normal((scene.N_z, 2, scene.N_x))
    state.y[:, 2:] = 1e5 * size * rng.standard_normal((scene.N_z, 2, scene.N_x))
    state.mode[:] = np.resize([STUCK, 1, -1], scene.N_x)
    state.y[0, 2, state.mode == STUCK] = 0
    if scene.walls.top == "held":
        state.y[-1] = 0
    return state


# --- scenes --------------------------------------------------------------------------------------


def test_forces_are_numbers_lists_or_functions_of_x():
    x = 2.5e-3 * np.arange(7)
    scene = small()
    np.testing.assert_array_equal(scene.p_prescribed, 60 + 1e3 * x)
    np.testing.assert_array_equal(scene.shear, 20 - 2e3 * x)
    assert small(p=tuple(60 + 1e3 * x), tau=list(20 - 2e3 * x)) == scene
    assert not scene.load.any()
    ends = small(walls={"left": "absorbing", "right": "absorbing"})  # half blocks have half of p
    np.testing.assert_array_equal(ends.p_prescribed[[0, -1]], scene.p_prescribed[[0, -1]] / 2)
    np.testing.assert_array_equal(ends.shear[[0, -1]], scene.shear[[0, -1]] / 2)
    np.testing.assert_array_equal(ends.p_prescribed[1:-1], scene.p_prescribed[1:-1])
    half = small(walls={"left": "mirrored"})  # x counts from the plane of the mirror
    np.testing.assert_array_equal(half.p_prescribed, 60 + 1e3 * (x + 1.25e-3))
    other = small(side="right")
    np.testing.assert_array_equal(other.p_prescribed[::-1], scene.p_prescribed)
    np.testing.assert_array_equal(other.shear[::-1], -scene.shear)
    refused(lambda: small(p=lambda x: x - 1), "top.p", "block 1", value=-1.0, within=(0,))
    refused(lambda: small(tau=lambda x: "a"), "top.tau", "block 1")


@pytest.mark.parametrize("walls", WALLS)
def test_files_hold_walls_where_there_are_any(walls):
    scene = small(walls=walls)
    text = scene.to_toml()
    assert Scene.from_toml(text) == scene
    assert ("[walls]" in text) == bool(walls)
    assert "walls" not in setup1().to_toml()


def test_refusals():
    document = tomllib.loads(small().to_toml())
    document["walls"] = {"left": "open"}
    refused(lambda: Scene.from_toml(tomli_w.dumps(document)), "walls.left", "'mirrored'", "'open'")
    refused(lambda: Walls(top="mirror"), "walls.top", "'held'")
    refused(lambda: small(k_f=1e6), "interface.k_f", "no foundation")
    refused(lambda: small(p=(1.0,) * 6), "top.p", "7 of them", "6 numbers")
    refused(lambda: small(h=7.5e-3, walls={"top": "held"}), "driver.h", "0.005 m", "held")
    refused(lambda: small(h=0.0), "driver.h", value=0.0, unit="m", within=(0.0025, 0.0075))
    mirror = Walls(left="mirrored")
    refused(lambda: dataclasses.replace(setup2(), walls=mirror), "walls.left", "'free'")
    no_driver = dataclasses.replace(setup1().driver, K=0.0)
    refused(lambda: dataclasses.replace(setup1(), driver=no_driver), "driver.K", "> 0 N/m")
    springs = dataclasses.replace(small().top, k_top=1.0)
    refused(lambda: dataclasses.replace(small(), top=springs), "top.k_top", "chain")


def test_engines_without_full_dynamics_say_why_not():
    scene = small()
    for fidelity in ("hybrid", "quasistatic", "equilibrium"):
        refused(lambda f=fidelity: pyfric.simulate(scene, 1e-4, fidelity=f), "top.kind", "dynamics")
    refused(lambda: pyfric.prediction_curve(scene), "top.kind")
    refused(lambda: ContactProblem(scene), "top.kind")
    refused(lambda: pyfric.solve_static(scene, np.zeros(7), 0.0), "top.kind")
    refused(lambda: simulate(scene, 1e-4, geometry="finite"), "geometry", "linear")
    hybrid, level, *_ = pyfric.plan(scene).levels
    assert (level.engine, level.geometry, level.switching) == ("dynamic", "linear", "located")
    assert "prescribed interface" in hybrid.cannot


# --- forces --------------------------------------------------------------------------------------


@pytest.mark.parametrize("walls", WALLS)
@pytest.mark.parametrize("size", [(4, 3), (6, 5), (9, 3)])
def test_forces_energies_and_powers_are_those_of_the_twin(walls, size):
    scene = small(*size, walls)
    state, t = shaken(scene), 1.234e-3
    model = core.model(scene, "linear", state.u_drv0)
    found = core.evaluate(model, state, t)
    slip = state.slip
    right = twin.right_hand_side(
        scene, "linear", t, state.y, state.rod, state.mode, state.u_drv0, slip
    )
    scale = np.abs(right.dydt[:, 2:]).max()
    free = state.mode != STUCK
    np.testing.assert_allclose(found.a[1:], right.dydt[1:, 2:], rtol=0, atol=ROUNDING * scale * 4)
    np.testing.assert_allclose(
        found.a[0][:, free], right.dydt[0, 2:][:, free], rtol=0, atol=ROUNDING * scale * 4
    )
    np.testing.assert_allclose(found.f, right.f, rtol=0, atol=4 * ROUNDING * scale * scene.m)
    np.testing.assert_array_equal(found.p, scene.p_prescribed)
    assert sum(found.dissipated) == pytest.approx(right.rates["bonds"], rel=1e-13)
    assert found.work[1] == pytest.approx(right.rates["load"], rel=1e-13)
    energies = core.energies(model, state, t)
    e = twin.energies(scene, "linear", state.y, state.rod, t, state.u_drv0)
    assert energies["elastic_bonds"] == pytest.approx(e["bonds"], rel=1e-13)
    assert sum(energies.values()) == pytest.approx(e["total"], rel=1e-13)


def test_the_start_has_the_forces_of_the_core():
    scene = small()
    start = loaded_state(scene)
    found = core.evaluate(core.model(scene, "linear", start.u_drv0), start.state(scene, 1e-7), 0.0)
    np.testing.assert_array_equal(start.f, found.f)
    np.testing.assert_array_equal(start.p, found.p)
    assert start.F_T == found.F_T


@pytest.mark.parametrize("walls", WALLS)
@pytest.mark.parametrize("dashpots", ["full", "along"])
def test_matrices_are_the_forces_of_the_core(walls, dashpots):
    scene = small(6, 4, walls, K=0.0, tau=0.0, dashpots=dashpots)
    state = shaken(scene)
    state.mode[:] = 1
    found = core.evaluate(core.model(scene, "linear", 0.0), state, 0.0)
    M, K, C = operators(scene)
    n = len(M)
    u, v = state.y[:, :2].ravel()[:n], state.y[:, 2:].ravel()[:n]
    force = -(K @ u + C @ v)
    force[: scene.N_x] += found.f
    expected = M * found.a.ravel()[:n]
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


# --- runs ----------------------------------------------------------------------------------------


def test_half_a_slider_is_half_of_the_whole_one():
    def dome(x):
        return 60 * np.exp(-((x / 6e-3) ** 2))

    rest = {"p": 100.0, "H": 0.02, "K": 0.0, "V": 0.0, "mu_s": 0.55, "mu_k": 0.3}
    half = small(9, tau=dome, walls={"left": "mirrored"}, **rest)
    middle = 8.5 * half.slider.l
    whole = small(18, tau=lambda x: dome(x - middle), **rest)
    runs = [simulate(scene, 6e-5, switching="located", energies=True) for scene in (half, whole)]
    one, both = (run.final_state for run in runs)
    size = np.abs(both.y[0, 0]).max()
    assert 2 <= (one.y[0, 0] > 0).sum() <= 9
    np.testing.assert_allclose(both.y[:, 0, 9:], one.y[:, 0], rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(both.y[:, 1, 9:], one.y[:, 1], rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(both.y[:, 1, 8::-1], -one.y[:, 1], rtol=0, atol=1e-9 * size)
    columns = ["elastic_bonds", *ENERGY_IN, *ENERGY_OUT]
    np.testing.assert_allclose(
        runs[1].curve[columns].iloc[-1],
        2 * runs[0].curve[columns].iloc[-1],
        rtol=1e-8,
        atol=1e-10 * runs[0].curve["friction_heat"].iloc[-1],
    )


@pytest.mark.parametrize("walls", WALLS[3:])
def test_energy_closes(walls):
    scene = small(12, 8, walls, tau=lambda x: 45 - 1e3 * x, mu_s=0.5, mu_k=0.3)
    record = simulate(scene, 2e-4, dt=1e-7, switching="located")
    heat = record.curve["friction_heat"].iloc[-1]
    assert heat > 0
    assert budget_error(record) < 1e-6 * heat


def test_split_runs_threads_and_the_whole_give_the_same_bits():
    scene = small(12, 8, WALLS[4], tau=lambda x: 45 - 1e3 * x, mu_s=0.5, mu_k=0.3)
    whole = simulate(scene, 1e-4, switching="located")
    first = simulate(scene, 5e-5, switching="located", threads=2)
    again = simulate(scene, 1e-4, initial=first)
    assert whole.switches["block"].size >= 12
    assert bits(whole.final_state) == bits(again.final_state)
    assert same_run(whole, again, counts={}, method=whole.method, curve=whole.curve)


@pytest.mark.parametrize("beyond", ["absorbing", "free", "mirrored"])
def test_a_row_that_starts_to_slide_loses_rho_c_S_v_until_the_wave_returns(beyond):
    """Uniform slip sends up a plane shear wave, which returns from a free top after 2 H/c_S."""
    walls = {"left": "mirrored", "right": "mirrored", "top": beyond}
    scene = small(4, 61, walls, p=100.0, tau=60.0, mu_s=0.5, mu_k=0.4, K=0.0, V=0.0)
    c_S = scene.slider.l * np.sqrt(scene.slider.k / 2 / scene.m)
    v = (60.0 - 40.0) / np.sqrt(scene.slider.k * scene.m / 2)
    back = 2 * scene.slider.H / c_S
    before = simulate(scene, 0.6 * back).final_state.y[0, 2]
    np.testing.assert_allclose(before, v, rtol=2e-3)
    after = simulate(scene, 1.5 * back).final_state.y[0, 2]
    expected = {"absorbing": v, "free": 3 * v, "mirrored": 3 * v}[beyond]
    np.testing.assert_allclose(after, expected, rtol=6e-3)


class Waves:
    """Plane waves of the lattice that hit an absorbing top, l = k = m = 1.

    q_x fits between mirrored sides. q_z spreads about the value of the wanted angle, in packets 1.5
    waves long.
    """

    def __init__(self, wave, degrees, length):
        """Take "P" or "S", the angle to the normal, and the length of the waves."""
        self.branch, self.length, self.sigma = "SP".index(wave), length, 1.5 * length
        sin, tan = np.sin(np.deg2rad(degrees)), np.tan(np.deg2rad(degrees))
        self.N_x = round(length / (2 * sin)) if sin else 3
        self.q_x = np.pi / self.N_x if sin else 0.0
        middle = self.q_x / tan if sin else 2 * np.pi / length
        self.q = middle + np.linspace(-4, 4, 81) / self.sigma
        self.weight = np.exp(-(((self.q - middle) * self.sigma) ** 2) / 4)
        self.omega2 = np.array([np.linalg.eigvalsh(self.stiffness(q))[self.branch] for q in self.q])
        shapes = [np.linalg.eigh(self.stiffness(q))[1][:, self.branch] for q in self.q]
        like = (self.q_x, middle) if wave == "P" else (middle, -self.q_x)
        self.shape = np.array([e * np.sign(e @ like) for e in shapes])
        power = (self.weight * np.sqrt(self.omega2)) ** 2
        self.share = power / power.sum()
        speeds = np.sqrt(self.omega2[[39, 41]])
        self.speed = np.diff(speeds)[0] / (self.q[41] - self.q[39])

    def stiffness(self, q_z):
        """Stiffness of plane waves, 2 x 2."""
        c_x, s_x, c, s = np.cos(self.q_x), np.sin(self.q_x), np.cos(q_z), np.sin(q_z)
        return np.array([[3 - 2 * c_x - c_x * c, s_x * s], [s_x * s, 3 - 2 * c - c_x * c]])

    def packet(self, x, z):
        """Return displacements and velocities at t = 0, (2, N_z, N_x) each, around z = 0."""
        at, omega = self.q[:, None] * z[:, 0], np.sqrt(self.omega2)
        across = np.array([np.cos(self.q_x * x), -np.sin(self.q_x * x)])
        found = []
        for of_x, of_z in ((np.cos(at), np.sin(at)), (np.sin(at), -np.cos(at))):
            waves = np.stack([of_x, of_z]) * (self.weight * self.shape.T)[:, :, None]
            waves = waves if not found else waves * omega[:, None]
            found.append(waves.sum(axis=1)[:, :, None] * across)
        return found

    def reflected(self, part):
        """Return reflected over incoming energy, for top blocks of the share `part`."""
        each = [self._reflected(q, W, part) for q, W in zip(self.q, self.omega2, strict=True)]
        return self.share @ each

    def _reflected(self, q_z, omega2, part):
        """Return reflected waves of one frequency, from the equations of the top row."""
        c_x, s_x = np.cos(self.q_x), np.sin(self.q_x)
        a, b = 3 - 2 * c_x - omega2, 3 - omega2
        of_cos = [c_x * (2 + c_x) + s_x**2, -(a * (2 + c_x) + b * c_x), a * b - s_x**2]
        leaving = []
        for q in np.arccos(np.roots(of_cos).astype(complex)):
            evanescent = abs(q.imag) > 1e-9
            up = q.imag < 0 if evanescent else self._flux(self._mode(q, omega2), q.real) < 0
            leaving.append(q if up else -q)  # decays or carries energy downward
        waves = [(self._mode(q, omega2), q) for q in leaving]
        came = self._mode(complex(q_z), omega2)
        matrix = np.column_stack([self._at_top(e, q, omega2, part) for e, q in waves])
        size = np.linalg.solve(matrix, -self._at_top(came, q_z, omega2, part))
        real = [
            (abs(s) ** 2, e, q.real) for s, (e, q) in zip(size, waves, strict=True) if not q.imag
        ]
        return -sum(s * self._flux(e, q) for s, e, q in real) / self._flux(came, q_z)

    def _mode(self, q, omega2):
        matrix = self.stiffness(q) - omega2 * np.eye(2)
        row = matrix[np.argmax(np.abs(matrix).sum(axis=1))]
        return np.array([-row[1], row[0]]) / np.linalg.norm(row)

    def _flux(self, e, q):
        c_x, s_x, c, s = np.cos(self.q_x), np.sin(self.q_x), np.cos(q), np.sin(q)
        return (e.conj() @ np.array([[c_x * s, s_x * c], [s_x * c, (2 + c_x) * s]]) @ e).real

    def _at_top(self, e, q, omega2, part):
        """Return forces on a block of the top row, and -m a."""
        c_x, s_x, below = np.cos(self.q_x), np.sin(self.q_x), e * np.exp(-1j * q)
        force_x = -2 * part * (1 - c_x) * e[0] + (c_x * below[0] - e[0]) / 2 - 0.5j * s_x * below[1]
        force_z = below[1] - e[1] + (c_x * below[1] - e[1]) / 2 - 0.5j * s_x * below[0]
        dashpots = 1j * np.sqrt(omega2) * np.sqrt([0.5, 1.5]) * e
        return np.array([force_x, force_z]) + dashpots + part * omega2 * e


def reflected(waves):
    """Return the reflected energy of a packet at an absorbing top, over its incoming energy."""
    N_x, N_z = waves.N_x, 15 * waves.length
    walls = Walls(left="mirrored", right="mirrored", top="absorbing")
    size = {"L": N_x - 1.0, "H": N_z - 1.0, "l": 1.0, "M": float(N_x * N_z)}
    scene = slab(**size, k=1.0, eta=0.0, p=1e-9, walls=walls)
    x, z = np.meshgrid(np.arange(N_x) + 0.5, np.arange(N_z) - 8.0 * waves.length)
    u, v = waves.packet(x, z)
    state = loaded_state(scene).state(scene, 0.5)
    state.y[:, :2], state.y[:, 2:] = u.transpose(1, 0, 2), v.transpose(1, 0, 2)
    state.mode[:] = 1
    model = core.model(scene, "linear", 0.0)
    before = sum(core.energies(model, state, 0.0).values())
    advance(scene, "linear", state, round(13 * waves.length / waves.speed / 0.5))
    return sum(core.energies(model, state, 0.0).values()) / before


def lysmer(wave, degrees):
    """Return the reflected energy of plane waves at such dashpots on a continuum."""
    c_P, c_S = np.sqrt(1.5), np.sqrt(0.5)
    sin = np.sin(np.deg2rad(degrees)) / (c_P if wave == "P" else c_S)  # slowness along x
    cos_P, cos_S = (np.sqrt(complex(1 / c**2 - sin**2)) for c in (c_P, c_S))

    def residual(d_x, d_z, up):
        """Return traction on the wall plus impedance times velocity, over -i omega, rho = 1."""
        mu, lam = c_S**2, c_P**2 - 2 * c_S**2
        shear = mu * (-(up * d_x) - sin * d_z)
        normal = -lam * (sin * d_x + up * d_z) - 2 * mu * up * d_z
        return np.array([shear + c_S * d_x, normal + c_P * d_z])

    P = residual(sin * c_P, -cos_P * c_P, -cos_P)
    S = residual(cos_S * c_S, sin * c_S, -cos_S)
    came = (sin * c_P, cos_P * c_P, cos_P) if wave == "P" else (cos_S * c_S, -sin * c_S, cos_S)
    a, b = np.linalg.solve(np.column_stack([P, S]), -residual(*came))
    flux = abs(a) ** 2 * c_P**2 * cos_P.real + abs(b) ** 2 * c_S**2 * cos_S.real
    return flux / ((c_P**2 * cos_P.real) if wave == "P" else (c_S**2 * cos_S.real))


@pytest.mark.parametrize(("wave", "degrees"), [("P", 5), ("P", 45), ("S", 0), ("S", 45)])
def test_absorbing_walls_reflect_what_theory_says(wave, degrees):
    """Amplitudes of packets agree with solutions for single waves at the top."""
    waves = Waves(wave, degrees, 16)
    found, expected = np.sqrt([reflected(waves), waves.reflected(0.5)])
    assert abs(found - expected) < 5e-4


@pytest.mark.parametrize("length", [8, 16, 64])
def test_half_blocks_reflect_by_the_square_of_the_wave_number(length):
    """At normal incidence they reflect the share tan^2(q l/4), and whole blocks tan(q l/4)."""
    waves = Waves("S", 0, length)
    for part, exponent in ((0.5, 4), (1.0, 2)):
        expected = waves.share @ np.tan(waves.q / 4) ** exponent
        assert waves.reflected(part) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("wave", "degrees"), [("P", 30), ("P", 45), ("S", 20), ("S", 45), ("S", 60)]
)
def test_long_waves_are_reflected_as_by_a_continuum(wave, degrees):
    """The effect of the lattice falls with the square of the wave number."""
    rest = []
    for length in (64, 256):
        waves = Waves(wave, degrees, length)
        waves.q, waves.omega2, waves.share = waves.q[40:41], waves.omega2[40:41], np.ones(1)
        angle = np.rad2deg(np.arctan(waves.q_x / waves.q[0]))
        rest.append(np.sqrt(waves.reflected(0.5)) - np.sqrt(lysmer(wave, angle)))
    assert 0 < rest[1] / rest[0] < 1 / 15
