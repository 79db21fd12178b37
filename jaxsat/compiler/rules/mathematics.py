"""Rules of elementary functions, each in plain `jax.numpy` and lowered as a function once."""

from collections.abc import Sequence
from typing import Any

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.functions import FUNCTIONS, program
from jaxsat.compiler.interpreter import interpret
from jaxsat.compiler.ir import Function, Scalar, Value
from jaxsat.compiler.lowering import Elements, each, filled, function_of, lower, lowers
from jaxsat.compiler.operations import INT
from jaxsat.compiler.passes.dead_code import without_dead_code

PARTS = ("sin", "cos")
"""Results of the function `sincos`, which is called once for both."""

SHORT = ("atan2", "erf_inv")
"""Functions with a short version, which is inlined."""

INTERNAL = ("sincos", "near_sincos", *(f"near_{name}" for name in SHORT))
"""Functions that are no primitives."""


@lowers(*(name for name in FUNCTIONS if name not in (*PARTS, *INTERNAL, *SHORT)))
def _written(b: Builder, eqn, *arrays: Elements) -> Elements:
    return each(lambda *scalars: _called(b, eqn.name, scalars)[0], *arrays)


def _called(b: Builder, name: str, scalars: Sequence[Scalar]) -> Sequence[Scalar]:
    """Return the results of a function, constants for constant arguments."""
    dtypes = [x.dtype for x in scalars]
    function = function_of(b, name, program(name, *dtypes), scalars)
    if name == "sincos" and not function.parts and not b.compact:
        function.parts = [function_of(b, part, program(part, *dtypes), scalars) for part in PARTS]
    constants = [x for x in scalars if not isinstance(x, Value)]
    if len(constants) < len(scalars):
        return b.call(function, scalars)
    results = interpret(function, constants)
    return [out.dtype.type(x) for x, out in zip(results, function.results, strict=True)]


@lowers(*SHORT)
def _by_short_way(b: Builder, eqn, *arrays: Elements) -> Elements:
    """Inline the short version, with a call where it fails in some lane, which is rare."""
    name = eqn.name

    def one(*scalars: Scalar) -> Scalar:
        if b.compact or not any(isinstance(x, Value) for x in scalars):
            return _called(b, name, scalars)[0]
        closed = program(f"near_{name}", *(x.dtype for x in scalars))
        near, far = (result[()] for result in lower(b, closed, [filled((), x) for x in scalars]))
        return b.cold_branch(far, lambda: _called(b, name, scalars)[0], near)

    return each(one, *arrays)


@lowers(*PARTS, *(f"jaxsat_{part}" for part in PARTS))
def _sine_or_cosine(b: Builder, eqn, x: Elements) -> Elements:
    """Inline the short version, with a call where it fails in some lane, which is rare."""
    place = PARTS.index(eqn.name.removeprefix("jaxsat_"))
    if b.compact:
        return each(lambda y: _compact(b, place, y), x)

    def one(y: Scalar) -> Scalar:
        def long_way() -> Scalar:
            return _called(b, "sincos", [y])[place]

        if not isinstance(y, Value):
            return long_way()
        results: Any = b.block.find(("near_sincos", y.number))
        if results is None:  # else the builder would share every operation
            closed = program("near_sincos", y.dtype)  # of one alone, the other is dead code
            results = [result[()] for result in lower(b, closed, [filled((), y)])]
            b.block.values["near_sincos", y.number] = results
        return b.cold_branch(results[-1], long_way, results[place])

    return each(one, x)


def _compact(b: Builder, place: int, y: Scalar) -> Scalar:
    """Call sine or cosine as one function, which contains the rare long version."""
    if not isinstance(y, Value):
        return _called(b, "sincos", [y])[place]
    key = (PARTS[place], y.dtype.char, y.uniform)
    if key not in b.functions:
        param, inner = Value(y.dtype, y.uniform), Builder(like=b)
        inner.functions = b.functions
        closed = b.cut(program("near_sincos", y.dtype))
        with b.at(()):
            results = [result[()] for result in lower(inner, closed, [filled((), param)])]
            result = inner.switch(
                inner.convert(results[-1], INT),
                [
                    lambda: [results[place]],
                    lambda: [_called(inner, "sincos", [param])[place]],
                ],
            )[0]
        whole = Function(f"{PARTS[place]}.{y.dtype.char}", [param], inner.block, [result])
        b.functions[key] = without_dead_code(whole)
    return b.call(b.functions[key], [y])[0]


@lowers("integer_pow")
def _integer_pow(b: Builder, eqn, x: Elements) -> Elements:
    return each(lambda x: power(b, x, eqn.parameters["y"]), x)


def power(b: Builder, x: Scalar, exponent: int) -> Scalar:
    """Return x to an integer power, by repeated squaring."""
    one = x.dtype.type(1)
    product, square, bits = None, x, abs(exponent)
    while bits:
        if bits & 1:
            product = square if product is None else b.operation("mul", product, square)
        bits >>= 1
        if bits:
            square = b.operation("mul", square, square)
    if product is None:
        return one
    return b.operation("div", one, product) if exponent < 0 else product
