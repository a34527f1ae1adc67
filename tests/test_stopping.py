"""Runs with conditions for their end have the bits of runs without."""

import functools

import numpy as np
import pytest
from click.testing import CliRunner
from helpers import refused, small, small_rod

import pyfric
from pyfric.cli.commands import main
from pyfric.engines.stopping import CONDITIONS, Stopping, ended_by_condition, force_to_come
from pyfric.record import build_catalogue
from pyfric.scene.ends import TAKES
from pyfric.sweeps import Job, Sweep

N = 100
K, M = 1e6, 1e-3
"""Stiffness of the springs, N/m, and mass of a block, kg, of chains; their blocks are 1 mm long."""
UNIT = np.sqrt(M / K)


def pushed(tau_bar, alpha):
    """Return a chain whose first block is at its threshold, under a very slow driver."""
    tau = np.full(N, 0.45 + 0.25 * tau_bar)
    tau[0] = 0.7
    lattice = {"L": (N - 1) * 1e-3, "l": 1e-3, "k": K, "M": N * M, "eta": 0.0}
    return pyfric.chain(p=1.0, tau=tau, K=1e-10, V=1e-3, alpha=alpha * np.sqrt(K * M), **lattice)


def two_runs(scene, t_end, stop_when, **options):
    """Return a run with conditions, and one without; check that the first is a part of it."""
    ended = pyfric.simulate(scene, t_end, stop_when=stop_when, **options)
    whole = pyfric.simulate(scene, t_end, **options)
    assert ended.curve.equals(whole.curve[: len(ended.curve)])
    for log in ("switches", "quiet"):
        for name, values in getattr(ended, log).items():
            np.testing.assert_array_equal(values, getattr(whole, log)[name][: len(values)])
    return ended, whole


HOW = {
    "dynamic": {"fidelity": "dynamic", "geometry": "linear"},
    "hybrid": {"fidelity": "hybrid", "geometry": "linear"},
    "quasistatic": {"fidelity": "quasistatic"},
}
ENGINES = pytest.mark.parametrize("engine", HOW)


@pytest.mark.usefixtures("coarse_curves")
@pytest.mark.parametrize("engine", ["dynamic", "hybrid"])
def test_a_front_that_arrests(engine):
    ended, whole = two_runs(small(), 6e-3, "arrested", **HOW[engine])
    assert ended.status == "ended by stop_when (arrested)"
    assert whole.status == "complete"
    assert len(ended.events) == 1 < len(whole.events)
    assert ended.events.equals(whole.events[:1])
    assert ended.events["finished"].all()
    assert ended.final_state.t == ended.curve["t"].iloc[-1] < whole.final_state.t


@ENGINES
def test_a_front_that_gets_somewhere(engine):
    scene = small()
    for text, least in (("reached = 10 mm", 5), ("L_p = 0.5", 5)):
        ended, _ = two_runs(scene, 3e-3, text, **HOW[engine])
        assert ended.status == f"ended by stop_when ({text})"
        touched = ended.scene.n_of_i[np.unique(ended.switches["block"])]
        assert touched.max() >= least
        assert ended.curve["t"].iloc[-1] < 1.2e-3


@pytest.mark.parametrize("engine", ["hybrid", "quasistatic"])
def test_counted_events(engine):
    ended, whole = two_runs("fig1", 0.4, ["system_size", "precursors = 2"], **HOW[engine])
    assert ended.status == "ended by stop_when (precursors = 2)"
    events = ended.events
    assert events.equals(whole.events[: len(events)])
    assert (events["is_main"] & events["is_precursor"] & events["finished"]).sum() == 2
    assert len(whole.events) > len(events)


COUNTED = {"main_events": "is_main", "precursors": "is_precursor", "system_size": "L_p_over_L"}


