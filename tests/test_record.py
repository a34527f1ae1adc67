"""Records are read from files exactly as written; foreign or newer files are refused."""

import copy
import dataclasses
import itertools
import json
import os
import pickle
import warnings
from types import SimpleNamespace

import h5netcdf
import h5py
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from damage import unnoticed
from helpers import edited, seal_again
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import loadmat

import pyfric
from pyfric.core import ENERGIES, State
from pyfric.record import (
    GROUPS,
    Errors,
    Method,
    Record,
    RecordError,
    block_array,
    catalogue,
    episodes,
    event_column,
    held,
    held_in,
)
from pyfric.record.layout import SCHEMA, SEAL, TEXTS, fields
from pyfric.scene import setup1, setup2
from pyfric.values import SceneError, files

MS = 1e-3
MANY = int(os.environ.get("PYFRIC_BROKEN", "0"))  # see test_broken


def make_catalogue(scene, n_events=3):
    """Return events of 2, 3, ... blocks from the trailing edge, 5 ms apart, and a corner slip."""
    column = np.argsort(scene.n_of_i)
    rows, quiet = [], []
    u_x = np.zeros(scene.N_x)
    for e in range(n_events):
        t, step = (1 + 5 * e) * MS, 10_000 * e
        mode = np.zeros(scene.N_x, dtype=np.int32)
        mode[column[0]] = 1
        quiet.append((step, t, 1, 10.0 * e, u_x.copy(), mode))
        for n in range(e + 2):
            rows.append((step, column[n], 0, 1, 0, t + n * 2e-6, 0.0, 10.0))
        for n in range(e + 2):
            rows.append((step + 9, column[n], 1, 0, 0, t + 0.5 * MS, 0.1e-6, 10.0))
        u_x = u_x + 0.1e-6
        quiet.append((step + 9, t + 0.5 * MS, -1, 10.0 * e - 1, u_x.copy(), 0 * mode))
        rows.append((step + 20, column[0], 0, -1, 1, t + MS, 0.0, 0.1))
        rows.append((step + 21, column[0], -1, 0, 1, t + 1.1 * MS, -1e-9, 0.2))
    rows = np.array(rows, dtype=float).reshape(-1, len(episodes.SWITCH_COLUMNS))
    switches = {
        name: column.astype(kind)
        for (name, kind), column in zip(episodes.SWITCH_COLUMNS.items(), rows.T, strict=True)
    }
    columns = zip(*quiet, strict=True) if quiet else [[]] * 6
    quiet = {
        name: np.array(column, dtype=kind)
        for (name, kind), column in zip(episodes.QUIET_COLUMNS.items(), columns, strict=True)
    }
    quiet |= {name: quiet[name].reshape(-1, scene.N_x) for name in ("u_x", "mode")}

    def solve(u, drive, *, free):
        tau = np.sin(np.arange(scene.N_x) + 1e7 * drive)
        return SimpleNamespace(F_T=1e6 * drive, tau=tau, p=np.exp(tau))

    solver = SimpleNamespace(solve=solve)
    return catalogue.build_catalogue(switches, quiet, scene, solver=solver), quiet, switches


def make_state(scene, seed=4):
    """Return a state with numbers that text would round."""
    rng, zeros = np.random.default_rng(seed), np.zeros(scene.N_x)
    whole = np.arange(scene.N_x, dtype=np.int32) % 3 - 1
    memory = np.zeros(scene.N_x, scene.law.memory)
    memory["s_0"], memory["t_0"] = rng.standard_normal(scene.N_x), -0.0
    return State(
        y=rng.standard_normal((scene.N_z, 4, scene.N_x)), rod=np.full(6, -0.0), mode=whole,
        corner=whole % 2, margin=zeros, memory=memory, loss=zeros, heat=zeros,
        dissipated=np.zeros(scene.N_z),
        work=np.zeros(2), step=2**60 + 1, t0=0.1 + 0.2, dt=1 / 3, u_drv0=-1e-310, drive=2e-5,
    )  # fmt: skip


def make_record(scene=None, n_events=3, **changes):
    scene = scene or setup1()
    found, quiet, switches = make_catalogue(scene, n_events)
    t = np.linspace(0, 0.02, 50)
    rng = np.random.default_rng(0)
    entries = {
        "curve": pd.DataFrame({"t": t, "F_T": 1e3 * np.sqrt(t), "elastic_bonds": rng.random(50)}),
        "tau_initial": rng.standard_normal(scene.N_x),
        "p_initial": rng.random(scene.N_x),
        "quiet": quiet,
        "switches": switches,
        "versions": {"pyfric": "0.1.0", "compiler": "GNU Fortran 12 – «µ»"},
        "timings": {"run": 0.1 + 0.2, "catalogue": 1e-300},
        "method": Method(engine="dynamic", geometry="finite", stepper="rk4", dt=0.2e-6),
        "final_state": make_state(scene),
    }
    return Record.from_catalogue(found, scene=scene, **(entries | changes))


