"""A rigid body with one torque: the frame of its steering, and a fit of its inertia."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.checks import as_float, positive, require_counts
from jaxsat.core.inertia import LEAST_TORQUE_TILT
from jaxsat.core.quotients import SMALLEST
from jaxsat.spacecraft.axes import directions_across
from jaxsat.spacecraft.least_propellant import inverse_of_columns


class TorqueAxisFrame(NamedTuple):
    """Rows b, d, e of `axes`, and J⁻¹ along them: [[α, 0, γ], [0, δ, η], [γ, η, ζ]], 1/(kg m²)."""

    axes: Matrix
    alpha: RealScalar
    gamma: RealScalar
    delta: RealScalar
    eta: RealScalar
    zeta: RealScalar

    @staticmethod
    def of(inertia: Matrix, axis: Vector) -> "TorqueAxisFrame":
        """The frame of an inertia (kg m²) and the unit vector b; d ∝ J⁻¹b × b, e = b × d."""
        inverse = inverse_of_columns(inertia)
        answer = inverse @ axis
        alpha = jnp.sum(axis * answer)
        side = jnp.cross(answer / alpha, axis)
        side = side / jnp.sqrt(jnp.sum(side**2) + SMALLEST)
        axes = jnp.stack([axis, side, jnp.cross(axis, side)])
        by_side, by_third = (inverse @ row for row in axes[1:])
        return TorqueAxisFrame(
            axes,
            alpha,
            jnp.maximum(jnp.sum(axes[2] * answer), LEAST_TORQUE_TILT * alpha),
            jnp.sum(side * by_side),
            jnp.sum(side * by_third),
            jnp.sum(axes[2] * by_third),
        )

    def coupling(self, x: RealScalar, y: RealScalar) -> RealScalar:
        """C: at small w the angle of (x, y) changes by w C / (x² + y²)."""
        return (
            (self.delta - self.alpha) * x**2
            + 2 * self.eta * x * y
            + (self.zeta - self.alpha) * y**2
        )

    def holding_torque(self, x: RealScalar, y: RealScalar) -> RealScalar:
        """Gyroscopic torque about b at w = 0, N m."""
        return (self.zeta - self.delta) * x * y + self.eta * (x**2 - y**2)

    def braked(self, w: RealScalar, x: RealScalar, y: RealScalar) -> RealScalar:
        """dx/dt, N m."""
        across = (self.alpha - self.zeta) * y - self.eta * x
        return -self.gamma * w**2 + w * across + self.gamma * y**2


PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Matrix indices of the six numbers of an inertia."""

MOMENT_ERROR, PRODUCT_ERROR, AXIS_ERROR = 0.08, 0.015, 0.012
"""Standard deviations of a moment relative to itself, of a product relative to the geometric mean
of its two moments, and of the direction of the torque axis (rad)."""

BELIEVED = 3.0
"""Bound on estimates, in standard deviations of the prior."""


def _basis() -> np.ndarray:
    matrices = np.zeros((6, 3, 3))
    for number, (row, column) in enumerate(PLACES):
        matrices[number, row, column] = matrices[number, column, row] = 1.0
    return matrices


BASIS = _basis()
"""Basis (6, 3, 3) of the symmetric matrices, with the numbers of an inertia as coefficients."""


class InertiaMemory(NamedTuple):
    """Errors of the model and their covariance, the last rates, and the current interval.

    `first` are the rates (rad/s) at its beginning, `squares` is ∫ω ωᵀ dt and `impulse` ∫u dt;
    `torque` (N m) was commanded at the last of its `samples`.
    """

    errors: Float[Array, "8"]
    covariance: Float[Array, "8 8"]
    first: Vector
    omega: Vector
    squares: Matrix
    impulse: RealScalar
    torque: RealScalar
    samples: IntScalar


