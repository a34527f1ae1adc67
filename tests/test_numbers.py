"""Numbers in module constants: of what kind each is; the docs list the fitted ones."""

import ast
import importlib
import re
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
ROOMS = ("planning", "engines", "statics", "record")
PAGE = ROOT / "docs" / "explanation" / "numbers.md"
MOST_FITTED = 18
NUMBER = r"[\d.]+(?:e-?\d+)?"
KINDS = {
    "policy": {
        "levels": "ALONE FIRST HALF SHORTER STEPPED STRICTER",
        "plans": "MOVING PILOT",
        "cost": "POINTS TIMED FASTEST SLOWEST",
        "integration": "STATIC_SECONDS STATIC_SHARE SHOWN OPEN_BUDGET",
        "guarded": "CALL_SECONDS",
        "guard": "STEPS MARGIN",
        "loaded": "FOLDING",
        "strains": "LINEAR",
        "schedule": "SPENT",
        "stable_slip": "FAST",
        "skip": "MOSTLY",
        "jump": "CORRECTED",
        "options": "FINEST MAX_THREADS RTOL",
        "pauses": "AT_REST BLOCKS COLUMNS",
        "rests": "BALANCED",
        "step_sizes": "ACCURACY AUTO_SHARE DIGITS HALVED LONGEST LONGEST_LOCATED MAX_STEPS",
        "stopping": "TRANSITS",
        "pairs": "PERTURBATION SAFETY",
        "linearised": "COLUMNS",
        "slow_slip": "BENT INERTIA OF_STEP SLIPPED SLOW_POINTS SLOW_STEPS SLOW_WORK SPENT WAVES",
        "simulation": "LONG SHORT STATIC_SHARE",
        "starts": "EXCESS",
        "heights": "TILT UNBALANCED",
        "contact": "LEAST_DEFINITENESS",
        "analysis": "BINS SHIFTS PER_BIN",
        "catalogue": "MAIN_EVENT_BLOCKS",
        "classes": "FROM_BLOCK SLOW LAST",
        "errors": "AGAIN SAME",
        "zones": "RESOLVED_L_B",
        "measured": "COVERED",
        "method": "T_GAP",
        "quasistatic": "BENDS",
        "recurrence": "BIN FEWEST",
        "rupture": "AVERAGED SLOWEST",
        "complementarity": "LEAST",
        "creep": "RATE PAST",
    },
    "rounding": {
        "crossing": "GONE",
        "operators": "INDEPENDENT",
        "system": "LEADING",
        "grid": "ON_GRID",
        "step_sizes": "ALMOST",
        "routes": "ROUNDING",
        "linearised": "LARGE",
        "complementarity": "LOST RATE_TOL",
        "contact": "CONTACT_TOL",
        "creep": "ENOUGH ROUNDED",
        "equilibrium": "ACCEPTED JUNCTION_ROUNDED",
        "heights": "OFF",
        "stability": "BITS GROWN ROUNDED",
        "analysis": "ROUNDED",
        "catalogue": "ROUNDED",
        "growth": "ROUNDING",
        "recurrence": "WHOLE",
    },
    "derived": {
        "cost": "BEYOND",
        "space": "SLOWEST",
        "pauses": "SLOWEST",
        "lattice": "DIRECTIONS",
        "growth": "SPEEDS",
        "netcdf": "DEFLATE",
        "creep": "PART",
        "stability": "_REDUCED",
    },
    "definition": {"layout": "SCHEMA", "contact": "BARE"},
    "cap or size": {
        "jump": "LONGEST",
        "path": "ROUNDS",
        "space": "APPLIED BLOCK FEW KEPT",
        "moving": "ASIDE",
        "recorder": "MAX_EVERY",
        "quasistatic": "GROWTH IDLE IN_A_CALL",
        "together": "BATCH BATCH_BYTES KEPT",
        "complementarity": "CHANGES BASES",
        "creep": "NEWTON LOOKS STEPS",
        "equilibrium": "MAX_NEWTON CORRECTIONS JUNCTION_STEPS",
        "heights": "ROUNDS",
        "crossing": "N_FINE GRID",
        "rests": "KEPT KEPT_SLIPS PATHS",
        "slow_slip": "KEPT",
        "banded": "TOGETHER",
        "blas": "SMALL",
        "condensation": "LARGE KEPT",
        "system": "KEPT",
        "netcdf": "COMPRESSED_FROM",
    },
}
"""Kinds of numbers that are not fitted, by module. A policy is a choice that could be another one:
defaults, shares of a tolerance, budgets of time, limits of notes. A cap ends an iteration that
should have ended before; a size costs time or memory only. Others follow from a formula beside
them, or are what double precision leaves."""

