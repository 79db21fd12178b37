"""Functions with corners, on each side of theirs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core.smooth import (
    as_width,
    at_least,
    positive_part,
    root_abs,
    sat,
    signed_root,
    without_slope,
)

STEPS = 1e-5, -1e-5


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


@pytest.mark.parametrize("width", [0.25, 1.0])
def test_a_rounded_corner_has_the_values_of_its_formula_and_their_slopes(width):
    """On both sides of the corner, and at zero, where the slope is one."""
    x, bound = np.array([-3.0, -1.1, -0.4, 0.0, 0.3, 1.6, 40.0]), 1.5

    def formula(x, bound, width):
        size, straight = np.abs(x), (1 - width) * bound
        beyond = np.maximum(size - straight, 0)
        rounded = np.minimum(size, straight) + width * bound * np.tanh(beyond / (width * bound))
        return np.copysign(rounded, x)

    point = x, bound, width
    np.testing.assert_allclose(sat(*map(jnp.asarray, point)), formula(*point), rtol=1e-14)
    for place in range(3):
        step = np.arange(3) == place
        ahead, behind = ([v + way * s for v, s in zip(point, step, strict=True)] for way in STEPS)
        differences = (formula(*ahead) - formula(*behind)) / (STEPS[0] - STEPS[1])
        tangents = [jnp.full_like(jnp.asarray(v), s) for v, s in zip(point, step, strict=True)]
        slopes = jax.jvp(sat, tuple(map(jnp.asarray, point)), tuple(tangents))[1]
        np.testing.assert_allclose(slopes, differences, atol=2e-10)
    assert jax.grad(sat)(*map(jnp.asarray, (0.0, bound, width))) == 1


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
