"""Where a step meets a switch of its loop, with derivatives that move the instant."""

from itertools import pairwise
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.engine.crossing import Bracket, located
from jaxsat.engine.walk import Course, Stretch, Walk, constant


class Landing(NamedTuple):
    """Where a step ends: its length (s), flat state with its rate, and the sides with their
    functions there."""

    seconds: Float[Array, ""]
    state: Float[Array, " n"]
    rate: Float[Array, " n"]
    sides: Bool[Array, " m"]
    gaps: Float[Array, " m"]


def until_switch(
    course: Course,
    walk: Walk,
    stretch: Stretch,
    end: Landing,
    wanted: Bool[Array, ""],
    min_step: Float[Array, ""],
) -> Landing:
    """The landing of a step that begins at `walk`, goes along `stretch` and would land at `end`.

    It is at the first switch, though at least `min_step` (s) away, or at the end of the step. A
    step for which it is not `wanted` costs no search.
    """
    whole = stretch.length
    if not walk.sides.size:
        return end
    sign = jnp.where(walk.sides, -1.0, 1.0)

    still = constant((course, walk.t, stretch))

    def gaps_at(part):
        still_course, t, still_stretch = still
        return still_course.gaps(
            walk.sides, t + part * whole, still_course.dense(still_stretch, part)
        )

    def excess(part):  # positive beyond a surface
        return jnp.max(sign * gaps_at(part))

    end = end._replace(gaps=course.gaps(walk.sides, walk.t + whole, end.state))
    bracket = _bracket(sign, constant(walk.gaps), excess, constant(end.gaps), course.output.looks)
    crosses = wanted & (bracket.high_value > 0)

    def at_switch():
        part = constant(located(excess, bracket, crosses))
        one_hot = jnp.arange(sign.size) == jnp.argmax(sign * gaps_at(part))
        seconds = _corrected(course, walk, stretch, one_hot, part)
        seconds = jnp.clip(seconds, jnp.minimum(min_step, whole), whole)
        t, state = walk.t + seconds, course.dense(stretch, seconds / whole)
        flipped = walk.sides ^ one_hot
        gaps = course.gaps(flipped, t, state)
        # what jumps with the piece may be on another side there
        sides = jnp.where(one_hot, flipped, gaps > 0)
        return Landing(seconds, state, course.rate(sides)(t, state), sides, gaps)

    return course.seldom(crosses, at_switch, end)


def _bracket(sign, begin_gaps, excess, end_gaps, looks: int) -> Bracket:
    """The first of equal parts of a step that crosses a surface, if its `high_value` is positive;
    else the last one."""
    begin, end = jnp.max(sign * begin_gaps), jnp.max(sign * end_gaps)
    points = [jnp.full_like(begin, number / looks) for number in range(looks + 1)]
    values = [begin, *map(excess, points[1:-1]), end]
    ends = list(zip(points, values, strict=True))
    *earlier, found = (Bracket(*low, *high) for low, high in pairwise(ends))
    for bracket in reversed(earlier):
        beyond = bracket.high_value > 0
        found = Bracket(*(jnp.where(beyond, a, b) for a, b in zip(bracket, found, strict=True)))
    return found


def _corrected(course: Course, walk: Walk, stretch: Stretch, one_hot, part) -> Float[Array, ""]:
    """The seconds until the switch: two steps of Newton's method.

    The second one moves with parameters. Taken where the function is zero, it is exact to first
    order.
    """

    def gap(seconds):
        flat = course.dense(stretch, seconds / stretch.length)
        gaps = course.gaps(walk.sides, walk.t + seconds, flat)
        return jnp.sum(jnp.where(one_hot, gaps, 0.0))

    def improved(seconds):
        value, slope = jax.jvp(gap, (seconds,), (jnp.ones_like(seconds),))
        slope = constant(slope)
        correction = -value / jnp.where(slope == 0, 1.0, slope)
        sound = (slope != 0) & (jnp.abs(correction) < 1e-2 * stretch.length)
        return jnp.where(sound, seconds + correction, seconds)

    return improved(constant(improved(part * stretch.length)))
