"""What a law should believe of the third axis: ripple observer and least squares.

No torque acts about the third axis, so what cannot be cancelled there must be known. Two things
matter: the periodic d3 of (2), whose ripple a law must not chase, and the small errors of axes
and inertia, through which torques meant for the first two axes reach the third.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.checks import as_float, require_positive
from jaxsat.control.rate_tracking import coupling
from jaxsat.dynamics import PlantState, RigidBody

RealScalar = Float[Array, ""]

LEAST_COUPLING = 0.2
"""A smaller |c + δc| than this is not believed: the laws divide by it."""

PRIOR = (0.03, 0.03, 0.08, 0.03, 0.03, 0.03, 0.003, 0.003)
"""Standard deviations of ε1, ε2 and of the coefficients of Q."""


class Ripple(NamedTuple):
    """Estimate of ω3 (rad/s), of d3 / J3 (rad/s²) and of the latter's derivative (rad/s³)."""

    rate: RealScalar
    acceleration: RealScalar
    jerk: RealScalar


class RippleObserver(eqx.Module):
    """The paper's internal model (42) moved to the axis without a torque.

    With n1 = d3 / J3 and n2 = dn1/dt, d²n1/dt² = -Ω² n1, and ε the error of the predicted ω3,
        dω̂3/dt = c ω1 ω2 + n1 + 3λ ε,
        dn1/dt = n2 + (3λ² - Ω²) ε,
        dn2/dt = -Ω² n1 + (λ³ - 3λΩ²) ε,
    whose three error poles are at -λ. It is sampled without approximation: the oscillation is
    propagated exactly between samples, and the gains put the poles at exp(-λ period).
    `frequency` is Ω and `pole` is λ, both in rad/s. Above `rate_limit` (rad/s) of ω1 or ω2 the
    unknown part of c ω1 ω2 would be taken for a disturbance, so only the oscillation goes on.
    """

    frequency: RealScalar = eqx.field(converter=as_float, default=0.1)
    pole: RealScalar = eqx.field(converter=as_float, default=0.05)
    rate_limit: RealScalar = eqx.field(converter=as_float, default=0.02)

    def __check_init__(self):
        for name in ("frequency", "pole", "rate_limit"):
            require_positive(name, getattr(self, name))

    def init(self, omega3: RealScalar) -> Ripple:
        """No disturbance known yet."""
        return Ripple(omega3, jnp.zeros_like(omega3), jnp.zeros_like(omega3))

    def advance(self, ripple: Ripple, change: RealScalar, period: RealScalar) -> Ripple:
        """The prediction one `period` (s) on; `change` is that of ω3 but for the disturbance."""
        cos, sin = jnp.cos(self.frequency * period), jnp.sin(self.frequency * period)
        n1, n2 = ripple.acceleration, ripple.jerk
        by_ripple = n1 * sin / self.frequency + n2 * (1 - cos) / self.frequency**2
        return Ripple(
            ripple.rate + change + by_ripple,
            n1 * cos + n2 * sin / self.frequency,
            n2 * cos - n1 * self.frequency * sin,
        )

    def correct(self, ripple: Ripple, omega: Float[Array, "3"], period: RealScalar) -> Ripple:
        """The prediction corrected by the measured `omega` (rad/s)."""
        slow = (jnp.abs(omega[0]) < self.rate_limit) & (jnp.abs(omega[1]) < self.rate_limit)
        error = omega[2] - ripple.rate
        gains = self.gains(period)
        change = jnp.where(slow, error, 0.0)
        return Ripple(
            jnp.where(slow, ripple.rate + gains.rate * error, omega[2]),
            ripple.acceleration + gains.acceleration * change,
            ripple.jerk + gains.jerk * change,
        )

    def gains(self, period: RealScalar) -> Ripple:
        """The sampled observer's gains, all three poles at exp(-λ period) exactly.

        In modal form ω̂3 = m + Re ζ with m' = 0 and ζ' = iΩ ζ, so n1 = -Ω Im ζ and n2 = -Ω² Re ζ,
        each gain is a residue of (z - p)³ over the open-loop polynomial. For short periods they
        become the continuous gains times the period.
        """
        half = self.frequency * period / 2
        rest = -jnp.expm1(-self.pole * period)  # 1 - p
        real, imaginary = rest * jnp.cos(half), (2 - rest) * jnp.sin(half)
        below = -2 * jnp.sin(half) * jnp.sin(2 * half)
        oscillating = (real**3 - 3 * real * imaginary**2) / below
        quadrature = (3 * real**2 * imaginary - imaginary**3) / below
        constant = rest**3 / (4 * jnp.sin(half) ** 2)
        return Ripple(
            constant + oscillating,
            -self.frequency * quadrature,
            -(self.frequency**2) * oscillating,
        )

    def ripples(self, ripple: Ripple) -> tuple[RealScalar, RealScalar]:
        """∫n1 dt and ∫∫n1 dt², without mean: the parts of ω3 (rad/s) and z (rad) to ignore."""
        return -ripple.jerk / self.frequency**2, -ripple.acceleration / self.frequency**2


