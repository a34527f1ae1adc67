"""Files of laboratories: each kind is read; what is not understood is refused with what to add."""

import re
import struct

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from pyfric.measured import Curve, read
from pyfric.scene import SceneError

T = (0.0, 0.5, 1.0, 1.5)
F = (0.0, 120.0, 260.0, 190.0)


def text(folder, content, name="curve.csv", encoding="utf-8"):
    path = folder / name
    path.write_bytes(content.encode(encoding))
    return path


def refuse(what, *texts):
    with pytest.raises(SceneError) as caught:
        what()
    for part in texts:
        assert re.search(part, str(caught.value)), (part, str(caught.value))
    return caught.value


def same(curve, **columns):
    for name, values in columns.items():
        np.testing.assert_allclose(curve.table[name], values, rtol=1e-14, atol=0, err_msg=name)


# --- text ----------------------------------------------------------------------------------------

ROWS = [(0.0, 0.0), (500.0, 0.12), (1000.0, 0.26), (1500.0, 0.19)]


def rows(apart=",", decimal="."):
    return "".join(apart.join(str(v).replace(".", decimal) for v in row) + "\n" for row in ROWS)


@pytest.mark.parametrize(
    "content",
    [
        "time (ms),shear force (kN)\n" + rows(),
        "time [ms];shear force [kN]\n" + rows(";", ","),
        "time\tF_T\n(ms)\t(kN)\n" + rows("\t", ","),
        "Time   ShearForce\nms  kN\n" + rows("  "),
        "time_ms,F_T_kN\n" + rows(),
        "# Shear rig\n# time_ms, F_T_kN\n" + rows(),
        "Operator: A, rig 2\nStart: 2 May\n\ntime (ms),F_T/kN\n" + rows(),
        "time,F_T\n" + "".join(f"{a} ms,{b} kN1\n" for a, b in ROWS),
        "\ufefftime (ms),F_T (kN)\n" + rows(),
        "time (ms),note,F_T (kN)\n" + "".join(f"{a},ok,{b}\n" for a, b in ROWS),
        "time (ms),F_T (kN)\n" + rows().replace("\n", ",\n"),
        "time F_T\n(ms) (kN)\n" + rows(" "),
        "Time (ms)   Shear force (kN)\n" + rows("   "),
        "Time, ms;Shear force, kN\n" + rows(";"),
        "% rig 2\n% time_ms  F_T_kN\n" + rows("  "),
        "# time F_T\n# ms kN\n" + rows(" "),
        '"time (ms)","F_T (kN)"\n' + "".join(f'"{a}","{b}"\n' for a, b in ROWS).replace(".", ","),
        "time (ms)\tF_T (kN)\n" + rows("\t").replace("0.0\t0.0", " 0.0D+0\t.0D+00"),
        "time (ms) F_T (kN)\n" + "".join(f"{a / 100}d+02 {b * 10}D-1\n" for a, b in ROWS),
        "LabVIEW Measurement\t\n***End_of_Header***\t\nChannels\t1\nSamples\t4\nX0\t0.0\n"
        "***End_of_Header***\t\ntime (ms)\tF_T (kN)\tComment\n" + rows("\t"),
    ],
)
def test_text_is_read_in_si_units(tmp_path, content):
    curve = read(text(tmp_path, content))
    assert list(curve.table) == ["t", "F_T"]
    same(curve, t=T, F_T=F)


def test_columns_of_laboratories_have_their_names(tmp_path):
    heads = "time_s,mu,effns_mpa,vdcdt_um,hdcdt_um\n"
    content = heads + "0,0.1,5,0,1\n1,0.4,5,10,2\n2,0.5,5.1,20,4\n"
    curve = read(text(tmp_path, content))
    same(curve, t=(0, 1, 2), mu=(0.1, 0.4, 0.5), sigma_n=(5e6, 5e6, 5.1e6))
    same(curve, load_point=(0, 1e-5, 2e-5), normal_displacement=(1e-6, 2e-6, 4e-6))
    assert "sigma_n: 'effns_mpa' in MPa" in str(curve)
    content = "row LP_Disp Shr_stress Nor_stress Time\n. micron MPa MPa sec\n"
    content += "1 0 0.5 5 0\n2 10 0.7 5 1\n3 20 0.6 5 2\n"
    curve = read(text(tmp_path, content))
    same(curve, t=(0, 1, 2), load_point=(0, 1e-5, 2e-5), tau=(5e5, 7e5, 6e5))
    np.testing.assert_allclose(curve.over_F_N, (0.1, 0.14, 0.12), rtol=1e-14)


