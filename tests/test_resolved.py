"""Fig. 4(b) with a resolved zone: positions, zones, shares, and statements on them."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import resolved
import resolved_found

import pyfric
from pyfric.paper.claims import shares
from pyfric.scene import preset

STORED = Path(__file__).parents[1] / "reference_data" / "fronts"
L = resolved.L


def test_speeds_on_places_are_those_of_the_times_between():
    l, x = 0.5e-3, np.arange(61) * 0.5e-3
    t = x / 800 + np.where(x > 15e-3, (x - 15e-3) / 800, 0.0)  # half as fast from 15 mm on
    t[50] = t[48]  # a block that slips before the front
    table = resolved._places(t, 56, l).set_index("x")
    assert table.index.to_numpy() == pytest.approx(np.arange(23) * L)
    v = table["v_c"].to_numpy()
    assert v[1:12] == pytest.approx(800)
    assert v[12] == pytest.approx(2 / (1 / 800 + 1 / 400))
    assert v[13:18] == pytest.approx(400)
    assert np.isnan(v[[0, 19, 20, 22]]).all()
    assert table["t"].iloc[4] == pytest.approx(4 * L / 800)


def test_the_zone_ends_where_slip_reaches_d_c():
    """Blocks slip at 1 m/s behind a front at 1000 m/s, so that 2 um of slip is a zone of 2 mm."""
    l, d_c, first = 0.25e-3, 2e-6, 5
    passed = np.arange(80) * l / 1000
    times = np.arange(0, 30e-6, 0.7e-6)
    slip = np.clip(times[:, None] - passed, 0, None)
    record = SimpleNamespace(
        curve=pd.DataFrame({"t": times}),
        motion={"u_x": slip},
        scene=SimpleNamespace(d=1, N_x=80),
        rupture_times=passed[None],
    )
    blocks = resolved._zones(record, first, 70, d_c)
    assert np.isnan(blocks[:first]).all()
    assert np.isnan(blocks[70:]).all()
    assert blocks[first] == 1  # behind it all blocks have slipped
    inside = blocks[first + 10 : 70]
    assert set(inside) <= {8, 9}
    assert blocks[10] == 6  # up to the crack that was released


@pytest.fixture(autouse=True)
def fewer(monkeypatch):
    monkeypatch.setattr(shares, "DRAWS", 49)


def fronts(speed, zone=8.0):
    """Return fronts of 8 events and all variants, with speeds from prestress and position."""
    rows = []
    rng, place = np.random.default_rng(0), np.linspace(0, 1, 40)
    for number in range(8):
        scaled = 0.9 - 0.3 * place + 0.4 * rng.random() + 0.2 * np.sin(9 * place + number)
        for d_c in resolved.D_C:
            for viscosity in resolved.VISCOSITIES:
                table = {"x": place, "scaled": scaled, "v_c": speed(scaled, place, rng)}
                about = {"scene": f"run{1 + number // 2}", "event": number, "d_c": d_c}
                known = {"zone": zone, "release": 1.0 + place, "v_R": 1.1, "v_L": 0.5}
                rows.append(pd.DataFrame(table | about | known | {"viscosity": viscosity}))
    table = pd.concat(rows, ignore_index=True)
    return table.assign(inside=table["x"].between(0.1, 0.9))


@pytest.mark.parametrize(
    ("speed", "zone", "said"),
    [
        (lambda s, x, rng: 1e3 * np.exp(s), 8.0, "keeps"),
        (lambda s, x, rng: 1e3 * np.exp(x + 0.1 * rng.normal(size=x.size)), 8.0, "loses"),
        (lambda s, x, rng: 1e3 * np.exp(s), 5.0, "unresolved"),
    ],
)
def test_verdict(speed, zone, said):
    table = resolved_found.summary(fronts(speed, zone))
    assert len(table) == 12
    assert (table["fronts"] == 8).all()
    assert (table["above_R"] == 1).all()
    assert (table["above_L"] == 0).all()
    own = table[table["places"] == "own"]
    assert {resolved_found.verdict(row) for _, row in own.iterrows()} == {said}
    assert said in resolved_found.report(table)


def test_common_places_are_those_of_all_variants():
    table = fronts(lambda s, x, rng: 1e3 * np.exp(s))
    lost = (table["d_c"] == resolved.D_C[0]) & (table["x"] > 0.5)
    found = resolved_found.summary(table[~lost]).set_index(["places", "d_c"])["points"]
    assert found["every"].nunique() == 1
    assert (found["own", resolved.D_C[0]] == found["every"].iloc[0]).all()
    assert (found["own", resolved.D_C[1]] > found["every"].iloc[0]).all()


@pytest.fixture(scope="module")
def event():
    """Return the second precursor of run 1 at l = 5 mm, whose front follows a long stable slip."""
    patch = pytest.MonkeyPatch()
    patch.setattr(resolved, "L", 5e-3)
    patch.setattr(resolved, "OF_RUNS", 4e-6)
    scene = preset("run1", l=5e-3, d_c=resolved.OF_RUNS)
    how = {"fidelity": "hybrid", "geometry": "linear", "progress": False}
    run = pyfric.simulate(scene, 0.56, **how)
    yield resolved.Event(run, "run1", int(resolved.main_events(run)[-1]))
    patch.undo()


def test_a_front_that_is_released(event):
    scene = event.scene(6e-6, "the paper's", 2.5e-3)
    at = event.held(scene)
    start = float(event.run.events["t_start"].loc[event.event])
    assert event.t > start
    before, then = at(start), at(event.t)
    np.testing.assert_array_equal(before.u[0, 0], then.u[0, 0])  # all blocks stick
    driven = scene.driver.K * scene.driver.fastest * (event.t - start)
    assert 0 < then.F_T - before.F_T <= driven
    assert then.p.sum() == pytest.approx(scene.F_N, rel=1e-6)
    assert then.tau.sum() == pytest.approx(then.F_T, rel=1e-6)
    little, paper = resolved.VISCOSITIES
    table, finer, little = (
        resolved.front(event, 6e-6, viscosity, l=2.5e-3, share=share).set_index("x")
        for viscosity, share in ((paper, 1.0), (paper, 0.5), (little, 1.0))
    )
    assert table["reached"].iloc[0] > event.critical
    both = table["v_c"].notna() & finer["v_c"].notna() & (table["t"] > 0)
    assert both.sum() > 4
    change = (finer["v_c"] / table["v_c"] - 1)[both].abs()
    assert change.median() < 0.02  # steps cross the knot of the law at d_c: 0.012
    assert little["reached"].iloc[0] >= table["reached"].iloc[0]


def test_what_is_said_of_a_resolved_zone():
    """As the docs say, with little viscosity there is no collapse for any of three d_c."""
    stored = pd.read_csv(STORED / "resolved_summary.csv")
    own = stored[stored["places"] == "own"]
    assert (own["fronts"] == 8).all()
    assert (own["zone"] > 0.99).all()
    little = own[own["viscosity"] == next(iter(resolved.VISCOSITIES))].set_index("d_c").sort_index()
    assert little.index.tolist() == sorted(resolved.D_C)
    assert {resolved_found.verdict(row) for _, row in little.iterrows()} == {"loses"}
    assert (little["prestress_high"] < 0.5).tolist() == [True, True, False]
    for name in ("prestress", "ranks"):
        assert (little[f"{name}_value"] < little[f"{name}_null"]).all()
    assert little["prestress_value"].tolist() == pytest.approx([0.06, 0.08, 0.30], abs=0.01)
    every = stored[stored["places"] == "every"]
    assert (every["prestress_value"] < every["prestress_null"]).all()


@pytest.mark.slow
def test_the_stored_shares_are_those_of_the_stored_fronts(monkeypatch):
    monkeypatch.undo()
    found = resolved_found.summary(pd.read_csv(STORED / "resolved_fronts.csv"))
    stored = pd.read_csv(STORED / "resolved_summary.csv")
    pd.testing.assert_frame_equal(found, stored, rtol=1e-4, check_dtype=False)
