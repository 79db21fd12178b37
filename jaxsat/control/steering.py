"""How effectors share in a commanded torque before all other actuators are asked."""

import abc
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.checks import as_float, as_optional_float, require_positive
from jaxsat.spacecraft import Magnetorquers, nearest_within, wheel_momentum
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.environment import DipoleField


class AbstractSteering(eqx.Module):
    """What one `kind` of effector makes of a law's command of three torques."""

    kind: eqx.AbstractClassVar[str]
    """That of the effector of the body that is commanded."""

    axes: eqx.AbstractVar[Float[Array, "3 k"]]
    """A unit vector for each of them, body axes."""

    @abc.abstractmethod
    def __call__(
        self, t: Float[Array, ""], state: PlantState, command: Float[Array, "3"]
    ) -> tuple[Float[Array, " k"], Float[Array, "3"]]:
        """The command of each at time `t` (s), and what of a torque (N m) is left to others.

        `state` is what the law is told of the plant.
        """


class MagneticSteering(AbstractSteering):
    """Dipoles m = B × τ / |B|², which make of a wanted torque τ what is across the field B.

    τ = `wanted` u - `unloading` A h: a part of the law's command u (N m), and what takes momentum h
    along `wheel_axes` A out of the wheels, in parts a second. `shares` (k, 3) makes a dipole of the
    magnetorquers along `axes`. Where that exceeds the `dipole_limit` (A m²) of one, others make up
    for it; of a torque that they cannot make, the greatest part is. What they then make is left out
    of the command of all other actuators, so that the body feels the law's torque. B is that of the
    `field` at the attitude that the law is told. Sidi, Spacecraft Dynamics and Control, 1997,
    sections 7.4 and 7.5: the cross-product law.
    """

    kind: ClassVar[str] = Magnetorquers.kind

    field: DipoleField
    axes: Float[Array, "3 k"] = eqx.field(converter=as_float)
    shares: Float[Array, "k 3"] = eqx.field(converter=as_float)
    dipole_limit: Float[Array, " k"] = eqx.field(converter=as_float)
    wanted: Float[Array, "3 3"] = eqx.field(converter=as_float)
    unloading: Float[Array, ""] = eqx.field(converter=as_float, default=0.0)
    wheel_axes: Float[Array, "3 wheels"] | None = eqx.field(
        converter=as_optional_float, default=None
    )

    def __check_init__(self):
        require_positive("dipole_limit", self.dipole_limit)
        require_positive("unloading", self.unloading, zero_allowed=True)

    def __call__(
        self, t: Float[Array, ""], state: PlantState, command: Float[Array, "3"]
    ) -> tuple[Float[Array, " k"], Float[Array, "3"]]:
        """The dipole of each magnetorquer (A m²), and the command left to others (N m)."""
        field = self.field.in_body(t, state.attitude)
        torque = self.wanted @ command
        momentum = wheel_momentum(state)
        if self.wheel_axes is not None and momentum is not None:
            torque = torque - self.unloading * (self.wheel_axes @ momentum)
        square = jnp.sum(field**2)
        shares = self.shares @ (jnp.cross(field, torque) / square)
        across = jnp.cross(self.axes, (field / jnp.sqrt(square))[:, None], axis=0)
        working = jnp.where(jnp.any(self.shares != 0, axis=1), 1.0, 0.0)
        dipoles, _ = nearest_within(across, working, self.dipole_limit, shares)
        return dipoles, command - jnp.cross(self.axes @ dipoles, field)
