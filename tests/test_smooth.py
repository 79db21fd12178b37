"""Functions with corners, on each side of theirs."""

import jax.numpy as jnp
import numpy as np

from jaxsat.smooth import as_width, root_abs, sat, signed_root


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
