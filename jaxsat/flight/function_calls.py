"""test_functions.c: calls of elementary functions with unusual arguments, such as infinity, and
NumPy's results of their programs."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.c.expressions import literal
from jaxsat.compiler.c.tidying import in_lines
from jaxsat.compiler.interpreter import interpret
from jaxsat.flight.guard import real_type
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import template

SIZES = (0.0, 5e-324, 1e-310, 1e-220, 1e-12, 0.3, 0.5, 1.0, 2.5, 1e7, 1e22, 1e38, 1.7e308, np.inf)
"""Sizes of arguments, which have both signs, besides NaN. Numbers outside single precision are zero
or infinite there."""


def function_calls(program: FlightProgram, intro: Sequence[str]) -> str:
    """Return test_functions.c; controller.c must have been printed before."""
    real = real_type(program)
    tables, calls = [], []
    for name, function in program.functions.items():
        rows = _rows(function)
        columns = len(rows[0])
        tables.append(f"static const {real} of_{name}[{len(rows)}][{columns}] = {{")
        for row in rows:
            tables += in_lines(f"{{{', '.join(literal(x).text for x in row)}}},", "  ")
        tables += ["};", ""]
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
    most = max((len(one.results) for one in program.functions.values()), default=1)
    text = template(
        "test_functions.c",
        TABLES="".join(f"{line}\n" for line in tables),
        REAL=real,
        MOST=most,
        CALLS="".join(f"{line}\n" for line in calls),
    )
    return "\n".join([*intro, text])


def _arguments(function: ir.Function) -> list[tuple[np.generic, ...]]:
    kind = function.params[0].dtype.type
    with np.errstate(over="ignore"):
        numbers = [kind(sign * size) for size in SIZES for sign in (1.0, -1.0)]
    return list(product([*numbers, kind(np.nan)], repeat=len(function.params)))


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
