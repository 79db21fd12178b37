import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.quotients import reciprocal

POINTS = jnp.asarray([0.3, -2.0, 7.5])


def test_a_reciprocal_and_its_derivatives():
    np.testing.assert_array_equal(reciprocal(POINTS), 1 / POINTS)
    step = 1e-5
    for x in map(jnp.asarray, (0.3, -2.0, 7.5)):
        slope = (1 / (x + step) - 1 / (x - step)) / (2 * step)
        np.testing.assert_allclose(jax.jvp(reciprocal, (x,), (jnp.ones(()),))[1], slope, rtol=1e-8)
        np.testing.assert_allclose(jax.grad(reciprocal)(x), slope, rtol=1e-8)
        np.testing.assert_allclose(jax.grad(jax.grad(reciprocal))(x), 2 / x**3, rtol=1e-14)


def test_a_derivative_divides_no_more_than_the_value():
    def both(x):
        return jax.jvp(reciprocal, (x,), (jnp.ones_like(x),))

    def divisions(jaxpr):
        count = sum(eqn.primitive.name in ("div", "integer_pow") for eqn in jaxpr.eqns)
        inner = [eqn.params.get("call_jaxpr", eqn.params.get("jaxpr")) for eqn in jaxpr.eqns]
        return count + sum(divisions(part.jaxpr) for part in inner if part is not None)

    assert divisions(jax.make_jaxpr(both)(jnp.asarray(2.0)).jaxpr) == 1