@pytest.mark.usefixtures("coarse_curves")
@pytest.mark.parametrize("goes_on", [False, True])
@pytest.mark.parametrize(
    "engine", [pytest.param("dynamic", marks=pytest.mark.slow), "hybrid", "quasistatic"]
)
def test_events_are_counted_as_by_their_catalogue(engine, goes_on, monkeypatch):
    """The run does not end before its catalogue has the number of events."""
    ended = Stopping.ended

    def checked(seen, which, n):
        found = ended(seen, which, n)
        if seen._logs:
            events = seen.events[seen.events["is_main"] & seen.events["finished"]]
            assert (found == np.inf) == ((events[which] == 1).sum() < n)
        return found

    monkeypatch.setattr(Stopping, "ended", checked)
    scene, how = small(V=0.2), HOW[engine] | {"t_gap": 1e-4}
    before = pyfric.simulate(scene, 1.0, stop_when="arrested", **how) if goes_on else None
    t_end = 0.007 + (before.curve["t"].iloc[-1] if goes_on else 0.0)
    conditions = [f"{name} = {n}" for name in COUNTED for n in (1, 2, 99)]
    for k in (0, 1, 4, 6, 7):  # other numbers end the run at the same steps
        assert pyfric.simulate(scene, t_end, initial=before, stop_when=conditions[k:], **how).done


def test_catalogues_are_made_where_they_can_count(monkeypatch):
    built = []

    def counted(*args, **how):
        built.append(args)
        return build_catalogue(*args, **how)

    monkeypatch.setattr("pyfric.engines.stopping.build_catalogue", counted)
    for n, most in ((99, 0.0), (5, 0.5)):
        record = pyfric.simulate(
            small_rod(V=0.02), 0.04, stop_when=f"main_events = {n}", **HOW["hybrid"]
        )
        rests = (record.quiet["kind"] < 0).sum()
        assert len(record.events) > 10
        assert len(built) <= most * rests


def test_slip_that_is_slow():
    """The run ends after a time without faster slip; with a high limit, right after this time."""
    ended, _ = two_runs("fig1", 0.4, "slow = 1 um/s, 20 ms", **HOW["hybrid"])
    last = ended.events["t_stop"].max()
    assert 0.02 <= ended.curve["t"].iloc[-1] - last < 0.02 + 2 * 0.4 / 500
    ended, _ = two_runs(small(), 3e-3, "slow = 1 km/s, 0.1 ms", **HOW["dynamic"])
    last = ended.episodes["t_start"].max()
    assert 1e-4 <= ended.curve["t"].iloc[-1] - last < 1e-4 + 2 * 3e-3 / 500


def test_creep_comes_to_rest():
    """With alpha = 4 sqrt(k m) blocks behind a front never stop, but no further block starts."""
    tau = np.where(np.arange(N) < 20, 0.6, 0.31)  # mu_k p is 0.45 N
    scene, t_end = pushed(0.5, 4.0).replace({"top.tau": (0.7, *tau[1:])}), 2e4 * UNIT
    ended, whole = two_runs(scene, t_end, "arrested", fidelity="dynamic")
    assert ended.status == "ended by stop_when (arrested)"
    assert (abs(ended.final_state.mode) == 1).any()
    assert ended.curve["t"].iloc[-1] < t_end / 2
    assert 20 < len(ended.switches["block"]) < 60
    assert len(whole.switches["block"]) == len(ended.switches["block"])  # no further slip starts


def test_at_rest_knows_what_the_driver_still_does():
    scene = pushed(0.02, 0.3)
    t_end, times = 600 * UNIT, []
    for V in (1e-3, 0.5):
        pushes = scene.replace({"driver.K": 10.0, "driver.V": V})
        ended, _ = two_runs(pushes, t_end, "at_rest", fidelity="dynamic")
        assert ended_by_condition(ended)
        times.append(ended.curve["t"].iloc[-1])
        weakest = ended.final_state.margin.min()
        assert 10.0 * V * (t_end - times[-1]) < weakest
    assert 10.0 * V * (t_end - times[0]) > weakest
    assert times[1] > times[0]


@pytest.mark.usefixtures("coarse_curves")
def test_the_same_step_however_calls_are_cut(monkeypatch):
    """The clock has no effect: calls of the core of another length end a run at the same step."""
    first = pyfric.simulate(small(), 6e-3, stop_when="arrested", **HOW["dynamic"])
    monkeypatch.setattr("pyfric.engines.guarded.CALL_SECONDS", 1e-6)
    monkeypatch.setattr("pyfric.engines.guarded.STEPS", 17)
    again = pyfric.simulate(small(), 6e-3, stop_when="arrested", **HOW["dynamic"])
    assert again.final_state == first.final_state


