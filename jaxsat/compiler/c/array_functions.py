"""Operations on small arrays as functions of C that are loops: products, sums, least elements."""

from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.ir import Function, Source


def loop_text(function: Function) -> tuple[str, list[str]]:
    """The name and the lines of an operation on arrays."""
    source = function.source
    assert source is not None
    match source.loop:
        case "product":
            return _product_text(function, source)
        case "sum":
            return _sum_text(function, source)
    return _extremum_text(function, source)


def count_of(source: Source) -> list[str]:
    """How many numbers there are, for operations on any number of them."""
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
    """The first number that is not a number comes before all others."""
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
    """The type of the numbers, and its zero."""
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
    given = [f"const {kind} {name}{_dimensions(shape)}" for name, shape in (("x", x), ("y", y))]
    name = _name(x, y, x_free, y_free)
    head = f"static void {name}({', '.join(given)}, {kind} product{_dimensions(out)})"
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


def _dimensions(shape: tuple[int, ...]) -> str:
    return "".join(f"[{n}]" for n in shape)
