"""The study of the collapse: which fronts it compares, and that its stored table is theirs."""

from pathlib import Path

import collapse
import low_viscosity
import numpy as np
import pandas as pd
import pytest

from pyfric.record import Record

STORED = Path(__file__).parents[1] / "reference_data" / "fronts"


def front(n_first, level, noise=0.0, **about):
    """A front of 40 blocks whose speed follows the prestress, which falls along it."""
    n = np.arange(n_first, n_first + 40)
    scaled = level - (n - n_first) / 39
    rng = np.random.default_rng(n_first)
    columns = {"n": n, "scaled": scaled, "v_c": 1e3 * np.exp(scaled + noise * rng.normal(size=40))}
    columns |= {"X_c0_over_l": 8.0, "X_c_over_l": np.where(scaled < level - 0.5, 7.0, np.nan)}
    return pd.DataFrame(columns | about)


def study(**about):
    how = {"d_c": 0.0, "l": 1e-3, "begun": 0.0} | about
    return [
        front(2 + run, 0.2 * event + 0.1 * run, 0.05, scene=f"run{run}", event=event, **how)
        for run in range(1, 5)
        for event in range(1, 6)
    ]


def test_all_precursors_and_the_last_of_each_run():
    fig1 = front(1, 0.3, scene="fig1", event=1, d_c=0.0, l=1e-3, begun=0.0)
    found = collapse.collapse(pd.concat([fig1, *study()]))
    assert found["precursors"].tolist() == ["all", "last"]
    assert found["fronts"].tolist() == [20, 8]
    assert found["points"].tolist() == [800, 320]
    assert (found["X_c0"] == 1).all()
    assert found["X_c"].between(0.45, 0.5).all()  # a front without a zone is not resolved
    assert (found["prestress_low"] > 0.9).all()
    every, last = found.to_dict("records")
    assert every["beyond_low"] > every["beyond_null"]
    assert last["beyond_null"] > every["beyond_null"]  # fewer fronts leave more room to chance
    assert "0 " in collapse.report(found)


def test_fronts_that_began_from_a_coarser_lattice_are_told_apart():
    """Each is the first event of its own run."""
    about = {"d_c": 1e-6, "l": 5e-4, "begun": 1e-3, "event": 1}
    runs = [front(2, 0.2 * i, 0.05, scene=f"run{run}", **about) for run in (1, 2) for i in (1, 2)]
    (row,) = collapse.collapse(pd.concat(runs)).to_dict("records")
    assert row["precursors"] == "last"  # there are no others
    assert row["fronts"] == 4


@pytest.mark.slow
def test_the_stored_table_is_that_of_the_stored_fronts():
    found = collapse.collapse(pd.read_csv(STORED / "fronts_fronts.csv"))
    stored = pd.read_csv(STORED / "collapse.csv")
    pd.testing.assert_frame_equal(found, stored, rtol=1e-4, check_dtype=False)


def test_what_is_said_of_a_resolved_zone():
    """The docs say it: with weakening prestress is not told from position, without it is."""
    stored = pd.read_csv(STORED / "collapse.csv").set_index(["d_c", "l", "precursors"])
    finest, coulomb = stored.loc[1e-6, 0.625e-3, "last"], stored.loc[0, 1.25e-3, "all"]
    assert finest["prestress_value"] < finest["prestress_null"]
    assert finest["beyond_value"] < finest["beyond_null"]
    assert finest["X_c"] < 0.05
    assert coulomb["prestress_low"] > coulomb["prestress_null"]
    assert coulomb["beyond_low"] > coulomb["beyond_null"]
    assert pytest.approx(0.33, abs=0.01) == finest["prestress_value"]


def test_what_is_said_of_little_viscosity():
    stored = pd.read_csv(STORED / "low_viscosity.csv").set_index(["viscosity", "l"])
    paper, little = low_viscosity.VISCOSITIES
    for l in low_viscosity.SPACINGS:
        found = stored.loc[little, l]
        assert found["fronts"] == 8
        assert found["prestress_value"] < found["prestress_null"]
        assert found["beyond_value"] < found["beyond_null"]
    again = pd.read_csv(STORED / "collapse.csv").set_index(["d_c", "l", "precursors"])
    for l in low_viscosity.SPACINGS:  # the same events, from other calls
        value = again.loc[1e-6, l, "last"]["prestress_value"]
        assert stored.loc[paper, l]["prestress_value"] == pytest.approx(value, abs=0.01)


@pytest.mark.slow
def test_fronts_with_little_viscosity_start_from_the_same_tractions(tmp_path):
    """With the paper's viscosity they stop where the run's do; with less they are faster."""
    how = {"names": ("run1",), "spacings": (5e-3,), "l": 5e-3}
    fronts = low_viscosity.study(tmp_path, **how)
    run = Record.load(tmp_path / "run1_5_1.nc")
    lengths = run.events["L_p_over_L"]
    paper, little = (fronts[fronts["viscosity"] == name] for name in low_viscosity.VISCOSITIES)
    for event, front in paper.groupby("event"):
        assert front["L_p_over_L"].iloc[0] == pytest.approx(lengths[event], abs=1 / 56)
        assert little[little["event"] == event]["v_c"].median() > 1.02 * front["v_c"].median()
    found = low_viscosity.shares_of(fronts)
    assert found["viscosity"].tolist() == list(low_viscosity.VISCOSITIES)
    assert (found["fronts"] == 2).all()
    assert "along bonds" in low_viscosity.report(found)
    pd.testing.assert_frame_equal(low_viscosity.study(tmp_path, **how), fronts)  # kept
