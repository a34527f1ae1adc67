"""Helpers for tests of several modules: small scenes, short calls of the core, comparisons."""

import contextlib
import dataclasses
import importlib
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import pytest

import pyfric
from pyfric import core
from pyfric.core import OPEN
from pyfric.record import budget_left
from pyfric.record.layout import SEAL, seal
from pyfric.record.netcdf import read_image
from pyfric.scene import setup1, setup2
from pyfric.statics import damping, loaded_state, mass, stiffness
from pyfric.values import SceneError

GEOMETRIES = ("linear", "finite")
ENERGY_IN = ["work_driver", "work_load"]
ENERGY_OUT = ["dissipated_bonds", "friction_heat", "switching_loss"]

WATCHED = """
import sys
sys.stderr.isatty = lambda: True
from pyfric.cli import start
start()
"""
"""The command line as in a terminal, where it shows progress."""

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
STUDIES = runpy.run_path(str(Path(__file__).parents[1] / "studies"))["main"]
"""The commands of `python studies`."""


def peer(name):
    """Return another program's module; without it skip the test, except in `make test-peers`."""
    there = "PYFRIC_PEERS" in os.environ
    return importlib.import_module(name) if there else pytest.importorskip(name)


# --- scenes --------------------------------------------------------------------------------------


def small(kind="rod", **changes):
    """A scene of 9 x 6 or 13 x 6 blocks, driven so fast that it slips after 1.1 ms."""
    if kind == "rod":
        return setup1(**{"L": 0.02, "H": 0.0125, "V": 0.5} | changes)
    return setup2(**{"L": 0.012, "H": 0.005, "theta": 0.5, "V": 0.3} | changes)


def small_rod(**changes):
    """13 x 7 blocks under a rod, with the paper's V."""
    return setup1(**{"L": 0.03, "H": 0.015} | changes)


def small_free(**changes):
    """21 x 7 blocks under a distributed load, with the paper's V."""
    return setup2(**{"L": 0.02, "H": 0.006} | changes)


def mirrored_scene(scene):
    swapped = {"left": "right", "right": "left"}
    side = " ".join(swapped.get(word, word) for word in scene.driver.side.split())
    return dataclasses.replace(scene, driver=dataclasses.replace(scene.driver, side=side))


def scaled(scene, factor):
    """Return the scene with F_N and V multiplied by `factor`."""
    top = dataclasses.replace(scene.top, F_N=factor * scene.F_N)
    driver = dataclasses.replace(scene.driver, V=factor * scene.driver.V)
    return dataclasses.replace(scene, top=top, driver=driver)


# --- states and the core -------------------------------------------------------------------------


def advance(scene, geometry, state, n, **options):
    """Make n steps; return the log, which is large enough for all switches."""
    log = core.Log(scene.N_x, 200_000, 20_000)
    model = core.model(scene, geometry, state.u_drv0)
    assert core.advance(model, state, log, n, **options) == core.Status.DONE
    return log


def shaken(scene, geometry, dt, size=1e-7, seed=0):
    """Return the loaded state with random velocities; nothing slips soon."""
    state = loaded_state(scene, geometry).state(scene, dt)
    rng = np.random.default_rng(seed)
    state.y[:, 2:] = size * rng.standard_normal((scene.N_z, 2, scene.N_x)) / dt
    state.y[0, 2] = 0
    if scene.rigid:
        state.y[-1, 2:] = 0
    return state


def mirrored_state(state):
    """Return the state of the mirrored scene."""
    sign = np.array([-1.0, 1.0, -1.0, 1.0])[None, :, None]
    new = state.copy()
    new.y = np.ascontiguousarray(sign * state.y[:, :, ::-1])
    new.rod = state.rod * np.array([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0])
    new.mode = np.where(state.mode == OPEN, OPEN, -state.mode)[::-1].astype(np.int32)
    for name in ("corner", "margin", "loss", "heat", "memory"):
        setattr(new, name, np.ascontiguousarray(getattr(state, name)[::-1]))
    new.u_drv0, new.spring = -state.u_drv0, state.spring * [1, -1, 1, 1]
    return new


def bits(state):
    values = dataclasses.asdict(state)
    return {n: v.tobytes() if isinstance(v, np.ndarray) else v for n, v in values.items()}


def log_bits(log):
    return [a.tobytes() for table in (log.switches(), log.quiet()) for a in table.values()]


# --- records and processes -----------------------------------------------------------------------


def budget_error(record):
    """Return the largest error of the energy budget of a record, in J."""
    return budget_left(record.curve).abs().max()


def same_run(one, other, **apart):
    """Check that records hold the same run; timings, and entries named in `apart`, may differ."""
    drop = {"timings": {}} | apart
    return dataclasses.replace(one, **drop) == dataclasses.replace(other, **drop)


def refused(call, field, *texts, value=None, unit=None, within=()):
    """Check that a call refuses this field, with a message that contains these texts.

    Value and unit of the error are checked, too, and numbers in its allowed range.
    """
    with pytest.raises(SceneError) as caught:
        call()
    error = caught.value
    assert error.field == field
    for text in texts:
        assert text in str(error)
    if value is not None:
        assert error.value == (value if isinstance(value, str) else pytest.approx(value, rel=1e-9))
    if unit is not None:
        assert error.unit == unit
    assert set(within) <= {float(number) for number in NUMBER.findall(error.allowed)}


def run_python(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )


# --- files ---------------------------------------------------------------------------------------


@contextlib.contextmanager
def edited(path):
    """Open a record file for changes, and seal it again."""
    with h5netcdf.File(path, "a") as file:
        yield file
    seal_again(path)


def seal_again(path):
    """Seal a record file after a change of its content; an unreadable file stays as it is."""
    with contextlib.suppress(ValueError, OSError):
        attributes, values = read_image(path.read_bytes())
        with h5py.File(path, "a") as file:
            file.attrs[SEAL] = seal(values, attributes)


def operators(scene, closed=None):
    """M (diagonal), K and C of the linear geometry, without friction."""
    return mass(scene), stiffness(scene, closed=closed), damping(scene)


def dynamic(scene, t_end, **options):
    """A run by full dynamics in linear geometry."""
    how = {"fidelity": "dynamic", "geometry": "linear", "progress": False} | options
    return pyfric.simulate(scene, t_end, **how)


def first_slips(record):
    """Return times of first slips, from the trailing edge on; NaN for blocks that never slip."""
    first = record.episodes.groupby("n")["t_start"].min()
    return first.reindex(range(1, record.scene.N_x + 1)).to_numpy()
