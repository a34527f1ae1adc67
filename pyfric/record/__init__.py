"""Records of runs: loading curve, events, stresses and errors."""

from pyfric.record import analysis
from pyfric.record.analysis import (
    PER_BIN,
    Collapse,
    budget_error,
    budget_left,
    collapse_spread,
    energy_release,
    front,
    fronts,
    precursor_lengths,
    stress_profile,
    system_size_events,
)
from pyfric.record.balance import extent, potency_history
from pyfric.record.catalogue import (
    Catalogue,
    Statics,
    build_catalogue,
    count_main,
    main_blocks,
    parts,
)
from pyfric.record.classes import SLOW, creeps_to_rest
from pyfric.record.episodes import QUIET_COLUMNS, SWITCH_COLUMNS, LastSlip
from pyfric.record.errors import Differences, differences, statistics
from pyfric.record.held import (
    GROUPS,
    RecordError,
    block_array,
    check_record,
    event_column,
    held_in,
)
from pyfric.record.history import History
from pyfric.record.measured import Errors
from pyfric.record.method import T_GAP, Method, Model, provenance, versions
from pyfric.record.outlines import EVENT_COLUMNS, RUN_COLUMNS, Outline
from pyfric.record.pairing import paired
from pyfric.record.record import Record, load
from pyfric.record.recurrence import Sizes, b_value, sizes
from pyfric.record.report import numbered, summary, text
from pyfric.record.rupture import front_speed
from pyfric.record.zones import (
    RESOLVED,
    blocks_needed,
    chain_notes,
    material_of,
    pace_limits,
    viscous_error,
    zone_notes,
    zone_of_scene,
)