@pytest.mark.usefixtures("coarse_curves")
@pytest.mark.parametrize("engine", ["dynamic", "hybrid", "quasistatic"])
def test_runs_go_on(engine):
    scene, how = ("fig1", HOW[engine]) if engine != "dynamic" else (small(), HOW[engine])
    t_end = 0.4 if engine != "dynamic" else 6e-3
    ended, whole = two_runs(scene, t_end, "arrested", **how)
    on = pyfric.simulate(ended.scene, t_end, initial=ended)
    assert on.status == "complete"
    assert len(on.events) == len(whole.events)
    if engine == "dynamic":
        assert on.final_state == whole.final_state
    second = pyfric.simulate(ended.scene, t_end, initial=ended, stop_when="arrested")
    assert ended_by_condition(second) or second.done
    assert len(second.events) > len(ended.events)  # counted from the end of the first run


@pytest.mark.parametrize("engine", ["quasistatic", "hybrid"])
def test_a_record_that_goes_on_keeps_what_it_has(engine):
    """A condition may have held before the record's end, or t_end may be earlier."""
    how = {"fidelity": engine, "progress": False}
    before = pyfric.simulate("fig1", 0.3, **how)
    with pytest.raises(pyfric.SceneError, match=r"t_end = 0\.1 s: too small; .*>= 0\.3"):
        pyfric.simulate("fig1", 0.1, initial=before, progress=False)
    after = pyfric.simulate("fig1", 0.5, initial=before, stop_when="precursors = 1", progress=False)
    assert after.status == "ended by stop_when (precursors = 1)"
    assert after.curve["t"].iloc[-1] >= before.curve["t"].iloc[-1]
    kept = after.events["F_T_start"].iloc[: len(before.events)]
    assert kept.to_numpy() == pytest.approx(before.events["F_T_start"].to_numpy(), rel=1e-8)


def test_refused_conditions():
    options = functools.partial(pyfric.Options)
    for text, said in (
        ("arested", "did you mean 'arrested'"),
        ("reached", "takes 1 numbers"),
        ("reached = 5 s", "wrong unit"),
        ("L_p = 2", "too large"),
        ("precursors = 0", "too small"),
        ("main_events = 1.5", "whole number"),
        ("slow = 1 m/s", "takes 2 numbers"),
        ("arrested = 3", "takes 0 numbers"),
        (3, "a list of texts"),
    ):
        refused(lambda text=text: options(stop_when=text), "stop_when", said)
    beyond = {"stop_when": "reached = 5", "progress": False}
    refused(lambda: pyfric.simulate("fig1", 1.0, **beyond), "stop_when", "beyond the interface")
    junctions = {"stop_when": "at_rest", "progress": False}
    refused(lambda: pyfric.simulate("slow", 1e-4, **junctions), "stop_when", "no threshold")
    assert options(stop_when=["arrested"]).stop_when == ("arrested",)
    assert options(stop_when=()).stop_when == ()
    assert all(due.__doc__ for due in CONDITIONS.values())
    assert set(CONDITIONS) == set(TAKES)


def test_command_line_jobs_and_sweeps(tmp_path):
    out = tmp_path / "a.nc"
    command = ["run", "fig1", "--t-end", "0.4", "--fidelity", "quasistatic", "--out", str(out)]
    done = CliRunner().invoke(main, [*command, "--stop-when", "main_events = 1"])
    assert done.exit_code == 0
    record = pyfric.Record.load(out)
    assert record.status == "ended by stop_when (main_events = 1)"
    assert record.status in done.output
    jobs = [Job(scene="fig1", t_end=0.4, options={"stop_when": one}) for one in (None, "arrested")]
    assert len({job.key for job in jobs}) == 2
    file = tmp_path / "sweep.toml"
    file.write_text(
        'scene = "fig1"\nt_end = "0.4 s"\n[over]\n"driver.h" = ["5 mm"]\n'
        '[options]\nfidelity = "quasistatic"\nstop_when = ["arrested", "precursors = 1"]\n'
    )
    (outcome,) = Sweep.from_toml(file).run(cache=tmp_path, workers=1, progress=False).outcomes
    assert outcome.status == "ended by stop_when (arrested)"


