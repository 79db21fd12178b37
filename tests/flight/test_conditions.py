"""Conditions that cannot hold, or always do, are no part of exported C."""

import re
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest
from jaxtyping import Array, Float

from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.checks import as_float
from jaxsat.flight.program import flight_program
from jaxsat.flight.source import source
from tests.flight.laws import Filtered, loop_of, start


class _Law(AbstractSampledController):
    """A law whose command is a function of rates."""

    function: object = eqx.field(static=True)
    period: Float[Array, ""] = eqx.field(converter=as_float, default=0.5)

    def init(self, state):
        """Nothing."""
        return jnp.zeros_like(state.omega[0])

    def step(self, t, state, memory):
        """What the function gives."""
        return self.function(state.omega), memory


def _text(law) -> str:
    return source(flight_program(loop_of(law), start()), [], libm=False)


def _opposites(omega):
    spins = omega[2] > 0.25
    return jnp.where(spins | ~spins, omega[:2], 7.5)


def _chosen_again(omega):
    spins = omega[2] > 0.25
    return jnp.where(spins, jnp.where(spins, omega[:2], 7.5), 2.0)


def _phases(omega):
    """The phase begins at 1 and never becomes less, so that it is never 0."""

    def turn(carry):
        number, phase, x = carry
        x = jnp.where(phase == 0, 7.5, x / 2)
        return number + 1, jnp.where(x[0] < 0.25, phase + 1, phase), x

    def goes_on(carry):
        return (carry[0] < 9) & (carry[1] < 4)

    return jax.lax.while_loop(goes_on, turn, (0, 1, omega[:2]))[2]


def _shifted(omega):
    bits = jax.lax.bitcast_convert_type(omega[:2], jnp.int64)
    return (bits << (bits & 63)).astype(omega.dtype) * 7.5


def _in_turn(omega):
    """Two rows are written in turn."""

    def turn(carry, _):
        number, rows = carry
        return (number + 1, rows.at[number % 2].set(0.5 * rows[0] + omega)), None

    rows = jax.lax.scan(turn, (0, jnp.zeros((2, 3))), None, length=4)[0][1]
    return jnp.sum(rows, axis=0)[:2]


def _from_zero(omega):
    """The larger of a number and 0 is not less than 0, in a wider type either."""
    number = jnp.maximum(jax.lax.convert_element_type(omega[2], jnp.int32), 0)
    return jnp.where(number.astype(jnp.int64) < 0, 7.5, omega[:2] * number)


def _narrow(omega):
    """A number of 32 bits is less than 2^40."""
    number = jax.lax.convert_element_type(omega[2], jnp.int32).astype(jnp.int64)
    return jnp.where(number > 2**40, 7.5, omega[:2] * number)


def _divided(omega):
    """What a division needs where it is not chosen is never evaluated."""
    spins = omega[2] > 0.25
    quotient = jnp.where(spins, omega[0] / jnp.where(spins, omega[2], 7.5), 2.0)
    root = jnp.where(spins, 2.0, jnp.sqrt(jnp.where(spins, 7.5, omega[1])))
    return jnp.stack([quotient, root])


def _remainder(omega):
    """The remainder of any number is a place in an array."""
    number = jax.lax.convert_element_type(omega[2], jnp.int32)
    place = jnp.mod(number, 4)
    row = jnp.where(place > 3, 7.5, jnp.arange(1.0, 5.0)[place])
    return jnp.where(place < 0, 7.5, omega[:2] * row)


def _looked_up(omega):
    """A number that was limited before it became whole is a place in a table."""
    place = jnp.clip(jnp.nan_to_num(100 * omega[2]), 0.0, 3.0).astype(jnp.int32)
    row = jnp.where(place > 3, 7.5, jnp.arange(1.0, 5.0)[place])
    return jnp.where(place < 0, 7.5, omega[:2] * row)


def _largest(omega):
    """The place of the largest one so far is that of one of them."""

    def larger(i, carry):
        best, x = carry
        x = jnp.where(i > 8, 7.5, jnp.sin(x) + omega[i % 3])
        return jnp.where(jnp.abs(x[0]) > 0.25, i, best), x

    best, x = jax.lax.fori_loop(0, 9, larger, (0, omega[:2]))
    return jnp.where((best > 8) | (best < 0), 7.5, best * x)


def _tested(omega):
    """What a loop tests holds in its body, and so does what it tested first."""
    spins = omega[2] > 0.25

    def turn(carry):
        goes, number, x = carry
        x = jnp.where(goes & spins & (jnp.abs(x[0]) < 2.0), jnp.sin(x), 7.5)
        return omega[1] > x[0], number + 1, x

    def goes_on(carry):
        return carry[0] & (carry[1] < 9) & (jnp.abs(carry[2][0]) < 2.0)

    return jax.lax.while_loop(goes_on, turn, (spins, 0, omega[:2]))[2]


def _in_branches(omega):
    """The predicate of a branch is true in it, and false in the other one."""
    spins = (omega[2] > 0.25) & (omega[1] > 0.125)

    def fast(x):
        return jnp.where(omega[1] > 0.125, jnp.sin(jnp.cos(jnp.sin(x))), 7.5)

    def slow(x):
        return jnp.where(spins, 7.5, jnp.cos(jnp.sin(jnp.cos(x))))

    return jax.lax.cond(spins, fast, slow, omega[:2])


