"""Cases: their framework, stored results with the page, and each case in a short form."""

import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import pyfric
from pyfric import SceneError
from pyfric.cli.commands import main
from pyfric.figures import DataFigure
from pyfric.paper import cases
from pyfric.paper.cases import CASES, LIMIT, Case, Found, interface, precursor_lengths
from pyfric.paper.claims import Claim
from pyfric.paper.claims.claim import Band
from pyfric.paper.claims.damage import given
from pyfric.sweeps import Job, run_all

STORED = Path(__file__).parents[1] / "reference_data" / "cases"
PAGE = Path(__file__).parents[1] / "docs" / "cases.md"


def find(name, **short):
    """Return the parts of a case by number, for these keywords, and its figure."""
    found = CASES[name].find(lambda jobs: run_all(jobs, 1, False, False), **short)
    return {part.number.removeprefix(name).strip(): part for part in found.parts}, found.draw()


# --- the frame -----------------------------------------------------------------------------------


def falls(run, *, height=1.0):
    """A case for tests: one run, with its value in the band if the height is 1."""
    run([Job("fig1", 1e-6, {"fidelity": "dynamic"})])
    figure = DataFigure()
    figure.caption = "What falls."
    damages = [given("twice the height", height=2.0), given("no height", height=math.nan)]
    part = Claim("falls", "it falls", height, Band(0.9, 1.1, "a book", "m"), "by eye", damages)
    return Found([part], lambda: figure)


def rises(run):
    part = Claim("rises", "it rises", -1.0, Band(0.0, None, "it"), "so", [given("it again")])
    return Found([part], DataFigure)


@pytest.fixture
def two(monkeypatch):
    entries = {
        "falls": Case("falls", "Falling", "A. Book", "number", {"height": "1 m, page 1"}, falls),
        "rises": Case("rises", "Rising", "B. Book", "trend", {}, rises),
    }
    for module in ("case", "collection"):
        monkeypatch.setattr(f"pyfric.paper.cases.{module}.CASES", entries)
    monkeypatch.setattr(cases, "CASES", entries)
    return entries


@pytest.mark.usefixtures("two")
def test_a_case_is_measured_and_damaged():
    falling, rising = cases.run(cache=False, progress=False)
    (part,) = falling.parts
    assert (part.value, part.holds, falling.verdict) == (1.0, True, "holds")
    assert (part.damage, part.damaged) == ("twice the height", 2.0)  # nearer to the band than NaN
    assert rising.verdict == "misses"
    assert 0 < falling.seconds < 20
    assert "1 of 1 hold" in str(falling)
    assert "more than" not in str(falling)
    slow = cases.Result(falling.case, falling.parts, falling.figure, LIMIT + 1)
    assert "more than 180 s" in str(slow)


@pytest.mark.usefixtures("two")
def test_the_processor_time_of_runs_counts_wherever_they_were_made(monkeypatch):
    class Made:
        timings = {"processor": 100.0}  # noqa: RUF012

    monkeypatch.setattr(cases.collection, "run_all", lambda *_: [Made, Made])
    (falling,) = cases.run(["falls"])
    assert falling.seconds == pytest.approx(600.0, abs=5.0)  # the case, and twice with damage


@pytest.mark.usefixtures("two")
def test_files_and_page(tmp_path):
    done = CliRunner().invoke(main, ["case", "--all", "--out", str(tmp_path), "--no-cache"])
    assert done.exit_code == 0, done.output
    assert "misses  it rises" in done.output
    names = {path.name for path in tmp_path.iterdir()}
    ends = {".json", ".pdf", ".png", ".txt", "_provenance.toml"}
    assert names == {f"{name}{end}" for name in ("falls", "rises") for end in ends} | {"index.html"}
    stored = json.loads((tmp_path / "falls.json").read_text())
    assert stored["parts"][0]["value"] == 1.0
    assert stored["seen"] == {"height": "1 m, page 1"}
    page = (tmp_path / "index.html").read_text()
    assert page.index("Rising") < page.index("Falling")  # misses first
    for text in ("1 of 2 cases hold", "A. Book", "0.9 to 1.1 m", "twice the height: 2 m"):
        assert text in page
    (tmp_path / "rises.json").unlink()
    assert "Rising" not in cases.write_page(tmp_path).read_text()


@pytest.mark.usefixtures("two")
def test_lists_and_refusals(tmp_path):
    listed = CliRunner().invoke(main, ["case"])
    assert listed.output == "falls  Falling\nrises  Rising\n"
    assert json.loads(CliRunner().invoke(main, ["case", "--json"]).output)["rises"] == "Rising"
    wrong = CliRunner().invoke(main, ["case", "fall", "--out", str(tmp_path / "new")])
    assert wrong.exit_code == 2
    assert "Did you mean falls?" in wrong.output
    assert not (tmp_path / "new").exists()
    with pytest.raises(SceneError, match="falls"):
        cases.run(["fell"])


