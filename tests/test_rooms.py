"""The rooms: their order, imports that no contract finds, and imports of lower rooms."""

import ast
import functools
import importlib
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import conftest
import pytest

import pyfric

ROOT = Path(__file__).parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
BY_NAME = {"import_module", "__import__", "resolve_name", "run_module", "run_path", "exec", "eval"}
"""Functions that can import a module by a string."""
DOOR = "pyfric/__init__.py"
OF_THEIR_OWN = {"pyfric/core/builds.py"}
"""Modules that read files of their own folder by name."""


def layers():
    contracts = SETTINGS["importlinter"]["contracts"]
    (order,) = (one["layers"] for one in contracts if one["type"] == "layers")
    return [name for layer in reversed(order) for name in layer.split(" | ")]


@functools.cache
def trees():
    paths = sorted((ROOT / "pyfric").rglob("*.py"))
    return [(p.relative_to(ROOT).as_posix(), ast.parse(p.read_text("utf-8"))) for p in paths]


def test_the_door_opens_the_rooms_from_the_ground_up():
    """`import pyfric` imports all rooms but the highest, from the lowest up."""
    assert ["display", "signals", *pyfric.ROOMS, "laws", "analysis", "cli"] == layers()


def test_no_string_names_a_room_to_import():
    found = set()
    for file, tree in trees():
        nodes = list(ast.walk(tree))
        calls = [node for node in nodes if isinstance(node, ast.Call)]
        calls = [node for node in calls if getattr(node.func, "id", "") == "eval"]
        harmless = [node.func for node in calls if ast.unparse(node) == "eval('0')"]
        names = [node for node in nodes if isinstance(node, ast.Name)]
        names = {node.id for node in names if node not in harmless}
        names |= {node.attr for node in nodes if isinstance(node, ast.Attribute)}
        if names & BY_NAME:
            found.add(file)
    assert found == {DOOR, *OF_THEIR_OWN}


def test_registries_read_their_own_folder():
    for file, tree in trees():
        if file not in OF_THEIR_OWN:
            continue
        package = file.rpartition("/")[0].replace("/", ".")
        calls = [
            node.args[0]
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and "import_module" in ast.unparse(node.func)
        ]
        assert calls, file
        for asked in map(ast.unparse, calls):
            assert asked.startswith(f"f'{package}."), (file, asked)


def test_nobody_below_comes_in_by_the_door():
    """Rooms below the command line never import `pyfric` itself, which imports them."""
    for file, tree in trees():
        if file.startswith("pyfric/cli/"):
            continue
        imported = [
            name.name
            for node in ast.walk(tree)
            if isinstance(node, ast.Import)
            for name in node.names
        ]
        assert "pyfric" not in imported, file
        if file != DOOR:
            from_door = [
                name.name
                for node in ast.walk(tree)
                if isinstance(node, ast.ImportFrom) and node.module == "pyfric"
                for name in node.names
            ]
            assert set(from_door) <= set(layers()), file


def imports(files):
    """Return module -> its imports, with those for types; `files` are paths and trees."""
    paths = {file.removesuffix(".py").replace("/", "."): tree for file, tree in files}
    modules = {name.removesuffix(".__init__"): tree for name, tree in paths.items()}
    found = {}
    for module, tree in modules.items():
        names = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                names |= {name.name for name in node.names}
            elif isinstance(node, ast.ImportFrom):
                inside = {f"{node.module}.{name.name}" for name in node.names}
                names |= inside & modules.keys() or {node.module}
        found[module] = names & modules.keys() - {module}
    return found


def rings(graph):
    """Return the largest sets of modules that import each other in rings."""

    def reached(module):
        found, ahead = set(), [module]
        while ahead:
            new = graph[ahead.pop()] - found
            found |= new
            ahead += new
        return found

    to = {module: reached(module) for module in graph}
    mutual = {frozenset(b for b in to[a] if a in to[b]) for a in graph}
    return {ring for ring in mutual if ring}


def test_modules_import_each_other_one_way():
    assert rings(imports(trees())) == set()


def test_a_ring_of_types_is_noticed():
    hidden = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pyfric.room import {}\n"
    files = [(f"pyfric/room/{a}.py", ast.parse(hidden.format(b))) for a, b in ("ab", "bc", "ca")]
    ring = frozenset(f"pyfric.room.{name}" for name in "abc")
    assert rings(imports([*files, ("pyfric/room/d.py", ast.parse("import pyfric.room.a"))])) == {
        ring
    }
    assert rings(imports(files[:2])) == set()


# --- what a fresh process imports ----------------------------------------------------------------

