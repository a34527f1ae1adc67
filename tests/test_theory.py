"""Theory of fronts: published values, a second quadrature, limits, inverses, the lattice."""

import re
import warnings

import numpy as np
import pandas as pd
import pint
import pytest
from scipy import integrate
from scipy.special import beta

import pyfric
from pyfric import chain, setup2, simulate, theory
from pyfric.record import front_speed
from pyfric.statics import dispersion, solve_static, spring_stiffness
from pyfric.statics.operators import bonds
from pyfric.theory.cracks import _I
from pyfric.theory.waves import reduced_D
from pyfric.values import SceneError

ROCK = theory.Material(c_P=6000.0, c_S=3464.0, rho=2670.0)
CAUCHY = theory.Material(c_P=np.sqrt(3), c_S=1.0, rho=1.0)  # lambda = mu, as the lattice
STIFF = theory.Material(c_P=10.0, c_S=1.0, rho=1.0)
SOFT = theory.Material(c_P=1.1, c_S=1.0, rho=1.0)
MATERIALS = pytest.mark.parametrize("material", [ROCK, CAUCHY, STIFF, SOFT])


@pytest.fixture(autouse=True)
def _no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def refused(field, call, *args, **kwargs):
    with pytest.raises(ValueError, match=rf"^{re.escape(field)} = .*; allowed: \S"):
        call(*args, **kwargs)


# --- waves ---------------------------------------------------------------------------------------


def test_waves_are_those_of_the_stiffness_matrix():
    """In the interior a plane wave along x is an eigenvector of the assembled matrix."""
    scene = pyfric.setup1(L=30e-3, H=30e-3, l=2.5e-3, h=5e-3)
    k, m, l = scene.slider.k, scene.m, scene.slider.l
    K = spring_stiffness(bonds(scene))
    x = np.arange(scene.N_x) * l
    middle = scene.N_z // 2, slice(1, -1)
    for c, polarisation in enumerate(("longitudinal", "shear")):
        for q in (0.1 / l, 1.0 / l, np.pi / l):
            u = np.zeros((scene.N_z, 2, scene.N_x))
            u[:, c] = np.cos(q * x + 0.3)
            force = (K @ u.ravel()).reshape(u.shape)
            omega = theory.lattice_waves(k, m, l, q, polarisation).omega
            found = force[middle[0], c, middle[1]]
            np.testing.assert_allclose(
                found, m * omega**2 * u[middle[0], c, middle[1]], rtol=1e-9, atol=1e-9 * k
            )


def test_waves_against_dispersion():
    scene = pyfric.setup1()
    k, m, l = scene.slider.k, scene.m, scene.slider.l
    q = np.linspace(0, np.pi / l, 31)
    omega, _ = dispersion(scene, np.stack([q, 0 * q], axis=-1))
    for column, polarisation in ((1, "longitudinal"), (0, "shear")):
        waves = theory.lattice_waves(k, m, l, q, polarisation)
        np.testing.assert_allclose(waves.omega, omega[:, column], rtol=1e-7)
        np.testing.assert_allclose(waves.phase[1:], waves.omega[1:] / q[1:], rtol=1e-12)
        d, inner = 1e-4 / l, q[1:-1]
        up, down = (
            theory.lattice_waves(k, m, l, inner + s * d, polarisation).omega for s in (1, -1)
        )
        np.testing.assert_allclose(waves.group[1:-1], (up - down) / (2 * d), rtol=1e-7)


def test_chain_waves():
    scene = pyfric.chain(k_top=0.0)
    k, m, l = scene.slider.k, scene.m, scene.slider.l
    q = np.array([0.2, 1.0, 3.0]) / l
    omega, _ = dispersion(scene, np.stack([q, 0 * q], axis=-1))
    waves = theory.lattice_waves(k, m, l, q, "chain")
    np.testing.assert_allclose(waves.omega, omega[:, 1], rtol=1e-12)
    assert theory.lattice_waves(k, m, l, 0.0, "chain").phase == pytest.approx(l * np.sqrt(k / m))


def test_speeds_of_the_paper():
    """Waves have 1720 and 993 m/s on the lattice, 1677 and 968 m/s with the density factor."""
    scene = pyfric.setup1()
    k, m, l, B = scene.slider.k, scene.m, scene.slider.l, 6e-3
    lattice = theory.Material.of_lattice(k, m, l, B)
    factor = theory.density_factor(scene.N_x, scene.N_z)
    slider = theory.Material.of_lattice(k, m * factor, l, B)
    assert (round(lattice.c_P), round(lattice.c_S)) == (1720, 993)
    assert (round(slider.c_P), round(slider.c_S)) == (1677, 968)
    assert slider.rho == pytest.approx(scene.slider.M / (scene.slider.L * scene.slider.H * B))
    assert slider.E_prime == pytest.approx(4 * k / (3 * B), rel=1e-12)
    assert slider.nu_plane_stress == pytest.approx(1 / 3)
    assert slider.nu_plane_strain == pytest.approx(1 / 4)


