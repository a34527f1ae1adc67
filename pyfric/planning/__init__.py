"""Levels of a scene, and runs at two levels, whose difference measures the error."""

from pyfric.planning.levels import Level
from pyfric.planning.plans import Plan, expected_cost, plan
from pyfric.planning.points import Told, levels_of, told
from pyfric.planning.simulation import check_run, released, simulate, simulate_point
