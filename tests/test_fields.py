"""Fields of the interface: draws, refusals, and runs of every engine."""

import dataclasses
import hashlib

import numpy as np
import pytest
import twin
from helpers import bits, budget_error, mirrored_state, refused
from test_twin import STUCK

import pyfric
from pyfric import core, laws
from pyfric.figures import sketch
from pyfric.record import Record, RecordError
from pyfric.scene import Scene, Spread, chain, setup1
from pyfric.statics import loaded_state, stability_limit

SIZE = {"L": 0.02, "H": 0.0125, "F_N": 400.0, "V": 0.1}
N = 9
MU_S = tuple(0.7 + 0.01 * np.cos(np.arange(N)))
MU_K = tuple(0.4 + 0.02 * np.sin(np.arange(N)))
D_C = tuple(1e-7 * (2 + np.cos(3 * np.arange(N))))
ALPHA = tuple(0.5 + 0.1 * np.sin(5 * np.arange(N)))
K_F = tuple(1e7 * (1.5 + 0.2 * np.cos(2 * np.arange(N))))
FIELDS = {"mu_s": MU_S, "mu_k": MU_K, "d_c": D_C, "alpha": ALPHA, "k_f": K_F}


def uneven(side="left", **changes):
    scene = setup1(**SIZE, side=side)
    interface = dataclasses.replace(scene.interface, **FIELDS | changes)
    return dataclasses.replace(scene, interface=interface)


# --- draws ---------------------------------------------------------------------------------------


def test_draws_are_the_same_on_any_machine():
    drawn = Spread(mean=0.7, std=0.03, seed=2**64 - 1, correlation_length=0.01).draw(57, 2.5e-3)
    digest = hashlib.sha256(drawn.tobytes()).hexdigest()
    assert digest.startswith("7a23e9fdf7bcc2bd"), digest
    assert Spread(mean=0.5, range=0.1, seed=5).draw(3, 1.0).tolist() == [
        0.5467491910889273,
        0.5181041289145418,
        0.4415617881324142,
    ]


def test_records_keep_what_was_drawn(tmp_path, monkeypatch):
    """Stored numbers are those of a new draw, for either driven side; others are refused."""
    for side in ("left", "right"):
        scene = uneven(side, mu_s=Spread(mean=0.7, std=0.01, seed=7), d_c=0.0, alpha=0.0, k_f=None)
        fresh = scene.drawn["mu_s"]
        assert fresh[:2] == (0.7158021832212201, 0.6846911756821876)
        record = pyfric.simulate(scene, 1e-5, fidelity="dynamic", progress=False)
        file = record.save(tmp_path / f"{side}.nc")
        again = Record.load(file)
        assert again == record
        assert again.scene.drawn == {"mu_s": fresh}
        np.testing.assert_array_equal(again.scene.law.mu_s, scene.law.mu_s)
        assert again.to_xarray()["drawn_mu_s"].to_numpy().tolist() == scene.law.mu_s.tolist()
        with monkeypatch.context() as other:
            other.setattr(Spread, "draw", lambda self, n, l, name: np.full(n, self.mean))
            with pytest.raises(RecordError, match="drawn_mu_s"):
                Record.load(file)


def test_draws_have_their_mean_width_and_correlation():
    n, over = 40_000, 8
    normal = (Spread(mean=3.0, std=0.5, seed=1).draw(n, 1.0) - 3) / 0.5
    assert normal.mean() == pytest.approx(0, abs=4 / np.sqrt(n))
    assert normal.std() == pytest.approx(1, abs=4 / np.sqrt(2 * n))
    assert np.mean(np.abs(normal) < 1) == pytest.approx(0.6827, abs=0.01)
    uniform = Spread(mean=3.0, range=0.5, seed=1).draw(n, 1.0)
    assert (2.5 <= uniform.min()) & (uniform.max() < 3.5)
    assert uniform.std() == pytest.approx(0.5 / np.sqrt(3), rel=0.01)
    long = Spread(mean=0.0, std=1.0, correlation_length=over, seed=2).draw(n, 1.0)
    assert long.std() == pytest.approx(1, abs=0.03)
    for far in (1, 4, 8, 20):
        found = np.mean(long[far:] * long[:-far])
        assert found == pytest.approx(max(0, 1 - far / over), abs=0.05)
    other = Spread(mean=0.0, std=1.0, correlation_length=over, seed=3).draw(n, 1.0)
    assert abs(np.mean(long * other)) < 0.05


