"""Motor torques of wheels with friction of known size."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxsat.core.checks import as_float
from jaxsat.spacecraft.wheels import Wheels

OfEach = Float[Array, " wheels"]

STILL = 4.0
"""Sigmas of a momentum that may be zero."""

SLIGHT = 0.1
"""Of what friction holds back of a wheel at rest: the least torque for which it is to turn."""

SMALLEST = 1e-30
"""Keeps a quotient of two zeros finite."""


def motor_torque(torque: OfEach, friction: OfEach, side: OfEach) -> OfEach:
    """Motor torques (N m) that do `torque` (N m) to the body against `friction` (N m).

    Friction helps or hinders a wheel that turns, on the `side` from -1 to 1. One near rest has to
    break away from it.
    """
    most = jnp.maximum(friction, 0.0)
    held = (1 - jnp.abs(side)) * jnp.clip(torque / SLIGHT, -most, most)
    return torque - friction * side + held


class WheelFriction(eqx.Module):
    """Friction of each wheel as whoever commands it knows it.

    `coulomb` (N m) brakes a wheel that turns, and `decay` (1/s) times its momentum. Momenta below
    `rest` (N m s) may be those of a wheel at rest.
    """

    coulomb: OfEach = eqx.field(converter=as_float)
    decay: OfEach = eqx.field(converter=as_float)
    rest: OfEach = eqx.field(converter=as_float)

    @staticmethod
    def of(
        wheels: Wheels, works: ArrayLike, momentum_noise: ArrayLike, period: float
    ) -> "WheelFriction | None":
        """That of those of the `wheels` whose motor `works`; None where they have none.

        A law that runs once in a `period` (s) knows their momenta by tachometers with noise (N m s,
        a standard deviation). A wheel may come to rest within a period.
        """
        if wheels.coulomb_friction is None and wheels.viscous_friction is None:
            return None
        coulomb, decay = np.zeros(wheels.count), np.where(works, wheels.decay, 0.0)
        if wheels.coulomb_friction is not None:
            coulomb = np.where(works, wheels.coulomb_friction, 0.0)
        rest = np.maximum(STILL * np.asarray(momentum_noise), period * coulomb)
        return WheelFriction(coulomb, decay, np.maximum(rest, SMALLEST))

    def motor_torque(self, torque: OfEach, momentum: OfEach) -> OfEach:
        """Motor torques (N m) of wheels of a `momentum` (N m s) that do `torque` to the body."""
        side = jnp.clip(momentum / self.rest, -1.0, 1.0)
        return motor_torque(torque, self.coulomb + self.decay * jnp.abs(momentum), side)