FRESH = """
import json, sys

def imported(*names):
    print(json.dumps(sorted(sys.modules.keys() & set(names))))

import pyfric
imported("numpy", "scipy", "pandas", "matplotlib", "xarray", "pydantic", "pyfric.scene")
from pyfric import preset, simulate
from pyfric.analysis import precursors
print(json.dumps(simulate(preset("fig1"), 1e-5, progress=False).status))
imported("scipy.optimize", "scipy.stats", "scipy.integrate", "matplotlib", "xarray", "pint")
scene = pyfric.Scene.from_toml(preset("fig1").to_toml())
imported("pint", "pyfric.figures")
print(json.dumps("<img" in scene._repr_html_()))
imported("matplotlib", "matplotlib.pyplot", "xarray", "pyfric.figures")
"""


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    """Return the output lines of a new process without display and home."""
    found = subprocess.run(
        [sys.executable, "-c", FRESH],
        cwd=tmp_path_factory.mktemp("fresh"),
        env={name: os.environ[name] for name in ("PATH", "PYTHONPATH") if name in os.environ},
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stderr
    names = ("door", "status", "run", "file", "drawn", "figure")
    return dict(zip(names, map(json.loads, found.stdout.splitlines()), strict=True))


def test_the_door_alone_imports_no_room_and_no_library(fresh):
    assert fresh["door"] == []


def test_running_needs_no_display_and_no_home(fresh):
    assert fresh["status"] == "complete"


def test_a_run_waits_for_no_library_that_it_does_not_use(fresh):
    assert fresh["run"] == []


def test_pint_is_imported_only_for_other_units(fresh):
    assert "pint" not in fresh["file"]


def test_a_scene_is_drawn_though_nobody_imported_figures(fresh):
    assert "pyfric.figures" not in fresh["file"]
    assert fresh["drawn"]


def test_drawing_leaves_no_global_state(fresh):
    assert fresh["figure"] == ["matplotlib", "pyfric.figures"]


# --- lists ---------------------------------------------------------------------------------------


def near():
    """Return the tests that `scripts/mutate-random` names for a file."""
    tree = ast.parse((ROOT / "scripts" / "mutate-random").read_text(encoding="utf-8"))
    values = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    return ast.literal_eval(values["NEAR"])


def test_lists_of_tests_name_files_that_exist():
    tests = {path.stem.removeprefix("test_") for path in (ROOT / "tests").glob("test_*.py")}
    assert set(conftest.PORTABLE) <= set(conftest.LAPACK) <= tests
    assert {test for tests in near().values() for test in tests} <= tests
    assert set(near()) <= {path.stem for path in (ROOT / "pyfric").rglob("*.py")}


def test_each_module_has_a_file_of_tests():
    """The file has its name, or is in the table of CONTRIBUTING, which has no other modules."""
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = [re.findall(r"`([\w/]+)`", line) for line in page.splitlines() if line[:8] == "| `test_"]
    files = {path.stem for path in (ROOT / "tests").glob("test_*.py")}
    assert {row[0] for row in rows} <= files
    paths = [Path(file) for file, _ in trees()]
    others = {
        path.relative_to("pyfric").with_suffix("").as_posix()
        for path in paths
        if not path.stem.startswith("__") and f"test_{path.stem}" not in files
    }
    assert sorted(module for row in rows for module in row[1:]) == sorted(others)


VAGUE = {"one", "some", "most", "few", "many", "here", "there"}
"""Names that are too vague."""


def test_names_say_what_they_hold():
    found = set()
    for file, tree in trees():
        for node in ast.walk(tree):
            stored = isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
            name = node.id if stored else node.arg if isinstance(node, ast.arg) else ""
            found |= {(file, name)} if name in VAGUE else set()
    assert found == {("pyfric/cli/commands/cache.py", "most")}  # the option --most


def test_no_constant_is_dead():
    """Each number of a module is read in it or in another module, or is public."""
    defined, read = {}, set()
    for file, tree in trees():
        names = [node for node in ast.walk(tree) if isinstance(node, ast.Name)]
        read |= {node.id for node in names if isinstance(node.ctx, ast.Load)}
        read |= {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        strings = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
        stores = (
            node for one in tree.body if isinstance(one, ast.Assign) for node in ast.walk(one)
        )
        stored = {node.id for node in stores if isinstance(node, ast.Name) and node.id.isupper()}
        defined |= {(file, name): name for name in stored - strings}
    read |= set(pyfric.theory.__all__)
    assert len(defined) > 100
    assert [key for key, name in defined.items() if name not in read] == []


@pytest.mark.parametrize(("name", "inside"), [("laws", "scene"), ("analysis", "record")])
def test_modules_are_imported_by_the_names_that_users_see(name, inside):
    short, long = (
        importlib.import_module(one) for one in (f"pyfric.{name}", f"pyfric.{inside}.{name}")
    )
    assert short is long is getattr(pyfric, name)
