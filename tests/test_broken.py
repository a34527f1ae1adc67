"""Broken scenes, options, calls and command lines all end in a documented error.

No other traceback, no warning, no hang and no file occurs. `make test-broken` tries 10 000 of them.
"""

import dataclasses
import os
import signal
import warnings
from contextlib import contextmanager
from decimal import Decimal
from fractions import Fraction
from typing import get_args

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import pyfric
from pyfric.cli.commands import main
from pyfric.engines.options import Fidelity, StepperName, Verify, Want
from pyfric.figures import sketch
from pyfric.scene import settings as scene_settings

MANY = int(os.environ.get("PYFRIC_BROKEN", "0"))
"""Number of examples; 0 means the few fixed examples of the suite."""
SECONDS = 60
"""Processor time after which an example counts as hanging, s."""
DOCUMENTED = (
    pyfric.SceneError,
    pyfric.StateError,
    pyfric.RecordError,
    pyfric.EquilibriumError,
    pyfric.RunError,
    pyfric.JobError,
)
some = settings(
    max_examples=MANY // 4 or 40,
    derandomize=not MANY,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)

SMALL = {
    "setup1": {"L": 0.01, "H": 0.005},
    "setup2": {"L": 0.004, "H": 0.002},
    "chain": {"L": 0.02},
}
KEYS = sorted({key for name in SMALL for key in scene_settings(name)})
ODD = [
    *(None, True, False, "", "x", "auto", "5 mm", "a\0b", b"x", (), [], {}, [1.0], {"a": 1}),
    *(object(), print, 1j, Decimal("nan"), Decimal(1), Fraction(1, 3), range(3), 10**400, -1, 0),
    *(float("nan"), float("inf"), -float("inf"), -1.0, -0.0, 5e-324, 1e-30, 1e300, 1e30, 2, 0.5),
    *(np.float64("nan"), np.array(1.0), np.array([1.0, np.nan]), np.int64(3), np.str_("left")),
    *("left", "rk4", "linear", "finite", "located", "dynamic", "\ud800", "9" * 5000, "fig1"),
]
odd = st.one_of(
    st.sampled_from(ODD),
    st.floats(),
    st.floats(-20, 20).map(lambda exponent: 10.0**exponent),
    st.integers(),
    st.text(max_size=12),
)


