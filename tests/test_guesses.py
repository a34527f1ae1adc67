"""First guesses: each does what a user expects, or a message says what to write instead.

guesses.txt lists guesses with their results: they work, or the error has this text.
"""

import contextlib
import copy
import inspect
import io
import os
import pickle
import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner
from helpers import small

import pyfric
from pyfric.cli import hints
from pyfric.cli.commands import main
from pyfric.record import held_in
from pyfric.scene import laws
from pyfric.scene.ends import TAKES
from pyfric.values import parse_quantity, usage, words

GUESSES = re.findall(
    r"^(?!#)(.+)  ->  (.+)$", (Path(__file__).parent / "guesses.txt").read_text(), re.M
)
CALLS, LINES = (
    [row for row in GUESSES if row[0].startswith("$ ") is shell] for shell in (False, True)
)
CURVE = "slip/m,mu\n0,0.7\n1e-6,0.45\n"


def run():
    return pyfric.simulate(small(), 1.2e-3, fidelity="quasistatic", progress=False)


# --- the list ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """Provide the surroundings of a guess: a scene, a record, a curve, and their files."""
    folder = tmp_path_factory.mktemp("guesses")
    scene = pyfric.setup1(L="20 mm", H="10 mm", l="2.5 mm", F_N="400 N", h="2.5 mm")
    quick = {"fidelity": "quasistatic", "progress": False}
    record = pyfric.simulate(scene, 0.3, **quick)
    with contextlib.chdir(folder):
        record.save("loading.nc")
        record.save("run.nc")
        scene.to_toml("own.toml")
        curve = pyfric.measured.sampled(record, "0.5 ms", noise=1e-3)
        curve.table.to_csv("curve.csv", index=False)
        yield {
            "pyfric": pyfric,
            "scene": scene,
            "record": record,
            "curve": curve,
            "other": pyfric.simulate(scene.replace(mu_s=0.65), 0.02, **quick),
            "figure": pyfric.figures.fig1b(record),
        }


def test_first_guesses_of_calls_work_or_are_answered(world):
    wrong = []
    for guess, answer in CALLS:
        with contextlib.redirect_stdout(io.StringIO()):
            try:
                eval(guess, world)
                found = "works"
            except Exception as error:
                found = str(error).replace("\n", " ")
        if answer not in found or (answer == "works") != (found == "works"):
            wrong.append((guess, answer, found))
    assert not wrong
    assert len(CALLS) > 200


def test_first_guesses_of_command_lines_work_or_are_answered(world):
    wrong = []
    for guess, answer in LINES:
        done = CliRunner().invoke(main, shlex.split(guess.removeprefix("$ pyfric ")))
        found = "works" if done.exit_code == 0 else done.stderr.replace("\n", " ")
        if answer not in found or done.exit_code not in (0, 2):
            wrong.append((guess, answer, done.output, done.exception))
    assert not wrong
    assert len(LINES) > 50


# --- words ---------------------------------------------------------------------------------------


def test_lines_to_write_can_be_written():
    """Each suggested line is valid Python, and suggested names exist."""
    lines = [text for owner, rows in words.LINES.items() for text in rows.values()]
    for text in lines:
        for code in re.findall(r"pyfric(?:\.\w+)+", text):
            found = pyfric
            for name in code.split(".")[1:]:
                found = getattr(found, name)
    options, laws_of = pyfric.Options.declared(), pyfric.laws.KINDS
    fields = pyfric.scene.SETTABLE
    columns = [name for group in ("curve", "events") for name in held_in(group)]
    known = {*options, *laws_of, *fields, *columns, *main.commands, *pyfric.__all__}
    known |= {*TAKES, *options["fidelity"].mark.words, "workers", "t_end", "out", "set"}
    stands = [row.split()[0] for row in words.NAMES.strip().split("\n")]
    assert set(stands) <= known


