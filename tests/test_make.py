"""Commands of the Makefile and their scripts: the files and tests that they name exist."""

import ast
import importlib.machinery
import importlib.util
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = re.search(r"^\.PHONY: ((?:.*\\\n)*.*)", MAKEFILE, re.MULTILINE)[1].replace("\\", "")
FILES = [path for path in (ROOT / "scripts").iterdir() if path.is_file()]
SCRIPTS = sorted(path.name for path in FILES if path.name != "setup")
"""Scripts in Python."""


def loaded(name):
    """Return a script as a module, without running its command."""
    loader = importlib.machinery.SourceFileLoader(
        name.replace("-", "_"), str(ROOT / "scripts" / name)
    )
    spec = importlib.util.spec_from_loader(loader.name, loader)
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def names_of_tests(path):
    """Return the names of the tests in a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {one.name for one in ast.walk(tree) if isinstance(one, ast.FunctionDef)}


@pytest.mark.parametrize("target", TARGETS.split())
def test_targets_name_files_that_are_there(target):
    """Nothing is built; files to be installed first count as present."""
    there = [word for one in ("packages", "installed", "docs") for word in ("-o", f".venv/{one}")]
    run = ["make", "-n", *there, target]
    done = subprocess.run(run, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for word in re.findall(r"(?<![\w./])(?:scripts|tests|studies|findings)/[\w./-]+", done.stdout):
        assert (ROOT / word).exists(), word


@pytest.mark.parametrize("name", SCRIPTS)
def test_scripts_name_tests_that_are_there(name):
    """Names occur in lists of files, and in lists of tests that are left out."""
    for value in vars(loaded(name)).values():
        words = [value] if isinstance(value, str) else value
        if not isinstance(words, str | list | tuple):
            continue
        for file, test in re.findall(
            r"(tests/test_\w+\.py)(?:::(\w+))?", " ".join(map(str, words))
        ):
            assert (ROOT / file).is_file(), file
            assert not test or test in names_of_tests(ROOT / file), test
    for one in getattr(loaded(name), "TESTS", ()):
        short = re.sub(r"^(tests/)?(test_)?|\.py$", "", one)
        assert (ROOT / "tests" / f"test_{short}.py").is_file(), one
