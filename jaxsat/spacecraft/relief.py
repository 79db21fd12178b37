"""Thrusters beside wheels: the torque that wheels lack, and momentum out of those nearly full."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.checks import as_float, positive
from jaxsat.spacecraft.allocation import allocate_unloading
from jaxsat.spacecraft.effector import Reach

OfEach = Float[Array, " wheels"]

FULL = 0.7
"""Of the largest momentum of a wheel: beyond it thrusters take momentum out."""

REACTION = 0.5
"""Of the largest torque of a wheel: what it makes at its full momentum against thrusters that take
momentum out."""

FASTEST = 0.25
"""Over a period: the rate at which momentum beyond `FULL` is taken out at most."""


class Relief(eqx.Module):
    """What `thrusters` do for wheels along unit `axes`, (3, wheels), zero for a failed one.

    Each wheel has a `torque_limit` (N m) and a `momentum_limit` (N m s), both of which may be
    infinite. `shares` (wheels, 3) is what each does of a torque, and holds of a momentum, without
    limits. `inertia` (kg m²) is that of the body; the law runs once in a `period` (s). What the
    thrusters can do, and at what price, is their reach as whoever allocates knows it.
    """

    thrusters: Reach
    axes: Float[Array, "3 wheels"] = eqx.field(converter=as_float)
    shares: Float[Array, "wheels 3"] = eqx.field(converter=as_float)
    torque_limit: OfEach = eqx.field(converter=positive("torque_limit"))
    momentum_limit: OfEach = eqx.field(converter=positive("momentum_limit"))
    inertia: Matrix = eqx.field(converter=as_float)
    period: RealScalar = eqx.field(converter=positive("period"))

    def bounds(self, momentum: OfEach) -> tuple[OfEach, OfEach]:
        """Torques (N m) on the body that each wheel of a `momentum` (N m s) makes for a period.

        A torque on the body takes momentum out of the wheel: it ends at the limit of that.
        """
        up, down = (
            jnp.maximum(self.momentum_limit + side * momentum, 0.0) / self.period
            for side in (1.0, -1.0)
        )
        return -jnp.minimum(self.torque_limit, down), jnp.minimum(self.torque_limit, up)

    def unloading(self, omega: Vector, momentum: OfEach) -> Vector:
        """The torque (N m) by which thrusters take momentum out of wheels at a rate (rad/s).

        It counts what each wheel would hold of the momentum of body and wheels once the body rests,
        so that none is taken out that a slew gives back. Up to `FULL` of its limit that is nothing;
        beyond, there is a torque in proportion, with no memory: momentum stays about there.
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
        """The torque of each wheel, of all thrusters, and what both do not make (N m)."""
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