def test_a_word_never_hides_a_name():
    """Known names are not in the list of words, and suggested names are known."""
    assert words.meant("velocity", ["V", "h"]) == "V"
    assert words.meant("velocity", ["h"]) == ""
    assert words.meant("F N", ["F_N"]) == words.meant("fn", ["F_N"]) == "F_N"
    assert words.meant("K", ["k"]) == ""


# --- the command line in its own words -----------------------------------------------------------


def test_arguments_that_refusals_name_are_options():
    """Arguments in errors on measurements, found in the source, are options of the command."""
    sources = (Path(pyfric.__file__).parent / "measured").glob("*.py")
    text = "".join(path.read_text() for path in sources)
    named = set(re.findall(r"(\w+)=\{+\"", text))
    assert {"units", "columns", "calibration", "wraps", "valid"} <= named
    assert named | {"gaps", "restarts", "decimal", "head", "step", "F_N", "area", "noise"} <= (
        hints.options_of(main.commands["fit"]).keys()
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('units={"t": "s"} or another unit', "--unit t=s or another unit"),
        ('columns={"t": name or number, ...}, or step=', "--column t=NAME, or --step"),
        ('calibration={"F_T": "0.12 N"}', "--calibration 'F_T=0.12 N'"),
        ('restarts="join", or a number', "--restarts join, or a number"),
        ('valid={"F_T": (low, high)} of pyfric.measured.read', "--valid F_T=low:high"),
        ('F_N="400 N", or a column of it', "--normal '400 N', or a column of it"),
        ("pyfric.measured.events(curve, noise=1e-3)", "--noise 1e-3"),
        ("fidelity = 'hybrid' or 'dynamic'", "--fidelity hybrid or 'dynamic'"),
        ("unknown={1: 2}, other=3", "unknown={1: 2}, other=3"),
    ],
)
def test_arguments_of_python_become_options(text, said):
    head = "units.t: 't' has no unit in the file; allowed: "
    assert hints.in_shell(head + text, main.commands["fit"]) == (
        f"--unit t: 't' has no unit in the file; allowed: {said}"
    )


def test_the_format_of_sweeps_is_in_the_help(world):
    said = CliRunner().invoke(main, ["sweep", "--help"]).stdout
    shown = [line.strip() for line in said.splitlines()]
    begin = next(n for n, line in enumerate(shown) if line.startswith("scene ="))
    end = next(n for n, line in enumerate(shown) if line.startswith("max_hours"))
    Path("shown.toml").write_text("\n".join(shown[begin : end + 1]))
    assert len(pyfric.Sweep.from_toml("shown.toml").rows) == 6


# --- calls ---------------------------------------------------------------------------------------


def test_calls_that_do_not_fit_are_refused_with_a_line():
    @usage()
    def made(scene, t_end, *, progress=True):
        return scene, t_end

    assert made(1, t_end=2) == (1, 2)
    assert list(inspect.signature(made).parameters) == ["scene", "t_end", "progress"]
    for call, field in (
        (lambda: made(1), "t_end"),
        (lambda: made(1, 2, 3), "arguments"),
        (lambda: made(1, 2, time=3), "time"),
    ):
        with pytest.raises(pyfric.SceneError) as refused:
            call()
        assert refused.value.field == field
    with pytest.raises(pyfric.SceneError, match=r"made\(scene, t_end\)"):
        made()


@pytest.mark.parametrize(
    ("guess", "text"),
    [
        (lambda: pyfric.plan(small(), "4 s"), r"want = '4 s'.*plan\(scene, t_end='4 s'\)"),
        (lambda: pyfric.plan(small(), 0.1), r"plan\(scene, t_end=0.1\)"),
        (lambda: pyfric.plan(small(), "slowly"), r"want = 'slowly': unknown"),
        (lambda: pyfric.simulate(small()), r't_end: missing.*simulate\(scene, "900 ms"\)'),
        (lambda: pyfric.Slider(E=3e9, nu=0.3, rho=1.0, B=0.01), r"E = .*Slider\.of_material\(E="),
        (lambda: pyfric.Slider(nu=0.3), r"nu = 0\.3.*Poisson's ratio is 1/3"),
        (lambda: small().replace({"slider.kk": 1.0}), r"kk = 1\.0: unknown"),
        (lambda: pyfric.setup2(l="5 mm"), r"driver\.h = 0\.002 m: .*of the preset: set it, too"),
        (lambda: pyfric.setup2(l="5 mm", h="3 mm"), r"driver\.h = 0\.003 m: not on a row; allowed"),
        (lambda: pyfric.front_speed(run(), 1), r"'Record'.*analysis\.front\(record, event\)"),
        (lambda: parse_quantity("K", "2 Newton/meter", "N/m"), "write 'newton/meter'"),
    ],
)
def test_one_sentence_says_what_to_write(guess, text):
    with pytest.raises(pyfric.SceneError, match=text) as refused:
        guess()
    assert "\n" not in str(refused.value)