class Fit(NamedTuple):
    """Estimate (ε1, ε2, and six of Q), its covariance, and the sums of the present interval."""

    estimate: Float[Array, "8"]
    covariance: Float[Array, "8 8"]
    first_omega: Float[Array, "3"]
    products: Float[Array, "6"]
    samples: Int[Array, ""]


class RecursiveLeastSquares(eqx.Module):
    """Recursive least squares for the errors of axes and inertia that reach the third axis.

    Two torques along any two axes and any inertia give J dω/dt = -ω × Jω + A u, and u can be
    eliminated: dω3/dt = ε1 dω1/dt + ε2 dω2/dt + Q(ω), exactly, Q quadratic. Over an interval of
    `samples` control periods
        Δω3 - c ∫ω1ω2 = ε1 Δω1 + ε2 Δω2 + ∫(Q - c ω1ω2) dt
    is linear in ε and the six coefficients of Q - c ω1ω2, those of ω1ω2 (that is δc), ω1² - ω2²
    (-J12 / J3 to first order), ω2ω3, ω1ω3, and two of second order, ω1² + ω2² and ω3². To first
    order ε collects torque axes that lean towards the third body axis and J13, J23. `prior` are
    the standard deviations believed at the start (shape (8,)), `noise` that of one Δω3 (rad/s).
    """

    prior: Float[Array, "8"] = eqx.field(converter=as_float, default=PRIOR)
    noise: RealScalar = eqx.field(converter=as_float, default=2e-5)
    samples: int = eqx.field(static=True, default=10)

    def __check_init__(self):
        require_positive("prior", self.prior)
        require_positive("noise", self.noise)
        if self.samples < 1:
            raise ValueError(f"Argument `samples` must be at least 1, but got {self.samples}.")

    def init(self, omega: Float[Array, "3"]) -> Fit:
        """No error known yet."""
        return Fit(
            jnp.zeros(8, omega.dtype),
            jnp.diag(self.prior**2).astype(omega.dtype),
            omega,
            jnp.zeros(6, omega.dtype),
            jnp.array(-1),  # the first sample only begins the first interval
        )

    def update(
        self, fit: Fit, omega: Float[Array, "3"], products: Float[Array, "6"], c: RealScalar
    ) -> Fit:
        """One sample more; `products` are the six integrals since the last sample.

        `c` is the model's value, which δc is added to.
        """
        products, count = fit.products + products, fit.samples + 1
        change = omega - fit.first_omega
        regressor = jnp.concatenate([change[:2], products])
        projected = jnp.sum(fit.covariance * regressor[None, :], axis=1)
        gain = projected / (self.noise**2 + jnp.sum(regressor * projected))
        residual = change[2] - c * products[0] - jnp.sum(regressor * fit.estimate)
        full = count >= self.samples
        return Fit(
            fit.estimate + jnp.where(full, gain * residual, 0.0),
            fit.covariance - jnp.where(full, gain[:, None] * projected[None, :], 0.0),
            jnp.where(full, omega, fit.first_omega),
            jnp.where(full, 0.0, products),
            jnp.where(full, 0, count),
        )


