"""
The largest stable step
=======================

Explicit steppers have a limit, which bond viscosity lowers. `stability_limit` computes it
before a run; larger steps are refused.
"""

import matplotlib.pyplot as plt
import numpy as np

import pyfric


def slider(eta=None):
    return pyfric.setup1(L=0.05, H=0.025, l=5e-3, eta=eta)


scene = slider()
unit = np.sqrt(scene.slider.k * scene.m)
eta = np.geomspace(0.03, 3, 15)

figure, axes = plt.subplots(layout="constrained")
for stepper in ("rk4", "verlet", "symplectic_euler"):
    limits = [pyfric.stability_limit(slider(one * unit), stepper)[0] for one in eta]
    axes.loglog(eta, np.array(limits) * 1e6, label=stepper)
axes.set(xlabel=r"$\eta/\sqrt{km}$", ylabel="largest stable step (µs)")
axes.legend()
