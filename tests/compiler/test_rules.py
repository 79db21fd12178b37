"""Every rule against XLA, with varying and uniform inputs, NaN and infinity among them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from compiler.rule_checks import CASES, check, numbers
from jaxsat.compiler import Mapped


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_arithmetic_and_comparisons_of_floats(dtype):
    def function(case, shared):
        x, y = case
        both = [(x, y), (x, shared), (shared, y)]
        return [
            (a + b, a - b, a * b, a / b, a < b, a <= b, a > b, a >= b, a == b, a != b)
            for a, b in both
        ]

    check(function, (numbers(dtype=dtype), numbers(dtype=dtype, seed=1)), dtype(0.7))


def test_extrema_signs_and_rounding():
    def function(case, shared):
        x, y = case
        both = jnp.maximum(x, y), jnp.minimum(x, y), jnp.clip(x, -0.5, y), jnp.maximum(x, 0.25)
        alone = [jnp.sign(x), jnp.abs(x), -x, jnp.floor(x), jnp.ceil(x), jnp.rint(x * 2)]
        whole = lax.round(x * 2), jnp.isfinite(x), jnp.sqrt(x), lax.rsqrt(x), jnp.square(x)
        powers = x**2, x**3, x**-2, x**0, jnp.where(x > shared, x, y), jnp.fmod(x, y)
        return both, alone, whole, powers

    check(function, (numbers(), numbers(seed=1)), 0.1, tolerance=4e-16)


@pytest.mark.parametrize("dtype", [np.int32, np.int64, np.uint32])
def test_whole_numbers(dtype):
    def function(case, shared):
        x, y = case
        sums = x + y, x - y, x * y, lax.div(x, y), lax.rem(x, y), jnp.sign(x), jnp.abs(x)
        bits = x & y, x | y, x ^ y, ~x, lax.population_count(x)
        count = jnp.abs(y).astype(dtype) * 5  # beyond the width as well
        shifts = [
            shift(x, other)
            for shift in (lax.shift_left, lax.shift_right_logical, lax.shift_right_arithmetic)
            for other in (count, jnp.asarray(3, dtype))
        ]
        far = lax.shift_right_arithmetic(~x, jnp.asarray(3, dtype))
        return sums, bits, shifts, far, jnp.maximum(x, shared), x < y, x == y

    check(function, (numbers(dtype=dtype), numbers(dtype=dtype, seed=1)), dtype(3))


def test_conversions():
    def function(case, shared):
        x, n, flag = case
        types = [jnp.float32, jnp.int32, jnp.int64, jnp.uint32, jnp.uint8, jnp.float64, bool]
        bits = lax.bitcast_convert_type(x, jnp.int64), lax.bitcast_convert_type(n, jnp.uint32)
        small = jnp.clip(jnp.nan_to_num(x), -100, 100)
        of_float = [small.astype(t) for t in types if t is not jnp.uint32 and t is not jnp.uint8]
        far = (x * 1e12).astype(jnp.int32), (x * 1e30).astype(jnp.int64)
        return bits, of_float, far, [v.astype(t) for v in (n, flag) for t in types]

    flags = numbers(dtype=bool)
    check(function, (numbers(), numbers(dtype=np.int32), flags))


def test_rounding_to_fewer_bits():
    def function(case, shared):
        del shared
        several = [lax.reduce_precision(case, *n) for n in ((8, 23), (5, 10), (11, 3))]
        return several, lax.reduce_precision(case.astype(jnp.float32), 5, 7)

    scales = 10.0 ** np.linspace(-50, 45, CASES)
    scaled = np.random.default_rng(0).normal(size=CASES) * scales
    for cases in (numbers(), scaled):
        check(function, cases, tolerance=0)


def test_moving_elements():
    def function(case, shared):
        x, row = case, shared
        joined = jnp.concatenate([x, row[None]]), jnp.stack([x[0], row]), jnp.flip(x, 1)
        padded = lax.pad(x, 7.0, [(1, 2, 1), (-1, 0, 2)]), x.T, x.reshape(3, 2), x[::2, 1:]
        return (
            joined,
            padded,
            jnp.split(x, 3, 1),
            jnp.diagonal(x),
            jnp.asarray(row)[jnp.array([2, 0])],
        )

    check(function, numbers(2, 3), np.array([1.0, 2.0, 3.0]))


def test_reductions_searches_and_sorts():
    def function(case, shared):
        x, flags = case
        sums = x.sum(), x.sum(0), x.prod(1), x.max(), x.min(1), flags.any(), flags.all(0)
        along = jnp.cumsum(x, 1), jnp.cumprod(x, 0), lax.cummax(x, 1), lax.cummin(x, 0, True)
        where = jnp.argmax(x, 1), jnp.argmin(x), jnp.argmax(flags)
        order = jnp.sort(x, 1), jnp.argsort(x, 1), lax.sort((x[0], x[1]), num_keys=2)
        return sums, along, where, order, x @ x.T, jnp.einsum("ij,kj,j->ik", x, x, shared)

    check(function, (numbers(4, 4), numbers(4, 4, dtype=bool)), np.arange(4.0), tolerance=1e-13)


@pytest.mark.parametrize("size", [5, 70])
def test_indices_known_only_when_running(size):
    def function(case, shared):
        x, i = case
        table = jnp.linspace(0.0, 1.0, size)
        reads = x[i], x[shared], table[i], x.at[i].get(mode="fill"), x.at[-i].get(mode="clip")
        pieces = lax.dynamic_slice(x, (i,), (3,)), lax.dynamic_slice(table, (shared,), (2,))
        writes = x.at[i].set(7.0), x.at[i].add(1.0), x.at[shared].max(0.0), x.at[i].min(0.0)
        return reads, pieces, writes, lax.dynamic_update_slice(x, x[:2] * 2, (i,))

    finite = np.nan_to_num(numbers(size), posinf=1.0, neginf=-1.0)
    check(function, (finite, numbers(dtype=np.int32, seed=3)), np.int32(2))


def test_random_bits_are_those_of_jax():
    from jaxsat.core import noise

    def function(case, shared):
        key = noise.fold_in(jnp.asarray(shared), jnp.asarray(case))
        return noise.bits(key, 4), noise.uniform(key, 3), noise.standard_normal(key, 5)

    check(function, np.arange(CASES), np.array([1, 2], np.uint32), tolerance=1e-13)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_convolutions_leave_padding_out(dtype):
    """As NumPy, and XLA with 64 bits: no NaN from an infinity times the zeros of padding."""
    x, weights = np.array([[1, 2, 3], [4, 5, np.inf]], dtype), np.array([np.inf, 1, -np.inf], dtype)
    mapped = Mapped(jnp.convolve, x[0], weights)
    with np.errstate(invalid="ignore"):
        expected = np.stack([np.convolve(row, weights) for row in x])
        interpreted = mapped.interpreted(x, weights)
    for found in (mapped(x, weights), interpreted):
        np.testing.assert_array_equal(found, expected)
    if dtype == np.float64:
        np.testing.assert_array_equal(
            jax.vmap(jnp.convolve, (0, None))(x, jnp.asarray(weights)), expected
        )


def test_top_k_is_in_the_total_order_of_floats():
    """-0.0 below 0.0, NaN beyond all on the side of its sign, ties in their order."""
    x = np.array([[-0.0, 0.0, -1.0], [np.nan, -np.nan, 1.0], [-np.nan, np.inf, np.nan], [2, 2, -3]])
    found = Mapped(lambda case, shared: lax.top_k(case, 3), x[0], 0.0)(x, 0.0)
    for ours, xla in zip(found, lax.top_k(x, 3), strict=True):
        np.testing.assert_array_equal(ours, xla)
    np.testing.assert_array_equal(found[1], [[1, 0, 2], [0, 2, 1], [2, 1, 0], [0, 1, 2]])
