"""Small C functions that printed programs call.

They are operations that C lacks, or lacks for some numbers, and operations on small arrays as loops
(products, sums, least elements). Signed integers are added, multiplied and shifted as unsigned
ones, so that they wrap like JAX's and never overflow, which C leaves undefined.
"""

import numpy as np

from jaxsat.compiler.c.tidying import dimensions
from jaxsat.compiler.ir import Function, Source

TYPES = {
    np.dtype(np.float64): "double",
    np.dtype(np.float32): "float",
    np.dtype(bool): "bool",
    **{np.dtype(f"{k}{n}"): f"{'u' * (k == 'u')}int{8 * n}_t" for k in "iu" for n in (1, 2, 4, 8)},
}
"""C's name of a type of numbers."""


def short(dtype: np.dtype) -> str:
    """Return a type's abbreviation in the names of helpers."""
    return {"f": "f", "i": "i", "u": "u", "b": "b"}[dtype.kind] + str(8 * dtype.itemsize)


def unsigned(dtype: np.dtype) -> np.dtype:
    """Return the unsigned type of the same width."""
    return np.dtype(f"u{dtype.itemsize}")


def least(dtype: np.dtype) -> str:
    """Return the least number of a signed type, whose macro is an expression of another type."""
    return f"({TYPES[dtype]})INT{8 * dtype.itemsize}_MIN"


def _signature(result: str, name: str, params: str) -> str:
    return f"static {result} {name}({params})"


_WRAPPED = {
    "add": ("+", "y"),
    "sub": ("-", "y"),
    "mul": ("*", "y"),
    "shift_left": ("<<", "count"),
    "shift_right_logical": (">>", "count"),
}
"""Signs and second operands of operations on unsigned numbers."""


DECIDES = {
    "maximum": "max",
    "minimum": "min",
    "whole": "convert",
    "quotient": "div",
    "remainder": "rem",
    "shift_right_arithmetic": "shift_right_arithmetic",
}
"""Helpers that have branches, and the operation that each is."""


