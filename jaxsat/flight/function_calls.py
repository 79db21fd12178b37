"""test_functions.c: calls of elementary functions and operations with unusual arguments, such as
infinity, and NumPy's results of them."""

from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.c.expressions import literal
from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.tidying import in_lines
from jaxsat.compiler.interpreter import interpret
from jaxsat.compiler.operations import evaluate
from jaxsat.flight.guard import real_type
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import template

SIZES = (
    0.0, 5e-324, 1e-310, 1e-220, 1e-12, 0.3, 0.5, 1.0, 2.5, 1e7, 1.713e10, 1e22, 1e38, 1.7e308,
    np.inf,
)  # fmt: skip
"""Sizes of arguments, which have both signs, besides NaN. Numbers outside single precision are zero
or infinite there. The reduction of the angle 1.713e10 carries, as that of one in some thousands."""

SHIFTS = (0, 1, 7)
"""Numbers of places by which a whole number is shifted."""


ALIKE = "(x == y) ? (!signbit(x) == !signbit(y)) : ((x != x) && (y != y))"
"""Condition of C that two floats are equal, as zeros with their signs, or no numbers."""


def function_calls(program: FlightProgram, intro: Sequence[str]) -> str:
    """Return test_functions.c; controller.c must have been printed before."""
    real = real_type(program)
    tables, calls = [], []
    for name, function in program.functions.items():
        rows = _rows(function)
        tables += _table(f"of_{name}", real, rows)
        arguments = [f"of_{name}[i][{place}]" for place in range(len(function.params))]
        results = [f"found[{place}]" for place in range(len(function.results))]
        pointers = [] if len(results) == 1 else [f"&{result}" for result in results]
        begin = f"{results[0]} = " if len(results) == 1 else ""
        calls += [f"  for (int i = 0; i < {len(rows)}; i++) {{"]
        calls += [f"    {begin}{name}({', '.join([*arguments, *pointers])});"]
        calls += [
            f"    wrong += same(of_{name}[i][{len(arguments) + place}], {result}) ? 0 : 1;"
            for place, result in enumerate(results)
        ]
        calls += ["  }"]
    for name, (operation, dtype, other) in program.operations.items():
        rows = list(_operands(operation, dtype))
        columns = [np.array(column) for column in zip(*rows, strict=True)]
        results = np.asarray(evaluate(operation, tuple(columns), other)).astype(other)
        tables += _table(f"of_{name}", TYPES[dtype], rows)
        tables += _table(f"from_{name}", TYPES[other], [[result] for result in results])
        arguments = ", ".join(f"of_{name}[i][{place}]" for place in range(len(columns)))
        calls += [
            f"  for (int i = 0; i < {len(rows)}; i++) {{",
            f"    const {TYPES[other]} x = {name}({arguments});",
            f"    const {TYPES[other]} y = from_{name}[i][0];",
            f"    wrong += ({ALIKE if other.kind == 'f' else 'x == y'}) ? 0 : 1;",
            "  }",
        ]
    most = max((len(one.results) for one in program.functions.values()), default=1)
    text = template(
        "test_functions.c",
        TABLES="".join(f"{line}\n" for line in tables),
        REAL=real,
        MOST=most,
        CALLS="".join(f"{line}\n" for line in calls),
    )
    return "\n".join([*intro, text])


def _table(name: str, kind: str, rows: Sequence[Sequence[np.generic]]) -> list[str]:
    """Return a constant array of these rows, and an empty line."""
    lines = [f"static const {kind} {name}[{len(rows)}][{len(rows[0])}] = {{"]
    for row in rows:
        lines += in_lines(f"{{{', '.join(literal(x).text for x in row)}}},", "  ")
    return [*lines, "};", ""]


def _numbers(dtype: np.dtype) -> list[np.generic]:
    """Return unusual numbers of a type."""
    kind: Callable = dtype.type
    if dtype.kind != "f":
        limits = np.iinfo(dtype)
        sizes = {0, 1, 2, 5, -1 if limits.min else 3, int(limits.min), int(limits.max)}
        return [kind(size) for size in sorted(sizes)]
    with np.errstate(over="ignore"):
        numbers = [kind(sign * size) for size in SIZES for sign in (1.0, -1.0)]
    return [*numbers, kind(np.nan)]


def _operands(operation: str, dtype: np.dtype) -> Iterator[tuple[np.generic, ...]]:
    """Return all combinations of operands of an operation."""
    numbers = _numbers(dtype)
    if operation == "convert":
        return product(numbers)
    seconds = [dtype.type(n) for n in SHIFTS] if operation.startswith("shift") else numbers
    return product(numbers, seconds)


def _arguments(function: ir.Function) -> list[tuple[np.generic, ...]]:
    return list(product(_numbers(function.params[0].dtype), repeat=len(function.params)))


def _rows(function: ir.Function) -> list[list[np.generic]]:
    """Return arguments and results, all at once for a program without branches."""
    args = _arguments(function)
    is_straight = all(isinstance(step, ir.Operation) for step in function.block.steps)
    rows = []
    for group in [args] if is_straight else [[one] for one in args]:
        columns = [np.array(column) for column in zip(*group, strict=True)]
        with np.errstate(all="ignore"):
            results = interpret(function, columns)
        columns += [np.broadcast_to(np.ravel(result), len(group)) for result in results]
        rows += [list(row) for row in zip(*columns, strict=True)]
    return rows
