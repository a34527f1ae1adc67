"""
How much to model
=================

The same question at two levels: the quasi-static sequence has no inertia and takes a fraction of
the time; the hybrid engine solves the motion inside events. `plan` says at which levels a run is
made until two agree within a tolerance.
"""

import time

import matplotlib.pyplot as plt

import pyfric

scene = pyfric.preset("fig1", l=5e-3)
figure, axes = plt.subplots(layout="constrained")
jumps = pyfric.Options(fidelity="hybrid", geometry="linear")
ladder = pyfric.Options(fidelity="quasistatic")
for how, symbol in ((jumps, "o"), (ladder, "x")):
    begin = time.process_time()
    record = pyfric.simulate(scene, 0.9, how, progress=False)
    took = time.process_time() - begin
    lengths = pyfric.analysis.precursor_lengths(record)
    label = f"{how.fidelity}, {took:.2f} s"
    axes.plot(lengths["force"], lengths["L_p_over_L"], symbol, label=label)
axes.set(xlabel=r"$F_T/F_N$", ylabel=r"$L_p/L$")
axes.legend()

# %%
# The levels for two tolerances:

print(pyfric.plan(scene, tolerance=0.1, t_end=0.9))
print(pyfric.plan(scene, tolerance=0.003, t_end=0.9))