def through_file(original, tmp_path):
    return Record.load(original.save(tmp_path / "run.nc"))


def test_the_short_names_that_everyone_tries(tmp_path):
    record = make_record(setup1(), 7)
    assert pyfric.load(record.save(tmp_path / "run.nc")) == record
    assert record.plot().caption == pyfric.figures.fig1b(record).caption


@pytest.mark.parametrize("n_events", [0, 1, 7])
@pytest.mark.parametrize("make_scene", [setup1, lambda: setup2(theta=-1 / 3)])
def test_loaded_record_is_identical(make_scene, n_events, tmp_path):
    original = make_record(make_scene(), n_events)
    loaded = through_file(original, tmp_path)
    assert loaded == original
    for one in dataclasses.fields(Record):
        a, b = getattr(original, one.name), getattr(loaded, one.name)
        if isinstance(a, pd.DataFrame):
            pd.testing.assert_frame_equal(a, b, check_exact=True)
        elif one.name in ("quiet", "switches", "arrays", "tau_initial", "p_initial"):
            same_bits(a, b)
        else:
            assert a == b
    assert loaded.final_state.step == 2**60 + 1
    assert type(loaded.final_state.t0) is float
    assert str(loaded.final_state.u_drv0) == "-1e-310"


def same_bits(a, b):
    if not isinstance(a, np.ndarray):
        assert list(a) == list(b)
        for name in a:
            same_bits(a[name], b[name])
        return
    assert a.dtype == b.dtype
    assert a.tobytes() == b.tobytes()


def from_tree(tree):
    """Return the record in a tree, in the same way as from a file."""
    groups = {
        group: {k: v.to_numpy() for k, v in one.to_dataset(inherit=False).variables.items()}
        for group, one in tree.children.items()
    }
    return Record(**fields(tree.attrs, groups))


@pytest.mark.parametrize("n_events", [0, 3])
def test_a_tree_holds_all_of_a_record(n_events, tmp_path):
    record = make_record(setup2(theta=-1 / 3), n_events)
    tree = record.to_datatree()
    assert from_tree(tree) == record
    assert set(tree.children) == set(GROUPS)
    assert list(tree["events"].data_vars) == list(record.events)
    assert tree["interface/tau_before"].dims == ("event", "x")
    for group in GROUPS:
        for name, variable in tree[group].to_dataset(inherit=False).variables.items():
            assert variable.attrs["units"], (group, name)
            assert variable.attrs["long_name"], (group, name)
    if n_events:
        tree.to_netcdf(tmp_path / "tree.nc", engine="h5netcdf")
        with xr.open_datatree(tmp_path / "tree.nc", engine="h5netcdf", decode_cf=False) as again:
            assert (again["events/t_start"] == record.events["t_start"]).all()


@pytest.mark.parametrize("name", ["chain", "slow", "rate_and_state"])
def test_a_record_says_what_the_law_of_its_scene_names(name):
    how = {"fidelity": "dynamic", "energies": True, "progress": False}
    record = pyfric.simulate(pyfric.preset(name), 2e-5, **how)
    tree, law = record.to_datatree(), record.scene.law
    for one in (*law.state, law.margin):
        attributes = tree["final_state"][one.name].attrs
        assert attributes["units"] == one.unit
        assert attributes["long_name"].startswith(one.meaning)
    terms = {term.name: term for term in law.terms}
    assert law.budget().keys() <= terms.keys() & set(record.curve)
    for one in law.budget():
        attributes = tree["curve"][one].attrs
        assert (attributes["units"], attributes["long_name"]) == ("J", terms[one].meaning)


def test_a_dataset_is_lean_and_says_what_is_in_it():
    record = make_record()
    dataset = record.to_xarray()
    assert set(dataset.coords) == {"t", "event", "x", "n"}
    assert set(dataset.sizes) == {"t", "event", "x"}
    assert all({"units", "long_name"} <= set(one.attrs) for one in dataset.variables.values())
    assert (dataset["event_t_start"] == record.events["t_start"]).all()
    third = record.events.loc[3]
    assert dataset.sel(event=3)["event_t_start"] == third["t_start"]
    assert (
        dataset.sel(event=3, x=0.0)["tau_after"]
        == record.tau_after[record.row(3)][record.scene.i_h]
    )
    first = dataset.isel(event=0).set_index(x="n").sortby("x")["tau_after"]
    np.testing.assert_array_equal(first, record.tau_after[0][np.argsort(record.scene.n_of_i)])
    assert not any(value.startswith("{") for value in map(str, dataset.attrs.values()))


