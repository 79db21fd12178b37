"""Arithmetic operations of programs, with their functions in NumPy and LLVM.

Constant folding, the interpreter and the LLVM printer use the one table `OPERATIONS`. Operands have
one type except where a comment says otherwise.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

BOOL, INT = np.dtype(bool), np.dtype(np.int32)


@dataclass(frozen=True)
class Arithmetic:
    """NumPy's function, and LLVM's words for floats, signed and unsigned (or bool) operands.

    A word that begins with "llvm." is an intrinsic function. `compares` says that the result is a
    bool.
    """

    numpy: Callable
    floating: str | None = None
    signed: str | None = None
    unsigned: str | None = None
    compares: bool = False

    def word(self, dtype: np.dtype) -> str | None:
        """Return LLVM's word for operands of this type."""
        if dtype.kind == "f":
            return self.floating
        return self.signed if dtype.kind == "i" else self.unsigned


def converted(x, dtype: np.dtype):
    """Convert `x` to a type; floats saturate at an integer type's range, NaN becomes zero."""
    x = np.asarray(x)
    if x.dtype.kind == "f" and dtype.kind in "iu":
        info = np.iinfo(dtype)
        inside = np.clip(np.nan_to_num(np.trunc(x), nan=0.0), float(info.min), float(info.max))
        above, below = inside >= float(info.max), inside <= float(info.min)
        plain = np.where(above | below, 0, inside).astype(dtype)
        return np.where(above, dtype.type(info.max), np.where(below, dtype.type(info.min), plain))
    return x.astype(dtype)


def _divide(x, y):
    x = np.asarray(x)
    if x.dtype.kind == "f":
        return x / y
    return (x - np.fmod(x, y)) // y  # towards zero, without the absolute value, which may not be


def _maximum(x, y):
    zeros = (x == 0) & (y == 0)  # NumPy promises no sign of theirs
    return np.where(zeros, np.add(x, y), np.maximum(x, y))


def _minimum(x, y):
    zeros = (x == 0) & (y == 0)
    return np.where(zeros, np.negative(np.subtract(np.negative(x), y)), np.minimum(x, y))


def _shift_right_logical(x, y):
    x = np.asarray(x)
    unsigned = x.dtype.str.replace("i", "u")
    return (x.view(unsigned) >> np.asarray(y).view(unsigned)).view(x.dtype)


def _shift_right_arithmetic(x, y):
    x = np.asarray(x)  # the first bit comes in again, also where it is no sign
    signed = x.dtype.str.replace("u", "i")
    return (x.view(signed) >> np.asarray(y).view(signed)).view(x.dtype)


def _count_ones(x):
    x = np.asarray(x)  # NumPy counts the bits of |x|
    return np.bitwise_count(x.view(x.dtype.str.replace("i", "u"))).astype(x.dtype)


OPERATIONS: dict[str, Arithmetic] = {
    "add": Arithmetic(np.add, "fadd", "add", "add"),
    "sub": Arithmetic(np.subtract, "fsub", "sub", "sub"),
    "mul": Arithmetic(np.multiply, "fmul", "mul", "mul"),
    # whole divisors are neither zero nor minus one; in compact programs signed ones may be: the
    # remainder is zero then, and the quotient zero or -x
    "div": Arithmetic(_divide, "fdiv", "sdiv", "udiv"),
    "rem": Arithmetic(np.fmod, "frem", "srem", "urem"),
    # NaN where either is; -0.0 is less than 0.0
    "max": Arithmetic(_maximum, "llvm.maximum", "llvm.smax", "llvm.umax"),
    "min": Arithmetic(_minimum, "llvm.minimum", "llvm.smin", "llvm.umin"),
    "and": Arithmetic(np.bitwise_and, None, "and", "and"),
    "or": Arithmetic(np.bitwise_or, None, "or", "or"),
    "xor": Arithmetic(np.bitwise_xor, None, "xor", "xor"),
    # shifts are by less than the width
    "shift_left": Arithmetic(np.left_shift, None, "shl", "shl"),
    "shift_right_logical": Arithmetic(_shift_right_logical, None, "lshr", "lshr"),
    "shift_right_arithmetic": Arithmetic(_shift_right_arithmetic, None, "ashr", "ashr"),
    "lt": Arithmetic(np.less, "fcmp olt", "icmp slt", "icmp ult", compares=True),
    "le": Arithmetic(np.less_equal, "fcmp ole", "icmp sle", "icmp ule", compares=True),
    "gt": Arithmetic(np.greater, "fcmp ogt", "icmp sgt", "icmp ugt", compares=True),
    "ge": Arithmetic(np.greater_equal, "fcmp oge", "icmp sge", "icmp uge", compares=True),
    "eq": Arithmetic(np.equal, "fcmp oeq", "icmp eq", "icmp eq", compares=True),
    "ne": Arithmetic(np.not_equal, "fcmp une", "icmp ne", "icmp ne", compares=True),
    "neg": Arithmetic(np.negative, "fneg"),
    "abs": Arithmetic(np.abs, "llvm.fabs"),
    "sqrt": Arithmetic(np.sqrt, "llvm.sqrt"),
    "floor": Arithmetic(np.floor, "llvm.floor"),
    "ceil": Arithmetic(np.ceil, "llvm.ceil"),
    "trunc": Arithmetic(np.trunc, "llvm.trunc"),
    "round_even": Arithmetic(np.rint, "llvm.roundeven"),
    "fma": Arithmetic(lambda x, y, z: x * y + z, "llvm.fma"),
    "copysign": Arithmetic(np.copysign, "llvm.copysign"),
    "population_count": Arithmetic(_count_ones, None, "llvm.ctpop", "llvm.ctpop"),
}
"""Further operations: `select` (a bool, then two of one type), `convert` and `bitcast` (to the
result's type), and `any` (a varying bool to a uniform one)."""


def evaluate(name: str, args: tuple, dtype: np.dtype):
    """Evaluate an operation on NumPy scalars or arrays of lanes; `dtype` is the result's."""
    with np.errstate(all="ignore"):
        match name:
            case "select":
                return np.where(*args)
            case "convert":
                return converted(args[0], dtype)
            case "bitcast":
                return np.asarray(args[0]).view(dtype)
            case "any":
                return np.any(args[0])
        return OPERATIONS[name].numpy(*args)
