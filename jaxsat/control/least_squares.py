"""Least squares for the errors of axes and inertia, through which torques reach the third axis."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.array_types import IntScalar, RealScalar, Vector
from jaxsat.core.checks import positive, require_counts
from jaxsat.core.quotients import reciprocal
from jaxsat.core.trees import Symmetric

PRIOR = (0.03, 0.03, 0.08, 0.03, 0.03, 0.03, 0.003, 0.003)
"""Standard deviations of ε1, ε2 and of the coefficients of Q."""


class Fit(NamedTuple):
    """Estimate (ε1, ε2, and six of Q), its covariance, and the sums of the current interval."""

    estimate: Float[Array, " n"]
    covariance: Symmetric
    first_omega: Vector
    products: Float[Array, " p"]
    samples: IntScalar


class RecursiveLeastSquares(eqx.Module):
    """Recursive least squares for the errors of axes and inertia that reach the third axis.

    Two torques along any two axes and any inertia give J dω/dt = -ω × Jω + A u, and u can be
    eliminated: dω3/dt = ε1 dω1/dt + ε2 dω2/dt + Q(ω), exactly, Q quadratic. Over an interval of
    `samples` control periods
        Δω3 - c ∫ω1ω2 = ε1 Δω1 + ε2 Δω2 + ∫(Q - c ω1ω2) dt
    is linear in ε and the six coefficients of Q - c ω1ω2, those of ω1ω2 (that is δc), ω1² - ω2²
    (-J12 / J3 to first order), ω2ω3, ω1ω3, and two of second order, ω1² + ω2² and ω3². To first
    order ε collects torque axes that lean towards the third body axis and J13, J23. `prior` are
    the initial standard deviations (shape (8,)), `noise` that of one Δω3 (rad/s).
    """

    noise: RealScalar = eqx.field(converter=positive("noise"))
    prior: Float[Array, " n"] = eqx.field(converter=positive("prior"), default=PRIOR)
    samples: int = eqx.field(static=True, default=10)
    mean: Float[Array, " n"] | None = None

    def __check_init__(self):
        require_counts(samples=self.samples)

    def init(self, omega: Vector) -> Fit:
        """The initial memory, with zero errors."""
        return Fit(
            jnp.zeros_like(self.prior) if self.mean is None else self.mean,
            Symmetric(jnp.diag(self.prior**2).astype(omega.dtype)),
            omega,
            jnp.zeros_like(self.prior[2:]),
            jnp.array(-1),  # the first sample only begins an interval
        )

    def update(
        self, fit: Fit, omega: Vector, products: Float[Array, " p"], factors: Float[Array, "6"]
    ) -> Fit:
        """Add one sample; `products` are the six integrals since the last sample.

        `factors` are the six of the model's own Q, to which the estimate is added. `samples` is
        zero after a sample that has ended an interval or begun the first.
        """
        fit = fit._replace(products=fit.products + products, samples=fit.samples + 1)
        full = fit.samples >= self.samples
        return jax.lax.cond(full, lambda: self._corrected(fit, omega, factors), lambda: fit)

    def _corrected(self, fit: Fit, omega: Vector, factors: Float[Array, "6"]) -> Fit:
        """The fit with the interval that ends now, at the beginning of the next one."""
        change = omega - fit.first_omega
        regressor = jnp.concatenate([change[:2], fit.products])
        covariance = fit.covariance.matrix
        projected = jnp.sum(covariance * regressor[None, :], axis=1)
        inverse = reciprocal(self.noise**2 + jnp.sum(regressor * projected))
        residual = (
            change[2] - jnp.sum(factors * fit.products[:6]) - jnp.sum(regressor * fit.estimate)
        )
        return Fit(
            fit.estimate + projected * (inverse * residual),
            Symmetric(covariance - inverse * (projected[:, None] * projected[None, :])),
            omega,
            jnp.zeros_like(fit.products),
            jnp.zeros_like(fit.samples),
        )
