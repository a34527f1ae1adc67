"""A newcomer's walk: the blocks of README and tutorials, run in order in an empty folder, as they
are written.

A block of Python goes on where the one before it ended. A block of TOML whose first line is a
comment with a name becomes that file. A block of text is how the output of the block before it
ends, where "..." stands for anything. Lines of `make` are left out: they are what runs the tests.
"""

import contextlib
import doctest
import io
import os
import re
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).parents[1]
# Of the tutorials, one is walked by `make test`, all by `make docs`.
HOW_TO = sorted((ROOT / "docs" / "howto").glob("*.md"))
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "tutorials").glob("*.md")), *HOW_TO]
PRINTED = "\0printed"
MATCHING = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks(page):
    return [(kind, text) for kind, text in BLOCK.findall(page.read_text(encoding="utf-8"))]


def run(kind, text, known):
    """Run a block; `known` are the names of those before it, and what the last one printed."""
    if kind == "python":
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(text, "block", "exec"), known)
        known[PRINTED] = printed.getvalue()
    elif kind == "text":
        check, printed = doctest.OutputChecker().check_output, known[PRINTED]
        ends = check(text, printed, MATCHING) or check(f"...\n{text}", printed, MATCHING)
        assert ends, f"{text}is not\n{printed}"
    elif kind == "toml":
        if name := re.match(r"# (\S+\.toml)\n", text):
            Path(name[1]).write_text(text, encoding="utf-8")
    elif kind == "sh":
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        known[PRINTED] = ""
        for line in text.splitlines():
            if not line.startswith("make "):
                env = os.environ | {"PATH": path}
                words, said = ["sh", "-ec", line], subprocess.PIPE
                done = subprocess.run(words, check=True, env=env, stdout=said, text=True)
                known[PRINTED] += done.stdout
    else:
        raise AssertionError(f"a block of {kind}: what is it?")


def walked(page):
    marks = [] if page.stem == "how_far" or page in HOW_TO else [pytest.mark.slow]
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
    assert len(HOW_TO) == 10
    assert all(blocks(page) for page in PAGES)


def test_a_block_that_fails_is_noticed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for kind, text in (("python", "1 / 0"), ("sh", "pyfric run nothing --t-end 1")):
        with pytest.raises((ZeroDivisionError, subprocess.CalledProcessError)):
            run(kind, text, {})


def test_another_output_is_noticed():
    known = {}
    run("python", "print(1 / 3)", known)
    run("text", "0.33...\n", known)
    with pytest.raises(AssertionError, match=r"is not\n *0\.33"):
        run("text", "0.34...\n", known)
