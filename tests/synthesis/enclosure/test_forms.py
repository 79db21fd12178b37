"""Operations on affine forms against 90 digits, at random points of the sets."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from mpmath import mpf

from jaxsat.core.errors import ArgumentError
from jaxsat.synthesis.enclosure.forms import Form, between, exact
from jaxsat.synthesis.enclosure.program import FormProgram

STARTS, OTHERS = 2, 2
PAIRS = 3


@pytest.fixture(autouse=True)
def digits():
    with mpmath.workdps(90):
        yield


def offset(slopes, symbols):
    return sum((g * s for g, s in zip(slopes, symbols, strict=True)), mpf(0))


def form_of(rng, middle, size):
    """A form of numbers about a middle, with starts, their pairs, other symbols and a rest."""
    rows = rng.uniform(-1, 1, (2 + STARTS + PAIRS + OTHERS, *np.shape(middle))) * size / 8
    rows[0], rows[1] = middle, np.abs(rows[1])
    return Form(rows, STARTS)


def symbols_of(rng):
    """Values of all symbols, often at the ends."""
    draw = [mpf(float(x)) for x in np.clip(rng.uniform(-1.5, 1.5, STARTS + OTHERS), -1, 1)]
    first, second = draw[:STARTS]
    return [*draw[:STARTS], 2 * first**2 - 1, first * second, 2 * second**2 - 1, *draw[STARTS:]]


def numbers_of(form, symbols, rest):
    """Members of the sets, each of `rest` of the bound r off what the symbols give."""
    flat = form.rows.reshape(len(form.rows), -1)
    values = []
    for column in flat.T:
        center, bound, *slopes = (mpf(float(x)) for x in column)
        values.append(center + offset(slopes, symbols) + rest * bound)
    return values


def assert_inside(form, symbols, values):
    """The values are what the symbols give, up to r."""
    flat = form.rows.reshape(len(form.rows), -1)
    for column, value in zip(flat.T, values, strict=True):
        center, bound, *slopes = (mpf(float(x)) for x in column)
        assert abs(value - center - offset(slopes or [mpf(0)] * len(symbols), symbols)) <= bound


FUNCTIONS = {
    "exp": (jnp.exp, mpmath.exp, (-3, 3)),
    "log": (jnp.log, mpmath.log, (0.5, 9)),
    "log1p": (jnp.log1p, mpmath.log1p, (0, 4)),
    "expm1": (jnp.expm1, mpmath.expm1, (-1, 1)),
    "sqrt": (jnp.sqrt, mpmath.sqrt, (0.3, 9)),
    "rsqrt": (jax.lax.rsqrt, lambda x: 1 / mpmath.sqrt(x), (0.5, 9)),
    "sin": (jnp.sin, mpmath.sin, (-9, 9)),
    "cos": (jnp.cos, mpmath.cos, (-9, 9)),
    "tanh": (jnp.tanh, mpmath.tanh, (-4, 4)),
    "sigmoid": (jax.nn.sigmoid, lambda x: 1 / (1 + mpmath.exp(-x)), (-6, 6)),
    "atan": (jnp.arctan, mpmath.atan, (-5, 5)),
    "abs": (jnp.abs, abs, (-1, 1)),
    "square": (jnp.square, lambda x: x**2, (-2, 2)),
    "cube": (lambda x: x**3, lambda x: x**3, (-2, 2)),
    "fourth": (lambda x: x**4, lambda x: x**4, (-2, 2)),
    "inverse square": (lambda x: x**-2, lambda x: x**-2, (0.5, 3)),
    "quarter": (lambda x: x**0.25, lambda x: mpmath.root(x, 4), (0.4, 3)),
    "reciprocal": (lambda x: 1 / x, lambda x: 1 / x, (-5, -0.4)),
    "clip": (lambda x: jnp.clip(x, -0.5, 0.7), lambda x: max(mpf(-0.5), min(mpf(0.7), x)), (-2, 2)),
    "where": (
        lambda x: jnp.where(x > 0.1, x, -3 * x),
        lambda x: x if x > mpf(0.1) else -3 * x,
        (-1, 1),
    ),
    "sign": (jnp.sign, mpmath.sign, (-1, 1)),
    "floor": (jnp.floor, mpmath.floor, (-2, 2)),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("size", [1e-15, 1e-3, 0.2, 1.0])
def test_functions(name, size):
    ours, theirs, domain = FUNCTIONS[name]
    rng = np.random.default_rng(3)
    bounded = size if name in ("exp", "sin", "cos", "tanh", "sigmoid", "atan") else min(size, 0.3)
    middle = rng.uniform(*domain, 40)
    program = FormProgram(ours, middle)
    form = form_of(rng, middle, bounded)
    (found,) = program(form)
    assert np.isfinite(found.rows).all()
    for _ in range(12):
        symbols, rest = symbols_of(rng), rng.choice([-1, 0.5, 1])
        assert_inside(found, symbols, [theirs(x) for x in numbers_of(form, symbols, rest)])


@pytest.mark.parametrize("size", [1e-15, 1e-3, 1.0])
def test_arithmetic(size):
    rng = np.random.default_rng(5)
    matrix = rng.normal(size=(3, 4))

    def function(x, y):
        return [x + y, x - y, -x, x * y, x / (y + 9), jnp.maximum(x, y), matrix @ x, x @ y, x.sum()]

    def reference(x, y):
        rows = [[mpf(float(m)) for m in row] for row in matrix]
        pairs = list(zip(x, y, strict=True))
        return [
            *([a + b for a, b in pairs], [a - b for a, b in pairs], [-a for a in x]),
            *([a * b for a, b in pairs], [a / (b + 9) for a, b in pairs]),
            [max(pair) for pair in pairs],
            [mpmath.fdot(row, x) for row in rows],
            *([mpmath.fdot(x, y)], [mpmath.fsum(x)]),
        ]

    program = FormProgram(function, np.zeros(4), np.zeros(4))
    for _ in range(30):
        x, y = (form_of(rng, rng.normal(size=4), size) for _ in range(2))
        found = program(x, y)
        symbols, rest = symbols_of(rng), rng.choice([-1, 1])
        values = reference(numbers_of(x, symbols, rest), numbers_of(y, symbols, rest))
        for one, value in zip(found, values, strict=True):
            assert_inside(one, symbols, value)


def test_what_is_left_out_is_of_third_order():
    """Twice the set, eight times the rest; a constant and a linear function leave out nothing."""
    rows = np.array([[0.4], [0.0], [1e-3], [2e-3], [0.0], [0.0], [0.0]])
    program = FormProgram(lambda x: jnp.tanh(x) * jnp.exp(x) / (2 + x), np.zeros(1))
    rests = []
    for scale in (1, 2):
        scaled = rows.copy()
        scaled[2:] *= scale
        rests.append(program(Form(scaled, STARTS))[0].rest[0])
    assert 7.8 < rests[1] / rests[0] < 8.3
    (linear,) = FormProgram(lambda x: 3 * x - x - 2 * x, np.zeros(1))(Form(rows, STARTS))
    assert linear.reach[0] < 1e-14


def test_unbounded_where_a_number_may_be_zero():
    (found,) = FormProgram(lambda x: 1 / x, np.zeros(2))(between([-1.0, 1.0], [1.0, 2.0]))
    assert not np.isfinite(found.upper[0])
    assert found.lower[1] <= 0.5 <= 1 <= found.upper[1]


def test_one_branch_may_have_no_value():
    program = FormProgram(lambda x: jnp.where(x > 0, jnp.sqrt(x), 0.0), np.zeros(2))
    (found,) = program(between([-2.0, 1.0], [-1.0, 1.0]))
    np.testing.assert_allclose(found.center, [0, 1])
    assert (found.reach < 1e-12).all()


def test_a_smooth_program_is_unbounded_at_a_corner():
    program = FormProgram(
        lambda x: jnp.abs(x) + jnp.where(x > 3, 1.0, 0.0), np.zeros(3), smooth=True
    )
    (found,) = program(between([-1.0, 1.0, 2.5], [1.0, 2.0, 3.5]))
    assert list(np.isfinite(found.upper)) == [False, True, False]


def test_numbers_are_moved_as_numpy_moves_them():
    def function(x):
        rows = x[np.array([2, 0])]
        return [rows, x.at[1].set(rows[0]), jax.lax.dynamic_slice(x, (1, 0), (2, 2)), x[::-1].T]

    x = np.random.default_rng(1).normal(size=(3, 2))
    form = form_of(np.random.default_rng(2), x, 0.1)
    changed = x.copy()
    changed[1] = x[2]
    found = FormProgram(function, x)(form)
    for one, expected in zip(found, [x[[2, 0]], changed, x[1:], x[::-1].T], strict=True):
        np.testing.assert_array_equal(one.center, expected)
    np.testing.assert_array_equal(found[1].rows[:, 1], form.rows[:, 2])
    with pytest.raises(ArgumentError, match="constants"):
        program = FormProgram(lambda x: jnp.arange(3.0)[(x > 0).astype(int)], np.zeros(1))
        program(between([-1.0], [1.0]))


def test_operations_without_a_rule_are_refused():
    with pytest.raises(ArgumentError, match="`sort`"):
        FormProgram(jnp.sort, np.zeros(3))
    with pytest.raises(ArgumentError, match="64-bit"):
        FormProgram(lambda x: x.astype(jnp.float32), np.zeros(3))(exact(np.zeros(3)))
