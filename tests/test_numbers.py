"""Numbers in module constants: their kinds; the docs list the fitted numbers."""

import ast
import importlib
import importlib.util
import re
from pathlib import Path

import numpy as np

import pyfric

ROOT = Path(__file__).parents[1]
WHOLE = {
    "figures": "sizes of drawings",
    "paper": "numbers of published cases",
    "checks": "limits of checks, each with its reason",
    "cli": "none",
}
"""Rooms whose numbers are all of one kind."""
ROOMS = tuple(room for room in (*pyfric.ROOMS, "cli") if room not in WHOLE)
PAGE = ROOT / "docs" / "explanation" / "numbers.md"
MOST_FITTED = 20
NUMBER = r"[\d.]+(?:e-?\d+)?"
KINDS = {
    "policy": {
        "moving": "LEAST",
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
        "arrivals": "PART FEWEST",
        "boundaries": "FIRST NEAR FAINT POINTS",
        "builds": "BLOCKS_PER_THREAD",
        "chain": "_DAMPED _FAR _PERIODS",
        "cracks": "ACCURACY _STEP",
        "curve": "OTHER_SIGN STILL",
        "files": "OLD",
        "fits": "MORE STARTS TOLERANCES",
        "junctions": "PARTS TAIL",
        "kinds": "CLOSE DECADES FAR PER_DECADE",
        "lines": "TUKEY",
        "measurement": "CAP",
        "measures": "PART",
        "misfits": "FEWEST LARGE OF_COUNTS OF_FORCES",
        "noise": "ALONE AROUND EQUAL FAR FEW FINE LONGEST OFTEN RARE SMOOTH_LINE WHITE",
        "of_curves": "PARTS POINTS",
        "of_events": "ENOUGH FAINT IN_A_ROW LATER LONGER OFF_LOAD POPULATION SLIDES",
        "phases": "BLOCKS STEP",
        "picking": "BLOCK CLEAR NEAR SMOOTH TOLD",
        "posteriors": "BURNT WALKERS",
        "presets": "UNSAID",
        "problem": "DOUBTFUL FURTHER",
        "reading": "NAMED NEAR_END SOME",
        "results": "AT_BOUND",
        "runs": "MAX_LOSSES POLL",
        "search": "ALIKE COARSE FAR FOLLOWED NOTICED STEP TOLD WALK WALKS WIDEST",
        "sensitivities": "NOISE STEPS",
        "shared": "CALIBRATION CHECKED CONFIDENCE LEAST",
        "spread": "CELLS",
        "store": "DAY FORGET POLL SILENCE",
        "sweep": "ASKED",
        "text": "LEFT RUN",
        "words": "LONG",
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
        "columns": "ROUNDED",
        "lines": "ROUNDED",
        "parts": "MULTIPLE_RTOL",
        "phases": "MORE",
        "sensitivities": "ROUNDED",
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
        "cracks": "_WEIGHT",
        "files": "SEAL_LENGTH",
        "lines": "NORMAL",
        "materials": "PLANE_STRAIN",
        "misfits": "ALONE PER_EVENT",
        "of_events": "OTHERS",
        "shared": "GOLDEN",
        "spread": "SUMMED",
        "waves": "_STIFFNESS",
    },
    "definition": {
        "layout": "SCHEMA",
        "contact": "BARE",
        "arrays": "FILLS",
        "calls": "SLIP_FINISHED",
        "cracks": "ANDREWS_S",
        "ends": "TAKES",
        "log": "POINT",
        "loggers": "CHANNELS HEAD TIME VALUES",
        "memory": "LIMITS",
        "packing": "BEYOND",
        "phases": "PACES",
        "reading": "BITS",
        "results": "MEASURED",
        "sequences": "IN_EVENT MOVES PASSES",
        "spacings": "AT",
        "rate_state": "EVOLUTIONS",
        "state": "OPEN SIDES STUCK",
        "steppers": "_RK4_ROWS",
        "units": "PREFIXES",
        "words": "LINES",
    },
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
        "body": "PART",
        "chain": "FASTEST FASTEST_OVERDAMPED LARGEST_VISCOSITY SLOWEST SLOWEST_OVERDAMPED",
        "checked": "MAX_LISTED",
        "columns": "MAX_BYTES PASSES",
        "errors": "_SHORT",
        "formats": "START",
        "found": "MAX_COLUMNS",
        "junctions": "MOST",
        "kinds": "MAX_KNOTS",
        "lattice": "MAX_NAME",
        "lines": "AT_ONCE FEWEST PASSES",
        "log": "POINTS",
        "parts": "MAX_BLOCKS",
        "profile": "MAX_BYTES",
        "protocol": "MOST",
        "rate_state": "LARGEST LONGEST MOST",
        "restless": "LARGEST_RATIO LONGEST_REST",
        "sequences": "KEPT POINTS QUIET",
        "spread": "MOST_CELLS",
        "store": "MAX_BYTES",
        "text": "MAX_BYTES SAMPLE",
        "toml": "MAX_FILE",
        "units": "LARGEST SMALLEST _LONGEST",
        "varied": "MAX_POINTS",
        "waves": "SOFTEST STIFFEST",
    },
}
"""Kinds of numbers that are not fitted, by module. A policy is a choice: a default, a share of a
tolerance, a budget of time, the limit of a note. A cap ends an iteration that should have ended
before. A size costs only time or memory. Others follow from a formula beside them, or from double
precision."""

