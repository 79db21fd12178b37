"""The periodic d3 of (2) about the axis without a torque: what of ω3 and z not to chase.

Nothing can cancel d3. It leaves a ripple of a3 / (J3 Ω) in ω3 and a3 / (J3 Ω²) in z, which a law
that steers the third axis has to know in order to leave it alone.
"""

import abc
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import as_float, require_positive
from jaxsat.core.quotients import reciprocal

LEAST_SIGMAS, SURE_SIGMAS = 2.0, 4.0
"""Of a steady acceleration: nothing is believed below the first many standard deviations, all from
the second, and a part between, so that an estimate near either does not switch the law to and fro.
"""


class ThirdRate(NamedTuple):
    """ω3 (rad/s), and the zero-mean ripples of ω3 (rad/s) and of z (rad) within it.

    `steady` (rad/s²) is what a constant torque makes of dω3/dt, `None` if it is not estimated.
    """

    rate: RealScalar
    rate_ripple: RealScalar
    turn_ripple: RealScalar
    steady: RealScalar | None = None


class AbstractRippleEstimator(eqx.Module):
    """Estimates a sinusoidal d3 from the measured rates, sample by sample."""

    @abc.abstractmethod
    def init(self, omega3: RealScalar) -> PyTree:
        """The memory when ω3 is all that is known."""

    @abc.abstractmethod
    def advance(
        self, memory: PyTree, omega: Float[Array, "3"], change: RealScalar, period: RealScalar
    ) -> PyTree:
        """The prediction `period` (s) on; `change` is that of ω3 (rad/s) but for d3."""

    @abc.abstractmethod
    def correct(self, memory: PyTree, omega: Float[Array, "3"], period: RealScalar) -> PyTree:
        """The prediction corrected by the measured `omega` (rad/s)."""

    @abc.abstractmethod
    def believed(self, memory: PyTree, omega3: RealScalar) -> ThirdRate:
        """What a law should take for ω3 and its ripple, given the measured ω3."""

    @abc.abstractmethod
    def forget(self, memory: PyTree, when: Bool[Array, ""]) -> PyTree:
        """Called where a new phase of a supervisor begins (`when`)."""


class Ripple(NamedTuple):
    """Estimate of ω3 (rad/s), of d3 / J3 (rad/s²) and of the latter's derivative (rad/s³)."""

    rate: RealScalar
    acceleration: RealScalar
    jerk: RealScalar


