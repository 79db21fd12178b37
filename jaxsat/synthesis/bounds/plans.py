"""Plans of `jaxsat.control.planning` from which the search for a bound begins."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxsat.control.planning import Plan, Planner, PlanStatus
from jaxsat.core.tolerances import Tolerances
from jaxsat.simulation import AbstractLoop, ContinuousLoop, SampledLoop
from jaxsat.spacecraft import Actuators, Wheels
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.synthesis.bounds.transcription import BoundObjective, Solution

GUESSES = 48

STRETCHES = (2.0, 4.0, 8.0)
"""Durations of plans of least effort over the least time."""


def plans_of(
    loop: AbstractLoop,
    start: PlantState,
    objective: BoundObjective,
    longest: float,
    tolerances: Tolerances | None = None,
) -> list[Solution]:
    """The plan of least time and, for least effort, those in some durations up to `longest` (s).

    They end within `tolerances` or, without them, at rest; so does a further one. None where the
    planner has nothing to offer: with less than two thrusters, for a third rate that is held, and
    where no plan arrives.
    """
    planner = _planner(loop, tolerances)
    if planner is None:
        return []
    plans = [_quickest(planner, start)]
    if tolerances is not None:  # what comes to rest settles, too
        plans.append(_quickest(dataclasses.replace(planner, tolerances=None), start))
    if objective is BoundObjective.EFFORT and int(plans[0].status) != PlanStatus.FAILED:
        cheapest = eqx.filter_jit(planner.cheapest)
        least = float(plans[0].duration)
        durations = dict.fromkeys(min(stretch * least, longest) for stretch in STRETCHES)
        plans += [cheapest(jnp.zeros(()), start, jnp.asarray(one)) for one in durations]
    return [solution_of(plan) for plan in plans if int(plan.status) != PlanStatus.FAILED]


@eqx.filter_jit
def _quickest(planner: Planner, start: PlantState) -> Plan:
    return planner.quickest(jnp.zeros(()), start)


def solution_of(plan: Plan) -> Solution:
    """A plan as what a search finds, its duration as its value."""
    states = np.concatenate([plan.quaternion, plan.omega], axis=1)
    duration = float(plan.duration)
    return Solution(duration, duration, np.asarray(plan.torque), states)


def _planner(loop: AbstractLoop, tolerances: Tolerances | None) -> Planner | None:
    if not isinstance(loop, ContinuousLoop | SampledLoop):
        return None
    plant, thrusters = loop.plant, loop.actuators
    if not isinstance(thrusters, Actuators) or plant.third_rate_held:
        return None
    if plant.find(Wheels) is not None or thrusters.torque_axes.shape[1] < 2:
        return None
    axes, limit = thrusters.torque_axes, thrusters.limit
    return Planner(plant, axes, limit, guesses=GUESSES, tolerances=tolerances)
