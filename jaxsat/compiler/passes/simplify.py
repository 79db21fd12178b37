"""Values that are there already in place of operations: neutral and absorbing numbers."""

import numpy as np

from jaxsat.compiler.ir import Scalar, Value
from jaxsat.compiler.operations import BOOL


def identity(x: Scalar):
    """What is the same for the same value or constant."""
    return x.number if isinstance(x, Value) else (x.dtype.char, x.tobytes())


def _is(x: Scalar, number) -> bool:
    """Whether `x` is this constant, the sign of zero included."""
    if isinstance(x, Value) or x != number:
        return False
    return x.dtype.kind != "f" or bool(np.signbit(x) == np.signbit(number))


def simplified(name: str, args: tuple[Scalar, ...], dtype: np.dtype) -> Scalar | None:
    """A value that is there already and equal in all bits, or None."""
    floating = dtype.kind == "f"
    match name, args:
        case "select", (predicate, yes, no):
            if not isinstance(predicate, Value):
                return yes if predicate else no
            return yes if identity(yes) == identity(no) else None
        case "convert" | "bitcast", (x,):
            return x if x.dtype == dtype else None
        case "mul", (x, y):
            return _with_neutral(x, y, 1) or (None if floating else _with_absorbing(x, y, 0))
        case "div", (x, y):
            return x if _is(y, 1) else None
        case "add", (x, y):
            return _with_neutral(x, y, -0.0 if floating else 0)
        case "sub", (x, y):
            return x if _is(y, 0.0 if floating else 0) else None
        case "and", (x, y):
            full = True if dtype == BOOL else np.invert(dtype.type(0))
            return _with_neutral(x, y, full) or _with_absorbing(x, y, False if dtype == BOOL else 0)
        case "or", (x, y):
            nothing = False if dtype == BOOL else 0
            absorbing = _with_absorbing(x, y, True) if dtype == BOOL else None
            return _with_neutral(x, y, nothing) or absorbing
        case "min" | "max", (x, y):
            return x if identity(x) == identity(y) else None
        case "xor", (x, y):
            return _with_neutral(x, y, False if dtype == BOOL else 0)
        case "shift_left" | "shift_right_logical" | "shift_right_arithmetic", (x, y):
            return x if _is(y, 0) else None
    return None


def _with_neutral(x: Scalar, y: Scalar, neutral) -> Scalar | None:
    if _is(y, neutral):
        return x
    return y if _is(x, neutral) else None


def _with_absorbing(x: Scalar, y: Scalar, absorbing) -> Scalar | None:
    if _is(y, absorbing):
        return y
    return x if _is(x, absorbing) else None
