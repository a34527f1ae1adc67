"""
What fracture mechanics says
============================

Speed of a growing shear crack under a uniform stress drop, from the energy balance at its tip:
from its critical length on, it first runs slowly and then approaches the Rayleigh speed. A
front of the lattice can be compared with this where its cohesive zone spans several blocks.
"""

import matplotlib.pyplot as plt
import numpy as np

import pyfric
from pyfric import theory

rock = theory.Material(c_P=6000.0, c_S=3464.0, rho=2670.0)
Gamma = theory.fracture_energy(mu_s=0.677, mu_k=0.525, p=120e6, d_c=0.4)
a = np.geomspace(1e3, 3e4, 60)

figure, axes = plt.subplots(layout="constrained")
for drop in (5e6, 7e6, 9e6):
    speed = theory.crack_speed(rock, a, drop, Gamma, bodies=2)
    axes.plot(
        a / 1e3,
        np.where(speed > 0, speed, np.nan) / rock.c_S,
        label=f"stress drop {drop / 1e6:g} MPa",
    )
axes.axhline(
    theory.rayleigh_speed(rock.c_P, rock.c_S) / rock.c_S, color="0.5", ls="--", label="$c_R$"
)
axes.set(xlabel="half length of the crack (km)", ylabel="speed, in $c_S$")
axes.legend()
print(
    pyfric.theory.cohesive_zone(rock, 0.677, 0.525, 120e6, 0.4, bodies=2),
    "m of cohesive zone at rest",
)
