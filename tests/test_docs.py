"""The pages in docs/: every procedure and test that they name exists."""

import re
from pathlib import Path

import pytest

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
    source, procedure = re.fullmatch(r"`(\w+\.f90):(\w+)`", row[1]).groups()
    text = (ROOT / "fortran" / source).read_text(encoding="utf-8")
    assert re.search(rf"^ *end (subroutine|function) {procedure}$", text, re.MULTILINE)
    file, test = re.fullmatch(r"(?:T: )?`(test_\w+\.py)::(test_\w+)`", row[2]).groups()
    text = (ROOT / "tests" / file).read_text(encoding="utf-8")
    assert re.search(rf"^def {test}\(", text, re.MULTILINE)


def test_a_name_that_does_not_exist_is_noticed():
    with pytest.raises(AssertionError):
        test_procedure_and_oracle_exist(["", "`law.f90:nothing`", "`test_docs.py::test_nothing`"])
