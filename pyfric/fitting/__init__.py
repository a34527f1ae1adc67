"""Parameters from measurements: misfit of events, fits, profiles, sensitivities."""

from pyfric.fitting.fits import fit
from pyfric.fitting.misfits import Misfit, misfit
from pyfric.fitting.posteriors import posterior
from pyfric.fitting.results import Fit
from pyfric.fitting.sensitivities import COUNTS, QUANTITIES, Sensitivity, sensitivity