@pytest.mark.parametrize("side", ["left", "right"])
def test_x_is_the_distance_from_the_trailing_edge_everywhere(side, tmp_path):
    record = make_record(setup1(side=side))
    scene = record.scene
    x = (scene.n_of_i - 1) * scene.slider.l
    assert x[scene.i_h] == 0.0
    assert x.max() == pytest.approx(scene.slider.L)
    np.testing.assert_array_equal(record.to_xarray()["x"], x)
    np.testing.assert_array_equal(record.to_datatree()["interface/x"], x)
    with xr.open_dataset(record.save(tmp_path / "run.nc")) as file:
        np.testing.assert_array_equal(file["x"], x)
        np.testing.assert_array_equal(file["event"], record.events.index)
    record.to_csv(tmp_path)
    table = pd.read_csv(tmp_path / "interface.csv")
    np.testing.assert_array_equal(table["x"], x)
    assert (record.events["x_nucleation"] == 0).all()


def test_events_are_counted_from_one_everywhere():
    record = make_record()
    assert list(record.events.index) == [1, 2, 3]
    assert record.events.index.name == "event"
    assert list(record.episodes["event"].unique()) == [1, 0, 2, 3]
    assert [record.row(event) for event in record.events.index] == [0, 1, 2]
    for wrong in (0, 4, True, 1.0, "1", None):
        with pytest.raises(SceneError, match="event"):
            record.row(wrong)
    first = record.episodes[record.episodes["event"] == 2]["t_start"].min()
    assert first == record.events.loc[2, "t_start"]


def test_floats_survive_bit_for_bit(tmp_path):
    rng = np.random.default_rng(2)
    bits = rng.integers(0, 2**64, 10_000, dtype=np.uint64)  # NaN payloads, subnormals, infinities
    wild = np.concatenate([bits.view(float), [-0.0, 0.0, np.nan, np.inf, 5e-324]])
    curve = pd.DataFrame({"t": np.arange(wild.size) * 1e-7, "F_T": wild})
    loaded = through_file(make_record(curve=curve), tmp_path)
    assert loaded.curve["F_T"].to_numpy().tobytes() == wild.tobytes()


def test_tables_have_the_columns_and_types_of_the_one_table():
    good = make_record()
    whole = good.curve.assign(F_T=np.arange(len(good.curve)))  # integers are numbers
    assert good.replace(curve=whole).curve["F_T"].dtype == float
    shuffled = good.replace(curve=good.curve[["F_T", "elastic_bonds", "t"]])
    assert list(shuffled.curve) == ["t", "F_T", "elastic_bonds"]
    for curve, message in (
        (good.curve.assign(odd=1.0), "no record holds curve.odd"),
        (good.curve.assign(F_T="x"), "curve.F_T holds"),
        (good.curve.assign(F_T=1j), "curve.F_T holds complex128"),
        (good.curve.drop(columns="t"), "curve.t is missing"),
    ):
        with pytest.raises(RecordError, match=message):
            good.replace(curve=curve)
    assert set(ENERGIES) < set(held_in("curve"))


def test_identical_sees_one_bit():
    a = make_record()
    p = a.p_initial.copy()
    p[3] = np.nextafter(p[3], 1)
    assert a == make_record()
    assert a != dataclasses.replace(a, p_initial=p)
    assert a != dataclasses.replace(a, status="interrupted")
    assert a != dataclasses.replace(a, curve=a.curve.assign(t=a.curve["t"] + 1e-16))
    assert a != dataclasses.replace(a, timings=a.timings | {"run": 1.0})
    assert a != a.replace(tau_after=np.nextafter(a.tau_after, 1))
    assert a != a.replace(errors=Errors(start=0.1))
    other = make_state(a.scene)
    other.rod[2] = 0.0  # which was -0.0
    assert a == a.replace(final_state=make_state(a.scene))
    assert a != a.replace(final_state=other)


@pytest.mark.parametrize("status", ["complete", "interrupted", "failed: p is not finite"])
def test_status_survives(status, tmp_path):
    assert through_file(make_record(status=status, final_state=None), tmp_path).status == status


