"""Static states of the slider."""

from pyfric.statics.blas import SMALL, one_thread, one_thread_if_small
from pyfric.statics.complementarity import Contact, ContactProblem, Route, Static
from pyfric.statics.condensation import LARGE
from pyfric.statics.contact import BARE, CONTACT_TOL, LEAST_DEFINITENESS, States, Values
from pyfric.statics.creep import Creep, Point
from pyfric.statics.equilibrium import RememberedStates, StaticSolver, loaded_state, solve_static
from pyfric.statics.heights import pressed
from pyfric.statics.lattice import bonds, spring_stiffness
from pyfric.statics.memory import Memory
from pyfric.statics.operators import damping, dispersion, extended, mass, stiffness
from pyfric.statics.rest import (
    Equilibrium,
    EquilibriumError,
    check_rests,
    check_sticks,
)
from pyfric.statics.routes import (
    Stretch,
    bends,
    beyond_ladder,
    check_ladder,
    check_statics,
    stretches,
)
from pyfric.statics.rows import ends, table_rows
from pyfric.statics.sequences import (
    Start,
    follows,
    interfaces_of,
    legs_of,
    rules_of,
    slider_of,
)
from pyfric.statics.stability import stability_limit
from pyfric.statics.starts import check_pushes, forced, overstressed, ramped, weakened
from pyfric.statics.system import System
from pyfric.statics.weakening import Weakening
