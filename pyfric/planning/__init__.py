"""Choose a model, run it, measure its errors."""

from pyfric.planning.choice import Assumption, Plan, plan
from pyfric.planning.simulation import check_run, expected_cost, released, simulate

__all__ = ["Assumption", "Plan", "check_run", "expected_cost", "plan", "released", "simulate"]
