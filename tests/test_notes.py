"""Notes on laws: friction that the driver does not reach or steps do not resolve."""

import pytest

import pyfric
from pyfric.scene import PRESETS, chain, density_notes, law_notes, laws, preset, setup1

LONG = laws.TabulatedLaw(slip=(0.0, 8e-3), mu=(0.65, 0.45))
SHORT = laws.TabulatedLaw(slip=(0.0, 3e-6, 1.0), mu=(0.65, 0.45, 0.45))
SPEED = laws.SpeedDependent(v=(0.0, 1e-3), factor=(1.0, 0.2))


@pytest.mark.parametrize(
    ("changes", "t_end", "text"),
    [
        ({"law": LONG}, 0.3, "slip of 8 mm, but the driver moves only 236.2 um"),
        ({"law": LONG}, 60.0, "slip of 8 mm, more than the block size l = 2.5 mm"),
        ({"law": SHORT}, 1e-3, "slip of 3 um, but the driver moves only 787.5 nm"),
        ({"law": SHORT}, 5e-3, ""),
        ({"d_c": 1e-6}, 1e-3, ""),
        ({"law": SPEED}, 0.3, ""),
        ({}, 0.3, ""),
    ],
)
def test_slip_that_the_driver_does_not_reach(changes, t_end, text):
    found = law_notes(setup1(**changes), t_end)
    assert (text in found[0]) if text else found == ()


def test_a_chain_under_stress_slips_without_its_driver():
    assert law_notes(chain(d_c=1e-3), 1e-3) == ()


def test_steps_that_do_not_resolve_weakening():
    """Slip weakening: m d^2s/dt^2 = drop p s/d_c. By speed: m dv/dt = mu_s p |dfactor/dv| v."""
    scene = setup1(d_c=1e-8)
    growth = (0.25 * 3500 / 57 / 1e-8 / scene.m) ** 0.5
    assert law_notes(scene, 0.3, 0.99 / growth) == ()
    (note,) = law_notes(scene, 0.3, 1.01 / growth)
    assert note.startswith(f"steps of {1.01 / growth:.3g} s do not resolve weakening over 10 nm")
    assert f"dt <= {1 / growth:.3g} s" in note
    scene = setup1(law=SPEED)
    (note,) = law_notes(scene, 0.3, 1e-5)
    assert "with speed" in note
    assert "d_c" not in note
    assert "um" not in note.partition("which")[0]
    assert law_notes(setup1(), 0.3, 1.0) == ()


@pytest.mark.parametrize(
    ("changes", "ratio", "mass"),
    [
        ({}, 1, 0.0756),
        ({"L": "200 mm", "l": "5 mm"}, 1, 0.108),
        ({"H": "30 mm"}, 2.5, 0.03024),
        ({"H": "30 mm", "M": 0.03024}, 1, 0.03024),
        ({"H": "150 mm", "L": "70 mm"}, 0.5, 0.0756),
    ],
)
def test_a_density_that_no_longer_is_that_of_the_preset_is_said(changes, ratio, mass):
    found = density_notes(preset("fig1", changes))
    if ratio == 1:
        assert found == ()
        return
    (note,) = found
    assert f"density {ratio:g} times that of fig1" in note
    assert note.endswith(f"M = {mass:g} kg keeps it")


def test_records_with_motion_have_the_note_on_density():
    assert not any(density_notes(preset(name)) for name in PRESETS)
    scene = preset("setup2", L="12 mm", H="4 mm")
    for engine, notes in (("dynamic", density_notes(scene)), ("quasistatic", ())):
        record = pyfric.simulate(scene, 1e-6, fidelity=engine, progress=False)
        assert [note for note in record.notes if "density" in note] == list(notes)
