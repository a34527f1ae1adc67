"""The study of the collapse: which fronts it compares, and its stored table."""

from pathlib import Path

import collapse
import numpy as np
import pandas as pd
import pytest

STORED = Path(__file__).parents[1] / "reference_data" / "fronts"


def front(n_first, level, noise=0.0, **about):
    """Return a front of 40 blocks whose speed follows a prestress that falls along it."""
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
    assert found["X_c"].between(0.45, 0.5).all()  # a front without a zone counts as unresolved
    assert (found["prestress_low"] > 0.9).all()
    every, last = found.to_dict("records")
    assert every["beyond_low"] > every["beyond_null"]
    assert last["beyond_null"] > every["beyond_null"]  # fewer fronts leave more to chance
    assert "0 " in collapse.report(found)


def test_fronts_that_began_from_a_coarser_lattice_are_told_apart():
    """Each front from a coarser lattice is the first event of its own run."""
    about = {"d_c": 1e-6, "l": 5e-4, "begun": 1e-3, "event": 1}
    runs = [front(2, 0.2 * i, 0.05, scene=f"run{run}", **about) for run in (1, 2) for i in (1, 2)]
    (row,) = collapse.collapse(pd.concat(runs)).to_dict("records")
    assert row["precursors"] == "last"  # there are no other fronts
    assert row["fronts"] == 4


@pytest.mark.slow
def test_the_stored_table_is_that_of_the_stored_fronts():
    found = collapse.collapse(pd.read_csv(STORED / "fronts_fronts.csv"))
    stored = pd.read_csv(STORED / "collapse.csv")
    pd.testing.assert_frame_equal(found, stored, rtol=1e-4, check_dtype=False)


def test_what_is_said_of_speeds_without_weakening():
    """As the docs say, the prestress explains more than the position."""
    stored = pd.read_csv(STORED / "collapse.csv").set_index(["d_c", "l", "precursors"])
    for l in (2.5e-3, 1.25e-3):
        coulomb = stored.loc[0, l, "all"]
        assert coulomb["prestress_low"] > 0.49
        assert coulomb["prestress_value"] > coulomb["prestress_null"]
    assert coulomb["prestress_low"] > coulomb["prestress_null"]
    assert coulomb["beyond_low"] > coulomb["beyond_null"]
