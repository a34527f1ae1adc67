"""Engines compared with stored runs of scenes unlike the paper's (`reference_data/off_box.py`)."""

import functools

import numpy as np
import off_box
import pandas as pd
import pytest

from pyfric.core import Status
from pyfric.engines.jump import Ringing
from pyfric.engines.ring_down import RingDown

FORCE = 1e-6
"""Tolerance of start and arrest forces of every event, over F_N, and requested accuracy."""
LOOSER = 1e-5
"""The default accuracy, over F_N."""
CURVE = 2e-5
"""Tolerance of F_T(t) at every point, over F_N. Within microseconds of a stop it includes fast
vibrations, of which a jump may drop a part."""
RUPTURE = 1e-7
"""Tolerance of rupture times, s: half of the paper's step. Neighbours break 1 to 2 us apart."""
LADDER = 1e-9
"""Tolerance of forces of the quasi-static engine over F_N, on any kernel of BLAS."""

reference = functools.cache(off_box.load)
ALL, CASES = off_box.names(), off_box.cases()
LONG = (
    *("digest_fig1_finite", "digest_law_finite", "fine_finite", "light_finite"),
    *("no_kinetic_finite", "no_kinetic_linear", "protocol_finite", "soft_foundation_finite"),
    *("stiff_foundation_finite", "viscosity_20_finite", "weakening_finite"),
)
"""Sets with hardly any jumps after the first events; only `make test-slow` runs them to the end."""
EARLY = 2
"""Least number of main events of four or more blocks that are compared by default."""
STEPPED = "viscosity_20_finite"
"""A set without jumps. By default only its first fifth is compared."""
LEAST = "digest_chain_linear"
"""A set of one small event."""
SHARP = {name for name, case in off_box.CASES.items() if not case.scene.interface.d_c}
LADDERS = pd.read_csv(off_box.FOLDER / "ladder.csv")


# --- what is stored ------------------------------------------------------------------------------


def test_sets_are_those_of_the_script():
    assert set(ALL) == set(CASES)
    assert set(LADDERS["scene"]) == SHARP


@pytest.mark.parametrize("name", ALL)
def test_reference_is_determined_and_of_its_scene(name):
    known, case = reference(name), CASES[name]
    about, events = known.about, known.tables["events"]
    assert known.scene == case.scene
    assert (about["engine"], about["switching"]) == ("dynamic", "located")
    for label, limit in (("half_step", off_box.HALF_STEP), ("driver", off_box.DRIVER)):
        assert about[label]["events"] == about[label]["blocks"] == 0
        if label == "driver" or not name.startswith("digest_"):
            assert max(about[label]["start"], about[label]["arrest"]) <= limit
    if not name.startswith("digest_"):
        assert (events["is_main"] & events["finished"]).sum() >= 3
        assert (events["n_front"] >= 5).sum() >= 3


def early(name):
    """Return the set; of a long one, the part before about its third large event."""
    known = reference(name)
    if name not in LONG:
        return known
    tables, t = known.tables, known.tables["curve"]["t"]
    events, fronts = tables["events"], tables["fronts"]
    n, between = -1, t > 0.2 * known.about["t_end"]
    large = np.flatnonzero(events["is_main"] & (events["n_front"] >= 4))[EARLY - 1 :]
    for n in large if name != STEPPED else ():
        between = (t > events["t_stop"][n] + known.about["t_gap"]) & (t < events["t_start"][n + 1])
        if between.any():
            break
    points = slice(None, between.idxmax())
    about = known.about | {"t_end": t[points.stop]}
    part = {"events": events[: n + 1], "curve": tables["curve"].loc[points]}
    return known._replace(about=about, tables=part | {"fronts": fronts[fronts["event"] <= n + 1]})


# --- engines -------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [LOOSER, 1e-4])
@pytest.mark.parametrize("name", [name for name in ALL if name.endswith("_finite")])
def test_a_looser_accuracy_is_kept(name, accuracy):
    record = reference(name).hybrid(accuracy)
    off = reference(name).apart(record)
    assert (off["events"], off["blocks"]) == (0, 0)
    assert max(off["start"], off["arrest"]) <= accuracy
    assert record.counts["jumps"] >= 1


@pytest.mark.slow
def test_what_jumps_spare_is_what_the_page_says():
    page = (off_box.HERE.parent / "docs" / "explanation" / "hybrid.md").read_text(encoding="utf-8")
    for name, accuracy, said in (
        ("viscosity_20_finite", FORCE, "spares {:.0f} % of its"),
        ("viscosity_20_finite", LOOSER, "{:.0f} % at $10^{{-5}}$"),
        ("viscosity_20_finite", 1e-3, "{:.0f} % at $10^{{-3}}$"),
        ("viscosity_20_linear", FORCE, "In linear geometry it spares {:.0f} % at $10^{{-6}}$"),
    ):
        counts = reference(name).hybrid(accuracy).counts
        share = 100 * counts["steps_spared"] / (counts["steps"] + counts["steps_spared"])
        assert said.format(share) in page


