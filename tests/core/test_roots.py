"""Roots and angles against NumPy's, and their derivatives against differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core.quotients import angle_of, length, root

STEP = 1e-6
SMALL = 3e-5  # a value is this far from zero where the differences are to be right


@pytest.mark.parametrize(
    ("function", "usual", "points"),
    [
        (root, np.sqrt, [[0.3], [7.5], [SMALL]]),
        (length, np.linalg.norm, [[0.3, -2.0, 0.5], [0.0, 0.0, SMALL]]),
        (lambda v: angle_of(*v), lambda v: np.arctan2(*v), [[0.3, -2.0], [-1.0, 0.0]]),
    ],
)
def test_values_are_the_usual_ones_and_derivatives_those_of_differences(function, usual, points):
    for point in map(np.array, points):
        np.testing.assert_array_equal(function(jnp.asarray(point)), usual(point))
        for way in np.eye(len(point)):
            step = STEP * SMALL * way
            slope = (usual(point + step) - usual(point - step)) / (2 * STEP * SMALL)
            found = jax.jvp(function, (jnp.asarray(point),), (jnp.asarray(way),))[1]
            np.testing.assert_allclose(found, slope, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(
    ("function", "size"), [(root, 1), (length, 3), (lambda v: angle_of(*v), 2)]
)
def test_at_zero_the_derivative_is_zero_in_both_modes(function, size):
    zero = jnp.zeros(size)
    both = (jax.jacfwd(function)(zero), jax.jacrev(function)(zero))
    np.testing.assert_array_equal(both, np.zeros_like(both))
    # so that what a zero counts for nothing in has a derivative
    np.testing.assert_array_equal(jax.grad(lambda v: jnp.sum(function(v) ** 2))(zero), zero)
