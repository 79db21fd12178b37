"""Elementary functions of the compiled engine against mpmath, over the whole domain.

Each is evaluated three times: with NumPy, operation by operation, by XLA and by the compiled
engine, which fuse a*b + c. All must meet the bound, so neither a fused nor an unfused
multiplication does harm.
"""

from itertools import product

import jax
import mpmath as mp
import numpy as np
import pytest
import scipy.special
from jax import lax

from engine.native.numpy_interpreter import evaluate
from jaxsat.engine.native.functions import FUNCTIONS, program
from jaxsat.engine.native.mapped import Mapped

mp.mp.dps = 40


def _logistic(x):
    return 1 / (1 + mp.exp(-x))


def _real(function):
    def real(x):
        value = function(x)
        return value if mp.im(value) == 0 else mp.nan

    return real


def _power(x, y):
    value = mp.power(x, y)
    return value if mp.im(value) == 0 else mp.nan


REFERENCES = {
    "acos": mp.acos,
    "acosh": _real(mp.acosh),
    "asin": mp.asin,
    "asinh": mp.asinh,
    "atan": mp.atan,
    "atan2": mp.atan2,
    "atanh": _real(mp.atanh),
    "cbrt": lambda x: mp.sign(x) * mp.cbrt(abs(x)),
    "cos": mp.cos,
    "cosh": mp.cosh,
    "erf": mp.erf,
    "erf_inv": mp.erfinv,
    "erfc": mp.erfc,
    "exp": mp.exp,
    "exp2": lambda x: mp.mpf(2) ** x,
    "expm1": mp.expm1,
    "log": mp.log,
    "log1p": mp.log1p,
    "logistic": _logistic,
    "pow": _power,
    "sin": mp.sin,
    "sinh": mp.sinh,
    "tan": mp.tan,
    "tanh": mp.tanh,
}
NUMPY = {
    "acos": np.arccos,
    "acosh": np.arccosh,
    "asin": np.arcsin,
    "asinh": np.arcsinh,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "atanh": np.arctanh,
    "cbrt": np.cbrt,
    "cos": np.cos,
    "cosh": np.cosh,
    "erf": scipy.special.erf,
    "erfc": scipy.special.erfc,
    "exp": np.exp,
    "exp2": np.exp2,
    "expm1": np.expm1,
    "log": np.log,
    "log1p": np.log1p,
    "pow": np.power,
    "sin": np.sin,
    "sinh": np.sinh,
    "tan": np.tan,
    "tanh": np.tanh,
}
TWO_ARGUMENTS = ("atan2", "pow")
ULPS = {name: 4.0 if name in ("pow", "erf_inv") else 2.0 for name in REFERENCES}
NEAR = ["sin", "cos"]
BASIC = {
    "abs", "add", "and", "bitcast_convert_type", "broadcast_in_dim", "cond", "convert_element_type",
    "div", "eq", "floor", "ge", "gt", "le", "lt", "max", "min", "mul", "ne", "neg", "not", "or",
    "round", "select_n", "shift_left", "shift_right_arithmetic", "shift_right_logical", "sqrt",
    "sub", "xor",
}  # fmt: skip
EDGES = np.array(
    [
        *(0.0, 5e-324, 2.2e-308, 2.0**-1022, 1e-300, 1e-20, 2.0**-27, 0.1, 0.5, 1.0, 1.5, 2.0, 3.0),
        *(np.nextafter(1.0, 0.0), np.nextafter(1.0, 2.0), np.pi / 4, np.pi / 2, np.pi),
        *(709.7, 710.4, 745.0, 746.0, 1024.0, 2.0**20, 2.0**31, 2.0**52 + 1, 2.0**53, 1e22, 1e300),
        *(np.finfo(float).max, np.inf),
    ]
)
EDGES = np.concatenate([EDGES, -EDGES, [np.nan]])


def _spread(rng: np.random.Generator, least: float, most: float, count: int) -> np.ndarray:
    """Both signs, evenly over the logarithms."""
    sizes = np.exp(rng.uniform(np.log(least), np.log(most), count))
    return sizes * rng.choice([-1.0, 1.0], count)


