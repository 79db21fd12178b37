"""The plain step against diffrax's own, and its order against an exact solution."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.simulation.engine.dense_output import dense_output
from jaxsat.simulation.engine.runge_kutta import (
    explicit_step,
    stage_rates,
    tableau_of,
    weighted,
)

SOLVERS = [
    diffrax.Heun(),
    diffrax.Bosh3(),
    diffrax.Tsit5(),
    diffrax.Dopri5(),
    diffrax.Dopri8(),
]


def rate(t, y):
    return {"x": y["v"], "v": -4 * y["x"] + jnp.sin(t)}


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_step_is_that_of_diffrax(solver):
    y, t, h = {"x": jnp.array(1.0), "v": jnp.array(-0.3)}, jnp.array(0.4), jnp.array(0.3)
    term = diffrax.ODETerm(lambda t, y, args: rate(t, y))
    state = solver.init(term, t, t + h, y, None)
    expected = solver.step(term, t, t + h, y, None, state, made_jump=False)[0]
    found = explicit_step(tableau_of(solver), rate, t, h, y)
    for name in "xv":
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-14)


@pytest.mark.parametrize(("solver", "stages"), list(zip(SOLVERS, (2, 3, 6, 6, 13), strict=True)))
def test_all_stages_share_one_trace_of_the_rate(solver, stages):
    traces = []

    def noted(t, y):
        traces.append(t)
        return rate(t, y)

    y, t, h, tableau = {"x": jnp.ones(()), "v": jnp.ones(())}, *jnp.ones(2), tableau_of(solver)
    jaxpr = jax.make_jaxpr(lambda *now: explicit_step(tableau, noted, *now))(t, h, y)
    written = sum(one.primitive.name == "sin" for one in jaxpr.eqns)
    assert (len(traces), written) == (1, stages)


def test_the_rate_may_be_a_module_of_traced_numbers():
    """As a loop is, which cannot be hashed."""

    class Decay(eqx.Module):
        constant: jax.Array

        def __call__(self, t, y):
            return -self.constant * y

    def after(constant):
        tableau = tableau_of(diffrax.Dopri8())
        return explicit_step(tableau, Decay(constant), jnp.zeros(()), jnp.ones(()), jnp.ones(()))

    np.testing.assert_allclose(jax.jit(after)(jnp.array(0.5)), np.exp(-0.5), rtol=1e-7)


@pytest.mark.parametrize(("solver", "order"), list(zip(SOLVERS, (2, 3, 5, 5, 8), strict=True)))
def test_the_order_of_a_step(solver, order):
    """x'' = -4 x + sin t has x = cos 2t + sin(t) / 3 from x = 1, v = 1/3."""
    errors = []
    for h in (0.4, 0.2):
        y = {"x": jnp.array(1.0), "v": jnp.array(1 / 3)}
        found = explicit_step(tableau_of(solver), rate, jnp.array(0.0), jnp.array(h), y)
        errors.append(abs(float(found["x"]) - np.cos(2 * h) - np.sin(h) / 3))
    assert np.log2(errors[0] / errors[1]) > order + 0.4


@pytest.mark.parametrize("solver", [diffrax.Tsit5(), diffrax.Dopri5(), diffrax.Dopri8()])
def test_the_dense_output_is_that_of_diffrax(solver):
    def slope(t, y):
        return jnp.stack([y[1], -4 * y[0] + jnp.sin(t)])

    y, t, h = jnp.array([1.0, -0.3]), jnp.array(0.4), jnp.array(0.3)
    term = diffrax.ODETerm(lambda t, y, args: slope(t, y))
    state = solver.init(term, t, t + h, y, None)
    _, _, inside, _, _ = solver.step(term, t, t + h, y, None, state, made_jump=False)
    theirs = solver.interpolation_cls(t0=t, t1=t + h, **inside)
    tableau = tableau_of(solver)
    rates = stage_rates(tableau, slope, t, h, y, slope(t, y))
    output = dense_output(solver)
    increments = output.increments(h, rates, h * weighted(tableau.b_sol, rates))
    coefficients = np.asarray(output.coefficients(increments))
    for part in np.linspace(0.0, 1.0, 9):
        expected = theirs.evaluate(t + part * h)
        found = output.at(y, increments, jnp.asarray(part))
        np.testing.assert_allclose(found, expected, rtol=1e-13)
        by_powers = y + part ** np.arange(1, len(coefficients) + 1) @ coefficients
        np.testing.assert_allclose(by_powers, expected, rtol=1e-13)
