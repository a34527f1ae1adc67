"""The twin by itself: symmetries, energies and the switching rule."""

from types import SimpleNamespace

import numpy as np
import pytest
import twin
from twin import LEFT, OPEN, RIGHT, STUCK, Slab

GEOMETRIES = ("linear", "finite")


def make_scene(
    *,
    rigid=True,
    side="left",
    N_x=5,
    N_z=4,
    eta=None,
    mu_s=0.7,
    mu_k=0.45,
    F_N=300.0,
    tau=0.0,
    d_c=0.0,
):
    """Return a scene; tau (N) is a force on each free top block, which then also has k_top."""
    k, l, m = 13.5e6, 2.5e-3, 4.3e-5
    x = (np.arange(N_x) - (N_x - 1) / 2) * l
    d = 1 if side == "left" else -1
    L = (N_x - 1) * l
    return Slab(
        N_x=N_x,
        N_z=N_z,
        m=m,
        eta=np.sqrt(0.1 * k * m) if eta is None else eta,
        k_f=0.8 * k,
        F_N=F_N,
        d=d,
        i_h=0 if d == 1 else N_x - 1,
        j_h=1,
        x=x,
        load=np.zeros(N_x) if rigid else F_N / N_x * (1 + 0.5 * d * x / x[-1]),
        shear=d * tau * (1 + 0.3 * d * x / x[-1]),
        k_top=0.1 * k if tau else 0.0,
        kappa=0.4e6 * L**2 / 12 if rigid else 0.0,
        M_rod=20 * m if rigid else 0.0,
        rigid=rigid,
        slider=SimpleNamespace(l=l, k=k, L=L),
        driver=SimpleNamespace(K=4e6, V=7.875e-4),
        interface=SimpleNamespace(mu_s=mu_s, mu_k=mu_k, d_c=d_c),
    )


def random_state(scene, seed=1, strain=1e-2, speed=0.1):
    """Return a state far from equilibrium: y, rod, mode (all four modes occur), u_drv0."""
    rng = np.random.default_rng(seed)
    l = scene.slider.l
    y = rng.uniform(-1, 1, (scene.N_z, 4, scene.N_x))
    y[:, :2] *= strain * l
    y[:, 2:] *= speed
    rod = rng.uniform(-1, 1, 6) * [strain * l, strain * l, strain, speed, speed, speed / l]
    mode = np.resize(np.array([STUCK, RIGHT, LEFT, OPEN], dtype=np.int32), scene.N_x)
    y[0, 2, mode == STUCK] = 0.0
    return twin.with_rod(scene, y, rod), rod, mode, strain * l / 3


def positions(scene):
    """Return the reference positions, shape (N_z, 2, N_x), in m."""
    j, i = np.mgrid[: scene.N_z, : scene.N_x]
    return scene.slider.l * np.stack([i, j], axis=1)


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_rigid_translation_has_no_force(geometry):
    scene = make_scene()
    y = np.zeros((scene.N_z, 4, scene.N_x))
    y += np.array([1e-3, -2e-3, 0.3, 0.1])[:, None]
    assert np.all(twin.bond_forces(scene, y, geometry) == 0.0)


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_rigid_rotation_has_no_spring_force(geometry):
    scene = make_scene()
    r, phi = positions(scene), 0.3
    y = np.zeros((scene.N_z, 4, scene.N_x))
    if geometry == "finite":
        c, s = np.cos(phi), np.sin(phi)
        y[:, 0], y[:, 1] = c * r[:, 0] - s * r[:, 1], s * r[:, 0] + c * r[:, 1]
        y[:, :2] -= r
    else:
        y[:, 0], y[:, 1] = -phi * r[:, 1], phi * r[:, 0]
    scale = scene.slider.k * scene.slider.l
    assert np.abs(twin.bond_forces(scene, y, geometry)).max() < 1e-13 * scale


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_internal_forces_and_torques_sum_to_zero(geometry):
    scene = make_scene()
    y, *_ = random_state(scene)
    F = twin.bond_forces(scene, y, geometry)
    assert np.abs(F.sum(axis=(0, 2))).max() < 1e-13 * np.abs(F).max() * F.size

    scene.eta = 0.0  # the dashpots carry torque
    F = twin.bond_forces(scene, y, geometry)
    r = positions(scene) + (y[:, :2] if geometry == "finite" else 0.0)
    torque = r[:, 0] * F[:, 1] - r[:, 1] * F[:, 0]
    assert abs(torque.sum()) < 1e-13 * np.abs(torque).sum()


