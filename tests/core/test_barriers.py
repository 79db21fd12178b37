"""Calls that XLA does not take apart, and branches that a whole batch leaves out."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.core.trees import apart
from jaxsat.simulation.engine.flat_ode import FlatODE


def _primitives(jaxpr):
    found = set()
    for eqn in jaxpr.eqns:
        found.add(eqn.primitive.name)
        for value in eqn.params.values():
            for inner in value if isinstance(value, tuple | list) else [value]:
                inner = getattr(inner, "jaxpr", inner)
                if hasattr(inner, "eqns"):
                    found |= _primitives(inner)
    return found


@jax.jit
def _sine(x):
    return jnp.sin(x)


def test_a_call_apart_gives_the_same_and_stays_a_call():
    def several(x, together):
        y = apart(_sine, x) if together else jnp.sin(x)
        return [jnp.sum(y * k) for k in range(3)]

    x = jnp.linspace(0.1, 0.9, 5)
    compiled = jax.jit(several, static_argnums=1).lower(x, True).compile()
    assert " call(" in compiled.as_text()
    np.testing.assert_allclose(compiled(x), several(x, False), rtol=1e-14)
    slope = jax.jacfwd(lambda x: apart(_sine, x))(jnp.asarray(0.3))
    np.testing.assert_allclose(slope, np.cos(0.3), rtol=1e-14)


def _branching(batch):
    ode = FlatODE(None, None, None, None, batch)  # pyright: ignore[reportArgumentType]

    def one(gain, x, number):
        wanted = (x > 0) & (number > 1)
        return ode.cold_branch(wanted, lambda: (jnp.sin(gain * x), number + 1), (gain**2, number))

    return one


def test_a_batch_leaves_out_a_branch_that_none_of_it_wants():
    x, number, gain = jnp.array([-1.0, 0.3, 0.7]), jnp.array([2, 2, 0]), jnp.array(1.3)
    several = jax.vmap(_branching("cases"), (None, 0, 0), axis_name="cases")
    assert "cond" in _primitives(jax.make_jaxpr(several)(gain, x, number).jaxpr)
    for none in (1, 0):
        found = several(gain, x, none * number)
        alone = [_branching(None)(gain, x[i], none * number[i]) for i in range(3)]
        np.testing.assert_array_equal(found, np.array(alone).T)


def test_the_derivative_of_a_branch_that_a_batch_may_leave_out():
    x, number, gain = jnp.array([-1.0, 0.3, 0.7]), jnp.array([2, 2, 0]), jnp.array(1.3)

    def slopes(x, number):
        return jax.jacfwd(lambda gain: _branching("cases")(gain, x, number)[0])(gain)

    found = jax.vmap(slopes, axis_name="cases")(x, number)
    expected = [2 * 1.3, 0.3 * np.cos(1.3 * 0.3), 2 * 1.3]
    np.testing.assert_allclose(found, expected, rtol=1e-14)
