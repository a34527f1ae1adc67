"""Draws from posteriors, compared with the exact normal distribution of a linear problem."""

import dataclasses
import functools
import sys

import numpy as np
import pandas as pd
import pytest
from helpers import refused

import pyfric
from pyfric.fitting import posterior
from pyfric.measured import events
from pyfric.values import SceneError

SCENE = pyfric.preset("fig1", l="5 mm")
ERROR = 1e-3


@functools.cache
def linear():
    """Return a fit of offset and drift, with linear residuals from a single run."""
    table = (
        events(pyfric.simulate(SCENE, 0.9, fidelity="quasistatic")).iloc[-6:].copy()
    )  # drops are large
    rng = np.random.default_rng(4)
    for name in ("peak", "valley"):
        table[name] += 0.01 + ERROR * rng.standard_normal(len(table))
        table[f"{name}_error"] = ERROR
    table["drop_error"] = np.sqrt(2) * ERROR
    table["rate"] = np.nan
    bounds = {"offset": (-0.02, 0.02), "drift": (-0.05, 0.05)}
    how = {"level": 0.68268949, "part": "all", "fidelity": "quasistatic"}
    return table, pyfric.fit(SCENE, table, bounds, **how)


@functools.cache
def drawn_from_it():
    said = []
    return posterior(linear()[1], 1200, progress=said.append), said


def test_draws_have_the_exact_means_and_covariances():
    pytest.importorskip("emcee")
    table, found = linear()
    t = np.concatenate([table["t_start"], table["t_stop"]])
    X = np.column_stack([np.ones(len(t)), t]) / ERROR
    exact = np.linalg.inv(X.T @ X)
    drawn, said = drawn_from_it()
    assert list(drawn) == ["offset", "drift", "chi2"]
    assert len(drawn) == 1200
    assert len(said) > 100
    spread = np.sqrt(np.diag(exact))
    for k, name in enumerate(("offset", "drift")):
        assert drawn[name].mean() == pytest.approx(found.values[name], abs=0.3 * spread[k])
        low, high = found.intervals[name]
        assert 0.5 * (high - low) == pytest.approx(spread[k], rel=0.05)  # one standard deviation
    cov = np.cov(drawn[["offset", "drift"]].to_numpy().T)
    np.testing.assert_allclose(cov, exact, rtol=0.25)
    above = drawn["chi2"] - found.chi2
    assert above.min() >= -1e-6
    assert above.mean() == pytest.approx(2, rel=0.2)  # chi^2 with two degrees of freedom
    assert 0.3 < drawn.attrs["acceptance"] < 0.9
    assert drawn.attrs["independent"] > 30
    few = posterior(found, 100)
    pd.testing.assert_frame_equal(few, posterior(found, 100))
    assert not few.equals(posterior(found, 100, seed=1))


def test_draws_assume_the_error_of_the_model():
    pytest.importorskip("emcee")
    _, found = linear()
    off = 2 * ERROR
    wider = posterior(dataclasses.replace(found, model_error=off), 800)
    ratio = wider["offset"].std() / drawn_from_it()[0]["offset"].std()
    assert ratio == pytest.approx(np.hypot(off, ERROR) / ERROR, rel=0.25)
    assert found.problem.model_error == 0


def test_what_is_missing_is_said(monkeypatch):
    _, found = linear()
    refused(lambda: posterior(found, 3), "draws", value=3, within=(100,))
    with pytest.raises(SceneError, match="no runs"):
        posterior(dataclasses.replace(found, problem=None))
    monkeypatch.setitem(sys.modules, "emcee", None)
    with pytest.raises(SceneError, match=r"pip install pyfric\[posterior\]"):
        posterior(found)
