"""Functions with corners, on each side of theirs."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.core.smooth import (
    as_width,
    at_least,
    positive_part,
    root_abs,
    sat,
    signed_root,
    without_slope,
)


def test_a_width_of_zero_is_the_corner_itself():
    assert as_width(0.0) is None
    assert as_width(None) is None
    assert as_width(0.3) == 0.3


def test_functions_with_corners_stay_on_their_side():
    x, bound = jnp.array([-2.0, 0.5, 2.0]), jnp.array(1.0)
    np.testing.assert_array_equal(sat(x, bound), [-1, 0.5, 1])
    np.testing.assert_array_equal(sat(x, bound, None, jnp.zeros(3, bool)), x)
    np.testing.assert_array_equal(sat(x, bound, None, jnp.ones(3, bool)), [-1, 1, 1])
    four = jnp.array(4.0)
    for positive, roots in ((None, (2, 2, 2, -2)), (True, (2, 2, 0, 0)), (False, (0, 0, 2, -2))):
        side = None if positive is None else jnp.array(positive)
        found = [f(v, None, side) for v in (four, -four) for f in (root_abs, signed_root)]
        np.testing.assert_array_equal(found, roots)


def test_a_number_without_slope_is_the_number():
    def spike(x):  # as the oscillation that is asked for where next to none is
        return without_slope(1e-18 * x / jnp.sqrt(x**2 + 1e-36), jnp.abs(x) < 1e-12)

    x, step = jnp.asarray([-0.5, 0.0, 1e-19]), 1e-6
    np.testing.assert_array_equal(spike(x), 1e-18 * x / jnp.sqrt(x**2 + 1e-36))
    for point in (0.0, 1e-19):
        differences = (spike(point + step) - spike(point - step)) / (2 * step)
        np.testing.assert_allclose(jax.grad(spike)(point), differences, atol=1e-11)


def test_the_slope_at_a_bound_that_is_just_met_is_that_of_the_number():
    x, step = jnp.asarray([-0.5, 0.0, 0.3]), 1e-6
    np.testing.assert_array_equal(positive_part(x), [0, 0, 0.3])
    np.testing.assert_array_equal(at_least(x, -x), [0.5, 0, 0.3])
    above = (positive_part(x + step) - positive_part(x)) / step
    for mode in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(mode(positive_part)(x), np.diag(above), atol=1e-9)
        np.testing.assert_allclose(mode(at_least)(x, 0 * x), np.diag(above), atol=1e-9)
        np.testing.assert_array_equal(mode(at_least, 1)(x, 0 * x), np.diag([1, 0, 0]))
