"""The order of steps, and cold switches put together: what the machine code is definitions from."""

from itertools import pairwise

import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxsat.compiler import Mapped
from jaxsat.compiler.ir import BlockSwitch, Loop, Operation, Value, definitions, uses

CASES = np.linspace(0.1, 2.0, 24)


def _steps(function, example=0.0):
    return Mapped(function, example).entry_point.function.block.steps


def _switches(function, example=0.0):
    return [step for step in _steps(function, example) if isinstance(step, BlockSwitch)]


def _comes_after_what_it_reads(steps, known):
    for step in steps:
        assert set(uses(step)) <= known
        if isinstance(step, Loop):
            inner = known | {param.number for param in step.params}
            _comes_after_what_it_reads(step.condition.steps, set(inner))
            tested = inner | {out.number for s in step.condition.steps for out in definitions(s)}
            _comes_after_what_it_reads(step.body.steps, tested)
        known |= {out.number for out in definitions(step)}


def _law(x, shared):
    """Chains, a loop, branches, memory and trigonometry."""
    del shared
    y = jnp.stack([x, x**2, jnp.sin(x)])

    def body(i, y):
        return y.at[i % 3].add(jnp.cos(y[(i + 1) % 3]) / (1 + y[0] ** 2))

    y = lax.fori_loop(0, 40, body, y)
    return jnp.tanh(y), lax.cond(x > 1, jnp.exp, jnp.log, x) + jnp.sum(y)


def test_steps_come_after_what_they_read_and_give_the_same():
    mapped = Mapped(_law, 0.0)
    known = {param.number for param in mapped.entry_point.function.params}
    _comes_after_what_it_reads(mapped.entry_point.function.block.steps, known)
    found = mapped(CASES)
    for x, y in zip(found, mapped.interpreted(CASES), strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-12)
    np.testing.assert_allclose(found[1][3], _law(CASES[3], None)[1], rtol=1e-12)


def test_the_longest_chain_begins_and_others_fill_its_gaps():
    def function(x, shared):
        short = x * 3.0
        long = x
        for number in range(6):
            long = (long + number) * x
        return short, long

    steps = [step for step in _steps(function) if isinstance(step, Operation)]
    constants = [[float(a) for a in s.args if not isinstance(a, Value)] for s in steps]
    at = constants.index([3.0])
    assert 0 < at < len(steps) - 1  # it was traced first, and nothing waits for it


def test_a_product_stands_before_the_sum_that_takes_it_in():
    def function(x, shared):
        return sum(jnp.sqrt(x + number) * x + number for number in range(5))

    steps = _steps(function)
    for before, step in pairwise(steps):
        if isinstance(before, Operation) and before.name == "mul":
            assert before.out in step.args


@pytest.mark.parametrize(
    ("function", "count"),
    [
        (lambda x, shared: jnp.sin(x) + jnp.cos(2 * x) * jnp.sin(3 * x), 1),
        (lambda x, shared: jnp.sin(jnp.sin(x)) + jnp.cos(x), 2),
        (lambda x, shared: jnp.sin(x * jnp.arange(1.0, 4.0))[0], 1),
        (lambda x, shared: x + 1, 0),
    ],
)
def test_cold_branches_that_need_not_wait_are_one(function, count):
    switches = _switches(function)
    assert len(switches) == count
    assert all(switch.cold for switch in switches)
    wide = CASES * 10.0 ** np.arange(24)  # some need the long way
    mapped = Mapped(function, 0.0)
    np.testing.assert_allclose(mapped(wide), mapped.interpreted(wide), rtol=1e-12, atol=1e-15)


def test_an_unused_sine_leaves_nothing():
    (switch,) = _switches(lambda x, shared: jnp.sin(x * jnp.arange(1.0, 4.0))[1])
    assert len(switch.outs) == 1
    assert len(_steps(lambda x, shared: jnp.sin(x * jnp.arange(1.0, 4.0))[1])) == len(
        _steps(lambda x, shared: jnp.sin(x * 2.0))
    )
