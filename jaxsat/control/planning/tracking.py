"""Feedback along a plan: a time-varying linear-quadratic regulator."""

from typing import NamedTuple

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jaxsat.control.planning.riccati import solved
from jaxsat.control.planning.search import in_hemisphere_of
from jaxsat.control.planning.transcription import STATES, Transcription, Unknowns
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar

WEIGHTS, LAST_WEIGHTS = (10.0,) * 4 + (2.0,) * 3, (100.0,) * 4 + (30.0,) * 3
"""Weights of the feedback, for (q, ω τ): along the plan, and at its end."""


class Guidance(NamedTuple):
    """The tracked plan, the feedback along it, and its begin in units of τ."""

    plan: Unknowns
    gains: Float[Array, "n m 7"]
    begin: RealScalar


class PlanTable(NamedTuple):
    """A plan as flight code takes it: `begin` (s since the law began) and `duration` (s), and for
    each of its equal intervals `attitude` (quaternion relative to the orbit frame) and inertial
    `rate` (rad/s) at its begin, its constant `torque` (N m) about the driven axes, and the feedback
    of errors of quaternion and rate, `attitude_gain` (N m) and `rate_gain` (N m s).
    """

    begin: RealScalar
    duration: RealScalar
    attitude: Float[Array, "n 4"]
    rate: Float[Array, "n 3"]
    torque: Float[Array, "n m"]
    attitude_gain: Float[Array, "n m 4"]
    rate_gain: Float[Array, "n m 3"]


def table_of(program: Transcription, guidance: Guidance) -> PlanTable:
    """The table of a plan and its feedback, in SI units."""
    (plan, gains, begin), unit = guidance, program.time_unit
    attitude, rate = plan.states[:, :4], plan.states[:, 4:] / unit
    torque, gains = plan.torque * program.limit, gains * program.limit
    times = begin * unit, plan.duration * unit
    return PlanTable(*times, attitude, rate, torque, gains[..., :4], gains[..., 4:] * unit)


def guidance_if(
    program: Transcription, new: BoolScalar, plan: Unknowns, begin: RealScalar, old: Guidance
) -> Guidance:
    """A `new` plan with its feedback, or the `old` one.

    A loop of at most one pass: a batch computes gains only when some of its cases need them.
    """

    def turn(at):
        gains = tracking_gains(program, begin, plan, jnp.array(WEIGHTS), jnp.array(LAST_WEIGHTS))
        return Guidance(plan, gains, begin), at[1] + 1

    return lax.while_loop(lambda at: (at[1] < 1) & new, turn, (old, jnp.array(0)))[0]


def following_torque(
    program: Transcription,
    now: RealScalar,
    x: Float[Array, "7"],
    guidance: Guidance,
    period: RealScalar,
) -> Float[Array, " m"]:
    """The torque over the next `period` that tracks a plan, all dimensionless.

    Zero before the plan's begin; it may exceed the limits.
    """
    plan, begin, gains = guidance.plan, guidance.begin, guidance.gains
    elapsed = now - begin
    target = planned_state(program, begin, plan, elapsed)
    error = in_hemisphere_of(target, x) - target
    error = jnp.where(elapsed + period / 2 > 0, error, 0.0)
    feedback = gains[interval_at(program, plan, elapsed)[0]] @ error
    return mean_torque(program, plan, elapsed, period) + feedback


def tracking_gains(
    program: Transcription,
    begin: RealScalar,
    plan: Unknowns,
    weights: Float[Array, "7"],
    last: Float[Array, "7"],
) -> Float[Array, "n m 7"]:
    """K of u = u_plan + K (x - x_plan) in every interval, all dimensionless.

    For the linearised dynamics K minimises the sum over all intervals of dxᵀ diag(`weights`) dx +
    |du|², times the length of one, plus dxᵀ diag(`last`) dx at the end.
    """
    length = plan.duration / program.intervals

    def backward(to_go: Float[Array, "7 7"], row):
        number, x, u = row
        _, by_state, b = program.linearised(begin, number, x, plan.duration, u)
        a = by_state[:, :STATES]
        weighted = to_go @ b
        own = b.T @ weighted + length * jnp.eye(u.shape[0])
        cross = weighted.T @ a
        gain = -solved(own, cross)
        before = a.T @ to_go @ a + cross.T @ gain + length * jnp.diag(weights)
        return (before + before.T) / 2, gain

    rows = (program.numbers(plan), plan.states, plan.torque)
    return lax.scan(backward, jnp.diag(last), rows, reverse=True)[1]


def planned_state(
    program: Transcription, begin: RealScalar, plan: Unknowns, elapsed: RealScalar
) -> Float[Array, "7"]:
    """The state of a plan `elapsed` after its begin."""
    number, share = interval_at(program, plan, elapsed)
    x, u = plan.states[number], plan.torque[number]
    part = share * plan.duration
    number = number.astype(x.dtype)
    since = begin + number * (plan.duration - part) / program.intervals
    return program.interval(since, number, x, part, u)


def mean_torque(
    program: Transcription, plan: Unknowns, elapsed: RealScalar, period: RealScalar
) -> Float[Array, " m"]:
    """The mean of a plan's torque from `elapsed` after its begin, over a `period`; then zero."""
    sums = jnp.concatenate([jnp.zeros_like(plan.torque[:1]), jnp.cumsum(plan.torque, axis=0)])

    def until(elapsed):
        number, share = interval_at(program, plan, elapsed)
        return sums[number] + share * plan.torque[number]

    length = plan.duration / program.intervals
    return (until(elapsed + period) - until(elapsed)) * length / period


def interval_at(
    program: Transcription, plan: Unknowns, elapsed: RealScalar
) -> tuple[IntScalar, RealScalar]:
    """The interval at a time after the begin, and its elapsed share."""
    place = jnp.clip(elapsed / plan.duration * program.intervals, 0.0, float(program.intervals))
    number = jnp.minimum(place.astype(int), program.intervals - 1)
    return number, place - number
