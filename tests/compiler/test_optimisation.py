"""Dead carries of loops, quotients that do not change in a loop, chains of extrema."""

import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxsat.compiler import Mapped
from jaxsat.compiler.ir import Block, BlockSwitch, Loop, Operation, definitions, uses
from jaxsat.compiler.llvm.target import host

CASES = np.linspace(0.1, 2.0, 24)


def _optimised(function, example=0.0):
    """A function that gives the same as its interpreter and as Python, and its block."""
    mapped = Mapped(function, example)
    found = mapped(CASES)
    np.testing.assert_allclose(found, mapped.interpreted(CASES), rtol=1e-13)
    np.testing.assert_allclose(found[5], function(CASES[5], None), rtol=1e-13)
    return mapped.entry_point.function.block


def _loops(block: Block) -> list[Loop]:
    found = []
    for step in block.steps:
        match step:
            case Loop(condition=condition, body=body):
                found += [step, *_loops(condition), *_loops(body)]
            case BlockSwitch(blocks=blocks):
                found += [loop for inside in blocks for loop in _loops(inside)]
            case _:
                pass
    return found


def _names(block: Block) -> list[str]:
    """Of all operations of a block and of those inside."""
    names = []
    for step in block.steps:
        match step:
            case Operation(name=name):
                names.append(name)
            case BlockSwitch(blocks=blocks):
                names += [name for inside in blocks for name in _names(inside)]
            case Loop(condition=condition, body=body):
                names += [*_names(condition), *_names(body)]
            case _:
                pass
    return names


def test_a_carry_on_which_only_itself_depends_is_gone_from_all_loops():
    def function(x, shared):
        del shared

        def inner(_, carry):
            y, unused = carry
            return y * 0.9 + x, unused + jnp.sqrt(y)

        def outer(_, carry):
            y, unused, other = carry
            y, unused = lax.fori_loop(0, 90, inner, (y, unused))
            return y, unused, other * unused

        return lax.fori_loop(0, 4, outer, (x, x, x))[0]

    outer, inner = _loops(_optimised(function))
    for loop in (outer, inner):
        assert len(loop.params) == len(loop.before) == len(loop.after) == 2  # the counter and y
        assert "sqrt" not in _names(loop.body)


def test_what_ends_a_loop_or_chooses_in_it_stays():
    def function(x, shared):
        del shared

        def step(carry):
            left, switch, y = carry
            y = lax.cond(switch > 0, lambda: jnp.exp(y) - y**3, lambda: y + jnp.sin(y))
            return left - x, -switch, y

        return lax.while_loop(lambda carry: carry[0] > 0, step, (9.0, 1.0, 0.5 * x))[2]

    (loop,) = _loops(_optimised(function))
    assert len(loop.params) == 3


def test_what_a_memory_needs_stays():
    def function(x, shared):
        del shared

        def step(carry, _):
            y, z = carry
            return (y * 0.5 + x, z + 1.0), y

        rows = lax.scan(step, (x, x), length=40)[1]
        return rows[(10 * x).astype(jnp.int32)]

    (loop,) = _loops(_optimised(function))
    assert len(loop.params) == 2  # the number of the row and y


def test_quotients_that_are_alike_in_every_round_are_before_the_loops():
    def function(x, shared):
        del shared

        def inner(_, y):
            return lax.cond(y > 0.3, lambda: y / jnp.sqrt(x + 2.0), lambda: y + 1.0 / y)

        def outer(_, y):
            return lax.fori_loop(0, 90, inner, y) + x * x

        return lax.fori_loop(0, 4, outer, x)

    block = _optimised(function)
    outside = [step.name for step in block.steps if isinstance(step, Operation)]
    assert outside.count("sqrt") == 1
    assert "mul" not in outside  # which is cheaper than a value kept through the loop
    for loop in _loops(block):
        assert "sqrt" not in _names(loop.body)
        assert _names(loop.body).count("div") == 2  # y is another one each time


def test_the_least_of_many_is_found_in_pairs():
    block = _optimised(lambda x, shared: jnp.min(jnp.cos(x * jnp.arange(1.0, 9.0))))
    depths: dict[int, int] = {}
    for step in block.steps:
        deepest = max((depths.get(number, 0) for number in uses(step)), default=0)
        extremum = isinstance(step, Operation) and step.name == "min"
        depths.update((out.number, deepest + extremum) for out in definitions(step))
    assert max(depths.values()) == 3


def test_the_least_of_two_equal_ones_is_either():
    assert not _optimised(lambda x, shared: jnp.minimum(x, jnp.maximum(x, x))).steps


@pytest.mark.skipif(host().register != 64, reason="this processor has no AVX-512")
def test_extrema_are_one_instruction_and_a_look_for_nan():
    mapped = Mapped(lambda xs, shared: lax.max(xs[0], xs[1]) - lax.min(xs[0], xs[1]), (0.0, 0.0))
    assert mapped.assembly().count("vrangepd") == 2
    numbers = np.array([0.0, -0.0, 1.0, -np.inf, np.inf, np.nan, 5e-324])
    pairs = tuple(x.ravel() for x in np.meshgrid(numbers, numbers))
    found, expected = mapped(pairs), mapped.interpreted(pairs)
    np.testing.assert_array_equal(found, expected)
    whole = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(found[whole]), np.signbit(expected[whole]))


def test_a_short_function_is_called_in_code_of_one_lane_and_written_out_in_that_of_vectors():
    """With the same bits: which products are fused does not depend on it."""
    one, several = (Mapped(lambda x, shared: x * jnp.tanh(x) + 0.1, 0.0, lanes=n) for n in (1, 8))
    calls = [
        [line for line in mapped.assembly().splitlines() if "call" in line and "tanh" in line]
        for mapped in (one, several)
    ]
    assert list(map(len, calls)) == [1, 0]
    np.testing.assert_array_equal(one(CASES), several(CASES))
