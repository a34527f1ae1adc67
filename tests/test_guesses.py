"""First guesses: each does what one expects, or one sentence says what to write instead."""

import copy
import os
import pickle
from pathlib import Path

import pytest
from click.testing import CliRunner
from helpers import small

import pyfric
from pyfric.cli.commands import main
from pyfric.scene import laws, parse_quantity

CURVE = "slip/m,mu\n0,0.7\n1e-6,0.45\n"


def run():
    return pyfric.simulate(small(), 1.2e-3, fidelity="quasistatic", progress=False)


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
