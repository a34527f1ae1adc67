"""The longest pause inside an event: the paper's scenes, its three time scales, and the note.

A scene in other units has the same pause and time step.
"""

import re

import numpy as np
import pytest
from helpers import scaled

import pyfric
from pyfric.engines.pauses import longest_pause, pause_notes
from pyfric.record import build_catalogue
from pyfric.scene import PRESETS, preset, setup1, setup2

OTHERS = ("burridge_knopoff", "rate_and_state", "rate_and_state_pmma", "run4", "slow", "tpv3")
"""Presets with other F_N or V than a setup of the paper."""


def test_the_papers_scenes_keep_a_millisecond():
    scenes = [preset(name) for name in PRESETS if name not in OTHERS]
    scenes += [setup1(h=h) for h in (2.5e-3, 15e-3)]
    np.testing.assert_allclose([longest_pause(one) for one in scenes], 1e-3, rtol=1e-12)


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (setup2(V=0.01), 0.3296e-3),  # 3 transits; the driver adds 0.9e-3 F_N in 0.05 ms
        (
            setup1(V=7.875e-3),
            0.4230e-3,
        ),  # 0.9e-3 * 3500 N/(4e6 N/m * 7.875 mm/s) = 0.1 ms, transits
        (setup1(F_N=1750.0), 0.5e-3),  # half the force, half the time
        (setup1(V=1e-6), 18.65e-3),  # 4 times 4.66 ms
        (setup1(V=7.875e-5, eta=0.0), 10e-3),  # the driver alone decides
        (setup1(V=0.0), 0.4230e-3),  # 3 transits decide alone
        (preset("tpv3"), 15.50),
    ],
)
def test_three_times_of_a_scene(scene, expected):
    assert longest_pause(scene) == pytest.approx(expected, rel=2e-4)
    if not scene.prescribed:
        assert longest_pause(scaled(scene, 2.0)) == pytest.approx(longest_pause(scene), rel=1e-12)


@pytest.fixture(scope="module")
def record():
    return pyfric.simulate(setup2(L=0.02, H=0.006, V=0.02), 0.05, fidelity="quasistatic")


def test_a_record_says_where_the_number_of_events_hangs_on_it(record):
    logs = record.switches, record.quiet, record.scene

    def count(t_gap):
        return int(build_catalogue(*logs, t_gap=t_gap).events["is_main"].sum())

    assert record.method.t_gap == longest_pause(record.scene)
    seen = []
    for t_gap in (1e-5, 3e-4, 1e-3):
        one = pyfric.simulate(record.scene, 0.05, fidelity="quasistatic", t_gap=t_gap)
        numbers = [count(factor * t_gap) for factor in (0.5, 1, 2)]
        noted = "{}, {} and {} with".format(*numbers)
        apart = max(numbers) - min(numbers) > 1
        assert any(noted in note for note in one.notes) == apart
        assert pause_notes(one) == tuple(note for note in one.notes if noted in note)
        seen.append(apart)
    assert seen == [False, True, True]
    assert count(1e-5) > count(2e-3) + 1


# --- other units ---------------------------------------------------------------------------------

TEXT = re.compile(r'"(\S+) ([A-Za-z0-9 /^]+)"')
SMALL = {"L": 0.05, "H": 0.02, "F_N": 700.0}
SMALL2 = {"L": 0.04, "H": 0.01, "F_N": 160.0}
HOLD = ((4e-3, 20e-3), (4e-3, 0.0))
UNITS = {
    "powers of two": (2.0**10, 2.0**-5, 2.0**4),
    "mm, ms, g": (1e3, 1e3, 1e3),
    "cm, s, g": (1e2, 1.0, 1e3),
}
"""Systems of units -> numbers of their units in 1 m, 1 s and 1 kg."""
SCENES = {
    "fast rod": (setup1(**SMALL, V=20e-3), 6e-3, "dynamic"),
    "finite": (setup1(**SMALL, V=10e-3), 8e-3, "hybrid"),
    "slow rod": (setup1(**SMALL, V=1e-3), 0.1, "hybrid"),
    "hold": (setup1(**SMALL, V=20e-3).replace({"driver.protocol": HOLD}), 6e-3, "dynamic"),
    "weakening": (setup1(**SMALL, V=20e-3, d_c=1e-6, alpha=1.0), 8e-3, "dynamic"),
    "disorder": (setup1(**SMALL, V=20e-3, mu_s=pyfric.Spread(mean=0.7, range=0.05, seed=3)), 5e-3,
                 "dynamic"),
    "setup2": (setup2(**SMALL2, V=20e-3), 5e-3, "dynamic"),
    "setup2+": (preset("setup2+", **SMALL2, V=2e-3), 0.03, "hybrid"),
    "sequence": (setup1(**SMALL), 0.4, "quasistatic"),
    "sequence 2": (setup2(**SMALL2), 0.2, "quasistatic"),
    "planned": (setup1(L=0.02, H=0.0125, F_N=400.0, V=2e-2), 6e-3, "auto"),
    "chain": (preset("chain", V=0.02, L=0.05), 4e-3, "dynamic"),
    "rate and state": (preset("rate_and_state", L=0.05, H=0.02, l=5e-3), 0.93, "hybrid"),
}  # fmt: skip
"""Scenes, ends (s) and engines."""


def in_units(scene, m, s, kg):
    """Return the scene with numbers in other units, of the same physics."""
    base = {"m": m, "s": s, "kg": kg, "N": kg * m / s**2}

    def there(found):
        value, unit = float(found[1]), found[2]
        for part, sign in zip(unit.split("/"), (1, -1), strict=False):
            for name, power in re.findall(r"([A-Za-z]+)\^?(\d?)", part):
                value *= base[name] ** (sign * int(power or 1))
        return f'"{value!r} {unit}"'

    return pyfric.Scene.from_toml(TEXT.sub(there, scene.to_toml()))


def test_steps_of_a_preset_are_those_of_its_name():
    assert pyfric.step_size("fig1") == pyfric.step_size(preset("fig1"))


@pytest.mark.parametrize("name", SCENES)
def test_other_units_give_the_same_catalogue(name):
    """Steps and pauses are defaults. Powers of two change only the last digits."""
    scene, t_end, engine = SCENES[name]
    how = {"fidelity": engine, "progress": False, "threads": 1}
    known = pyfric.simulate(scene, t_end, **how)
    assert len(known.events) >= 1
    for m, s, kg in UNITS.values():
        other = in_units(scene, m, s, kg)
        assert other.F_N == pytest.approx(scene.F_N * kg * m / s**2)
        found = pyfric.simulate(other, t_end * s, **how)
        np.testing.assert_array_equal(found.region, known.region)
        for column, unit in (("t_start", s), ("t_stop", s), ("F_T_start", kg * m / s**2)):
            a, b = found.events[column] / unit, known.events[column]
            np.testing.assert_allclose(a, b, rtol=1e-7, atol=1e-9 * b.abs().max())
        assert found.method.t_gap == pytest.approx(known.method.t_gap * s, rel=1e-12)
        if known.method.dt:
            assert found.method.dt == pytest.approx(known.method.dt * s, rel=1e-12)