def test_columns_can_be_chosen(tmp_path):
    path = text(tmp_path, "a,b,c\n" + "".join(f"{k},{10 * k},{k * k}\n" for k in range(4)))
    units = {"t": "ms", "F_T": "N"}
    same(read(path, {"t": "a", "F_T": 3}, units=units), t=(0, 1e-3, 2e-3, 3e-3), F_T=(0, 1, 4, 9))
    same(read(path, {"F_T": "b"}, units=units, step="2 ms"), t=(0, 2e-3, 4e-3, 6e-3))
    refuse(lambda: read(path), "no column is known to be the time", "'a', 'b', 'c'", "columns=")
    refuse(lambda: read(path, {"t": "d", "F_T": 3}), "columns.t = 'd'", "one of 'a', 'b', 'c'")
    refuse(lambda: read(path, {"t": 4, "F_T": 3}), "columns.t = 4", "from 1 to 3")
    refuse(lambda: read(path, {"t": 1, "force": 3}), "columns.force", "F_T, F_N, tau")
    refuse(lambda: read(path, {"t": 1, "F_T": 2}, units=units, step=1.0), "the file has times")


@pytest.mark.parametrize(
    ("content", "how", "texts"),
    [
        ("time,F_T (N)\n" + rows(), {}, ["units.t", "'time' has no unit", 'units={"t": "s"}']),
        ("time (s),F_T\n" + rows(), {}, ["units.F_T", "has no unit"]),
        ("time (s),F_T (V)\n" + rows(), {}, ["'V', which is none of N", "calibration="]),
        ("time (s),F_T (N)\n" + rows(), {"units": {"F_T": "kN"}}, ["in the file, N", "differs"]),
        ("time (s),Force (N)\n" + rows(), {}, [r"'Force \(N\)' may be F_T or F_N", "columns="]),
        ("time (s),tau (kPa),Shear stress (kPa)\n0,1,1\n1,2,2\n2,3,3\n", {}, ["both tau"]),
        ("0.1,0.2\n0.3,0.4\n", {}, ["no column is known to be the time", "'1', '2'"]),
        ("time (s),F_T (N)\n0,1\n1\n2,3\n3,4\n", {}, ["row 3: 1 columns, other rows: 2", "head=3"]),
        ("time (s);mu\n0;1,234\n1;1,345\n", {}, ["may be decimal, or part thou", 'decimal=","']),
        ("time (s),mu\n0,1\n2,x\n3,4\n1,4\n", {}, ["row 3, column 2: 'x' is no number", 'gaps="x"', "head=3"]),
        ("time (s),mu\n0,1\n1,2\n", {}, ["t = 2: samples; allowed: three or more"]),
        ("time,mu\n10:00:01,1\n10:00:02,2\n", {}, ["'10:00:01' is no number", "step="]),
        ("t F_T\n0 0.1 N1\n1 0.2 N1\n", {}, ["words or other signs between", "by commas"]),
        ("time (s)|mu\n0|1\n1|2\n2|3\n", {}, ["last row, 4, has words or other", "by commas"]),
        ("time (s);mu\n0;1.234,5\n1;1.235,5\n", {}, ["'1.234,5' is no number", "thousands"]),
        ("time (s),mu\n0,1\n1,2\n", {"decimal": ";"}, ["decimal = ';'"]),
        ("time (s),mu\n0,1\n1,2\n", {"columns": ["t", "mu"]}, ["columns = ", "a dict"]),
        ("time (s),mu\n0,1\n1,2\n", {"units": {"t": 1}}, ["units.t = '1'", "in quotes"]),
        ("t,F_T\n0,1\n1,2\n", {"units": {"t": "s"}, "calibration": {"F_T": "0 N"}}, ["zero"]),
        ("time (s),F_T (N)\n0 s,1 kN\n1 s,2 kN\n", {}, ["'N' at the top, 'kN' behind"]),
        ("time (s),F_T (N)\n0,1\n1,0x104\n2,3\n", {}, ["column 2 has '', 'x104' behind"]),
        ("time (s),tau (mPa)\n0,1\n1,2\n2,3\n", {}, ["may be a spelling of MPa", "calibration="]),
        ("time (s),F_T (N),F_N\n0,1,4\n1,2,4\n2,3,4\n", {}, ["'F_N' has no unit"]),
        ("time (s),F_T (N),F_N (N)\n0,1,-4\n1,2,-4\n2,3,-4\n", {}, ["F_N = -4", '"-1 N"']),
        ("time (s),mu\n1,1\n1,2\n1,3\n", {}, ["all are the same"]),
        ("t\0i\0m\0e\0", {}, ["not a kind of file"]),
        ("words\nand no number\n", {}, ["has no number"]),
        ("", {}, ["no row of numbers"]),
        ("time (s),mu\n0,1\n1,2\n0,3\n1,4\n", {}, ["anew 1 times, first at sample 3", "join"]),
        ("time (s),mu\n0,1\n1,2\n2,3\n", {"restarts": 2}, ["times do not start anew"]),
        (
            "time (s),mu (N)\n0,1\n1,2\n2,3\n",
            {},
            ["'mu .N.' has the unit 'N', which is none of a ratio"],
        ),
    ],
)
def test_what_is_not_understood_is_refused_with_what_to_add(tmp_path, content, how, texts):
    refuse(lambda: read(text(tmp_path, content), **how), *texts)


