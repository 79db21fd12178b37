"""Steering the third axis by oscillating the first two: the oscillatory law.

Two phase-locked oscillations of ω1 and ω2 have a mean product, and c ω1 ω2 moves ω3; the area
that the tilt (φ, θ) sweeps moves the turn z. After Morin and Samson, IEEE Trans. Robotics and
Automation 13(4), 1997; the derivation with the orbit's terms is in docs/laws.md.

With ω - e ≈ (ρ S, (α S + β C) / ρ), e the orbit frame's rate in body axes, S = sin νt and
C = cos νt, the slow rate s and slow turn ẑ (ω3 and z without their ripple) obey on average
    ds/dt = c α / 2,    dẑ/dt = s - β / 2ν.
A demand chooses (α, β) from (s, ẑ); the law tracks the rates that make them. A wave of mean square
m in place of S takes α / 2m in place of α for the same mean product. A flat-topped wave is
f = S / √(S² + q² C²), the sine of the phase χ with tan χ = tan θ / q: a sine for q = 1 and a square
wave for q = 0. Its mean square is 1 / (1 + q) and its largest slope 1 / q.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsat.control.demands import AbstractDemand
from jaxsat.control.estimators import ThirdAxis
from jaxsat.control.normal_form import NormalForm, NormalState, Tilt, leaned, tracking_torque
from jaxsat.core.array_types import Pair, RealScalar, Vector
from jaxsat.core.checks import not_negative, positive
from jaxsat.core.declaration.settling import LEAST_ROUNDNESS
from jaxsat.core.quotients import reciprocal
from jaxsat.core.smooth import without_slope

SINE = 1 - 1e-6
"""q of a sine, less what keeps the quotients of a flat-topped wave finite."""

SAMPLES = 1.5
"""Smallest q in parts of the phase of a control period: the change from -1 to 1 then takes about
three periods."""


class Wave(NamedTuple):
    """A wave f of mean square m at a phase θ: f, df/dθ, and two integrals without a mean.

    `fall` is that of -f, `ripple` that of f² - m.
    """

    value: RealScalar
    slope: RealScalar
    fall: RealScalar
    ripple: RealScalar


def wave_at(sine: RealScalar, cosine: RealScalar, roundness: RealScalar | None) -> Wave:
    """The flat-topped wave with q = `roundness` at a phase, or the sine for `None`."""
    if roundness is None:
        return Wave(sine, cosine, cosine, -sine * cosine / 2)
    q, flat = roundness, 1 - roundness
    square = flat * (1 + q)
    size = jnp.sqrt(sine**2 + (q * cosine) ** 2)
    inverse, root = reciprocal(size), jnp.sqrt(square)
    ahead = jnp.arctan2(flat * sine * cosine, q * cosine**2 + sine**2)  # χ - θ
    return Wave(
        sine * inverse,
        q**2 * cosine * inverse**3,
        jnp.arctan2(root * cosine, size) * reciprocal(root),
        -q * ahead * reciprocal(square),
    )


def twice_mean_square(roundness: RealScalar | None) -> RealScalar | float:
    """2 / (1 + q), the mean square relative to that of a sine, for q = `roundness`."""
    return 1.0 if roundness is None else 2 * reciprocal(1 + roundness)


class FlatTop(eqx.Module):
    """The flattest wave that torques and control periods make.

    Its largest slope is at most the `acceleration` (rad/s²), and it changes over some control
    periods of `period` (s).
    """

    acceleration: RealScalar = eqx.field(converter=positive("acceleration"))
    period: RealScalar = eqx.field(converter=positive("period"))

    def roundness(self, amplitude: RealScalar, frequency: RealScalar) -> RealScalar:
        """q of a wave of an `amplitude` (rad/s) and a `frequency` (rad/s)."""
        by_torque = amplitude * frequency / self.acceleration
        least = jnp.maximum(SAMPLES * frequency * self.period, LEAST_ROUNDNESS)
        return jnp.minimum(jnp.maximum(by_torque, least), SINE)


NO_AMPLITUDE = 1e-8
"""Smallest amplitude, relative to the largest: its root has no derivative at zero."""


class Oscillation(NamedTuple):
    """The last demanded oscillation: α, β in (rad/s)², amplitude ρ in rad/s.

    `axes` is (cos, sin) of the angle about n to the oscillation's axes, see `ThirdAxis`.
    `roundness` is q of its wave, `None` for sines.
    """

    alpha: RealScalar
    beta: RealScalar
    amplitude: RealScalar
    axes: Pair
    roundness: RealScalar | None = None


class OscillationRequest(NamedTuple):
    """Demand for an oscillation, and its limits; squares of rates but for the last three.

    `alpha` and `beta` are demanded, `dead` is the (α, β) demanded by a slow rate of the dead zone,
    `most` the largest h; ρ = √(h `share`) + `least`. `roundness` is q of the wave.
    """

    alpha: RealScalar
    beta: RealScalar
    dead: tuple[RealScalar, RealScalar]
    most: RealScalar
    share: RealScalar
    least: RealScalar
    roundness: RealScalar | None = None

    def granted(self, axes: Pair) -> Oscillation:
        """The demand beyond the dead zone, scaled down so that h is at most `most`."""
        size = _size(self.alpha, self.beta, self.least)
        left = _size(*self.dead, self.least)
        granted = jnp.clip(size - left, self.least**2, self.most)
        scale = granted / size
        amplitude = jnp.sqrt(granted * self.share) + self.least
        none = granted <= self.least**2
        alpha, beta = (without_slope(scale * x, none) for x in (self.alpha, self.beta))
        return Oscillation(alpha, beta, amplitude, axes, self.roundness)


class Slow(NamedTuple):
    """Slow rate s (rad/s) and slow turn ẑ (rad)."""

    rate: RealScalar
    turn: RealScalar


class Tracking(NamedTuple):
    """Rates to track (rad/s) and their derivatives (rad/s²), each of shape (2,)."""

    rate: Pair
    derivative: Pair


class Oscillator(eqx.Module):
    """From slow errors to rate references: the law without its estimator and torque limit.

    `frequency` is ν (rad/s), `tilt_gain` k (1/s) pulls the tilt to its oscillation, `rate_gain` kω
    (1/s) the rates to theirs. `largest_amplitude` is ρm (rad/s), and `ratio` r divides the product:
    ρ = √(h / r) about the first axis and h / ρ about the second, h = |(α, β)|. The part of h due to
    a slow rate of `dead_zone` (rad/s) is not demanded: the end game covers it, and an uncertain
    estimate is not chased. With a `roundness` q the waves are flat-topped, and both h of the same
    amplitudes and the largest h are 2 / (1 + q) times as large.
    """

    form: NormalForm
    demand: AbstractDemand
    frequency: RealScalar = eqx.field(converter=positive("frequency"))
    tilt_gain: RealScalar = eqx.field(converter=positive("tilt_gain"))
    rate_gain: RealScalar = eqx.field(converter=positive("rate_gain"))
    largest_amplitude: RealScalar = eqx.field(converter=positive("largest_amplitude"))
    ratio: RealScalar = eqx.field(converter=positive("ratio"))
    dead_zone: RealScalar = eqx.field(converter=not_negative("dead_zone"), default=0.0)
    roundness: RealScalar | None = None

    def init(self, omega: Vector) -> Oscillation:
        """The initial oscillation, of no amplitude."""
        zero = jnp.zeros_like(omega[0])
        roundness = None if self.roundness is None else zero + self.roundness
        axes = jnp.stack([zero + 1, zero])
        return Oscillation(zero, zero, zero + self._no_amplitude, axes, roundness)

    @property
    def _no_amplitude(self) -> RealScalar:
        return NO_AMPLITUDE * self.largest_amplitude

    def slow(self, clock: RealScalar, tilt: Tilt, third: ThirdAxis, last: Oscillation) -> Slow:
        """s and ẑ: the rest of ω3 and z without the ripple of the last oscillation.

        The terms in e account for the body's turn with the orbit frame: with the rates at rest e
        and s every product of rates couples p1 and p2 into s, and the tilt turns e away from the
        third axis.
        """
        nu, c = self.frequency, third.coupling
        alpha, beta, rho, axes, roundness = last
        sine, cosine = jnp.sin(nu * clock), jnp.cos(nu * clock)
        cos2, sin2 = 1 - 2 * sine**2, 2 * sine * cosine
        turn_cos, turn_sin = jnp.cos(tilt.turn), jnp.sin(tilt.turn)
        o1, o2, o3 = third.orbit_rate
        frame = jnp.stack([o1 * turn_cos + o2 * turn_sin, o2 * turn_cos - o1 * turn_sin, o3])
        by_tilt = jax.grad(third.change)(leaned(frame, self.form.lean))
        e1, e2 = along(axes, frame[0], frame[1])
        swing1, swing2 = rho * sine, (alpha * sine + beta * cosine) * reciprocal(rho)

        rate = third.rate - third.rate_ripple
        rate = rate - by_tilt[0] * tilt.phi - by_tilt[1] * tilt.theta
        inverse = reciprocal(nu)
        if roundness is None:
            rate = rate + c / 4 * inverse * (alpha * sin2 + beta * cos2)
        else:
            ripple = wave_at(sine, cosine, roundness).ripple * (1 + roundness)
            rate = rate + c / 4 * inverse * (beta * cos2 - 2 * alpha * ripple)

        turn = tilt.turn - third.lean[0] * tilt.phi - third.lean[1] * tilt.theta
        turn = turn - third.turn_ripple
        turn = turn + ((1 + c) * e2 * swing1 - (1 - c) * e1 * swing2) * inverse**2
        turn = turn - c / 8 * inverse**2 * (alpha * cos2 - beta * sin2)
        return Slow(rate, turn)

    def request(
        self, slow: Slow, third: ThirdAxis, aim: RealScalar | None = None
    ) -> OscillationRequest:
        """The demand, with compensation of the drift; `aim` (rad/s) is the slow rate to reach
        instead of zero."""
        excess = slow.rate if aim is None else slow.rate - aim
        alpha, beta = self.demand(excess, slow.turn, third.coupling, self.frequency)
        alpha = alpha - 2 * reciprocal(third.coupling) * third.drift
        still = jnp.zeros_like(slow.turn)
        dead = self.demand(self.dead_zone, still, third.coupling, self.frequency)
        share = self.ratio * twice_mean_square(self.roundness)
        most, share = share * self.largest_amplitude**2, reciprocal(share)
        return OscillationRequest(
            alpha, beta, dead, most, share, self._no_amplitude, self.roundness
        )

    def oscillation(self, slow: Slow, third: ThirdAxis) -> Oscillation:
        """The granted part of the request."""
        return self.request(slow, third).granted(third.axes)

    def tracking(
        self, clock: RealScalar, state: NormalState, tilt: Tilt, oscillation: Oscillation
    ) -> Tracking:
        """ω_d = e - k (tilt - its oscillation) + the oscillating rates, and dω_d/dt."""
        nu, k = self.frequency, self.tilt_gain
        alpha, beta, rho, axes, roundness = oscillation
        sine, cosine = jnp.sin(nu * clock), jnp.cos(nu * clock)
        frame = state.frame_rate[:2]
        inverse = reciprocal(rho)
        wave = wave_at(sine, cosine, roundness)
        if roundness is not None:
            alpha = alpha * (1 + roundness) / 2

        def swung(of_wave, of_cosine):
            return turned(axes, rho * of_wave, (alpha * of_wave + beta * of_cosine) * inverse)

        swing = swung(wave.value, cosine)
        swing_rate = nu * swung(wave.slope, -sine)
        swing_tilt = -swung(wave.fall, -sine) * reciprocal(nu)
        pull = k * (jnp.stack([tilt.phi, tilt.theta]) - swing_tilt)
        derivative = swing_rate - k * (state.omega[:2] - frame - swing)
        return Tracking(frame - pull + swing, derivative)

    def torque(self, omega: Vector, tracking: Tracking) -> Pair:
        """The tracking torque about x and y before limiting, N m."""
        return tracking_torque(self.form, omega, tracking.rate, tracking.derivative, self.rate_gain)


def along(axes: Pair, x: RealScalar, y: RealScalar) -> tuple[RealScalar, RealScalar]:
    """Components of the vector (x, y) along axes turned about n, given as (cos, sin)."""
    cosine, sine = axes
    return cosine * x + sine * y, cosine * y - sine * x


def turned(axes: Pair, x: RealScalar, y: RealScalar) -> Pair:
    """Inverse of `along`."""
    cosine, sine = axes
    return jnp.stack([cosine * x - sine * y, cosine * y + sine * x])


def _size(alpha: RealScalar, beta: RealScalar, least: RealScalar) -> RealScalar:
    return jnp.sqrt(alpha**2 + beta**2 + least**4)
