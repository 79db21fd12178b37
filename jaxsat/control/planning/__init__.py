"""Plans from any state to rest at the target with two torques, in least time or effort."""

from jaxsat.control.planning.planner import Planner as Planner
from jaxsat.control.planning.planner import PlanStatus as PlanStatus