class InertiaFit(eqx.Module):
    """Recursive least squares for J and the torque axis b in J dω/dt = -ω × Jω + b u.

    Over an interval J Δω + ∫ω × Jω dt = b ∫u dt, which is linear in the six numbers of J and the
    two by which b leans; the commanded torque sets the scale. `moments` (kg m²) are those of the
    model, in whose principal axes all is expressed, `axis` its unit vector b. `rate_noise` (rad/s)
    is the standard deviation of a measured rate, `torque_noise` (N m) that of unknown torques over
    an interval of `samples` control periods. Estimates are bounded by three standard deviations of
    the prior.
    """

    moments: Vector = eqx.field(converter=positive("moments"))
    axis: Vector = eqx.field(converter=as_float)
    rate_noise: RealScalar = eqx.field(converter=positive("rate_noise"))
    torque_noise: RealScalar = eqx.field(converter=positive("torque_noise"))
    samples: int = eqx.field(static=True, default=10)

    def __check_init__(self):
        require_counts(samples=self.samples)

    @property
    def prior(self) -> Float[Array, "8"]:
        """Standard deviations of the six numbers of J (kg m²) and of b along two directions."""
        products = jnp.stack(
            [jnp.sqrt(self.moments[row] * self.moments[column]) for row, column in PLACES[3:]]
        )
        lean = jnp.full(2, AXIS_ERROR, self.moments.dtype)
        return jnp.concatenate([MOMENT_ERROR * self.moments, PRODUCT_ERROR * products, lean])

    def init(self, omega: Vector) -> InertiaMemory:
        """The initial memory, with zero errors."""
        zero = jnp.zeros_like(omega[0])
        return InertiaMemory(
            jnp.zeros(8, omega.dtype),
            jnp.diag(self.prior**2).astype(omega.dtype),
            omega,
            omega,
            jnp.zeros((3, 3), omega.dtype),
            zero,
            zero,
            jnp.array(-1),  # the first sample only begins an interval
        )

    def believed(self, memory: InertiaMemory) -> tuple[Matrix, Vector]:
        """Estimated J (kg m²) and unit vector b."""
        prior = self.prior
        errors = jnp.clip(memory.errors, -BELIEVED * prior, BELIEVED * prior)
        inertia = jnp.diag(self.moments) + jnp.sum(
            errors[:6, None, None] * jnp.asarray(BASIS, errors.dtype), axis=0
        )
        axis = self.axis + jnp.sum(errors[6:, None] * directions_across(self.axis), axis=0)
        return inertia, axis / jnp.sqrt(jnp.sum(axis**2))

    def sampled(self, memory: InertiaMemory, omega: Vector, period: RealScalar) -> InertiaMemory:
        """The memory one sample later, after `period` (s) with the last torque held."""
        started = memory.samples >= 0
        span = jnp.where(started, period, 0.0)
        middle = (memory.omega + omega) / 2
        # Simpson's rule, exact for squares of straight lines.
        square = (_square(memory.omega) + 4 * _square(middle) + _square(omega)) / 6
        memory = memory._replace(
            first=jnp.where(started, memory.first, omega),
            omega=omega,
            squares=memory.squares + span * square,
            impulse=memory.impulse + span * memory.torque,
            samples=memory.samples + 1,
        )
        full = memory.samples >= self.samples
        errors, covariance = self._corrected(memory, period)
        return memory._replace(
            errors=jnp.where(full, errors, memory.errors),
            covariance=jnp.where(full, covariance, memory.covariance),
            first=jnp.where(full, omega, memory.first),
            squares=jnp.where(full, 0.0, memory.squares),
            impulse=jnp.where(full, 0.0, memory.impulse),
            samples=jnp.where(full, 0, memory.samples),
        )

    def _corrected(self, memory: InertiaMemory, period: RealScalar):
        """Errors and covariance after the three equations of an interval, one at a time."""
        change = memory.omega - memory.first
        basis = jnp.asarray(BASIS, change.dtype)
        turned = jnp.sum(memory.squares[None, :, :, None] * basis[:, None, :, :], axis=2)
        rows = jnp.sum(basis * change[None, None, :], axis=-1) + _antisymmetric(turned)
        across = -directions_across(self.axis) * memory.impulse
        regressors = jnp.concatenate([rows, across])  # (8, 3)
        impulse = jnp.sum(self.moments[:, None] * rows[:3], axis=0) - self.axis * memory.impulse
        noise = 2 * (jnp.mean(self.moments) * self.rate_noise) ** 2
        noise += (self.torque_noise * self.samples * period) ** 2
        errors, covariance = memory.errors, memory.covariance
        for number in range(3):
            regressor = regressors[:, number]
            projected = jnp.sum(covariance * regressor[None, :], axis=1)
            gain = projected / (noise + jnp.sum(regressor * projected))
            errors = errors - gain * (impulse[number] + jnp.sum(regressor * errors))
            covariance = covariance - gain[:, None] * projected[None, :]
        return errors, covariance


def _square(omega: Vector) -> Matrix:
    return omega[:, None] * omega[None, :]


def _antisymmetric(matrices: Float[Array, "6 3 3"]) -> Float[Array, "6 3"]:
    """∫ω × Eω dt of (∫ω ωᵀ dt) E."""
    pairs = ((1, 2), (2, 0), (0, 1))
    parts = [matrices[:, row, column] - matrices[:, column, row] for row, column in pairs]
    return jnp.stack(parts, axis=1)
