"""Parameters from measurements: misfit of events, fits, profiles, sensitivities."""

from pyfric.fitting.fit import Fit, fit
from pyfric.fitting.misfit import Misfit, misfit
from pyfric.fitting.sensitivity import COUNTS, QUANTITIES, Sensitivity, sensitivity
