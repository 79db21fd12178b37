"""Loops, branches and derivatives against XLA: no lane changes another."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from compiler.rule_checks import CASES, check, numbers
from jaxsat.compiler import Mapped


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