class RippleObserver(AbstractRippleEstimator):
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

    frequency: RealScalar = eqx.field(converter=as_float)
    pole: RealScalar = eqx.field(converter=as_float)
    rate_limit: RealScalar = eqx.field(converter=as_float)

    def __check_init__(self):
        for name in ("frequency", "pole", "rate_limit"):
            require_positive(name, getattr(self, name))

    def init(self, omega3: RealScalar) -> Ripple:
        """The memory of an observer that knows no disturbance yet."""
        return Ripple(omega3, jnp.zeros_like(omega3), jnp.zeros_like(omega3))

    def advance(
        self, memory: Ripple, omega: Float[Array, "3"], change: RealScalar, period: RealScalar
    ) -> Ripple:
        """The prediction one `period` (s) on, exactly."""
        cos, sin = jnp.cos(self.frequency * period), jnp.sin(self.frequency * period)
        n1, n2 = memory.acceleration, memory.jerk
        by_ripple = n1 * sin / self.frequency + n2 * (1 - cos) / self.frequency**2
        return Ripple(
            memory.rate + change + by_ripple,
            n1 * cos + n2 * sin / self.frequency,
            n2 * cos - n1 * self.frequency * sin,
        )

    def correct(self, memory: Ripple, omega: Float[Array, "3"], period: RealScalar) -> Ripple:
        """The prediction corrected by the measured `omega` (rad/s), while ω1 and ω2 are small."""
        slow = (jnp.abs(omega[0]) < self.rate_limit) & (jnp.abs(omega[1]) < self.rate_limit)
        error = omega[2] - memory.rate
        gains = self.gains(period)
        change = jnp.where(slow, error, 0.0)
        return Ripple(
            jnp.where(slow, memory.rate + gains.rate * error, omega[2]),
            memory.acceleration + gains.acceleration * change,
            memory.jerk + gains.jerk * change,
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

    def believed(self, memory: Ripple, omega3: RealScalar) -> ThirdRate:
        """The measured ω3, and the integrals of n1 without mean: -n2 / Ω² and -n1 / Ω²."""
        square = self.frequency**2
        return ThirdRate(omega3, -memory.jerk / square, -memory.acceleration / square)

    def forget(self, memory: Ripple, when: Bool[Array, ""]) -> Ripple:
        """n1 = n2 = 0 where `when` holds."""
        n1, n2 = jnp.where(when, 0.0, memory.acceleration), jnp.where(when, 0.0, memory.jerk)
        return Ripple(memory.rate, n1, n2)


class RippleBelief(NamedTuple):
    """Mean of ω3, the ripple and its quadrature, all rad/s, and their covariance.

    A fourth state, if there is one, is the steady acceleration (rad/s²).
    """

    state: Float[Array, " states"]
    covariance: Float[Array, "states states"]


class Steady(NamedTuple):
    """What is known of the acceleration by a constant torque.

    Its expected `size` (rad/s²), how fast it may change, `drift` (rad/s² per √s), and above which
    ω1 or ω2, `rate_limit` (rad/s), nothing is learnt of it: the errors of c ω1 ω2 are not random.
    """

    size: RealScalar
    drift: RealScalar
    rate_limit: RealScalar


class RippleFilter(AbstractRippleEstimator):
    """The same model with gains that suit what is known: a Kalman filter.

    At first it learns in a fraction of the disturbance's period, later it averages the noise of
    the sensor away. Rates of ω1 and ω2 make it careful instead of being switched off: the
    predicted ω3 is trusted to `product_error` |ω|², `lean_error` |ω| (without unit). `frequency`
    is Ω (rad/s), `noise` the sensor's (rad/s), `amplitude` the ripple's expected size (rad/s), and
    `drift` the rate at which the ripple may change by itself (rad/s per √s), which lets a frequency
    nearby be followed. With `steady` it estimates the acceleration by a constant torque as well.
    """

    frequency: RealScalar = eqx.field(converter=as_float)
    noise: RealScalar = eqx.field(converter=as_float)
    amplitude: RealScalar = eqx.field(converter=as_float)
    drift: RealScalar = eqx.field(converter=as_float)
    product_error: RealScalar = eqx.field(converter=as_float)
    lean_error: RealScalar = eqx.field(converter=as_float, default=0.003)
    steady: Steady | None = None

    def __check_init__(self):
        require_positive("frequency", self.frequency)
        for name in ("noise", "amplitude", "drift", "product_error", "lean_error"):
            require_positive(name, getattr(self, name))

    def init(self, omega3: RealScalar) -> RippleBelief:
        """The first measurement is mean plus ripple, and nothing more is known of the mean."""
        zero, noise, size = jnp.zeros_like(omega3), self.noise**2, self.amplitude**2
        covariance = jnp.stack(
            [
                jnp.stack([noise + size, -size, zero]),
                jnp.stack([-size, size + zero, zero]),
                jnp.stack([zero, zero, size + zero]),
            ]
        )
        state = jnp.stack([omega3, zero, zero])
        if self.steady is None:
            return RippleBelief(state, covariance)
        covariance = jnp.pad(covariance, (0, 1)).at[3, 3].set(self.steady.size**2)
        return RippleBelief(jnp.append(state, 0.0), covariance)

    def advance(
        self, memory: RippleBelief, omega: Float[Array, "3"], change: RealScalar, period: RealScalar
    ) -> RippleBelief:
        """The mean moves by `change`, the ripple turns by Ω `period`, and all grow less sure."""
        cos, sin = jnp.cos(self.frequency * period), jnp.sin(self.frequency * period)
        model_error = self.product_error * (omega[0] ** 2 + omega[1] ** 2)
        spread = [model_error**2, self.drift**2, self.drift**2]
        state = _moved(memory.state, cos, sin, period).at[0].add(change)
        covariance = _moved(_moved(memory.covariance, cos, sin, period).T, cos, sin, period)
        if self.steady is not None:
            spread.append(self.steady.drift**2)
            calm = jnp.maximum(jnp.abs(omega[0]), jnp.abs(omega[1])) < self.steady.rate_limit
            alone = covariance.at[3, :3].set(0.0).at[:3, 3].set(0.0)
            covariance = jnp.where(calm, covariance, alone)
        return RippleBelief(state, covariance + jnp.diag(period * jnp.stack(spread)))

    def correct(
        self, memory: RippleBelief, omega: Float[Array, "3"], period: RealScalar
    ) -> RippleBelief:
        """The usual update by one measurement, the sum of mean and ripple."""
        size = omega[0] ** 2 + omega[1] ** 2
        seen = memory.covariance[0] + memory.covariance[1]
        variance = seen[0] + seen[1] + self.noise**2 + self.lean_error**2 * size
        gain = seen * reciprocal(variance)
        error = omega[2] - memory.state[0] - memory.state[1]
        covariance = memory.covariance - gain[:, None] * seen[None, :]
        return RippleBelief(memory.state + gain * error, covariance)

    def believed(self, memory: RippleBelief, omega3: RealScalar) -> ThirdRate:
        """The filtered ω3; the ripple's integral is its quadrature over Ω."""
        mean, ripple, quadrature = memory.state[:3]
        steady = None
        if self.steady is not None:
            squared = memory.state[3] ** 2 * reciprocal(memory.covariance[3, 3])
            least, sure = LEAST_SIGMAS**2, SURE_SIGMAS**2
            steady = memory.state[3] * jnp.clip((squared - least) / (sure - least), 0.0, 1.0)
        return ThirdRate(mean + ripple, ripple, quadrature / self.frequency, steady)

    def forget(self, memory: RippleBelief, when: Bool[Array, ""]) -> RippleBelief:
        """The memory as it is: the covariance knows what the last phase was worth."""
        return memory


def _moved(
    rows: Float[Array, "states *n"], cos: RealScalar, sin: RealScalar, period: RealScalar
) -> Float[Array, "states *n"]:
    """The second and third row turned: ripple and quadrature; the fourth moves the first."""
    first, second, third, *steady = rows
    for acceleration in steady:
        first = first + period * acceleration
    return jnp.stack([first, cos * second - sin * third, sin * second + cos * third, *steady])
