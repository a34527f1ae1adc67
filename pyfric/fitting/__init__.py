"""Parameters from measurements: misfit of events, fits, profiles, sensitivities."""

from pyfric.fitting.fits import fit
from pyfric.fitting.measurement import Known, Measurement, Together
from pyfric.fitting.misfits import Misfit, misfit
from pyfric.fitting.of_curves import CurveOf
from pyfric.fitting.of_events import Events, Sizes
from pyfric.fitting.posteriors import posterior
from pyfric.fitting.results import Fit
from pyfric.fitting.sensitivities import COUNTS, QUANTITIES, Sensitivity, sensitivity
from pyfric.fitting.sensors import Arrivals, Lengths

__all__ = [
    "COUNTS",
    "QUANTITIES",
    "Arrivals",
    "CurveOf",
    "Events",
    "Fit",
    "Known",
    "Lengths",
    "Measurement",
    "Misfit",
    "Sensitivity",
    "Sizes",
    "Together",
    "fit",
    "misfit",
    "posterior",
    "sensitivity",
]
