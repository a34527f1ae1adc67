"""Names in texts: pages in docs/, mutations, and mu, which only the law may name."""

import ast
import dataclasses
import importlib.machinery
import importlib.util
import inspect
import itertools
import re
import signal
import tomllib
from pathlib import Path
from typing import get_args

import accuracy
import click
import pandas as pd
import pytest

import pyfric
from pyfric.cli.commands import main
from pyfric.cli.options import ELSEWHERE
from pyfric.fitting.measurement import KINDS, Measurement

ROOT = Path(__file__).parents[1]
ROWS = [
    [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    for line in (ROOT / "docs" / "equations.md").read_text(encoding="utf-8").splitlines()
    if line.startswith("| ") and not line.startswith("| equation ")
]


def test_the_table_is_read():
    assert len(ROWS) > 20
    assert all(len(row) == 3 for row in ROWS)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_procedure_and_oracle_exist(row):
    source, procedure = re.fullmatch(r"`(\w+\.f90|\w+/\w+\.py):(\w+)`", row[1]).groups()
    python = source.endswith(".py")
    text = (ROOT / ("pyfric" if python else "fortran") / source).read_text(encoding="utf-8")
    begin = rf"^ *def {procedure}\(" if python else rf"^ *end (subroutine|function) {procedure}$"
    assert re.search(begin, text, re.MULTILINE)
    file, test = re.fullmatch(r"(?:T: )?`(test_\w+\.py)::(test_\w+)`", row[2]).groups()
    text = (ROOT / "tests" / file).read_text(encoding="utf-8")
    assert re.search(rf"^def {test}\(", text, re.MULTILINE)


def test_a_name_that_does_not_exist_is_noticed():
    with pytest.raises(AssertionError):
        test_procedure_and_oracle_exist(["", "`law.f90:nothing`", "`test_docs.py::test_nothing`"])


def test_only_the_law_says_mu():
    """Only `law.f90` uses the modules of laws, except for the evolution of states."""
    paths = list((ROOT / "fortran").glob("*.f90"))
    assert {"law.f90", "junctions.f90", "sweep.f90"} <= {path.name for path in paths}
    for path in paths:
        text = path.read_text(encoding="utf-8")
        said = re.search(r"\bmu(_s|_k|_0)?\b|%drop\b", text)
        laws = ("law.f90", "resting.f90", "junctions.f90", "evolution.f90")
        assert bool(said) == (path.name in laws), path.name
        for law in ("resting", "junctions", "rate_state"):
            assert (f"use pyfric_{law}," in text) == (path.name == "law.f90"), path.name


def script(name):
    loader = importlib.machinery.SourceFileLoader(name, str(ROOT / "scripts" / name))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(name, loader))
    loader.exec_module(module)
    return module


def test_each_mutation_finds_its_text_once():
    for name, mutation in script("mutate").MUTATIONS.items():
        for file, old, _ in mutation.edits:
            assert (ROOT / file).read_text(encoding="utf-8").count(old) == 1, (name, file, old)


def test_contributing_draws_the_rooms_in_the_order_of_the_contract():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    drawn = re.findall(r"│ (\w+)(?:, (\w+))?  |  │ (\w+)  ", text)
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    contracts = settings["importlinter"]["contracts"]
    layers = next(one["layers"] for one in contracts if one["type"] == "layers")
    names = [name for layer in layers for name in layer.split(" | ")]
    rooms = [name for name in names if name not in ("laws", "analysis")]  # other names of modules
    assert [name for names in drawn for name in names if name] == rooms


@pytest.mark.parametrize("folder", ["pyfric", "studies", "fortran"])
def test_every_module_says_what_it_is(folder):
    """The site lists the first lines of modules."""
    paths = [*(ROOT / folder).rglob("*.py"), *(ROOT / folder).rglob("*.f90")]
    assert len(paths) > 10
    for path in paths:
        first = path.read_text(encoding="utf-8").split("\n", 1)[0]
        assert re.match(r'(r?"""|!>? )[^ ].{10,}', first), path


