"""The operation that makes a NaN, in functions of which it is known."""

import inspect
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

from jaxsat.core.solvers import NamedSolver, Solver
from jaxsat.simulation.engine.nan_origin import nan_in_run, nan_origins
from jaxsat.simulation.engine.program import program_of
from jaxsat.simulation.engine.stepper import AbstractStepper
from simulation.engine.examples import Kicked, continuous_example

X = jnp.array([0.0, 1.0])


def slope(function):
    return lambda x: jax.jvp(function, (x,), (jnp.ones_like(x),))[1]


def hidden_root(x):
    return jnp.where(x > 0, jnp.sqrt(x), 0.0)  # zero times infinity, in forward mode chosen away


def spoilt(x):
    return 0.0 * jnp.sqrt(x)


def in_a_loop(x):
    def step(carry, number):
        return carry - 1.0, jnp.log(carry) * number

    return jax.lax.scan(step, x, jnp.arange(3.0))[1]  # of 2, 1, 0 and of -1, which is none


def in_a_while(x):
    return jax.lax.while_loop(lambda x: jnp.all(x > -3), lambda x: jnp.sqrt(x) - 3, x)


def in_a_branch(x):
    return jax.lax.cond(jnp.sum(x) > 0, lambda x: x / x, lambda x: x, x)


@jax.jit
def called(x):
    return jnp.inf - x / 0.0


@pytest.mark.parametrize(
    ("function", "x", "operation", "source"),
    [
        (slope(spoilt), X, "mul", spoilt),
        (in_a_loop, jnp.array(1.0), "log", in_a_loop),
        (in_a_while, jnp.array(-1.0), "sqrt", in_a_while),
        (in_a_branch, X, "div", in_a_branch),
        (called, X, "div", called.__wrapped__),
        (lambda x: jnp.sin(jnp.sqrt(-1 - x)) + 1, X, "sqrt", None),
    ],
)
def test_the_operation_and_its_line_are_found(function, x, operation, source):
    origin = nan_origins(function, x)
    assert origin.operation == operation
    assert origin.place[-1].file == __file__
    if source is not None:
        lines, first = inspect.getsourcelines(source)
        assert first <= origin.place[-1].line < first + len(lines)


def test_what_is_no_nan_or_is_not_chosen_has_no_origin():
    assert nan_origins(hidden_root, X) is None
    assert nan_origins(lambda x: jnp.where(x > 5, jnp.nan, x), X) is None
    assert nan_origins(lambda x: (x.astype(int), 1 / x), X) == (None, None)


def test_a_nan_that_is_given_is_told_by_the_number_of_its_argument():
    given = {"a": jnp.array(1.0), "b": jnp.array([jnp.nan, 2.0])}
    one, two = nan_origins(lambda tree: (2 * tree["a"], tree["b"] ** 2), given)
    assert one is None
    assert two.argument == 1


def test_of_two_the_one_that_is_chosen_counts():
    def chosen(x):
        return jnp.where(x < 1, jnp.log(x - 1), jnp.sqrt(x - 2))

    for x, operation in ((0.5, "log"), (1.5, "sqrt")):
        assert nan_origins(chosen, jnp.array(x)).operation == operation


def test_the_pass_of_the_outermost_loop_is_told():
    def loops(x):
        return jax.lax.fori_loop(0, 4, lambda i, x: jnp.sum(in_a_loop(x)) - i, x)

    assert nan_origins(in_a_loop, jnp.array(0.5)).step == 1
    assert nan_origins(in_a_while, jnp.array(5.0)).step == 1
    assert nan_origins(loops, jnp.array(3.5)).step == 1  # ln 2.5 + 2 ln 1.5 = 1.7 < 2


class Gain(Kicked):
    """A case that draws the gain."""

    def __call__(self, case, gains):
        return super().__call__(case, None)._replace(drawn={"gain": gains})


class Falling(AbstractStepper):
    """A number, the gain, falls by 1 in each interval.

    In one `phase` its derivative becomes NaN where the number is not positive.
    """

    phase: str = eqx.field(static=True)
    solver: Solver = NamedSolver("tsit5")

    def spoilt(self, x, phase):
        return x + 0.0 * jnp.sqrt(jnp.maximum(x, 0.0)) if phase == self.phase else x

    def identity(self):
        return {}

    def begin(self, program, case):
        return self.spoilt(case.drawn["gain"] - 3.0, "begin") + 3.0

    def advance(self, program, case, progress, first, count, axis_name=None):
        return self.spoilt(progress - 1.0, "advance")

    def finish(self, program, case, progress, number):
        return SimpleNamespace(cost=self.spoilt(progress, "finish"))

    def signals(self, program, case, progress, number):
        raise NotImplementedError


@pytest.fixture(scope="module")
def falling():
    """The origin of the NaN of a phase in five intervals of 2 s."""
    example = continuous_example()
    factory = Gain(example.case_factory.loop, example.case_factory.start)
    program = program_of(factory, factory.loop, 10.0, 2.0)
    gain = jnp.array(3.0)
    return lambda phase: nan_in_run(Falling(phase), program, jnp.zeros(3), gain, gain)


@pytest.mark.parametrize(("phase", "time"), [("begin", 0.0), ("advance", 4.0), ("finish", 10.0)])
def test_the_time_is_that_of_the_interval_in_which_the_nan_begins(falling, phase, time):
    found = falling(phase)
    assert (found.time, found.origin.operation) == (time, "mul")
    assert found.origin.place[-1].function == "Falling.spoilt"


def test_a_run_without_a_nan_has_no_origin(falling):
    assert falling("none") is None
