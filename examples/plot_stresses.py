"""
Stress before and after an event
================================

Shear over normal force of each bottom block at rest, just before the eleventh precursor and
just after it. Inside the precursor the ratio falls to about mu_k; ahead of its tip it
rises, and the next event begins from there.
"""

import matplotlib.pyplot as plt

import pyfric

mu_s, mu_k = 0.7, 0.45
scene = pyfric.preset("fig1", mu_s=mu_s, mu_k=mu_k)
record = pyfric.simulate(scene, t_end=0.8, geometry="linear", progress=False)
event = int(pyfric.analysis.precursors(record)["event"].iloc[10])

figure, axes = plt.subplots(layout="constrained")
for when in ("before", "after"):
    stress = pyfric.analysis.stress_profile(record, event, when)
    axes.plot(stress["x_over_L"], stress["tau"] / stress["p"], label=f"{when} the event")
axes.axhline(mu_s, color="0.5", ls="--", label=r"$\mu_s$")
axes.axhline(mu_k, color="0.5", ls=":", label=r"$\mu_k$")
axes.set(xlabel="x/L", ylabel=r"$\tau/p$")
axes.legend()
