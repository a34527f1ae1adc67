"""
What is simulated
=================

Two of the paper's scenes, to scale: a slider under a rigid rod, and one under a distributed
load. `sketch` draws any scene, so that a wrong length or load is seen before a run.
"""

import pyfric

figure = pyfric.figures.sketch(pyfric.preset("fig1"))

# %%
# A slider with a free top, whose load grows towards the trailing edge:

figure = pyfric.figures.sketch(pyfric.setup2(theta=0.5))