def test_the_site_names_every_public_name():
    text = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^   (\w+)$", text, re.MULTILINE))
    public = {name for name in pyfric.__all__ if inspect.isroutine(getattr(pyfric, name))}
    public |= {name for name in pyfric.__all__ if inspect.isclass(getattr(pyfric, name))}
    for module in (pyfric.analysis, pyfric.figures, pyfric.measured, pyfric.theory):
        public |= set(module.__all__)
    public |= {kind.__name__ for kind in (*KINDS.values(), Measurement)}
    constants = {"ANDREWS_S", "LARGEST_VISCOSITY"}
    assert public - named == constants | {"DataFigure", "PaperFigure", "FIGURES"}
    assert named - public == set()


def test_random_mutants_change_one_line_and_are_the_same_again():
    def some():
        return list(itertools.islice(script("mutate-random").mutants(ROOT, 3), 40))

    made = some()
    assert made == some()
    assert {one.area for one in made} == {"core", "statics", "engines", "record"}
    for one in made:
        old = (ROOT / one.file).read_text(encoding="utf-8").splitlines()
        new = one.text.splitlines()
        assert [i for i, pair in enumerate(zip(old, new, strict=True), 1) if len({*pair}) > 1] == [
            one.line
        ]
        if one.file.endswith(".py"):
            ast.parse(one.text)


def test_trials_of_faults_are_kept_as_they_end_and_not_made_again(tmp_path):
    faults = script("faults")
    tried = []

    def trials(bad=(), until=4):
        for n in range(1, until + 1):

            def do(n=n):
                tried.append(n)
                if n in bad:
                    raise bad[n]

            yield "run", f"fault {n}", do

    def make(commit, **how):
        tried.clear()
        table = faults.Table(tmp_path)
        faults.try_all(trials(**how), "kills", {"seed": "1", "commit": commit}, table)

    with pytest.raises(KeyboardInterrupt):
        make("old", bad={2: OSError("no space"), 3: KeyboardInterrupt()})
    make("old")
    assert tried == [3, 4]
    make("new", bad={2: faults.Broken("lost")})
    assert tried == [2]
    assert "| kills | run | 4 | 3 |" in (tmp_path / "README.md").read_text(encoding="utf-8")
    make("newer", until=5)
    assert tried == [2, 5]
    assert "| kills | run | 5 | 5 |" in (tmp_path / "README.md").read_text(encoding="utf-8")
    table = faults.Table(tmp_path)
    assert [row["commit"] for row in table.rows] == ["old", "newer", "old", "old", "newer"]
    table.drop(["kills"], "1")
    assert not table.rows


def test_tests_that_somebody_killed_say_nothing_about_a_mutant(tmp_path, monkeypatch):
    mutate = script("mutate-random")
    monkeypatch.setattr(mutate, "WORK", tmp_path)

    class Ends:
        def __init__(self, code):
            self.python = lambda *words, **more: code

    with pytest.raises(mutate.Killed):
        mutate.noticed(Ends(-signal.SIGKILL), ["tests"])
    assert mutate.noticed(Ends(-signal.SIGXCPU), ["tests"]) == "start (does not end)"
    assert mutate.noticed(Ends(0), ["tests"]) == ""


def test_options_are_typed_by_their_names():
    """Editors complete the keywords of `simulate` from the class `Keywords`."""
    keywords = pyfric.engines.options.Keywords.__annotations__
    assert list(keywords) == [one.name for one in dataclasses.fields(pyfric.Options)]
    assert get_args(pyfric.engines.options.StepperName) == tuple(pyfric.core.STEPPERS)
    command = main.commands["run"]
    params = command.get_params(click.Context(command))
    (stepper,) = (one.type for one in params if one.name == "stepper")
    assert tuple(stepper.choices) == tuple(pyfric.core.STEPPERS)
    assert get_args(pyfric.engines.Fidelity) == ("auto", *pyfric.engines.ENGINES)
    assert set(keywords) <= {one.name for one in params} | {*ELSEWHERE}