FORMULAS = {
    "core/memory": (1024.0,),  # bytes of a kilobyte
    "engines/cost": (2e-7, 500.0),  # the step of the paper; bytes for each unknown
    "fitting/fits": (0.9,),  # default level of intervals
    "fitting/misfits": (1.2533, 1.4826),  # sqrt(pi/2); 1 over the third quartile of a normal number
    "fitting/posteriors": (12.0,),  # 1 over the variance of a uniform number
    "fitting/results": (0.9,),  # default level of intervals
    "fitting/search": (1e-4, 0.01),  # ends of a search
    "fitting/sensitivities": (0.01,),  # a hundredth, of per cent
    "measured/loggers": (5e8,),
    "measured/lvm": (60.0, 3600.0),  # seconds of a minute and of an hour
    "measured/meanings": (0.01,),  # a hundredth, of per cent
    "measured/noise": (0.9,),  # a quantile
    "measured/picking": (1.25,),  # from the middle of a mean to the step beyond its end
    "planning/plans": (0.01, 1e5),  # default tolerance; bytes of a record without events
    "record/errors": (0.95,),  # a quantile
    "record/zones": (0.75,),  # 3 pi/4
    "scene/lattice": (0.1,),  # eta of the paper
    "scene/laws/kinds": (0.25, 0.75),  # where a function is tried between knots
    "scene/materials": (0.75,),  # k of plane strain over E
    "scene/text": (0.25, 1.5),  # 1/2 squared; c_P squared over c squared
    "statics/operators": (1.5,),  # impedances of P and S waves
    "sweeps/boundaries": (1e-3,),  # default tolerance
    "sweeps/measures": (0.05, 0.95),  # quantiles
    "sweeps/phases": (1e-3, 0.45, 0.7),  # default tolerance; mu_k and mu_s of a chain
    "sweeps/spacings": (0.1, 3.0),  # damping of the paper; default end
    "theory/chain": (30.0,),  # where an integrand is negligible
    "theory/waves": (0.499999, 0.99),  # range of Poisson's ratio
}
"""Other numbers in the bodies of functions, by module."""
PRESETS = ("presets",)
"""Modules whose functions hold values of scenes."""
UNITS, ROUNDED = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 10.0, 1e3, 1e6, 1e9), 1e-9
"""Numbers that need no name: small ones, powers of ten, and limits of rounding."""


FORTRAN = {
    "policy": {"location": "DIP_DEPTH DIP_LENGTH", "slow_slip": "LONGER SAFE SHORTER SLOWLY"},
    "rounding": {
        "junctions": "AT_LIMIT",
        "location": "FORESEEN_WIDTH KNOT_WIDTH ROOT_WIDTH",
        "slow_slip": "TURNED",
    },
    "derived": {
        "elementary": "INVERSE LOG_2 LOG_2_INVERSE LOG_2_REST ODD TWO_52 WHOLE",
        "kinds": "NOT_KNOWN",
        "slow_slip": "A AT BY_TIME C GAMMA INSIDE",
    },
    "cap or size": {
        "location": "SHORTEST_SUBSTEP",
        "model": "S_SERIES",
        "evolution": "FAR LAST_STEP LEAST LOST",
        "rate_state": "SMALL",
    },
}
"""Real parameters of the core, as in `KINDS`. Steppers have coefficients; none is fitted."""


def has_number(node):
    """Whether an assigned value contains a number."""
    numbers = (int, float)
    return any(
        isinstance(one, ast.Constant) and type(one.value) in numbers for one in ast.walk(node)
    )


def numbers(root=ROOT):
    """Return the names of constants that hold numbers, "module.NAME"."""
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
    """Return numbers in functions that are not small, units or rounding, by module."""
    found = {}
    files = (file for room in ROOMS for file in (root / "pyfric" / room).rglob("*.py"))
    for path in (file for file in files if file.stem not in PRESETS):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        functions = [one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef)]
        inside = (one for function in functions for one in ast.walk(function))
        numbers = {one.value for one in inside if isinstance(one, ast.Constant)}
        floats = {one for one in numbers if type(one) is float and one not in UNITS}
        if kept := tuple(sorted(one for one in floats if one > ROUNDED)):
            found[path.relative_to(root / "pyfric").with_suffix("").as_posix()] = kept
    return found


def parameters(folder=ROOT / "fortran"):
    """Return the real parameters of modules of the core, "module.NAME"."""
    found = set()
    for path in folder.glob("*.f90"):
        for line in path.read_text(encoding="utf-8").splitlines():
            kind, _, names = line.partition("!")[0].partition("parameter ::")
            if names and kind.split("(")[0].strip() == "real":
                bare = re.sub(r"\([^()]*\)|\[.*", "", re.sub(r"\([^()]*\)", "", names))
                found |= {f"{path.stem}.{name}" for name in re.findall(r"([A-Z]\w*) *=", bare)}
    return found


def told(table):
    """Return rows and names of a table of the page: 0 for fitted numbers, 1 for prices."""
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


def test_each_parameter_of_the_core_has_one_kind():
    kinds = [
        f"{module}.{name}"
        for modules in FORTRAN.values()
        for module, names in modules.items()
        for name in names.split()
    ]
    assert len(kinds) == len(set(kinds))
    assert set(kinds) == parameters()


def test_the_page_has_the_values_of_the_code():
    rows, _ = told(0)
    for row in rows:
        names, value = row.split("|")[1:3]
        found = []
        for module, name in re.findall(r"`([a-z_]+)\.([A-Z_]+)`", names):
            holds = (f"pyfric.{one}.{module}" for one in ROOMS)
            holds = (importlib.import_module(one) for one in holds if importlib.util.find_spec(one))
            (number,) = (getattr(one, name) for one in holds if hasattr(one, name))
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
    assert unnamed(tmp_path) == {"engines/new": (0.37,)}