@pytest.mark.parametrize(
    "how", [{"std": 0.02}, {"range": 0.02}, {"std": 0.02, "correlation_length": 0.01}]
)
def test_equal_seeds_of_two_fields_give_independent_numbers(how):
    n = 2001
    scene = setup1(
        L=(n - 1) * 2.5e-3, H=2.5e-3, h=2.5e-3,
        mu_s=Spread(mean=0.7, **how), mu_k=Spread(mean=0.45, **how), d_c=Spread(mean=0.7, **how),
    )  # fmt: skip
    mu_s, mu_k, d_c = (np.array(scene.drawn[name]) for name in ("mu_s", "mu_k", "d_c"))
    blocks = n / (4 if "correlation_length" in how else 1)  # number of independent values
    for a, b in ((mu_s, mu_k), (mu_s, d_c), (mu_k, d_c)):
        assert abs(np.corrcoef(a, b)[0, 1]) < 4 / np.sqrt(blocks)
    assert scene.drawn["mu_s"][:5] == tuple(Spread(mean=0.7, **how).draw(n, 2.5e-3)[:5])


def test_finer_blocks_are_on_the_same_interface():
    """Blocks of a longer slider, or of any spacing, are on the same interface, too."""
    spread = Spread(mean=0.7, std=0.03, correlation_length=0.0135, seed=5)
    coarse, fine = spread.draw(57, 2.5e-3), spread.draw(113, 1.25e-3)
    np.testing.assert_array_equal(fine[::2], coarse)
    np.testing.assert_array_equal(spread.draw(81, 2.5e-3)[:57], coarse)
    odd = spread.draw(141, 1e-3)
    np.testing.assert_allclose(odd[::5], coarse[::2], rtol=1e-12)
    between = np.interp(np.arange(141) * 1e-3, np.arange(113) * 1.25e-3, fine)
    assert np.corrcoef(odd, between)[0, 1] > 0.95
    scene = setup1(mu_s=spread, l=5e-3)
    assert scene.interface_on(57).mu_s == spread
    assert setup1(mu_s=spread).drawn["mu_s"][::2] == scene.drawn["mu_s"]


def test_width_and_correlation_do_not_depend_on_l():
    seeds, length = 400, 0.02
    for l in (0.01, 0.003):
        spreads = (
            Spread(mean=0.0, std=1.0, correlation_length=length, seed=n) for n in range(seeds)
        )
        drawn = np.array([spread.draw(9, l) for spread in spreads])
        assert drawn.std(axis=0) == pytest.approx(np.ones(9), abs=0.15)
        for far in (1, 2, 3):
            found = np.mean(drawn[:, far:] * drawn[:, :-far])
            assert found == pytest.approx(max(0, 1 - far * l / length), abs=0.1)


def test_refusals():
    scene = setup1(**SIZE)
    with_ = lambda **changes: dataclasses.replace(  # noqa: E731
        scene, interface=dataclasses.replace(scene.interface, **changes)
    )
    refused(lambda: with_(mu_s=[0.7] * 8), "interface.mu_s", "8 numbers", "a list of 9 of them")
    refused(lambda: with_(d_c=[]), "interface.d_c", "0 numbers")
    refused(lambda: with_(mu_s=[0.7] * 8 + [-0.7]), "interface.mu_s", "block 9", value=-0.7)
    refused(lambda: with_(mu_k=[0.45] * 8 + [0.71]), "interface.mu_k", "block 9", within=(0, 0.7))
    wide = Spread(mean=0.1, std=0.2, seed=1)
    refused(lambda: with_(mu_k=wide), "interface.mu_k", "reaches", "block")
    refused(lambda: Spread(mean=1.0), "spread.std")
    refused(lambda: Spread(mean=1.0, std=0.1, range=0.1), "spread.std")
    refused(lambda: Spread(mean=1.0, std=0.1, seed=-1), "spread.seed")
    backward = {"mean": 0.7, "std": 0.1, "correlation_length": -1e-3}
    tiny = {"mean": 0.7, "std": 0.1, "correlation_length": 1e-9}
    refused(lambda: with_(mu_s=tiny), "interface.mu_s", value=1e-09, unit="m", within=(0, 3.2e-07))
    refused(lambda: with_(mu_s=backward), "interface.mu_s", value=-0.001, unit="m", within=(0,))
    refused(lambda: with_(mu_s={"mean": 0.7}), "interface.mu_s", "std: one is needed")
    refused(lambda: with_(law={"kind": "ageing"}), "interface.law", "in a scene file")
    length = {"correlation_length": 0.1}
    refused(lambda: Spread(mean=1.0, range=0.1, **length), "spread.correlation_length")


