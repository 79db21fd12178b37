"""All three rates to zero in finite time with two torques of bounded size.

The paper's reference (38) gives ω3 an exponential decay and requires torques that grow without
bound near ω3 = 0. With the cube root of |ω3| instead of the square root the references change at a
constant rate, so that a constant torque tracks them, and ω3 vanishes in finite time.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxsat.control.estimators import ThirdAxis
from jaxsat.control.normal_form import NormalForm, tracking_torque
from jaxsat.control.oscillatory import Tracking, turned
from jaxsat.core.array_types import Pair, RealScalar, Vector
from jaxsat.core.checks import positive
from jaxsat.core.quotients import cube_root
from jaxsat.spacecraft.dynamics import PlantState

HELD = 0.7
"""Largest share of the torque limit for the gyroscopic torque at the references."""


MOST_GROWTH = 2.0
"""Largest credible |s|, relative to the initial |(p1, p2, s)|; beyond it the model is wrong."""


DIRECTIONS = ((1, 1), (1, -1), (-1, 1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1))
"""Possible signs of the references. One rate alone moves s where x and y are not exactly the axes
of the reduced inertia, and where n leans."""

GOOD_FALL, POOR_FALL = 0.7, 0.3
"""Smallest rate of decrease of |s|, relative to the fastest, of initial and of current
directions."""

BRAKED = 0.5
"""Share of |s| below which the rates end the braking of a failing law."""


class Signs(NamedTuple):
    """Signs (σ1, σ2) of the references, the sign of s at their choice, and a bound.

    `most` is the |s| (rad/s) above which the law is failing: it then only brakes.
    """

    sigma: Pair
    third: RealScalar
    most: RealScalar


class FiniteTimeRate(eqx.Module):
    """ω1d = σ1 a g, ω2d = σ2 b g with g = max(|ω3| - ε, 0)^⅓, as a rule σ1 σ2 = -sgn(ω3) sgn(c).

    Once tracked, d|ω3|/dt = -|c| a b g², so |ω3| reaches ε after 3 g(0) / (|c| a b). The references
    then change at a_i |c| a b / 3, and a³ = 3 η Tm J2 / (|c| J1²), b³ = 3 η Tm J1 / (|c| J2²) make
    that a torque of η Tm about each axis. `torque_limit` is Tm (N m), `share` is η in (0, 1),
    `rate_gain` (1/s) pulls the rates to their references, `dead_zone` is ε (rad/s).
    """

    form: NormalForm
    torque_limit: RealScalar = eqx.field(converter=positive("torque_limit"))
    share: RealScalar = eqx.field(converter=positive("share"))
    rate_gain: RealScalar = eqx.field(converter=positive("rate_gain"))
    dead_zone: RealScalar = eqx.field(converter=positive("dead_zone"))

    def init(self, state: PlantState) -> Signs:
        """The initial memory, without signs."""
        zero = jnp.zeros_like(state.omega[2])
        return Signs(jnp.zeros(2, state.omega.dtype), zero, zero)

    def factors(self, c: RealScalar) -> Pair:
        """(a, b), rad^⅔ s^-⅔."""
        j1, j2, _ = self.form.moments
        base = 3 * self.share * self.torque_limit / jnp.abs(c)
        return jnp.stack([jnp.cbrt(base * j2 / j1**2), jnp.cbrt(base * j1 / j2**2)])

    def signs(self, third: ThirdAxis, omega: Vector, last: Signs) -> Signs:
        """Signs of the rates: of those with which |s| decreases quickly the nearest ones.

        The distance is Σ J_i (ω_i - ω_id)². Signs are kept until s changes sign, or others decrease
        it much faster: the terms p1 s and p2 s of leaning axes grow with s and help one of two
        opposite directions.
        """
        moments = self.form.moments[:2]
        side = jnp.where(third.rate < 0, -1.0, 1.0)
        slopes = self.factors(third.coupling) * jnp.cbrt(
            jnp.maximum(jnp.abs(third.rate), self.dead_zone)
        )

        def judged(sigma):
            reference = turned(third.axes, *(sigma * slopes))
            reference = reference * self._feasible(reference, omega[2])
            fall = -side * third.change(jnp.concatenate([reference, omega[2:]]))
            return fall, jnp.sum(moments * (omega[:2] - reference) ** 2)

        sigmas = [jnp.array(sigma, omega.dtype) for sigma in DIRECTIONS]
        falls, ways = (jnp.stack(of_all) for of_all in zip(*map(judged, sigmas), strict=True))
        quickest = jnp.max(falls)
        good = falls >= quickest - (1 - GOOD_FALL) * jnp.abs(quickest)
        nearest = jnp.stack(sigmas)[jnp.argmin(jnp.where(good, ways, jnp.inf))]
        failed = jnp.abs(third.rate) > last.most
        braked = jnp.sum(omega[:2] ** 2) < BRAKED**2 * third.rate**2
        begins = (last.third == 0) | (failed & braked)
        most = jnp.where(begins, MOST_GROWTH * jnp.sqrt(jnp.sum(omega**2)), last.most)
        fall, _ = judged(last.sigma)
        keep = ~begins & (side == last.third) & (fall > POOR_FALL * quickest)
        return Signs(jnp.where(keep, last.sigma, nearest), side, most)

    def tracking(self, third: ThirdAxis, omega: Vector, signs: Signs) -> Tracking:
        """The references and their derivatives at the present decay of ω3.

        The decay is that of the actual rates, at most the ideal one: feeding the ideal one forward
        leaves the rates behind their references at large torques.
        """
        moments, c = self.form.moments[:2], third.coupling
        slopes = signs.sigma * self.factors(c)
        root = cube_root(jnp.abs(third.rate) - self.dead_zone)
        failing = jnp.abs(third.rate) > signs.most
        references = turned(third.axes, *slopes)
        share = jnp.where(failing, 0.0, self._feasible(references * root, omega[2]))
        fastest = jnp.abs(c * slopes[0] * slopes[1]) * (share * root) ** 2
        slopes = share * references
        decay = jnp.clip(signs.third * third.change(omega), -fastest, 0.0)
        square = jnp.where(root > 0, root**2, 1.0)
        most = self.torque_limit / moments
        derivative = jnp.clip(slopes * decay / (3 * square), -most, most)
        return Tracking(slopes * root, derivative)

    def torque(self, omega: Vector, tracking: Tracking) -> Pair:
        """The tracking torque about x and y before limiting, N m."""
        drive = tracking_torque(
            self.form, omega, tracking.rate, tracking.derivative, self.rate_gain
        )
        overwhelmed = jnp.any(jnp.abs(self.form.gyroscopic_torque(omega)) > self.torque_limit)
        braking = -self.rate_gain * self.form.moments[:2] * omega[:2]
        return jnp.where(overwhelmed, braking, drive)

    def _feasible(self, reference: Pair, slow: RealScalar) -> RealScalar:
        """The share of a reference (rad/s) that thrusters hold against the gyroscopic torque."""
        gyroscopic = self.form.gyroscopic_torque(jnp.concatenate([reference, slow[None]]))
        most = jnp.max(jnp.abs(gyroscopic)) / (HELD * self.torque_limit)
        return 1 / jnp.maximum(most, 1.0)
