"""Plans: from any state to rest at the target with two torques, in least time or effort."""

from jaxsat.control.planning.planner import Plan, Planner, PlanStatus

__all__ = ["Plan", "PlanStatus", "Planner"]
