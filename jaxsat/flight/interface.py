"""icd.csv and icd.md: every field of the C structures, with type, size, unit, range and rate."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np

from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.layout import Field
from jaxsat.core.declaration.keys import Key, Numeric
from jaxsat.core.declaration.sensors import HOLD_SAMPLES
from jaxsat.core.text import csv_text
from jaxsat.flight.flight import UNITS, FlightController, as_type
from jaxsat.flight.guard import (
    NORM_TOLERANCE,
    RATE_LIMIT,
    groups,
    is_quaternion,
    is_rate,
    is_vector,
    real_type,
    status_bits,
)
from jaxsat.flight.program import FlightProgram, is_parameter

PLAN = "law.plan."
"""Begin of the paths of a plan's parameters."""


@dataclass(frozen=True)
class Parameter:
    """A field of `controller_parameters` with its default and inclusive bounds of its elements.

    `key` is the declared key of `[control]`, or of a plan, whose number it is, or None. A float
    without declared bounds must be finite. A whole number without them, such as an index of a
    table, is one of its enumeration, or within those of the scenario. Bounds contain the default,
    also where it is infinite; `bounds` is None for other types, or where a default is NaN.
    """

    field: Field
    default: np.ndarray
    key: Key | None

    @property
    def bounds(self) -> tuple[np.number, np.number] | None:
        """Least and largest value, in the type of the field."""
        if self.field.dtype.kind not in "fi" or np.isnan(self.default).any():
            return None
        kind = self.field.dtype.type
        least, most = self._stated()
        return kind(min(least, self.default.min())), kind(max(most, self.default.max()))

    def _stated(self) -> tuple[np.number | int, np.number | int]:
        """Return the bounds by the key, the enumeration or the type."""
        kind, real = self.field.dtype.type, self.field.dtype.kind == "f"
        limits = np.finfo(kind) if real else np.iinfo(kind)
        key = None if self.key is None else self.key.kind
        if isinstance(key, Numeric):
            most = min(key.at_most, limits.max)
            if key.at_least is not None:
                least = kind(key.at_least) if real else math.ceil(key.at_least)
            elif key.above is not None:
                above = math.floor(key.above) + 1
                least = np.nextafter(kind(key.above), kind(np.inf)) if real else above
            else:
                least = limits.min
            return max(least, limits.min), kind(most)
        if real:
            return limits.min, limits.max
        numbers = [*map(int, self.field.choices or ()), *self.default.ravel()]
        return min(numbers), max(numbers)

    @property
    def range(self) -> str:
        """Text of the bounds."""
        if self.bounds is None:
            return "false, true" if self.field.dtype.kind == "b" else "any"
        least, most = self.bounds
        if self.field.dtype.kind == "i":
            return names_of(self.field) or f"{least} to {most}"
        largest = np.finfo(self.field.dtype).max
        if (least, most) == (-largest, largest):
            return "finite"
        low = "above 0" if 0 < least <= np.nextafter(least * 0, least) else f"{least:.9g}"
        return f"{low} to {most:.9g}"


def parameters(program: FlightProgram, loop: object, keys: Sequence[Key]) -> list[Parameter]:
    """Return all parameters of a program in the structure's order; `keys` are those of its law."""
    flight = FlightController.of(loop)
    keys = [*keys, *flight.law.plan_keys]
    arrays = eqx.filter(as_type(flight, np.float64), is_parameter)
    paths = jax.tree_util.tree_leaves_with_path(arrays)
    number_of = {
        jax.tree_util.keystr(path): number
        for (path, _), number in zip(paths, program.order, strict=True)
    }
    key_of = {number_of.get(f".law.{key.tunable}"): key for key in keys if key.tunable}
    return [
        Parameter(field, np.asarray(program.parameters[field.number]), key_of.get(field.number))
        for field in program.structs["parameters"].fields
    ]


def is_of_plan(field: Field) -> bool:
    """Whether a parameter is a part of a plan."""
    return field.path.startswith(PLAN)


class Row(NamedTuple):
    """Row of the document for one field: `bytes` without padding, `rate` in calls."""

    structure: str
    name: str
    path: str
    type: str
    dimensions: str
    bytes: int
    unit: str
    range: str
    validity: str
    rate: str


