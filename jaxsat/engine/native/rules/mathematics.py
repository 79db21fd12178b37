"""Elementary functions: each is written in plain `jax.numpy` and lowered as a function once."""

import numpy as np

from jaxsat.engine.native.builder import Builder
from jaxsat.engine.native.functions import FUNCTIONS, program
from jaxsat.engine.native.interpreter import interpret
from jaxsat.engine.native.ir import Scalar, Value
from jaxsat.engine.native.lowering import Elements, each, function_of, lowers

TOGETHER: dict[str, tuple[str, int]] = {"sin": ("sincos", 0), "cos": ("sincos", 1)}
"""Functions that are one of the results of another: who needs both calls it once."""


@lowers(*FUNCTIONS)
def _written(b: Builder, eqn, *arrays: Elements) -> Elements:
    name, place = TOGETHER.get(eqn.primitive.name, (eqn.primitive.name, 0))
    dtype = np.dtype(eqn.outvars[0].aval.dtype)

    def apply(*scalars: Scalar) -> Scalar:
        closed = program(name, *(x.dtype for x in scalars))
        function = function_of(b, name, closed, scalars)
        if name == "sincos" and not function.parts:
            function.parts = [
                function_of(b, part, program(part, *(x.dtype for x in scalars)), scalars)
                for part in TOGETHER
            ]
        if not any(isinstance(x, Value) for x in scalars):
            return dtype.type(interpret(function, scalars)[place])  # pyright: ignore
        return b.call(function, scalars)[place]

    return each(apply, *arrays)


@lowers("integer_pow")
def _integer_pow(b: Builder, eqn, x: Elements) -> Elements:
    return each(lambda x: power(b, x, eqn.params["y"]), x)


def power(b: Builder, x: Scalar, exponent: int) -> Scalar:
    """x to a whole number, by repeated squaring."""
    one = x.dtype.type(1)
    found, square, left = None, x, abs(exponent)
    while left:
        if left & 1:
            found = square if found is None else b.operation("mul", found, square)
        left >>= 1
        if left:
            square = b.operation("mul", square, square)
    if found is None:
        return one
    return b.operation("div", one, found) if exponent < 0 else found