def test_record_checks_its_parts():
    good = make_record()
    for change, message in (
        ({"status": "fine"}, "status"),
        ({"p_initial": np.zeros(3)}, "p_initial has shape"),
        ({"rupture_times": good.rupture_times[:-1]}, "rupture_times has shape"),
        ({"arrays": {}}, "interface.region is missing"),
        ({"tau_after": good.tau_after.astype(complex)}, "tau_after holds complex128"),
        ({"curve": good.curve.drop(columns="F_T")}, "curve.F_T is missing"),
        ({"switches": {}}, "switches.step is missing"),
        ({"quiet": {"step": good.quiet["step"]}}, "quiet.t is missing"),
        ({"quiet": good.quiet | {"t": good.quiet["t"][1:]}}, "quiet.t has shape"),
    ):
        with pytest.raises(RecordError, match=message):
            good.replace(**change)
    with pytest.raises(AttributeError, match="no 'tau_befor'"):
        _ = good.tau_befor
    assert "tau_before" in dir(good)


def test_masked_values_are_refused():
    record = make_record()
    array = np.ma.masked_array(record.tau_initial)
    assert record.replace(tau_initial=array) == record
    array[0] = np.ma.masked
    with pytest.raises(RecordError, match=r"interface.tau_initial has masked values"):
        record.replace(tau_initial=array)


