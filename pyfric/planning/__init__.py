"""Levels of a scene, runs at two of them, and the error that they measure."""

from pyfric.planning.levels import Level
from pyfric.planning.plans import Plan, expected_cost, plan
from pyfric.planning.points import Told, levels_of, told
from pyfric.planning.simulation import check_run, released, simulate, simulate_point
