"""Elementary functions of the compiled engine against mpmath, over the whole domain.

Each is evaluated three times: with NumPy, operation by operation, by XLA and by the compiled
engine, which fuse a*b + c. All must meet the bound, so neither a fused nor an unfused
multiplication does harm.
"""

from itertools import product

import jax
import numpy as np
import pytest
from jax import lax

from compiler.function_points import TWO_ARGUMENTS, arguments_of, points
from compiler.function_references import NUMPY, REFERENCES, errors_in_ulps, exact_values
from compiler.numpy_interpreter import evaluate
from helpers.compiling import fully_optimised
from jaxsat.compiler.functions import FUNCTIONS, program
from jaxsat.compiler.llvm.mapped import Mapped
from jaxsat.compiler.rules.mathematics import PARTS

ULPS = {name: 4.0 if name in ("pow", "erf_inv") else 2.0 for name in REFERENCES}
BASIC = {
    "abs", "add", "and", "bitcast_convert_type", "broadcast_in_dim", "cond",
    "convert_element_type", "div", "dynamic_slice", "eq", "floor", "ge", "gt", "le", "lt",
    "max", "min", "mul", "ne", "neg", "not", "or", "round", "select_n", "shift_left",
    "shift_right_arithmetic", "shift_right_logical", "sqrt", "squeeze", "sub", "xor",
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


def _by_numpy(name: str, arguments: tuple[np.ndarray, ...]) -> np.ndarray:
    return np.asarray(evaluate(program(name, *(["float64"] * len(arguments))), *arguments)[0])


def _by_machine_code(name: str, arguments: tuple[np.ndarray, ...]) -> np.ndarray:
    numbers = tuple(0.0 for _ in arguments)
    function = Mapped(lambda numbers, shared: getattr(lax, name)(*numbers), numbers)
    return function(arguments)


def _assert_accurate(name: str, arguments: tuple[np.ndarray, ...]) -> None:
    exact = exact_values(name, arguments)
    unfused = errors_in_ulps(_by_numpy(name, arguments), exact)
    assert unfused.max() <= ULPS[name], [a[unfused.argmax()] for a in arguments]
    compiled = errors_in_ulps(_by_machine_code(name, arguments), exact)
    assert compiled.max() <= ULPS[name], [a[compiled.argmax()] for a in arguments]
    # XLA takes subnormal numbers for zero.
    normal = np.all([(np.abs(a) > 1e-307) for a in arguments], axis=0)
    fused = errors_in_ulps(np.asarray(fully_optimised(FUNCTIONS[name])(*arguments)), exact, 1e-307)
    fused = np.where(normal, fused, 0.0)
    assert fused.max() <= ULPS[name], [a[fused.argmax()] for a in arguments]


@pytest.mark.parametrize("name", REFERENCES)
def test_every_function_is_accurate(name):
    _assert_accurate(name, arguments_of(name, 1, 20 if name == "erf_inv" else 300))


@pytest.mark.slow
@pytest.mark.parametrize("name", REFERENCES)
def test_every_function_is_accurate_on_many_points(name):
    _assert_accurate(name, arguments_of(name, 2, 500 if name == "erf_inv" else 20_000))


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
    x = points("sin", np.random.default_rng(3), 200)
    values = evaluate(program("sincos", "float64"), x)
    np.testing.assert_array_equal(values[0], _by_numpy("sin", (x,)))
    np.testing.assert_array_equal(values[1], _by_numpy("cos", (x,)))


def test_the_short_way_of_sine_and_cosine_is_accurate_below_its_limit():
    """Beyond the limit it says that it is wrong."""
    rng = np.random.default_rng(6)
    x = np.concatenate([points("sin", rng, 300), rng.uniform(-(2.0**14), 2.0**14, 600)])
    short = np.abs(x) < 2.0**14
    name = "near_sincos"
    for found in (evaluate(program(name, "float64"), x), fully_optimised(FUNCTIONS[name])(x)):
        np.testing.assert_array_equal(np.asarray(found[-1]), ~short)
        for part, values in zip(PARTS, found[:-1], strict=True):
            errors = errors_in_ulps(np.asarray(values)[short], exact_values(part, (x[short],)))
            assert errors.max() <= ULPS[part], x[short][errors.argmax()]
    both = Mapped(lambda x, shared: (lax.sin(x), lax.cos(x)), 0.0)(x)
    for part, values in zip(PARTS, both, strict=True):
        assert errors_in_ulps(values, exact_values(part, (x,))).max() <= ULPS[part]


@pytest.mark.parametrize("contract", [True, False])
def test_sine_and_cosine_have_the_same_bits_alone_and_together(contract):
    """Also of an angle that ends in a sum of a product, and where sums read the results."""
    rng = np.random.default_rng(8)
    x = np.concatenate([points("sin", rng, 300), rng.uniform(-(2.0**14), 2.0**14, 600), EDGES])
    cases = x, rng.uniform(0.5, 2, x.size), rng.normal(size=x.size)

    def found(*functions):
        def results(case, shared):
            x, scale, shift = case
            angle = x * scale + shift
            return [(f(x), shift + scale * f(angle)) for f in functions]

        values = Mapped(results, (0.0, 0.0, 0.0), contract=contract)(cases)
        return [np.asarray(value).view(np.int64) for value in jax.tree.leaves(values)]

    sine, cosine = found(lax.sin), found(lax.cos)
    np.testing.assert_array_equal(found(lax.sin, lax.cos), [*sine, *cosine])
    np.testing.assert_array_equal(found(lax.cos, lax.sin), [*cosine, *sine])


@pytest.mark.parametrize("name", ["atan2", "erf_inv"])
def test_a_short_way_is_accurate_where_it_does_not_say_that_it_is_wrong(name):
    """That is nearly everywhere where numbers are not far from one."""
    rng = np.random.default_rng(7)
    if name == "atan2":
        ordinary = tuple(rng.normal(size=(2, 400)))
        rest = arguments_of(name, 8, 100)
    else:
        ordinary = (rng.uniform(-0.999, 0.999, 100),)
        rest = (np.concatenate([arguments_of(name, 8, 10)[0], EDGES, [1 - 1e-4, 1e-4 - 1]]),)
    arguments = tuple(np.concatenate(pair) for pair in zip(ordinary, rest, strict=True))
    doubles = ["float64"] * len(arguments)
    with np.errstate(all="ignore"):
        unfused = evaluate(program(f"near_{name}", *doubles), *arguments)
    for values, wrong in (unfused, jax.jit(FUNCTIONS[f"near_{name}"])(*arguments)):
        right = ~np.asarray(wrong)
        assert right[: len(ordinary[0])].all()
        assert not right.all()
        chosen = tuple(a[right] for a in arguments)
        if values is unfused[0]:  # flight code has the long way alone
            np.testing.assert_array_equal(values[right], _by_numpy(name, chosen))
        found = np.asarray(values)[right]
        errors = errors_in_ulps(found, exact_values(name, chosen), 1e-307)
        assert errors.max() <= ULPS[name], [a[errors.argmax()] for a in chosen]


@pytest.mark.parametrize("name", REFERENCES)
def test_32_bit_floats_are_rounded_once(name):
    with np.errstate(all="ignore"):
        arguments = [a.astype(np.float32) for a in arguments_of(name, 4, 50)]
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
        programs = {
            name: program(name, *["float32"] * (1 + (name.removeprefix("near_") in TWO_ARGUMENTS)))
            for name in FUNCTIONS
        }
    for name, closed in programs.items():
        assert closed.out_avals[0].dtype == np.float32
        assert _primitives(closed) <= BASIC, name


def _primitives(jaxpr) -> set[str]:
    names = set()
    for equation in jaxpr.equations:
        names |= {equation.name}.union(*map(_primitives, equation.programs()))
    return names
