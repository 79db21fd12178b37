"""Numbers at which arithmetic goes wrong, for every type of numbers of the compiled engine."""

from itertools import product

import numpy as np
from jax import lax

FLOATS = tuple(map(np.dtype, (np.float64, np.float32)))
SIGNED = tuple(map(np.dtype, (np.int8, np.int16, np.int32, np.int64)))
UNSIGNED = tuple(map(np.dtype, (np.uint8, np.uint16, np.uint32, np.uint64)))
BOOLS = (np.dtype(bool),)
WHOLE = SIGNED + UNSIGNED
NUMBERS = FLOATS + WHOLE
ALL = NUMBERS + BOOLS

LATER = ("stack", "unstack", "log2", "one_minus_square", "polynomial")
"""Primitives that JAX has had since 0.10.1 or later."""

MISSING = {name for name in LATER if not hasattr(lax, f"{name}_p")}
"""Those that this JAX does not have."""


def edge_values(dtype: np.dtype) -> np.ndarray:
    """About 40 of a type: the ends, zeros, ones, halves, powers of two and their neighbours."""
    if dtype.kind == "b":
        return np.array([False, True])
    return _floats(dtype) if dtype.kind == "f" else _whole(dtype)


def edge_pairs(dtype: np.dtype, other: np.dtype | None = None) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of them."""
    values = edge_values(dtype), edge_values(dtype if other is None else other)
    x, y = zip(*product(*values), strict=True)
    return np.array(x, dtype), np.array(y, values[1].dtype)


def _floats(dtype: np.dtype) -> np.ndarray:
    info = np.finfo(dtype)
    one, most = dtype.type(1), info.max
    below_half = np.nextafter(dtype.type(0.5), dtype.type(0))
    positive = [
        0.0, info.smallest_subnormal, info.smallest_normal - info.smallest_subnormal,
        info.smallest_normal, info.eps, below_half, 0.5, 1 - info.epsneg, 1.0, 1 + info.eps, 1.5,
        2.0, 2.5, 3.0, 127.5, 255.5, 2.0**15, 2.0**31, np.nextafter(dtype.type(2.0**31), one),
        2.0**32, 2.0 ** (info.nmant + 1) - 1, 2.0**63, np.nextafter(dtype.type(2.0**64), one),
        np.sqrt(most), most, np.inf,
    ]  # fmt: skip
    least = [-x for x in positive if x in (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, np.inf, most)]
    others = [-below_half, -info.smallest_subnormal, -(2.0**31), -(2.0**63), np.nan]
    return np.array([*positive, *least, *others], dtype)


def _whole(dtype: np.dtype) -> np.ndarray:
    info, width = np.iinfo(dtype), 8 * dtype.itemsize
    half = 1 << (width // 2)
    numbers = {0, 1, 2, 3, 5, 7, 10, width - 1, width, width + 1, half - 1, half, half + 1, 100}
    numbers |= {info.max, info.max - 1, info.max // 2, info.max // 2 + 1, info.max // 3}
    numbers |= {-x for x in numbers} | {info.min, info.min + 1, info.min // 2, info.min // 2 - 1}
    return np.array(sorted(x for x in numbers if info.min <= x <= info.max), dtype)
