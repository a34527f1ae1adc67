"""Records survive the file exactly, and foreign or newer files are refused."""

import copy
import dataclasses
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
from helpers import bits, edited

from pyfric.core import State
from pyfric.record import Method, Record, RecordError, catalogue, episodes
from pyfric.record.labels import LABELS
from pyfric.record.record import GROUPS, SCHEMA
from pyfric.scene import files, setup1, setup2

MS = 1e-3


def make_catalogue(scene, n_events=3):
    """Events that slip 2, 3, ... blocks from the trailing edge, 5 ms apart, and a corner slip."""
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


def make_record(scene=None, n_events=3, **changes):
    scene = scene or setup1()
    found, quiet, switches = make_catalogue(scene, n_events)
    t = np.linspace(0, 0.02, 50)
    rng = np.random.default_rng(0)
    entries = {
        "curve": pd.DataFrame({"t": t, "F_T": 1e3 * np.sqrt(t), "kinetic": rng.random(50)}),
        "tau_initial": rng.standard_normal(scene.N_x),
        "p_initial": rng.random(scene.N_x),
        "quiet": quiet,
        "switches": switches,
        "versions": {"pyfric": "0.1.0", "compiler": "GNU Fortran 12 – «µ»"},
        "timings": {"run": 0.1 + 0.2, "catalogue": 1e-300},
        "method": Method(engine="dynamic", geometry="finite", stepper="rk4", dt=0.2e-6),
        "final_state": {
            "y": rng.standard_normal((scene.N_z, 4, scene.N_x)),
            "mode": np.arange(scene.N_x, dtype=np.int32),
            "t": 0.1 + 0.2,
            "n": 2**60 + 1,
            "done": True,
            "note": "exact",
            "nothing": None,
        },
    }
    return Record.from_catalogue(found, scene=scene, **(entries | changes))


def through_file(original, tmp_path):
    return Record.load(original.save(tmp_path / "run.nc"))


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
        elif isinstance(a, np.ndarray):
            assert a.dtype == b.dtype
            assert a.tobytes() == b.tobytes()
        elif one.name in ("quiet", "switches"):
            assert list(a) == list(b)
            for name in a:
                assert a[name].dtype == b[name].dtype
                assert a[name].tobytes() == b[name].tobytes()
        elif one.name != "final_state":
            assert a == b
    assert loaded.events.dtypes.equals(original.events.dtypes)
    assert loaded.final_state["n"] == 2**60 + 1
    assert type(loaded.final_state["t"]) is float
    assert loaded.method == original.method


@pytest.mark.parametrize("n_events", [0, 3])
def test_a_tree_holds_all_of_a_record(n_events, tmp_path):
    record = make_record(setup2(theta=-1 / 3), n_events)
    tree = record.to_datatree()
    assert Record.from_datatree(tree) == record
    assert set(tree.children) == set(GROUPS)
    assert list(tree["events"].data_vars) == list(record.events)
    assert tree["interface/tau_before"].dims == ("event", "x")
    if n_events:
        tree.to_netcdf(tmp_path / "tree.nc", engine="h5netcdf")
        with xr.open_datatree(tmp_path / "tree.nc", engine="h5netcdf", decode_cf=False) as again:
            assert (again["events/t_start"] == record.events["t_start"]).all()


def test_trees_that_are_no_record_are_refused():
    tree = make_record().to_datatree()
    with pytest.raises(RecordError, match="tree: not a pyfric record"):
        Record.from_datatree(xr.DataTree())
    del tree["episodes"]
    with pytest.raises(RecordError, match="tree: damaged pyfric record"):
        Record.from_datatree(tree)


def test_a_dataset_is_lean_and_says_what_is_in_it():
    record = make_record()
    dataset = record.to_xarray()
    assert set(dataset.coords) == {"t", "event", "x", "n"}
    assert set(dataset.sizes) == {"t", "event", "x"}
    assert all({"units", "long_name"} <= set(one.attrs) for one in dataset.variables.values())
    assert (dataset["event_t_start"] == record.events["t_start"]).all()
    first = dataset.isel(event=0).set_index(x="n").sortby("x")["tau_after"]
    np.testing.assert_array_equal(first, record.tau_after[0][np.argsort(record.scene.n_of_i)])
    assert not any(value.startswith("{") for value in map(str, dataset.attrs.values()))


