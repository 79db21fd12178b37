"""Fit of the total momentum of body and wheels together with the inertia.

With the inertia J of the law's model, E its error and the wheels' momentum A h the total is H = Cᵀ
((J + E) ω + A h) in the axes of the target, C the attitude. Without external torque it is constant:
recursive least squares of Cᵀ (J ω + A h) = H - Cᵀ E ω, linear in H (3) and E (6).
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.inertia_fit import BASIS, BELIEVED, MOMENT_ERROR, PLACES, PRODUCT_ERROR
from jaxsat.core.array_types import BoolScalar, IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.checks import positive
from jaxsat.core.trees import Symmetric
from jaxsat.spacecraft.spacecraft import Spacecraft

SAMPLES = 10
"""Number of control periods between updates."""


class MomentumMemory(NamedTuple):
    """E and H (rad/s), over the mean moment, their covariance, and samples since the update."""

    estimate: Float[Array, "9"]
    covariance: Symmetric
    samples: IntScalar


class MomentumFit(eqx.Module):
    """Recursive least squares for the total momentum and the errors of the inertia.

    The standard deviation of an unknown momentum is `unknown`, that of a measured total is `noise`;
    external torque changes the momentum by `walk` between updates. All are rates (rad/s): the
    momentum over the mean moment.
    """

    spacecraft: Spacecraft
    unknown: RealScalar = eqx.field(converter=positive("unknown"))
    noise: RealScalar = eqx.field(converter=positive("noise"))
    walk: RealScalar = eqx.field(converter=positive("walk"))

    def init(self) -> MomentumMemory:
        """The initial memory, with zero estimates."""
        prior = jnp.concatenate([self._prior(), jnp.full(3, self.unknown)])
        return MomentumMemory(jnp.zeros(9), Symmetric(jnp.diag(prior**2)), jnp.array(SAMPLES))

    def _prior(self) -> Float[Array, "6"]:
        """Standard deviations of E over the mean moment."""
        diagonal = jnp.diagonal(self.spacecraft.inertia) / self.spacecraft.momentum_unit
        products = [jnp.sqrt(diagonal[row] * diagonal[column]) for row, column in PLACES[3:]]
        return jnp.concatenate([MOMENT_ERROR * diagonal, PRODUCT_ERROR * jnp.stack(products)])

    def known(self, memory: MomentumMemory) -> tuple[Vector, RealScalar]:
        """H and its standard deviation, N m s."""
        unit = self.spacecraft.momentum_unit
        variance = jnp.sum(jnp.diagonal(memory.covariance.matrix)[6:])
        return unit * memory.estimate[6:], unit * jnp.sqrt(jnp.maximum(variance, 0.0))

    def inertia(self, memory: MomentumMemory) -> Matrix:
        """J + E, kg m², with E bounded by three standard deviations of its prior."""
        prior = BELIEVED * self._prior()
        errors = jnp.clip(memory.estimate[:6], -prior, prior)
        error = jnp.sum(errors[:, None, None] * jnp.asarray(BASIS, errors.dtype), axis=0)
        return self.spacecraft.inertia + self.spacecraft.momentum_unit * error

    def update(
        self,
        memory: MomentumMemory,
        into_body: Matrix,
        omega: Vector,
        total: Vector,
        again: BoolScalar,
    ) -> MomentumMemory:
        """The memory after one more sample: the attitude, ω (rad/s) and the `total` momentum Cᵀ(Jω
        + A h) (N m s) by the model. `again` is true if H is new, after a failure."""
        due = (memory.samples + 1 >= SAMPLES) | again

        def corrected() -> MomentumMemory:
            return self._corrected(memory, into_body, omega, total, again)

        later = memory._replace(samples=memory.samples + 1)
        return jax.lax.cond(due, corrected, lambda: later)

    def _corrected(
        self,
        memory: MomentumMemory,
        into_body: Matrix,
        omega: Vector,
        total: Vector,
        again: BoolScalar,
    ) -> MomentumMemory:
        """The memory after the three equations, one at a time."""
        estimate, covariance = memory.estimate, memory.covariance.matrix
        fresh = jnp.where(again, self.unknown, self.walk)
        grown = jnp.concatenate([jnp.zeros(6), jnp.ones(3)]) * fresh
        covariance = covariance + jnp.diag(grown**2)
        basis = jnp.asarray(BASIS, estimate.dtype)
        turned = -(
            jnp.sum(basis * omega[None, None, :], axis=-1) @ into_body
        )  # of -Cᵀ E ω, a row each of E
        rows = jnp.concatenate([turned, jnp.eye(3)])
        reading = total / self.spacecraft.momentum_unit
        for number in range(3):
            row = rows[:, number]
            projected = jnp.sum(covariance * row[None, :], axis=1)
            gain = projected / (self.noise**2 + jnp.sum(row * projected))
            estimate = estimate + gain * (reading[number] - jnp.sum(row * estimate))
            covariance = covariance - gain[:, None] * projected[None, :]
        return MomentumMemory(estimate, Symmetric(covariance), jnp.zeros_like(memory.samples))
