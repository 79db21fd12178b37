"""How far the steps of a run are from the motion, estimated by halving them hold by hold."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.simulation.assessment import stop_gradient
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class IntegrationError(eqx.Module):
    """The error estimate of a run's steps: of the inertial rate (rad/s) and the attitude (rad).

    Each part of a run is integrated once more from the same state under the same commands with
    steps of half the length. The differences at its end are summed by size, and an error of the
    rate turns the attitude until the end of the run. So the sums are what the plant would be off by
    under the same commands; a law that sees the difference takes some of it back.
    """

    rate: Float[Array, "*n"]
    attitude: Float[Array, "*n"]

    @staticmethod
    def none(like: Float[Array, "..."]) -> "IntegrationError":
        """Before the first part, in the precision of an array."""
        zero = jnp.zeros((), like.dtype)
        return IntegrationError(zero, zero)

    def after(
        self,
        body: RigidBody,
        length: Float[Array, ""],
        whole: PlantState,
        halved: PlantState,
        weight: float = 1.0,
    ) -> "IntegrationError":
        """With a part of so many seconds, at whose end the plant is as whole and halved steps say.

        The momenta of effectors count as the rate that they give a body of the mean moment. The
        part stands for `weight` parts.
        """
        whole, halved = stop_gradient((whole, halved))
        rate = _norm(whole.omega - halved.omega)
        moment = jnp.trace(stop_gradient(body.spacecraft.inertia)) / 3
        pairs = zip(*map(jax.tree.leaves, (whole.effectors, halved.effectors)), strict=True)
        rate = sum((_norm(one - other) / moment for one, other in pairs), rate)
        one, other = (state.attitude.as_quaternion().q for state in (whole, halved))
        turn = 2 * jnp.minimum(_norm(one - other), _norm(one + other))
        carried = self.later(length)
        return IntegrationError(carried.rate + weight * rate, carried.attitude + weight * turn)

    def later(self, length: Float[Array, ""]) -> "IntegrationError":
        """After so many seconds without an error of their own."""
        return IntegrationError(self.rate, self.attitude + self.rate * stop_gradient(length))


def _norm(vector: Float[Array, " n"]) -> Float[Array, ""]:
    return jnp.sqrt(jnp.sum(vector**2))