FORMULAS = {
    "cost": (2e-7, 500.0),  # the step of the paper; bytes for each unknown
    "errors": (0.95,),  # a quantile
    "plans": (0.01, 1e5),  # default tolerance; bytes of a record without events
    "operators": (1.5,),  # impedances of P and S waves
    "zones": (0.75,),  # 3 pi/4
}
"""Other numbers in the bodies of functions, by module."""
UNITS, ROUNDED = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 10.0, 1e3, 1e6, 1e9), 1e-9
"""Numbers that need no name: small ones and powers of ten, and those that are rounding."""


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


def unnamed(root=ROOT):
    """Numbers in bodies of functions that are neither small, units nor rounding, by module."""
    found = {}
    for path in (file for room in ROOMS for file in (root / "pyfric" / room).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        functions = [one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef)]
        inside = (one for function in functions for one in ast.walk(function))
        numbers = {one.value for one in inside if isinstance(one, ast.Constant)}
        floats = {one for one in numbers if type(one) is float and one not in UNITS}
        if kept := tuple(sorted(one for one in floats if one > ROUNDED)):
            found[path.stem] = kept
    return found


def told(table):
    """The rows of a table of the page, 0 for fitted numbers and 1 for prices, and their names."""
    text = PAGE.read_text(encoding="utf-8").split("## Prices")[table]
    rows = [line for line in text.splitlines() if line[:3] == "| `"]
    return rows, [name for row in rows for name in re.findall(r"`([a-z_]+\.[A-Z_]+)`", row)]


def test_each_number_has_one_kind():
    kinds = [
        f"{module}.{name}"
        for modules in KINDS.values()
        for module, names in modules.items()
        for name in names.split()
    ]
    found = [*kinds, *told(0)[1], *told(1)[1]]
    assert len(found) == len(set(found))
    assert set(found) == numbers()


def test_the_page_has_the_values_of_the_code():
    rows, _ = told(0)
    for row in rows:
        names, value = row.split("|")[1:3]
        found = []
        for module, name in re.findall(r"`([a-z_]+)\.([A-Z_]+)`", names):
            (room,) = (one for one in ROOMS if (ROOT / "pyfric" / one / f"{module}.py").exists())
            number = getattr(importlib.import_module(f"pyfric.{room}.{module}"), name)
            number = list(number.values()) if isinstance(number, dict) else number
            found += np.atleast_1d(number).tolist()
        assert [float(one) for one in re.findall(NUMBER, value)] == found, row


def test_numbers_in_functions_are_formulas_or_units():
    assert unnamed() == FORMULAS


def test_few_are_fitted():
    rows, names = told(0)
    values = [len(re.findall(NUMBER, row.split("|")[2])) for row in rows]
    assert 5 < len(rows) <= len(names) <= sum(values) <= MOST_FITTED


def test_prices_are_those_of_the_module():
    _, names = told(1)
    assert {name.partition(".")[0] for name in names} == {"cost"}


def test_a_number_that_is_not_told_is_noticed(tmp_path):
    (tmp_path / "pyfric" / "engines").mkdir(parents=True)
    (tmp_path / "pyfric" / "engines" / "new.py").write_text("FUDGE = 0.37\nNAME = 'text'\n")
    assert numbers(tmp_path) == {"new.FUDGE"}
    (tmp_path / "pyfric" / "engines" / "new.py").write_text("def f(s):\n    return 0.37 * s\n")
    assert unnamed(tmp_path) == {"new": (0.37,)}
