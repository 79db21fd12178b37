"""Programs in one piece of machine code, and branches that a whole batch leaves out."""

import jax
import jax.numpy as jnp
import jaxlib.version
import numpy as np
import pytest
from jax import lax

from jaxsat.compiler import (
    COMPILED_WHOLE,
    TESTED,
    WIDEST,
    apart,
    compiles_whole,
    in_one_piece,
    primitives,
)
from jaxsat.engine.walk import Course

LANES = 5
KNOWN = jax.default_backend() == "cpu" and jaxlib.version.__version_info__[:2] in TESTED
only_where_known = pytest.mark.skipif(not KNOWN, reason="this jaxlib takes plain calls")

INSIDE = (lax.abs, lax.acos, lax.asin, lax.atan, lax.cbrt, lax.ceil, lax.cos, lax.cosh, lax.erf)
INSIDE += (lax.erf_inv, lax.exp, lax.exp2, lax.expm1, lax.floor, lax.log, lax.log1p, lax.logistic)
INSIDE += (lax.neg, lax.round, lax.rsqrt, lax.sign, lax.sin, lax.sinh, lax.sqrt, lax.square)
INSIDE += (lax.tan, lax.tanh, lax.stop_gradient, lax.optimization_barrier, jnp.copy)


@jax.custom_vjp
def _doubled(x):
    return 2 * x


_doubled.defvjp(lambda x: (2 * x, None), lambda _, slope: (2 * slope,))


def _arithmetic(x, y, v):
    yield from (function(x) for function in INSIDE)
    yield from (x + y, x - y, x * y, x / y, x**y, y**3, lax.rem(y, x), lax.atan2(x, y))
    yield from (lax.max(x, y), lax.min(x, y), lax.clamp(0.2, x, 0.3), jnp.where(x < y, x, y))
    yield from (jnp.sum(v), jnp.prod(v), jnp.max(v), jnp.min(v), v @ v, jnp.outer(v, v) @ v)
    yield from (v[jnp.argmax(v)], v[jnp.argmin(v)], v[jnp.arange(3) % 2])
    for compare in (lax.eq, lax.ne, lax.lt, lax.le, lax.gt, lax.ge):
        yield compare(x, y)
    yield ~(jnp.isfinite(x) & jnp.any(v > x) | jnp.all(v > y))
    bits = lax.bitcast_convert_type(y, jnp.int64)
    yield lax.shift_right_logical(bits, 3) ^ lax.shift_right_arithmetic(bits << 2, 5)


def _structure(x, y, v, number):
    yield from (jnp.stack([x, y]), jnp.concatenate([v, v]), jnp.pad(v, 1), v[::-1], v[1:])
    yield from (jnp.split(v, [1])[1], v.reshape(3, 1).T, jnp.broadcast_to(x, (2, 2)), *v)
    yield v[number]
    yield jnp.expand_dims(x, 0).squeeze(0) + jnp.arange(3.0)
    yield lax.cond(lax.pmax(x, "cases") < 0.5, jnp.sin, jnp.cos, y)
    yield lax.while_loop(lambda n: n[1] < number + 2, lambda n: (n[0] * x, n[1] + 1), (y, 0))
    yield lax.scan(lambda c, z: (c * z, c + z), x, v)
    yield from (jax.nn.relu(x), _doubled(x), jax.checkpoint(jnp.sin)(x), jax.jit(jnp.hypot)(x, y))
    yield jax.grad(lambda x: jnp.sin(x) * x)(x)
    yield apart(jax.jit(lambda x: jnp.sin(x)), x)


def _everything(x, y, v, number, unused):
    del unused
    return [*_arithmetic(x, y, v), *_structure(x, y, v, number)]


def _inputs():
    x = jnp.linspace(0.1, 0.9, LANES)
    return x, 1.3 + x**2, jnp.outer(x, jnp.array([1.0, -2.0, 0.7])), jnp.arange(LANES) % 2, x


def _batched(x, y, v, number, unused):
    first, second, *_ = jnp.unstack(x)
    part = lax.dynamic_slice(x, (number[1],), (2,))
    several = jax.vmap(_everything, axis_name="cases")(x, y, v, number, unused)
    return several, first * second, lax.dynamic_update_slice(y, part, (number[0],))


@jax.jit
def _whole(*inputs):
    return in_one_piece(lambda: _batched(*inputs), LANES)


@pytest.mark.slow
@only_where_known
def test_one_piece_of_all_that_is_known_to_compile_so():
    inputs = _inputs()
    assert primitives(jax.make_jaxpr(_batched)(*inputs).jaxpr) == COMPILED_WHOLE
    compiled = _whole.lower(*inputs).compile()
    assert "xla_cpu_small_call" in compiled.as_text()
    both = compiled(*inputs), jax.jit(_batched)(*inputs)
    for found, wanted in zip(*map(jax.tree.leaves, both), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("lanes", [3, WIDEST + 1])
@pytest.mark.parametrize("function", [jnp.sort, lambda x: x.at[x.size // 2].set(1.0)])
def test_what_is_not_known_to_compile_or_is_wide_is_left_as_it_is(function, lanes):
    x = jnp.linspace(1.0, 0.0, lanes)
    one = jax.jit(lambda x: in_one_piece(lambda: function(x), lanes))
    assert not compiles_whole(jax.make_jaxpr(function)(x).jaxpr)
    assert "xla_cpu_small_call" not in one.lower(x).as_text()
    np.testing.assert_array_equal(one(x), function(x))


def _branching(batch):
    course = Course(None, None, None, batch)  # pyright: ignore[reportArgumentType]

    def one(gain, x, number):
        wanted = (x > 0) & (number > 1)
        return course.seldom(wanted, lambda: (jnp.sin(gain * x), number + 1), (gain**2, number))

    return one


def test_a_batch_leaves_out_a_branch_that_none_of_it_wants():
    x, number, gain = jnp.array([-1.0, 0.3, 0.7]), jnp.array([2, 2, 0]), jnp.array(1.3)
    several = jax.vmap(_branching("cases"), (None, 0, 0), axis_name="cases")
    assert "cond" in primitives(jax.make_jaxpr(several)(gain, x, number).jaxpr)
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
