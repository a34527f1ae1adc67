"""One verification for many runs: points that choose the level, checks, and the report."""

import dataclasses
import re

import numpy as np
import pytest
import scipy
from click.testing import CliRunner
from helpers import refused, same_run, small

import pyfric
from pyfric.cli.commands import main
from pyfric.engines import RunError
from pyfric.planning import simulate, simulate_point, told
from pyfric.record import Errors
from pyfric.scene import Spread
from pyfric.sweeps import Job, Shared, Sweep, phase_diagram, run_all, shared
from pyfric.sweeps.shared import able, lower_limit, measured

T_END, TOLERANCE = 1.2e-3, 0.05
OPTIONS = {"tolerance": TOLERANCE, "verify": "shared"}
RANDOM = small().replace({"interface.mu_s": Spread(mean=0.7, std=0.02)})


def jobs_of(errors, **options):
    """Return a job for each of these numbers, with the number in its name."""
    scenes = (small(F_N=3000.0 + n, name=str(error)) for n, error in enumerate(errors))
    return [Job(scene=scene, t_end=T_END, options=OPTIONS | options) for scene in scenes]


def swept(count, **changes):
    over = {"interface.mu_s.seed": range(count)}
    rest = {"scene": RANDOM, "t_end": T_END, "options": {"tolerance": TOLERANCE}}
    return Sweep(**rest | {"over": over} | changes)


@pytest.fixture
def made(monkeypatch):
    """Replace runs: the error of the first level is in the scene's name; others have none.

    The list has the error, the number of the first level and the largest number of levels of each
    run.
    """
    base = simulate(small(), 1e-4, fidelity="quasistatic")
    found = []

    def planted(scene, t_end, options, *, first=0, count=None, progress=None):
        found.append((float(scene.name), first, count))
        of = able(scene, options)
        errors = [*(float(error) for error in [scene.name]), *[0.0] * len(of)]
        last = first
        if count != 1:
            last += 1
            while count is None and errors[last - 1] > options.tolerance:
                last += 1
        level = of[last]
        own = dataclasses.asdict(level.model)
        own.pop("faster")
        method = dataclasses.replace(base.method, **own)
        record = dataclasses.replace(base, scene=scene, method=method, errors=None)
        if count == 1:
            return record
        how = {"want": options.want, "tolerance": options.tolerance, "by": (of[last - 1].model,)}
        return dataclasses.replace(record, errors=Errors(start=errors[last - 1], **how))

    monkeypatch.setattr(shared, "simulate_point", planted)
    return found


def level_numbers(records):
    return [told(record, able(record.scene, pyfric.Options(**OPTIONS))).level for record in records]


@pytest.mark.parametrize("how", [{}, {"want": "motion"}, {"switching": "step_end"}, {"dt": 1e-6}])
def test_real_runs_tell_the_number_of_their_level(how):
    options = pyfric.Options(**how)
    of = able(small(), options)
    for first in (0, 1):
        record = shared.simulate_point(small(), 2e-4, options, first=first, count=1)
        assert told(record, of).level == first


# --- who chooses ---------------------------------------------------------------------------------


@pytest.mark.parametrize("where", [0, 10, 19])
def test_the_most_demanding_of_a_few_points_decides(made, where):
    """The points are spread over the list, ends included, and each finds its own level."""
    errors = np.full(20, 0.01)
    errors[where] = 0.2
    records = run_all(jobs_of(errors), 1, cache=False)
    assert [n for n, (*_, count) in enumerate(made) if count is None] == [0, 1, 2, 3, 4]
    spread = [round(number) for number in np.linspace(0, 19, 5)]
    assert {0, 19} < set(spread)
    decides = where in spread
    single = [n for n, record in enumerate(records) if record.errors.chosen_at]
    assert len(single) == 20 - measured(20) == 13
    assert set(level_numbers(records[n] for n in single)) == {int(decides)}
    assert not set(single) & set(spread)


def test_an_error_beyond_the_tolerance_at_a_check_is_said_and_nothing_is_made_again(made):
    """The finer run of the check is returned, and the report gives the limit for the others."""
    errors = [0.01] * 40
    before = run_all(jobs_of(errors), 1, cache=False)
    chosen = {round(number) for number in np.linspace(0, 39, 5)}
    bad, other = (
        n for n, record in enumerate(before) if not record.errors.chosen_at and n not in chosen
    )
    errors[bad] = 0.3
    memory = Shared()
    made.clear()
    records = run_all(jobs_of(errors), 1, cache=False, shared=memory)
    assert len(made) == 40
    assert [run for run in made if run[2] == 2] == [(0.3, 0, 2), (0.01, 0, 2)]
    assert records[other].errors.holds
    assert level_numbers([records[bad]]) == [1]
    assert records[bad].errors.measured() == 0.3
    assert records[bad].errors.holds is False
    lines = str(memory).splitlines()
    assert "measured at 7 points and are within the tolerance at 6; the largest is 0.3" in lines[1]
    level = str(able(small(), pyfric.Options(**OPTIONS))[0])
    assert f"33 were not measured: {level} keeps the tolerance at 1 of 2 checks" in lines[2]
    assert "errors of at most 0.01, and so at 3% of the others or more (95% confidence)" in lines[2]