def test_floats_survive_bit_for_bit(tmp_path):
    rng = np.random.default_rng(2)
    bits = rng.integers(0, 2**64, 10_000, dtype=np.uint64)  # NaN payloads, subnormals, infinities
    wild = np.concatenate([bits.view(float), [-0.0, 0.0, np.nan, np.inf, 5e-324]])
    curve = pd.DataFrame({"t": np.arange(wild.size) * 1e-7, "F_T": wild})
    loaded = through_file(make_record(curve=curve), tmp_path)
    assert loaded.curve["F_T"].to_numpy().tobytes() == wild.tobytes()


@pytest.mark.parametrize("rows", [0, 4])
def test_column_types_survive(rows, tmp_path):
    curve = pd.DataFrame(
        {
            "t": np.arange(rows, dtype=float),
            "F_T": np.arange(rows, dtype=np.float32),
            "count": np.arange(rows, dtype=np.int64) + 2**62,
            "small": np.arange(rows, dtype=np.int8),
            "flag": np.arange(rows) % 2 == 0,
            "words": pd.Series(["", "µs – x", "nan", "\t"][:rows], dtype="str"),
        }
    )
    loaded = through_file(make_record(curve=curve), tmp_path)
    pd.testing.assert_frame_equal(loaded.curve, curve, check_exact=True)


def test_identical_sees_one_bit():
    a = make_record()
    p = a.p_initial.copy()
    p[3] = np.nextafter(p[3], 1)
    assert a == make_record()
    assert a != dataclasses.replace(a, p_initial=p)
    assert a != dataclasses.replace(a, status="interrupted")
    assert a != dataclasses.replace(a, curve=a.curve.assign(t=a.curve["t"] + 1e-16))
    assert a != dataclasses.replace(a, timings=a.timings | {"run": 1.0})


@pytest.mark.parametrize("status", ["complete", "interrupted", "failed: p is not finite"])
def test_status_survives(status, tmp_path):
    assert through_file(make_record(status=status, final_state=None), tmp_path).status == status


def awkward_state():
    """Return a state with numbers that files round, whose law remembers more than one sort."""
    rng = np.random.default_rng(4)
    memory = np.zeros(5, [("anchor", float, (3,)), ("t_0", float)])
    memory["anchor"], memory["t_0"] = rng.standard_normal((5, 3)), -0.0
    zeros, whole = np.zeros(5), np.array([0, 1, -1, 2, 0], dtype=np.int32)
    return State(
        y=rng.standard_normal((3, 4, 5)), rod=np.full(6, -0.0), mode=whole, corner=whole % 2,
        margin=zeros, memory=memory, loss=zeros, dissipated=np.zeros(3), heat=zeros,
        work=np.zeros(2), step=7, t0=0.1 + 0.2, dt=1 / 3, u_drv0=-1e-310,
    )  # fmt: skip


def test_state_object_survives(tmp_path):
    state = awkward_state()
    original = make_record(final_state=state)
    loaded = through_file(original, tmp_path)
    assert bits(loaded.final_state) == bits(state)
    assert loaded == original
    state.rod[2] = 0.0
    assert loaded == original
    state.anchor[3, 1] += 1e-9
    assert loaded != dataclasses.replace(original, final_state=state)
    assert bits(State.load(state.save(tmp_path / "state"))) == bits(state)


def test_record_checks_its_parts():
    good = make_record()
    for change, message in (
        ({"status": "fine"}, "status"),
        ({"p_initial": np.zeros(3)}, "p_initial has shape"),
        ({"rupture_times": good.rupture_times[:-1]}, "rupture_times has shape"),
        ({"curve": good.curve.drop(columns="F_T")}, "no column F_T"),
        ({"switches": {}}, "switches has no column step"),
        ({"quiet": {"step": good.quiet["step"]}}, "quiet has no column t"),
    ):
        with pytest.raises(RecordError, match=message):
            dataclasses.replace(good, **change)


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
        with warnings.catch_warnings(action="ignore"):  # pandas says that a copy changes
            change()
    curve = record.curve
    curve["F_T"] = 0.0
    curve.iloc[:] = 0.0
    record.final_state["y"][:] = 0.0
    record.final_state["n"] = 0
    for name in ("timings", "versions", "counts", "quiet", "switches"):
        with pytest.raises(TypeError):
            getattr(record, name)["run"] = 0.0
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