ESTIMATED = ("digest_fig1_finite", "digest_fig1_linear", "slender_finite")
MORE = ("digest_law_finite", "protocol_finite", "steep_finite")
"""Sets on which estimates of errors of jumps are compared with steps."""
TIMES, STEPS_LEAVE = 5.0, 1e-9
"""Largest ratio of error and estimate; error of steps of rk4 themselves, over F_N."""


def beyond_estimates(known):
    """Return a hybrid run, and the excess of each jump's error over its limit, over F_N.

    The margins of sticking blocks against slip and opening are compared: after the jump, and after
    the same steps on a copy.
    """
    excess, land = [], RingDown._land

    def compared(skip, present, landing, system):
        state, n = present.copy(), len(system.held)
        end = state.step + landing.n
        while state.step < end:
            made = skip.steps.make_steps(state, end - state.step)
            assert made in (Status.DONE, Status.LOG_FULL)
        land(skip, present, landing, system)
        gaps = np.minimum(landing.gaps[:n], landing.gaps[n : 2 * n])
        error = np.abs(state.margin[system.held] - gaps).max()
        excess.append((error - TIMES * landing.error) / skip.scene.F_N)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RingDown, "_land", compared)
        record = known.hybrid(FORCE)
    return record, np.array(excess)


@functools.cache
def runs(name):
    """Return errors of a hybrid run and, for some sets, of its jumps against steps."""
    known = early(name)
    record, excess = beyond_estimates(known) if name in ESTIMATED else (known.hybrid(FORCE), None)
    return known.apart(record), excess


def hybrid(name):
    return runs(name)[0]


def check(off):
    assert (off["events"], off["blocks"]) == (0, 0)
    assert max(off["start"], off["arrest"]) <= FORCE
    assert off["curve"] <= CURVE
    assert off["rupture"] <= RUPTURE


@pytest.mark.parametrize("name", ALL)
def test_hybrid_is_full_dynamics(name):
    known = early(name)
    assert (known.tables["events"]["is_main"].sum() < EARLY) == (name in (STEPPED, LEAST))
    check(hybrid(name))


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_hybrid_is_full_dynamics_up_to_the_end(name):
    """All events agree; by default the first ones are compared."""
    known = reference(name)
    check(known.apart(known.hybrid(FORCE)))


@pytest.mark.parametrize(
    "name", [*ESTIMATED, *(pytest.param(one, marks=pytest.mark.slow) for one in MORE)]
)
def test_a_jump_lands_within_its_estimate_of_where_steps_lead(name):
    excess = runs(name)[1] if name in ESTIMATED else beyond_estimates(reference(name))[1]
    assert len(excess) >= 3
    assert excess.max() < STEPS_LEAVE


def test_an_estimate_without_resonance_is_noticed(monkeypatch):
    monkeypatch.setattr(Ringing, "distances", lambda self: np.full(len(self.a), np.inf))
    known = reference("slender_finite")
    half = known._replace(about=known.about | {"t_end": known.about["t_end"] / 2})
    assert beyond_estimates(half)[1].max() > STEPS_LEAVE


@pytest.mark.parametrize("scene", sorted(SHARP))
def test_ladder_is_the_stored_one(scene):
    known = reference(f"{scene}_{off_box.CASES[scene].geometries[0]}")
    stored = LADDERS[LADDERS["scene"] == scene]
    made = off_box.ladder(known)
    assert len(made) == len(stored) > 3
    for name in off_box.LADDER:
        if name.startswith("F_T"):
            atol = LADDER * known.scene.F_N
            np.testing.assert_allclose(made[name], stored[name], rtol=0, atol=atol, err_msg=name)
        else:
            np.testing.assert_array_equal(made[name], stored[name], err_msg=name)


# --- the comparison notices ----------------------------------------------------------------------


def changed(**columns):
    tables = {name: table.copy() for name, table in reference("disorder_linear").tables.items()}
    for name, (table, row, change) in columns.items():
        tables[table].loc[row, name] += change
    return tables


@pytest.mark.parametrize(
    ("columns", "noticed"),
    [
        ({"F_T_start": ("events", 4, 1.0)}, "start"),
        ({"F_T_arrest": ("events", 4, np.nan)}, "arrest"),
        ({"t_start": ("events", 4, 1e-6)}, "time"),
        ({"last_block": ("events", 4, 1)}, "blocks"),
        ({"n": ("fronts", 0, 100)}, "blocks"),
        ({"t": ("fronts", 0, 1e-6)}, "rupture"),
        ({"F_T": ("curve", 50, 1.0)}, "curve"),
    ],
)
def test_differences_are_noticed(columns, noticed):
    same, F_N = changed(), reference("disorder_linear").scene.F_N
    assert set(off_box.apart(same, same, F_N).values()) == {0.0}
    assert off_box.apart(same, changed(**columns), F_N)[noticed] > 0


def test_a_missing_event_is_noticed():
    same = changed()
    fewer = same | {"events": same["events"].iloc[:-1]}
    assert off_box.apart(same, fewer, 1.0)["events"] == 1
