"""Thrusters beside wheels: torque beyond the wheels' limits, and unloading of momentum."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.checks import as_float, positive
from jaxsat.core.declaration.three_torques import FULL
from jaxsat.spacecraft.allocation import allocate_unloading
from jaxsat.spacecraft.effector import Reach

OfEach = Float[Array, " wheels"]

REACTION = 0.5
"""Fraction of a wheel's torque limit that unloads it at its momentum limit."""

FASTEST = 0.25
"""Largest unloading rate of momentum beyond `FULL`, times the period."""


class Relief(eqx.Module):
    """Assistance of `thrusters` to wheels along unit `axes`, (3, wheels), zero for a failed one.

    Each wheel has a `torque_limit` (N m) and a `momentum_limit` (N m s), both of which may be
    infinite. `shares` (wheels, 3) allocates a torque, or a momentum, to wheels without limits.
    `inertia` (kg m²) is that of the body; the law runs once in a `period` (s). `thrusters` is their
    reach, with prices, as the allocator knows it.
    """

    thrusters: Reach
    axes: Float[Array, "3 wheels"] = eqx.field(converter=as_float)
    shares: Float[Array, "wheels 3"] = eqx.field(converter=as_float)
    torque_limit: OfEach = eqx.field(converter=positive("torque_limit"))
    momentum_limit: OfEach = eqx.field(converter=positive("momentum_limit"))
    inertia: Matrix = eqx.field(converter=as_float)
    period: RealScalar = eqx.field(converter=positive("period"))

    def bounds(self, momentum: OfEach) -> tuple[OfEach, OfEach]:
        """Return bounds of wheel torques (N m) on the body for a period, from a `momentum` (N m s).

        A torque on the body changes the wheel's momentum, whose limit bounds the torque.
        """
        up, down = (
            jnp.maximum(self.momentum_limit + side * momentum, 0.0) / self.period
            for side in (1.0, -1.0)
        )
        return -jnp.minimum(self.torque_limit, down), jnp.minimum(self.torque_limit, up)

    def unloading(self, omega: Vector, momentum: OfEach) -> Vector:
        """Return the torque (N m) by which thrusters unload wheels at a body rate (rad/s).

        It uses each wheel's share of the momentum of body and wheels with the body at rest, so that
        momentum that a slew returns is not unloaded. The torque is zero up to `FULL` of the limit,
        and proportional to the excess beyond, without memory: momentum settles near there.
        """
        total = self.inertia @ omega + self.axes @ momentum
        each = self.shares @ total
        dead_band = FULL * self.momentum_limit
        beyond = each - jnp.clip(each, -dead_band, dead_band)
        rate = REACTION * self.torque_limit / ((1 - FULL) * self.momentum_limit)
        most = REACTION * self.torque_limit
        demand = jnp.clip(jnp.minimum(rate, FASTEST / self.period) * beyond, -most, most)
        return -(self.axes @ demand)

    def allocate(
        self, torque: Vector, unloading: Vector, momentum: OfEach
    ) -> tuple[OfEach, Vector, Vector]:
        """Return the torque of each wheel, of all thrusters, and the torque not made (N m)."""
        low, high = self.bounds(momentum)
        thrusters, free = self.thrusters, jnp.zeros_like(low)
        price = jnp.ones_like(thrusters.high) if thrusters.price is None else thrusters.price
        reach = Reach(
            jnp.concatenate([self.axes, thrusters.columns], axis=1),
            jnp.concatenate([low, thrusters.low]),
            jnp.concatenate([high, thrusters.high]),
            jnp.concatenate([free, price]),
        )
        wheels = free.shape[0]
        allocated = allocate_unloading(
            reach, torque, unloading, jnp.arange(reach.low.shape[0]) < wheels
        )
        use = allocated.use
        return use[:wheels], thrusters.columns @ use[wheels:], allocated.unmade
