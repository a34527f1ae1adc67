"""Files of laboratories: each kind is read; unclear files are refused with advice."""

import gc
import io
import re
import struct
import sys

import h5py
import numpy as np
import pytest
from scipy.io import netcdf_file, savemat

from pyfric.measured import Curve, read
from pyfric.measured import body as parsing
from pyfric.values import SceneError

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
        (
            "time (s),mu\n0,1\n2,x\n3,4\n1,4\n",
            {},
            ["column 2: 'x' is no number", 'gaps="x"', "head=3"],
        ),
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


@pytest.mark.parametrize("what", [42, ["a.csv"], io.StringIO("t,mu")])
def test_what_is_no_path_is_refused(what):
    refuse(lambda: read(what), "no path", "curve.csv")


def test_a_head_is_no_longer_than_the_file(tmp_path):
    path = text(tmp_path, "time (s),mu\n0,0.1\n1,0.2\n2,0.3\n")
    refuse(lambda: read(path, head=10**9), "head = 1000000000", "fewer lines than the file has, 5")


# --- what commas and points stand for ------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "how", "texts"),
    [
        ("time (s);F_T (N)\n0;998\n1;1.002\n2;1.013\n", {}, ["point in '1.002'", "thousands"]),
        ("time (s)\tF_T (N)\n0\t998\n1\t1,002\n2\t1,013\n", {}, ["comma in '1,002'"]),
        ("0,0,0,5\n0,1,0,6\n0,2,0,7\n", {}, ["may have decimal commas", 'decimal="."']),
        ("time;F_T\n0,0,0,5\n0,1,0,6\n0,2,0,7\n", {}, ["may have decimal commas"]),
        ("0,0\n0,1\n0,2\n", {}, ["may have decimal commas"]),
        ("0,0.1\n1,0.2\n2,0.3\n", {"decimal": ","}, ["commas separate columns"]),
        ("t;F_T\n0,5;1,5\n0,6;1.5\n0,7;1,7\n", {}, ["'1.5' has a decimal point"]),
        (
            "t;F_T\n0.5;1.5\n0.6;1,5\n0.7;1.7\n",
            {},
            ["others have a decimal comma", "one decimal mark"],
        ),
    ],
)
def test_marks_that_are_not_clear_are_refused(tmp_path, content, how, texts):
    asked = {"columns": {"t": 1, "F_T": 2}, "units": {"t": "s", "F_T": "N"}} | how
    refuse(lambda: read(text(tmp_path, content), **asked), *texts)


def test_marks_that_are_clear_are_read(tmp_path):
    asked = {"columns": {"t": 1, "F_T": 2}, "units": {"t": "s", "F_T": "N"}}
    path = text(tmp_path, "0;998\n1;1.002\n2;1.013\n")
    same(read(path, decimal=".", **asked), F_T=(998, 1.002, 1.013))
    path = text(tmp_path, "0,2048\n1,2050\n2,2051\n")
    same(read(path, decimal=".", **asked), t=(0, 1, 2), F_T=(2048, 2050, 2051))
    path = text(tmp_path, "t;F_T\n1;998.5\n2;999\n3;1.002\n")
    same(read(path, **asked), F_T=(998.5, 999, 1.002))
    path = text(tmp_path, "t;F_T\n29;1.002\n30;1.003\n31;1.004\n")
    same(read(path, **asked), F_T=(1.002, 1.003, 1.004))


def test_a_column_is_not_two(tmp_path):
    path = text(tmp_path, "time (s),F_T (N)\n0,0.1\n1,0.2\n2,0.3\n")
    refuse(lambda: read(path, {"t": 1, "F_T": 1}), "columns.", "'time .s.'", "too")


# --- several tables, words between numbers -------------------------------------------------------