def _any_double(rng: np.random.Generator, count: int) -> np.ndarray:
    numbers = rng.integers(0, 2**64, count, dtype=np.uint64).view(float)
    return numbers[np.isfinite(numbers)]


def _near(points, rng: np.random.Generator, count: int) -> np.ndarray:
    """Doubles within some units of the points where a function changes its formula."""
    bits = np.repeat(np.asarray(points, float), count).view(np.int64)
    return (bits + rng.integers(-1000, 1000, bits.size)).view(float)


def _points(name: str, rng: np.random.Generator, count: int) -> np.ndarray:
    if name in ("sin", "cos", "tan"):
        multiples = np.arange(1, count // 4 + 1) * (np.pi / 2)
        worst = [6381956970095103 * 2.0**797, 5.31937264832654141671e255, 2.0**20, 1e22]
        return np.concatenate(
            [
                *(rng.uniform(-10, 10, count), _spread(rng, 1e-5, 1e9, count), multiples, worst),
                *(_any_double(rng, count), _near([2.0**20, np.pi / 4], rng, 20)),
            ]
        )
    if name == "acosh":
        from_one = [rng.uniform(1, 4, count), 1 + np.abs(_spread(rng, 1e-15, 1.0, count))]
        large = np.exp(rng.uniform(0, 709, count))
        return np.concatenate([*from_one, large, _near([1.5, 2.0**28], rng, 20)])
    if name in ("asin", "acos", "atanh", "erf_inv"):
        ends = 1 - np.abs(_spread(rng, 1e-16, 0.3, count))
        middle = _near([0.5, 0.99903], rng, 20)
        return np.concatenate(
            [rng.uniform(-1, 1, count), ends, -ends, _spread(rng, 1e-300, 1.0, count), middle]
        )
    if name in ("log", "log1p"):
        near_one = 1 + _spread(rng, 1e-12, 0.5, count)
        every = np.abs(_any_double(rng, count))
        shift = 1.0 if name == "log1p" else 0.0
        close = _spread(rng, 1e-300, 0.9, count) if shift else _near([0.7071, 1.4142], rng, 20)
        return np.concatenate([rng.uniform(0.01, 4, count) - shift, near_one - shift, every, close])
    if name in ("erf", "erfc"):
        edges = _near([0.5, 0.9, 4.0], rng, 20)
        tail = rng.uniform(4, 28, count)
        small = _spread(rng, 1e-300, 1.0, count)
        return np.concatenate([rng.uniform(-6, 6, count), tail, small, edges, -edges])
    edges = _near([0.34657, 0.5, 0.55, 1.0, 22.0, 2.0**28], rng, 20)
    large = rng.uniform(-740, 705, count)
    return np.concatenate(
        [rng.uniform(-3, 3, count), large, _spread(rng, 1e-300, 30, count), edges]
        + ([_any_double(rng, count)] if name in ("asinh", "atan", "cbrt") else [])
    )


def _pairs(name: str, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    if name == "atan2":
        first = [rng.uniform(-2, 2, count), _spread(rng, 1e-4, 1e4, count)]
        second = [rng.uniform(-2, 2, count), _spread(rng, 1e-4, 1e4, count)]
    else:
        first = [rng.uniform(0, 4, count), 1 + _spread(rng, 1e-9, 0.4, count)]
        second = [rng.uniform(-20, 20, count), _spread(rng, 1, 1e9, count)]
        first += [rng.uniform(-4, 4, count), np.exp(rng.uniform(-700, 700, count))]
        second += [rng.integers(-30, 30, count).astype(float), rng.uniform(-1, 1, count)]
    numbers, others = _any_double(rng, count), _any_double(rng, count)
    both = min(numbers.size, others.size)
    return np.concatenate([*first, numbers[:both]]), np.concatenate([*second, others[:both]])


def _arguments(name: str, seed: int, count: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    return _pairs(name, rng, count) if name in TWO_ARGUMENTS else (_points(name, rng, count),)


def _exact(name: str, arguments: tuple[np.ndarray, ...]) -> list[mp.mpf]:
    if name == "pow":
        # An exponent of 1e9 costs nine digits of the logarithm.
        with mp.workdps(60):
            return [_bounded_power(float(x), float(y)) for x, y in zip(*arguments, strict=True)]
    reference = REFERENCES[name]
    return [reference(*map(mp.mpf, map(float, row))) for row in zip(*arguments, strict=True)]


def _bounded_power(x: float, y: float) -> mp.mpf:
    if x < 0 and y != np.floor(y):
        return mp.nan
    with np.errstate(all="ignore"):
        if x == 0 or abs(y * np.log(abs(x))) > 2000:
            return mp.mpf(float(np.power(x, y)))
    return _power(mp.mpf(x), mp.mpf(y))


def _ulps(values: np.ndarray, exact: list[mp.mpf], smallest: float = 0.0) -> np.ndarray:
    """Errors in units in the last place; results of less than `smallest` pass."""
    errors = np.zeros(values.size)
    for i, (value, true) in enumerate(zip(values, exact, strict=True)):
        nearest = float(true)
        if abs(true) < smallest:
            continue
        if np.isnan(nearest) or np.isinf(nearest):
            errors[i] = 0.0 if np.array_equal(value, nearest, equal_nan=True) else np.inf
        elif not np.isfinite(value):
            limit = np.finfo(float).max
            errors[i] = 1.0 if abs(true) > limit * (1 - 2**-52) else np.inf
        else:
            spacing = float(np.spacing(abs(nearest)))
            errors[i] = float(abs(mp.mpf(float(value)) - true) / mp.mpf(spacing))
    return errors


def _by_numpy(name: str, arguments: tuple[np.ndarray, ...]) -> np.ndarray:
    return np.asarray(evaluate(program(name, *(["float64"] * len(arguments))), *arguments)[0])


def _by_machine_code(name: str, arguments: tuple[np.ndarray, ...]) -> np.ndarray:
    numbers = tuple(0.0 for _ in arguments)
    function = Mapped(lambda numbers, shared: getattr(lax, name)(*numbers), numbers)
    return function(arguments)


def _assert_accurate(name: str, arguments: tuple[np.ndarray, ...]) -> None:
    exact = _exact(name, arguments)
    unfused = _ulps(_by_numpy(name, arguments), exact)
    assert unfused.max() <= ULPS[name], [a[unfused.argmax()] for a in arguments]
    compiled = _ulps(_by_machine_code(name, arguments), exact)
    assert compiled.max() <= ULPS[name], [a[compiled.argmax()] for a in arguments]
    # XLA takes subnormal numbers for zero.
    normal = np.all([(np.abs(a) > 1e-307) for a in arguments], axis=0)
    fused = _ulps(np.asarray(jax.jit(FUNCTIONS[name])(*arguments)), exact, 1e-307)
    fused = np.where(normal, fused, 0.0)
    assert fused.max() <= ULPS[name], [a[fused.argmax()] for a in arguments]


@pytest.mark.parametrize("name", REFERENCES)
def test_every_function_is_accurate(name):
    _assert_accurate(name, _arguments(name, 1, 20 if name == "erf_inv" else 300))


@pytest.mark.slow
@pytest.mark.parametrize("name", REFERENCES)
def test_every_function_is_accurate_on_many_points(name):
    _assert_accurate(name, _arguments(name, 2, 500 if name == "erf_inv" else 20_000))


@pytest.mark.parametrize("name", NUMPY)
def test_special_values_are_those_of_numpy(name):
    pairs = np.array(list(product(EDGES, EDGES))).T
    arguments = tuple(pairs) if name in TWO_ARGUMENTS else (EDGES,)
    with np.errstate(all="ignore"):
        expected = NUMPY[name](*arguments)
    for values in (_by_numpy(name, arguments), _by_machine_code(name, arguments)):
        _assert_special(values, expected, ULPS[name])


def _assert_special(values: np.ndarray, expected: np.ndarray, ulps: float) -> None:
    np.testing.assert_array_equal(np.isnan(values), np.isnan(expected))
    whole = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(values[whole]), np.signbit(expected[whole]))
    special = whole & ((expected == 0) | np.isinf(expected))
    np.testing.assert_array_equal(values[special], expected[special])
    # NumPy's own vector functions err by up to four units.
    rest = whole & ~special
    with np.errstate(all="ignore"):
        distance = np.abs(values[rest] - expected[rest]) / np.spacing(np.abs(expected[rest]))
    assert distance.max() <= ulps + 4


def test_erf_inv_and_logistic_have_the_right_ends():
    ends = np.array([0.0, -0.0, 1.0, -1.0, 1.5, -np.inf, np.nan])
    values = _by_numpy("erf_inv", (ends,))
    np.testing.assert_array_equal(values, [0.0, 0.0, np.inf, -np.inf, np.nan, np.nan, np.nan])
    assert np.signbit(values[1])
    values = _by_numpy("logistic", (np.array([np.inf, -np.inf, 0.0, -800.0, np.nan]),))
    np.testing.assert_array_equal(values, [1.0, 0.0, 0.5, 0.0, np.nan])


def test_sincos_is_sine_and_cosine():
    x = _points("sin", np.random.default_rng(3), 200)
    values = evaluate(program("sincos", "float64"), x)
    np.testing.assert_array_equal(values[0], _by_numpy("sin", (x,)))
    np.testing.assert_array_equal(values[1], _by_numpy("cos", (x,)))


def test_the_short_way_of_sine_and_cosine_is_accurate_below_its_limit():
    """Alone and together; beyond the limit it says that it is wrong."""
    rng = np.random.default_rng(6)
    x = np.concatenate([_points("sin", rng, 300), rng.uniform(-(2.0**14), 2.0**14, 600)])
    short = np.abs(x) < 2.0**14
    for name, parts in (("near_sin", ["sin"]), ("near_cos", ["cos"]), ("near_sincos", NEAR)):
        for found in (evaluate(program(name, "float64"), x), jax.jit(FUNCTIONS[name])(x)):
            np.testing.assert_array_equal(np.asarray(found[-1]), ~short)
            for part, values in zip(parts, found[:-1], strict=True):
                errors = _ulps(np.asarray(values)[short], _exact(part, (x[short],)))
                assert errors.max() <= ULPS[part], x[short][errors.argmax()]
    both = Mapped(lambda x, shared: (lax.sin(x), lax.cos(x)), 0.0)(x)
    for part, values in zip(NEAR, both, strict=True):
        assert _ulps(values, _exact(part, (x,))).max() <= ULPS[part]


@pytest.mark.parametrize("name", REFERENCES)
def test_32_bit_floats_are_rounded_once(name):
    with np.errstate(all="ignore"):
        arguments = [a.astype(np.float32) for a in _arguments(name, 4, 50)]
    values = evaluate(program(name, *(["float32"] * len(arguments))), *arguments)[0]
    wide = _by_numpy(name, tuple(a.astype(float) for a in arguments))
    assert values.dtype == np.float32
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(values, wide.astype(np.float32))


def test_an_integer_exponent_is_converted():
    values = evaluate(program("pow", "float64", "int32"), np.full(3, 1.5), np.arange(-1, 2))[0]
    np.testing.assert_array_equal(values, [1 / 1.5, 1.0, 1.5])


def test_programs_need_no_64_bit_setting_and_only_basic_operations():
    with jax.enable_x64(False):
        program.cache_clear()
        programs = {n: program(n, *["float32"] * (1 + (n in TWO_ARGUMENTS))) for n in FUNCTIONS}
    for name, closed in programs.items():
        assert closed.out_avals[0].dtype == np.float32
        assert _primitives(closed.jaxpr) <= BASIC, name


def _primitives(jaxpr) -> set[str]:
    names = set()
    for equation in jaxpr.eqns:
        names.add(equation.primitive.name)
        for branch in equation.params.get("branches", ()):
            names |= _primitives(branch.jaxpr)
    return names