def test_scene_files_hold_fields_and_laws():
    spread = Spread(mean=1e-7, std=1e-8, correlation_length=0.005, seed=4)
    for scene in (
        uneven(),
        uneven(d_c=spread, law=laws.ExponentialWeakening()),
        uneven(law=laws.TabulatedLaw(slip=(0.0, 1e-6), mu=(0.6, float(np.mean(MU_K))))),
    ):
        assert Scene.from_toml(scene.to_toml()) == scene
    text = uneven(d_c=spread).to_toml().replace('"1e-07 m"', '"0.1 um"')
    assert Scene.from_toml(text).interface.d_c == spread
    refused(lambda: Scene.from_toml(text.replace('"0.1 um"', '"1 N"')), "interface.d_c")
    refused(lambda: Scene.from_toml(text.replace("seed = 4", "sed = 4")), "interface.d_c")
    plain = setup1(**SIZE).to_toml()
    refused(
        lambda: Scene.from_toml(plain + '[interface.law]\nkind = "agein"\n'),
        "interface.law.kind", "did you mean 'ageing'",
    )  # fmt: skip


# --- runs ----------------------------------------------------------------------------------------


def test_a_uniform_field_gives_the_bits_of_the_number():
    numbers = {"mu_s": 0.7, "mu_k": 0.45, "d_c": 1e-7, "alpha": 0.5, "k_f": 1.3e7}
    a, b = (uneven(**{n: x if one else (x,) * N for n, x in numbers.items()}) for one in (1, 0))
    how = {"geometry": "finite", "progress": False}
    for engine in ("dynamic", "hybrid"):
        one, two = (pyfric.simulate(s, 1.5e-3, fidelity=engine, **how) for s in (a, b))
        assert bits(one.final_state) == bits(two.final_state)
        assert len(one.switches["t"]) > 5


def test_the_mirrored_field_gives_the_mirrored_run():
    """Runs from the mirrored state agree bit for bit."""
    left, right = uneven(), uneven("right")
    dt = 0.5 * stability_limit(left)[0]
    at_left = loaded_state(left).state(left, dt)
    at_right = mirrored_state(at_left)
    logs = []
    for scene, state in ((left, at_left), (right, at_right)):
        logs.append(core.Log(N, 20_000, 500))
        model = core.model(scene, "linear", state.u_drv0)
        core.advance(model, state, logs[-1], round(1.5e-3 / dt), switching="located")
    one, two = (log.switches() for log in logs)
    assert len(one["t"]) > 5
    np.testing.assert_array_equal(one["t"], two["t"])
    np.testing.assert_array_equal(one["block"], N - 1 - two["block"])
    np.testing.assert_array_equal(at_left.y, mirrored_state(at_right).y)
    np.testing.assert_array_equal(at_left.t_0, at_right.t_0[::-1])
    np.testing.assert_array_equal(at_left.parts, at_right.parts[:, ::-1])