@pytest.fixture(autouse=True)
def nowhere(tmp_path, monkeypatch):
    """Return an empty folder, and check that it stays empty."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYFRIC_CACHE", str(tmp_path / "cache"))
    yield
    assert not list(tmp_path.iterdir())


@contextmanager
def in_time():
    def handler(number, frame):
        raise AssertionError(f"still at work after {SECONDS} s")

    old = signal.signal(signal.SIGPROF, handler)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, old)


def tried(call):
    """Return the result of a call, or None if it ends in a documented error."""
    with in_time(), warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "(?s).*(not be|not) (the only|unique)", RuntimeWarning)
        missing = "(?s).*static states of events were not found and are NaN"  # see build_catalogue
        warnings.filterwarnings("ignore", missing, RuntimeWarning)
        try:
            return call()
        except DOCUMENTED as error:
            assert str(error)
            return None


def small(name, changes):
    known = scene_settings(name)
    return pyfric.preset(name, SMALL[name] | {k: v for k, v in changes.items() if k in known})


@some
@given(
    st.sampled_from(sorted(SMALL)),
    st.dictionaries(st.sampled_from(KEYS), odd, min_size=1, max_size=3),
    st.sampled_from(get_args(Fidelity)),
    st.sampled_from(["linear", "finite", None]),
)
@example("setup2", {"F_N": 1.0, "V": 1.0, "d_c": 1.0}, "auto", "linear")  # blocks lift off at once
def test_scenes(name, changes, fidelity, geometry):
    """A scene is refused, or a few of its steps are made or refused.

    Heavy blocks have long steps, so the driver's path is limited to ten times that of F_N.
    """
    scene = tried(lambda: small(name, changes))
    if scene is None or scene.N_x * scene.N_z > 2000:
        return
    assert tried(lambda: pyfric.Scene.from_toml(scene.to_toml())) == scene
    dt = tried(lambda: pyfric.step_size(scene))
    if dt is None:
        return
    how = {"fidelity": fidelity, "geometry": geometry, "progress": False}
    pace = scene.driver.K * scene.driver.V
    t_end = min(20 * dt, 10 * scene.F_N / pace) if pace else 20 * dt
    record = tried(lambda: pyfric.simulate(scene, t_end, **how))
    assert record is None or np.isfinite(record.curve.to_numpy()).all()


OPTIONS = [one.name for one in dataclasses.fields(pyfric.Options) if one.name != "checkpoint"]
WORDS = [word for kind in (Fidelity, StepperName, Verify, Want) for word in get_args(kind)]
options = st.dictionaries(
    st.sampled_from([*OPTIONS, *OPTIONS, "Fidelity", "thread", "", "self"]),
    odd | st.sampled_from(["paper", "finite", "located", *WORDS]),
    min_size=1,
    max_size=4,
)


@some
@given(options, odd)
def test_options(given_options, t_end):
    scene, dt = small("setup1", {}), 1e-6
    if isinstance(t_end, int | float) and abs(t_end) > 100 * dt:
        t_end = 100 * dt
    tried(lambda: pyfric.simulate(scene, t_end, **given_options | {"progress": False}))
    tried(lambda: pyfric.Job(scene=scene, t_end=t_end, options=given_options))


CALLS = {
    "simulate": lambda a, b, c: pyfric.simulate(a, 0.0, b, initial=c, progress=False),
    "plan": lambda a, b, c: pyfric.plan(small("setup1", {}), a, b, t_end=c),
    "plan a scene": lambda a, b, c: pyfric.plan(a, t_end=0.0),
    "preset": lambda a, b, c: pyfric.preset(a, h=b, k=c),
    "Scene": lambda a, b, c: pyfric.Scene(slider=a, top=b, driver=c, interface=a),
    "from_toml": lambda a, b, c: pyfric.Scene.from_toml(a),
    "prediction_curve": lambda a, b, c: pyfric.prediction_curve(small("setup1", {}), a),
    "prediction_curve of": lambda a, b, c: pyfric.prediction_curve(a, b),
    "loaded_state": lambda a, b, c: pyfric.loaded_state(small("setup1", {}), a),
    "loaded_state of": lambda a, b, c: pyfric.loaded_state(a),
    "stability_limit": lambda a, b, c: pyfric.stability_limit(small("setup2", {}), a),
    "stability_limit of": lambda a, b, c: pyfric.stability_limit(a),
    "step_size": lambda a, b, c: pyfric.step_size(small("setup2", {}), a, b),
    "run_all": lambda a, b, c: pyfric.run_all([a], workers=b, cache=False),
    "sketch": lambda a, b, c: sketch(a) if not isinstance(a, str) else None,
    "Record.load": lambda a, b, c: pyfric.Record.load(a),
}


@some
@given(st.sampled_from(sorted(CALLS)), odd, odd, odd)
def test_calls(name, a, b, c):
    try:
        tried(lambda: CALLS[name](a, b, c))
    except FileNotFoundError:
        assert name == "Record.load"


WORDS = [
    *(
        "run",
        "plan",
        "scene",
        "draw",
        "movie",
        "claims",
        "info",
        "fig1",
        "setup2",
        "chain",
        "x.toml",
    ),
    *("--t-end", "--set", "--fidelity", "--dt", "--sample", "--want", "--tolerance", "--geometry"),
    *(
        "--stepper",
        "--switching",
        "--rtol",
        "--threads",
        "--json",
        "--event",
        "--resume",
        "--nothing",
    ),
    *("h=3 kg", "h=", "=", "L=nan", "name=x", "mu_k=2", "theta=1", "side=up", "p=1", "M=-1 g"),
    *("1", "-1", "0.1 ms", "1e-5", "nan", "inf", "1e400", "5 kg", "auto", "rk4", "", "\0", "99"),
]


@some
@given(
    st.sampled_from(["run", "plan", "scene", "draw", "movie"]),
    st.lists(st.sampled_from(WORDS) | st.text(max_size=6), max_size=7),
)
def test_command_lines(command, words):
    """A single wrong word makes the line broken; such a line writes nothing and starts nothing."""
    done = CliRunner()
    with in_time():
        result = done.invoke(main, [command, *words, "--set", "h=3 kg"])
    assert result.exit_code == 2, result.output
    assert isinstance(result.exception, SystemExit | None)
    assert "Traceback" not in result.output