def test_gaps_and_restarts(tmp_path):
    content = "time (s),mu\n0,0.1\n1,NaN\n2,0.3\n,0.4\n0,0.5\n1,\n2,0.7\n"
    path = text(tmp_path, content)
    curve = read(path, restarts="join")
    same(curve, t=(0, 1, 2, 3, 4, 5), mu=(0.1, np.nan, 0.3, 0.5, np.nan, 0.7))
    assert "1 samples without a time" in str(curve)
    assert "2 gaps" in str(curve)
    same(read(path, restarts=2), t=(0, 1, 2), mu=(0.5, np.nan, 0.7))
    refuse(lambda: read(path, restarts=3), "restarts = 3", "from 1 to 2")
    refuse(lambda: read(path, restarts="all"), "restarts = 'all'", "1 to 2")


def test_overflows_and_lost_loads_are_gaps(tmp_path):
    content = "time (s),F_T (N),F_N (N)\n0,1,10\n1,inf,10\n2,#N/A,10\n3,4,0\n4,5,10\n"
    curve = read(text(tmp_path, content))
    same(curve, F_T=(1, np.nan, np.nan, 4, 5))
    np.testing.assert_array_equal(curve.over_F_N, (0.1, np.nan, np.nan, np.nan, 0.5))


def test_gaps_at_the_ends_of_rows_are_kept_between_tabs(tmp_path):
    content = "\ttime (s)\tmu\tslip (um)\n0\t0\t0.1\t1\n1\t1\t0.2\t\n2\t2\t0.3\t3\n3\t3\t0.2\t\n"
    curve = read(text(tmp_path, content))
    same(curve, t=(0, 1, 2, 3), mu=(0.1, 0.2, 0.3, 0.2), slip=(1e-6, np.nan, 3e-6, np.nan))
    wide = content.replace("\n", "\t\t\n")  # as spreadsheets fill rows up
    for each in (wide, wide.replace(".", ",")):
        same(read(text(tmp_path, each)), slip=(1e-6, np.nan, 3e-6, np.nan))


def test_columns_without_use_are_named(tmp_path):
    content = "time/s,F_T/F_N,slip/10^-6 m\n0,0.1,1\n1,0.2,2\n2,0.3,3\n"
    curve = read(text(tmp_path, content))
    same(curve, mu=(0.1, 0.2, 0.3))
    assert "not used: 'slip/10^-6 m'" in str(curve)
    asked = {"t": 1, "mu": 2, "slip": 3}
    refuse(lambda: read(text(tmp_path, content), asked), "'10.-6' is a factor", "such as um")
    curve = read(text(tmp_path, content), asked, units={"slip": "um"})
    same(curve, slip=(1e-6, 2e-6, 3e-6))
    assert "not used" not in str(curve)


