"""Every rule against XLA, with varying and uniform inputs, NaN and infinity among them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from engine.examples import EXAMPLES, KICKS, program
from jaxsat.engine import FixedStepper
from jaxsat.engine.native import CannotLower, Mapped, native_obstacle
from jaxsat.engine.native.ir import NativeBug
from jaxsat.engine.native.lowering import RULES

CASES = 37
"""No multiple of any vector's length."""

SPECIAL = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e300, -1e-300, 1.0])
"""No subnormal numbers: XLA takes them as zero, machine code does not."""


def numbers(*shape, dtype=float, seed=0):
    rng = np.random.default_rng(seed)
    if np.dtype(dtype).kind == "f":
        x = rng.normal(size=(CASES, *shape))
        x.flat[:: max(1, x.size // 16)] = np.resize(SPECIAL, x.flat[:: max(1, x.size // 16)].shape)
        with np.errstate(over="ignore"):
            return x.astype(dtype)
    if np.dtype(dtype).kind == "b":
        return rng.random((CASES, *shape)) < 0.5
    return rng.integers(-9 if np.dtype(dtype).kind == "i" else 0, 9, (CASES, *shape), dtype)


def check(function, cases, shared=None, tolerance=1e-15, lanes=0):
    """Machine code and interpreter against `jax.jit(jax.vmap(...))`, in types and numbers."""
    case = jax.tree.map(lambda x: x[0], cases)
    mapped = Mapped(function, case, shared, lanes)
    expected = jax.jit(jax.vmap(lambda case: function(case, shared)))(cases)
    with np.errstate(all="ignore"):
        found = mapped(cases, shared), mapped.interpreted(cases, shared)
    for outputs in found:
        for x, y in zip(jax.tree.leaves(outputs), jax.tree.leaves(expected), strict=True):
            assert x.dtype == y.dtype
            rtol = tolerance if x.dtype.kind == "f" else 0
            rtol = max(rtol, 2e-7) if x.dtype == np.float32 and tolerance else rtol
            np.testing.assert_allclose(x, y, rtol=rtol, atol=0)


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


def test_loops_whose_lanes_end_at_different_times():
    def function(case, shared):
        x, n = case
        collatz = lax.while_loop(
            lambda c: c[0] > 1,
            lambda c: (jnp.where(c[0] % 2 == 0, c[0] // 2, 3 * c[0] + 1), c[1] + 1, c[2]),
            (jnp.abs(n) + 1, 0, x),
        )
        uniform = lax.fori_loop(0, shared, lambda i, y: 0.5 * y + i, x)
        inner = lax.while_loop(
            lambda c: c[0] < n,
            lambda c: (c[0] + 1, c[1] + lax.fori_loop(0, c[0], lambda _, z: z + 1.0, 0.0)),
            (0, 0.0),
        )
        return collatz, uniform, inner

    check(function, (numbers(), numbers(dtype=np.int64)), 5)


@pytest.mark.parametrize("length", [1, 3, 50])
def test_scans_with_stacked_outputs(length):
    def function(case, shared):
        def step(carry, row):
            carry = carry * 0.9 + row.sum()
            return carry, (carry, row[::-1], carry > 0)

        rows = shared + jnp.arange(2.0 * length).reshape(length, 2)
        forwards = lax.scan(step, case, rows)
        return forwards, lax.scan(step, case, rows, reverse=True)

    check(function, numbers(), 0.3, tolerance=1e-13)


def test_branches():
    def function(case, shared):
        x, i = case
        several = [lambda v: v + 1, jnp.cos, lambda v: lax.fori_loop(0, 9, lambda _, z: z / 2, v)]
        by_case = lax.switch(i, several, x), lax.cond(x > 0, jnp.log, jnp.exp, x)
        for_all = lax.switch(shared, several, x), lax.cond(shared > 0, jnp.sin, jnp.tan, x)
        return by_case, for_all

    check(function, (numbers(), numbers(dtype=np.int32)), np.int32(2), tolerance=1e-14)


def test_a_lane_outside_a_branch_does_not_keep_its_loop_alive():
    def function(case, shared):
        halved = lambda x: lax.while_loop(lambda y: y > 1, lambda y: y / 2, x)  # noqa: E731
        return lax.cond(jnp.isfinite(case), halved, lambda x: jnp.zeros_like(x), case)

    cases = numbers()  # XLA's loop over a batch would never end for infinity
    finite = np.nan_to_num(cases, nan=0.0, posinf=0.0, neginf=0.0)
    expected = np.where(finite > 1, finite / 2.0 ** np.ceil(np.log2(np.maximum(finite, 1))), finite)
    mapped = Mapped(function, cases[0])
    np.testing.assert_array_equal(mapped(cases), expected)
    np.testing.assert_array_equal(mapped.interpreted(cases), expected)


def test_derivatives_and_custom_rules():
    @jax.custom_jvp
    def bent(x):
        return jnp.abs(x)

    bent.defjvp(lambda primals, tangents: (bent(*primals), 3.0 * tangents[0]))

    def function(case, shared):
        f = lambda x: bent(jnp.sin(x) * shared) + jax.jit(jnp.tanh)(x)  # noqa: E731
        return jax.jvp(f, (case,), (jnp.ones_like(case),)), jax.jacfwd(jax.checkpoint(f))(case)

    finite = np.nan_to_num(numbers(), posinf=1.0, neginf=-1.0)
    check(function, np.clip(finite, -9, 9), 0.7, tolerance=1e-14)


def test_random_bits_are_those_of_jax():
    from jaxsat import noise

    def function(case, shared):
        key = noise.fold_in(jnp.asarray(shared), jnp.asarray(case))
        return noise.bits(key, 4), noise.uniform(key, 3), noise.standard_normal(key, 5)

    check(function, np.arange(CASES), np.array([1, 2], np.uint32), tolerance=1e-13)


@pytest.mark.parametrize("lanes", [2, 8])
def test_a_lane_that_is_no_number_changes_no_other(lanes):
    def function(case, shared):
        grown = lax.while_loop(lambda y: jnp.abs(y) < 9, lambda y: 2 * y + 0.1, case)
        return grown, jnp.sort(jnp.stack([case, grown, shared]))

    clean = np.linspace(0.1, 3, CASES)
    dirty = np.where(np.arange(CASES) % 8 == 3, np.nan, clean)
    mapped = Mapped(function, clean[0], 1.0, lanes)
    for x, y in zip(mapped(clean, 1.0), mapped(dirty, 1.0), strict=True):
        np.testing.assert_array_equal(x[dirty == clean], y[dirty == clean])


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


def test_what_cannot_be_lowered_is_named_with_its_place():
    def function(case, shared):
        return jnp.linalg.eigvalsh(jnp.outer(case, case))

    with pytest.raises(CannotLower, match=r"eigh.*test_rules\.py"):
        Mapped(function, np.ones(3))


@pytest.fixture
def broken_rules(monkeypatch):
    def broken(b, eqn, *arrays):
        raise IndexError("beyond the end")

    for name in ("sin", "mul"):
        monkeypatch.setitem(RULES, name, broken)


@pytest.mark.usefixtures("broken_rules")
def test_a_rule_that_breaks_down_is_told_as_a_bug():
    with pytest.raises(NativeBug, match=r"`sin`.*test_rules\.py.*beyond the end.*bug in jaxsat"):
        Mapped(lambda x, _: jnp.where(x > 0, jax.jit(lambda y: jnp.sin(y))(x), x), 0.5)


@pytest.mark.usefixtures("broken_rules")
def test_a_rule_that_breaks_down_is_no_obstacle_to_fall_back_for():
    """Engine `auto` asks for the obstacle, and takes another engine where there is one."""
    one = EXAMPLES["corners"]()
    # steps that no other test has made a kernel for
    stepper = FixedStepper(one.scan.stepper.solver, 1237)
    with pytest.raises(NativeBug):
        native_obstacle(stepper, program(one), KICKS)


@pytest.mark.parametrize("part", ["merge_cold_branches", "schedule", "parameter_locations"])
def test_what_goes_wrong_after_the_rules_is_told_as_a_bug(monkeypatch, part):
    """A `ValueError` above all, which a command would take for the user's mistake."""

    def broken(*_):
        raise ValueError("no such block")

    monkeypatch.setattr(f"jaxsat.engine.native.entry_points.{part}", broken)
    with pytest.raises(NativeBug, match=r"no such block.*bug in jaxsat"):
        _ = Mapped(lambda x, _: 2 * x, 0.5).text


@pytest.mark.parametrize("error", [NativeBug("a rule", "what"), RuntimeError("of LLVM")])
def test_only_what_has_no_rule_is_an_obstacle(monkeypatch, error):
    one = EXAMPLES["corners"]()
    arguments = FixedStepper(one.scan.stepper.solver), program(one), KICKS

    def failing(error):
        def fail(*_):
            raise error

        monkeypatch.setattr("jaxsat.engine.native.engine._kernel", fail)

    failing(CannotLower("No rule"))
    assert "No rule" in native_obstacle(*arguments)
    failing(error)
    with pytest.raises(type(error)):
        native_obstacle(*arguments)
    with jax.enable_x64(False):
        assert "must have 64-bit numbers" in native_obstacle(*arguments)


def test_top_k_is_in_the_total_order_of_floats():
    """-0.0 below 0.0, NaN beyond all on the side of its sign, ties in their order."""
    x = np.array([[-0.0, 0.0, -1.0], [np.nan, -np.nan, 1.0], [-np.nan, np.inf, np.nan], [2, 2, -3]])
    found = Mapped(lambda case, shared: lax.top_k(case, 3), x[0], 0.0)(x, 0.0)
    for ours, xla in zip(found, lax.top_k(x, 3), strict=True):
        np.testing.assert_array_equal(ours, xla)
    np.testing.assert_array_equal(found[1], [[1, 0, 2], [0, 2, 1], [2, 1, 0], [0, 1, 2]])
