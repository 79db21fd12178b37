"""LLVM's words for types and constants."""

import struct

import numpy as np

from jaxsat.compiler.ir import Value
from jaxsat.core.once import once

TYPES = {"float64": "double", "float32": "float", "bool": "i1"} | {
    f"{sign}int{bits}": f"i{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}


@once
def scalar_type(dtype: np.dtype) -> str:
    """The type of one number."""
    return TYPES[dtype.name]


@once
def vector_type(dtype: np.dtype, lanes: int) -> str:
    """The type of a number in every lane."""
    return f"<{lanes} x {scalar_type(dtype)}>"


def type_of(x, lanes: int) -> str:
    """The type of a value of the program; constants are scalars."""
    uniform = not isinstance(x, Value) or x.uniform
    return scalar_type(x.dtype) if uniform else vector_type(x.dtype, lanes)


def memory_type(dtype: np.dtype) -> str:
    """The type of one number in memory."""
    return "i8" if dtype.kind == "b" else scalar_type(dtype)


def constant(x: np.generic) -> str:
    """A number."""
    if x.dtype.kind == "b":
        return "true" if x else "false"
    if x.dtype.kind == "f":
        return f"0x{struct.unpack('<Q', struct.pack('<d', float(x)))[0]:016X}"
    return str(int(x))


def conversion(old: np.dtype, new: np.dtype) -> str:
    """The instruction that makes a number of one type one of another; not of floats to integers."""
    if old.kind == "f":
        return "fptrunc" if new.itemsize < old.itemsize else "fpext"
    if new.kind == "f":
        return "sitofp" if old.kind == "i" else "uitofp"
    if old.kind == "b" or new.itemsize > old.itemsize:
        return "sext" if old.kind == "i" else "zext"
    return "trunc" if new.itemsize < old.itemsize else "bitcast"


def suffix(dtype: np.dtype, lanes: int | None) -> str:
    """The ending of an intrinsic function's name: v16f64 or f64."""
    kind = "f" if dtype.kind == "f" else "i"
    bits = 1 if dtype.kind == "b" else dtype.itemsize * 8
    return f"{kind}{bits}" if lanes is None else f"v{lanes}{kind}{bits}"
