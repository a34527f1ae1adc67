"""Ensembles: numbers of many runs are those of their records, and are stored in parts."""

import functools
import signal

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from helpers import refused, small_free, small_rod
from test_heights import grooved

import pyfric
from pyfric.cli.commands import main
from pyfric.engines import Asked, outlines
from pyfric.record import EVENT_COLUMNS, RUN_COLUMNS, Outline
from pyfric.scene import Spread, chain
from pyfric.statics import EquilibriumError
from pyfric.sweeps import Span, Store, Sweep, measures
from pyfric.values import SceneError

simulate = functools.partial(pyfric.simulate, fidelity="quasistatic", progress=False)
FIELD = Spread(mean=0.7, std=0.05)
SCENE = small_rod(h=10e-3)
VARY = {"mu_s": FIELD}
T_END = 1.3


def made(n=9, scene=SCENE, vary=VARY, **how):
    return pyfric.ensemble(scene, vary, n, T_END, **{"cache": False, "progress": False} | how)


@functools.cache
def known():
    return made(events=("F_T_start", "n_blocks", "potency"))


# --- numbers are those of records ----------------------------------------------------------------

BATCH = {
    **{
        f"seed {n}": (SCENE.replace(mu_s=Spread(mean=0.7, std=0.05, seed=n)), T_END) for n in (1, 2)
    },
    "other end": (SCENE.replace(mu_s=FIELD), 0.8),
    "another foundation": (SCENE.replace(k_f=2e6), T_END),
    "free": (small_free(theta=0.833).replace(mu_s=FIELD), 0.5),
    "free, other friction": (small_free(theta=0.833, mu_s=0.6), 0.5),
    "right": (small_rod(side="right", h=7.5e-3), 1.0),
    "slips while it is loaded": (small_free(theta=0.833, mu_s=0.2, mu_k=0.1), 0.3),
    "grows": (SCENE.replace(mu_s=0.45), 1.0),
    "not unique": (small_free(k_f=1e10, mu_s=5.0, mu_k=5.0), 3.0),
    "loads": (small_free().replace({"top.protocol": ((0.2, 400.0), (0.4, 350.0))}), 0.6),
    "loads, other friction": (
        small_free(mu_s=0.65).replace({"top.protocol": ((0.2, 400.0), (0.4, 350.0))}),
        0.6,
    ),
    "slipped": (small_rod().replace(slip=tuple(np.linspace(2e-6, 0, 13).tolist())), 1.0),
    "bare": (grooved("bare", V=6e-3), 0.1),
    "gaps": (grooved("gaps", V=6e-3), 0.1),
    "chain": (chain(L=0.05, k_top=2e7, V=0.02), 0.03),
    "no time": (SCENE, 0.0),
}


@functools.cache
def together(threads):
    found = outlines((Asked(*BATCH[name]) for name in BATCH), threads)
    return dict(zip(BATCH, found, strict=True))


@pytest.mark.parametrize("name", BATCH)
def test_a_run_of_a_batch_is_that_of_its_record(name):
    """Bits agree, also among different scenes, for any number of threads."""
    record = simulate(*BATCH[name])
    alone = Outline.of_record(record)
    for found in (together(1)[name], together(3)[name]):
        assert found.status == record.status
        for column in EVENT_COLUMNS:
            np.testing.assert_array_equal(found.events[column], alone.events[column])
        for number in RUN_COLUMNS:
            np.testing.assert_equal(found[number], alone[number])
    assert len(record.events) > 3 or name in ("no time", "not unique", "grows", "slipped")