def rows(
    program: FlightProgram, of_parameters: Sequence[Parameter], hold_samples: int = HOLD_SAMPLES
) -> list[Row]:
    """Return all rows, structure by structure in the order of their fields.

    `hold_samples` is the default of that parameter of the guard.
    """
    period = f"every {float(np.asarray(program.period)):.9g} s"
    table = [
        _row("controller_input", field, _unit(field), *_judged(field), period)
        for field in program.structs["input"].fields
    ]
    table += [
        Row("controller_validity", group.name, group.name, "bool", "", 1, "", "false, true",
            "as the sensor tells", period)
        for group in groups(program)
    ]  # fmt: skip
    for parameter in of_parameters:
        key = parameter.key
        unit = "" if key is None else key.unit or ""
        path = parameter.field.path
        if key is not None and not is_of_plan(parameter.field):
            path = f"control.{key.name}"
        row = _row("controller_parameters", parameter.field, unit, parameter.range,
                   "controller_check_parameters", "once")  # fmt: skip
        table.append(row._replace(path=path))
    table += _limits(program, hold_samples)
    outputs = program.structs["output"].fields
    table += [
        _row("controller_output", field, _unit(field), names_of(field) or "finite",
             "finite", period)
        for field in outputs
    ]  # fmt: skip
    bits = status_bits(program).values()
    status = f"sum of bits up to {sum(number for number, _ in bits)}"
    table.append(
        Row("controller_guard_step", "status", "status", "uint32_t", "", 4, "", status,
            "always", period)
    )  # fmt: skip
    return table + [
        _row(
            "controller_state",
            field,
            _unit(field),
            names_of(field) or "any",
            "not NaN",
            period,
        )
        for field in program.structs["state"].fields
    ]


def _row(structure: str, field: Field, unit: str, span: str, validity: str, rate: str) -> Row:
    dimensions = " x ".join(map(str, field.shape))
    size = field.size * field.dtype.itemsize
    kind = TYPES[field.dtype]
    return Row(
        structure, field.name, field.path, kind, dimensions, size, unit, span, validity, rate
    )


def _unit(field: Field) -> str:
    if field.dtype.kind == "b":
        return ""
    return UNITS.get(field.path.split(".")[0], "")


def _judged(field: Field) -> tuple[str, str]:
    """Return the range of an input, and the condition of its validity."""
    if is_quaternion(field):
        return "-1 to 1", f"square of the norm within {NORM_TOLERANCE:g} of 1"
    if is_rate(field):
        return f"{-RATE_LIMIT:g} to {RATE_LIMIT:g}", "within the range"
    if field.dtype.kind == "b":
        return "false, true", "always"
    if is_vector(field):
        return "finite", "finite, not zero"
    if field.path == "sample":
        return "any", "later than the last one; may wrap around"
    return "finite", "finite"


def names_of(field: Field) -> str:
    """Return the numbers of an enumeration and their names."""
    return ", ".join(f"{one.value} {one.name}" for one in field.choices or ())


def _limits(program: FlightProgram, hold_samples: int) -> Iterator[Row]:
    real = real_type(program)
    size = 4 if program.single else 8
    for name, kind, unit, default in (
        ("hold_samples", "int32_t", "", hold_samples),
        ("rate_limit", real, "rad/s", RATE_LIMIT),
        ("norm_tolerance", real, "1", NORM_TOLERANCE),
    ):
        width = 4 if kind == "int32_t" else size
        yield Row("controller_guard_parameters", name, name, kind, "", width, unit,
                  f"at least 0; default {default:g}", "not checked", "once")  # fmt: skip


def as_csv(table: Sequence[Row]) -> str:
    """Return the rows as comma-separated values, with a line of names."""
    return csv_text([Row._fields, *table])


def as_markdown(title: str, table: Sequence[Row]) -> str:
    """Return the rows as a document with a table for each structure."""
    lines = [f"# {title}: interface control document", ""]
    lines += ["Quaternions have the scalar first. Bytes do not include padding. A parameter whose"]
    lines += ["path begins with `control.` has the unit and the range of that key of the scenario."]
    structure = None
    for row in table:
        if row.structure != structure:
            structure = row.structure
            lines += ["", f"## {structure}", "", f"| {' | '.join(Row._fields[1:])} |"]
            lines.append("|---" * (len(Row._fields) - 1) + "|")
        lines.append(f"| {' | '.join(str(cell) for cell in row[1:])} |")
    return "\n".join([*lines, ""])