def test_column_that_the_file_cannot_hold_is_refused(tmp_path):
    good = make_record()
    mixed = good.curve.assign(odd=[object()] * len(good.curve))
    with pytest.raises(RecordError, match="odd"):
        dataclasses.replace(good, curve=mixed).save(tmp_path / "run.nc")
    clash = good.curve.assign(p_initial=0.0)
    with pytest.raises(RecordError, match="another name"):
        dataclasses.replace(good, curve=clash).save(tmp_path / "run.nc")
    assert list(tmp_path.iterdir()) == []


# --- the file ------------------------------------------------------------------------------------


def test_file_describes_itself(tmp_path):
    path = make_record().save(tmp_path / "run.nc")
    with xr.open_dataset(path) as dataset:
        for name, variable in dataset.variables.items():
            assert variable.attrs["units"], name
            assert variable.attrs["long_name"], name
        assert dataset["F_T"].dims == ("t",)
        assert dataset["F_T"].attrs["units"] == "N"
        assert dataset["kinetic"].attrs["units"] == "J"
        assert dataset["tau_before"].dims == ("event", "x")
        assert dataset["event_is_main"].dtype == bool
        assert {"x", "t", "n"} <= set(dataset.coords)
        assert "[slider]" in dataset.attrs["scene"]


def test_every_column_of_the_catalogue_is_described():
    found, quiet, switches = make_catalogue(setup1())
    for name in (*found.events, *found.episodes, *quiet, *switches):
        assert name in LABELS


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


def test_saved_file_has_the_usual_permissions(tmp_path):
    path = make_record(n_events=1).save(tmp_path / "run.nc")
    (tmp_path / "plain").touch()
    assert path.stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_any_netcdf_reader_opens_the_file(tmp_path):
    record = make_record()
    path = record.save(tmp_path / "run.nc")
    assert b"pyfric sha256" in path.read_bytes()[-100:]
    F_T = record.curve["F_T"].to_numpy()
    with h5py.File(path) as file:
        assert (file["F_T"][:] == F_T).all()
    with h5netcdf.File(path) as file:
        assert (file["F_T"][:] == F_T).all()
    with xr.open_dataset(path) as file:
        assert (file["F_T"] == F_T).all()


def test_damage_is_noticed(tmp_path):
    record = make_record()
    path = record.save(tmp_path / "run.nc")
    assert not unnoticed(path, Record.load, RecordError, seed=1, flips=200, pages=40, cuts=40)
    assert Record.load(path) == record


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


def test_file_without_a_part_is_refused(tmp_path):
    path = make_record().save(tmp_path / "run.nc")
    with edited(path) as file:
        del file.attrs["method"]
    with pytest.raises(RecordError, match=r"damaged.*method"):
        Record.load(path)


@pytest.mark.parametrize("schema", [SCHEMA - 1, SCHEMA + 1])
def test_another_schema_is_refused(schema, tmp_path):
    path = make_record().save(tmp_path / "run.nc")
    with edited(path) as file:
        file.attrs["pyfric_schema"] = schema
    with pytest.raises(RecordError, match=rf"schema {schema}.*reads {SCHEMA}; another version"):
        Record.load(path)


# --- CSV -----------------------------------------------------------------------------------------


def test_csv_holds_every_digit(tmp_path):
    original = make_record()
    paths = original.to_csv(tmp_path / "csv")
    names = ["curve", "events", "episodes", "stresses", "columns"]
    assert [path.stem for path in paths] == names
    read = {path.stem: pd.read_csv(path, engine="python") for path in paths}
    pd.testing.assert_frame_equal(read["curve"], original.curve, check_exact=True)
    pd.testing.assert_frame_equal(
        read["events"].drop(columns="event"), original.events, check_exact=True
    )
    pd.testing.assert_frame_equal(
        read["episodes"], original.episodes, check_exact=True, check_dtype=False
    )
    stresses = read["stresses"]
    tau = stresses.loc[stresses["event"] == 1, "tau_before"].to_numpy()
    np.testing.assert_array_equal(tau, original.tau_before[1])
    p = stresses.loc[stresses["event"] == -1, "p_before"].to_numpy()
    np.testing.assert_array_equal(p, original.p_initial)
    described = set(zip(read["columns"]["table"], read["columns"]["column"], strict=True))
    assert described == {(name, column) for name in names[:-1] for column in read[name]}


def test_csv_of_no_events(tmp_path):
    paths = make_record(n_events=0).to_csv(tmp_path)
    assert all(path.read_text().count("\n") >= 1 for path in paths)
