"""Any rotation by three slews about the two driven axes.

A rotation is R_i(a) R_j(b) R_i(c), i and j the two axes with a torque, taken about the body's own
axes in sequence. With the body at rest before each slew, ω1 ω2 = 0 throughout and ω3 stays
constant.
"""

import dataclasses
import enum
from typing import Annotated, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.control.normal_form import NormalForm, NormalState
from jaxsat.core.array_types import BoolScalar, IntScalar, Matrix, Pair, RealScalar, Vector
from jaxsat.core.checks import positive
from jaxsat.core.quotients import SMALLEST, angle_of, root
from jaxsat.core.tolerances import wrap_angle
from jaxsat.core.trees import choose

TAIL = 3.0
"""Additional duration of a leg for its exponential end, in time constants."""

END_ITERATIONS = 3
"""Number of iterations for the rotation, which depends weakly on its own duration."""


def mirrored(q: Float[Array, "4"], along_x: BoolScalar) -> Float[Array, "4"]:
    """Exchange body axes x and y (and reverse z) unless the first slew is about x.

    Every formula below is written for the order 1-2-1 alone.
    """
    q0, q1, q2, q3 = q
    return jnp.where(along_x, q, jnp.stack([q0, q2, q1, -q3]))


def three_slews(q: Float[Array, "4"]) -> Float[Array, "2 3"]:
    """Angles (a, b, c) in [-π, π) with q = q_x(a) q_y(b) q_x(c), up to sign; both solutions.

    cos(b/2) (cos, sin)((a + c)/2) = (q0, q1) and sin(b/2) (cos, sin)((a - c)/2) = (q2, q3).
    """
    q0, q1, q2, q3 = q
    middle = 2 * angle_of(root(q2**2 + q3**2), root(q0**2 + q1**2))
    total, difference = 2 * angle_of(q1, q0), 2 * angle_of(q3, q2)
    opposite = difference + 2 * jnp.pi  # b < 0
    first = jnp.stack([(total + difference) / 2, middle, (total - difference) / 2])
    second = jnp.stack([(total + opposite) / 2, -middle, (total - opposite) / 2])
    return wrap_angle(jnp.stack([first, second]))


def two_slews(q: Float[Array, "4"]) -> Pair:
    """Angles (b, c) in [-π, π) whose q_y(b) q_x(c) is nearest to q, with the least rotation left.

    The scalar product with q is a sum of one cosine of (b + c)/2 and one of (b - c)/2, each
    maximal.
    """
    q0, q1, q2, q3 = q
    half_sum = angle_of(q1 + q2, q0 + q3)
    half_difference = angle_of(q2 - q1, q0 - q3)
    return wrap_angle(jnp.stack([half_sum + half_difference, half_sum - half_difference]))


def one_slew(q: Float[Array, "4"]) -> RealScalar:
    """The angle in [-π, π) about x nearest to q."""
    return wrap_angle(2 * angle_of(q[1], q[0]))


class Leg(enum.IntEnum):
    """The legs of three slews, and the state after them."""

    FIRST_SLEW = 0
    SECOND_SLEW = 1
    THIRD_SLEW = 2
    SLEWED = 3


class Slewing(NamedTuple):
    """The current leg (`Leg`), its remaining angle (rad), the order of axes.

    `end` is the time (s) at which the last leg should end, `last_rate` the leg's rate at the last
    sample (rad/s).
    """

    leg: Annotated[IntScalar, Leg]
    to_go: RealScalar
    along_x: BoolScalar
    end: RealScalar
    last_rate: RealScalar