def test_arrays_are_read_only_and_fields_frozen():
    good = make_record()
    with pytest.raises(ValueError, match="read-only"):
        good.tau_before[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        good.quiet["u_x"][0, 0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        good.status = "complete"


@pytest.mark.parametrize(
    "copied", [lambda r: r, copy.deepcopy, lambda r: pickle.loads(pickle.dumps(r))]
)
def test_nothing_changes_a_record(copied):
    untouched, record = make_record(), copied(make_record())
    for change in (
        lambda: record.curve.loc.__setitem__((0, "F_T"), 1.0),
        lambda: record.events.__setitem__("L_p_over_L", 0.0),
        lambda: record.episodes.iloc.__setitem__((slice(None), 0), 0),
    ):
        with warnings.catch_warnings(action="ignore"):  # pandas warns that a copy changes
            change()
    curve = record.curve
    curve["F_T"] = 0.0
    curve.iloc[:] = 0.0
    record.final_state.y[:] = 0.0
    record.final_state.step = 0
    for name in ("timings", "versions", "counts", "quiet", "switches"):
        with pytest.raises(TypeError):
            getattr(record, name)["run"] = 0.0
    with pytest.raises(TypeError):
        record.arrays["region"] = record.region
    for array in (record.region, record.p_initial, record.quiet["u_x"]):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0
    assert record == untouched


def test_a_record_keeps_none_of_the_tables_it_was_made_from():
    curve = make_record().curve
    record = make_record(curve=curve)
    curve.loc[0, "F_T"] = 1.0
    assert record == make_record()


def test_tables_are_plain_frames():
    events = make_record().events
    events["force"] = events["F_T_start"] / 2
    assert (events.groupby("is_main")["force"].sum() > 0).any()


def test_records_equal_no_other_object():
    assert make_record() != 3
    assert make_record() != make_record(n_events=1)


# --- the one table -------------------------------------------------------------------------------


@pytest.fixture
def one_more(monkeypatch):
    """Add a column of events and an array over blocks, each by one decorated function."""
    monkeypatch.setattr(held, "_held", {group: dict(names) for group, names in held._held.items()})

    @event_column("m", "largest slip of a block")
    def largest_slip(of):
        slip = np.abs(of.joined["slip"])
        return np.maximum.reduceat(slip, of.first)

    @block_array("m", "slip in the event, without corner slip")
    def slip(of):
        found = np.zeros((of.first.size, of.scene.N_x))
        np.add.at(found, (of.joined["row"], of.joined["i"]), of.joined["slip"])
        return found


def test_a_column_and_an_array_are_one_function_each(one_more, tmp_path):
    """Each is in the record, the file, the Dataset, the tree and the tables, with its meaning."""
    record = make_record()
    assert (record.events["largest_slip"] == record.slip.max(axis=1)).all()
    assert through_file(record, tmp_path) == record
    assert from_tree(record.to_datatree()) == record
    dataset = record.to_xarray()
    assert dataset["event_largest_slip"].attrs["long_name"] == "largest slip of a block"
    assert dataset["slip"].dims == ("event", "x")
    record.to_csv(tmp_path)
    meanings = pd.read_csv(tmp_path / "columns.csv").set_index(["table", "column"])["meaning"]
    assert meanings["events", "largest_slip"] == "largest slip of a block"
    assert "slip" in pd.read_csv(tmp_path / "stresses.csv")
    with pytest.raises(ValueError, match="held already"):
        event_column("m", "again")(held_in("events")["largest_slip"].find)


def test_what_nobody_describes_is_not_read(tmp_path, monkeypatch):
    with monkeypatch.context() as here:
        here.setitem(held._held, "events", dict(held._held["events"]))
        event_column("1", "its row")(lambda of: np.arange(of.first.size, dtype=float))
        path = make_record().save(tmp_path / "run.nc")
    with pytest.raises(RecordError, match=r"event_<lambda>: no record holds"):
        Record.load(path)


# --- the file ------------------------------------------------------------------------------------


def test_file_describes_itself(tmp_path):
    path = make_record().save(tmp_path / "run.nc")
    with xr.open_dataset(path) as dataset:
        for name, variable in dataset.variables.items():
            assert variable.attrs["units"], name
            assert variable.attrs["long_name"], name
        assert dataset["F_T"].dims == ("t",)
        assert dataset["F_T"].attrs["units"] == "N"
        assert dataset["elastic_bonds"].attrs["units"] == "J"
        assert dataset["tau_before"].dims == ("event", "x")
        assert dataset["event_is_main"].dtype == bool
        assert {"x", "t", "n"} <= set(dataset.coords)
        assert "[slider]" in dataset.attrs["scene"]


def test_saving_replaces_the_file_whole(tmp_path, monkeypatch):
    path = tmp_path / "run.nc"
    old = make_record(n_events=1)
    old.save(path)
    assert [one.name for one in tmp_path.iterdir()] == ["run.nc"]

    def no_space(*_, **__):
        raise OSError("no space left")

    monkeypatch.setattr(files, "_flush", no_space)
    with pytest.raises(OSError, match="no space"):
        make_record(n_events=2).save(path)
    assert [one.name for one in tmp_path.iterdir()] == ["run.nc"]
    assert Record.load(path) == old


def test_another_run_is_saved_beside_the_file_that_exists(tmp_path):
    path, old = tmp_path / "run.nc", make_record(n_events=1)
    new = old.replace(method=dataclasses.replace(old.method, dt=0.1e-6))
    old.save(path)
    for n in (2, 3):
        with pytest.raises(SceneError, match=rf"the file exists.*the new one is run-{n}\.nc"):
            new.save(path)
        assert Record.load(tmp_path / f"run-{n}.nc") == new
    assert Record.load(path) == old
    new.save(path, overwrite=True)
    assert Record.load(path) == new
    assert len(list(tmp_path.iterdir())) == 3


def test_saved_file_has_the_usual_permissions(tmp_path):
    path = make_record(n_events=1).save(tmp_path / "run.nc")
    (tmp_path / "plain").touch()
    assert path.stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_any_netcdf_reader_opens_the_file(tmp_path):
    record = make_record()
    path = record.save(tmp_path / "run.nc")
    F_T = record.curve["F_T"].to_numpy()
    with h5py.File(path) as file:
        assert (file["F_T"][:] == F_T).all()
    with h5netcdf.File(path) as file:
        assert (file["F_T"][:] == F_T).all()
    with xr.open_dataset(path) as file:
        assert (file["F_T"] == F_T).all()


def test_types_are_those_that_every_program_reads(tmp_path):
    """Types are those of classic netCDF: no strings, no enumerations, short integers."""
    record = make_record()
    slow = record.episodes["step_start"].to_numpy() + 2**40
    record = record.replace(episodes=record.episodes.assign(step_start=slow))
    path = record.save(tmp_path / "run.nc")
    classic = [h5py.h5t.FLOAT, h5py.h5t.INTEGER]
    with h5py.File(path) as file:
        for where in (file, *file.values()):
            own = {"DIMENSION_LIST", "REFERENCE_LIST", "actual_range"}
            said = [one for one in where.attrs if one not in own]
            for kind in (where.attrs.get_id(name).get_type() for name in said):
                text = kind.get_class() == h5py.h5t.STRING and not kind.is_variable_str()
                assert text or kind.get_class() in classic, (where, said)
                assert text or kind.get_class() == h5py.h5t.FLOAT or kind.get_size() <= 4
        for name, one in file.items():
            assert one.id.get_type().get_class() in classic, name
            values = one[()]
            long = one.dtype.kind == "i" and one.dtype.itemsize > 4
            assert long == (name in ("episode_step_start", "final_step")), name
            gaps = one.dtype.kind == "f" and bool(np.isnan(values).any())
            label = one.attrs.get("NAME", b"")
            if label.startswith(b"This is a netCDF dimension") or one.attrs.get("dtype") == b"bool":
                continue
            assert ("_FillValue" in one.attrs) == gaps, name
            if gaps:
                assert np.isnan(one.fillvalue), name
                assert one.attrs["_FillValue"].dtype == one.dtype, name
            there = values[np.isfinite(values)]
            assert ("actual_range" in one.attrs) == bool(there.size), name
            if there.size:
                assert one.attrs["actual_range"].dtype == one.dtype, name
                assert list(one.attrs["actual_range"]) == [there.min(), there.max()], name
        assert file["episode_t_stop"].attrs["units"] == b"s"
        assert file.attrs["pyfric_schema"].dtype == np.int32
    assert Record.load(path) == record


@pytest.mark.parametrize("name", ["µ_s = 0,7 – Gleitblock", "a" * 200_000])
def test_texts_of_any_length_and_alphabet(name, tmp_path):
    record = make_record()
    record = record.replace(notes=(name,), versions={"": name})
    path = record.save(tmp_path / "run.nc")
    assert Record.load(path) == record
    with h5netcdf.File(path) as file:
        assert json.loads(file.attrs["notes"]) == [name]


def test_damage_is_noticed_or_left_nothing_out(tmp_path):
    record = make_record()
    path, read = record.save(tmp_path / "run.nc"), []
    unnoticed(path, lambda path: read.append(Record.load(path)), RecordError,
              seed=1, flips=90, pages=12, cuts=12)  # fmt: skip
    assert len(read) < 75, "titles and units take a part of a small file"
    assert all(found == record for found in read)
    assert Record.load(path) == record


def test_a_program_that_opens_a_record_for_writing_does_not_damage_it(tmp_path):
    record = make_record()
    path = record.save(tmp_path / "run.nc")
    before = path.read_bytes()
    with h5py.File(path, "a") as file:
        file.attrs["history"] = "opened by another program"
        file["F_T"].attrs["colour"] = "blue"
    assert path.read_bytes() != before
    assert Record.load(path) == Record.load(path, unsealed=True) == record


def test_what_another_program_changed_is_read_on_demand_and_has_a_note(tmp_path):
    record = make_record()
    path = record.save(tmp_path / "run.nc")
    with h5py.File(path, "a") as file:
        file["F_T"][3] = np.nextafter(file["F_T"][3], np.inf)
    with pytest.raises(RecordError, match=rf"{SEAL} do not agree.*unsealed=True"):
        Record.load(path)
    read = pyfric.load(path, unsealed=True)
    assert "changed after pyfric wrote it" in read.notes[-1]
    assert (read.curve["F_T"] != record.curve["F_T"]).sum() == 1
    assert Record.load(read.save(path)) == read, "its note stays"
    with h5py.File(path, "a") as file:
        del file["F_T"]
    with pytest.raises(RecordError, match="F_T"):
        Record.load(path, unsealed=True)


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"run\.nc"):
        Record.load(tmp_path / "run.nc")


def test_foreign_files_are_refused(tmp_path):
    path = tmp_path / "run.nc"
    for content in (b"", b"t,F_T\n0,0\n", os.urandom(2000)):
        path.write_bytes(content)
        with pytest.raises(RecordError, match="not a pyfric record"):
            Record.load(path)
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(RecordError, match="not a pyfric record"):
        Record.load(path)
    with edited(path):
        pass
    with pytest.raises(RecordError, match="no attribute pyfric_schema"):
        Record.load(path)
    for path in (tmp_path, "/dev/zero"):
        with pytest.raises(RecordError, match="not a regular file"):
            Record.load(path)


def test_cut_off_file_is_refused(tmp_path):
    path = make_record().save(tmp_path / "run.nc")
    path.write_bytes(path.read_bytes()[:-3000])
    with pytest.raises(RecordError, match=r"run\.nc"):
        Record.load(path)


@pytest.mark.parametrize("schema", [SCHEMA - 1, SCHEMA + 1])
def test_another_schema_is_refused(schema, tmp_path):
    path = make_record().save(tmp_path / "run.nc")
    with edited(path) as file:
        file.attrs["pyfric_schema"] = schema
    with pytest.raises(RecordError, match=rf"schema {schema}.*reads {SCHEMA}; another version"):
        Record.load(path)


# --- files that somebody sealed again ------------------------------------------------------------


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return make_record().save(tmp_path_factory.mktemp("saved") / "run.nc")


@pytest.fixture
def resealed(tmp_path, saved):
    """Return the result of loading a file after a change."""

    def told(change):
        path = tmp_path / "run.nc"
        path.write_bytes(saved.read_bytes())
        with h5py.File(path, "a") as file:
            change(file)
        seal_again(path)
        with pytest.raises(RecordError) as refused:
            Record.load(path)
        assert str(path) in str(refused.value)
        return str(refused.value)

    return told


WRONG = [3, None, "", "x", "x=", "[", "[]", '{"a": [1]}', b"\xff", [1, 2]]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *itertools.product(["scene", "timings"], WRONG),
        *itertools.product(["status", *(one for one in TEXTS if one != "timings")], [3, None, "x"]),
    ],
)
def test_attributes_are_what_they_have_to_be(resealed, name, value):
    """Wrong forms are refused: status = 3, timings as a list, a path as scene ..."""

    def change(file):
        del file.attrs[name]
        if value is not None:
            file.attrs[name] = value

    if name == "notes" and value == "[]":
        return  # missing notes are no damage
    assert name in resealed(change)


