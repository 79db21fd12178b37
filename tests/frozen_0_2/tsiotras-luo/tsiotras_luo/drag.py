"""A disturbance of a package's own."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat import AbstractDisturbance, PartDeclaration
from jaxsat.core.declaration import number


class AerodynamicTorque(AbstractDisturbance):
    """A force against the velocity, which is along x of the orbit frame, at a lever arm."""

    declaration = PartDeclaration(
        summary="a constant aerodynamic force at a lever arm",
        keys=(
            number("force_N", "Force against the velocity", "N", at_least=0),
            number("arm_m", "Centre of pressure from the centre of mass", "m", size=3),
        ),
    )

    force: Float[Array, ""] = eqx.field(converter=jnp.asarray)
    arm: Float[Array, "3"] = eqx.field(converter=jnp.asarray)

    @classmethod
    def from_table(cls, values, context):
        return cls(values["force_N"], values["arm_m"])

    def __call__(self, t, attitude, inertia):
        along = attitude.as_dcm().matrix @ jnp.array([-1.0, 0.0, 0.0])
        return jnp.cross(self.arm, self.force * along)
