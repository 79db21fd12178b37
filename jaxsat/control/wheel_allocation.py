"""Remaining capability of wheels after failures, and the allocation of a torque among them.

The weighted least squares of a 3 x 3 system by its adjugate: no factorisation in the loop.
"""

from typing import Annotated, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.control.diagnosis.diagnosis import WEAK
from jaxsat.control.diagnosis.residual import ActuatorCondition
from jaxsat.control.diagnosis.wheel_filter import WheelFilter
from jaxsat.control.reconfiguration import Rank
from jaxsat.core.array_types import IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.quotients import SMALLEST, length, root
from jaxsat.spacecraft.allocation import allocate_evenly
from jaxsat.spacecraft.spacecraft import adjugate
from jaxsat.spacecraft.wheel_friction import motor_torque
from jaxsat.spacecraft.wheels import Wheels

OfEach = Float[Array, " m"]

SPARE = 0.02
"""Share of the sum of squares of all wheels' components that must remain along each axis."""

MOST_MOMENTUM = 0.9
"""Largest momentum for a slew, relative to the capacity of the remaining wheels."""

LEAST_MOMENTUM = 0.02
"""Smallest momentum that is always available to a slew, relative to the same capacity."""

PARALLEL = 1e-3
"""Sine of the angle between the Earth's field and the normal of two wheels' plane that is treated
as zero: magnetorquers then cannot unload them."""


class WheelsInUse(NamedTuple):
    """Capability of wheels in a condition.

    `usable` (N m) is the torque of each beyond its friction, zero for an excluded one. `rank` is
    their joint capability, `normal` the unit vector of the least torque, and `shares` (m, 3) the
    allocation of a torque on the body.
    """

    usable: OfEach
    rank: Annotated[IntScalar, Rank]
    normal: Vector
    shares: Float[Array, "m 3"]

    @property
    def working(self) -> Bool[Array, " m"]:
        """Mask of the used wheels."""
        return self.usable > 0


