"""Test calls: each row is one call of an entry point with its own parameters.

A row has the index of the entry point, parameters, the first attitude if there is an estimator,
input and state; expected are outputs (zero where the entry point has none), then state.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any

import jax
import numpy as np
from jaxtyping import Float, PyTree

from jaxsat.compiler import ir
from jaxsat.compiler.c.expressions import literal
from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.tidying import in_lines
from jaxsat.compiler.interpreter import interpret
from jaxsat.compiler.operations import evaluate
from jaxsat.flight.flight import Input, State
from jaxsat.flight.guard import real_type
from jaxsat.flight.interface import Parameter
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.reference import Reference
from jaxsat.flight.templates import template

EXTREMES = (
    0.0, -0.0, 1.0, -1.0, 1e-300, -1e-300, 1e-12, 1e12, 1e300, -1e300, np.inf, -np.inf, np.nan,
    np.pi, -np.pi, 2.0**14, 2.0**20, 5e-324,
)  # fmt: skip


STEP, INIT, COAST = 0, 1, 2
"""Indices of the entry points."""

TABLES = 64
"""Number of drawn tables of parameters."""

BEGUN = 128
"""Calls of `controller_init`, and of `controller_coast`, with the scenario's parameters."""


def call_sizes(program: FlightProgram) -> dict[str, int]:
    """Return the parts of a row in order, with their numbers of elements."""
    structs = program.structs
    return {
        "kind": 1,
        "parameters": structs["parameters"].size,
        "attitude": 4 * program.estimates,
        "input": structs["input"].size,
        "state": structs["state"].size,
    }


def drawn_calls(
    program: FlightProgram,
    of_parameters: Sequence[Parameter],
    samples: Float[np.ndarray, "n given"],
    seed: int = 0,
) -> Float[np.ndarray, "calls numbers"]:
    """Draw calls of every entry point, at inputs and states (rows) of samples.

    Parameters are the scenario's, drawn over their ranges, and at their bounds.
    """
    rng = np.random.default_rng(seed)
    default = _row([np.asarray(one.default, float) for one in of_parameters])
    others = (INIT, *([COAST] if program.estimates else []))
    plan = [(kind, default) for kind in others for _ in range(BEGUN)]
    for number in range(TABLES):
        draw = _at_bounds if number % 2 else _over_range
        table = _row([draw(rng, one) for one in of_parameters])
        plan += [(kind, table) for kind in (STEP, STEP, *others)]
    rows = samples[rng.integers(0, len(samples), len(plan))]
    attitudes = rng.normal(size=(len(plan), call_sizes(program)["attitude"]))
    if program.estimates:
        attitudes /= np.linalg.norm(attitudes, axis=1, keepdims=True)
        struck = rng.random(attitudes.shape) < 0.05
        attitudes = np.where(struck, rng.choice(EXTREMES, attitudes.shape), attitudes)
    kinds = np.array([kind for kind, _ in plan], float)[:, None]
    tables = np.stack([table for _, table in plan])
    return np.concatenate([kinds, tables, attitudes, rows], axis=1)


def expected_of_calls(
    reference: Reference, rows: Float[np.ndarray, "calls numbers"]
) -> Float[np.ndarray, "calls expected"]:
    """Return the expected results of these calls: rows of outputs, then of the next state."""
    program = reference.program
    sizes = call_sizes(program)
    kinds, tables, attitudes, inputs, states = np.split(
        rows, np.cumsum(list(sizes.values()))[:-1], axis=1
    )
    expectations = np.zeros((len(rows), program.structs["output"].size + sizes["state"]))
    groups: dict[bytes, list[int]] = {}
    for number, row in enumerate(rows):
        groups.setdefault(row[: 1 + sizes["parameters"]].tobytes(), []).append(number)
    for numbers in groups.values():
        kind = kinds[numbers[0], 0]
        with np.errstate(all="ignore"):
            table = _parameters(program, tables[numbers[0]])
            now, state = trees_of(program, inputs[numbers], states[numbers])
        if kind == STEP:
            expectations[numbers] = reference.step(now, state, table)
        elif kind == INIT:
            expectations[numbers, -sizes["state"] :] = reference.begin(
                attitudes[numbers], now, table
            )
        else:
            expectations[numbers, -sizes["state"] :] = reference.coast(now, state, table)
    return expectations


