"""Assessment of a whole run on its integrator's own steps, independent of the saved instants.

The assessment contains settling time, effort and the estimate of the integration error.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import Pair, RealScalar, Vector
from jaxsat.core.tolerances import Tolerances, excess
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class Assessment(eqx.Module):
    """Settling time and effort of a run.

    `settled_from` (s) is the instant from which attitude and relative rate, `at_rest_from` the
    instant from which the inertial rate alone, stayed within the tolerances to the end; infinite if
    that began after 0.9 of the horizon or never. `effort` is ∫|T_i| dt of all effectors by body
    axis and `constraint_effort` that of the ideal torque by which the third rate is held, None
    where it is free, both in N m s; NaN where the run did not reach its end. A case that an engine
    has replayed has `settled_from` alone, the others are None.
    """

    settled_from: RealScalar
    at_rest_from: RealScalar | None = None
    effort: Vector | None = None
    constraint_effort: RealScalar | None = None


class JudgedSignals(NamedTuple):
    """The signals that decide settling; see `Signals`."""

    w: Pair
    z: RealScalar
    relative_rate: Vector
    omega: Vector

    @staticmethod
    def of(plant: RigidBody, state: PlantState) -> "JudgedSignals":
        """The observation of a plant in a state."""
        wz = state.attitude.as_wz()
        return JudgedSignals(wz.w, wz.z, plant.relative_rate(state), state.omega)

    def excess(self, tolerances: Tolerances) -> Vector:
        """Relative excess over the tolerances, see `jaxsat.core.tolerances.excess`."""
        return excess(self.w, self.z, self.relative_rate, tolerances)

    def rest_excess(self, tolerances: Tolerances) -> Float[Array, "1"]:
        """Relative excess of the inertial rate alone over its tolerance."""
        return jnp.sqrt(jnp.sum(self.omega**2))[None] / tolerances.relative_rate - 1


def stop_gradient(tree: PyTree) -> PyTree:
    """The tree with `stop_gradient` applied to every array."""
    return jax.tree.map(lambda x: jax.lax.stop_gradient(x) if eqx.is_array(x) else x, tree)


class IntegrationError(eqx.Module):
    """The error estimate of a run's steps: of the inertial rate (rad/s) and the attitude (rad).

    Each part of a run is integrated once more from the same state under the same commands with
    steps of half the length. The norms of the differences at its end are summed, and an error of
    the rate turns the attitude until the end of the run. The sums are therefore the plant's error
    under the same commands; feedback of a law reduces it.
    """

    rate: Float[Array, "*n"]
    attitude: Float[Array, "*n"]

    @staticmethod
    def none(like: Float[Array, "..."]) -> "IntegrationError":
        """Zero error, in the precision of the array `like`."""
        zero = jnp.zeros((), like.dtype)
        return IntegrationError(zero, zero)

    def after(
        self,
        body: RigidBody,
        length: RealScalar,
        whole: PlantState,
        halved: PlantState,
        weight: float = 1.0,
    ) -> "IntegrationError":
        """The sums after a part of `length` s, at whose end whole and halved steps give two states.

        The momentum of each effector counts as the rate that it gives a body of the mean moment.
        The part represents `weight` parts.
        """
        whole, halved = stop_gradient((whole, halved))
        rate = _norm(whole.omega - halved.omega)
        body = stop_gradient(body)
        for effector, *states in zip(body.effectors, whole.of_each, halved.of_each, strict=True):
            one, other = map(effector.momentum, states)
            if one is not None and other is not None:
                rate = rate + _norm(one - other) / body.spacecraft.momentum_unit
        one, other = (state.attitude.as_quaternion().q for state in (whole, halved))
        turn = 2 * jnp.minimum(_norm(one - other), _norm(one + other))
        previous = self.later(length)
        return IntegrationError(previous.rate + weight * rate, previous.attitude + weight * turn)

    def later(self, length: RealScalar) -> "IntegrationError":
        """The sums after `length` s without further error."""
        return IntegrationError(self.rate, self.attitude + self.rate * stop_gradient(length))


def _norm(vector: Float[Array, " n"]) -> RealScalar:
    return jnp.sqrt(jnp.sum(vector**2))
