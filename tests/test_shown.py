"""Numbers on pages that come from a command: the command runs again.

shown.txt has sentences of the pages, with numbers in brackets, and expressions for these numbers.
Numbers beside blocks of how-to pages are in the blocks (`test_walk.py`). The site inserts numbers
of stored tables.
"""

import functools
import re
from pathlib import Path

import numpy as np
import pytest

import pyfric
from pyfric.record.zones import zone_at_rest

ROOT = Path(__file__).parents[1]
NUMBER = re.compile(r"\[([\d.]+(?:e-?\d+)?)\]")


def rows(text):
    """Yield page, sentence, expression, and whether the expression is slow."""
    page, slow = "", False
    for line in text.splitlines():
        if line.startswith("docs/"):
            page, _, slow = line.partition(", ")
        elif line and line[0] != "#":
            part, expression = line.split("  ->  ")
            yield page, part, expression, bool(slow)


ROWS = [*rows((Path(__file__).parent / "shown.txt").read_text(encoding="utf-8"))]


# --- names of the expressions ---------------------------------------------------------------------


@functools.cache
def _sliding(fidelity, changes):
    scene = pyfric.preset("fig1", **{name: eval(value) for name, value in changes})
    how = {"stop_when": "system_size", "progress": False}
    record = pyfric.simulate(scene, 2.0, fidelity=fidelity, **how)
    assert record.status.startswith("ended")
    return record


def sliding(fidelity="quasistatic", **changes):
    """Return a run of the Fig. 1 scene up to its first event over the whole interface."""
    return _sliding(fidelity, tuple((name, repr(value)) for name, value in changes.items()))


def count(**changes):
    events = sliding(**changes).events
    return (events["is_main"] & events["is_precursor"]).sum()


def force(event, column, **changes):
    """Return a force of an event over F_N."""
    record = sliding(**changes)
    return record.events[column].iloc[event] / record.scene.F_N


def first(**changes):
    """Return the force at which the first precursor starts, over F_N."""
    record = sliding(**changes)
    chosen = record.events.query("is_main and is_precursor")
    return chosen["F_T_start"].iloc[0] / record.scene.F_N


def higher(**changes):
    """Return by how many % changes raise the force at which the slider slides."""
    return 100 * (slides(**changes) / slides() - 1)


def half(what, l):
    """Return by how many % half blocks at the edges raise a force."""
    return 100 * (what(l=l, edges="half") / what(l=l) - 1)


def main_event(name, **changes):
    """Return the force of the first main event of a preset, over F_N."""
    scene = pyfric.preset(name, **changes)
    how = {"fidelity": "quasistatic", "stop_when": "main_events", "progress": False}
    return pyfric.simulate(scene, 1.0, **how).events["F_T_start"].iloc[-1] / scene.F_N


def weight():
    """Return the weight on the foundation with gravity, over F_N."""
    scene = pyfric.preset("fig1", g="9.81 m/s^2")
    return pyfric.loaded_state(scene).p.sum() / scene.F_N - 1


def zone(name, **changes):
    """Return the length of the cohesive zone at rest, median over blocks, mm."""
    scene = pyfric.preset(name, **changes)
    zones = zone_at_rest(scene, pyfric.loaded_state(scene).p)
    return 1e3 * scene.slider.l * np.nanmedian(zones)


def blocks_in_L_b(name):
    scene = pyfric.preset(name)
    return scene.law.blocks_in_L_b(scene.F_N / scene.N_x, scene.slider.k)


starts = functools.partial(force, 0, "F_T_start")
slides = functools.partial(force, -1, "F_T_start")
arrests = functools.partial(force, -1, "F_T_arrest")
groove = np.isin(np.arange(57), range(26, 31))
smooth = {"mu_s": (0.7 * ~groove).tolist(), "mu_k": (0.45 * ~groove).tolist()}
hybrid = {"fidelity": "hybrid"}


# --- tests ---------------------------------------------------------------------------------------


def right(said, value):
    """Whether a number is this value, rounded to the digits that it has."""
    digits, _, power = said.partition("e")
    last = 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
    return abs(float(said) - value) <= 0.5 * last * (1 + 1e-6)


@pytest.mark.parametrize(
    ("page", "part", "expression"),
    [pytest.param(*row, marks=[pytest.mark.slow] * slow, id=row[1]) for *row, slow in ROWS],
)
def test_a_number_of_a_page_is_what_a_command_shows(page, part, expression):
    text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    assert NUMBER.sub(r"\1", part) in text
    said, values = NUMBER.findall(part), eval(f"({expression},)", globals())
    assert len(said) == len(values) > 0
    assert [right(*pair) for pair in zip(said, values, strict=True)] == [True] * len(said), values


def test_another_number_is_noticed():
    assert right("0.494", 0.49449)
    assert not right("0.494", 0.4951)
    assert right("4e-4", 4.2e-4)
    assert not right("4e-4", 4.6e-4)
    assert not right("18", 17)
    assert {page for page, *_ in ROWS} > {"docs/faq.md", "docs/laws.md"}
    assert [*rows("# a note\n\ndocs/a.md, slow\nfirst [1] of  ->  1\n")] == [
        ("docs/a.md", "first [1] of", "1", True)
    ]