def test_blocks_of_a_page_keep_their_lines():
    page = "# Page\n\n```python\nimport pyfric\n```\n\n```sh\nls\n```\n\n```python\nx = 1\n```\n"
    made = script("blocks").module(page).splitlines()
    assert (made[3], made[11]) == ("import pyfric", "x = 1")
    assert "".join(made) == "import pyfricx = 1"


def test_the_version_is_the_same_in_all_release_files():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    for name in ("CITATION.cff", ".zenodo.json", "scripts/release/recipe.yaml"):
        text = (ROOT / name).read_text(encoding="utf-8")
        (found,) = re.findall(r"^\W*(?:% set )?version\W+(\d[\w.]*)", text, re.MULTILINE)
        assert found == version, name


def test_the_paper_counts_plans_as_they_are_stored():
    data = pd.read_csv(ROOT / "reference_data" / "plans" / "plans.csv")
    text = " ".join((ROOT / "scripts" / "release" / "paper.md").read_text(encoding="utf-8").split())
    silent = (data["beyond_tolerance"] & ~data["said"]).sum()
    assert silent < len(data) / 100
    said = f"In {silent} of {len(data)} random plans the error exceeded the tolerance without "
    said += "notice; in "
    assert said + f"{data['not_measured'].sum()} of them the record says" in text


def test_plans_with_weakening_are_told_as_they_are_stored():
    data = pd.read_csv(ROOT / "reference_data" / "plans" / "weakening.csv")
    text = " ".join((ROOT / "docs" / "validation.md").read_text(encoding="utf-8").split())
    assert f"Of {len(data)} more scenes" in text
    assert data["beyond_tolerance"].sum() == (data["beyond_tolerance"] & data["said"]).sum() == 2
    assert not data["beyond_measured"].any()


def test_texts_beside_the_charts_say_what_is_stored():
    folder = ROOT / "reference_data"
    price = pd.read_csv(folder / "chart" / "price_points.csv").set_index("name")
    about = (ROOT / "README.md").read_text(encoding="utf-8")
    times = float(f"{price.loc['hybrid engine', 'cheaper']:.2g}")
    assert f"is {times:.0f} times cheaper" in about
    points = pd.read_csv(folder / "chart" / "chart_points.csv")
    plans = points[points["kind"] == "plan"]
    full = accuracy.full_dynamics(points).set_index("scene")["seconds"]
    shares = plans["seconds"] / plans["scene"].map(full)
    kept = [row[row["want"]] <= row["tolerance"] for row in plans.to_dict("records")]
    text = " ".join((folder / "README.md").read_text(encoding="utf-8").split())
    assert all(kept)
    assert f"All {len(plans)} plans meet their tolerance." in text
    low, high = shares.min(), shares.max()
    assert f"they take {low:.2g} to {high:.2g} of the time of full dynamics" in text


def test_findings_are_listed_and_stand_apart():
    """Each finding is one script, with exact versions, without pyfric."""
    folder = ROOT / "findings"
    if not folder.is_dir():
        pytest.skip("they are not in a source distribution")
    scripts = {path.name: path.read_text() for path in folder.glob("*.sh")}
    listed = re.findall(r"\]\((\w+\.sh)\)", (folder / "README.md").read_text())
    assert sorted(listed) == sorted(scripts)
    for name, text in scripts.items():
        code = "\n".join(line for line in text.splitlines() if not line.startswith("#"))
        assert "pyfric" not in code, name
        wanted = re.findall(r"install --quiet (.+)", code)
        assert wanted, name
        assert all(re.search(r"(==|\w@)\d", one) for one in wanted[0].split()), name
        for said in ("# Input: ", "# Expected: ", "# Seen: "):
            assert said in text, name
