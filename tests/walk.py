"""Run the blocks of a Markdown page in order, in the working folder, for tests and site.

A block of Python continues the previous one. A block of TOML whose first line is a comment with a
name becomes a file of this name. A block of text is the end of the output of the previous block,
where "..." stands for any text. Lines of `make` are left out, because they run the tests.
"""

import contextlib
import doctest
import io
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd

PRINTED = "\0printed"
MATCHING = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks(page):
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def run(kind, text, known):
    """Run a block; `known` has the names of earlier blocks and the output of the last one."""
    if kind == "python":
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(compile(text, "block", "exec"), known)
        known[PRINTED] = printed.getvalue()
    elif kind == "text":
        check, printed = doctest.OutputChecker().check_output, known[PRINTED]
        ends = check(text, printed, MATCHING) or check(f"...\n{text}", printed, MATCHING)
        assert ends, f"{text}is not\n{printed}"
    elif kind == "toml":
        known[PRINTED] = ""
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


def shown(source, folder, root):
    """Run the blocks of a page in a new folder below `root`; return the page with their output."""

    def with_output(found):
        names = {*folder.glob("*.png")}
        run(*found.groups(), known)
        parts = [found[0]]
        if known[PRINTED].strip():
            parts.append(
                f"```{{code-block}} text\n:class: output\n\n{known[PRINTED].rstrip()}\n```"
            )
        for path in sorted({*folder.glob("*.png")} - names):
            about = path.with_suffix(".txt")
            alt = path.stem.replace("_", " ")
            if about.exists():
                alt = re.split("[.;] ", about.read_text(encoding="utf-8"))[0]
            where = path.relative_to(root).as_posix()
            parts.append(f"```{{image}} /{where}\n:alt: {alt}\n:width: 75%\n```")
        return "\n\n".join(parts)

    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    known = {"__name__": "__main__"}
    with contextlib.chdir(folder), pd.option_context("display.width", 100):
        return BLOCK.sub(with_output, source)


if __name__ == "__main__":  # page, folder for its output, root of the site
    page, folder, root = map(Path, sys.argv[1:])
    print(shown(page.read_text(encoding="utf-8"), folder / page.stem, root))