def test_numbers_are_what_they_say():
    """Numbers follow from the tables of a record in another way."""
    record = simulate(SCENE, 2.5)
    events, run = record.events, Outline.of_record(record)
    main, done = events[events["is_main"]], events["is_main"] & events["finished"]
    sliding, lengths = (
        events[done & (events["L_p_over_L"] == 1)],
        pyfric.analysis.precursor_lengths(record),
    )
    drops = (events["F_T_start"] - events["F_T_arrest"])[events["finished"]]
    expected = {
        "n_events": len(events),
        "n_main_events": len(main),
        "n_precursors": len(lengths),
        "F_first": main["F_T_start"].iloc[0],
        "F_max": record.curve["F_T"].max(),
        "L_p_max": lengths["L_p_over_L"].max(),
        "t_slide": sliding["t_start"].iloc[0],
        "F_slide": sliding["F_T_start"].iloc[0],
        "t_first": main["t_start"].iloc[0],
        "x_first": main["x_nucleation"].iloc[0],
        "n_blocks_first": main["n_blocks"].iloc[0],
        "L_p_first": lengths["L_p_over_L"].iloc[0],
        "F_precursor": events["F_T_start"][lengths["event"].iloc[0]],
        "drop_max": drops.max(),
        "n_system_size": len(sliding),
        "recurrence": sliding["t_start"].diff().mean(),
        "potency": events["potency"][events["finished"]].sum(),
        "b": pyfric.analysis.sizes(record).b,
    }
    assert set(expected) == set(RUN_COLUMNS)
    assert len(sliding) > 1
    for name, value in expected.items():
        assert run[name] == pytest.approx(value, rel=1e-12), name


def test_runs_without_events_have_no_numbers_of_them():
    run = Outline.of_record(simulate(SCENE, 0.1))
    assert run["n_events"] == 0
    assert np.isnan(
        [run[name] for name in ("F_first", "L_p_max", "t_slide", "b", "drop_max")]
    ).all()


# --- ensembles -----------------------------------------------------------------------------------


def test_a_table_has_a_row_for_each_seed():
    table = known().table
    assert list(table.index) == list(range(9))
    assert table.index.name == "seed"
    assert list(table.columns) == ["status", "reason", *RUN_COLUMNS]
    assert (table["status"] == "complete").all()
    for seed in (0, 8):
        record = known().record(seed)
        assert record.scene.interface.mu_s.seed == seed
        assert table["F_max"][seed] == record.curve["F_T"].max()
        events = known().events[known().events["seed"] == seed]
        np.testing.assert_array_equal(events["n_blocks"], record.events["n_blocks"])
        np.testing.assert_array_equal(events["potency"], record.events["potency"])
    assert "9 complete" in repr(known())


@pytest.mark.parametrize("how", [{"threads": 1}, {"threads": 2}, {"threads": 7}], ids=str)
def test_a_table_does_not_depend_on_threads(how):
    pd.testing.assert_frame_equal(made(**how).table, known().table, check_exact=True)


def test_a_later_seed_gives_the_same_run():
    found = made(3, seed=6, columns=["F_max", "b"])
    expected = known().table.loc[6:8, ["status", "reason", "F_max", "b"]]
    pd.testing.assert_frame_equal(found.table, expected, check_exact=True)


def test_statistics_are_those_of_the_table():
    found, column = known().statistics("F_max"), known().table["F_max"]
    assert list(found.index) == ["F_max"]
    row = found.loc["F_max"]
    assert row["mean"] == pytest.approx(np.mean(column))
    assert row["std"] == pytest.approx(np.std(column, ddof=1))
    assert row["standard_error"] == pytest.approx(np.std(column, ddof=1) / 3)
    assert row["median"] == np.median(column)
    assert (row["5 %"], row["95 %"]) == tuple(np.quantile(column, [0.05, 0.95]))
    assert row["n"] == 9
    assert known().statistics().loc["t_slide", "n"] == known().table["t_slide"].notna().sum()


def test_numbers_and_lists_vary_too():
    vary = {"mu_s": FIELD, "mu_k": Span(start=0.4, stop=0.5), "h": [5e-3, 7.5e-3, 10e-3]}
    found = made(3, vary=vary, seed=4, columns=["F_max"])
    table = found.table
    assert list(table["driver.h"]) == [5e-3, 7.5e-3, 10e-3]
    assert table["interface.mu_k"].between(0.4, 0.5).all()
    assert table["interface.mu_k"].nunique() == 3
    record = found.record(5)
    assert record.scene.driver.h == 7.5e-3
    assert record.scene.interface.mu_k == table["interface.mu_k"][5]
    assert record.scene.interface.mu_s.seed == 5
    assert record.curve["F_T"].max() == table["F_max"][5]


