"""Contribution of magnetorquers to the remaining control in a case, and whether the law uses it."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxsat.control.sampled import AbstractSampledController
from jaxsat.controllability.judgement import Judgement
from jaxsat.controllability.orbit_rest import NORMAL
from jaxsat.controllability.rods import MOST_OPPOSING, RodSet, rest_with_rods
from jaxsat.simulation.loops import AbstractLoop, parts_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.effector import Dipoles
from jaxsat.spacecraft.environment.disturbances import has_gravity_gradient
from jaxsat.spacecraft.magnetorquers import MagneticSteering

TURNED = 0.1
"""Largest momentum of runaways across the orbit normal, relative to the least capacity of a wheel.
The orbit turns it, and two wheels cannot unload it for a third of an orbit."""

SMALL = 0.1
"""Turn (rad) up to which the motion of the body counts as linear."""


class RodsLeft(NamedTuple):
    """All magnetorquers, None without any.

    In one case or, with a leading axis, in all: the mask of `healthy` ones, and the dipole (A m²)
    of each that is `stuck`, zero for others.
    """

    rods: RodSet | None
    healthy: Bool[np.ndarray, "*cases k"]
    stuck: Float[np.ndarray, "*cases k"]

    def case(self, number: int) -> "RodsLeft":
        """Return the magnetorquers in one case."""
        return RodsLeft(self.rods, self.healthy[number], self.stuck[number])

    def opposes(
        self, judged: Judgement, capacity: Float[np.ndarray, " m"], tolerance: float
    ) -> bool:
        """Whether healthy ones oppose the torque of stuck ones over an orbit.

        With the wheels `judged`, each of a `capacity` (N m s), they use at most `MOST_OPPOSING` of
        their limits, and of the `tolerance` (rad) of the attitude.
        """
        rods = self.rods
        if rods is None or not np.any(rods.axes @ self.stuck):
            return True
        healthy, wheels = np.flatnonzero(self.healthy).tolist(), judged.actuators
        rest = rest_with_rods(judged, rods, healthy)
        if rest is None:
            return False
        from jaxsat.controllability.stuck_dipole import OrbitWheels, largest_opposed  # slow

        dipole, angle = rods.axes @ self.stuck, MOST_OPPOSING * min(tolerance, SMALL)
        size = np.abs(dipole).max()
        most = largest_opposed(
            rods,
            healthy,
            dipole / size,
            judged.inertia,
            OrbitWheels(wheels.wheel_axes, capacity, wheels.coasting),
            rest,
            angle,
            MOST_OPPOSING,
        )
        return bool(most >= size)


def rod_set(loop: AbstractLoop, dipoles: Dipoles) -> RodSet:
    """Return the magnetorquers of a loop for controllability."""
    limits = np.asarray(dipoles.limits, float)
    return RodSet(
        names=tuple(f"m{number}" for number in range(1, len(limits) + 1)),
        axes=np.asarray(dipoles.axes, float),
        limits=limits,
        field=dipoles.field,
        bias=momentum_bias(loop),
        gravity_gradient=has_gravity_gradient(loop.plant.disturbance),
    )


def momentum_bias(loop: AbstractLoop) -> float:
    """Momentum bias (N m s) of wheels along the orbit normal, whatever steers the magnetorquers."""
    steering = parts_of(MagneticSteering, loop)
    return -float(steering[0].bias[1]) if steering else 0.0


def sampled_law(loop: AbstractLoop) -> AbstractSampledController | None:
    """Return the law of a sampled loop; None for another, which does not use magnetorquers."""
    return loop.controller if isinstance(loop, SampledLoop) else None


def law_uses_rods(
    loop: AbstractLoop, axes: Float[np.ndarray, "3 k"], rods: Bool[np.ndarray, " rods"]
) -> bool:
    """Whether the law holds an orbit's attitude by these magnetorquers beside wheels along these
    axes."""
    law = sampled_law(loop)
    return law is None or law.holds_by_rods(axes, rods)


def wheels_hold_turned(loop: AbstractLoop, runaway: Float[np.ndarray, "3 k"], least: float) -> bool:
    """Whether wheels of at least this capacity (N m s) tolerate the momentum of `runaway` columns.

    Only a law that monitors wheels sees such a state.
    """
    law = sampled_law(loop)
    if law is None or law.known is None:
        return True
    across = np.linalg.norm(np.cross(NORMAL, runaway.T), axis=1).sum()
    return bool(across <= TURNED * least)
