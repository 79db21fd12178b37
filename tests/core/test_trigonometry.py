"""Sine and cosine in basic operations against NumPy and 60 digits, for every size of angle."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import sympy

from jaxsat.core.trigonometry import cos, sin

FUNCTIONS = {"sin": (sin, np.sin, sympy.sin), "cos": (cos, np.cos, sympy.cos)}


def angles(limit, count, seed=1):
    return jnp.asarray(np.random.default_rng(seed).uniform(-limit, limit, count))


@pytest.mark.slow
@pytest.mark.parametrize("name", FUNCTIONS)
def test_below_the_limit_it_is_right_to_two_units_in_the_last_place(name):
    ours, theirs, exact = FUNCTIONS[name]
    near_multiples = jnp.arange(-10000, 10001) * (jnp.pi / 2)
    x = jnp.concatenate([angles(2.0**14, 50000), angles(4, 50000), near_multiples])
    for found in (ours(x), jax.jit(jax.vmap(ours))(x)):
        assert (np.abs(found - theirs(x)) / np.spacing(np.abs(theirs(x)))).max() <= 3
    some = jnp.concatenate([x[:100], near_multiples[::500]])
    true = np.array([float(exact(sympy.Rational(float(value))).evalf(60)) for value in some])
    assert (np.abs(ours(some) - true) / np.spacing(np.abs(true))).max() <= 2


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("size", [1e5, 1e8, 1e12, 1e15])
def test_beyond_it_the_argument_is_as_good_as_rounded(name, size):
    ours, theirs, _ = FUNCTIONS[name]
    x = angles(size, 20000)
    assert np.abs(ours(x) - theirs(x)).max() <= 1.5 * np.spacing(size)


def test_special_values():
    assert np.isnan(sin(jnp.array([jnp.inf, -jnp.inf, jnp.nan]))).all()
    assert np.isnan(cos(jnp.array([jnp.inf, -jnp.inf, jnp.nan]))).all()
    np.testing.assert_array_equal(sin(jnp.array([0.0, 1e-300])), [0.0, 1e-300])
    assert np.signbit(sin(jnp.array(-0.0)))
    np.testing.assert_array_equal(cos(jnp.array([0.0, -0.0, 1e-300])), 1.0)
    for function in (sin, cos):
        assert np.abs(function(angles(1e300, 10000))).max() <= 1


def test_derivatives():
    x = angles(10, 50)
    h = 1e-6
    for function in (sin, cos):
        central = (np.asarray(function(x + h)) - np.asarray(function(x - h))) / (2 * h)
        np.testing.assert_allclose(jax.vmap(jax.grad(function))(x), central, atol=1e-9)
    np.testing.assert_allclose(jax.vmap(jax.grad(jax.grad(sin)))(x), -np.sin(x), rtol=1e-14)


def test_32_bit_floats_stay_so():
    for function, theirs, _ in FUNCTIONS.values():
        found = function(jnp.float32(0.3))
        assert found.dtype == jnp.float32
        np.testing.assert_allclose(found, theirs(0.3), rtol=1e-6)
