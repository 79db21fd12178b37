"""Small C functions that printed programs call: operations that C has not, or not for all numbers.

Signed whole numbers are added, multiplied and shifted as unsigned ones, so that they wrap where
JAX's do and never overflow, which C leaves undefined.
"""

import numpy as np

TYPES = {
    np.dtype(np.float64): "double",
    np.dtype(np.float32): "float",
    np.dtype(bool): "bool",
    **{np.dtype(f"{k}{n}"): f"{'u' * (k == 'u')}int{8 * n}_t" for k in "iu" for n in (1, 2, 4, 8)},
}
"""C's name of a type of numbers."""

REAL = frozenset(["fabs", "sqrt", "floor", "ceil", "trunc", "rint", "copysign", "fmod"])
"""Functions of math.h whose results are exact or rounded correctly."""


def short(dtype: np.dtype) -> str:
    """A type in the names of helpers."""
    return {"f": "f", "i": "i", "u": "u", "b": "b"}[dtype.kind] + str(8 * dtype.itemsize)


def unsigned(dtype: np.dtype) -> np.dtype:
    """The unsigned type of the same width."""
    return np.dtype(f"u{dtype.itemsize}")


def _signature(result: str, name: str, params: str) -> str:
    return f"static {result} {name}({params})"


def helper(name: str, dtype: np.dtype, other: np.dtype | None = None) -> tuple[str, str, list]:
    """Name and text of a helper for operands of a type, and the helpers that it needs itself.

    `other` is the type of the result where that differs.
    """
    c = TYPES[dtype]
    full = f"{name}_{short(dtype)}"
    match name:
        case "maximum" | "minimum" if dtype.kind == "f":
            return full, _extremum(name, full, c), []
        case "maximum" | "minimum":
            sign = ">" if name == "maximum" else "<"
            body = f"return (x {sign} y) ? x : y;"
            return full, _one_line(c, full, f"{c} x, {c} y", body), []
        case "add" | "sub" | "mul":
            sign = {"add": "+", "sub": "-", "mul": "*"}[name]
            u = TYPES[unsigned(dtype)]
            wrap = "signed_of", unsigned(dtype), None
            body = f"return {helper(*wrap)[0]}(({u})(({u})x {sign} ({u})y));"
            return full, _one_line(c, full, f"{c} x, {c} y", body), [wrap]
        case "shift_left" | "shift_right_logical":
            sign = "<<" if name == "shift_left" else ">>"
            u = TYPES[unsigned(dtype)]
            wrap = "signed_of", unsigned(dtype), None
            body = f"return {helper(*wrap)[0]}(({u})(({u})x {sign} ({u})count));"
            return full, _one_line(c, full, f"{c} x, {c} count", body), [wrap]
        case "shift_right_arithmetic":
            u = TYPES[unsigned(dtype)]
            wrap = "signed_of", unsigned(dtype), None
            signed = helper(*wrap)[0]
            lines = [
                f"{_signature(c, full, f'{c} x, {c} count')}",
                "{",
                f"  const {u} bits = ({u})x;",
                f"  const {u} moved = (x < 0) ? ({u})~(({u})~bits >> ({u})count)"
                f" : ({u})(bits >> ({u})count);",
                f"  return {signed}(moved);",
                "}",
            ]
            return full, "\n".join(lines), [wrap]
        case "signed_of":
            signed = TYPES[np.dtype(f"i{dtype.itemsize}")]
            return full, _copied(full, c, signed), []
        case "bits":
            assert other is not None
            full = f"bits_{short(dtype)}_{short(other)}"
            return full, _copied(full, c, TYPES[other]), []
        case "whole":
            assert other is not None
            full = f"whole_{short(dtype)}_{short(other)}"
            return full, _saturated(full, dtype, other), []
        case "population_count":
            u = TYPES[unsigned(dtype)]
            lines = [
                f"{_signature(c, full, f'{c} x')}",
                "{",
                f"  {u} bits = ({u})x;",
                f"  {c} count = 0;",
                f"  for (int32_t i = 0; i < {8 * dtype.itemsize}; i++) {{",
                f"    count = ({c})(count + ({c})(bits & 1u));",
                f"    bits = ({u})(bits >> 1);",
                "  }",
                "  return count;",
                "}",
            ]
            return full, "\n".join(lines), []
    raise KeyError(name)


def _one_line(result: str, name: str, params: str, body: str) -> str:
    return f"{_signature(result, name, params)}\n{{\n  {body}\n}}"


def _extremum(name: str, full: str, c: str) -> str:
    """NaN where either is, and -0.0 below 0.0."""
    sign, other = (">", "<") if name == "maximum" else ("<", ">")
    last = "(x + y)" if name == "maximum" else "-((-x) - y)"
    lines = [
        _signature(c, full, f"{c} x, {c} y"),
        "{",
        f"  const {c} same = ((x == y) && (x != {_zero(c)})) ? x : {last};"
        " /* zeros, not a number */",
        f"  return (x {sign} y) ? x : ((x {other} y) ? y : same);",
        "}",
    ]
    return "\n".join(lines)


def _zero(c: str) -> str:
    return "0.0F" if c == "float" else "0.0"


def _copied(name: str, before: str, after: str) -> str:
    lines = [
        f"{_signature(after, name, f'{before} x')}",
        "{",
        f"  {after} found;",
        "  (void)memcpy(&found, &x, sizeof(found));",
        "  return found;",
        "}",
    ]
    return "\n".join(lines)


def _saturated(name: str, dtype: np.dtype, other: np.dtype) -> str:
    """Towards zero; beyond the range its end, zero for NaN."""
    c, whole, info = TYPES[dtype], TYPES[other], np.iinfo(other)
    top, bottom = (repr(float(end)) + ("F" if c == "float" else "") for end in (info.max, info.min))
    word = f"{'U' * (other.kind == 'u')}INT{info.bits}"
    least = "0" if other.kind == "u" else f"{word}_MIN"
    lines = [
        f"{_signature(whole, name, f'{c} x')}",
        "{",
        f"  {whole} found = 0;",
        f"  if (x >= {top}) {{",
        f"    found = {word}_MAX;",
        f"  }} else if (x <= {bottom}) {{",
        f"    found = {least};",
        "  } else if (x == x) {",
        f"    found = ({whole})x;",
        "  } else {",
        "    /* not a number */",
        "  }",
        "  return found;",
        "}",
    ]
    return "\n".join(lines)