@pytest.mark.parametrize("geometry", ["linear", "finite"])
def test_forces_are_those_of_the_twin(geometry):
    scene = uneven(law=laws.SpeedDependent(v=(0.0, 0.1, 1.0), factor=(1.0, 0.8, 0.9)))
    rng = np.random.default_rng(0)
    state = loaded_state(scene, geometry).state(scene, 0.2 * stability_limit(scene)[0])
    state.y[:-1, 2:] += 0.5 * rng.standard_normal((scene.N_z - 1, 2, N))
    state.mode[:] = np.resize([STUCK, 1, -1], N)
    state.y[0, 2, state.mode == STUCK] = 0
    state.s_0[:] = 1e-7 - np.where(np.abs(state.mode) == 1, state.mode * state.y[0, 0], 0.0)
    found = core.evaluate(core.model(scene, geometry, state.u_drv0), state, 0.0)
    exact = twin.right_hand_side(
        scene, geometry, 0.0, state.y, state.rod, state.mode, state.u_drv0, state.slip
    )
    np.testing.assert_allclose(found.f, exact.f, rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose(found.p, exact.p, rtol=1e-13)


AGEING = {"law": laws.Ageing(B=0.05, t_c=1e-5)}


@pytest.mark.parametrize("changes", [{}, AGEING | {"d_c": 0.0}], ids=["fields", "ageing"])
def test_jumps_give_the_events_of_full_dynamics(changes):
    scene, how = uneven(**changes), {"geometry": "linear", "switching": "located"}
    how["dt"] = pyfric.step_size(scene) / 2
    a, b = (
        pyfric.simulate(scene, 2e-3, fidelity=name, progress=False, **how)
        for name in ("dynamic", "hybrid")
    )
    assert len(a.events) == len(b.events) > 0
    assert b.counts["steps_spared"] > 0.2 * a.counts["steps"]
    for name in ("first_block", "last_block", "nucleation_block"):
        np.testing.assert_array_equal(a.events[name], b.events[name])
    for name in ("F_T_start", "F_T_arrest"):
        np.testing.assert_allclose(a.events[name], b.events[name], rtol=0, atol=1e-4 * scene.F_N)
    assert budget_error(a) < 1e-4 * a.curve["work_driver"].iloc[-1]


def test_a_run_in_parts_is_the_whole_run(tmp_path):
    scene = uneven(**AGEING)
    how = {"fidelity": "dynamic", "geometry": "linear", "progress": False}
    whole = pyfric.simulate(scene, 1.5e-3, **how)
    part = pyfric.simulate(scene, 0.8e-3, **how)
    part = Record.load(part.save(tmp_path / "part.nc"))
    assert part.scene == scene
    rest = pyfric.simulate(scene, 1.5e-3, initial=part, progress=False)
    assert bits(rest.final_state) == bits(whole.final_state)


def test_the_ladder_follows_fields_and_says_what_it_does_not():
    scene = uneven(d_c=0.0, alpha=0.0)
    scene = dataclasses.replace(scene, driver=dataclasses.replace(scene.driver, V=0.02))
    how = {"progress": False, "fidelity": "quasistatic"}
    ladder = pyfric.simulate(scene, 6e-3, **how)
    run = pyfric.simulate(scene, 6e-3, fidelity="hybrid", geometry="linear", progress=False)
    start = [one.events["F_T_start"].iloc[0] / scene.F_N for one in (ladder, run)]
    assert start[0] == pytest.approx(start[1], abs=5e-3)
    assert len(pyfric.prediction_curve(scene).curve) > N
    steep = pyfric.simulate(
        dataclasses.replace(scene, interface=uneven(d_c=1e-9, alpha=0.0).interface), 6e-3, **how
    )
    np.testing.assert_array_equal(steep.events["F_T_start"], ladder.events["F_T_start"])
    for changes, field, text in (
        ({"d_c": 0.0}, "interface.alpha", "viscosity"),
        ({"alpha": 0.0} | AGEING, "interface.law", "time"),
    ):
        refused(lambda c=changes: pyfric.simulate(uneven(**c), 1e-3, **how), field, text)
    found = pyfric.plan(uneven(**AGEING), "loading_curve", 0.2, t_end=0.6).levels
    assert "time or speed" in found[0].cannot


def test_viscosity_of_slip_lowers_the_stable_step():
    scene = chain(L=0.02)
    impedance = np.sqrt(scene.slider.k * scene.m)
    limits = [
        stability_limit(
            dataclasses.replace(
                scene, interface=dataclasses.replace(scene.interface, alpha=a * impedance)
            )
        )[0]
        for a in (0.0, 10.0, 100.0)
    ]
    assert limits[1] < limits[0]
    assert limits[2] == pytest.approx(2.785 * scene.m / (100 * impedance), rel=0.02)


def test_sketches_show_fields():
    drawn = sketch(uneven())
    assert "vary along the interface" in drawn.caption
    np.testing.assert_allclose(drawn.tables["columns"]["mu_s"], MU_S)
