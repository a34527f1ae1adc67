"""
Loading curve
=============

Does the slider slip before it slides? The force on the driver's spring over time, and below it
where the interface slips in each event: precursors grow from the pushed end until one of them
crosses the whole interface.
"""

import pyfric

record = pyfric.simulate("fig1", t_end=0.9, geometry="linear", progress=False)
figure = pyfric.figures.fig1b(record)
print(pyfric.analysis.precursors(record)[["t_start", "F_T_start", "F_T_arrest", "L_p_over_L"]])
