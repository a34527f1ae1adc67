"""
Front speed and prestress
=========================

The rupture front of the eleventh precursor of the Fig. 1 scene: fast where the shear was close
to the static limit before, slow where it was not. With Amontons-Coulomb friction the lattice
resolves no cohesive zone, so compare such speeds with each other, not with wave speeds of a
continuum.
"""

import pyfric

record = pyfric.simulate("fig1", t_end=0.8, want="front_speed", geometry="linear", progress=False)
event = int(pyfric.analysis.precursors(record)["event"].iloc[10])
figure = pyfric.figures.fig4a(record, event)
