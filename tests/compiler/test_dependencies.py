"""Which inputs results need, against what changes when an input of the interpreter changes."""

import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxsat.compiler import ir
from jaxsat.compiler.interpreter import interpret
from jaxsat.compiler.llvm.mapped import Mapped
from jaxsat.compiler.passes.dead_code import dependencies, reachable


def inputs_of_results(function: ir.Function) -> list[set[int]]:
    """The places of the parameters that each result of a function may need."""
    needs = dependencies(function.block)
    places = {param.number: place for place, param in enumerate(function.params)}
    live = [reachable(needs, ir.numbers_of([result])) for result in function.results]
    return [{places[number] for number in some & places.keys()} for some in live]


CASES = np.random.default_rng(3).uniform(0.5, 2.0, (16, 5))


def arithmetic(x):
    """One input each, none, and two."""
    return x[0] * 2, x[1] - x[1] * 0 + x[3], jnp.array(1.0)


def loop(x):
    """What a loop hands on turn by turn: a needs b, b needs c, c only itself; x4 counts."""
    a, b, c, _ = lax.while_loop(
        lambda at: at[3] < 4.0,
        lambda at: (at[1] + 1, at[2] * 2, at[2] + 1, at[3] + x[4]),
        (x[0], x[1], x[2], jnp.zeros(())),
    )
    return a, b, c, x[3]


def nest(x):
    """A loop in a loop: a and b change places and take c, which takes x3 after the inner loop."""

    def inner(at):
        return at[0] + 1, at[2], at[1] + at[3], at[3]

    def outer(at):
        n, a, b, c, d = at
        _, a, b, c = lax.while_loop(lambda at: at[0] < 2, inner, (0, a, b, c))
        return n + 1, a, b, c + x[3], d * 2

    return lax.while_loop(lambda at: at[0] < 3, outer, (0, x[0], x[1], x[2], x[4]))[1:]


def switch(x):
    """The branch taken depends on x0, what it gives on others."""
    return lax.cond(x[0] > 1.0, lambda: (x[1], x[2]), lambda: (x[3], x[2] * 1.5))


def memory(x):
    """An array written at a place that x0 tells, with x1, and read elsewhere."""
    written = x.at[(x[0] * 2).astype(int)].set(x[1])
    return written[(x[2] * 2).astype(int)], x[4]


@pytest.mark.parametrize("function", [arithmetic, loop, nest, switch, memory])
def test_a_result_changes_only_with_the_inputs_that_it_needs(function):
    entry = Mapped(lambda x, shared: function(x), CASES[0], None).entry_point
    needs = inputs_of_results(entry.function)
    inputs = [CASES[:, entry.inputs[i].element] for i in range(len(entry.inputs))]
    before = interpret(entry.function, inputs)
    changing = [set() for _ in before]
    for number in range(len(inputs)):
        for change in (0.25, -0.3, 0.6):
            changed = [x + change * (i == number) for i, x in enumerate(inputs)]
            after = interpret(entry.function, changed)
            for changes, x, y in zip(changing, before, after, strict=True):
                if not np.array_equal(x, y):
                    changes.add(number)
    assert all(changes <= needed for changes, needed in zip(changing, needs, strict=True))


@pytest.mark.parametrize(
    ("function", "least"),
    [
        (loop, [{0, 1, 2, 4}, {1, 2, 4}, {2, 4}, {3}]),
        (nest, [{0, 1, 2, 3}, {0, 1, 2, 3}, {2, 3}, {4}]),
    ],
)
def test_the_needs_of_a_loop_are_no_larger_than_they_must_be(function, least):
    entry = Mapped(lambda x, shared: function(x), CASES[0], None).entry_point
    elements = [location.element for location in entry.inputs]
    needs = [{elements[i] for i in some} for some in inputs_of_results(entry.function)]
    assert needs == least
