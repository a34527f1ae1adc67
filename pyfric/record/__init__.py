"""What happened: curve, events, stresses."""

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
    griffith_length,
    precursor_lengths,
    stress_profile,
    system_size_events,
)
from pyfric.record.catalogue import (
    MAIN_EVENT_BLOCKS,
    T_GAP,
    Catalogue,
    build_catalogue,
    count_main,
)
from pyfric.record.episodes import QUIET_COLUMNS, SWITCH_COLUMNS
from pyfric.record.errors import Errors, differences, paired, statistics
from pyfric.record.record import Method, Record, RecordError
from pyfric.record.report import numbered, summary, text
from pyfric.record.rupture import front_speed
from pyfric.record.software import provenance, versions
from pyfric.record.zones import RESOLVED, zone_at_rest, zone_moving, zone_notes

__all__ = [
    "MAIN_EVENT_BLOCKS",
    "PER_BIN",
    "QUIET_COLUMNS",
    "RESOLVED",
    "SWITCH_COLUMNS",
    "T_GAP",
    "Catalogue",
    "Collapse",
    "Errors",
    "Method",
    "Record",
    "RecordError",
    "analysis",
    "budget_error",
    "budget_left",
    "build_catalogue",
    "collapse_spread",
    "count_main",
    "differences",
    "energy_release",
    "front",
    "front_speed",
    "fronts",
    "griffith_length",
    "numbered",
    "paired",
    "precursor_lengths",
    "provenance",
    "statistics",
    "stress_profile",
    "summary",
    "system_size_events",
    "text",
    "versions",
    "zone_at_rest",
    "zone_moving",
    "zone_notes",
]
