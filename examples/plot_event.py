"""
One event, frame by frame
=========================

Velocities in the whole slider, tau/p and slip along the interface, at six moments of one
precursor. The event is replayed with full dynamics from the state at rest before it.
"""

import pyfric

record = pyfric.simulate("fig1", t_end=0.5, geometry="linear", progress=False)
event = int(pyfric.analysis.precursors(record)["event"].iloc[-1])
figure = pyfric.figures.event_strip(record, event)
# sphinx_gallery_tile = 6
