"""What magnetorquers add to what is left in a case of a study, and whether the law uses it."""

import jax
import numpy as np
from jaxtyping import Float

from jaxsat.control.fault_tolerant import FaultTolerant
from jaxsat.control.steering import MagneticSteering
from jaxsat.controllability.rods import NORMAL, RodSet
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.spacecraft.environment.disturbances import GravityGradient
from jaxsat.spacecraft.magnetorquers import Magnetorquers

TURNED = 0.1
"""Of the least momentum that a wheel can hold: what runaways may hold across the orbit normal. The
orbit turns it, and nothing takes that out of two wheels for a third of an orbit."""


def rod_set(loop: AbstractLoop, magnetorquers: Magnetorquers) -> RodSet:
    """The magnetorquers of a loop as controllability judges them."""
    disturbance = loop.plant.disturbance
    terms = getattr(disturbance, "terms", (disturbance,))
    return RodSet(
        names=tuple(f"m{number}" for number in range(1, magnetorquers.count + 1)),
        axes=np.asarray(magnetorquers.axes, float),
        limits=np.asarray(magnetorquers.dipole_limit, float),
        field=magnetorquers.field,
        bias=momentum_bias(loop),
        gravity_gradient=any(isinstance(term, GravityGradient) for term in terms),
    )


def momentum_bias(loop: AbstractLoop) -> float:
    """Momentum (N m s) along the orbit normal that wheels are to keep, whoever steers rods."""

    def steers(part: object) -> bool:
        return isinstance(part, MagneticSteering)

    steering = [one for one in jax.tree.leaves(loop, is_leaf=steers) if steers(one)]
    return -float(steering[0].bias[1]) if steering else 0.0


def law_uses_rods(loop: AbstractLoop, axes: Float[np.ndarray, "3 k"]) -> bool:
    """Whether the law holds an orbit's attitude by magnetorquers beside wheels along these axes.

    The fault-tolerant law does so about the one axis across two wheels, others about any.
    """
    law = getattr(loop, "controller", None)
    return law.holds_by_rods(axes) if isinstance(law, FaultTolerant) else True


def wheels_hold_turned(loop: AbstractLoop, runaway: Float[np.ndarray, "3 k"], least: float) -> bool:
    """Whether wheels that hold the `least` momentum (N m s) live with that of `runaway` columns.

    Only the fault-tolerant law finds wheels in that state.
    """
    if not isinstance(getattr(loop, "controller", None), FaultTolerant):
        return True
    across = np.linalg.norm(np.cross(NORMAL, runaway.T), axis=1).sum()
    return bool(across <= TURNED * least)
