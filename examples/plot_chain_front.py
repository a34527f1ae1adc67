"""
A front in a chain, against theory
==================================

One row of blocks under uniform load and shear has fronts of constant speed, which theory gives
exactly. The shear is given as taubar = (tau/p - mu_k)/(mu_s - mu_k);
without viscosity v = c/sqrt(1 - taubar^2).
"""

import matplotlib.pyplot as plt
import numpy as np

import pyfric

n, released, mu_s, mu_k = 150, 20, 0.7, 0.45
taubar = np.array([0.3, 0.5, 0.7, 0.8, 0.9])
speeds = []
for one in taubar:
    tau = mu_k + one * (mu_s - mu_k)
    scene = pyfric.chain(L=(n - 1) * 2.5e-3, p=1.0, tau=tau, eta=0.0, K=1e-3, V=0.0)
    unit = np.sqrt(scene.m / scene.slider.k)  # time from block to block at the speed c
    guess = pyfric.theory.chain_speed_undamped(one)
    start = pyfric.loaded_state(scene).state(scene, 0.1 * unit / guess)
    start.mode[:released] = 1  # these blocks begin to slip at once
    record = pyfric.simulate(
        scene,
        1.05 * (n - released) * unit / guess,
        fidelity="dynamic",
        initial=start,
        dt=start.dt,
        t_gap=1.0,
        progress=False,
    )
    times = record.rupture_times[0][n // 2 :]
    speeds.append(np.polyfit(times, np.arange(len(times)), 1)[0] * unit)

figure, axes = plt.subplots(layout="constrained")
x = np.linspace(0.2, 0.93, 50)
axes.plot(x, pyfric.theory.chain_speed_undamped(x), label="theory")
axes.plot(taubar, speeds, "o", label="runs")
axes.set(xlabel=r"$\bar\tau$", ylabel="front speed, in c")
axes.legend()
print(np.array(speeds) / pyfric.theory.chain_speed_undamped(taubar) - 1)
