"""
The shape of the load
=====================

A free top under a load that grows or falls along the slider (theta from -0.8 to 0.8): where the
load is small, slip comes early. Shown is the slipping length over the driving force, for
mu_s = mu_k.
"""

import matplotlib.pyplot as plt

import pyfric

figure, axes = plt.subplots(layout="constrained")
for theta in (-0.8, -0.4, 0.0, 0.4, 0.8):
    scene = pyfric.setup2(theta=theta, l=2e-3)
    curve = pyfric.prediction_curve(scene).curve
    axes.plot(curve["F_T"] / scene.F_N, curve["L_p_over_L"], label=f"theta = {theta:g}")
axes.set(xlabel=r"$F_T/F_N$", ylabel=r"$L_p/L$")
axes.legend()