def test_points_without_errors_say_so(made):
    """Errors that were not measured are never 0."""
    for record in run_all(jobs_of([0.01] * 12), 1, cache=False):
        if not record.errors.chosen_at:
            continue
        assert record.errors.chosen_at == 5
        assert record.errors.measured() is None
        assert record.errors.holds is None
        assert record.errors.start is None
        assert "NOT MEASURED, its level was chosen at 5 other points" in record.summary()


def test_limits_of_shares_are_those_of_binomial_tails():
    """With the share at the limit, `kept` or more checks succeed with a chance of 5 %."""
    for kept, checks in ((2, 2), (50, 50), (47, 50), (1, 50)):
        share = lower_limit(kept, checks)
        assert scipy.stats.binom.sf(kept - 1, checks, share) == pytest.approx(0.05)
    assert lower_limit(0, 0) == lower_limit(0, 4) == 0.0


def test_points_with_other_options_choose_for_themselves(made):
    """Jobs with another tolerance choose another level."""
    easy, hard = jobs_of([0.01] * 8), jobs_of([0.2] * 8, tolerance=0.06)
    memory = Shared()
    records = run_all([*easy, *hard], 1, cache=False, shared=memory)
    chosen = [level_numbers([record]) for record in records if record.errors.chosen_at]
    assert chosen == [[0], [1]]
    assert str(memory).count("8 points") == 2


def test_a_few_points_that_fail_leave_the_choice_to_the_others(made, monkeypatch):
    planted = shared.simulate_point

    def failing(scene, *arguments, **how):
        if scene.F_N == 3000.0:
            raise RunError("the lattice folds", None)
        return planted(scene, *arguments, **how)

    monkeypatch.setattr(shared, "simulate_point", failing)
    found = run_all(jobs_of([0.01] * 12), 1, cache=False, errors="return")
    assert [n for n, each in enumerate(found) if isinstance(each, pyfric.JobError)] == [0]
    assert {record.errors.chosen_at for record in found[1:]} == {0, 4}


# --- one by one, and again -----------------------------------------------------------------------


def test_jobs_that_come_one_by_one_choose_a_level_and_are_checked_now_and_then(made):
    memory = Shared()
    for job in jobs_of([0.01] * 70):
        run_all([job], 1, cache=False, shared=memory)
    counts = [count for *_, count in made]
    assert counts[:8] == [None] * 5 + [2, 2, 1]
    assert [n for n, count in enumerate(counts) if count == 2] == [5, 6, 45, 65]
    run_all(jobs_of([0.01]), 1, cache=False, shared=memory)  # known to `shared`, but not stored
    assert made[-1] == made[0]
    assert "70 points" in str(memory)


def test_what_was_stopped_goes_on_with_the_same_choice(made, tmp_path):
    jobs = jobs_of([0.2, *[0.01] * 13])
    memory = Shared()
    whole = run_all(jobs, 1, cache=tmp_path / "whole", shared=memory)
    expected = list(made)
    made.clear()

    def stopped(done, _):
        if done == 9:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_all(jobs, 1, cache=tmp_path / "part", progress=stopped)
    again = Shared()
    found = run_all(jobs, 1, cache=tmp_path / "part", shared=again)
    assert all(map(same_run, found, whole))
    assert made == expected
    assert str(again) == str(memory)
    run_all(jobs, 1, cache=tmp_path / "part")
    assert made == expected


def test_a_list_that_grew_measures_where_it_chooses_and_replaces_what_is_too_coarse(made, tmp_path):
    run_all(jobs_of([0.01] * 13), 1, cache=tmp_path)
    more = jobs_of([*[0.01] * 13, 0.2])
    made.clear()
    records = run_all(more, 1, cache=tmp_path)
    assert sum(count is None for *_, count in made) > 1  # the last one, and others without errors
    assert set(level_numbers(record for record in records if record.errors.chosen_at)) == {1}


# --- runs ----------------------------------------------------------------------------------------