def test_tables_of_the_same_columns_are_parts_of_one(tmp_path):
    block = "Data Acquisition\t\tTime:\t1.2\tSec\nTime\tAxial Force\n(Sec)\t(kN)\n"
    numbers = "0\t0.1\n1\t0.2\n2\t0.3\n"
    asked = {"columns": {"t": "Time", "F_T": "Axial Force"}}
    content = "MTS793\n" + 3 * (block + numbers)
    path = text(tmp_path, content)
    refuse(lambda: read(path, **asked), "times start anew 2 times", "1 to 3")
    curve = read(path, restarts="join", **asked)
    same(curve, t=range(9), F_T=3 * (100, 200, 300))
    assert "3 tables of the same columns, from rows 5, 11, 17" in str(curve)
    other = text(tmp_path, content.replace("(kN)", "(N)").replace("(N)", "(kN)", 1))
    refuse(lambda: read(other, **asked), "a second table begins in row 9", "other heads", "head=7")
    words = text(tmp_path, "time (s),mu\n0,0.1\n1,0.2\nvalve opened\n2,0.3\n")
    refuse(lambda: read(words), "begins in row 4", "reads 'valve opened'")
    commented = "# time (s),mu\n0,0.1\n1,0.2\n# time (ms),mu\n2,0.3\n3,0.4\n"
    refuse(lambda: read(text(tmp_path, commented)), "second table begins in row 4")


def test_words_of_gaps_are_asked_for(tmp_path):
    lines = [f"{k},{k / 8}" for k in range(60)]
    lines[50] = "50,OVLD"
    path = text(tmp_path, "time (s),mu\n" + "\n".join(lines))
    error = refuse(lambda: read(path), "row 52, column 2: 'OVLD' is no number", 'gaps="OVLD"')
    assert "head=" not in str(error)  # head= would keep only 9 of 60 rows
    curve = read(path, gaps="OVLD")
    assert len(curve.t) == 60
    assert curve.table["mu"].isna().sum() == 1


def test_empty_rows_and_zeros_at_the_end_are_no_rows(tmp_path):
    content = "time (s);mu\n0;0.1\n1;0.2\n;;\n;;;\n2;0.3\n3;0.2\n" + "\0" * 100
    curve = read(text(tmp_path, content))
    same(curve, t=range(4), mu=(0.1, 0.2, 0.3, 0.2))
    assert "zeros at the end are left out" in str(curve)


@pytest.mark.parametrize("apart", [";", "\t"])
def test_a_word_in_the_last_row_before_further_heads_is_no_head(tmp_path, apart):
    """A word in the last row of all is no head, either."""
    heads = apart.join(("time (s)", "mu", "slip (m)", "load point (m)")) + "\n"
    rows = "".join(apart.join((f"{k},5", "0,1", "0,2", "0,3")) + "\n" for k in range(4))
    for lost in (1, 3):
        cells = [*["OVLD"] * lost, "0,2", "0,2"][:3]
        word = apart.join(("4,5", *cells)) + "\n"
        for more, part in ((heads + rows, 1), ("", None)):
            path = text(tmp_path, heads + rows + word + more)
            refuse(lambda path=path: read(path), "row 6, column 2: 'OVLD' is no number")
            assert read(path, gaps="OVLD", restarts=part).t[-1] == 4.5


@pytest.mark.parametrize(
    ("feet", "told"),
    [
        ("\nTotalTime\n00:12:56.56\n", "'TotalTime'"),
        ("Max,0.4\nMin,0.1\n", "'Max,0.4'"),
        ("4", "'4'"),
    ],
)
def test_what_is_below_a_table_is_left_out_and_said(tmp_path, feet, told):
    content = "Recipe, Upper, 100, Rotary\nStep, Timestamp, COF\n"
    content += "".join(f"4,{k},0.{k + 1}\n" for k in range(4))
    curve = read(text(tmp_path, content + feet.replace(",", ",0,")), units={"t": "s"})
    same(curve, t=(0, 1, 2, 3), mu=(0.1, 0.2, 0.3, 0.4))
    assert f"rows below the table are left out, from row {8 if feet[0] == chr(10) else 7}" in (
        str(curve)
    )
    commas = content.replace("COF", "COF,").replace("\n4", ",\n4") + feet
    same(read(text(tmp_path, commas.replace("0.4\n", "0.4,\n")), units={"t": "s"}), t=range(4))
    assert told.strip("'")[:3] in str(curve)


def test_heads_of_several_rows_have_names_units_and_more(tmp_path):
    lines = [
        '"TOA5","rig","CR1000"\n"TIMESTAMP","RECORD","Friction_force"\n"TS","RN","N"\n"","","Smp"\n',
        "x-axis,1,Friction_force\nsecond,Volt,N\n",
        "real_time,record,Friction_force\n---------,------,---\ns,RN,N\n",
    ]
    for heads in lines:
        path = text(tmp_path, heads + "".join(f'"May {k}",{k},{k / 8}\n' for k in range(4)))
        same(read(path, {"F_T": "Friction_force"}, step="1 s"), F_T=np.arange(4) / 8)