def test_what_follows_from_l_in_a_preset_follows():
    """The driver of fig1 is two blocks above the interface for any l."""
    found = made(2, "fig1", {"mu_s": FIELD, "l": [2.5e-3, 5e-3]}, columns=["F_first"])
    assert [found.record(n).scene.N_x for n in (0, 1)] == [57, 29]


def test_runs_that_fail_or_are_refused_are_said():
    """A draw of mu_s below mu_k is refused; the other runs are made."""
    found = made(4, vary={"mu_k": [0.4, 0.9, 0.5, 0.3]}, columns=["F_max"])
    assert list(found.table["status"]) == ["complete", "refused", "complete", "complete"]
    assert "mu_k" in found.failed["reason"].iloc[0]
    assert np.isnan(found.table["F_max"][1])
    with pytest.raises(SceneError, match="mu_k"):
        found.record(1)


def test_errors_of_the_core_are_those_of_a_run(monkeypatch):
    monkeypatch.setattr("pyfric.statics.sequences.CHANGES", 0)
    with pytest.raises(EquilibriumError) as error:
        simulate(SCENE, T_END)
    found = made(2, vary={"mu_s": [0.7, 0.65]})
    assert list(found.table["status"]) == ["failed", "failed"]
    assert found.table["reason"][0] == str(error.value)


@pytest.mark.parametrize(
    ("arguments", "field", "text"),
    [
        ({"vary": {}}, "vary", "a mapping"),
        ({"vary": {"mu_s": 0.7}}, "vary.interface.mu_s", "a Spread, a Span, or a list of 9 values"),
        ({"vary": {"mu_s": [0.7, 0.6]}}, "vary.interface.mu_s", "9 values"),
        ({"vary": {"mu": FIELD}}, "mu", "mu_s"),
        ({"n": 0}, "n", "1"),
        ({"seed": -1}, "seed", "0"),
        ({"columns": ["F_ma"]}, "columns", "F_max"),
        ({"columns": "F_max"}, "columns", "a list of names"),
        ({"events": ["t_fast"]}, "events", "t_start"),
        ({"threads": 0}, "threads", "1"),
        ({"options": {"fidelity": "dynamical"}}, "fidelity", "dynamic"),
    ],
    ids=str,
)
def test_arguments_are_checked(arguments, field, text):
    with pytest.raises(SceneError) as error:
        made(**arguments)
    assert field in error.value.field
    assert text in str(error.value)


def test_unknown_numbers_and_runs_are_refused():
    with pytest.raises(SceneError, match="F_max"):
        known().statistics("F_mx")
    refused(lambda: known().record(9), "seed", value=9, within=(0, 8))


def test_other_runs_go_through_records(monkeypatch):
    """Runs with conditions for the end, and with other engines, have records."""
    in_this_process = functools.partial(pyfric.run_all, workers=1)
    monkeypatch.setattr(measures, "run_all", in_this_process)
    options = {"fidelity": "quasistatic", "stop_when": "main_events = 1"}
    found = made(2, options=options, columns=["n_main_events", "F_first"])
    assert list(found.table["n_main_events"]) == [1, 1]
    np.testing.assert_array_equal(found.table["F_first"], known().table["F_first"][:2])
    assert found.table["status"].str.startswith("ended by stop_when").all()
    other = made(2, options={"fidelity": "hybrid"}, columns=["F_first"])
    np.testing.assert_allclose(other.table["F_first"], known().table["F_first"][:2], rtol=0.02)


def test_a_sweep_has_numbers_of_its_points():
    over = {"mu_k": [0.4, 0.45], "mu_s.seed": [1, 2]}
    scene = SCENE.replace(mu_s=FIELD)
    sweep = Sweep(scene=scene, t_end=T_END, over=over, options={"fidelity": "quasistatic"})
    found = sweep.measure(["F_max", "n_events"], events=["t_start"], cache=False)
    whole = sweep.run(workers=1, cache=False, progress=False).table
    for name in ("interface.mu_k", "interface.mu_s.seed", "F_max", "n_events"):
        np.testing.assert_array_equal(found.table[name], whole[name])
    assert found.table.index.name == "point"
    assert found.events["point"].value_counts().sort_index().tolist() == whole["n_events"].tolist()