@pytest.mark.parametrize(
    ("name", "value", "field"),
    [
        ("timings", {"run": "long"}, "timings.run"),
        ("versions", {"pyfric": 1}, "versions.pyfric"),
        ("counts", {"steps": None}, "counts.steps"),
        ("notes", ["a", 3], "notes.1"),
        ("method", {"engine": "dynamic", "geometry": 3}, "method.geometry"),
        ("method", {"engine": "dynamic", "geometry": "linear", "odd": 1}, "method.odd"),
        ("errors", {"start": "small"}, "errors.start"),
        ("errors", {"statistics": {"a": [1.0]}}, "errors.statistics"),
        ("errors", {"odd": 1.0}, "errors.odd"),
    ],
)
def test_a_wrong_part_of_an_attribute_is_named(resealed, name, value, field):
    assert f"attribute {field}" in resealed(lambda f: f.attrs.create(name, json.dumps(value)))


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("t", "curve."),
        ("event_t_start", "events.t_start"),
        ("episode_n", "episodes."),
        ("tau_after", "interface.tau_after"),
        ("n", "n"),
        ("quiet_u_x", "quiet."),
        ("switch_p", "switches."),
    ],
)
def test_variables_have_their_types_and_shapes(resealed, name, field):
    for values in (
        np.zeros(4),
        np.zeros(()),
        np.zeros((2, 2, 2)),
        np.zeros(50, complex),
        np.array([b"a", b"b"]),
        np.zeros(2, [("a", float)]),
        h5py.Empty("f8"),
    ):

        def change(file, values=values):
            attributes = dict(file[name].attrs)
            del file[name]
            file[name] = values
            keep = ("units", "long_name")
            file[name].attrs.update({k: attributes[k] for k in keep if k in attributes})

        said = resealed(change).partition("record (")[2]
        assert field in said or said.startswith(f"{name} holds no numbers")
    assert field in resealed(lambda file: file.__delitem__(name))