def test_every_case_says_where_it_is_from():
    assert pyfric.cases is cases
    for name, entry in CASES.items():
        assert any(mark in entry.source for mark in ("doi:", "arXiv:", "hal-")), name
        assert entry.target in ("number", "trend")
        assert entry.seen, name


# --- stored results ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CASES)
def test_stored_results(name):
    """Verdicts follow from values and bands, damaged scenes miss, and no case takes too long."""
    stored = json.loads((STORED / f"{name}.json").read_text())
    assert stored["seconds"] <= LIMIT
    made = tomllib.loads((STORED / f"{name}_provenance.toml").read_text())
    assert f"case {name}" in made["command"] or "--all" in made["command"]
    for part in stored["parts"]:
        band = Band(part["low"], part["high"], "")
        value, damaged = (math.nan if part[n] is None else part[n] for n in ("value", "damaged"))
        assert part["verdict"] == ("misses" if band.outside(value) else "holds")
        assert band.outside(damaged) > 0, part["number"]
    missed = any(part["verdict"] == "misses" for part in stored["parts"])
    assert stored["verdict"] == ("misses" if missed else "holds")


def test_the_page_of_the_docs_shows_stored_results():
    lines = PAGE.read_text().splitlines()
    rows = [[cell.strip(" `*") for cell in line.split("|")[1:-1]] for line in lines]
    rows = [row for row in rows if row and row[0].split(" ")[0].strip("`") in CASES]
    shown = {}
    for number, *_, value, verdict in rows:
        shown[number.replace("`", "")] = value, verdict
    known = {}
    for name in CASES:
        for part in json.loads((STORED / f"{name}.json").read_text())["parts"]:
            known[part["number"]] = f"{part['value']:.3g} {part['unit']}".strip(), part["verdict"]
    assert shown == known


# --- cases in their shortest form ----------------------------------------------------------------


def test_peak_friction():
    short = {"widths": (0.0,), "N": 4}
    parts, figure = find("peak_friction", **short)
    assert parts["a"].value == pytest.approx(2.0, abs=0.01)
    assert figure.tables["ratios"]["peak"][0] == pytest.approx(1.0, rel=1e-9)
    kept = find("peak_friction", **short, kept=1 / 3)[0]["a"]
    assert kept.value == pytest.approx(1.5, abs=0.01)  # 1/((1 + 1/3)/2)


def test_event_sizes():
    parts, figure = find("event_sizes", alpha=(1.5,), N=30, periods=0.5)
    row = figure.tables["b"].iloc[0]
    assert row["events"] > 10
    assert 0.2 < parts["a"].value == row["b"] < 2


def test_chain_fronts():
    short = {"alpha": (0.3,), "tau_bar": (0.5, 0.8)}
    parts, figure = find("chain_fronts", **short)
    assert parts["a"].value == 2  # crack, supershear
    assert parts["b"].holds
    assert len(figure.tables["fronts"]) == 2
    assert not find("chain_fronts", **short, eta=0.316)[0]["b"].holds


def test_patch():
    """The slab is smaller: a patch of eight blocks at half the distance from sides and top."""
    short = {"shape": (96, 48), "n": 8, "beta": (1.1, 1.2)}
    parts, figure = find("patch", **short)
    assert parts["a"].holds
    assert parts["b"].value == pytest.approx(1.15)
    assert figure.tables["runs"]["slip_over_d_c"].is_monotonic_increasing
    assert not find("patch", **short, edge=True)[0]["a"].holds


def test_stiffness_of_the_interface_is_that_of_a_strip_when_all_slips():
    """Under a held top uniform slip u causes the stress G u/H, G = k/2 per unit length."""
    K = interface.stiffness_of(interface.half_space(120, 6))
    np.testing.assert_allclose(K, K.T, atol=1e-13)
    middle = (K @ np.ones(120))[55:65]
    np.testing.assert_allclose(middle, 0.5 / 5, rtol=1e-3)
    assert interface.slipping(K, slice(120), 0.1) > 1  # free sides make the slab softer
    assert interface.slipping(K, slice(50, 70), 0.1) < 1


def test_heterogeneous_weakening():
    """The case has half the blocks and fewer interfaces."""
    short = {"sizes": (1, 16), "seeds": 12, "shape": (96, 48), "length": 16}
    parts, figure = find("heterogeneous_weakening", **short)
    assert parts["a"].value == pytest.approx(0.96, abs=0.06)
    assert parts["b"].holds
    assert len(figure.tables["lengths"]) == 24
    large = short | {"sizes": (32, 48)}
    assert not find("heterogeneous_weakening", **large)[0]["b"].holds


