"""Fitted numbers of the hybrid engine, doubled and halved: forces stay within the accuracy.

The table of these numbers is in `docs/explanation/hybrid.md`.
"""

import importlib
from pathlib import Path

import off_box
import pytest

ACCURACY = 1e-6
"""Of start and arrest forces of every event, over F_N."""
SETS = ("protocol_linear", pytest.param("light_finite", marks=pytest.mark.slow))
FITTED = (
    "modes.N_MODES",
    "modes.SLOW",
    "jump.TRY",
    "jump.ROUNDS",
    "hybrid.BEYOND",
    "hybrid.AMPLIFIED",
)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("constant", FITTED)
def test_events_do_not_depend_on_it(constant, factor, name, monkeypatch):
    module, _, attribute = constant.partition(".")
    module = importlib.import_module(f"pyfric.engines.{module}")
    value = getattr(module, attribute)
    monkeypatch.setattr(module, attribute, type(value)(factor * value))
    if attribute == "N_MODES":
        defaults = (None, None, module.N_MODES)
        monkeypatch.setattr(module.Linearised.__init__, "__defaults__", defaults)
    elif attribute == "TRY":
        monkeypatch.setattr("pyfric.engines.hybrid.TRY", module.TRY)
    known = off_box.load(name)
    found = known.apart(known.hybrid())
    assert (found["events"], found["blocks"]) == (0, 0)
    limit = ACCURACY / (factor if attribute == "AMPLIFIED" else 1.0)
    assert max(found["start"], found["arrest"]) <= max(limit, ACCURACY)


def test_the_docs_list_them_all():
    page = Path(__file__).parents[1] / "docs" / "explanation" / "hybrid.md"
    text = page.read_text(encoding="utf-8")
    for constant in FITTED:
        assert f"| `{constant}` |" in text
