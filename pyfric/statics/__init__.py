"""States of rest."""

from pyfric.statics.banded import BandedCholesky
from pyfric.statics.blas import one_thread, one_thread_if_small
from pyfric.statics.complementarity import Contact, ContactProblem, Route, Values
from pyfric.statics.creep import Change, Creep, Forces, Point, creeps
from pyfric.statics.equilibrium import LARGE, StaticSolver, loaded_state, solve_static
from pyfric.statics.operators import (
    bonds,
    damping,
    dispersion,
    mass,
    spring_stiffness,
    stiffness,
)
from pyfric.statics.rest import Equilibrium, EquilibriumError, check_rests, check_sticks
from pyfric.statics.stability import stability_limit
from pyfric.statics.uniqueness import LIMIT as LEAST_DEFINITENESS

__all__ = [
    "LARGE",
    "LEAST_DEFINITENESS",
    "BandedCholesky",
    "Change",
    "Contact",
    "ContactProblem",
    "Creep",
    "Equilibrium",
    "EquilibriumError",
    "Forces",
    "Point",
    "Route",
    "StaticSolver",
    "Values",
    "bonds",
    "check_rests",
    "check_sticks",
    "creeps",
    "damping",
    "dispersion",
    "loaded_state",
    "mass",
    "one_thread",
    "one_thread_if_small",
    "solve_static",
    "spring_stiffness",
    "stability_limit",
    "stiffness",
]
