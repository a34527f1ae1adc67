"""Numbers of engines, statics and record: the docs say of each what kind it is."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
ROOMS = ("engines", "statics", "record")
PAGE = ROOT / "docs" / "explanation" / "numbers.md"
MOST_FITTED = 15
FITTED = "Fitted"


def has_number(node):
    """Whether a number is among what is assigned."""
    numbers = (int, float)
    return any(
        isinstance(one, ast.Constant) and type(one.value) in numbers for one in ast.walk(node)
    )


def numbers(root=ROOT):
    """The names of constants that hold numbers, "module.NAME"."""
    found = set()
    for path in (file for room in ROOMS for file in (root / "pyfric" / room).rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
                continue
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [one.id for target in targets for one in ast.walk(target) if hasattr(one, "id")]
            kinds = ast.Dict | ast.Tuple | ast.Constant | ast.BinOp | ast.UnaryOp
            if isinstance(node.value, kinds) and has_number(node.value):
                found |= {f"{path.stem}.{name}" for name in names if name.isupper()}
    return found


def told():
    """The names on the page, by heading."""
    sections = re.split(r"^## (.+)$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    pairs = zip(sections[::2], sections[1::2], strict=True)
    return {name: re.findall(r"`([a-z_]+\.[A-Z_]+)`", text) for name, text in pairs}


def test_each_number_is_told_once():
    found = [name for names in told().values() for name in names]
    assert len(found) == len(set(found))
    assert set(found) == numbers()


def test_few_are_fitted():
    page = PAGE.read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    assert 5 < len(rows) <= MOST_FITTED
    assert all(name in "".join(rows) for name in told()[FITTED])


def test_a_number_that_is_not_told_is_noticed(tmp_path):
    (tmp_path / "pyfric" / "engines").mkdir(parents=True)
    (tmp_path / "pyfric" / "engines" / "new.py").write_text("FUDGE = 0.37\nNAME = 'text'\n")
    assert numbers(tmp_path) == {"new.FUDGE"}
