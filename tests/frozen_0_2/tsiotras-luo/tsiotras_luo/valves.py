"""Actuators of a package's own."""

import jax
import jax.numpy as jnp

from jaxsat import AbstractSmoothActuators, Actuators, PartDeclaration
from jaxsat.core.declaration import number


class CoarseValves(AbstractSmoothActuators):
    """Thrusters that are commanded in whole steps of torque."""

    declaration = PartDeclaration(
        summary="thrusters commanded in steps",
        keys=(number("step_N_m", "Least change of the command", "N m", above=0),),
    )

    thrusters: Actuators
    step: jax.Array

    @classmethod
    def from_table(cls, values, context):
        return cls(context.ideal, jnp.asarray(values["step_N_m"]))

    def __call__(self, command):
        return self.thrusters(self.step * jnp.round(command / self.step))
