"""
How far does a precursor reach?
===============================

Length of each precursor against the force at which it stops, beside the prediction curve: the
same slider with mu_s = mu_k, whose slip grows continuously. Precursors follow it
from event to event.
"""

import matplotlib.pyplot as plt

import pyfric

scene = pyfric.preset("fig1")
lengths = pyfric.analysis.precursor_lengths(
    pyfric.simulate(scene, 0.9, geometry="linear", progress=False)
)
curve = pyfric.prediction_curve(scene).curve
F_N = scene.F_N

figure, axes = plt.subplots(layout="constrained")
axes.plot(curve["F_T"] / F_N, curve["L_p_over_L"], label=r"prediction, $\mu_s = \mu_k$")
axes.plot(lengths["force"], lengths["L_p_over_L"], "o", label="precursors")
axes.set(xlabel=r"$F_T/F_N$", ylabel=r"$L_p/L$")
axes.legend()