def test_heads_can_be_left_out_and_commas_said(tmp_path):
    path = text(tmp_path, "1,2,3\ntime (s);mu\n0;1,234\n1;1,345\n2;1,5\n")
    same(read(path, head=1, decimal=","), t=(0, 1, 2), mu=(1.234, 1.345, 1.5))
    windows = text(
        tmp_path, "time (s),load point (µm),mu\n0,1,0.1\n1,2,0.2\n2,3,0.3\n", "w", "cp1252"
    )
    curve = read(windows)
    same(curve, load_point=(1e-6, 2e-6, 3e-6))
    assert "cp1252" in str(curve)
    wide = text(tmp_path, "time (s),mu\n0,0.1\n1,0.2\n2,0.3\n", "u", "utf-16")
    same(read(wide), mu=(0.1, 0.2, 0.3))


def test_other_files_are_refused(tmp_path):
    (tmp_path / "a.xlsx").write_bytes(b"PK\3\4")
    refuse(lambda: read(tmp_path / "a.xlsx"), "export the table")
    (tmp_path / "a.bin").write_bytes(bytes(range(256)) * 20)
    refuse(lambda: read(tmp_path / "a.bin"), "not a kind of file", "HDF5, MATLAB, netCDF")
    refuse(lambda: read(tmp_path / "none"), "No such file")
    refuse(lambda: read(tmp_path), "directory")


# --- containers ----------------------------------------------------------------------------------

SAID = {"units": {"t": "s", "F_T": "N"}}


def test_matlab(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"exp": {"time": np.array(T), "ft": np.array(F), "name": "x"}, "n": 3})
    same(read(path, **SAID), t=T, F_T=F)
    assert "MATLAB" in str(read(path, group="exp", **SAID))
    savemat(path, {"data": np.column_stack([T, F])})
    same(read(path, {"t": "data:1", "F_T": 2}, **SAID), t=T, F_T=F)
    refuse(lambda: read(path, **SAID), "'data:1', 'data:2'")
    refuse(lambda: read(path, group="exp"), "group = 'exp'", "'data:1'")
    path.write_bytes(path.read_bytes()[:140])
    refuse(lambda: read(path), "a MATLAB file that can be read")


def test_arrays_of_structs_and_tables_of_records(tmp_path):
    """None is taken for another: all have names."""
    path = tmp_path / "a.mat"
    kind = [("time", object), ("F_T", object)]
    parts = [(np.array(T), np.array(F)), (np.array(T), 2 * np.array(F))]
    savemat(path, {"run": np.array(parts, dtype=kind)})
    refuse(lambda: read(path, **SAID), "run.1..time' and 'run.2..time' are both t")
    same(read(path, group="run(2)", **SAID), t=T, F_T=2 * np.array(F))
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["a"] = np.array(list(zip(T, F, strict=True)), dtype=[("time", float), ("F_T", float)])
    same(read(path, **SAID), t=T, F_T=F)
    with h5py.File(path, "w") as file:
        file["time"], file["F_T"] = T, F
        file["F_T"].attrs["units"] = ["kN"]
        file["time"].attrs["units"] = h5py.Empty("S1")
    same(read(path, units={"t": "s"}), t=T, F_T=1e3 * np.array(F))


