"""Choose a model, run it, measure its errors."""

from pyfric.planning.choice import Assumption, Plan, plan
from pyfric.planning.simulation import check_run, expected_cost, released, simulate
