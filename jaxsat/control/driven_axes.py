"""Least squares for the effect of the two torques and the gyroscopic terms on the driven axes."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.estimators import integrated_products, products_of
from jaxsat.control.normal_form import NormalForm
from jaxsat.control.planning.transcription import AbstractCorrection
from jaxsat.core.array_types import IntScalar, Pair, RealScalar, Vector
from jaxsat.core.checks import positive, require_counts
from jaxsat.spacecraft.dynamics import PlantState

TORQUE_ERROR, ACROSS_ERROR, PRODUCT_ERROR = 0.12, 0.03, 0.1
"""Standard deviations of the gain of a torque about its own axis and about the other one, and of
the main gyroscopic term relative to (S_other + n·Jn) / S; other products have `ACROSS_ERROR`."""

UNKNOWN_TORQUE = 0.002
"""Standard deviation of unknown torques over an interval, as a share of the limit."""

BELIEVED = 3.0
"""Bound on estimates, in standard deviations of the prior."""


class DrivenMemory(NamedTuple):
    """Errors of the model, a row for x and y each, their covariances, and the current interval.

    Columns belong to the accelerations by the two torques and to the six products. `first` are the
    (p1, p2) at its beginning, `expected` their change by the model, `regressor` the factors of the
    errors, all rad/s but for the products' rad²/s. `omega` is the last (p1, p2, s), and `torque`
    about x and y (N m) acts from then on.
    """

    errors: Float[Array, "2 8"]
    covariance: Float[Array, "2 8 8"]
    first: Pair
    expected: Pair
    regressor: Float[Array, "8"]
    omega: Vector
    torque: Pair
    samples: IntScalar


class DrivenFit(eqx.Module):
    """Recursive least squares for dp/dt = S⁻¹ (u + gyroscopic torque) + E (S⁻¹ u, products).

    Any two torques and any inertia give dp/dt = B u + Q(p1, p2, s), exactly, Q quadratic
    (`docs/laws.md`); E is the difference of B and Q from the model's. Over an interval of `samples`
    control periods Δp less the model's part is linear in E. `limit` (N m) is that of the torques,
    `rate_noise` (rad/s) the standard deviation of a measured rate.
    """

    form: NormalForm
    limit: RealScalar = eqx.field(converter=positive("limit"))
    rate_noise: RealScalar = eqx.field(converter=positive("rate_noise"))
    samples: int = eqx.field(static=True, default=5)

    def __check_init__(self):
        require_counts(samples=self.samples)

    @property
    def prior(self) -> Float[Array, "2 8"]:
        """Standard deviations of the errors."""
        first, second, third = self.form.moments
        across = jnp.full_like(first, ACROSS_ERROR)
        own = jnp.full_like(first, TORQUE_ERROR)
        rest = [across, across]
        x = [own, across, *rest, PRODUCT_ERROR * (second + third) / first, across, *rest]
        y = [across, own, *rest, across, PRODUCT_ERROR * (first + third) / second, *rest]
        return jnp.stack([jnp.stack(x), jnp.stack(y)])

    def init(self, omega: Vector) -> DrivenMemory:
        """The initial memory, with zero errors, at the rates (p1, p2, s), rad/s."""
        none = jnp.zeros(2, omega.dtype)
        variance = (self.prior**2).astype(omega.dtype)
        return DrivenMemory(
            jnp.zeros((2, 8), omega.dtype),
            jnp.stack([jnp.diag(variance[0]), jnp.diag(variance[1])]),
            none,
            none,
            jnp.zeros(8, omega.dtype),
            omega,
            none,
            jnp.array(-1),  # the first sample only begins an interval
        )

    def sampled(
        self, t: RealScalar, state: PlantState, memory: DrivenMemory, period: RealScalar
    ) -> DrivenMemory:
        """The memory after one more sample, `period` (s) after the last."""
        omega = self.form.slow(self.form.axes @ state.omega)
        runs, middle = memory.samples >= 0, (memory.omega + omega) / 2
        turning = self.form.gyroscopic_torque
        model_torque = (turning(memory.omega) + 4 * turning(middle) + turning(omega)) / 6
        model_torque = model_torque + self.form.axes[:2] @ self.form.model.disturbance_torque(
            t - period / 2, state
        )
        by_torque = self._by_inertia(memory.torque) * period
        products = integrated_products(memory.omega, omega, period)
        expected = memory.expected + by_torque + self._by_inertia(model_torque) * period
        regressor = memory.regressor + jnp.concatenate([by_torque, products])
        memory = memory._replace(
            first=jnp.where(runs, memory.first, omega[:2]),
            expected=jnp.where(runs, expected, 0.0),
            regressor=jnp.where(runs, regressor, 0.0),
            omega=omega,
            samples=memory.samples + 1,
        )
        full = memory.samples >= self.samples
        return jax.lax.cond(full, lambda: self._corrected(memory, period), lambda: memory)

    def _by_inertia(self, torque: Pair) -> Pair:
        """S⁻¹ times a torque about x and y, rad/s²."""
        (a, b), (_, d) = self.form.reduced_inertia
        x, y = torque
        return jnp.stack([d * x - b * y, a * y - b * x]) / (a * d - b * b)

    def _corrected(self, memory: DrivenMemory, period: RealScalar) -> DrivenMemory:
        """The memory with the interval that ends now, at the beginning of the next one."""
        regressor, covariance = memory.regressor, memory.covariance
        span = self.samples * period
        unknown = self._by_inertia(jnp.stack([self.limit, self.limit])) * UNKNOWN_TORQUE * span
        noise = 2 * self.rate_noise**2 + unknown**2
        projected = jnp.sum(covariance * regressor[None, None, :], axis=2)
        gain = projected / (noise + jnp.sum(projected * regressor[None, :], axis=1))[:, None]
        residual = memory.omega[:2] - memory.first - memory.expected
        residual = residual - jnp.sum(memory.errors * regressor[None, :], axis=1)
        return memory._replace(
            errors=memory.errors + gain * residual[:, None],
            covariance=covariance - gain[:, :, None] * projected[:, None, :],
            first=memory.omega[:2],
            expected=jnp.zeros_like(memory.expected),
            regressor=jnp.zeros_like(regressor),
            samples=jnp.zeros_like(memory.samples),
        )

    def believed(self, memory: DrivenMemory) -> Float[Array, "2 8"]:
        """The errors, within three standard deviations of the prior."""
        most = BELIEVED * self.prior
        return jnp.clip(memory.errors, -most, most)

    def change(self, errors: Float[Array, "2 8"], omega: Vector, torque: Pair) -> Pair:
        """Change of dp/dt by the errors at the rates (p1, p2, s) and a torque about x and y."""
        regressor = jnp.concatenate([self._by_inertia(torque), products_of(omega)])
        return jnp.sum(errors * regressor[None, :], axis=1)


class FittedDynamics(AbstractCorrection):
    """dp/dt with the errors of a `DrivenFit`, and ds/dt with those of the third axis.

    `lean` are the `errors` of lean and products that `ThirdAxisEstimator` has fitted, `driven`
    those of the driven axes. Either is `None` where it is not estimated.
    """

    form: NormalForm
    fit: DrivenFit
    lean: Float[Array, "8"] | None
    driven: Float[Array, "2 8"] | None

    def __call__(self, omega, torque, acceleration):
        """The acceleration corrected along x and y, and about n."""
        axes = self.form.axes
        rates = self.form.slow(axes @ omega)
        if self.driven is not None:
            change = self.fit.change(self.driven, rates, axes[:2] @ torque)
            acceleration = acceleration + axes[:2].T @ change
            acceleration = acceleration + axes[2] * jnp.sum(self.form.lean * change)
        if self.lean is not None:
            change = jnp.sum(self.lean[:2] * (axes[:2] @ acceleration))
            change = change + jnp.sum(self.lean[2:] * products_of(rates))
            acceleration = acceleration + axes[2] * change
        return acceleration
