"""One block on a spring: the closed form of `studies sticks`."""

import numpy as np
import pandas as pd
import pytest
import sticks

PEERS = {peer.name: peer for peer in sticks.PEERS}


def test_the_closed_form_solves_the_equation_of_motion():
    """Speed and acceleration of the block follow from the force by differences."""
    t = np.linspace(4.0, 4.31, 3101)
    end = np.array([sticks.end_of_spring(None)(one) for one in t])
    u = end - sticks.exact(t, two=True) / sticks.K
    a = np.gradient(np.gradient(u, t), t)[2:-2]
    F = sticks.exact(t, two=True)[2:-2]
    np.testing.assert_allclose(sticks.M * a, F - sticks.MU_K * sticks.P, atol=2e-3)


@pytest.mark.parametrize("name", ["pyfric", "solve_ivp"])
def test_a_block_that_sticks_does_not_creep(name):
    for share in sticks.HELD:
        assert sticks.held(PEERS[name], share) == 0.0


@pytest.mark.parametrize(
    ("name", "step", "error"), [("pyfric", 1e-3, 1e-10), ("solve_ivp", 1e-10, 1e-10)]
)
def test_a_pulled_block_follows_the_closed_form(name, step, error):
    found = sticks.pulled(PEERS[name], step)
    assert found["error"] < error
    assert found["F_max"] == pytest.approx(sticks.MU_S * sticks.P, rel=1e-4)
    arrest = (2 * sticks.MU_K - sticks.MU_S) * sticks.P
    assert found["F_min"] == pytest.approx(arrest, rel=1e-4)


@pytest.mark.slow
def test_ten_blocks_move_alike_in_pyfric_and_in_the_loop():
    peer = next(peer for peer in sticks.CHAINS if peer.name == "pyfric")
    assert sticks.chained(peer, 1e-3)["error"] < 1e-6
    assert sticks.chained(peer, 5e-4)["error"] < 1e-8


def test_ten_blocks_with_another_coefficient_are_noticed():
    peer = sticks.Peer("other", "", lambda *a: sticks.chain_of_solve_ivp(1e-8, *a[1:], 0.41), True)
    assert sticks.chained(peer, 1e-8)["error"] > 0.1


def test_a_block_that_creeps_is_noticed(monkeypatch):
    def creeping(step, t_end, share):
        t = np.arange(0, t_end, step)
        return t, 1e-6 * t, 0.0, "0"

    peer = sticks.Peer("creeping", "", creeping)
    assert sticks.held(peer, 0.5) == pytest.approx(1e-6 * sticks.HOLD, rel=1e-3)
    assert sticks.pulled(peer, 1e-3)["error"] > 1e-5


def test_new_rows_replace_those_of_the_same_program():
    table = pd.DataFrame({"program": ["pyfric", "pyfric", "solve_ivp"], "error": [1.0, 2.0, 3.0]})
    rows = pd.DataFrame({"program": ["pyfric"], "error": [4.0]})
    found = sticks.renewed(table, rows)
    assert found["program"].tolist() == ["pyfric", "solve_ivp"]
    assert found["error"].tolist() == [4.0, 3.0]