def test_one_bond_by_hand():
    scene = make_scene(N_x=2, N_z=1, eta=0.0)
    k, l = scene.slider.k, scene.slider.l
    y = np.zeros((1, 4, 2))
    y[0, 0, 1], y[0, 1, 1] = 0.5 * l, 2.0 * l
    finite = twin.bond_forces(scene, y, "finite")[0, :, 0]
    assert finite == pytest.approx(k * 1.5 * l * np.array([0.6, 0.8]), rel=1e-14)
    linear = twin.bond_forces(scene, y, "linear")[0, :, 0]
    assert linear == pytest.approx(k * l * np.array([0.5, 0.0]), rel=1e-14)


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_spring_forces_are_minus_the_energy_gradient(geometry):
    scene = make_scene(eta=0.0)
    y, *_ = random_state(scene, strain=0.1)
    F = twin.bond_forces(scene, y, geometry)
    h = 1e-6 * scene.slider.l
    gradient = np.zeros_like(F)
    for index in np.ndindex(F.shape):
        y_plus, y_minus = y.copy(), y.copy()
        y_plus[index] += h
        y_minus[index] -= h
        gradient[index] = (
            twin.bond_energy(scene, geometry, y_plus) - twin.bond_energy(scene, geometry, y_minus)
        ) / (2 * h)
    assert np.abs(F + gradient).max() < 1e-7 * np.abs(F).max()


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_geometries_agree_for_small_strains(geometry):
    scene = make_scene()
    y, *_ = random_state(scene, strain=1e-9, speed=1e-9)
    F = twin.bond_forces(scene, y, geometry)
    assert np.abs(F - twin.bond_forces(scene, y, "linear")).max() < 1e-7 * np.abs(F).max()


@pytest.mark.parametrize("j_h", ["inside", "top", "plate"])
@pytest.mark.parametrize("rigid", [True, False])
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_energy_grows_at_the_rate_of_the_powers(geometry, side, rigid, j_h):
    scene = make_scene(rigid=rigid, side=side, tau=0.0 if rigid else 20.0)
    scene.j_h = scene.N_z - 1 if j_h == "top" else 1
    y, rod, mode, u_drv0 = random_state(scene)
    if j_h == "plate":
        scene.driver.h_top = (scene.N_z - 1) * scene.slider.l
        u_drv0 *= np.array([1.0, -2.0, 0.5])
    t = 1e-3
    F = twin.right_hand_side(scene, geometry, t, y, rod, mode, u_drv0)

    def energy(h):
        args = (y + h * F.dydt, rod + h * F.drod, t + h, u_drv0)
        return twin.energies(scene, geometry, *args)["total"]

    h = 1e-10
    rates = F.rates
    expected = rates["driver"] + rates["load"] - rates["bonds"] - rates["friction"]
    scale = sum(abs(rate) for rate in rates.values())
    assert (energy(h) - energy(-h)) / (2 * h) == pytest.approx(expected, abs=1e-5 * scale)
    assert rates["bonds"] > 0.0


def test_friction_weakens_with_slip():
    scene = make_scene(mu_s=0.7, mu_k=0.4, d_c=2e-6)
    found = [twin.friction_coefficient(scene, s * 1e-6) for s in (-1, 0, 0.5, 1, 2, 9)]
    assert found == pytest.approx([0.7, 0.7, 0.625, 0.55, 0.4, 0.4])
    assert twin.friction_coefficient(make_scene(), 0.0) == 0.45


def test_right_hand_side_by_contact_mode():
    scene = make_scene(N_x=4)
    y, rod, mode, u_drv0 = random_state(scene)
    y[0, 1] = -1e-5
    F = twin.right_hand_side(scene, "finite", 0.0, y, rod, mode, u_drv0)
    other = twin.all_but_friction(scene, "finite", 0.0, y, u_drv0)[0][0, 0]
    p = scene.k_f * 1e-5
    assert F.p == pytest.approx(p)
    assert F.f == pytest.approx([-other[0], -0.45 * p, 0.45 * p, 0.0])
    assert F.dydt[0, 0, 0] == F.dydt[0, 2, 0] == 0.0
    assert F.dydt[0, 2, 3] == pytest.approx(other[3] / scene.m)


def test_top_row_moves_with_the_rod():
    scene = make_scene()
    y, rod, mode, u_drv0 = random_state(scene)
    F = twin.right_hand_side(scene, "finite", 0.0, y, rod, mode, u_drv0)
    moved = twin.with_rod(scene, y, F.drod)
    assert F.dydt[-1] == pytest.approx(moved[-1], rel=1e-14)


