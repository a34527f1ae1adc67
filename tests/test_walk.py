"""A newcomer's walk: the blocks of README and tutorials, run in order in an empty folder, as they
are written.

A block of Python goes on where the one before it ended. A block of text is how its output ends. A
block of TOML whose first line is a comment with a name becomes that file. Lines of `make` are left
out: they are what runs the tests.
"""

import contextlib
import io
import os
import re
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).parents[1]
# Of the pages, one is walked by `make test`, all by `make docs`.
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "tutorials").glob("*.md"))]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks(page):
    return [(kind, text) for kind, text in BLOCK.findall(page.read_text(encoding="utf-8"))]


def run(kind, text, known):
    if kind == "python":
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(text, "block", "exec"), known)
        known["_printed"] = printed.getvalue()
    elif kind == "text":
        assert known["_printed"].endswith(text)
    elif kind == "toml":
        if name := re.match(r"# (\S+\.toml)\n", text):
            Path(name[1]).write_text(text, encoding="utf-8")
    elif kind == "sh":
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        for line in text.splitlines():
            if not line.startswith("make "):
                subprocess.run(["sh", "-ec", line], check=True, env=os.environ | {"PATH": path})
    else:
        raise AssertionError(f"a block of {kind}: what is it?")


def walked(page):
    marks = [] if page.stem == "how_far" else [pytest.mark.slow]
    return pytest.param(page, marks=marks, id=page.stem)


@pytest.mark.parametrize("page", [walked(page) for page in PAGES])
def test_a_newcomer_can_run_every_block(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "kept"))
    known = {"__name__": "__main__"}
    for kind, text in blocks(page):
        run(kind, text, known)
    plt.close("all")


def test_every_page_has_blocks():
    assert len(PAGES) > 3
    assert all(blocks(page) for page in PAGES)


def test_a_block_that_fails_is_noticed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = {"python": "1 / 0", "sh": "pyfric run nothing --t-end 1", "text": "2\n"}
    for kind, text in wrong.items():
        with pytest.raises((ZeroDivisionError, subprocess.CalledProcessError, AssertionError)):
            run(kind, text, {"_printed": "1\n"})