def _again_in_a_branch(omega):
    """Only in a branch is its predicate known: its opposite is still tested after it."""
    spins = omega[2] > 0.25

    def fast(x):
        return jnp.sin(jnp.cos(jnp.sin(x)))

    branch = jax.lax.cond(spins, fast, lambda x: x, omega[:2])
    return branch + jnp.where(spins, 1.5, branch)


def _never_turned(omega):
    """A loop that what is around it excludes is left out."""
    spins = omega[2] > 0.25

    def turned(goes, x):
        return jax.lax.while_loop(
            lambda carry: goes & (carry[0] < 9) & (jnp.abs(carry[1][0]) < 2.0),
            lambda carry: (carry[0] + 1, jnp.sin(carry[1])),
            (0, x),
        )[1]

    return jax.lax.cond(
        spins, lambda x: turned(spins, x), lambda x: jnp.cos(turned(spins, x)), omega[:2]
    )


_FUNCTIONS = [
    _never_turned,
    _opposites,
    _chosen_again,
    _phases,
    _from_zero,
    _narrow,
    _divided,
    _remainder,
    _looked_up,
    _largest,
    _tested,
    _in_branches,
]


class _History(NamedTuple):
    rows: Array
    count: Array


class _Keeping(AbstractSampledController):
    """A law whose helper writes its history."""

    period: Float[Array, ""] = eqx.field(converter=as_float, default=0.5)

    def init(self, state):
        """Nothing was measured."""
        return _History(jnp.zeros((4, 3)), jnp.array(0))

    def step(self, t, state, memory):
        """A sum over the history."""
        rows = _written(memory.rows, memory.count % 4, state.omega)
        return jnp.sum(rows, axis=0)[:2], _History(rows, memory.count + 1)


def _written(history, i, x):
    """Long enough to be a function of its own."""
    for k in range(9):
        x = x - 0.05 * (x - history[i]) / (1.0 + k * x**2)
    return history.at[i].set(x)


@pytest.mark.parametrize("function", _FUNCTIONS)
def test_what_is_never_chosen_is_not_printed(function):
    text = _text(_Law(function))
    assert "7.5" not in text
    assert "|| !" not in text


def test_what_is_chosen_stays_the_argument_of_a_function():
    assert "? 2.0 : sqrt(in->omega[1]);" in _text(_Law(_divided))


def test_the_predicate_of_a_branch_is_known_only_in_it():
    assert "? 1.5 :" in _text(_Law(_again_in_a_branch))


def test_a_count_that_is_less_than_the_width_is_not_tested():
    assert "UINT64_C(64)" not in _text(_Law(_shifted))


def test_an_element_is_compared_with_its_own_place_alone():
    text = _text(_Law(_in_turn))
    assert "< 0)" not in text  # no remainder is less
    assert re.findall(r"= \w+ == (\d+);", text) == ["0", "1"]  # one comparison of a row


def test_a_loop_does_not_test_its_count_twice():
    text = _text(Filtered(gain=[3.0, 2.0]))
    assert re.findall(r"< (?:INT64_C\()?30\b.", text) == ["< 30;"]
    assert "break;" in text  # for its other condition


def test_a_helper_does_not_limit_a_place_that_is_within_bounds():
    text = _text(_Keeping())
    assert "written(in, now, next," in text
    tests = re.findall(r" ((?:==|<) \d+)(?:;$|\))", text, re.MULTILINE)
    assert sorted(tests) == ["< 0", "== 0", "== 1", "== 2", "== 3"]  # of the count, and of rows


class _Twice(_Keeping):
    """A law that calls a helper with places of different ranges."""

    helper: object = eqx.field(static=True, default=None)

    def step(self, t, state, memory):
        """What the helper makes of a place within bounds, and of any place."""
        within, anywhere = memory.count % 4, memory.count
        command = self.helper(state.omega, within) + self.helper(2.0 * state.omega, anywhere)
        return command[:2], _History(memory.rows, memory.count + 1)


def _scaled(x, i):
    """Its steps are the same for any number."""
    for k in range(9):
        x = x - 0.05 * (x - i) / (1.0 + k * x**2)
    return x


def _picked(x, i):
    """A place within bounds is not limited."""
    for k in range(9):
        x = x - 0.05 * (x - x[i]) / (1.0 + k * x**2)
    return x


@pytest.mark.parametrize(("helper", "functions"), [(_scaled, 1), (_picked, 2)])
def test_calls_with_other_ranges_share_a_function_of_the_same_steps(helper, functions):
    text = _text(_Twice(helper=helper))
    name = helper.__name__.strip("_")
    assert len(re.findall(rf"^static void {name}(?:_\d+)?\(", text, re.MULTILINE)) == functions


def _next(x, i):
    """The place is followed by the next one, of four."""
    for k in range(9):
        x = x - 0.05 * x / (1.0 + k * x**2)
    return x, i + 1


class _Following(_Keeping):
    """A law that calls a helper with places of different ranges, and uses those that it returns."""

    def step(self, t, state, memory):
        """Only the place that is known to be within bounds is not limited."""
        rows = memory.rows
        x, first = _next(state.omega, memory.count % 3)
        y, second = _next(x, memory.count)
        return (x + y + rows[first] + rows[second])[:2], _History(rows, memory.count + 1)


def test_a_shared_function_has_the_range_of_each_of_its_calls():
    text = _text(_Following())
    assert len(re.findall(r"^static void next(?:_\d+)?\(", text, re.MULTILINE)) == 1
    places = re.findall(r"now->law_rows\[(\w+)\]\[0\]", text)
    assert len(places) == 2
    limited = [re.search(rf"{place} = minimum_i32", text) is not None for place in places]
    assert limited == [False, True]
