"""The compiled core: builds, calls, steppers, state."""

from pyfric.core.builds import (
    BLOCKS_PER_THREAD,
    ENVIRONMENT,
    VARIANT,
    additions,
    build_info,
    fork_notes,
    forked,
    lacks,
    processors,
    useful_threads,
    variants,
)
from pyfric.core.calls import (
    ENERGIES,
    SlowLimits,
    SlowSlip,
    advance,
    bond_forces,
    curve_point,
    energies,
    evaluate,
    slow_slip,
)
from pyfric.core.log import POINT, Log, Switching, room_of_step
from pyfric.core.memory import available
from pyfric.core.packing import (
    CORNER_SHARE,
    Constants,
    Counts,
    Model,
    check_driven,
    model,
    springs,
)
from pyfric.core.part import Part
from pyfric.core.sequences import (
    IN_EVENT,
    CondensedSlider,
    CoreLeg,
    Interfaces,
    Rules,
    SequenceLog,
    Sequences,
    room_of_run,
)
from pyfric.core.state import OPEN, STUCK, State, StateError, spring_of
from pyfric.core.status import Status
from pyfric.core.steppers import STEPPERS, Stepper
