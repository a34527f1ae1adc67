"""The same slab on finer lattices: changes, notes, and refusals."""

import json
import math

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from helpers import refused

import pyfric
from pyfric.cli.commands import main
from pyfric.sweeps.spacings import AT, _finer

SLAB = pyfric.setup1(L=0.06, H=0.03, l=5e-3, V=4e-4)


def test_numbers_are_those_of_single_runs(tmp_path):
    found = pyfric.resolve(SLAB, levels=3, cache=tmp_path, workers=1, progress=False)
    assert list(found.table.columns) == [5e-3, 2.5e-3, 1.25e-3, "change", "converges"]
    for l in (5e-3, 1.25e-3):
        record = pyfric.simulate(SLAB.replace(l=l), 3.0, fidelity="quasistatic", progress=False)
        events = record.events
        first = int(np.argmax(events["L_p_over_L"] == 1))
        short = events[:first]
        short = short[short["is_precursor"] & short["is_main"]]
        values = found.table[l]
        assert values["precursors"] == len(short) > 3
        assert values["L_p/L of the first precursor"] == short["L_p_over_L"].iloc[0]
        assert values["F_T/F_N where it starts"] == short["F_T_start"].iloc[0] / SLAB.F_N
        onset = events["F_T_start"].iloc[first] / SLAB.F_N
        assert values["F_T/F_N at onset of sliding"] == onset
        below, above = short[short["L_p_over_L"] <= AT], short[short["L_p_over_L"] > AT]
        ends = [below["F_T_arrest"].max() / SLAB.F_N, above["F_T_arrest"].min() / SLAB.F_N]
        assert ends[0] <= values[f"F_T/F_N after L_p/L = {AT:g}"] <= ends[1]
    change = found.table[1.25e-3] / found.table[2.5e-3] - 1
    pd.testing.assert_series_equal(change, found.table["change"], check_names=False)
    assert len(list(tmp_path.glob("*.nc"))) == 3
    assert "no length" in str(found)
    assert "viscosity plays no part" in str(found)


@pytest.mark.parametrize("levels", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_what_has_a_limit_changes_less_than_what_has_none(levels):
    """Forces at given length and the onset change less than counts."""
    found = pyfric.resolve("fig1", levels=levels, cache=False, workers=1, progress=False).table
    steps = found[[2.5e-3, 1.25e-3, 6.25e-4][:levels]].astype(float)
    largest = steps.diff(axis=1).abs().max(axis=1) / steps[2.5e-3]
    assert largest[found["converges"]].max() < 0.02
    assert largest[~found["converges"]].max() > 0.3


def test_what_varies_and_what_is_shared_goes_on_finer_blocks():
    scene = SLAB.replace(mu_s=tuple(np.linspace(0.6, 0.8, SLAB.N_x)), alpha=0.3, side="right")
    fine = _finer(scene, 2)
    np.testing.assert_allclose(fine.field("mu_s")[::2], scene.field("mu_s"), rtol=1e-14)
    assert fine.N_x * fine.interface.alpha == pytest.approx(0.3 * fine.N_x / 2)
    assert (fine.slider.k, fine.slider.M, fine.F_N) == (scene.slider.k, scene.slider.M, scene.F_N)


def test_a_slab_that_does_not_slide_says_so():
    found = pyfric.resolve(SLAB, 0.05, cache=False, workers=1, progress=False)
    assert "no system-size event before t = 0.05 s" in str(found)
    assert math.isnan(found.table.loc["F_T/F_N at onset of sliding", 5e-3])
    (line,) = (one for one in str(found).splitlines() if one.startswith("F_T/F_N at onset"))
    assert line.split()[-4:] == ["-"] * 4  # not measured, so no statement on convergence


def test_viscosity_is_named_where_it_matters():
    how = {"options": {"fidelity": "hybrid"}, "cache": False, "workers": 1, "progress": False}
    assert "eta = sqrt(0.1 k m)" in str(pyfric.resolve(SLAB, 0.01, **how))
    assert "stays" in str(pyfric.resolve(SLAB.replace(eta=100.0), 0.01, **how))


def test_refusals():
    refused(lambda: pyfric.resolve(SLAB, levels=1), "levels", value=1, within=(2, 5))
    refused(lambda: pyfric.resolve(SLAB, levels=2.0), "levels", value=2.0, within=(2, 5))
    refused(lambda: pyfric.resolve(SLAB, options=5), "options", "a mapping")
    refused(lambda: pyfric.resolve("chain"), "top.kind", "'rod' or 'distributed'")
    slow = SLAB.replace(law=pyfric.laws.Ageing(**pyfric.laws.Ageing.example))
    refused(lambda: pyfric.resolve(slow, cache=False, workers=1), "interface.law", "cannot follow")


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "kept"))
    scene = tmp_path / "slab.toml"
    SLAB.to_toml(scene)
    shown = CliRunner().invoke(main, ["resolve", str(scene), "--workers", "1"])
    assert shown.exit_code == 0
    assert "precursors" in shown.stdout
    told = CliRunner().invoke(
        main, ["resolve", str(scene), "--t-end", "50 ms", "--workers", "1", "--json"]
    )
    quantities = json.loads(told.stdout)["quantities"]
    assert quantities["F_T/F_N at onset of sliding"]["0.005"] is None


def test_records_say_what_depends_on_l():
    record = pyfric.simulate(SLAB, 1.2, fidelity="quasistatic", progress=False)
    assert "depend on l" in record.notes[-1]
    still = pyfric.simulate(SLAB, 0.01, fidelity="quasistatic", progress=False)
    assert not any("depend on l" in note for note in still.notes)
