"""Run every command of `python studies --tiny` in one process, and print each result.

    python -P tests/tiny_studies.py FOLDER [COMMAND ...]

Outputs go to the folder. Studies store their runs in one folder, so that they share them.
"""

import json
import runpy
import sys
import time
import traceback
from pathlib import Path

import click
from click.testing import CliRunner

from pyfric import core
from pyfric.figures import style

GIVEN = {"fronts": ["--collapse", "5 mm"], "collapse": ["{out}/fronts/fronts_fronts.csv"]}
"""Arguments of commands besides folders; `fronts` has made the file before."""


def words(folder, name, command):
    """Return the command line of a command, from its options."""
    found = [word.format(out=folder) for word in GIVEN.get(name, ())]
    options = {one.name: one for one in command.params if isinstance(one, click.Option)}
    if "out" in options:
        kind = options["out"].metavar
        found += ["--out", str(folder / name if kind == "DIR" else folder / f"{name}.csv")]
    if "runs" in options:
        found += ["--runs", str(folder / "runs")]
    return found


def main(folder, *chosen):
    core.processors = lambda: 1  # workers would import all modules again
    style.PNG_DPI = 30
    studies = runpy.run_path(str(Path(__file__).parents[1] / "studies"))["main"]
    rows = []
    for name, command in sorted(studies.commands.items(), key=lambda one: one[0] == "collapse"):
        if chosen and name not in chosen:
            continue
        start = time.process_time()
        done = CliRunner().invoke(studies, ["--tiny", name, *words(Path(folder), name, command)])
        said = done.output
        if done.exception and not isinstance(done.exception, SystemExit):
            said += "".join(traceback.format_exception(done.exception))
        seconds = round(time.process_time() - start, 2)
        rows.append({"name": name, "code": done.exit_code, "said": said, "seconds": seconds})
        print(name, done.exit_code, seconds, file=sys.stderr, flush=True)
    print(json.dumps(rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