def test_tables_are_written(tmp_path):
    names = [path.name for path in known().save(tmp_path / "out")]
    assert names == ["runs.csv", "events.csv"]
    table = pd.read_csv(tmp_path / "out" / "runs.csv", index_col="seed")
    np.testing.assert_array_equal(table["F_max"], known().table["F_max"])
    assert len(pd.read_csv(tmp_path / "out" / "events.csv")) == known().table["n_events"].sum()


# --- what is kept --------------------------------------------------------------------------------


@pytest.fixture
def counted(monkeypatch):
    """Count the runs that are made, in parts of four."""
    made_now = []

    def counting(asked, threads):
        for outcome in outlines(asked, threads):
            made_now.append(outcome)
            yield outcome

    monkeypatch.setattr(measures, "outlines", counting)
    monkeypatch.setattr(measures, "PART", 4)
    return made_now


def test_parts_are_kept(tmp_path, counted):
    """A larger ensemble reuses the parts of a smaller one; other columns need new runs."""
    columns = ["F_max", "t_slide"]
    first = made(8, cache=tmp_path, columns=columns, events=["n_blocks"])
    assert len(counted) == 8
    more = made(10, cache=tmp_path, columns=columns, events=["n_blocks"])
    assert len(counted) == 10
    pd.testing.assert_frame_equal(first.table, more.table[:8], check_exact=True)
    pd.testing.assert_frame_equal(more.events, made(10, events=["n_blocks"]).events)
    counted.clear()
    again = made(10, cache=tmp_path, columns=columns, events=["n_blocks"])
    assert not counted
    pd.testing.assert_frame_equal(again.table, more.table, check_exact=True)
    pd.testing.assert_frame_equal(again.events, more.events, check_exact=True)
    for change in ({"columns": ["F_max"]}, {"vary": {"mu_s": Spread(mean=0.7, std=0.04)}}):
        counted.clear()
        made(8, cache=tmp_path, **{"columns": columns, "events": ["n_blocks"]} | change)
        assert len(counted) == 8


def test_a_damaged_part_is_made_again(tmp_path, counted):
    first = made(8, cache=tmp_path)
    part = sorted(tmp_path.glob("*.npz"))[0]
    part.write_bytes(part.read_bytes()[:-100] + b"x" * 100)
    counted.clear()
    again = made(8, cache=tmp_path)
    assert len(counted) == 4
    pd.testing.assert_frame_equal(again.table, first.table, check_exact=True)


def test_a_stopped_ensemble_goes_on(tmp_path, counted):
    """Ctrl-C comes after the second part."""

    def stop(done, _):
        if done == 9:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        made(12, cache=tmp_path, progress=stop)
    assert len(counted) == 9
    counted.clear()
    shown = []
    found = made(12, cache=tmp_path, progress=lambda *now: shown.append(now))
    assert len(counted) == 4
    assert shown == [(8, 12), (9, 12), (10, 12), (11, 12), (12, 12)]
    pd.testing.assert_frame_equal(found.table, made(12).table, check_exact=True)


def test_the_store_knows_parts(tmp_path, counted, monkeypatch):
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path))
    made(5, cache=True, columns=["F_max"])
    listed = CliRunner().invoke(main, ["cache", "list"])
    assert "numbers of 4 runs" in listed.output
    assert "numbers of 1 runs" in listed.output
    assert CliRunner().invoke(main, ["cache", "check"]).exit_code == 0
    part = sorted(tmp_path.glob("*.npz"))[0]
    part.write_bytes(part.read_bytes()[:-1])
    checked = CliRunner().invoke(main, ["cache", "check"])
    assert checked.exit_code == 1
    assert "damaged" in checked.output
    gone, _ = Store(tmp_path).prune(damaged=True)
    assert [entry.path for entry in gone] == [part]
    assert len(Store(tmp_path).entries()) == 1


def test_batches_are_bounded(monkeypatch):
    """Scenes are made at most one batch ahead."""
    taken = []

    def asked():
        for n in range(40):
            taken.append(n)
            yield Asked(SCENE.replace(mu_s=Spread(mean=0.7, std=0.05, seed=n)), 0.6)

    monkeypatch.setattr("pyfric.engines.together.BATCH", 4)
    for n, _ in enumerate(outlines(asked(), 2)):
        assert len(taken) <= n + 13
    assert n == 39
