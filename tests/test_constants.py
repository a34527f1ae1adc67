"""Fitted numbers, doubled and halved: forces and promises hold.

The table of these numbers is in `docs/explanation/numbers.md`.
"""

import functools
import importlib
from pathlib import Path

import numpy as np
import off_box
import pytest

import pyfric
from pyfric.record import differences
from pyfric.scene import preset, setup1

ACCURACY = 1e-6
"""Of start and arrest forces of every event, over F_N."""
SETS = ("protocol_linear", pytest.param("light_finite", marks=pytest.mark.slow))
FITTED = (
    "modes.N_MODES",
    "jump.TRY",
    "hybrid.AMPLIFIED",
)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("constant", FITTED)
def test_events_do_not_depend_on_it(constant, factor, name, monkeypatch):
    module, _, attribute = constant.partition(".")
    module = importlib.import_module(f"pyfric.engines.{module}")
    value = getattr(module, attribute)
    monkeypatch.setattr(module, attribute, type(value)(factor * value))
    if attribute == "N_MODES":
        defaults = (None, None, module.N_MODES)
        monkeypatch.setattr(module.Linearised.__init__, "__defaults__", defaults)
    elif attribute == "TRY":
        monkeypatch.setattr("pyfric.engines.hybrid.TRY", module.TRY)
    known = off_box.load(name)
    found = known.apart(known.hybrid())
    assert (found["events"], found["blocks"]) == (0, 0)
    limit = ACCURACY / (factor if attribute == "AMPLIFIED" else 1.0)
    assert max(found["start"], found["arrest"]) <= max(limit, ACCURACY)


CHOOSE = {
    "planning.choice.ERROR_QUASISTATIC": {},
    "planning.choice.RING_SHARE": {},
    "planning.choice.OPEN_BLOCKS": {},
    "engines.stretches.SOFTEST": {"d_c": 5e-8},
}
"""Number -> changes of the Fig. 1 scene in which it decides."""
DECIDE = {"planning.choice.ERROR_QUASISTATIC": 2.0, "engines.stretches.SOFTEST": 0.5}
"""Those with which another engine is taken there, and by which factor."""
TOLERANCE = 0.06


def rod(**changes):
    return setup1(L=0.02, H=0.0125, F_N=400.0, V=2e-3, **changes)


@functools.cache
def full(t_end, **changes):
    how = {"fidelity": "dynamic", "budget": False, "progress": False, "geometry": "linear"}
    return pyfric.simulate(rod(**changes), t_end, **how)


@functools.cache
def exact(**changes):
    scene = preset("fig1", **changes)
    return pyfric.simulate(scene, 0.3, fidelity="hybrid", geometry="finite", progress=False)


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("constant", CHOOSE)
def test_plans_keep_their_promise_whatever_chooses(constant, factor, monkeypatch):
    module, _, attribute = constant.rpartition(".")
    module = importlib.import_module(f"pyfric.{module}")
    monkeypatch.setattr(module, attribute, factor * getattr(module, attribute))
    scene = preset("fig1", **CHOOSE[constant])
    how = {"want": "precursors", "tolerance": TOLERANCE, "progress": False, "verify": "none"}
    made = pyfric.simulate(scene, 0.3, **how)
    errors = differences(made, exact(**CHOOSE[constant])).errors()
    assert max(errors["start"], errors["arrest"]) <= TOLERANCE
    other = DECIDE.get(constant) == factor
    assert made.method.engine == ("hybrid" if other else "quasistatic")


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_stable_slip_does_not_depend_on_inertia_allowed(factor, monkeypatch):
    monkeypatch.setattr("pyfric.engines.creeping.INERTIA", 200.0 * factor)
    how = {"fidelity": "hybrid", "geometry": "linear", "progress": False}
    a, b = full(0.048, d_c=5e-6), pyfric.simulate(rod(d_c=5e-6), 0.048, **how)
    assert len(a.events) == len(b.events) > 1
    limit = 1e-5 * a.scene.F_N
    np.testing.assert_allclose(b.events["F_T_start"], a.events["F_T_start"], rtol=0, atol=limit)


def test_the_docs_list_them_all():
    page = Path(__file__).parents[1] / "docs" / "explanation" / "numbers.md"
    text = page.read_text(encoding="utf-8")
    chosen = (constant.partition(".")[2] for constant in CHOOSE)
    for constant in (*FITTED, *chosen, "creeping.INERTIA"):
        assert f"`{constant}`" in text