def test_rayleigh_speed():
    """The speed is a root of Rayleigh's cubic equation, another form of D = 0."""
    assert theory.rayleigh_speed(np.sqrt(3), 1.0) == pytest.approx(0.919402, abs=5e-7)
    assert theory.Material.plane_strain(1e9, 0.25, 1e3).c_R == pytest.approx(
        0.919402 * np.sqrt(1e6 / 2.5), rel=1e-6
    )
    assert CAUCHY.c_R**2 == pytest.approx(2 - 2 / np.sqrt(3), rel=1e-13)  # closed for lambda = mu
    for material in (ROCK, STIFF, SOFT):
        r = material.r
        roots = np.roots([1, -8, 24 - 16 * r, -16 * (1 - r)])
        real = roots[(abs(roots.imag) < 1e-9) & (roots.real > 0) & (roots.real < 1)].real
        assert len(real) == 1
        assert material.c_R / material.c_S == pytest.approx(np.sqrt(real[0]), rel=1e-10)


@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.2, 1 / 3, 0.45])
def test_plane_stress_and_plane_strain(nu):
    """Plane stress with nu is plane strain with nu/(1 + nu)."""
    E, rho = 3e9, 1200.0
    plate, bulk = theory.Material.plane_stress(E, nu, rho), theory.Material.plane_strain(E, nu, rho)
    assert plate.nu_plane_stress == pytest.approx(nu, abs=1e-12)
    assert plate.nu_plane_strain == pytest.approx(nu / (1 + nu), abs=1e-12)
    assert bulk.nu_plane_strain == pytest.approx(nu, abs=1e-12)
    assert plate.E_prime == pytest.approx(E, rel=1e-12)
    assert bulk.E_prime == pytest.approx(E / (1 - nu**2), rel=1e-12)
    assert plate.mu == pytest.approx(E / (2 * (1 + nu)), rel=1e-12)


# --- cracks --------------------------------------------------------------------------------------

TABLE_G = {
    0.1: 0.97545, 0.3: 0.85505, 0.5: 0.69628, 0.7: 0.51676,
    0.8: 0.41124, 0.9: 0.27231, 0.95: 0.16921, 0.99: 0.04337,
}  # fmt: skip


def test_g_II_table():
    v = np.array(list(TABLE_G)) * CAUCHY.c_R
    np.testing.assert_allclose(theory.g_II(CAUCHY, v), list(TABLE_G.values()), rtol=0, atol=5.1e-6)


def k_II_literal(material, v):
    """Return k_II by definition: R of complex slowness, I by quadrature in x = tan(t)/v."""
    a, b = 1 / material.c_P, 1 / material.c_S

    def R(z):
        s, d = np.sqrt(b**2 - z * z + 0j), np.sqrt(a**2 - z * z + 0j)
        return ((b**2 - 2 * z * z) ** 2 + 4 * z * z * s * d).real

    def f(t):
        x = np.tan(t) / v
        rest = np.cos(t) ** 3 * v**3 / np.sqrt(b**2 + x * x) / (v * np.cos(t) ** 2)
        return R(1j * x) * rest

    # Near t = pi/2 this R loses digits: it is cut there, where f is flat.
    whole = integrate.quad(f, 0, np.pi / 2 - 1e-3, epsabs=0, epsrel=1e-11)[0]
    whole += 1e-3 * f(np.pi / 2 - 5e-4)
    I = v * b**2 / whole
    # 1/v lies above both branch points: sqrt(a^2 - z^2) sqrt(b^2 - z^2) = -|.||.|
    z = 1 / v
    R_v = (b**2 - 2 * z**2) ** 2 - 4 * z**2 * np.sqrt(z**2 - a**2) * np.sqrt(z**2 - b**2)
    return I, -I * R_v * v / b**2 / np.sqrt(z**2 - b**2)


@MATERIALS
@pytest.mark.parametrize("fraction", [0.2, 0.5, 0.8, 0.97])
def test_k_II_against_another_quadrature(material, fraction):
    v = fraction * material.c_R
    I, k = k_II_literal(material, v)
    assert theory.I_v(material, v) == pytest.approx(I, rel=1e-8)
    assert theory.k_II(material, v) == pytest.approx(k, rel=1e-8)