def helper(name: str, dtype: np.dtype, other: np.dtype | None = None) -> tuple[str, str, list]:
    """Return name and text of a helper for operands of a type, and the helpers that it needs.

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
        case "add" | "sub" | "mul" | "shift_left" | "shift_right_logical":
            sign, second = _WRAPPED[name]
            u = TYPES[unsigned(dtype)]
            wrap = "signed_of", unsigned(dtype), None
            body = f"return {helper(*wrap)[0]}(({u})(({u})x {sign} ({u}){second}));"
            return full, _one_line(c, full, f"{c} x, {c} {second}", body), [wrap]
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
        case "quotient" | "remainder":
            negation = "sub", dtype, None
            needs = [negation] if name == "quotient" else []
            return full, _divided(name, full, c, helper(*negation)[0]), needs
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
    """Return the larger or smaller of two floats: NaN where either is, and -0.0 below 0.0."""
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


def _divided(name: str, full: str, c: str, minus: str) -> str:
    """Return a division by any number, in branches of divisors among which zero is not."""
    sign, rest = ("/", f"(y == 0) ? 0 : {minus}(0, x)") if name == "quotient" else ("%", "0")
    lines = [
        _signature(c, full, f"{c} x, {c} y"),
        "{",
        f"  {c} found;",
        "  if (y > 0) {",
        f"    found = ({c})(x {sign} y);",
        "  } else if (y < -1) {",
        f"    found = ({c})(x {sign} y);",
        "  } else { /* 0, by which none divides, or -1, which may overflow */",
        f"    found = {rest};",
        "  }",
        "  return found;",
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
    """Return a float cut towards zero to an integer: beyond the range its end, zero for NaN."""
    c, whole, info = TYPES[dtype], TYPES[other], np.iinfo(other)
    top, bottom = (repr(float(end)) + ("F" if c == "float" else "") for end in (info.max, info.min))
    word = f"{'U' * (other.kind == 'u')}INT{info.bits}"
    lines = [
        f"{_signature(whole, name, f'{c} x')}",
        "{",
        f"  {whole} found = 0;",
        f"  if (x >= {top}) {{",
        f"    found = {word}_MAX;",
        f"  }} else if (x <= {bottom}) {{",
        f"    found = {'0' if other.kind == 'u' else least(other)};",
        "  } else if (x == x) {",
        f"    found = ({whole})x;",
        "  } else {",
        "    /* not a number */",
        "  }",
        "  return found;",
        "}",
    ]
    return "\n".join(lines)


def loop_text(function: Function) -> tuple[str, list[str]]:
    """Return the name and the lines of an operation on arrays."""
    source = function.source
    assert source is not None
    match source.loop:
        case "product":
            return _product_text(function, source)
        case "sum":
            return _sum_text(function, source)
    return _extremum_text(function, source)


def count_of(source: Source) -> list[str]:
    """Return the element count as an argument, for operations on any number of elements."""
    flat = all(len(shape) == 1 for shape in source.params)
    return [str(source.params[0][0])] if flat else []


def _sum_text(function: Function, source: Source) -> tuple[str, list[str]]:
    kind, zero = _kind(function)
    return "sum", [
        f"static {kind} sum(int32_t count, const {kind} x[])",
        "{",
        f"  {kind} sum = {zero};",
        f"  {_loop('i', 'count')}",
        "    sum += x[i];",
        "  }",
        "  return sum;",
        "}",
    ]


def _extremum_text(function: Function, source: Source) -> tuple[str, list[str]]:
    """Return the search for the first extremum; NaN precedes all other numbers."""
    kind, _ = _kind(function)
    whole = TYPES[function.results[0].dtype]
    sign = "<" if source.loop == "argmin" else ">"
    return source.loop, [
        f"static {whole} {source.loop}(int32_t count, const {kind} x[])",
        "{",
        f"  {whole} best = 0;",
        f"  for ({whole} i = 1; i < count; i++) {{",
        f"    if ((x[i] {sign} x[best]) || ((x[i] != x[i]) && (x[best] == x[best]))) {{",
        "      best = i;",
        "    }",
        "  }",
        "  return best;",
        "}",
    ]


def _kind(function: Function) -> tuple[str, str]:
    dtype = function.params[0].dtype
    return TYPES[dtype], "0.0F" if dtype.itemsize == 4 else "0.0"


def _product_text(function: Function, source: Source) -> tuple[str, list[str]]:
    (x, y), (out,) = source.params, source.results
    kind, zero = _kind(function)
    if not out:
        return "dot", [
            f"static {kind} dot(int32_t count, const {kind} x[], const {kind} y[])",
            "{",
            f"  {kind} sum = {zero};",
            f"  {_loop('k', 'count')}",
            "    sum += x[k] * y[k];",
            "  }",
            "  return sum;",
            "}",
        ]
    x_axis, y_axis = source.axes
    x_free = "".join("i" if axis != x_axis else "k" for axis in range(len(x)))
    y_free = "".join("j" if axis != y_axis else "k" for axis in range(len(y)))
    parameters = [f"const {kind} {name}{dimensions(shape)}" for name, shape in (("x", x), ("y", y))]
    name = _name(x, y, x_free, y_free)
    head = f"static void {name}({', '.join(parameters)}, {kind} product{dimensions(out)})"
    loops = [(letter, size) for letter, size in zip(x_free, x, strict=True) if letter == "i"]
    loops += [(letter, size) for letter, size in zip(y_free, y, strict=True) if letter == "j"]
    lines, indent = ["{"], "  "
    for letter, size in loops:
        lines.append(f"{indent}{_loop(letter, size)}")
        indent += "  "
    lines += [
        f"{indent}{kind} sum = {zero};",
        f"{indent}{_loop('k', x[x_axis])}",
        f"{indent}  sum += x{_index(x_free)} * y{_index(y_free)};",
        f"{indent}}}",
    ]
    place = "".join(f"[{letter}]" for letter, _ in loops)
    lines.append(f"{indent}product{place} = sum;")
    lines += ["  " * depth + "}" for depth in range(len(loops), -1, -1)]
    return name, [head, *lines]


def _name(x: tuple[int, ...], y: tuple[int, ...], x_free: str, y_free: str) -> str:
    words = ["product"]
    for shape, letters, plain in ((x, x_free, "ik"), (y, y_free, "kj")):
        words.append("x".join(map(str, shape)))
        if len(shape) == 2 and letters != plain:
            words.append("transposed")
    return "_".join(words)


def _loop(letter: str, size: int | str) -> str:
    return f"for (int32_t {letter} = 0; {letter} < {size}; {letter}++) {{"


def _index(letters: str) -> str:
    return "".join(f"[{letter}]" for letter in letters)