def test_slow_fronts():
    """One front becomes slow; with a short slip time of junctions it stays fast."""
    parts, _ = find("slow_fronts", shear=(0.135,), t_end=10e-3)
    assert parts["b"].holds
    fast, _ = find("slow_fronts", shear=(0.135,), t_end=2e-3, t_R=2e-5)
    assert not fast["b"].holds


def test_precursor_lengths():
    parts, _ = find("precursor_lengths", variants=precursor_lengths.BASE)
    assert parts["a"].holds
    assert np.isnan(parts["b"].value)
    assert np.isnan(parts["d"].value)
    coarse = {"l": "5 mm"}
    base = precursor_lengths.BASE | {"with inertia": coarse}
    for V, ends in ((0.39375e-3, (1e-9, 0.02)), (7.875e-3, (0.02, 0.3))):
        parts, _ = find("precursor_lengths", variants=base | {"V/2": coarse | {"V": V}})
        assert ends[0] < parts["b"].value < ends[1], V
    chain, _ = find("precursor_lengths", variants=precursor_lengths.BASE, slider="chain")
    assert not chain["a"].holds


def test_strip():
    """Two fronts bracket the default result; a top twice as high changes it."""
    parts, figure = find("strip", ratios=(0.8, 1.3), rows=13, columns=120)
    assert parts[""].value == pytest.approx(1.05)
    assert len(figure.tables["fronts"]) == 2
    assert not find("strip", ratios=(0.4, 0.8), rows=13, columns=120, higher=2)[0][""].holds


def test_random_strength():
    """The slab has half the size, and is tried with little disorder, too."""
    short = {"lengths": (0.125, 1.0), "seeds": 15, "shape": (120, 30), "L_c": 12}
    parts, _ = find("random_strength", **short)
    assert parts["a"].holds
    assert parts["b"].holds
    assert not find("random_strength", **short, std=7e-6)[0]["a"].holds


def test_strength_is_that_of_slow_loading():
    """The oracle loads in small steps, and lets slip grow until all blocks are in equilibrium."""
    n, w = 24, 0.35
    K = interface.stiffness_of(interface.half_space(n, 12))
    tau_p = 0.7 + 0.1 * np.sin(np.arange(n) ** 2)
    tau, slipping = interface.strength(K, tau_p, w)
    u, load = np.zeros(n), tau_p.min() - 1e-3
    while u.max() < 10:  # beyond this slip nothing holds the slider
        excess = np.where(u > 0, load - K @ u - tau_p + w * u, load - K @ u - tau_p)
        if (excess < 1e-7).all():
            rest, load = u.copy(), load + 1e-4
        else:
            u += np.maximum(excess, 0) / K.diagonal()
    assert load == pytest.approx(tau, abs=3e-4)
    assert (rest > 0).sum() in (slipping - 1, slipping)


def test_periodic_strength():
    """The strip is shorter; a uniform strip has no period."""
    parts, _ = find("periodic_strength", columns=200)
    assert parts["a"].value == pytest.approx(1.0, abs=0.1)
    uniform, _ = find("periodic_strength", columns=200, contrast=0.0)
    assert not uniform["b"].holds


def test_surface_grooves():
    """The case misses: one groove does not lower the force."""
    parts, _ = find("surface_grooves", grooves=(0, 1, 14))
    assert not parts["a"].holds
    assert parts["b"].value == pytest.approx(0.0074, abs=1e-3)


def test_pressure_and_length():
    parts, _ = find("pressure_and_length", lengths=(0.035, 0.14), pressures=(1.0, 2.0))
    assert parts["a"].value == pytest.approx(0, abs=1e-9)  # linear, homogeneous
    assert parts["b"].holds
    assert not find("pressure_and_length", lengths=(0.14,) * 2, pressures=(1.0,))[0]["b"].holds


def test_weak_patch():
    """With 25 blocks the patch lowers the largest force less than with 51."""
    parts, figure = find("weak_patch", l=4e-3)
    assert -0.05 < parts["a"].value < -0.03
    assert parts["b"].holds
    assert not figure.tables["events"].empty
    assert not find("weak_patch", l=4e-3, weak=(0.7, 0.45))[0]["a"].holds


def test_loading_place():
    """Two different places have two modes; one place at two speeds has one mode."""
    places = {"pushed": {"side": "left"}, "sheared": {"side": "top", "h": "20 mm"}}
    assert find("loading_place", places=places)[0][""].value == 2
    assert find("loading_place", places={"pushed": {}})[0][""].value == 1
