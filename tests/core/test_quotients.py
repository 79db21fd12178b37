import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core.quotients import quotient, reciprocal, share_within

POINTS = jnp.asarray([0.3, -2.0, 7.5])


def test_a_reciprocal_and_its_derivatives():
    np.testing.assert_array_equal(reciprocal(POINTS), 1 / POINTS)
    step = 1e-5
    for x in map(jnp.asarray, (0.3, -2.0, 7.5)):
        slope = (1 / (x + step) - 1 / (x - step)) / (2 * step)
        np.testing.assert_allclose(jax.jvp(reciprocal, (x,), (jnp.ones(()),))[1], slope, rtol=1e-8)
        np.testing.assert_allclose(jax.grad(reciprocal)(x), slope, rtol=1e-8)
        np.testing.assert_allclose(jax.grad(jax.grad(reciprocal))(x), 2 / x**3, rtol=1e-14)


def test_a_quotient_and_its_derivatives():
    step = 1e-5
    for x, y in jnp.asarray([(0.3, -2.0), (-1.5, 0.7)]):
        np.testing.assert_allclose(quotient(x, y), x / y, rtol=3e-16)
        by_x = (x + step) / y - (x - step) / y, 1 / y
        by_y = x / (y + step) - x / (y - step), -x / y**2
        for number, (change, exact) in enumerate((by_x, by_y)):
            found = jax.grad(quotient, number)(x, y)
            np.testing.assert_allclose(found, change / (2 * step), rtol=1e-8)
            np.testing.assert_allclose(found, exact, rtol=1e-14)
        slope = jax.jvp(quotient, (x, y), (jnp.asarray(2.0), jnp.asarray(-3.0)))[1]
        np.testing.assert_allclose(slope, 2 / y + 3 * x / y**2, rtol=1e-14)
        twice = jax.grad(jax.grad(quotient, 1), 1)(x, y)
        np.testing.assert_allclose(twice, 2 * x / y**3, rtol=1e-14)


@pytest.mark.parametrize("function", [reciprocal, lambda x: quotient(jnp.asarray(3.0), x)])
def test_a_derivative_divides_no_more_than_the_value(function):
    def both(x):
        return jax.jvp(function, (x,), (jnp.ones_like(x),))

    def divisions(jaxpr):
        count = sum(eqn.primitive.name in ("div", "integer_pow") for eqn in jaxpr.eqns)
        inner = [eqn.params.get("call_jaxpr", eqn.params.get("jaxpr")) for eqn in jaxpr.eqns]
        return count + sum(divisions(part.jaxpr) for part in inner if part is not None)

    assert divisions(jax.make_jaxpr(both)(jnp.asarray(2.0)).jaxpr) == 1


def test_the_share_within_a_bound_that_may_be_infinite():
    def share(most, size):
        return np.minimum(1.0, np.divide(most, size))

    step = 1e-6
    for most, size in ((2.0, 3.0), (2.0, 0.5), (np.inf, 0.5), (np.inf, 0.0), (2.0, 1e-300)):
        arrays = (jnp.asarray(most), jnp.asarray(size))
        with np.errstate(divide="ignore"):
            np.testing.assert_array_equal(share_within(*arrays), share(most, size))
            slope = (share(most, size + step) - share(most, max(size - step, 0.0))) / (2 * step)
        for mode in (jax.jacfwd, jax.jacrev):
            np.testing.assert_allclose(mode(share_within, 1)(*arrays), slope, rtol=1e-8)