class ThirdAxis(NamedTuple):
    """What a law is told of the third axis.

    `rate` is ω3 without the part that comes with ω1 and ω2 (rad/s), `lean` that part's (ε1, ε2),
    `coupling` is c, and the ripples of rate (rad/s) and turn (rad) are those to ignore.
    """

    rate: RealScalar
    lean: Float[Array, "2"]
    coupling: RealScalar
    rate_ripple: RealScalar
    turn_ripple: RealScalar


class EstimatorMemory(NamedTuple):
    """Memories of the observer and the fit, each `None` without one, and the last rates."""

    ripple: Ripple | None
    fit: Fit | None
    omega: Float[Array, "3"]
    started: Bool[Array, ""]


class ThirdAxisEstimator(eqx.Module):
    """Observer and fit together; without either the third axis is what the model says it is.

    The observer predicts the measured ω3 with the fitted errors in it, so that a new estimate
    does not look like a disturbance.
    """

    model: RigidBody
    observer: RippleObserver | None = eqx.field(default_factory=RippleObserver)
    least_squares: RecursiveLeastSquares | None = eqx.field(default_factory=RecursiveLeastSquares)

    def init(self, state: PlantState) -> EstimatorMemory:
        """Nothing known yet."""
        return EstimatorMemory(
            None if self.observer is None else self.observer.init(state.omega[2]),
            None if self.least_squares is None else self.least_squares.init(state.omega),
            state.omega,
            jnp.array(False),
        )

    def forget_ripple(self, memory: EstimatorMemory, when: Bool[Array, ""]) -> EstimatorMemory:
        """The disturbance estimate set back to zero where `when` holds."""
        if memory.ripple is None:
            return memory
        rate, n1, n2 = memory.ripple
        ripple = Ripple(rate, jnp.where(when, 0.0, n1), jnp.where(when, 0.0, n2))
        return memory._replace(ripple=ripple)

    def update(
        self, state: PlantState, memory: EstimatorMemory, period: RealScalar
    ) -> tuple[ThirdAxis, EstimatorMemory]:
        """One sample: what to believe now, and the memory for the next; `period` in s."""
        c = coupling(self.model.spacecraft.moments)
        started = memory.started
        memory = jax.tree.map(lambda x, y: jnp.where(started, x, y), memory, self.init(state))
        span = jnp.where(started, period, 0.0)
        products = span * _mean_products(memory.omega, state.omega)
        errors = jnp.zeros(8, state.omega.dtype) if memory.fit is None else memory.fit.estimate
        ripple, fit = memory.ripple, memory.fit
        if self.observer is not None and ripple is not None:
            known = jnp.concatenate([(state.omega - memory.omega)[:2], products])
            change = c * products[0] + jnp.sum(known * errors)
            ripple = self.observer.advance(ripple, change, span)
            ripple = self.observer.correct(ripple, state.omega, period)
        if self.least_squares is not None and fit is not None:
            fit = self.least_squares.update(fit, state.omega, products, c)
            errors = fit.estimate
        following = EstimatorMemory(ripple, fit, state.omega, jnp.array(True))
        return self._believed(state, ripple, errors, c), following

    def _believed(self, state, ripple, errors, c) -> ThirdAxis:
        omega1, omega2, omega3 = state.omega
        zero = jnp.zeros_like(omega3)
        by_others = errors[0] * omega1 + errors[1] * (omega2 + self.model.orbit.rate)
        ripples = (zero, zero) if self.observer is None else self.observer.ripples(ripple)
        sign = jnp.where(c < 0, -1.0, 1.0)
        fitted = sign * jnp.maximum(sign * (c + errors[2]), LEAST_COUPLING)
        # Without a fit the model's own value is used, however small.
        believed = c if self.least_squares is None else fitted
        return ThirdAxis(omega3 - by_others, errors[:2], believed, *ripples)


def _mean_products(before: Float[Array, "3"], after: Float[Array, "3"]) -> Float[Array, "6"]:
    """Means of the six products over a period in which the rates change linearly."""
    middle = (before + after) / 2
    # Simpson's rule, exact for squares of straight lines.
    return (_products(before) + 4 * _products(middle) + _products(after)) / 6


def _products(omega: Float[Array, "3"]) -> Float[Array, "6"]:
    x, y, z = omega
    return jnp.stack([x * y, x**2 - y**2, y * z, x * z, x**2 + y**2, z**2])