def test_no_link_is_followed_and_no_other_file_is_read(resealed, tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["F_T"] = np.zeros(50)

    def replaced(make):
        def change(file):
            del file["F_T"]
            make(file)

        return change

    layout = h5py.VirtualLayout((50,), "f8")
    layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "F_T", (50,))
    (tmp_path / "raw").write_bytes(bytes(400))
    raw = [(str(tmp_path / "raw"), 0, 400)]
    for make, why in (
        (lambda f: f.__setitem__("F_T", h5py.ExternalLink(tmp_path / "other.h5", "F_T")), "link"),
        (lambda f: f.__setitem__("F_T", h5py.SoftLink("/t")), "link"),
        (lambda f: f.create_virtual_dataset("F_T", layout), "another file"),
        (lambda f: f.create_dataset("F_T", (50,), "f8", external=raw), "another file"),
        (lambda f: f.create_group("F_T"), "no variable"),
        (
            lambda f: f.create_dataset("F_T", data=np.zeros(50), fletcher32=True),
            "stored with filters",
        ),
        (lambda f: f.create_dataset("F_T", (10**12,), "f8"), "claims more data"),
        (lambda f: f.create_dataset("F_T", data=f["t"].ref, dtype=h5py.ref_dtype), "no numbers"),
    ):
        assert f"F_T {why}" in resealed(replaced(make)).replace("is a ", "").replace(
            "lies in ", ""
        ).replace("is ", "").replace("holds ", "").replace("are ", "")