class SlewPlanner(eqx.Module):
    """Plan of three slews to the orbit frame, and their tracking one by one.

    A leg follows the rate v(e) of its remaining angle e: λ e near the end and the square root of a
    constant deceleration α = η_s Tm / J before, joined smoothly at e0 = α / λ². `torque_limit` is
    Tm (N m), `share` η_s, `approach` λ and `rate_gain` k_s in 1/s. A leg ends when the remaining
    angle is below `angle_tolerance` (rad) and its rate below `rate_tolerance` (rad/s).
    """

    form: NormalForm
    torque_limit: RealScalar = eqx.field(converter=positive("torque_limit"))
    share: RealScalar = eqx.field(converter=positive("share"))
    approach: RealScalar = eqx.field(converter=positive("approach"))
    rate_gain: RealScalar = eqx.field(converter=positive("rate_gain"))
    angle_tolerance: RealScalar = eqx.field(converter=positive("angle_tolerance"))
    rate_tolerance: RealScalar = eqx.field(converter=positive("rate_tolerance"))

    def about(self, axes: Pair) -> "SlewPlanner":
        """The planner of slews in the frame of `NormalForm.turned`."""
        return dataclasses.replace(self, form=self.form.turned(axes))

    def init(self, omega: Vector) -> Slewing:
        """The memory without a plan."""
        zero = jnp.zeros_like(omega[0])
        return Slewing(jnp.array(Leg.FIRST_SLEW), zero, jnp.array(True), zero, zero)

    def needed(self, state: NormalState, ahead: RealScalar) -> Float[Array, "4"]:
        """The rotation (quaternion) from the body to the orbit frame `ahead` seconds later.

        Its components are along the slew axes: x and y lean by ε as the body turns about n
        likewise. At s = rest the body itself turns about n with the orbit frame.
        """
        q, turn_rate = state.attitude.q, self.form.orbit_rate.at[2].add(-self.form.rest[2])
        speed = jnp.sqrt(jnp.sum(turn_rate**2) + SMALLEST)
        half = speed * ahead / 2
        p0, p = jnp.cos(half), jnp.sin(half) * turn_rate / speed
        scalar = q[0] * p0 + jnp.sum(q[1:] * p)
        vector = q[0] * p - p0 * q[1:] - jnp.cross(q[1:], p)
        return jnp.concatenate([scalar[None], self._slew_axes() @ vector])

    def _slew_axes(self) -> Matrix:
        """Rows: the axis of a slew about x, the nearest to that about y across it, their product.

        The slew axes are orthogonal up to ε1 ε2.
        """
        e1, e2 = self.form.lean
        one, zero = jnp.ones_like(e1), jnp.zeros_like(e1)
        first = jnp.stack([one, zero, e1]) / jnp.sqrt(1 + e1**2)
        second = jnp.stack([zero, one, e2])
        second = second - first * jnp.sum(first * second)
        second = second / jnp.sqrt(jnp.sum(second**2))
        return jnp.stack([first, second, jnp.cross(first, second)])

    def duration(self, angles: Float[Array, "*n 3"], along_x: Bool[Array, "*n"]) -> Array:
        """Duration of three legs from rest to rest, tails included, s."""
        j1, j2, _ = self.form.moments
        outer, inner = jnp.where(along_x, j1, j2), jnp.where(along_x, j2, j1)
        size = jnp.abs(angles) + 1e-9  # its root has no derivative at zero
        roots = jnp.sqrt(outer * size[..., 0]) + jnp.sqrt(outer * size[..., 2])
        roots = roots + jnp.sqrt(inner * size[..., 1])
        tails = 3 * TAIL / self.approach
        return 2 * roots / jnp.sqrt(self.share * self.torque_limit) + tails

    def plan(self, t: RealScalar, state: NormalState) -> Slewing:
        """The fastest of the four ways to the orbit frame at their end."""
        ahead = jnp.zeros_like(state.omega[0])
        angle, x_first = ahead, jnp.array(True)
        for _ in range(END_ITERATIONS):
            ahead, angle, x_first = self._quickest(state, ahead)
        rate = jnp.where(x_first, state.omega[0], state.omega[1])
        return Slewing(jnp.array(Leg.FIRST_SLEW), angle, x_first, t + ahead, rate)

    def _quickest(self, state: NormalState, ahead: RealScalar) -> tuple[Array, Array, Array]:
        """Duration (s) of the fastest of the four ways to the orbit frame `ahead` seconds later,
        its first angle (rad) and whether that is about x."""
        q = self.needed(state, ahead)
        along_x = jnp.array([True, True, False, False])
        ways = [three_slews(mirrored(q, jnp.array(first_x))) for first_x in (True, False)]
        angles = jnp.concatenate(ways)
        durations = self.duration(angles, along_x)
        best = jnp.argmin(durations)
        duration = durations[best]
        angle = angles[best, 0]
        x_first = along_x[best]
        return duration, angle, x_first

    def advance(
        self, t: RealScalar, state: NormalState, slewing: Slewing, period: RealScalar
    ) -> Slewing:
        """The remaining angle `period` (s) later; after a leg, that of the next by the attitude."""
        axis_x = self._axis_is_x(slewing)
        rate = jnp.where(axis_x, state.omega[0], state.omega[1])
        stretch = jnp.sqrt(1 + jnp.where(axis_x, *self.form.lean) ** 2)
        to_go = slewing.to_go - stretch * period * (rate + slewing.last_rate) / 2
        over = (jnp.abs(to_go) < self.angle_tolerance) & (jnp.abs(rate) < self.rate_tolerance)
        same_leg = slewing._replace(to_go=to_go, last_rate=rate)
        following = self._next_leg(t, state, slewing)
        return choose(over, following, same_leg)

    def reference(self, to_go: RealScalar, along_x: BoolScalar) -> tuple[Array, Array]:
        """The leg's rate v (rad/s) for a remaining angle, and dv/de (1/s)."""
        j1, j2, _ = self.form.moments
        deceleration = self.share * self.torque_limit / jnp.where(along_x, j1, j2)
        join = deceleration / self.approach**2
        size = jnp.abs(to_go)
        root = jnp.sqrt(2 * deceleration * jnp.maximum(size - join / 2, join / 2))
        linear = size <= join
        rate = jnp.where(linear, self.approach * to_go, jnp.sign(to_go) * root)
        return rate, jnp.where(linear, self.approach, deceleration / root)

    def references(self, slewing: Slewing) -> Pair:
        """The reference rates of both axes in the current leg, rad/s."""
        axis_x = self._axis_is_x(slewing)
        rate = jnp.where(slewing.leg == Leg.SLEWED, 0.0, self.reference(slewing.to_go, axis_x)[0])
        return jnp.where(jnp.stack([axis_x, ~axis_x]), rate, 0.0)

    def torque(self, omega: Vector, slewing: Slewing) -> Pair:
        """The torque about x and y of the current leg before limiting, N m.

        The profile's deceleration is fed forward only while the body follows it.
        """
        axis_x = self._axis_is_x(slewing)
        rate = jnp.where(axis_x, omega[0], omega[1])
        reference, slope = self.reference(slewing.to_go, axis_x)
        follows = (reference * rate > 0) & (jnp.abs(rate) > jnp.abs(reference) / 2)
        change = jnp.where(follows, -slope * rate, 0.0)
        acceleration = change + self.rate_gain * (reference - rate)
        resting = -self.rate_gain * omega[:2]
        driven = jnp.stack([axis_x, ~axis_x])
        return self.form.torque(omega, jnp.where(driven, acceleration, resting))

    def _axis_is_x(self, slewing: Slewing) -> BoolScalar:
        return slewing.along_x ^ (slewing.leg == Leg.SECOND_SLEW)

    def _next_leg(self, t: RealScalar, state: NormalState, slewing: Slewing) -> Slewing:
        q = mirrored(self.needed(state, slewing.end - t), slewing.along_x)
        second, third = two_slews(q)[0], one_slew(q)
        following = slewing._replace(leg=jnp.minimum(slewing.leg + 1, Leg.SLEWED))
        axis_x = self._axis_is_x(following)
        return following._replace(
            to_go=jnp.where(slewing.leg == Leg.FIRST_SLEW, second, third),
            last_rate=jnp.where(axis_x, state.omega[0], state.omega[1]),
        )
