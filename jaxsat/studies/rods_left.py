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
from jaxsat.spacecraft.environment.orbit import EARTH_ROTATION
from jaxsat.spacecraft.magnetorquers import MagneticSteering
from jaxsat.studies.momentum_left import Held

TURNED = 0.1
"""Largest momentum of runaways across the orbit normal, relative to the least capacity of a wheel.
The orbit turns it, and two wheels cannot unload it for a third of an orbit."""

LEAST_HOLD = 0.02
"""Smallest reserve of momentum beside a runaway wheel or a stuck magnetorquer, relative to the
largest capacity of a wheel."""

SMALL = 0.1
"""Turn (rad) up to which the motion of the body counts as linear."""


UNLIMITED = 1e6
"""Momentum that a wheel without a limit holds, relative to the largest limit of another."""


class ThrustersLeft(NamedTuple):
    """Torques (N m) of thrusters at level 1, and the least and the largest level of each."""

    torques: Float[np.ndarray, "3 n"]
    low: Float[np.ndarray, " n"]
    high: Float[np.ndarray, " n"]


class RodsLeft(NamedTuple):
    """All magnetorquers, None without any.

    In one case or, with a leading axis, in all: the mask of `healthy` ones, the dipole (A m²) of
    each that is `stuck`, zero for others, the largest dipole (A m²) that each can make, `most`, and
    the time (s) `since` which it has failed, infinite for those that have not.
    """

    rods: RodSet | None
    healthy: Bool[np.ndarray, "*cases k"]
    stuck: Float[np.ndarray, "*cases k"]
    most: Float[np.ndarray, "*cases k"]
    since: Float[np.ndarray, "*cases k"]

    def case(self, number: int) -> "RodsLeft":
        """Return the magnetorquers in one case."""
        return RodsLeft(self.rods, *(part[number] for part in self[1:]))

    def load(
        self,
        axes: Float[np.ndarray, "3 m"],
        capacity: Float[np.ndarray, " m"],
        beside: ThrustersLeft,
        hold: Held,
        case: int = 0,
    ) -> float:
        """Return the part of their `capacity` (N m s) that wheels need until the end beside stuck
        ones; zero without one, or without a limit.

        Wheels along unit `axes` hold what the dipole of stuck ones and the disturbances add up to.
        Where they cannot alone, healthy ones, and thrusters `beside` them, take out what they can.
        """
        limited, rods, fails = np.isfinite(capacity), self.rods, self.stuck != 0
        if rods is None or not np.any(rods.axes @ self.stuck) or not limited.any():
            return 0.0
        room = np.where(limited, capacity, UNLIMITED * capacity[limited].max(initial=0.0))
        times = hold.times(float(self.since[fails].min()))
        fields = rods.field.sampled(times, EARTH_ROTATION * times)
        acts = np.where(times[:, None] >= self.since, self.stuck, 0.0) @ rods.axes.T
        path, turn = hold.under(case, times, np.cross(acts, fields))
        inverse = np.linalg.pinv(axes)
        alone = float(np.abs(path @ inverse.T / room).max())
        if alone <= 1 - LEAST_HOLD and np.allclose(axes @ inverse, np.eye(3)):
            return alone
        from jaxsat.controllability.filling import least_load  # slow

        each = np.cross(rods.axes[:, self.healthy].T, fields[:, None]).swapaxes(1, 2)
        each = np.concatenate([each, np.tile(beside.torques, (len(times), 1, 1))], axis=2)
        impulses = (times[1] - times[0]) / 2 * (turn @ each[:-1] + each[1:])
        most = self.most[self.healthy]
        low, high = np.append(-most, beside.low), np.append(most, beside.high)
        return least_load(path, turn, axes, room, impulses, low, high)

    def opposed(
        self, judgement: Judgement, capacity: Float[np.ndarray, " m"], tolerance: float
    ) -> float:
        """Return the part of the torque of stuck ones that healthy ones oppose over an orbit;
        infinite without one.

        With the wheels of the `judgement`, each of a `capacity` (N m s), they use at most
        `MOST_OPPOSING` of their limits, and of the `tolerance` (rad) of the attitude.
        """
        rods = self.rods
        if rods is None or not np.any(rods.axes @ self.stuck):
            return np.inf
        healthy, wheels = np.flatnonzero(self.healthy).tolist(), judgement.actuators
        rest = rest_with_rods(judgement, rods, healthy)
        if rest is None:
            return 0.0
        from jaxsat.controllability.stuck_dipole import OrbitWheels, largest_opposed  # slow

        dipole, angle = rods.axes @ self.stuck, MOST_OPPOSING * min(tolerance, SMALL)
        size = float(np.abs(dipole).max())
        most = largest_opposed(
            rods,
            healthy,
            dipole / size,
            judgement.inertia,
            OrbitWheels(wheels.wheel_axes, capacity, wheels.coasting),
            rest,
            angle,
            MOST_OPPOSING,
        )
        return most / size


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
