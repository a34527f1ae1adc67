"""Every error of the package keeps message, attributes and notes between processes."""

import importlib
import pickle
import pkgutil

import numpy as np
import pytest

import pyfric
from pyfric.checks.verify import _OutOfTime
from pyfric.engines.guarded import Failure
from pyfric.fitting.fits import _Unlike
from pyfric.sweeps.runs import Unwanted


def run_error():
    record = pyfric.simulate(pyfric.setup1(L=0.02, H=0.0125), 1e-5, progress=False)
    error = pyfric.RunError("the motion is not finite", record)
    error.record = record  # the planner replaces the record
    return error


EXAMPLES = {
    pyfric.EquilibriumError: lambda: pyfric.EquilibriumError("no way", np.nan, 1e-9, 7),
    pyfric.JobError: lambda: pyfric.JobError(
        pyfric.Job(scene=pyfric.preset("fig1"), t_end=0.1), run_error()
    ),
    pyfric.RecordError: lambda: pyfric.RecordError("a.nc: no record"),
    pyfric.RunError: run_error,
    pyfric.SceneError: lambda: pyfric.SceneError(
        "h", 2.0, "m", "less", "too high", [pyfric.SceneError("l", 3, "m", "a number")]
    ),
    pyfric.StateError: lambda: pyfric.StateError("no state"),
    Failure: lambda: Failure("a block jumped"),
    _OutOfTime: lambda: _OutOfTime("not made within 60 s"),
    _Unlike: lambda: _Unlike("events scatter as those of the model do not"),
    Unwanted: Unwanted,
}


def all_errors():
    """Return every exception that a module of the package defines."""
    found = set()
    for module in pkgutil.walk_packages(pyfric.__path__, "pyfric."):
        if "._core" in module.name or module.name.endswith("__main__"):
            continue
        for value in vars(importlib.import_module(module.name)).values():
            if isinstance(value, type) and issubclass(value, BaseException):
                found.add(value)
    return {one for one in found if one.__module__.startswith("pyfric")}


def test_there_is_an_example_of_every_error():
    assert all_errors() == set(EXAMPLES)


@pytest.mark.parametrize("kind", EXAMPLES, ids=lambda kind: kind.__name__)
def test_errors_travel(kind):
    error = EXAMPLES[kind]()
    error.add_note("seen by a test")
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is kind
    assert str(back) == str(error)
    assert vars(back).keys() == vars(error).keys()
    assert back.__notes__ == ["seen by a test"]


def test_a_run_error_brings_its_record():
    error = run_error()
    assert pickle.loads(pickle.dumps(error)).record == error.record
    job = pyfric.Job(scene=pyfric.preset("fig1"), t_end=0.1)
    back = pickle.loads(pickle.dumps(pyfric.JobError(job, error)))
    assert back.job == job
    assert back.error.record == error.record


def test_an_equilibrium_error_brings_its_numbers():
    back = pickle.loads(pickle.dumps(pyfric.EquilibriumError("no way", 2.0, 1e-9, 7)))
    assert (back.residual, back.limit, back.iterations) == (2.0, 1e-9, 7)


def test_a_scene_error_brings_its_attributes():
    back = pickle.loads(pickle.dumps(EXAMPLES[pyfric.SceneError]()))
    assert (back.field, back.value, back.unit, back.allowed) == ("h", 2.0, "m", "less")
    assert [other.value for other in back.others] == [3]
