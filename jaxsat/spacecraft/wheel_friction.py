"""Motor torques that compensate the known friction of wheels."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxsat.core.checks import as_float
from jaxsat.core.quotients import SMALLEST
from jaxsat.spacecraft.wheels import Wheels

OfEach = Float[Array, " wheels"]

STILL = 4.0
"""Standard deviations of noise within which a measured momentum may be zero."""

SLIGHT = 0.1
"""Smallest torque that is to start a wheel at rest, relative to its friction."""


def motor_torque(torque: OfEach, friction: OfEach, side: OfEach) -> OfEach:
    """Return motor torques (N m) that make `torque` (N m) on the body against `friction` (N m).

    Friction acts by the wheel's direction of rotation, `side` from -1 to 1. A wheel near rest must
    overcome it to break away.
    """
    most = jnp.maximum(friction, 0.0)
    stiction = (1 - jnp.abs(side)) * jnp.clip(torque / SLIGHT, -most, most)
    return torque - friction * side + stiction


class WheelFriction(eqx.Module):
    """Friction of each wheel as known to the controller.

    `coulomb` (N m) brakes a turning wheel, and `decay` (1/s) times its momentum. Momenta below
    `rest` (N m s) may belong to a wheel at rest.
    """

    coulomb: OfEach = eqx.field(converter=as_float)
    decay: OfEach = eqx.field(converter=as_float)
    rest: OfEach = eqx.field(converter=as_float)

    @staticmethod
    def of(
        wheels: Wheels, works: ArrayLike, momentum_noise: ArrayLike, period: float
    ) -> "WheelFriction | None":
        """Return the friction of `wheels`, zero unless the motor `works`; None without friction.

        A law that runs once in a `period` (s) measures momenta by tachometers with noise (N m s, a
        standard deviation). A wheel may come to rest within a period.
        """
        if wheels.coulomb_friction is None and wheels.viscous_friction is None:
            return None
        coulomb, decay = np.zeros(wheels.count), np.where(works, wheels.decay, 0.0)
        if wheels.coulomb_friction is not None:
            coulomb = np.where(works, wheels.coulomb_friction, 0.0)
        rest = np.maximum(STILL * np.asarray(momentum_noise), period * coulomb)
        return WheelFriction(coulomb, decay, np.maximum(rest, SMALLEST))

    def motor_torque(self, torque: OfEach, momentum: OfEach) -> OfEach:
        """Return motor torques (N m) of wheels of a `momentum` (N m s) that make `torque` (N m)."""
        side = jnp.clip(momentum / self.rest, -1.0, 1.0)
        return motor_torque(torque, self.coulomb + self.decay * jnp.abs(momentum), side)
