"""Notes on laws: what the driver does not reach, what steps do not resolve."""

import pytest

from pyfric.scene import chain, law_notes, laws, setup1

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
    """m ds/dt^2 = drop p s/d_c; with speed m dv/dt = mu_s p |dfactor/dv| v."""
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