@MATERIALS
def test_slip_of_an_infinitely_fast_front(material):
    """I is slip over static slip 4 dtau a/E', over 2 (1 - r). Behind an infinitely fast front
    bodies slide uniformly and radiate, at the slip rate 2 dtau/(rho c_S)."""
    xi = 1e7
    slip_rate = 4 / material.E_prime * 2 * (1 - material.r) * _I(np.asarray(xi), material.r)
    slip_rate *= xi * material.c_S
    one_body = 1 / (material.rho * material.c_S)
    assert slip_rate == pytest.approx(2 * one_body, rel=1e-5)
    assert theory.I_v(material, 0.0) * 2 * (1 - material.r) == pytest.approx(1)


@MATERIALS
def test_functions_of_the_front_speed(material):
    """The functions agree with their definitions where these lose no digits."""
    v = np.linspace(0.2, 0.99, 9) * material.c_R
    s, d = theory.alpha_s(material, v), theory.alpha_d(material, v)
    np.testing.assert_allclose(s**2, 1 - (v / material.c_S) ** 2, rtol=1e-12)
    np.testing.assert_allclose(d**2, 1 - (v / material.c_P) ** 2, rtol=1e-12)
    D = theory.D(material, v)
    np.testing.assert_allclose(D, 4 * s * d - (1 + s**2) ** 2, rtol=0, atol=1e-14)
    A = v**2 * s / ((1 - material.nu_plane_strain) * material.c_S**2 * D)
    np.testing.assert_allclose(theory.A_II(material, v), A, rtol=1e-9)
    in_plate = v**2 * s * (1 + material.nu_plane_stress) / (material.c_S**2 * D)
    np.testing.assert_allclose(A, in_plate, rtol=1e-12)
    g = theory.g_II(material, v)
    np.testing.assert_allclose(g, A * theory.k_II(material, v) ** 2, rtol=1e-9)


@MATERIALS
def test_limits(material):
    slow = np.array([0.0, 1e-9, 1e-4]) * material.c_S
    for function in (theory.g_II, theory.A_II, theory.k_II):
        np.testing.assert_allclose(function(material, slow), 1, atol=2e-4)
        assert function(material, 0.0) == pytest.approx(1, abs=1e-13)
    assert abs(theory.g_II(material, material.c_R)) < 1e-13
    assert abs(theory.k_II(material, material.c_R)) < 1e-13
    near = theory.A_II(material, material.c_R * (1 - np.array([1e-6, 1e-8])))
    assert near[1] / near[0] == pytest.approx(100, rel=1e-2)  # a simple pole at c_R
    g = theory.g_II(material, np.linspace(0, material.c_R, 101))
    assert (np.diff(g) < 0).all()


def test_D_without_cancellation():
    """D c_S^2/v^2 tends to 2 (1 - r), where the definition has no digit left."""
    assert reduced_D(1e-20, 1 / 3) == pytest.approx(4 / 3, rel=1e-15)


def test_a_v_a():
    a = np.geomspace(1.001, 1e4, 40)
    critical = theory.crack_length(ROCK, 0.0, 5e6, 1e6)
    assert critical == pytest.approx(2 * 1e6 * ROCK.E_prime / (np.pi * 5e6**2))  # one body
    v = theory.crack_speed(ROCK, a * critical, 5e6, 1e6)
    assert (np.diff(v) > 0).all()
    np.testing.assert_allclose(theory.crack_length(ROCK, v, 5e6, 1e6), a * critical, rtol=1e-9)
    assert theory.crack_speed(ROCK, 0.99 * critical, 5e6, 1e6) == 0
    assert theory.crack_speed(ROCK, critical, 5e6, 0.0) == pytest.approx(ROCK.c_R)


def test_one_body_is_half_of_two():
    drop, p, mu_s, mu_k, d_c = 10e6, 120e6, 0.677, 0.525, 0.2
    one, both = (theory.fracture_energy(mu_s, mu_k, p, d) for d in (d_c, 2 * d_c))
    assert one == pytest.approx(0.152 * 120e6 * 0.1)
    assert both == pytest.approx(2 * one)
    a = np.array([3e3, 12e3])
    v = theory.crack_speed(ROCK, a, drop, one, bodies=1)
    np.testing.assert_allclose(v, theory.crack_speed(ROCK, a, drop, both, bodies=2), rtol=1e-12)
    zones = [
        theory.cohesive_zone(ROCK, mu_s, mu_k, p, d, bodies=n) for n, d in ((1, d_c), (2, 2 * d_c))
    ]
    assert zones[0] == pytest.approx(zones[1], rel=1e-14)
    K = theory.stress_intensity(a, drop)
    G = theory.energy_release_rate(ROCK, K, v, bodies=2)
    np.testing.assert_allclose(G, both, rtol=1e-9)
    np.testing.assert_allclose(theory.energy_release_rate(ROCK, K, v), one, rtol=1e-9)
    np.testing.assert_allclose(theory.energy_release_rate(ROCK, K, bodies=2), K**2 / ROCK.E_prime)


