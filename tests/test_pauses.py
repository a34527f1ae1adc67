"""The longest pause inside an event: the paper's scenes, three times of a scene, and the note."""

import pytest
from helpers import scaled

import pyfric
from pyfric.engines.pauses import longest_pause, pause_notes
from pyfric.record import build_catalogue
from pyfric.scene import PRESETS, preset, setup1, setup2

OTHERS = ("burridge_knopoff", "chain", "rate_and_state", "tpv3")
"""Presets that are not scenes of the paper."""


def test_the_papers_scenes_keep_a_millisecond():
    scenes = [preset(name) for name in PRESETS if name not in OTHERS]
    scenes += [setup1(F_N=F_N, h=h) for F_N in (1750.0, 2700.0, 3500.0) for h in (2.5e-3, 15e-3)]
    assert {longest_pause(one) for one in scenes} == {1e-3}


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        (setup2(V=0.01), 3e-4),  # 3 transits of 0.11 ms; the driver adds 1.2e-3 F_N in 0.06 ms
        (setup1(V=7.875e-3), 3e-4),  # 1.2e-3 * 3500 N / (4e6 N/m * 7.875 mm/s) = 0.13 ms, transits
        (setup1(V=1e-6), 3e-2),  # 4 times 5 ms
        (setup1(V=7.875e-5, eta=0.0), 1e-2),  # the driver alone: 13 ms
        (setup1(V=0.0), 3e-4),  # 3 transits of 0.145 ms: nothing else begins
        (preset("tpv3"), 10.0),  # 3 transits of 5.2 s; 15.5 s are nearer to 10 s than to 30 s
    ],
)
def test_three_times_of_a_scene(scene, expected):
    assert longest_pause(scene) == expected
    if not scene.prescribed:
        assert longest_pause(scaled(scene, 2.0)) == expected


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