@pytest.mark.parametrize("k", [0, 2, 3])
def test_an_empty_cell_more_at_the_end_of_a_row_is_nothing(tmp_path, k):
    rows = [f"{n}\t0.{n + 1}" for n in range(4)]
    rows[k] += "\t"
    path = text(tmp_path, "time\tmu\ns\t-\n" + "\n".join(rows))
    same(read(path), t=range(4), mu=(0.1, 0.2, 0.3, 0.4))


def test_a_second_table_below_is_refused(tmp_path):
    content = "time (s),mu\n0,0.1\n1,0.2\n2,0.3\n3,0.3\n4,0.2\na,b,c\n1,2,3\n4,5,6\n"
    refuse(lambda: read(text(tmp_path, content)), "columns, other rows")


def test_a_row_of_units_may_be_a_comment(tmp_path):
    content = "Time Shr_stress Nor_stress\n# sec MPa MPa\n0 0.5 5\n1 0.7 5\n2 0.6 5\n"
    same(read(text(tmp_path, content)), t=(0, 1, 2), tau=(5e5, 7e5, 6e5), sigma_n=(5e6,) * 3)


def test_all_missing_units_are_named_at_once(tmp_path):
    path = text(tmp_path, "time,F_T,slip\n0,1,2\n1,2,3\n2,3,4\n")
    refuse(lambda: read(path), 'units={"t": "s"}', 'units={"F_T": "N"}', 'units={"slip": "m"}')


# --- by pandas, or line by line ------------------------------------------------------------------


def long_text(rows=300, odd=(), apart=","):
    """Return a text with the given rows of `odd`."""
    odd, pair = dict(odd), "{:.3f}" + apart + "{:.17g}"
    made = np.random.default_rng(0).standard_normal(rows) * 10.0 ** np.linspace(-20, 20, rows)
    lines = [odd.get(k, pair.format(0.001 * k, v)) for k, v in enumerate(made)]
    return f"time (s){apart}mu\n" + "\n".join(lines) + "\n", made


@pytest.mark.parametrize("apart", [",", ";", "\t", "  "])
def test_numbers_are_those_of_python_to_the_last_bit(tmp_path, monkeypatch, apart):
    content, made = long_text(apart=apart)
    curve = read(text(tmp_path, content))
    np.testing.assert_array_equal(curve.table["mu"], [float(f"{v:.17g}") for v in made])
    monkeypatch.setattr(parsing, "_parsed", lambda *how: None)
    again = read(text(tmp_path, content))
    np.testing.assert_array_equal(again.table, curve.table)


@pytest.mark.parametrize("part", [200, 1000, 1 << 22])
@pytest.mark.parametrize("k", [1, 70, 298])
def test_one_odd_row_among_many_is_read_as_alone(tmp_path, monkeypatch, part, k):
    """The numbers are the same for parts of any size, and any place of the row."""
    monkeypatch.setattr(parsing, "PART", part)
    t = f"{0.001 * k:.3f}"
    for odd, value in (
        (f"{t},1.5D+02", 150),
        (f"{t},", np.nan),
        (f" {t} , 4 ", 4),
        (f'{t},"4"', 4),
    ):
        curve = read(text(tmp_path, long_text(odd={k: odd})[0]))
        assert len(curve.t) == 300
        np.testing.assert_array_equal(curve.table["mu"][k], value)
    curve = read(text(tmp_path, long_text(odd={k: "# a remark, of two"})[0]))
    assert len(curve.t) == 299
    for odd, said in (
        (f"{t}", "1 columns, other rows: 2"),
        (f"{t},1,2", "3 columns, other rows: 2"),
        (f"{t},True", "'True' is no number"),
        (f"{t},0x10", "'x10' behind"),
        (f"{t},1_0", "'1_0' is no number"),
        (f"{t},0.5 kN", "'kN' behind"),
        ("a,b", "a second table begins"),
    ):
        path = text(tmp_path, long_text(odd={k: odd})[0])
        refuse(
            lambda path=path: read(path), said, *([f"row {k + 2}"] if "behind" not in said else [])
        )


