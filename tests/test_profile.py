"""Fields from points along the interface, and from files."""

import numpy as np
import pytest
from helpers import refused, small_rod

import pyfric
from pyfric import Profile
from pyfric.scene import Scene, setup1

MU = Profile(x=(0.0, 0.05, 0.2), value=(0.6, 0.8, 0.7))


@pytest.mark.parametrize("side", ["left", "right"])
def test_values_are_linear_between_points_at_any_l(side):
    for l in (5e-3, 2.5e-3, 1.25e-3):
        scene = setup1(l=l, mu_s=MU, side=side)
        x = (scene.n_of_i - 1) * l
        expected = np.where(x < 0.05, 0.6 + 4 * x, 0.8 - (x - 0.05) / 1.5)
        assert scene.field("mu_s") == pytest.approx(expected, rel=1e-12)
    assert setup1(l=5e-3, mu_s=MU).interface_on(57).mu_s == MU
    assert MU.mean == pytest.approx((0.7 * 0.05 + 0.75 * 0.15) / 0.2)


def test_files_of_text_and_of_numpy(tmp_path):
    rows = [[0.0, 1.0e7], [0.03, 2.0e7], [0.14, 1.5e7]]
    np.save(tmp_path / "k.npy", np.array(rows))
    (tmp_path / "k.csv").write_text("x (mm),k_f (N/um)\n0,10\n30,20\n140,15\n")
    (tmp_path / "bare.txt").write_text("# in SI\n0 1e7\n0.03 2e7\n0.14 1.5e7\n")
    found = [Profile.read(tmp_path / name, "N/m") for name in ("k.npy", "k.csv", "bare.txt")]
    for one in found:
        assert one.x == pytest.approx([x for x, _ in rows])
        assert one.value == pytest.approx([value for _, value in rows])
    text = setup1().to_toml() + "\n"
    text = text.replace("[interface]\n", '[interface]\nk_f = {file = "k.csv"}\n')
    (tmp_path / "scene.toml").write_text(text)
    scene = Scene.from_toml(tmp_path / "scene.toml")
    assert scene == setup1(k_f=found[1])
    assert Scene.from_toml(scene.to_toml()) == scene  # without the file
    assert setup1(k_f={"file": str(tmp_path / "k.csv")}) == scene
    refused(lambda: Scene.from_toml(text, files=False), "interface.k_f", "names no files")
    record = pyfric.simulate(scene.replace(l=5e-3), 0.01, fidelity="quasistatic")
    again = pyfric.load(record.save(tmp_path / "run.nc"))
    assert again.scene == record.scene


def test_refusals(tmp_path):
    refused(lambda: setup1(L=0.205, mu_s=MU), "interface.mu_s", value=0.2, within=(0, 0.205))
    late = Profile(x=(0.01, 0.2), value=(0.7, 0.7))
    refused(lambda: setup1(mu_s=late), "interface.mu_s", value=0.01, unit="m", within=(0, 0.14))
    refused(lambda: Profile(x=(0.0, 0.0), value=(1.0, 1.0)), "profile.x", value=0.0, within=(0.0,))
    refused(lambda: Profile(x=(0.0, 1.0), value=(1.0,)), "profile.value", "same length")
    refused(lambda: Profile(x=(0.0,), value=(1.0,)), "profile.value", "at least 2")
    low = Profile(x=(0.0, 1.0), value=(0.7, -9.0))
    refused(lambda: setup1(mu_s=low), "interface.mu_s", "the profile reaches this at block")
    for name, content, *texts in (
        ("three.csv", b"0,1,2\n1,2,3\n", "row 1: 3 columns"),
        ("word.csv", b"0,1\n1,much\n", "row 2", "not a number"),
        ("unit.csv", b"x (N),mu\n0,1\n1,1\n", "unit.csv"),
        ("one.csv", b"0,1\n", "1 rows"),
        ("flat.npy", b"nothing", "no array of NumPy"),
        ("order.csv", b"1,1\n0,1\n", "out of order", "order.csv"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(pyfric.SceneError) as caught:
            small_rod(mu_s={"file": str(tmp_path / name)})
        for text in texts:
            assert text in str(caught.value)
    refused(lambda: small_rod(mu_s={"file": "nowhere.csv"}), "interface.mu_s", "No such file")
