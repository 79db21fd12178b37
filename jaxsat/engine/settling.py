"""Since when a trajectory of adaptive steps is settled, judged on their dense output."""

from itertools import pairwise

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.engine.crossing import Bracket, located
from jaxsat.engine.walk import Course, Stretch, constant
from jaxsat.metrics import Since
from jaxsat.simulation.assessment import Sight


def judged_along(
    course: Course, stretch: Stretch, until: Float[Array, ""], settled: Since
) -> Since:
    """Since when the case is settled, with the part `until` of a step taken into account.

    It is looked at the ends of equal parts, as many as for switches, and the instant at which it
    comes inside the tolerances is located between them. Nothing of it is differentiated.
    """
    course, stretch, until = constant((course, stretch, until))
    tolerances = course.program.tolerances

    def excess(part):
        t = stretch.begin + part * stretch.length
        state = course.state(t, course.dense(stretch, part))
        return Sight.of(course.loop.plant, course.loop.plant_state(state)).excess(tolerances)

    count = course.output.looks
    parts = [until * number / count for number in range(1, count + 1)]
    values = [excess(part) for part in parts]
    depths = [-jnp.max(value) for value in (settled.excess, *values)]  # positive inside
    ends = list(zip([jnp.zeros_like(until), *parts], depths, strict=True))
    bracket = Bracket(*ends[0], *ends[0])
    enters = jnp.zeros_like(until) > 0
    for low, high in pairwise(ends):
        here = (low[1] <= 0) & (high[1] > 0)
        now = Bracket(*low, *high)
        bracket = Bracket(*(jnp.where(here, x, y) for x, y in zip(now, bracket, strict=True)))
        enters |= here
    end = stretch.begin + until * stretch.length
    inside = depths[-1] > 0
    part = located(lambda part: -jnp.max(excess(part)), bracket, enters & inside)
    entry = jnp.where(enters, stretch.begin + part * stretch.length, stretch.begin)
    before = settled._replace(start=jnp.where(enters, jnp.inf, settled.start))
    return before.entered(entry, end, values[-1])