# --- in scene files and sweep files --------------------------------------------------------------


@pytest.mark.usefixtures("coarse_curves")
def test_conditions_of_a_scene_end_its_runs():
    """A scene may have conditions; conditions of a run, or (), replace them."""
    scene, how = small(stop_when="arrested"), HOW["dynamic"]
    plain = small()
    assert scene.stop_when == ("arrested",)
    assert scene != plain
    ended = pyfric.simulate(scene, 6e-3, **how)
    same = pyfric.simulate(plain, 6e-3, stop_when="arrested", **how)
    assert ended.status == same.status == "ended by stop_when (arrested)"
    assert ended.final_state == same.final_state
    other = pyfric.simulate(scene, 6e-3, stop_when="reached = 10 mm", **how)
    assert other.status == "ended by stop_when (reached = 10 mm)"
    whole = pyfric.simulate(scene, 6e-3, stop_when=(), **how)
    assert whole.status == "complete"
    on = pyfric.simulate(plain, 6e-3, initial=ended, **how)
    assert on.final_state == whole.final_state  # without the conditions, from the record with them
    assert "ends when: arrested" in repr(scene)


@pytest.mark.parametrize("engine", ["hybrid", "quasistatic"])
def test_conditions_of_a_scene_in_the_other_engines(engine):
    scene = pyfric.preset("fig1", stop_when=["precursors = 2"])
    ended = pyfric.simulate(scene, 0.4, **HOW[engine])
    same = pyfric.simulate("fig1", 0.4, stop_when="precursors = 2", **HOW[engine])
    assert ended.status == same.status == "ended by stop_when (precursors = 2)"
    assert ended.events.equals(same.events)


def test_plans_and_estimates_count_with_those_of_a_scene():
    scene = pyfric.preset("fig1", stop_when="precursors")
    whole, part = (pyfric.plan("fig1", t_end=0.8, stop_when=one) for one in (None, "precursors"))
    assert part.t_end < 0.5 * whole.t_end
    assert part.seconds[2] < 0.5 * whole.seconds[2]
    assert pyfric.plan(scene, t_end=0.8).seconds == part.seconds
    assert pyfric.plan(scene, t_end=0.8, stop_when=()).seconds == whole.seconds
    costs = []
    for one in (scene, "fig1"):
        sweep = Sweep(scene=one, t_end=1.5, over={"driver.h": [5e-3]}, options=HOW["hybrid"])
        costs.append(sweep.estimate(cache=None).hours)
    assert costs[0] < 0.5 * costs[1]


def test_conditions_in_scene_files(tmp_path):
    """Conditions are at the top of a file, and are refused with the same message."""
    scene = small(stop_when=["arrested", "reached = 10 mm"])
    file = tmp_path / "scene.toml"
    text = scene.to_toml(file)
    assert 'stop_when = [\n    "arrested",\n    "reached = 10 mm",\n]' in text
    assert pyfric.Scene.from_toml(file) == scene
    assert pyfric.Scene.from_toml(text).replace(stop_when=()) == small()
    assert "stop_when" not in small().to_toml()
    one = 'stop_when = "L_p = 0.5"\n' + small().to_toml()
    assert pyfric.Scene.from_toml(one).stop_when == ("L_p = 0.5",)
    for given, said in (
        ('"arested"', "did you mean 'arrested'"),
        ('["reached"]', "takes 1 numbers"),
        ('"reached = 5 s"', "wrong unit"),
        ('"L_p = 2"', "too large"),
        ("3", "a list of texts"),
    ):
        bad = f"stop_when = {given}\n" + small().to_toml()
        refused(lambda bad=bad: pyfric.Scene.from_toml(bad), "stop_when", said)
    record = pyfric.simulate(file, 6e-3, **HOW["dynamic"])
    assert record.status == "ended by stop_when (reached = 10 mm)"
    record.save(tmp_path / "a.nc")
    assert pyfric.Record.load(tmp_path / "a.nc").scene == scene


