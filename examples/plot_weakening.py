"""
Friction that weakens with slip
===============================

With a slip-weakening distance d_c the strength falls from mu_s p to
mu_k p over a slip of d_c. Slip is then stable at first: the blocks at the
pushed corner creep before an event. As long as few blocks creep, lengths and forces of precursors
hardly change; with 1 µm they begin to.
"""

import matplotlib.pyplot as plt

import pyfric

figure, axes = plt.subplots(layout="constrained")
for d_c, symbol in {0.0: "o", 2e-7: "s", 1e-6: "^"}.items():
    scene = pyfric.preset("fig1", l=5e-3, V=5e-3, d_c=d_c)
    record = pyfric.simulate(scene, 0.1, fidelity="hybrid", geometry="linear", progress=False)
    main = record.events[record.events["is_main"]]
    force = main["F_T_start"] / scene.F_N
    axes.plot(force, main["L_p_over_L"], symbol, ls=":", label=f"$d_c$ = {d_c * 1e6:g} µm")
axes.set(xlabel=r"$F_T/F_N$ at which an event starts", ylabel=r"$L_p/L$")
axes.legend()