def test_cohesive_zone():
    """The zone is 2.54 mm per um of d_c in the paper's scene at rest, shorter by A_II at speed."""
    E, p = 3e9, 3500 / (0.14 * 6e-3)
    material = theory.Material.plane_stress(E, 1 / 3, 1200.0)
    X_c0 = theory.cohesive_zone(material, 0.7, 0.45, p, 1e-6)
    assert X_c0 == pytest.approx(9 * np.pi / 32 * E * 1e-6 / (0.25 * p))
    assert X_c0 == pytest.approx(2.5447e-3, abs=5e-8)
    v = 0.9 * material.c_R
    X_c = theory.cohesive_zone(material, 0.7, 0.45, p, 1e-6, v)
    assert X_c * theory.A_II(material, v) == pytest.approx(X_c0)
    assert theory.cohesive_zone(ROCK, 0.677, 0.525, 120e6, 0.4, bodies=2) == pytest.approx(
        9 * np.pi / 32 * ROCK.mu / (1 - ROCK.nu_plane_strain) * 0.4 / (0.152 * 120e6)
    )


@pytest.mark.parametrize("n", [0, 1, 2, 3, 4])
def test_stress_intensity_of_powers(n):
    """For dtau = t^n, K = (2/sqrt(pi)) a^(n + 1/2) B(1/2, (n + 1)/2)/2."""
    a = np.array([0.3, 2.0])
    K = 2 / np.sqrt(np.pi) * a ** (n + 0.5) * beta(0.5, (n + 1) / 2) / 2
    np.testing.assert_allclose(theory.stress_intensity(a, lambda t: t**n), K, rtol=1e-9)


def test_stress_intensity_that_cancels():
    """Stress drops of opposite sign cancel in K, at any magnitude."""
    for size in (1e-12, 1e12):

        def dtau(t, size=size):
            return size * (2 * t**2 - 1)

        assert abs(theory.stress_intensity(1.0, dtau)) < 1e-12 * size
        K = theory.stress_intensity(2.0, dtau)
        assert K == pytest.approx(np.sqrt(2 * np.pi) * (4 - 1) * size, rel=1e-12)


def test_stress_intensity_of_a_patch():
    """A stress drop only on |x| < b gives K = 2 sqrt(a/pi) dtau arcsin(b/a)."""
    a, b = np.array([0.5, 1.0, 1.0001, 3.0, 100.0]), 1.0
    K = 2 * np.sqrt(a / np.pi) * 7.0 * np.arcsin(np.minimum(b / a, 1))
    patch = theory.stress_intensity(a, lambda t: 7.0 * (t < b), breaks=[b])
    np.testing.assert_allclose(patch, K, rtol=1e-9)
    np.testing.assert_allclose(theory.stress_intensity(a, 7.0), 7 * np.sqrt(np.pi * a))


def test_a_front_stops_outside_its_patch():
    """K of the patch falls as a^(-1/2): the front starts, slows down and stops at G = Gamma."""
    b, drop = 1e3, 10e6
    critical = theory.energy_release_rate(ROCK, drop * np.sqrt(np.pi * 500.0))

    def patch(t):
        return drop * (t < b)

    a = np.array([400.0, 600.0, 1000.0, 1050.0, 50e3])
    v = theory.crack_speed(ROCK, a, patch, critical, breaks=[b])
    assert v[0] == v[-1] == 0
    assert (v[1:4] > 0).all()
    assert v[2] > v[1]
    assert v[2] > v[3]
    K = theory.stress_intensity(a[1:4], patch, breaks=[b])
    G = theory.energy_release_rate(ROCK, K, v[1:4])
    np.testing.assert_allclose(G, critical, rtol=1e-9)
    barrier = theory.crack_speed(ROCK, a[1:4], patch, critical * np.array([1, 1, 9]), breaks=[b])
    np.testing.assert_allclose(barrier, [v[1], v[2], 0], rtol=1e-12)
    pulled = theory.crack_speed(ROCK, b, lambda t: -patch(t), critical, breaks=[b])
    assert pulled == 0


