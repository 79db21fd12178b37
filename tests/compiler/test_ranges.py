"""What the builder knows of integers holds for all of them: random programs, every operand."""

import numpy as np
import pytest

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Value
from jaxsat.compiler.operations import BOOL, evaluate

KIND = np.dtype(np.int8)
NUMBERS = np.arange(-128, 128).astype(KIND)
COMPARED = ("lt", "le", "gt", "ge", "eq", "ne")
JOINED = ("add", "sub", "min", "max")


class _Program:
    """A program of two integers, and the numbers of each value for all of these."""

    def __init__(self, seed: int):
        self.rng = np.random.default_rng(seed)
        self.b = Builder()
        self.b.compact = True
        pairs = np.meshgrid(NUMBERS, NUMBERS[::5])
        self.whole = [(Value(KIND, True), pair.ravel()) for pair in pairs]
        self.truths: list = []
        self.decided = 0

    def add(self, name, *args):
        """Append an operation, and check what is known of its result."""
        scalars, arrays = zip(*args, strict=True)
        kind = BOOL if name in COMPARED or scalars[-1].dtype == BOOL else KIND
        expected = np.asarray(evaluate(name, arrays, kind)).astype(kind)
        found = self.b.operation(name, *scalars)
        if not isinstance(found, Value):
            np.testing.assert_array_equal(expected, found)
            self.decided += any(isinstance(x, Value) for x in scalars)
            return
        known = [y for x, y in self.whole + self.truths if x is found]
        for array in known:
            np.testing.assert_array_equal(expected, array)
        self.decided += bool(known)
        bounds = self.b.ranges.of(found)
        if bounds is not None:
            assert bounds[0] <= expected.min()
            assert expected.max() <= bounds[1]
        (self.truths if kind == BOOL else self.whole).append((found, expected))

    def some(self, among):
        """One of these, more often a late one."""
        place = int(len(among) * self.rng.random() ** 0.5)
        return among[place]

    def constant(self, least=-128):
        """A constant, mostly a small one."""
        size = 128 if self.rng.random() < 0.3 else 5
        number = KIND.type(self.rng.integers(max(least, -size), size))
        return number, np.full(len(self.whole[0][1]), number)

    def grow(self):
        """Append a random operation."""
        which = self.rng.integers(6)
        if which == 0:
            self.add("rem", self.some(self.whole), self.constant(2))
        elif which == 1:
            other = self.constant() if self.rng.random() < 0.7 else self.some(self.whole)
            self.add(str(self.rng.choice(JOINED)), self.some(self.whole), other)
        elif which <= 3 or len(self.truths) < 2:
            self.add(str(self.rng.choice(COMPARED)), self.some(self.whole), self.constant())
        elif which == 4:
            name = str(self.rng.choice(("and", "or")))
            self.add(name, self.some(self.truths), self.some(self.truths))
        else:
            parts = [self.some(self.whole), self.some(self.whole)]
            if self.rng.random() < 0.4:
                parts[self.rng.integers(2)] = self.constant()
            self.add("select", self.some(self.truths), *parts)


@pytest.mark.parametrize("seed", range(12))
def test_what_is_known_holds_for_every_operand(seed):
    program = _Program(seed)
    for _ in range(400):
        program.grow()
    assert program.decided > 40


def test_a_remainder_with_the_sign_of_its_divisor_has_a_range():
    program = _Program(0)
    number = program.whole[0]
    program.add("rem", number, (KIND.type(6), np.full(len(number[1]), 6, KIND)))
    rest = program.whole[-1]
    zero = KIND.type(0), np.zeros(len(number[1]), KIND)
    program.add("lt", rest, zero)
    program.add("add", rest, (KIND.type(6), np.full(len(number[1]), 6, KIND)))
    program.add("select", program.truths[-1], program.whole[-1], rest)
    assert program.b.ranges.of(program.whole[-1][0]) == (0, 5)


def _constant(program, number):
    return KIND.type(number), np.full(len(program.whole[0][1]), number, KIND)


def test_a_number_in_the_place_of_another_is_never_that_one():
    """As a divisor is never zero."""
    program = _Program(0)
    number, zero = program.whole[0], _constant(program, 0)
    program.add("eq", number, zero)
    program.add("select", program.truths[-1], _constant(program, 3), number)
    divisor = program.whole[-1]
    decided = program.decided
    program.add("eq", divisor, zero)
    program.add("ne", zero, divisor)
    assert program.decided == decided + 2
    program.add("select", program.truths[-1], _constant(program, 0), number)
    program.add("eq", program.whole[-1], zero)
    assert program.decided == decided + 2
    assert len(program.truths) == 2


def test_an_equality_of_a_choice_is_its_predicate():
    """As the sign of a number is one where it is positive."""
    program = _Program(0)
    number, zero, one = program.whole[0], _constant(program, 0), _constant(program, 1)
    program.add("lt", number, zero)
    program.add("gt", number, zero)
    below, above = program.truths[-2:]
    program.add("select", below, _constant(program, -1), zero)
    program.add("select", above, one, program.whole[-1])
    sign = program.whole[-1][0]
    assert program.b.operation("eq", sign, KIND.type(1)) is above[0]
    negation = program.b.operation("ne", sign, KIND.type(1))
    assert negation is program.b.negation(above[0])
    truth = program.b.convert(below[0], KIND)
    assert program.b.operation("ne", truth, KIND.type(0)) is below[0]
    assert program.b.select(negation, KIND.type(5), KIND.type(6)) is program.b.select(
        above[0], KIND.type(6), KIND.type(5)
    )