@pytest.mark.parametrize("scene", ["/etc/passwd", "fig1", "scene.toml", "../scene.toml"])
def test_the_scene_is_parsed_and_never_opened(resealed, scene, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(setup1().to_toml())
    assert "attribute scene" in resealed(lambda file: file.attrs.create("scene", scene))


def test_a_scene_of_a_record_names_no_files(resealed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "friction.csv").write_text("slip (um),mu\n0,0.7\n1,0.45\n")
    text = setup1().to_toml() + '\n[interface.law]\nkind = "table"\nslide = "friction.csv"\n'
    said = resealed(lambda file: file.attrs.create("scene", text))
    assert "interface.law.slide" in said
    assert "names no files" in said


def test_a_final_state_fits_its_scene(resealed):
    for name, values in (
        ("final_y", np.zeros((2, 4, 3))),
        ("final_mode", np.zeros(57)),
        ("final_dt", np.array(-1.0)),
        ("final_odd", np.zeros(57)),  # no state variable of its law
        ("final_odd", np.zeros(2)),
    ):

        def change(file, name=name, values=values):
            if name in file:
                del file[name]
            file[name] = values

        assert "final_state" in resealed(change)
    assert "final_state" in resealed(lambda file: file.__delitem__("final_y"))


@settings(max_examples=MANY // 4 or 12, derandomize=not MANY, deadline=None, database=None,
          suppress_health_check=list(HealthCheck))  # fmt: skip
@given(st.data())
def test_whatever_is_changed_is_answered_or_read(saved, tmp_path, data):
    """Any change of a variable or attribute gives a record or a `RecordError` with the cause."""
    path = tmp_path / "run.nc"
    path.write_bytes(saved.read_bytes())
    numbers = st.sampled_from([0, -1, 1.5, np.nan, np.inf, 1e300, 2**62, -(2**62), 127, True])
    texts = st.text(max_size=20) | st.sampled_from(["{}", "[]", "null", "NaN", "0", '"a"', "1e999"])
    with h5py.File(path, "a") as file:
        name = data.draw(st.sampled_from([*file.attrs, *file]))
        if name in file.attrs:
            file.attrs[name] = data.draw(texts | numbers)
        elif data.draw(st.booleans()) or not file[name].size:
            shape = data.draw(st.sampled_from([(), (0,), (1,), (3,), (50,), (3, 57), (57, 3)]))
            dtype = data.draw(st.sampled_from(["f8", "i8", "i4", "i1", "u8", "f4", ">f8", "?"]))
            keep = dict(file[name].attrs)
            del file[name]
            file.create_dataset(name, data=np.zeros(shape, dtype))
            file[name].attrs.update({k: keep[k] for k in ("units",) if k in keep})
        else:
            with np.errstate(all="ignore"):
                values = np.array(file[name])
                at = data.draw(st.integers(0, values.size - 1))
                values.reshape(-1)[at] = np.array(data.draw(numbers)).astype(values.dtype)
            file[name][...] = values
    seal_again(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            record = Record.load(path)
        except RecordError as error:
            assert str(error).startswith(str(path))
            return
        record.summary()
        assert Record.load(record.save(path)) == record


# --- CSV -----------------------------------------------------------------------------------------


def test_csv_holds_every_digit(tmp_path):
    original = make_record()
    paths = original.to_csv(tmp_path / "csv")
    names = ["curve", "events", "episodes", "interface", "stresses", "columns"]
    assert [path.stem for path in paths] == names
    read = {path.stem: pd.read_csv(path, engine="python") for path in paths}
    pd.testing.assert_frame_equal(read["curve"], pd.DataFrame(original.curve), check_exact=True)
    pd.testing.assert_frame_equal(
        read["events"].set_index("event"), pd.DataFrame(original.events), check_exact=True
    )
    pd.testing.assert_frame_equal(
        read["episodes"], pd.DataFrame(original.episodes), check_exact=True, check_dtype=False
    )
    stresses = read["stresses"]
    assert list(stresses.columns[:2]) == ["event", "n"]
    second = stresses[stresses["event"] == 2]
    np.testing.assert_array_equal(second["tau_before"], original.tau_before[1])
    np.testing.assert_array_equal(second["n"], original.scene.n_of_i)
    np.testing.assert_array_equal(read["interface"]["p_initial"], original.p_initial)
    described = set(zip(read["columns"]["table"], read["columns"]["column"], strict=True))
    assert described == {(name, column) for name in names[:-1] for column in read[name]}


def test_matlab_files_hold_every_group(tmp_path):
    record = make_record()
    found = loadmat(record.to_mat(tmp_path / "run.mat"), simplify_cells=True)
    for name in ("curve", "events", "episodes"):
        for column, values in getattr(record, name).items():
            np.testing.assert_array_equal(found[name][column], values.to_numpy())
    np.testing.assert_array_equal(found["interface"]["tau_before"], record.tau_before)
    np.testing.assert_array_equal(found["final_state"]["y"], record.final_state.y)
    assert pyfric.Scene.from_toml(found["about"]["scene"] + "\n") == record.scene
    assert found["about"]["status"] == record.status
    with pytest.raises(SceneError, match=r"\.nc"):
        record.to_mat(tmp_path / "run.nc")


def test_csv_of_no_events(tmp_path):
    paths = make_record(n_events=0).to_csv(tmp_path)
    assert all(path.read_text().count("\n") >= 1 for path in paths)
