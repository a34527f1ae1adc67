"""Steps of the moving part of a chain are those of the whole chain."""

import numpy as np
import pytest

import pyfric
from pyfric import core
from pyfric.engines import hybrid, moving
from pyfric.scene import chain, preset


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Let parts of chains be shorter than those that save time."""
    monkeypatch.setattr(moving, "LEAST", 0)


def pulled(N_x=60, **changes):
    """Return a chain under a moving plate, with a weak piece at its start."""
    mu_s = 0.6 + 0.02 * (np.arange(N_x) * 7 % 20)
    mu_s[: N_x // 4] = np.linspace(0.45, 0.5, N_x // 4)
    own = {"L": (N_x - 1) * 2.5e-3, "mu_s": mu_s.tolist(), "V": 1e-6}
    return preset("burridge_knopoff", **own | changes)


def pushed(**changes):
    return chain(L=59 * 2.5e-3, k_top=2e7, mu_s=0.5, mu_k=0.2, **changes)


def both(scene, t_end, monkeypatch, **how):
    """Return the run by parts, and that of the whole chain."""
    parts = pyfric.simulate(scene, t_end, fidelity="hybrid", **how)
    monkeypatch.setattr(hybrid, "has_parts", lambda scene: False)
    return parts, pyfric.simulate(scene, t_end, fidelity="hybrid", **how)


@pytest.mark.parametrize("switching", ["located", "step_end"])
@pytest.mark.parametrize(
    ("scene", "t_end"),
    [(pulled(), 0.4), (pushed(), 0.12), (pushed(side="right"), 0.12)],
    ids=["plate", "pushed", "from the right"],
)
def test_switches_have_the_same_bits(scene, t_end, switching, monkeypatch):
    parts, whole = both(scene, t_end, monkeypatch, switching=switching)
    assert len(whole.switches["t"]) > 60
    for name in ("t", "block", "new", "corner", "u_x", "p", "step"):
        assert np.array_equal(parts.switches[name], whole.switches[name])
    for name in ("mode", "u_x", "kind", "t"):
        assert np.array_equal(parts.quiet[name], whole.quiet[name])
    close = {"rtol": 0.0, "atol": 1e-12 * scene.F_N}
    np.testing.assert_allclose(parts.quiet["F_T"], whole.quiet["F_T"], **close)
    np.testing.assert_allclose(parts.curve["F_T"], whole.curve["F_T"], **close)
    assert parts.final_state.y == pytest.approx(whole.final_state.y, rel=1e-12)
    assert parts.counts["block_evaluations"] < 0.8 * whole.counts["block_evaluations"]


@pytest.mark.parametrize("aside", [2, 5])
def test_parts_that_are_too_short_are_doubled(aside, monkeypatch):
    monkeypatch.setattr(moving, "ASIDE", aside)
    parts, whole = both(pulled(), 0.4, monkeypatch)
    assert np.array_equal(parts.switches["t"], whole.switches["t"])
    assert parts.counts["block_evaluations"] < 0.8 * whole.counts["block_evaluations"]


def test_a_limit_far_from_all_that_slips_releases_its_block():
    limit_from = [1e-3 if n == 50 else float("inf") for n in range(60)]
    scene = pulled(limit=((0.0, 0.6), (0.02, 0.0)), limit_from=limit_from)
    a, b = (pyfric.simulate(scene, 0.025, fidelity=engine) for engine in ("dynamic", "hybrid"))
    assert set(a.switches["block"]) == {50}
    np.testing.assert_array_equal(b.switches["block"], a.switches["block"])
    np.testing.assert_allclose(b.switches["t"], a.switches["t"], rtol=0, atol=1e-8)


def test_a_switch_costs_the_same_in_a_longer_chain():
    cost = []
    for N_x in (150, 600):
        scene = preset("burridge_knopoff", L=(N_x - 1) * 2.5e-3, V=1e-6)
        made = pyfric.simulate(scene, 0.25, fidelity="hybrid")
        cost.append(made.counts["block_evaluations"] / len(made.switches["t"]))
    assert cost[1] < 1.5 * cost[0]


def test_a_part_has_the_forces_of_the_chain():
    scene = pushed(side="right")
    model = core.model(scene, "linear", 0.0)
    whole = pyfric.statics.loaded_state(scene).state(scene, 1e-7)
    whole.y[0, 0] = 1e-6 * np.sin(np.arange(scene.N_x))
    for first, end in ((0, 20), (13, 41), (30, 60)):
        part = core.Part(model, first, end)
        own = core.evaluate(part.model, part.state(whole), 1e-3)
        inner = slice(first > 0, None if end == 60 else -1)
        f = core.evaluate(model, whole, 1e-3).f[first:end]
        assert np.array_equal(own.f[inner], f[inner])
        assert (own.F_T != 0) == (end == 60)  # the driver is at the right end


def test_parts_begin_where_they_pay(monkeypatch):
    monkeypatch.undo()
    assert [moving.has_parts(pulled(N_x)) for N_x in (60, 159, 160)] == [False, False, True]


def test_parts_need_rest_beside_rest():
    assert moving.has_parts(pulled())
    assert moving.has_parts(pushed(d_c=1e-6, law=pyfric.laws.LinearWeakening()))
    for scene in (
        preset("fig1"),
        pushed(protocol=[("1 ms", 1e-3), ("2 ms", 0.0)]),
        pushed(law=pyfric.laws.Ageing(B=0.1, t_c=1e-3)),
        preset("burridge_knopoff", law=pyfric.laws.RateAndState(a=0.01, b=0.015, D_c=2e-7)),
    ):
        assert not moving.has_parts(scene)
