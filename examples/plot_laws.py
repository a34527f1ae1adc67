"""
What fields and laws do
=======================

Two things that the paper's interface cannot do. A strong patch, blocks 15 to 20, stops precursors
at its edge, until some break through it. And contacts that age make the force at which a block
starts again grow with the time of contact: points are a run whose driver holds longer and longer,
lines what the law says.
"""

import matplotlib.pyplot as plt
import numpy as np

import pyfric
from pyfric import laws

figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9), layout="constrained")

scene = pyfric.preset("fig1")
n = np.arange(1, scene.N_x + 1)  # from the trailing edge on
patch = np.where((n >= 15) & (n <= 20), 2.0, 0.7)
for mu_s, style, label in (
    (0.7, {"marker": "o", "color": "0.6", "ms": 7}, r"$\mu_s$ = 0.7"),
    (patch.tolist(), {"marker": "o", "color": "#D55E00", "ms": 4}, "with the patch"),
):
    record = pyfric.simulate(scene.replace(mu_s=mu_s), 0.9, fidelity="quasistatic", progress=False)
    found = pyfric.analysis.precursors(record)
    left.plot(found["force_start"], found["L_p_over_L"], ls="", label=label, **style)
left.axhspan(14 / scene.N_x, 20 / scene.N_x, color="#D55E00", alpha=0.2, lw=0)
left.text(0.48, 17 / scene.N_x, r"$\mu_s$ = 2 here", ha="right", va="center", fontsize="small")
left.set(xlabel="$F_T/F_N$ at which a precursor starts", ylabel="$L_p/L$", ylim=(0, 1))
left.legend(frameon=False, loc="upper left")

V, p, slide, holds = 0.05, 60.0, 3e-3, np.array([1e-3, 3e-3, 1e-2, 3e-2, 1e-1])
ages, corners, t, again = np.geomspace(1e-3, 0.12, 50), [], 0.0, []
for hold in holds:  # slide, hold, slide, hold longer, ...
    corners += [(t + slide, V), (t + slide, 0.0), (t + slide + hold, 0.0), (t + slide + hold, V)]
    t += slide + hold
    again.append(t)
block = pyfric.chain(L=5e-3, p=p, k=1.0, K=1e6, V=V, eta=5.0, M=3e-3)
block = block.replace({"driver.protocol": corners})
for law, colour, label in (
    (laws.LinearWeakening(), "0.5", "Amontons-Coulomb"),
    (laws.ExponentialHealing(gain=0.04, t_c=5e-3), "#009E73", "exponential healing"),
    (laws.Ageing(B=0.02, t_c=1e-5), "#0072B2", "ageing"),
):
    one = block.replace({"interface.law": law})
    record = pyfric.simulate(one, t + slide, dt=1e-5, t_gap=1e-4, sample=1e-3, progress=False)
    events = record.events
    first = events["t_start"].searchsorted(again)
    age = events["t_start"].to_numpy()[first] - events["t_stop"].to_numpy()[first - 1]
    F_T = events["F_T_start"].to_numpy()[first]
    right.semilogx(age * 1e3, F_T / p, "o", ms=4, color=colour, label=label)
    right.semilogx(ages * 1e3, one.law.static.hold(np.ones(len(ages)), ages), lw=1, color=colour)
right.set(
    xlabel="time of contact (ms)", ylabel="$F_T/p$ at which the block starts", ylim=(0.69, 0.82)
)
right.legend(frameon=False, loc="upper left")