def test_strength_excess():
    """S of TPV3 is 1.6 (81.24 - 70 over 70 - 63), and S = 1/tau_bar - 1."""
    tau_p, tau_r = 0.677 * 120e6, 0.525 * 120e6
    assert theory.strength_excess(tau_p, 70e6, tau_r) == pytest.approx(1.6, abs=0.01)
    tau_bar = np.array([0.1, 0.5, 0.9])
    S = theory.strength_excess(tau_p, tau_r + tau_bar * (tau_p - tau_r), tau_r)
    np.testing.assert_allclose(S, 1 / tau_bar - 1)
    assert theory.ANDREWS_S == 1.77


# --- chain ---------------------------------------------------------------------------------------

ETA = np.sqrt(0.1)
SPEEDS = [0.2, 0.5, 0.8, 0.95, 1.05, 1.2, 1.5, 2, 3]
# tau_bar at SPEEDS; the values agree with `by_brute_force` and, for v >= 0.5 and within 3e-4, with
# simulated chains of 700 blocks.
TABLE_CHAIN = {
    (0.0, ETA): [0.108589, 0.326654, 0.551071, 0.716755, 0.841631],
    (0.0, 1.0): [0.047619, 0.166667, 0.333333, 0.5, 0.666667],
    (0.1, 0.0): [
        0.016190, 0.030153, 0.072477, 0.204479, 0.393847, 0.579060, 0.753516, 0.868682, 0.943489,
    ],
    (0.3, ETA): [
        0.046779, 0.099279, 0.200263, 0.291915, 0.362446, 0.462254, 0.608141, 0.739885, 0.849540,
    ],
    (1.0, 0.0): [
        0.136539, 0.265936, 0.458901, 0.570381, 0.634314, 0.710375, 0.808197, 0.888923, 0.949063,
    ],
}  # fmt: skip


@pytest.mark.parametrize(("alpha", "eta"), TABLE_CHAIN)
def test_chain_table(alpha, eta):
    table = TABLE_CHAIN[alpha, eta]
    v = SPEEDS[-len(table) :]
    found = theory.chain_prestress(v, alpha, eta)
    np.testing.assert_allclose(found, table, rtol=0, atol=5.1e-7)
    np.testing.assert_allclose(theory.chain_speed(found, alpha, eta), v, rtol=1e-9)


def by_brute_force(v, alpha, eta, n=400_000, Q=200 * np.pi):
    """Return tau_bar with a complex kernel: ln q below 1, midpoints above, the stated tail."""

    def arg(q):
        above = v**2 * q**2 + 1j * alpha * v * q - 4 * np.sin(q / 2) ** 2 * (1 - 1j * eta * v * q)
        return np.angle(above / (v * q * (v * q + 1j * alpha)))

    y = np.linspace(np.log(1e-9), 0, 40001)
    total = np.trapezoid(arg(np.exp(y)), y)
    q = 1 + (np.arange(n) + 0.5) * (Q - 1) / n
    total += np.sum(arg(q) / q) * (Q - 1) / n + 2 * eta / (v * Q)
    return (1 if alpha else np.sqrt(1 - 1 / v**2)) * np.exp(-total / np.pi)


@pytest.mark.parametrize(
    ("v", "alpha", "eta"),
    [
        (0.2, 0.1, 0.0),
        (0.6, 1e-3, 0.2),
        (0.95, 0.3, ETA),
        (3.0, 0.1, 0.0),
        (1.01, 0.0, 0.5),
        (20.0, 2.0, 3.0),
    ],
)
def test_chain_against_brute_force(v, alpha, eta):
    found = theory.chain_prestress(v, alpha, eta)
    assert found == pytest.approx(by_brute_force(v, alpha, eta), rel=1e-6)


def test_chain_closed_forms():
    tau_bar = np.array([0.05, 0.3, 0.7, 0.95])
    critical = theory.chain_speed_critical(tau_bar)
    np.testing.assert_allclose(theory.chain_prestress(critical, 0.0, 1.0), tau_bar, rtol=1e-9)
    undamped = theory.chain_speed_undamped(tau_bar)
    np.testing.assert_allclose(theory.chain_prestress(undamped), tau_bar, atol=1e-13)
    # nothing is special at eta = 0 or alpha = 0
    np.testing.assert_allclose(theory.chain_prestress(undamped, 0.0, 1e-6), tau_bar, atol=1e-5)
    np.testing.assert_allclose(theory.chain_prestress(undamped, 1e-6, 0.0), tau_bar, atol=1e-4)