@pytest.mark.parametrize(
    ("old", "v_x", "u_x", "p", "expected", "stops"),
    [
        # u_x pulls the block back with 2 k |u_x| = `other`, in units of p
        (STUCK, 0.0, -0.5, 1.0, STUCK, False),
        (STUCK, 0.0, -0.8, 1.0, RIGHT, False),
        (STUCK, 0.0, 0.8, 1.0, LEFT, False),
        (STUCK, 0.0, -0.8, 0.0, OPEN, False),
        (RIGHT, 0.1, 0.9, 1.0, RIGHT, False),
        (RIGHT, -1e-9, 0.5, 1.0, STUCK, True),
        (RIGHT, -1e-9, 0.8, 1.0, LEFT, True),
        (RIGHT, 0.0, -0.8, 1.0, RIGHT, False),
        (LEFT, 1e-9, -0.5, 1.0, STUCK, True),
        (LEFT, 0.1, 0.5, 0.0, OPEN, False),
        (LEFT, -0.1, 0.5, 1.0, LEFT, False),
        (OPEN, 0.1, 0.5, 0.0, OPEN, False),
        (OPEN, 0.1, 0.5, 1.0, RIGHT, False),
        (OPEN, -0.1, 0.5, 1.0, LEFT, False),
        (OPEN, 0.0, 0.5, 1.0, STUCK, False),
        (OPEN, 0.0, 0.8, 1.0, LEFT, False),
    ],
)
def test_switching_rule(old, v_x, u_x, p, expected, stops):
    scene = make_scene(rigid=False, N_x=3, N_z=2)
    y, rod = np.zeros((2, 4, 3)), np.zeros(6)
    y[0, 1, 1] = 0.0 if p == 0 else -p / scene.k_f
    y[0, 0, 1] = 1e-12
    pull = twin.all_but_friction(scene, "linear", 0.0, y, 0.0)[0][0, 0, 1] / 1e-12
    y[0, 0, 1] = u_x / abs(pull)
    y[0, 2, 1] = v_x
    mode = np.full(3, OPEN, dtype=np.int32)
    mode[1] = old
    new, y_new, loss = twin.switch(scene, "linear", 0.0, y, rod, mode, 0.0)
    assert new.tolist() == [OPEN, expected, OPEN]
    assert y_new[0, 2, 1] == (0.0 if stops else v_x)
    assert loss == pytest.approx(scene.m * v_x**2 / 2 if stops else 0.0)
    y_new[0, 2, 1] = v_x
    assert np.array_equal(y_new, y)


def pushed(scene):
    """Return a state at rest that is not in equilibrium, pressed and sheared."""
    y = np.zeros((scene.N_z, 4, scene.N_x))
    height = np.arange(scene.N_z)[:, None]
    y[:, 0] = scene.d * 2e-6 * height
    y[:, 1] = -1e-5
    rod = np.array([y[-1, 0, 0], y[-1, 1, 0], 0, 0, 0, 0])
    mode = np.zeros(scene.N_x, dtype=np.int32)
    return y, rod, mode, y[scene.j_h, 0, scene.i_h] + scene.d * 5e-6


@pytest.mark.parametrize(("geometry", "rigid"), [("linear", True), ("finite", False)])
def test_run_keeps_the_energy_budget(geometry, rigid):
    scene = make_scene(rigid=rigid)
    y, rod, mode, u_drv0 = pushed(scene)
    u_drv0 += 2e-5  # F_T > 0 at t = 0
    dt, steps = 2.5e-8, 600 if rigid else 300
    before = twin.energies(scene, geometry, y, rod, 0.0, u_drv0)["total"]
    end = twin.run(scene, geometry, y, rod, mode, u_drv0, dt, steps)
    after = twin.energies(scene, geometry, end.y, end.rod, steps * dt, u_drv0)["total"]
    w = end.works
    balance = w["driver"] + w["load"] - w["bonds"] - w["friction"] - w["switching"]
    assert end.switches
    assert w["friction"] > 0
    assert w["switching"] > 0
    # order 4 in dt, unless a block lifts off or lands within a step: p has a kink there
    lifted = any(new == OPEN for *_, new in end.switches)
    tolerance = 1e-6 if lifted else 1e-8
    assert after - before == pytest.approx(balance, abs=tolerance * w["bonds"])


def test_run_in_halves_is_the_whole_run():
    scene = make_scene()
    y, rod, mode, u_drv0 = pushed(scene)
    whole = twin.run(scene, "finite", y, rod, mode, u_drv0, 2e-7, 40)
    half = twin.run(scene, "finite", y, rod, mode, u_drv0, 2e-7, 20)
    rest = twin.run(scene, "finite", half.y, half.rod, half.mode, u_drv0, 2e-7, 20, first=20)
    assert np.array_equal(whole.y, rest.y)
    assert np.array_equal(whole.rod, rest.rod)
    assert whole.switches == half.switches + rest.switches


@pytest.mark.parametrize("rigid", [True, False])
def test_mirror_image(rigid):
    ends = []
    for side in ("left", "right"):
        scene = make_scene(rigid=rigid, side=side, tau=0.0 if rigid else 20.0)
        y, rod, mode, u_drv0 = pushed(scene)
        ends.append(twin.run(scene, "finite", y, rod, mode, u_drv0 + scene.d * 2e-5, 2e-7, 60))
    left, right = ends
    assert left.switches
    flip = np.array([-1, 1, -1, 1])[:, None]
    assert left.y == pytest.approx(flip * right.y[:, :, ::-1], abs=1e-9 * np.abs(left.y).max())
    mirrored = np.where(right.mode[::-1] == OPEN, OPEN, -right.mode[::-1])
    assert left.mode.tolist() == mirrored.tolist()


def test_order_four_while_nothing_switches():
    scene = make_scene(N_x=3, N_z=3)
    y, rod, mode, u_drv0 = pushed(scene)
    T, ends = 1.6e-6, []
    for steps in (8, 16, 64):
        state = y, rod
        for n in range(steps):
            t, dt = n * T / steps, T / steps
            *state, _, _ = twin.rk4_step(scene, "finite", t, *state, mode, u_drv0, dt)
        ends.append(state[0][:, :2])
    errors = [np.abs(end - ends[-1]).max() for end in ends[:2]]
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.2)
