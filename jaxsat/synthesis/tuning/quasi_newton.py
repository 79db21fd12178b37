"""optimistix' BFGS for a function that is computed outside of JAX."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from jaxtyping import Float

Vector = Float[np.ndarray, " n"]


def minimise(
    gradient: Callable[[Vector], tuple[float, Vector]], start: Vector, low: Vector, high: Vector
) -> Vector:
    """BFGS from `start` until it ends or `gradient` raises; beyond the bounds it is flat.

    `gradient` gives value and gradient at a point within the bounds. A step of optimistix looks at
    its function at one point only, which is known beforehand, so it is given the tangent there.
    """
    solver = optimistix.BFGS(rtol=1e-8, atol=1e-8)
    point = jnp.asarray(start)
    options, tags = {}, frozenset()
    scalar = jax.ShapeDtypeStruct((), point.dtype)
    state = solver.init(lambda y, _: (jnp.sum(y), None), point, None, options, scalar, None, tags)

    @eqx.filter_jit
    def step(point, state, value, slope):
        there = state.y_eval

        def tangent(y, _):
            return value + jnp.sum(slope * (y - there)), None

        point, state, _ = solver.step(tangent, point, None, options, state, tags)
        return point, state, solver.terminate(tangent, point, None, options, state, tags)[0]

    done = False
    while not done:
        asked = np.asarray(state.y_eval)
        inside = np.clip(asked, low, high)
        value, slope = gradient(inside)
        slope = np.where(asked == inside, slope, 0.0)
        point, state, done = step(point, state, jnp.asarray(value), jnp.asarray(slope))
    return np.clip(np.asarray(point), low, high)