def test_scene_files_on_the_command_line(tmp_path):
    """Conditions on the command line replace the file's; a run can go on to the next condition."""
    scene, out = pyfric.preset("fig1", stop_when="main_events = 1"), str(tmp_path / "a.nc")
    scene.to_toml(tmp_path / "scene.toml")
    command = ["run", str(tmp_path / "scene.toml"), "--t-end", "0.4", "--fidelity", "quasistatic"]
    ends = []
    for more in ([], ["--resume"], ["--resume", "--set", "stop_when=[]"]):
        done = CliRunner().invoke(main, [*command, "--out", out, *more])
        assert done.exit_code == 0, done.output
        ends.append(pyfric.Record.load(out).curve["t"].iloc[-1])
    assert ends[0] < ends[1] < ends[2] == 0.4
    done = CliRunner().invoke(main, [*command, "--stop-when", "precursors = 2"])
    assert "ended by stop_when (precursors = 2)" in done.output
    command = ["plan", str(tmp_path / "scene.toml"), "--t-end", "0.2", "--json"]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0


@pytest.mark.usefixtures("coarse_curves")
def test_conditions_in_sweep_files(tmp_path):
    """Conditions may belong to the scene or to all runs, or vary; each run has its own key."""
    small(stop_when="reached = 10 mm").to_toml(tmp_path / "scene.toml")
    head = 'scene = "scene.toml"\nt_end = "6 ms"\n'
    options = '[options]\nfidelity = "dynamic"\ngeometry = "linear"\n'
    file = tmp_path / "sweep.toml"
    file.write_text(f'{head}[over]\nmu_s = [0.7]\nstop_when = [["arrested"], []]\n{options}')
    how = {"cache": tmp_path / "cache", "workers": 1, "progress": False}
    results = Sweep.from_toml(file).run(**how)
    ends = [one.status for one in results.outcomes]
    assert ends == ["ended by stop_when (arrested)", "complete"]
    file.write_text(f"{head}[over]\nmu_s = [0.7]\n{options}")
    (outcome,) = Sweep.from_toml(file).run(**how).outcomes
    assert outcome.status == "ended by stop_when (reached = 10 mm)"
    file.write_text(f'{head}[over]\nmu_s = [0.7]\n{options}stop_when = "arested"\n')
    refused(lambda: Sweep.from_toml(file), "stop_when", "did you mean 'arrested'")


def test_a_driver_that_comes_back_counts_where_it_turns():
    scene = pyfric.preset("fig1", V=0.0).replace(
        {"driver.V": 1e-3, "driver.protocol": ((2.0, -1e-3), (4.0, 1e-3))}
    )
    far = scene.drive(1.0)  # V is 0 there
    assert force_to_come(scene, 0.0, 2.0) == pytest.approx(scene.driver.K * far)
    assert scene.drive(2.0) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("condition", ["arrested", "at_rest"])
def test_a_front_from_released_blocks_is_not_at_rest(condition):
    scene = pyfric.chain(L=0.0475, p=10.0, tau=6.25, K=0.0, V=0.0)
    how = {"fidelity": "dynamic", "initial": pyfric.released(scene, 5), "progress": False}
    ended, whole = two_runs(scene, 1e-4, condition, **how)
    assert np.isfinite(whole.rupture_times[0]).sum() == scene.N_x - 5
    assert np.isfinite(ended.rupture_times[0]).sum() == scene.N_x - 5


def test_released_blocks_count_as_slipping():
    scene = pyfric.chain(L=0.0475, p=10.0, tau=6.25, K=0.0, V=0.0)
    how = {"fidelity": "dynamic", "initial": pyfric.released(scene, 5), "progress": False}
    for condition in ("reached = 5 mm", "L_p = 0.25"):
        record = pyfric.simulate(scene, 1e-4, stop_when=condition, **how)
        assert ended_by_condition(record)
        assert record.curve["t"].iloc[-1] < 1e-5
