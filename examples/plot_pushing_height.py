"""
Pushing higher or lower
=======================

How does the height h at which the driver pushes change the precursors? Four runs of the
quasi-static sequence. They stay on nearly the same curve; the higher the push, the larger the
torque, and the longer the steps from one precursor to the next.
"""

import matplotlib.pyplot as plt

import pyfric

figure, axes = plt.subplots(layout="constrained")
for h in (2.5e-3, 5e-3, 7.5e-3, 10e-3):
    record = pyfric.simulate(
        pyfric.preset("fig1", h=h), t_end=1.0, fidelity="quasistatic", progress=False
    )
    lengths = pyfric.analysis.precursor_lengths(record)
    axes.plot(lengths["force"], lengths["L_p_over_L"], "o-", ms=4, label=f"h = {h * 1e3:g} mm")
axes.set(xlabel=r"$F_T/F_N$", ylabel=r"$L_p/L$")
axes.legend()