def test_viscosity_of_the_paper_at_0_7():
    """This viscosity raises the front speed from 1.400 c to 1.926 c."""
    assert theory.chain_speed(0.7) == pytest.approx(1.400, abs=5e-4)
    assert theory.chain_speed(0.7, eta=ETA) == pytest.approx(1.926, abs=5e-4)
    assert theory.chain_speed_undamped(0.7) == pytest.approx(theory.chain_speed(0.7), rel=1e-10)


def test_slow_fronts_of_the_chain():
    tau_bar = np.array([0.005, 0.02])
    v = theory.chain_speed(tau_bar, 0.3, 0.1)
    assert (v < 0.1).all()
    np.testing.assert_allclose(theory.chain_prestress(v, 0.3, 0.1), tau_bar, rtol=1e-9)


def test_fronts_down_to_1e_4_c():
    """tau_bar is inverted, also at speeds at which waves with v q of order one are averaged."""
    for alpha, tau_bar in ((10.0, 1.1e-3), (0.3, 3e-4)):
        v = theory.chain_speed(tau_bar, alpha)
        assert theory.chain.SLOWEST < v < 0.01
        assert theory.chain_prestress(v, alpha) == pytest.approx(tau_bar, rel=1e-9)


@pytest.mark.parametrize(
    ("v", "alpha", "eta"),
    [pytest.param(0.019, 1.0, 0.0, marks=pytest.mark.slow), (0.03, 0.5, 0.3)],
)
def test_averaged_periods_against_brute_force(v, alpha, eta):
    assert alpha + 4 * eta > theory.chain._DAMPED * v
    exact = by_brute_force(v, alpha, eta, n=4_000_000, Q=4000 * np.pi)
    assert theory.chain_prestress(v, alpha, eta) == pytest.approx(exact, rel=1e-6)