def test_truths_are_no_numbers(tmp_path, monkeypatch):
    """pandas reads columns with only truth values in a part as numbers."""
    monkeypatch.setattr(parsing, "PART", 110)  # eleven rows
    cells = ["0.25"] * 110 + ["True"] * 110 + ["0.25"] * 110
    rows = "".join(f"{0.001 * k:.3f},{cell}\n" for k, cell in enumerate(cells))
    refuse(lambda: read(text(tmp_path, "time (s),mu\n" + rows)), "row 112, column 2: 'True'")


# --- sums, counters, ends of sensors -------------------------------------------------------------


def test_intervals_are_summed_to_times(tmp_path):
    content = "Samp_period (msec),F_T (N)\n10,1\n10,2\n1,3\n1,4\n10,5\n"
    same(read(text(tmp_path, content)), t=(0, 0.01, 0.011, 0.012, 0.022), F_T=(1, 2, 3, 4, 5))
    both = "time (s),dt (s),mu\n0,1,1\n1,1,2\n2,1,3\n"
    assert "not used: 'dt (s)'" in str(read(text(tmp_path, both)))
    asked = {"t": 1, "step": 2, "mu": 3}
    refuse(lambda: read(text(tmp_path, both), asked), "both tell times")
    gap = text(tmp_path, "dt (s),mu\n1,1\n,2\n1,3\n")
    refuse(lambda: read(gap), "step: sample 2 has none")


def test_times_that_stand_still_are_refused(tmp_path):
    """Examples are a clock coarser than the samples, and intervals read as times."""
    t = np.round(np.arange(400) * 5e-4, 2)
    refuse(lambda: Curve.of(t=t, mu=t), "95% of the samples", 'step="..."')
    rows = [f"{dt},{k}\n" for dt in (10000, 10) for k in range(20)]
    path = text(tmp_path, "Time (ms),mu\n" + "".join(rows))
    refuse(lambda: read(path), "times start anew")
    refuse(lambda: read(path, restarts="join"), "all are the same", 'columns={"step"')
    curve = read(path, {"step": 1, "mu": 2}, units={"step": "ms"})
    assert curve.t[-1] == pytest.approx(190 + 0.2)


def test_counters_that_wrap_are_said_and_undone(tmp_path):
    counts = (np.arange(0, 140000, 700) + 32768) % 65536 - 32768
    content = "time (s),slip (um)\n" + "".join(f"{k},{c}\n" for k, c in enumerate(counts))
    curve = read(text(tmp_path, content))
    assert "a counter of 16 bits" in str(curve)
    assert 'wraps={"slip": 65536}' in str(curve)
    curve = read(text(tmp_path, content), wraps={"slip": 65536})
    same(curve, slip=700e-6 * np.arange(200))
    assert "a counter of" not in str(curve)
    ends = text(tmp_path, content.replace("\n40,", "\n40,32767\n40.5,"))
    assert "stands at an end of 16 bits in 1 samples" in str(read(ends))
    refuse(lambda: read(ends, wraps={"mu": 65536}), "wraps.mu", "one of t, slip")
    refuse(lambda: read(ends, wraps={"slip": -1.0}), "wraps.slip")


def test_readings_at_the_ends_of_a_sensor_are_gaps(tmp_path):
    path = text(tmp_path, "time (s),F_T (kN)\n0,0\n1,5\n2,9999\n3,4\n4,-5\n")
    curve = read(path, valid={"F_T": ("-5 kN", 5001.0)})
    same(curve, F_T=(0, 5000, np.nan, 4000, np.nan))
    assert "2 samples that are not valid" in str(curve)
    refuse(lambda: read(path, valid={"F_T": ("5 kN", "1 kN")}), "the smaller one first")
    refuse(lambda: read(path, valid={"F_T": "5 kN"}), "valid.F_T")


def test_forces_of_the_other_sign_are_refused(tmp_path):
    f = -0.5 + 1e-3 * np.random.default_rng(0).standard_normal(50)
    refuse(lambda: Curve.of(t=np.arange(50), mu=f), "negative throughout", 'calibration={"mu": -1}')
    refuse(lambda: Curve.of(t=np.arange(50), F_T=f), 'calibration={"F_T": "-1 N"}')
    f[0] = 0.0
    refuse(lambda: Curve.of(t=np.arange(50), mu=f), "negative throughout")
    path = text(tmp_path, "time (s),mu\n0,-1\n1,-2\n2,-3\n")
    same(read(path, calibration={"mu": -1}), mu=(1, 2, 3))
    assert len(Curve.of(t=(0, 1, 2), mu=(-1, 1, -2)).t) == 3  # to and fro


