"""What is left of a set of wheels after failures, and how a torque is shared among them.

The weighted least squares of a 3 x 3 system by its adjugate: no factorisation in the loop.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.control.diagnosis.diagnosis import WEAK
from jaxsat.control.diagnosis.residual import ActuatorCondition
from jaxsat.control.diagnosis.wheel_filter import WheelFilter
from jaxsat.control.reconfiguration import Left
from jaxsat.core.array_types import IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.quotients import length, root
from jaxsat.spacecraft.allocation import allocate
from jaxsat.spacecraft.effector import Reach
from jaxsat.spacecraft.wheel_friction import motor_torque
from jaxsat.spacecraft.wheels import Wheels

OfEach = Float[Array, " m"]

SPARE = 0.02
"""Of the sum of squares of all wheels' parts along an axis: what must be left along each."""

MOST_MOMENTUM = 0.9
"""Of what the wheels left can hold: what a slew may make them hold."""

LEAST_MOMENTUM = 0.02
"""Of the same: what a slew may make them hold however full they are."""

PARALLEL = 1e-3
"""Sine of the angle between the Earth's field and the normal of two wheels' plane that is none:
magnetorquers then take nothing out of them."""

SMALLEST = 1e-30
"""Keeps a quotient of two zeros finite."""


class Wheeled(NamedTuple):
    """What wheels can do in a condition.

    `usable` (N m) is the torque that each has to spare beyond what brakes it, zero for one that is
    left out. `left` is what they make together, `normal` the unit vector about which they make
    least, and `shares` (m, 3) what each does of a torque on the body.
    """

    usable: OfEach
    left: IntScalar
    normal: Vector
    shares: Float[Array, "m 3"]

    @property
    def working(self) -> Bool[Array, " m"]:
        """Which wheels are used."""
        return self.usable > 0


def adjugate(matrix: Matrix) -> Matrix:
    """det(M) M⁻¹ of a symmetric matrix, also where there is no inverse."""
    a, b, c = matrix
    return jnp.stack([jnp.cross(b, c), jnp.cross(c, a), jnp.cross(a, b)])


class WheelAllocation(eqx.Module):
    """Which wheels are used in a condition, and what each does of a commanded torque.

    Wheels are weighted by the torque that they have to spare. Where that of one is too small,
    others make up for it; of a command that they cannot make, the greatest part is. Momentum that
    makes no torque on the body, where there are more wheels than axes, is driven to zero.
    """

    filter: WheelFilter

    @property
    def wheels(self) -> Wheels:
        """The wheels that the law believes in."""
        return self.filter.wheels

    def find(
        self, condition: ActuatorCondition, momentum: OfEach, before: "Wheeled | None" = None
    ) -> Wheeled:
        """What is left at momenta (N m s); `before` is what was left at the last sample.

        A wheel is left out that has failed, or has less than `WEAK` of its torque to spare. Half of
        what is asked of others is enough for one that was used, and for axes that were there, so
        that nothing changes to and fro.
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
        had = -1 if before is None else before.left
        three = SPARE * jnp.where(had == Left.THREE_AXES, 0.5, 1.0)
        plane = SPARE * jnp.where((had == Left.THREE_AXES) | (had == Left.PLANE), 0.5, 1.0)
        left = jnp.where(
            volume > three * minors,
            int(Left.THREE_AXES),
            jnp.where(minors > plane * trace, int(Left.PLANE), int(Left.LESS)),
        )
        # Along the normal of a plane nothing is asked for; one there makes an inverse.
        more = jnp.where(left == Left.THREE_AXES, 0.0, trace) * jnp.outer(normal, normal)
        more = more + jnp.where(left == Left.LESS, trace + SMALLEST, 0.0) * jnp.eye(3)
        filled = gram + more
        cofactors = adjugate(filled)
        inverse = cofactors / (jnp.sum(filled[0] * cofactors[0]) + SMALLEST)
        return Wheeled(usable, left, normal, (weight[None] * axes).T @ inverse)

    def shared(self, wheeled: Wheeled, torque: Vector) -> OfEach:
        """What each wheel does to the body (N m) for a `torque` (N m), or its part in a plane."""
        reach = Reach(self.wheels.axes, -wheeled.usable, wheeled.usable)
        within_plane = self.wheels.axes @ (wheeled.shares @ torque)
        return allocate(reach, within_plane).use

    def balanced(
        self, wheeled: Wheeled, nearest: OfEach, momentum: OfEach, unloading: RealScalar
    ) -> OfEach:
        """Torques (N m) with the `nearest` to those of a command, and what balances the momenta.

        `unloading` (1/s) is the rate at which momentum without effect on the body is taken out, as
        far as the command leaves room.
        """
        held = jnp.where(wheeled.working, momentum, 0.0)
        idle = held - wheeled.shares @ (self.wheels.axes @ held)
        idle = jnp.where(wheeled.left == Left.THREE_AXES, unloading * idle, 0.0)
        return nearest + idle * within(wheeled.usable, nearest, idle)

    def unloadable(self, wheeled: Wheeled, momentum: OfEach, bias: Vector, field: Vector) -> Vector:
        """What wheels in use hold of their momenta (N m s) beyond a `bias`, as far as they make all
        torques against one that takes it out across the Earth's `field` (T).

        Of two wheels that is the part along the one direction in their plane that is across the
        field, of one it is nothing.
        """
        excess = self.wheels.axes @ jnp.where(wheeled.working, momentum, 0.0) - bias
        direction = jnp.cross(wheeled.normal, field)
        squares = jnp.sum(direction**2)
        parallel = squares <= PARALLEL**2 * jnp.sum(field**2)
        along = direction @ excess / jnp.where(parallel, jnp.inf, squares)
        plane = jnp.where(wheeled.left == Left.PLANE, along * direction, 0.0)
        return jnp.where(wheeled.left == Left.THREE_AXES, excess, plane)

    def commands(self, condition: ActuatorCondition, momentum: OfEach, torque: OfEach) -> OfEach:
        """Motor torques (N m), within the limits, that do `torque` (N m) to the body.

        Of what is commanded a weak motor makes a part.
        """
        full, part = self.filter.full, condition.part
        friction, side = self.filter.friction(momentum, condition), self.filter.side(momentum)
        command = motor_torque(torque, friction, side)
        command = command / jnp.where(part > 0, part, 1.0)
        return jnp.clip(command, -full, full)

    def largest_momentum(self, wheeled: Wheeled, stored: Vector) -> RealScalar | None:
        """Momentum (N m s) that a slew about any axis may give the body; None for no limit.

        `stored` (N m s) is what wheels in use hold when the body is at rest.
        """
        limit = self.wheels.momentum_limit
        if limit is None:
            return None
        sizes = root(jnp.sum(wheeled.shares**2, axis=1))
        held = jnp.where(sizes > 0, limit / jnp.where(sizes > 0, sizes, 1.0), jnp.inf)
        most = jnp.min(held)
        free = MOST_MOMENTUM * most - length(stored)
        return jnp.maximum(free, LEAST_MOMENTUM * most)


def within(usable: OfEach, torque: OfEach, more: OfEach) -> RealScalar:
    """The part of `more`, at most 1, that fits with what is `made` into the torques to spare."""
    room = jnp.maximum(usable - jnp.abs(torque), 0.0)
    size = jnp.abs(more)
    return jnp.minimum(
        jnp.min(jnp.where(size > 0, room / jnp.where(size > 0, size, 1.0), 1.0)), 1.0
    )