def overdamped_by_quadrature(w, periods):
    """Return tau_bar by Gauss points, dense near sin(q/2) = 0, and the tail 2/(w Q)."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    t = (1 + nodes) / 2
    near, weights = np.pi * t**4, 2 * np.pi * t**3 * weights
    begin = 2 * np.pi * np.arange(periods)[:, None]
    q = np.stack([begin + near, begin + 2 * np.pi - near])
    total = np.sum(np.arctan2(4 * np.sin(q / 2) ** 2, w * q) / q @ weights)
    return np.exp(-(total + 2 / (w * 2 * np.pi * periods)) / np.pi)


def test_overdamped_chain():
    """tau_bar(w) agrees with quadrature and with the limit 1 - tau_bar = 1/w + ..."""
    w = np.array([0.1, 0.3, 1.0, 3.0])
    found = theory.chain_prestress_overdamped(w)
    exact = [overdamped_by_quadrature(one, 20_000) for one in w]
    np.testing.assert_allclose(found, exact, rtol=1e-6)
    np.testing.assert_allclose(found, [0.077133, 0.191729, 0.442898, 0.724601], atol=1e-6)
    assert theory.chain_prestress_overdamped(0.01) == pytest.approx(0.0092094, abs=1e-7)
    np.testing.assert_allclose(theory.chain_speed_overdamped(found, 2.0), w / 2, rtol=1e-9)
    # the overdamped chain is the limit of the chain with inertia
    error = [theory.chain_prestress(one / 10, 10.0) / theory.chain_prestress_overdamped(one) - 1
             for one in w[:3]]  # fmt: skip
    assert np.abs(error).max() < 5e-3
    assert abs(error[0]) < 1e-4


def test_the_line_where_fronts_reach_c():
    line = [theory.chain_prestress(1.0, alpha) for alpha in (0.1, 0.3, 1.0, 3.0)]
    np.testing.assert_allclose(line, [0.301837, 0.426534, 0.603682, 0.777259], atol=6e-7)


# --- rigid ---------------------------------------------------------------------------------------


def test_radiation_in_the_lattice():
    """If the lowest row moves at v, a shear wave takes the traction rho c_S v.

    The wave returns from the top after 2 H/c_S.
    """
    k, m, l, B, v, rows = 2e6, 3e-4, 2e-3, 5e-3, 0.1, 40
    material = theory.Material.of_lattice(k, m, l, B)
    K = k / 2 * (2 * np.eye(rows) - np.eye(rows, k=1) - np.eye(rows, k=-1))
    K[-1, -1] = k / 2
    omega2, modes = np.linalg.eigh(K / m)
    t = np.linspace(0.2, 0.9, 300)[:, None] * 2 * rows * l / material.c_S
    omega = np.sqrt(omega2)
    drive = modes[0] * (k / 2 * v / m)  # times t: forced oscillators from rest
    first = (drive * (t / omega2 - np.sin(omega * t) / omega**3)) @ modes[0]
    force = k / 2 * (v * t[:, 0] - first)
    assert np.mean(force) / (l * B) == pytest.approx(material.rho * material.c_S * v, rel=0.01)


def test_one_dimensional_length():
    """A chain under a slow push slips up to the block at which the sum of mu_k p equals F_T."""
    scene = chain(L=0.06, p=10.0, tau=0.0, K=4e6, V=5e-3, mu_s=0.4, mu_k=0.4)
    record = simulate(scene, 4.5e-3, fidelity="dynamic", progress=False)
    blocks, first = np.unique(record.switches["block"], return_index=True)
    F_T = np.interp(record.switches["t"][first], record.curve["t"], record.curve["F_T"])
    assert 20 <= len(blocks) < scene.N_x
    slipping = (blocks - blocks[0] + 1) / scene.N_x
    np.testing.assert_allclose(F_T / (0.4 * scene.F_N), slipping, rtol=0, atol=0.03 / scene.N_x)


@pytest.mark.parametrize("drive", [2e-5, 6e-5])
def test_pressure_balances_force_and_torque(drive):
    """For a slider stiffer than its foundation, p L/F_N = 1 + 6 (h/L)(F_T/F_N)(2 x/L - 1).

    With N blocks the second term has the factor (N - 1)/(N + 1).
    """
    scene = setup2(L=0.1, H=0.03, l=5e-3, k=1.35e12, k_f=13.5e6, theta=0.0, h=0.01)
    state, N = solve_static(scene, np.zeros(scene.N_x), drive), scene.N_x
    lever = scene.driver.h / scene.slider.L * (N - 1) / (N + 1)
    x = np.linspace(0, 1, N)
    expected = 1 + 6 * lever * state.F_T / scene.F_N * (2 * x - 1)
    np.testing.assert_allclose(state.p * N / scene.F_N, expected, rtol=0, atol=2e-5)
    assert abs(expected[0] - 1) > 0.02


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("field", "call"),
    [
        ("c_P", lambda: theory.Material(c_P=1.0, c_S=1.0, rho=1.0)),
        ("rho", lambda: theory.Material(c_P=2.0, c_S=1.0, rho=0.0)),
        ("c_S", lambda: theory.rayleigh_speed(2.0, -1.0)),
        ("nu", lambda: theory.Material.plane_strain(1.0, 0.5, 1.0)),
        ("B", lambda: theory.Material.of_lattice(1.0, 1.0, 1.0, 0.0)),
        ("k", lambda: theory.lattice_waves(np.nan, 1.0, 1.0)),
        ("q", lambda: theory.lattice_waves(1.0, 1.0, 1.0, [0.1, 3.2])),
        ("N_x", lambda: theory.density_factor(5.5, 3)),
        ("polarisation", lambda: theory.lattice_waves(1.0, 1.0, 1.0, 0.1, "sound")),
        ("N_z", lambda: theory.density_factor(5, 1)),
        ("v", lambda: theory.alpha_s(CAUCHY, 1.01)),
        ("v", lambda: theory.g_II(CAUCHY, 0.92)),
        ("v", lambda: theory.g_II(CAUCHY, [0.1, np.nan])),
        ("v", lambda: theory.g_II(CAUCHY, "fast")),
        ("v", lambda: theory.g_II(CAUCHY, [])),
        ("v", lambda: theory.g_II(CAUCHY, [[0.1], [0.1, 0.2]])),
        ("v", lambda: theory.g_II(CAUCHY, np.array([True]))),
        ("v", lambda: theory.A_II(CAUCHY, CAUCHY.c_R)),
        ("v", lambda: theory.crack_length(CAUCHY, CAUCHY.c_R, 1.0, 1.0)),
        ("stress_drop", lambda: theory.crack_length(CAUCHY, 0.1, 0.0, 1.0)),
        ("Gamma", lambda: theory.crack_speed(CAUCHY, 1.0, 1.0, -1.0)),
        ("a, Gamma", lambda: theory.crack_speed(CAUCHY, [1.0, 2.0], 1.0, [1.0, 2.0, 3.0])),
        ("bodies", lambda: theory.crack_speed(CAUCHY, 1.0, 1.0, 1.0, bodies=3)),
        ("a", lambda: theory.stress_intensity(0.0, 1.0)),
        ("breaks", lambda: theory.stress_intensity(1.0, np.cos, breaks=[-1.0])),
        ("stress_drop(t)", lambda: theory.stress_intensity(1.0, lambda t: np.inf)),
        ("stress_drop", lambda: theory.stress_intensity(1.0, lambda t: float(np.sin(1e5 * t) > 0))),
        ("mu_s", lambda: theory.fracture_energy(0.3, 0.4, 1.0, 1.0)),
        ("(mu_s - mu_k) p", lambda: theory.cohesive_zone(CAUCHY, 0.4, 0.4, 1.0, 1.0)),
        ("d_c", lambda: theory.fracture_energy(0.5, 0.4, 1.0, -1.0)),
        ("tau_0", lambda: theory.strength_excess(1.0, 0.0, 0.0)),
        ("tau_0", lambda: theory.strength_excess(1.0, [0.5, 1.1], 0.0)),
        ("v", lambda: theory.chain_prestress(1.0)),
        ("v", lambda: theory.chain_prestress(9e-5, 0.1)),
        ("w", lambda: theory.chain_prestress_overdamped(0.0)),
        ("alpha", lambda: theory.chain_speed_overdamped(0.1, 0.0)),
        ("tau_bar", lambda: theory.chain_speed_overdamped(1e-12, 1.0)),
        ("eta", lambda: theory.chain_prestress(2.0, eta=-0.1)),
        ("alpha", lambda: theory.chain_speed(0.5, alpha=11.0)),
        ("tau_bar", lambda: theory.chain_speed(1.0)),
        ("tau_bar", lambda: theory.chain_speed(1e-7, alpha=1.0)),
        ("tau_bar", lambda: theory.chain_speed(0.9999999, eta=10.0)),
        ("tau_bar", lambda: theory.chain_speed_undamped(1.0)),
    ],
)  # fmt: skip
def test_refusals(field, call):
    refused(field, call)


def test_a_quantity_does_not_lose_its_unit():
    """A quantity in mm is refused, because its number would count as m."""
    units = pint.UnitRegistry()
    for given in (5 * units.mm, [5 * units.mm], units.Quantity([1.0, 2.0], "mm"), "5 mm"):
        with pytest.raises(ValueError, match=r"(?s)^a = .*; allowed: plain numbers, in m"):
            theory.stress_intensity(given, 1e6)
    refused("E", theory.Material.plane_stress, 3 * units.GPa, 0.3, 1200.0)


def test_shapes():
    """A number gives a number, an array its shape, a column of a table an array."""
    column = pd.Series([0.1, 0.5], index=[7, 8])
    np.testing.assert_array_equal(theory.g_II(CAUCHY, column), theory.g_II(CAUCHY, [0.1, 0.5]))
    v = np.full((2, 3), 0.5)
    assert np.ndim(theory.g_II(CAUCHY, 0.5)) == 0
    for function in (theory.g_II, theory.A_II, theory.D, theory.k_II):
        assert function(CAUCHY, v).shape == (2, 3)
    assert theory.crack_speed(CAUCHY, v, 1.0, 0.1).shape == (2, 3)
    assert theory.stress_intensity(v, np.cos).shape == (2, 3)
    assert theory.chain_prestress(v + 1).shape == (2, 3)
    assert theory.cohesive_zone(CAUCHY, 0.6, 0.4, v, [1.0, 2.0, 3.0], 0.1).shape == (2, 3)
    assert np.ndim(theory.chain_speed(0.3)) == 0


def test_masked_values_are_refused():
    tau_bar = np.ma.masked_array([0.3, 0.5], mask=[False, False])
    theory.chain_speed(tau_bar)
    tau_bar[1] = np.ma.masked
    with pytest.raises(ValueError, match=r"(?s)tau_bar = .*numbers without gaps"):
        theory.chain_speed(tau_bar)


class WithUnit(np.ndarray):
    """An array with a unit, as in some unit libraries; NumPy drops its unit silently."""

    unit = "ms"


def test_arrays_with_a_unit_are_refused():
    """Rupture times with a unit are refused, too."""
    values = np.linspace(0.0, 1e-3, 7)
    given = values.view(WithUnit)
    assert theory.fracture_energy(0.7, 0.45, values, 1e-6).shape == (7,)
    for p in (given, [given]):
        with pytest.raises(ValueError, match="allowed: plain numbers, in Pa"):
            theory.fracture_energy(0.7, 0.45, p, 1e-6)
    assert np.isfinite(front_speed(values, 1e-3)[3])
    with pytest.raises(SceneError, match="plain numbers, in s"):
        front_speed(given, 1e-3)