# --- LabVIEW -------------------------------------------------------------------------------------


def lvm(*above, heads="X_Value\tshear force\tComment", columns="One", decimal="."):
    """Return a section of a LabVIEW text: its head lines and its rows."""
    content = f"LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t{decimal}\n"
    content += f"X_Columns\t{columns}\nDate\t2026/05/02\n***End_of_Header***\t\n\t\n"
    for lines, numbers in above:
        content += f"Channels\t1\t\n{lines}***End_of_Header***\t\t\n{heads}\n{numbers}"
    return content


ABOVE = "X_Dimension\tTime\t\nY_Unit_Label\tkN\t\nX0\t0\t\nDelta_X\t0.5\t\n"


def test_sections_of_labview_are_joined(tmp_path):
    asked = {"columns": {"t": "X_Value", "F_T": "shear force"}}
    first, later = "0\t1\n0.5\t2\n1\t3\n", "1.5\t7\n2\t8\n2.5\t9\n"
    curve = read(text(tmp_path, lvm((ABOVE, first), (ABOVE, later))), **asked)
    same(curve, t=np.arange(6) / 2, F_T=(1e3, 2e3, 3e3, 7e3, 8e3, 9e3))
    assert "2 tables" in str(curve)
    anew = text(tmp_path, lvm((ABOVE, first), (ABOVE, first.replace("3", "4"))))
    refuse(lambda: read(anew, **asked), "times start anew 1 times")
    same(read(anew, restarts=1, **asked), F_T=(1e3, 2e3, 3e3))
    same(read(anew, restarts=2, **asked), F_T=(1e3, 2e3, 4e3))
    same(read(anew, restarts="join", **asked), t=np.arange(6) / 2)
    commas = text(tmp_path, lvm((ABOVE, "0,000\t1,234\n1,000\t2,345\n2,000\t3,456\n"), decimal=","))
    same(read(commas, **asked), t=(0, 1, 2), F_T=(1234, 2345, 3456))


def test_labview_states_times_that_it_does_not_write(tmp_path):
    content = lvm((ABOVE, "\t1\n\t2\n\t3\n"), columns="No")
    same(read(text(tmp_path, content), {"t": "time", "F_T": "shear force"}), t=(0, 0.5, 1))


def test_channels_of_labview_with_clocks_of_their_own_are_not_joined(tmp_path):
    heads = "X_Value\tshear force\tX_Value\tslip\tComment"
    above = "Time\t10:00:00\t\t10:00:{0}\nY_Unit_Label\tN\t\tum\nX0\t0\t\t0\n"
    above += "Delta_X\t1\t\t1\n"
    rows = "0\t1\t0\t5\n1\t2\t1\t6\n2\t3\t2\t7\n"

    def made(late, rows=rows):
        content = lvm((above.format(late), rows), heads=heads, columns="Multi")
        return text(tmp_path, content.replace("Channels\t1", "Channels\t2"))

    asked = {"t": "X_Value", "F_T": "shear force", "slip": "slip"}
    same(read(made("00"), asked), t=(0, 1, 2), F_T=(1, 2, 3), slip=(5e-6, 6e-6, 7e-6))
    same(read(made("00.2"), asked), t=(0, 1, 2))  # of Delta_X = 1 s, by two tasks
    refuse(lambda: read(made("03"), asked), "'shear force'|'X_Value'", "not sampled together")
    later = rows.replace("\t0\t5", "\t3\t5").replace("\t1\t6", "\t4\t6").replace("\t2\t7", "\t5\t7")
    refuse(lambda: read(made("00", later), asked), "not sampled together")
    same(read(made("00", later), {"t": "X_Value:2", "slip": "slip"}), t=(3, 4, 5))


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
    """Each array has its own name."""
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