def test_hdf5_and_matlab_7_3(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run/time"], file["run/ft"] = T, F
        file["run/time"].attrs["units"] = "s"
        file["run/ft"].attrs["units"] = b"N"
        file["other/ft"] = (1.0, 2.0)
    refuse(lambda: read(tmp_path / "a.h5"), "'other/ft' and 'run/ft' are both F_T")
    same(read(tmp_path / "a.h5", group="run"), t=T, F_T=F)
    with h5py.File(tmp_path / "b.mat", "w", userblock_size=512) as file:
        file["exp/data"] = np.column_stack([T, F]).T  # MATLAB stores columns first
        file["exp/ft"] = np.array([F])
        file["exp/name"] = np.array([[1, 2]], dtype="u2")
        file["exp/name"].attrs["MATLAB_class"] = np.bytes_("char")
    with (tmp_path / "b.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    curve = read(tmp_path / "b.mat", {"t": "data:1", "F_T": "exp.ft"}, **SAID)
    same(curve, t=T, F_T=F)
    assert "MATLAB 7.3" in str(curve)


def test_tdms(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "a.tdms"
    told = {"wf_increment": 0.5, "wf_start_offset": 0.0, "wf_samples": 4, "unit_string": "V"}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("shear", "Shear force", np.array(F) / 40, told)])
    refuse(lambda: read(path), "the unit 'V'", "calibration=")
    same(read(path, calibration={"F_T": "40 N"}), t=T, F_T=F)
    slip = nptdms.ChannelObject("shear", "slip", 1.0 * np.arange(4), told | {"wf_increment": 0.25})
    force = nptdms.ChannelObject("shear", "Shear force", np.array(F), told | {"unit_string": "N"})
    slip.properties["unit_string"] = "um"
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([force, slip])
    refuse(lambda: read(path), "'shear/time of Shear force' and 'shear/time of slip' are both t")
    same(read(path, {"t": "shear/time of slip", "slip": "slip"}), t=np.array(T) / 2)
    path.write_bytes(b"TDSm")
    refuse(lambda: read(path), "columns: none")


def look(path, names, columns, *, channels=16, kind=">f4"):
    head = struct.pack(">20s4i", b"p1234", len(columns[0]), len(columns), 0, 0)
    for k in range(channels):
        name, unit = names[k] if k < len(names) else ("no_val", "no_val")
        n = len(columns[k]) if k < len(names) else 0
        head += struct.pack(">13s13si50si", name.encode(), unit.encode(), 0, b"", n)
    assert len(head) == 36 + 84 * channels
    path.write_bytes(head + b"".join(np.array(column).astype(kind).tobytes() for column in columns))


@pytest.mark.parametrize("channels", [16, 32])
@pytest.mark.parametrize("kind", [">f4", "<f4", ">f8", "<f8"])
def test_look(tmp_path, channels, kind):
    bits = np.array([2048.0, 2060.0, 2074.0, 2067.0])
    names = [("Time", "sec"), ("Shear_force", "bit"), ("LP_Disp", "micron")]
    look(tmp_path / "p", names, [T, bits, np.array(T) * 10], channels=channels, kind=kind)
    refuse(lambda: read(tmp_path / "p"), "'Shear_force' has the unit 'bit'", "calibration=")
    curve = read(tmp_path / "p", calibration={"F_T": ("10 N", 2048)})
    same(curve, t=T, F_T=10 * (bits - 2048), load_point=np.array(T) * 1e-5)


def test_a_look_file_without_a_clear_order_is_refused(tmp_path):
    zeros = [(0.0, 0.0, 0.0)] * 2
    look(tmp_path / "p", [("Time", "sec"), ("mu", ".")], zeros)
    refuse(lambda: read(tmp_path / "p"), "order is not clear")


# --- curves --------------------------------------------------------------------------------------


def test_a_ratio_is_no_force():
    mu = Curve.of(t=T, mu=(0.1, 0.2, 0.3, 0.2))
    refuse(mu.force, "F_N: missing")
    np.testing.assert_allclose(mu.force(400.0), (40, 80, 120, 80), rtol=1e-14)
    force = Curve.of(t=T, F_T=F)
    refuse(lambda: force.over_F_N, "F_N: missing", 'F_N="400 N"')
    np.testing.assert_allclose(Curve.of(t=T, F_T=F, F_N="1 kN").over_F_N, np.array(F) / 1e3)
    np.testing.assert_allclose(Curve.of(t=T, F_T=F, F_N=np.array(F) + 1).over_F_N[1], 120 / 121)
    tau = {"t": T, "tau": (1e6, 2e6, 3e6, 2e6)}
    refuse(lambda: Curve.of(**tau, F_N=1.0).over_F_N, "area: missing, and tau is no force")
    curve = Curve.of(**tau, area="100 mm^2", F_N=1000.0)
    np.testing.assert_allclose(curve.over_F_N, (0.1, 0.2, 0.3, 0.2), rtol=1e-14)


@pytest.mark.parametrize(
    ("columns", "text"),
    [
        ({"F_T": F}, "t: missing"),
        ({"t": T}, "no force"),
        ({"t": T, "F_T": F[:-1]}, r"F_T = '\(3,\)'"),
        ({"t": T, "F_T": "abcd"}, "numbers"),
        ({"t": T, "force": F}, "unknown column"),
        ({"t": (0.0, 2.0, 1.0), "mu": (0, 0, 0)}, r"t\[2\] = 1.0 s"),
        ({"t": T, "mu": F, "area": -1.0}, "area = -1.0"),
    ],
)
def test_curves_that_are_none(columns, text):
    refuse(lambda: Curve.of(**columns), text)
