"""Whole numbers of 64 bits in programs that only count with them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.compiler.interpreter import interpret
from jaxsat.compiler.ir import Loop, Value
from jaxsat.compiler.passes.holders import functions_of, steps_in
from jaxsat.compiler.passes.narrowing import NARROW, WIDE, Ports, narrow
from jaxsat.compiler.scalar_program import scalar_program

LEGS = jnp.array([3, 1, 4, 1, 5, 9, 2, 6])


def counts(n, x):
    """A counter that begins anew."""
    return jnp.where(x > 0.5, 0, n + 1)


def chooses(n, x):
    """A mode, by tables, extrema, branches and a loop."""
    chosen = LEGS[jnp.clip(n, 0, 7)] + 40
    most = jax.lax.cond(x > 0.3, lambda: jnp.maximum(chosen, n), lambda: -n)
    loop = jax.lax.fori_loop(0, 40, lambda i, m: jnp.where(m > i, m - 1, m), most)
    return jnp.minimum(loop, jnp.where(n == 3, 7, 50)) % 11


def divides(n, x):
    """Quotients, remainders and a shift, of a count by a count, rounded down."""
    parts = n // 3 + jnp.where(x > 0.4, n % jnp.where(n > 5, n, 4), n // jnp.maximum(n, -3))
    return jnp.where(x > 0.9, n + 1, (parts >> 2) % 7)


def votes(n, x):
    """A count of what holds, and of signs."""
    return jnp.where(x > 1.0, 0, n + (x > 0.3)) - jnp.where(x < 0.0, jnp.sign(n), 0)


def searches(n, x):
    """The index of a least number, which the interpreter does not know."""
    return jnp.argmin(jnp.abs(jnp.arange(6) * 0.2 - x)) + jnp.where(n == 3, 0, 1)


def multiplies(n, x):
    """A generator of random numbers."""
    return jnp.where(x > 0, n * 1103 + 12345, n)


def adds_much(n, x):
    """Microseconds since the begin."""
    return jnp.where(x > 0, n + 100_000, n)


def doubles(n, x):
    """Growth by itself."""
    return jnp.where(x > 0, n + n, n)


def rounds(n, x):
    """A float of any size."""
    return jnp.where(n > 3, jnp.round(1e12 * x).astype(int), n)


def is_large(n, x):
    """A limit beyond 32 bits."""
    return jnp.where(n + 1 > 2**40, 0, jnp.where(x > 0, n, n + 1))


def shifts_far(n, x):
    """A shift by more places than 32 bits have."""
    return jnp.where(x > 0, n + 1, n >> 40)


def adds_sums(n, x):
    """More than one a call."""
    return n + jnp.where(x > 0, n % 5, 2)


def reads_bits(n, x):
    """The bits of a float."""
    return n + (jax.lax.bitcast_convert_type(x, jnp.int64) >> 62)


def adds_large(n, x):
    """A sum that feeds nothing, of a constant that 32 bits hold."""
    return n + 2_000_000_000


def widens(n, x):
    """A sum of numbers that were made longer for it."""
    count = jnp.where(x > 0, 2_000_000_000, -5).astype(jnp.int32)
    return n + jnp.where(count.astype(jnp.int64) + count.astype(jnp.int64) > 0, 1, 0)


def program(function, number=2):
    """The scalar program of a function, and its ports: the number comes back at the next call."""
    example = scalar_program("step", function, (jnp.array(number), jnp.array(0.25)))
    return example.function, Ports(example.function, ["state", None], ["state"])


def kinds(function):
    """Types of all whole numbers of a program and of the functions that it calls."""
    values = [
        x
        for one in functions_of(function)
        for step in steps_in(one.block)
        for x in (getattr(step, "out", None), *getattr(step, "outs", ()))
        if isinstance(x, Value)
    ]
    return {x.dtype for x in values if x.dtype.kind == "i"}


@pytest.mark.parametrize("function", [counts, chooses, divides, votes])
def test_what_only_counts_and_chooses_has_32_bits_and_the_same_results(function):
    scalar, ports = program(function)
    assert WIDE in kinds(scalar)
    assert narrow([ports]) == {"state"}
    assert kinds(scalar) <= {NARROW}
    assert any(isinstance(step, Loop) for step in steps_in(scalar.block)) == (function is chooses)
    assert scalar.params[0].dtype == NARROW
    rng, compiled = np.random.default_rng(1), jax.jit(function)
    for n, x in zip(rng.integers(-4, 12, 60), rng.uniform(-0.2, 1.2, 60), strict=True):
        (result,) = interpret(scalar, [np.int32(n), np.float64(x)])
        assert result.dtype == NARROW
        assert result == compiled(n, x)


@pytest.mark.parametrize(
    "function",
    [
        multiplies,
        adds_much,
        adds_large,
        adds_sums,
        doubles,
        rounds,
        is_large,
        shifts_far,
        reads_bits,
    ],
)
def test_what_can_leave_32_bits_keeps_64(function):
    scalar, ports = program(function)
    assert narrow([ports]) == set()
    assert scalar.params[0].dtype == WIDE


def test_what_the_program_makes_longer_stays_so():
    scalar, ports = program(widens)
    narrow([ports])
    assert WIDE in kinds(scalar)
    results = [interpret(scalar, [np.int32(1), np.float64(x)])[0] for x in (0.5, -0.5)]
    assert results == [2, 1]


def test_floats_have_no_part_in_it():
    _, ports = program(lambda n, x: jnp.where(jnp.inf - x > 0, n + 1, n))
    assert narrow([ports]) == {"state"}


def test_an_index_has_32_bits():
    scalar, ports = program(searches)
    assert narrow([ports]) == {"state"}
    found = {x.dtype for one in functions_of(scalar) for x in one.results}
    assert len(functions_of(scalar)) == 2
    assert found == {NARROW}


def test_a_large_sum_that_does_not_come_back_may_be_short():
    scalar, _ = program(adds_much)
    assert narrow([Ports(scalar, ["state", None], ["output"])]) == {"state", "output"}


def test_a_number_that_must_be_long_keeps_those_it_meets_long():
    scalar, ports = program(counts)
    assert narrow([ports], ["state"]) == set()
    assert scalar.params[0].dtype == WIDE


def test_programs_that_share_a_number_agree_on_its_type():
    (first, ports), (second, others) = program(counts), program(rounds)
    assert narrow([ports, others]) == set()
    assert first.params[0].dtype == second.params[0].dtype == WIDE