def _row(arrays: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.zeros(0), *(array.ravel().astype(float) for array in arrays)])


def _over_range(rng: np.random.Generator, one: Parameter) -> np.ndarray:
    """Draw a parameter over its declared range; without one, from half its default to the double,
    and a whole number over `whole_range`."""
    value, shape = np.asarray(one.default, float), one.field.shape
    if one.field.dtype.kind == "i":
        least, most = whole_range(one)
        return rng.integers(least, most, shape, endpoint=True).astype(float)
    if one.bounds is None:
        return value
    if one.key is None:
        with np.errstate(over="ignore"):
            return np.asarray(np.clip(value * 2 ** rng.uniform(-1, 1, shape), *one.bounds))
    least, most = (float(bound) for bound in one.bounds)
    if least > 0:
        sizes = np.exp(rng.uniform(np.log(least), np.log(most), shape))
    else:
        sizes = rng.uniform(least, most, shape)
    return np.asarray(np.clip(sizes, least, most))


def whole_range(one: Parameter) -> tuple[int, int]:
    """Return the bounds of a parameter of whole numbers, one wider at both ends, and from -1 at
    most: an index out of its table and the divisors 0 and -1 are tested, too."""
    assert one.bounds is not None
    limits = np.iinfo(one.field.dtype)
    least, most = map(int, one.bounds)
    return max(min(least - 1, -1), int(limits.min)), min(most + 1, int(limits.max))


def _at_bounds(rng: np.random.Generator, one: Parameter) -> np.ndarray:
    """Draw each element of a parameter as a declared bound or its default."""
    value = np.asarray(one.default, float)
    if one.bounds is None or one.key is None:
        return value
    least, most = (np.full(value.shape, bound, float) for bound in one.bounds)
    return np.asarray(np.choose(rng.integers(0, 3, value.shape), [least, value, most]))


def _parameters(program: FlightProgram, row: np.ndarray) -> list[np.ndarray]:
    """Return the program's arrays with the numbers of a row in place of its own."""
    arrays = [np.asarray(array) for array in program.parameters]
    place = 0
    for field in program.structs["parameters"].fields:
        part = row[place : place + field.size].reshape(field.shape)
        arrays[field.number] = part.astype(arrays[field.number].dtype)
        place += field.size
    return arrays


def trees_of(program: FlightProgram, inputs: np.ndarray, states: np.ndarray) -> tuple[Input, State]:
    """Return rows of inputs and states as trees of arrays with a leading axis."""
    now = unpacked(inputs, program.now)
    state = unpacked(states[:, :-1], program.start_state)
    begin: Any = states[:, -1].astype(np.int32)
    return now, state._replace(begin_sample=begin)


def unpacked(rows: np.ndarray, like: PyTree, shape: tuple[int, ...] | None = None) -> PyTree:
    """Return rows as a tree of arrays like these, with a leading axis before theirs.

    With a `shape` the arrays have its axes already, in place of the leading one.
    """
    before, axes = ((len(rows),), 0) if shape is None else (shape, len(shape))
    leaves, structure = jax.tree.flatten(like)
    arrays, place = [], 0
    for leaf in leaves:
        size = math.prod(leaf.shape[axes:])
        part = rows[:, place : place + size].reshape((*before, *leaf.shape[axes:]))
        arrays.append((part != 0) if leaf.dtype == bool else part.astype(leaf.dtype))
        place += size
    return jax.tree.unflatten(structure, arrays)


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


def _rows(function: ir.Function) -> list[list[np.generic]]:
    """Return arguments and results, all at once for a program without branches."""
    args = list(product(_numbers(function.params[0].dtype), repeat=len(function.params)))
    is_straight = all(isinstance(step, ir.Operation) for step in function.block.steps)
    rows = []
    for group in [args] if is_straight else [[one] for one in args]:
        columns = [np.array(column) for column in zip(*group, strict=True)]
        with np.errstate(all="ignore"):
            results = interpret(function, columns)
        columns += [np.broadcast_to(np.ravel(result), len(group)) for result in results]
        rows += [list(row) for row in zip(*columns, strict=True)]
    return rows
