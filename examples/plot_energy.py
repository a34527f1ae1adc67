"""
Where the energy goes
=====================

Full dynamics keeps an energy budget: the driver's work becomes kinetic and elastic energy, heat
at the interface and in the bonds. What is left over at the end is the error of the steps.
"""

import matplotlib.pyplot as plt

import pyfric

scene = pyfric.preset("fig1", l=5e-3, V=0.02)
record = pyfric.simulate(scene, 0.03, fidelity="dynamic", energies=True, progress=False)
curve = record.curve

figure, axes = plt.subplots(layout="constrained")
for column, meaning in {
    "work_driver": "work of the driver",
    "elastic_driver": "in the driver's spring",
    "elastic_bonds": "in the bonds",
    "friction_heat": "heat at the interface",
    "dissipated_bonds": "heat in the bonds",
}.items():
    axes.plot(curve["t"] * 1e3, (curve[column] - curve[column].iloc[0]) * 1e3, label=meaning)
axes.set(xlabel="t (ms)", ylabel="energy since the start (mJ)")
axes.legend()
print(f"left over: {pyfric.analysis.budget_error(curve):.1e} of the largest energy")
