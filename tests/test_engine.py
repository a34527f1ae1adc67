"""Engines as objects: their options, their refusals, and an engine of the tests."""

import dataclasses
import functools

import numpy as np
import pytest

import pyfric
from pyfric.engines import ENGINES, Engine, integrate, owned
from pyfric.engines.quasistatic import QuasistaticRun, static_sequence
from pyfric.scene import chain, preset, setup1
from pyfric.statics import check_statics
from pyfric.values import SceneError

SCENE, T_END = setup1(L=0.03, H=0.015, V=7.875e-3), 0.065
"""A scene, and a time (s) after its first event of more than one block."""
simulate = functools.partial(pyfric.simulate, progress=False)
SCENES = {
    "of the paper": SCENE,
    "junctions": preset("slow"),
    "rate and state": preset("rate_and_state", L=0.03, H=0.015),
    "pushed": pyfric.forced(SCENE, x=0.01, length=5e-3, speed=100.0),
    "no driver": chain(K=0.0),
    "viscous": setup1(L=0.03, H=0.015, alpha=1e-3),
}


class StaticToy(QuasistaticRun):
    name = "toy"


def toy(monkeypatch, *owners, steps=False):
    """Register an engine with the options of these owners."""
    static = {"geometries": ("linear",), "check": check_statics}
    engine = Engine(
        name="toy",
        models="what another engine models",
        options=owned("run", *owners),
        follow=functools.partial(*((integrate, "toy") if steps else (static_sequence, StaticToy))),
        **({"steppers": ("rk4", "rk46")} if steps else static),
    )
    monkeypatch.setitem(ENGINES, "toy", engine)
    return engine


def test_a_new_engine_runs_by_its_name(monkeypatch):
    engine = toy(monkeypatch)
    record = simulate(SCENE, T_END, fidelity="toy", stop_when=())
    assert record.method.engine == "toy"
    known = simulate(SCENE, T_END, fidelity="quasistatic").curve
    assert record.curve.equals(known)
    longer = simulate(SCENE, 1.1 * T_END, initial=record)
    assert longer.method.engine == "toy"
    assert longer.curve["t"].iloc[-1] == pytest.approx(1.1 * T_END)
    assert (engine.steps, engine.jumps, engine.energies) == (False, False, False)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("dt", 1e-6, "'hybrid' or 'dynamic'"),
        ("method", "paper", "'hybrid' or 'dynamic'"),
        ("stepper", "verlet", "None, or fidelity = 'dynamic'"),
        ("accuracy", 1e-7, "None, or fidelity = 'hybrid'"),
        ("energies", True, "False, or fidelity = 'hybrid' or 'dynamic'"),
        ("sample", 1e-3, "makes no time steps"),
        ("geometry", "finite", "'linear', or fidelity = 'hybrid' or 'dynamic'"),
        ("verify", "sample", "'none', or fidelity = 'quasistatic' or 'hybrid' or 'dynamic'"),
        ("verify", "full", "finds no event"),
    ],
)
def test_a_new_engine_refuses_what_it_lacks(monkeypatch, name, value, text):
    toy(monkeypatch)
    with pytest.raises(SceneError, match="the toy engine") as refusal:
        simulate(SCENE, T_END, fidelity="toy", **{name: value})
    assert refusal.value.field == name
    assert text in str(refusal.value)
    nothing = {"energies": False, "verify": "none", "geometry": "linear", "dt": "auto"}
    assert ENGINES["toy"].lacks(pyfric.Options(**nothing)) is None


@pytest.mark.parametrize("steps", [False, True])
def test_a_new_engine_is_verified_if_it_finds_events(monkeypatch, steps):
    toy(monkeypatch, "events", *(["steps"] if steps else []), steps=steps)
    record = simulate(SCENE, T_END, fidelity="toy", verify="sample", tolerance=0.1)
    assert record.method.engine == "toy"
    assert record.errors.by
    assert np.isfinite(record.errors.measured())


@pytest.mark.parametrize("name", ["auto", *ENGINES])
@pytest.mark.parametrize("verify", ["sample", "full"])
def test_who_asks_for_errors_gets_them_or_a_refusal(name, verify):
    options = pyfric.Options(fidelity=name, verify=verify)
    if name != "auto" and (error := ENGINES[name].lacks(options)) is not None:
        assert error.field == "verify"
        with pytest.raises(SceneError, match="verify"):
            simulate(SCENE, 1e-3, options)
    else:
        record = simulate(SCENE, 1e-3, options)
        assert record.errors.by or any("errors" in note for note in record.notes)


@pytest.mark.parametrize("engine", ENGINES.values(), ids=ENGINES)
@pytest.mark.parametrize("scene", SCENES)
def test_an_engine_says_what_it_cannot_run(engine, scene):
    reason = engine.cannot(SCENES[scene])
    expected = {
        "of the paper": {"equilibrium", "quasistatic", "hybrid", "dynamic"},
        "viscous": {"equilibrium", "hybrid", "dynamic"},
        "rate and state": {"hybrid", "dynamic"},
    }
    assert (reason == "") == (engine.name in expected.get(scene, {"dynamic"}))
    if reason:
        with pytest.raises(SceneError) as refusal:
            simulate(SCENES[scene], 1e-4, fidelity=engine.name)
        assert reason in str(refusal.value)


def test_options_are_declared_once():
    declared = pyfric.Options.declared()
    assert list(declared) == [field.name for field in dataclasses.fields(pyfric.Options)]
    for name, option in declared.items():
        assert f"        {name}: " in pyfric.Options.__doc__
        assert option.default == getattr(pyfric.Options, name)
        assert not option.asks(option.default)
        assert option.meaning.endswith(".")
    for engine in ENGINES.values():
        assert engine.options <= set(declared)
        assert all(declared[name].of_engine for name in engine.options)
    assert max(map(len, pyfric.Options.__doc__.splitlines())) <= 100


def test_what_an_engine_can_follows_from_its_options():
    found = {e.name: (e.steps, e.jumps, e.energies) for e in ENGINES.values()}
    assert found["hybrid"] == (True, True, True)
    assert found["dynamic"] == (True, False, True)
    assert found["quasistatic"] == found["equilibrium"] == (False, False, False)
