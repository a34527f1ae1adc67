"""
Where setup 2 has precursors
============================

In which part of the plane of (theta, h) does setup 2 have precursors, and how many?

.. image:: ../../examples/precursors_setup2.png

The picture shows the number of precursors before the force is largest, and the line below which
there are fewer than five, which `pyfric.boundary` follows. ``python examples/precursors_setup2.py
[FOLDER]`` draws it in half a minute; it is not run with this page. If more than two blocks are
open at a time, the order of events means little.
"""

# sphinx_gallery_thumbnail_path = "_build/precursors_setup2.png"

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import pyfric
from pyfric.core import OPEN

H = np.arange(2e-3, 20.1e-3, 2e-3)
THETA = np.linspace(-1.0, 1.0, 11)
OPTIONS = pyfric.Options(fidelity="quasistatic")
FEW = 5


def job(theta, h):
    scene = pyfric.setup2(theta=theta, h=h, l=2e-3)
    return pyfric.Job(scene=scene, t_end=0.8, options=OPTIONS)


def count(record):
    """Precursors before the largest force at which an event starts; whether a gap opens by then."""
    top = record.events.loc[record.events["F_T_start"].idxmax(), "t_start"]
    found = pyfric.analysis.precursors(record)
    before = record.quiet["t"] <= top
    gap = (record.quiet["mode"][before] == OPEN).sum(axis=1).max() > 2
    return int((found["t_start"] < top).sum()), bool(gap)


def main(folder="."):
    plane = [(h, theta) for h in H for theta in THETA]
    records = pyfric.run_all([job(theta, h) for h, theta in plane])
    found = [count(record) for record in records]
    number = np.array([n for n, _ in found]).reshape(len(H), len(THETA))
    gap = np.array([one for _, one in found]).reshape(number.shape)

    def few(theta, h):
        (record,) = pyfric.run_all([job(theta, h)], progress=False)
        return count(record)[0] < FEW

    line = pyfric.boundary(few, (-1.0, 1.0), H, scale="linear", tolerance=1e-2)
    print(line.to_string())
    print(number[::-1])
    figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
    scale = {"norm": "log", "vmin": 1, "vmax": max(number.max(), 2), "cmap": "viridis"}
    shown = axes.pcolormesh(THETA, H * 1e3, np.ma.masked_equal(number, 0), **scale)
    for i, h in enumerate(H):
        for j, theta in enumerate(THETA):
            text = f"{number[i, j]}" + ("*" if gap[i, j] else "")
            light = "white" if 0 < number[i, j] < 8 else "black"
            axes.text(theta, h * 1e3, text, ha="center", va="center", color=light, fontsize=8)
    axes.plot(line["along"], line["over"] * 1e3, "r.-", label=f"fewer than {FEW} on the left")
    axes.set(xlabel="theta", ylabel="h (mm)", title="Setup 2: precursors before the largest force")
    figure.legend(loc="outside lower center", fontsize=8)
    figure.colorbar(shown, label="precursors (*: more than two blocks open)")
    path = Path(folder) / "precursors_setup2.png"
    figure.savefig(path, dpi=110)
    print(path)


if __name__ == "__main__":
    main(*sys.argv[1:])