def test_positions_are_those_of_simulate(tmp_path):
    assert pyfric.Job(small(), "1 ms") == pyfric.Job(scene=small(), t_end=1e-3)
    path = tmp_path / "friction.csv"
    path.write_text(CURVE)
    assert laws.Measured(path) == laws.Measured(path=path)
    with pytest.raises(TypeError):
        laws.Measured(path, 3)


@pytest.mark.parametrize("text", ["2 mm s-1", "2 mm s⁻¹", "2 mm/s", "2 millimetre/second"])
def test_units_are_read_as_they_are_written(text):
    assert parse_quantity("V", text, "m/s") == 2e-3


@pytest.mark.parametrize("code", ["utf-8", "utf-8-sig", "utf-16"])
def test_scenes_are_read_in_each_unicode(code, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(small().to_toml(), encoding=code)
    assert pyfric.Scene.from_toml(path) == small()


def test_the_home_folder_has_its_short_name(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    record = run()
    assert record.save("~/a.nc") == tmp_path / "a.nc"
    assert pyfric.load("~/a.nc") == pyfric.load(Path("~/a.nc")) == record
    assert record.to_csv("~/tables")[0].parent == tmp_path / "tables"
    state = pyfric.simulate(small(), 1e-6, fidelity="dynamic", progress=False).final_state
    assert pyfric.State.load(state.save("~/state.npz")) == pyfric.State.load("~/state.npz")
    small().to_toml("~/scene.toml")
    assert pyfric.Scene.from_toml("~/scene.toml") == small()
    words = ["scene", "~/scene.toml", "--out", "~/again.toml"]
    assert CliRunner().invoke(main, words).exit_code == 0
    assert {"a.nc", "again.toml", "scene.toml"} < set(os.listdir(tmp_path))


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["run", "-", "--t-end", "1 ms"], "name a preset or a file"),
        (["run", "fig1", "--t-end", "1 ms", "--out", "-"], "name a place for them"),
        (["run", "fig1", "--t-end", "1 ms", "--csv", "-"], "name a place for them"),
        (["draw", "fig1", "--out", "-"], "name a place for them"),
        (["cache", "list"], "PYFRIC_CACHE names a file, not a folder"),
    ],
)
def test_the_command_line_says_what_to_name(words, text, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "file"))
    monkeypatch.chdir(tmp_path)
    found = CliRunner().invoke(main, words)
    assert found.exit_code == 2, found.output
    assert text in found.stderr
    assert os.listdir(tmp_path) == ["file"]


def test_only_names_of_its_own_are_offered():
    ours = {"importlib", "sys", "Any", "TYPE_CHECKING", "ROOMS", "SPACES", "display", "signals"}
    assert ours.isdisjoint(dir(pyfric))
    assert set(pyfric.__all__) <= set(dir(pyfric))


def test_the_normal_force_of_any_scene_is_found():
    assert small().top.F_N == small().F_N
    chain = pyfric.chain()
    with pytest.raises(AttributeError, match=r"no 'F_N'; scene\.F_N is"):
        _ = chain.top.F_N
    with pytest.raises(AttributeError, match=r"no 'G_N'$"):
        _ = chain.top.G_N
    assert pickle.loads(pickle.dumps(chain)) == copy.deepcopy(chain) == chain