class WheelAllocation(eqx.Module):
    """Choice of the wheels in a condition, and allocation of a commanded torque to them.

    Wheels are weighted by their usable torque. If one has too little, others compensate; of an
    infeasible command the largest possible part is produced. With more wheels than axes, momentum
    without torque on the body is driven to zero: each wheel then holds what it would of a torque
    or, where wheels are `uneven`, with the least sum of squares of momentum over limit.
    """

    filter: WheelFilter
    uneven: bool = eqx.field(static=True, default=False)

    @property
    def wheels(self) -> Wheels:
        """The wheels of the law's model."""
        return self.filter.wheels

    def find(
        self, condition: ActuatorCondition, momentum: OfEach, before: "WheelsInUse | None" = None
    ) -> WheelsInUse:
        """The capability at momenta (N m s); `before` is that at the last sample.

        A wheel is excluded if it has failed, or its usable torque is below `WEAK` of its full
        torque. The thresholds are halved for wheels in use and for axes that were available, as
        hysteresis.
        """
        wheels, full = self.wheels, self.filter.full
        spare = condition.part * full - self.filter.friction(momentum, condition)
        used = before is not None and before.working
        enough = WEAK * full * jnp.where(used, 0.5, 1.0)
        usable = jnp.where(condition.failed | (spare < enough), 0.0, spare)
        weight = usable / jnp.max(full)
        axes = wheels.axes
        gram = (weight[None] * axes) @ axes.T
        around = adjugate(gram)
        minors, trace = jnp.trace(around), jnp.trace(gram)
        best = jnp.argmax(jnp.diagonal(around))
        normal = around[best] / jnp.sqrt(jnp.sum(around[best] ** 2) + SMALLEST)
        volume = jnp.sum(gram[0] * around[0])
        had = -1 if before is None else before.rank
        three = SPARE * jnp.where(had == Rank.THREE_AXES, 0.5, 1.0)
        plane = SPARE * jnp.where((had == Rank.THREE_AXES) | (had == Rank.PLANE), 0.5, 1.0)
        rank = jnp.where(
            volume > three * minors,
            int(Rank.THREE_AXES),
            jnp.where(minors > plane * trace, int(Rank.PLANE), int(Rank.LESS)),
        )
        inverse = _inverse(gram, trace, rank, normal)
        return WheelsInUse(usable, rank, normal, (weight[None] * axes).T @ inverse)

    def holding(self, wheels: WheelsInUse) -> Float[Array, "m 3"]:
        """Return the share of each wheel (m, 3) in a momentum that the used wheels hold."""
        limit, axes = self.wheels.momentum_limit, self.wheels.axes
        if limit is None or not self.uneven:
            return wheels.shares
        weight = jnp.where(wheels.working, (limit / jnp.max(limit)) ** 2, 0.0)
        columns = weight[None] * axes
        gram = columns @ axes.T
        return columns.T @ _inverse(gram, jnp.trace(gram), wheels.rank, wheels.normal)

    def shared(self, wheels: WheelsInUse, torque: Vector) -> OfEach:
        """Torque of each wheel on the body (N m) for a `torque` (N m), or its part in a plane."""
        within_plane = self.wheels.axes @ (wheels.shares @ torque)
        return allocate_evenly(self.wheels.axes, wheels.usable, within_plane).use

    def balanced(
        self, wheels: WheelsInUse, nearest: OfEach, momentum: OfEach, unloading: RealScalar
    ) -> OfEach:
        """Torques (N m): the `nearest` to those of a command, plus the balance of the momenta.

        `unloading` (1/s) is the rate at which momentum without effect on the body is removed, as
        far as the command leaves room.
        """
        in_use = jnp.where(wheels.working, momentum, 0.0)
        idle = in_use - self.holding(wheels) @ (self.wheels.axes @ in_use)
        idle = jnp.where(wheels.rank == Rank.THREE_AXES, unloading * idle, 0.0)
        return nearest + idle * within(wheels.usable, nearest, idle)

    def unloadable(
        self, wheels: WheelsInUse, momentum: OfEach, bias: Vector, field: Vector
    ) -> Vector:
        """Momentum (N m s) of the used wheels beyond a `bias`, as far as they can produce all
        torques that oppose its removal across the Earth's `field` (T).

        For two wheels that is the component along the one direction in their plane across the
        field, for one wheel zero.
        """
        excess = self.wheels.axes @ jnp.where(wheels.working, momentum, 0.0) - bias
        direction = jnp.cross(wheels.normal, field)
        squares = jnp.sum(direction**2)
        parallel = squares <= PARALLEL**2 * jnp.sum(field**2)
        along = direction @ excess / jnp.where(parallel, jnp.inf, squares)
        plane = jnp.where(wheels.rank == Rank.PLANE, along * direction, 0.0)
        return jnp.where(wheels.rank == Rank.THREE_AXES, excess, plane)

    def commands(self, condition: ActuatorCondition, momentum: OfEach, torque: OfEach) -> OfEach:
        """Motor torques (N m), within the limits, that produce `torque` (N m) on the body.

        A weak motor produces only a part of its command.
        """
        full, part = self.filter.full, condition.part
        friction, side = self.filter.friction(momentum, condition), self.filter.side(momentum)
        command = motor_torque(torque, friction, side)
        command = command / jnp.where(part > 0, part, 1.0)
        return jnp.clip(command, -full, full)

    def largest_momentum(self, wheels: WheelsInUse, stored: Vector) -> RealScalar | None:
        """Largest momentum (N m s) of the body in a slew about any axis; None without a limit.

        `stored` (N m s) is the momentum of the used wheels when the body is at rest.
        """
        limit = self.wheels.momentum_limit
        if limit is None:
            return None
        sizes = root(jnp.sum(self.holding(wheels) ** 2, axis=1))
        most_each = jnp.where(sizes > 0, limit / jnp.where(sizes > 0, sizes, 1.0), jnp.inf)
        most = jnp.min(most_each)
        free = MOST_MOMENTUM * most - length(stored)
        if self.uneven:
            room = MOST_MOMENTUM * limit - jnp.abs(self.holding(wheels) @ stored)
            free = jnp.min(jnp.where(sizes > 0, room / jnp.where(sizes > 0, sizes, 1.0), jnp.inf))
        return jnp.maximum(free, LEAST_MOMENTUM * most)


def _inverse(gram: Matrix, trace: RealScalar, rank: IntScalar, normal: Vector) -> Matrix:
    """Return the inverse of a weighted `gram` of axes, with its `trace`, for shares of wheels.

    No torque is demanded along a plane's normal; a term there makes gram invertible. With wheels
    along one axis, gram is trace times the projector onto it.
    """
    filled = gram + jnp.where(rank == Rank.PLANE, trace, 0.0) * jnp.outer(normal, normal)
    filled = jnp.where(rank == Rank.LESS, (trace + SMALLEST) * jnp.eye(3), filled)
    cofactors = adjugate(filled)
    return cofactors / (jnp.sum(filled[0] * cofactors[0]) + SMALLEST)


def within(usable: OfEach, torque: OfEach, more: OfEach) -> RealScalar:
    """The part of `more`, at most 1, that fits beside `torque` into the `usable` torques."""
    room = jnp.maximum(usable - jnp.abs(torque), 0.0)
    size = jnp.abs(more)
    return jnp.minimum(
        jnp.min(jnp.where(size > 0, room / jnp.where(size > 0, size, 1.0), 1.0)), 1.0
    )