def test_one_job_alone_is_simply_verified():
    job = Job(scene=small(), t_end=T_END, options=OPTIONS)
    (record,) = run_all([job], 1, cache=False)
    expected = simulate(small(), T_END, tolerance=TOLERANCE, threads=1, progress=False)
    assert record.errors.holds
    assert same_run(record, expected, counts={})
    refused(lambda: simulate(small(), T_END, verify="shared"), "verify", "run_all", "'sample'")


def test_points_that_were_not_measured_are_within_the_tolerance(tmp_path):
    """The rest runs at the level that the few need, with errors as in the report."""
    what = swept(14, options={"tolerance": 2 * TOLERANCE})
    found = what.run(tmp_path, workers=1, progress=False)
    table = found.table
    held_back = [n for n, record in enumerate(found.outcomes) if record.errors.chosen_at]
    assert len(held_back) == 14 - measured(14) == 7
    assert table["error"].isna().sum() == 7
    assert table["level"][held_back].nunique() == 1
    for n in held_back[:4]:
        job, record = what.jobs[n], found.outcomes[n]
        of = able(job.scene, job.options)
        number = told(record, of).level
        pair = simulate_point(job.scene, T_END, job.options, first=number, count=2, progress=False)
        assert told(pair, of).errors[number] <= 2 * TOLERANCE
    assert re.search(r"precursors within 0.1: 14 points, 7 by ", found.report)
    assert found.report.count("\n") == 2
    assert what.status(tmp_path).report == found.report
    assert what.status(None).report == ""


def test_other_processes_make_the_same(tmp_path):
    found = swept(8).run(tmp_path, workers=2, progress=False).outcomes
    for record, other in zip(found, run_all(swept(8).jobs, 1, cache=False), strict=True):
        assert record.events.equals(other.events)
        assert record.method.engine == other.method.engine
        assert record.errors.chosen_at == other.errors.chosen_at
    assert sum(bool(record.errors.chosen_at) for record in found) == 8 - measured(8) == 1


def test_sweeps_share_a_verification_unless_they_say_otherwise():
    assert {job.options.verify for job in swept(2).jobs} == {"shared"}
    others = ({"verify": "sample"}, {"verify": "none"}, {"fidelity": "hybrid"}, {"method": "paper"})
    for options in others:
        expected = options.get("verify")
        assert {job.options.verify for job in swept(2, options=options).jobs} == {expected}


def test_a_named_engine_is_checked_at_some_points():
    options = {"fidelity": "hybrid", "geometry": "linear", "verify": "shared", "tolerance": 0.05}
    scenes = [small(F_N=3000.0 + n) for n in range(8)]
    records = run_all([Job(scene=s, t_end=T_END, options=options) for s in scenes], 1, cache=False)
    models = {(record.method.engine, record.method.geometry) for record in records}
    assert models == {("hybrid", "linear")}
    assert sum(record.errors.measured() is not None for record in records) == measured(8) == 7


def test_the_estimate_counts_what_is_measured(monkeypatch):
    costs = {"shared": (7200.0, 2e9), "none": (3600.0, 2e9)}
    cost = lambda scene, t_end, options: costs[options.verify]  # noqa: E731
    monkeypatch.setattr("pyfric.sweeps.sweep.expected_cost", cost)
    found = swept(100).estimate(None)
    assert measured(100) == 10
    assert (found.hours, found.GB) == pytest.approx((110.0, 200.0))


def test_a_phase_diagram_shares_a_verification_with_its_lines(made, tmp_path):
    """Map and lines have the same options, so that the map's level holds for the lines."""
    found = phase_diagram(
        small(name="0.01"),
        x=("driver.h", [2.5e-3, 5e-3]),
        y=("interface.mu_k", [0.3, 0.35, 0.4, 0.45]),
        label=lambda record: record.scene.interface.mu_k > 0.37,
        t_end=T_END,
        options={"tolerance": TOLERANCE},
        tolerance=0.01,
        cache=tmp_path,
        workers=1,
    )
    runs = 8 + int(found.lines["runs"].sum())
    assert f"{runs} points" in found.report
    assert sum(count is None for *_, count in made) == 5


def test_the_command_says_the_report(tmp_path, monkeypatch):
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "cache"))
    RANDOM.to_toml(tmp_path / "scene.toml")
    lines = ('scene = "scene.toml"', 't_end = "1.2 ms"', "[over]", '"interface.mu_s.seed" = [1, 2]')
    (tmp_path / "sweep.toml").write_text("\n".join(lines))
    done = CliRunner().invoke(main, ["sweep", str(tmp_path / "sweep.toml"), "--workers", "1"])
    assert done.exit_code == 0, done.output
    assert "precursors within 0.01: 2 points" in done.output
    assert "errors were measured at 2 points" in done.output