@pytest.mark.parametrize("shape", [(-1,), (1, -1), (-1, 1)])
@pytest.mark.parametrize("head", [b"MATLAB 7.3 MAT-file", b""])
def test_vectors_of_either_orientation(tmp_path, shape, head):
    """Python writers of MATLAB files store vectors in several shapes, and text as codes."""
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["time"], file["F_T"] = np.reshape(T, shape), np.reshape(F, shape)
        for name, dtype in (("name", "u2"), ("other", "u4")):
            file[name] = np.array([[ord(c) for c in "name"]], dtype=dtype).T
            file[name].attrs["MATLAB_class"] = np.bytes_("char")
            file[name].attrs["Python.Type"] = np.bytes_("str")
    with (tmp_path / "a.mat").open("r+b") as file:
        file.write(head)
    curve = read(tmp_path / "a.mat", {"t": "time", "F_T": "F_T"}, **SAID)
    same(curve, t=T, F_T=F)


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


def test_tdms_channels_have_the_times_of_their_clocks(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    begin, path = np.datetime64("2026-05-02T10:00:00"), tmp_path / "a.tdms"

    def channel(name, unit, late, **more):
        told = {"unit_string": unit, "wf_increment": 0.5, "wf_start_time": begin + late} | more
        return nptdms.ChannelObject("g", name, np.array(F), told)

    def write(*segments):
        with nptdms.TdmsWriter(path) as writer:
            for channels in segments:
                writer.write_segment(list(channels))

    force = channel("shear force", "N", np.timedelta64(0, "s"))
    write([force, channel("slip", "um", np.timedelta64(3, "s"))])
    refuse(lambda: read(path), "both t")
    asked = {"t": "time of slip", "slip": "slip"}
    same(read(path, asked), t=3 + np.array(T), slip=1e-6 * np.array(F))
    both = asked | {"F_T": "shear force"}
    refuse(lambda: read(path, both), "not sampled together", "one clock")
    write([force, channel("slip", "um", np.timedelta64(1, "ms"))])  # by two tasks
    same(read(path), t=T, F_T=F, slip=1e-6 * np.array(F))
    write([force], [channel("shear force", "N", np.timedelta64(60, "s"))])
    curve = read(path)
    same(curve, t=(*T, *(60 + np.array(T))), F_T=2 * F)
    assert "recorded in 2 parts" in str(curve)
    write([force], [force])
    same(read(path), t=np.arange(8) / 2)


@pytest.mark.parametrize("kind", ["AdvancedAPI", "Logarithmic", "PieceWisePolynomial"])
@pytest.mark.parametrize("of", ["channel", "group", "root"])
def test_tdms_scales_that_are_not_applied_are_refused(tmp_path, kind, of):
    nptdms = pytest.importorskip("nptdms")
    scale = {"NI_Number_Of_Scales": 1, "NI_Scaling_Status": "unscaled"}
    scale["NI_Scale[0]_Scale_Type"] = kind
    told = {"unit_string": "N", "wf_increment": 0.5} | (scale if of == "channel" else {})
    channel = nptdms.ChannelObject("g", "shear force", np.array(F), told)
    group = nptdms.GroupObject("g", scale if of == "group" else {})
    root = nptdms.RootObject(scale if of == "root" else {})
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([root, group, channel])
    refuse(lambda: read(tmp_path / "a.tdms"), f"a scale of type '{kind}'", "Linear, Polynomial")


# --- packed arrays -------------------------------------------------------------------------------


def packed(folder, numbers, file_attrs=(), kind="i2", **attrs):
    with h5py.File(folder / "a.h5", "w") as file:
        file["time"], file["F_T"] = np.arange(len(numbers)), np.array(numbers, dtype=kind)
        file["time"].attrs["units"], file["F_T"].attrs["units"] = "s", "N"
        for name, value in attrs.items():
            file["F_T"].attrs[name] = value
        for name in file_attrs:
            file.attrs[name] = "version=2"
    return read(folder / "a.h5")


def test_packed_arrays_are_unpacked(tmp_path):
    how = {"scale_factor": 0.5, "add_offset": 20.0, "_FillValue": np.int16(-32768)}
    curve = packed(tmp_path, [0, 2, -32768, 6], **how)
    same(curve, F_T=(20, 21, np.nan, 23))
    assert "1 samples without a valid value are gaps, scale_factor 0.5, add_offset 20" in str(curve)
    same(packed(tmp_path, [0, 7, 9, 6], missing_value=[7, 9]), F_T=(0, np.nan, np.nan, 6))
    same(packed(tmp_path, [0, 7, 9, 6], valid_range=[1, 8]), F_T=(np.nan, 7, np.nan, 6))
    same(packed(tmp_path, [0, 7, 9, 6], valid_min=1), F_T=(np.nan, 7, 9, 6))
    same(packed(tmp_path, [0, 7, 9, 6], valid_max=8), F_T=(0, 7, np.nan, 6))
    same(packed(tmp_path, [0, -1, 2, 3], kind="i1", _Unsigned="true"), F_T=(0, 255, 2, 3))
    fill = 9.969209968386869e36
    same(packed(tmp_path, [0, fill, 2], ["_NCProperties"], "f8"), F_T=(0, np.nan, 2))
    curve = packed(tmp_path, [0, fill, 2], kind="f8")
    same(curve, F_T=(0, np.nan, 2))
    assert "1 numbers beyond 1e+30 are gaps" in str(curve)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"] = np.arange(4)
        file["time"].attrs["units"] = "seconds since 2026-05-02"
        made = file.create_dataset("F_T", data=[1.0, -99, 3, 4], fillvalue=-99)
        made.attrs["units"] = "N"
    same(read(tmp_path / "a.h5"), t=range(4), F_T=(1, np.nan, 3, 4))


def test_arrays_along_other_dimensions_are_not_joined(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name in ("time", "time_2"):
            file[name] = np.arange(4.0)
            file[name].attrs["units"] = "s"
            file[name].make_scale()
        for name, along in (("F_T", "time"), ("slip", "time_2")):
            file[name] = np.arange(4.0)
            file[name].attrs["units"] = "N" if name == "F_T" else "m"
            file[name].dims[0].attach_scale(file[along])
    asked = {"t": "time", "F_T": "F_T"}
    same(read(tmp_path / "a.h5", asked), F_T=range(4))
    refuse(lambda: read(tmp_path / "a.h5", asked | {"slip": "slip"}), "not sampled together")


def test_classic_netcdf(tmp_path):
    with netcdf_file(tmp_path / "a.nc", "w") as file:
        file.createDimension("time", 4)
        for name, values, unit in (("time", T, "s"), ("shear_force", (1, -32767, 3, 4), "N")):
            made = file.createVariable(name, "f8" if unit == "s" else "i2", ("time",))
            made[:] = values
            made.units = unit
        made.scale_factor = 0.5
    same(read(tmp_path / "a.nc"), t=T, F_T=(0.5, np.nan, 1.5, 2))
    (tmp_path / "b.nc").write_bytes(b"CDF\x05" + bytes(80))
    refuse(lambda: read(tmp_path / "b.nc"), "netCDF 5, which is not read", "nccopy")


def test_numpy(tmp_path):
    np.savez(tmp_path / "a.npz", time=T, F_T=F, note="x")
    same(read(tmp_path / "a.npz", **SAID), t=T, F_T=F)
    np.save(tmp_path / "a.npy", np.column_stack([T, F]))
    same(read(tmp_path / "a.npy", {"t": 1, "F_T": 2}, **SAID), t=T, F_T=F)
    long = np.stack([np.arange(5.0), np.arange(5.0) ** 2])
    np.save(tmp_path / "a.npy", long)
    curve = read(tmp_path / "a.npy", {"t": "array(1,:)", "F_T": "array(2,:)"}, **SAID)
    same(curve, t=long[0], F_T=long[1])
    assert "2 x 5 numbers: its rows are taken for channels" in str(curve)
    np.save(tmp_path / "a.npy", np.zeros((100, 80)))
    refuse(lambda: read(tmp_path / "a.npy", {"t": 1, "F_T": 2}), "left out: 100 x 80 numbers")
    np.save(tmp_path / "a.npy", np.array([{}, 1], dtype=object))
    refuse(lambda: read(tmp_path / "a.npy"), "arrays of numbers")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of broken files
def test_mdf(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    for version, name in (("4.10", "a.mf4"), ("3.30", "a.mdf")):
        t = np.array(T)
        with asammdf.MDF(version=version) as file:
            force = asammdf.Signal(np.array(F), t, unit="N", name="shear force")
            file.append([force, asammdf.Signal(np.array(F), t, unit="um", name="slip")])
            file.append([asammdf.Signal(np.array(F), t + 3, unit="V", name="other")])
            file.save(tmp_path / name, overwrite=True)
        asked = {"t": "time of group 1", "F_T": "shear force", "slip": "slip"}
        same(read(tmp_path / name, asked), t=T, F_T=F, slip=1e-6 * np.array(F))
        asked["t"] = "time of group 2"
        refuse(lambda name=name, asked=asked: read(tmp_path / name, asked), "not sampled together")
        with asammdf.MDF(version=version) as file:  # groups with the same times
            file.append([force])
            file.append([asammdf.Signal(np.array(F), t, unit="um", name="slip")])
            file.save(tmp_path / name, overwrite=True)
        same(read(tmp_path / name), t=T, F_T=F, slip=1e-6 * np.array(F))
    with asammdf.MDF(version="4.10") as file:
        bad = np.array([False, False, True, False])
        file.append([asammdf.Signal(np.array(F), t, unit="N", name="F_T", invalidation_bits=bad)])
        file.save(tmp_path / "b.mf4")
    same(read(tmp_path / "b.mf4"), t=T, F_T=np.where(bad, np.nan, F))
    (tmp_path / "c.mf4").write_bytes(b"MDF     4.10    " + bytes(80))
    refuse(lambda: read(tmp_path / "c.mf4"), "an MDF file that can be read")
    gc.collect()


def universal(pyuff, path, *, step=0.5, binary=0, **channels):
    path.unlink(missing_ok=True)
    for name, (values, unit) in channels.items():
        named = {"id1": name, "rsp_ent_name": name, "ordinate_axis_units_lab": unit}
        of = {"abscissa_spacing": 1, "abscissa_min": 0.0, "abscissa_inc": step}
        kinds = {"abscissa_spec_data_type": 17, "orddenom_spec_data_type": 0}
        kinds |= {"ordinate_spec_data_type": 13, "z_axis_spec_data_type": 0, "func_type": 1}
        nodes = dict.fromkeys(("rsp_node", "rsp_dir", "ref_node", "ref_dir"), 1)
        data = {"data": np.array(values), "x": step * np.arange(len(values)), "binary": binary}
        made = pyuff.prepare_58(**named, **of, **kinds, **nodes, **data)
        pyuff.UFF(str(path)).write_sets(made, mode="add")


@pytest.mark.parametrize("binary", [0, 1])
def test_universal_files(tmp_path, binary):
    pyuff = pytest.importorskip("pyuff")
    path = tmp_path / "a.uff"
    universal(pyuff, path, binary=binary, F_T=(F, "N"), slip=(F, "um"))
    curve = read(path)
    np.testing.assert_allclose(curve.t, T, rtol=1e-6)
    np.testing.assert_allclose(curve.table["F_T"], F, rtol=1e-6)
    np.testing.assert_allclose(curve.table["slip"], 1e-6 * np.array(F), rtol=1e-6)
    assert "six digits" not in str(curve)
    universal(pyuff, path, binary=binary, step=1 / 3000, F_T=(100 * F, "N"))
    curve = read(path)
    assert "six digits; times may be off by 2e-07 s" in str(curve)
    assert np.abs(curve.t - np.arange(400) / 3000).max() < 2e-7


def test_extras_that_are_missing_are_named(tmp_path, monkeypatch):
    for begin, module, extra in (
        (b"TDSm", "nptdms", "tdms"),
        (b"MDF     4.10", "asammdf", "mdf"),
        (b"    -1\n    58\n", "pyuff", "uff"),
    ):
        monkeypatch.setitem(sys.modules, module, None)
        (tmp_path / "a").write_bytes(begin + bytes(80))
        refuse(lambda: read(tmp_path / "a"), rf"pip install pyfric\[{extra}\]")


def test_kinds_that_are_not_read_say_what_to_do(tmp_path):
    (tmp_path / "a.itx").write_text("IGOR\nWAVES/D t F\nBEGIN\n0 1\nEND\n")
    refuse(lambda: read(tmp_path / "a.itx"), "Igor text", "Save Delimited Text")
    (tmp_path / "a.xls").write_bytes(b"\xd0\xcf\x11\xe0" + bytes(80))
    refuse(lambda: read(tmp_path / "a.xls"), "workbook", "export the table")


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
