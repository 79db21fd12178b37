"""What a whole run was, judged on its integrator's own steps, whatever instants are saved."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.tolerances import Tolerances, excess
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class Assessment(eqx.Module):
    """When a run settled, and what that took.

    `settled_from` (s) is the instant from which attitude and relative rate, `at_rest_from` that
    from which the inertial rate alone, stayed within the tolerances to the end; infinite where that
    began after 0.9 of the horizon or never. `effort` is ∫|T_i| dt of the thrusters by body axis
    and `constraint_effort` that of the ideal torque by which the third rate is held, None where it
    is free, both in N m s; NaN where the run did not reach its end. A case that an engine has
    replayed tells `settled_from` alone, the others are None.
    """

    settled_from: Float[Array, ""]
    at_rest_from: Float[Array, ""] | None = None
    effort: Float[Array, "3"] | None = None
    constraint_effort: Float[Array, ""] | None = None


class Observation(NamedTuple):
    """What of the signals settling is judged by; see `Signals`."""

    w: Float[Array, "2"]
    z: Float[Array, ""]
    relative_rate: Float[Array, "3"]
    omega: Float[Array, "3"]

    @staticmethod
    def of(plant: RigidBody, state: PlantState) -> "Observation":
        """That of a plant in a state."""
        wz = state.attitude.as_wz()
        return Observation(wz.w, wz.z, plant.relative_rate(state), state.omega)

    def excess(self, tolerances: Tolerances) -> Float[Array, "3"]:
        """How far outside the tolerances, see `jaxsat.core.tolerances.excess`."""
        return excess(self.w, self.z, self.relative_rate, tolerances)

    def rest_excess(self, tolerances: Tolerances) -> Float[Array, "1"]:
        """The same of the inertial rate alone."""
        return jnp.sqrt(jnp.sum(self.omega**2))[None] / tolerances.relative_rate - 1


def stop_gradient(tree: PyTree) -> PyTree:
    """The tree with nothing to be differentiated."""
    return jax.tree.map(lambda x: jax.lax.stop_gradient(x) if eqx.is_array(x) else x, tree)
