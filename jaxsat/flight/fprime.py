"""Wrapper of a controller: a component of NASA's F´ (F Prime)."""

from collections.abc import Sequence

import numpy as np

from jaxsat.compiler.c.naming import ascii_text
from jaxsat.flight.guard import first_attitude, real_type
from jaxsat.flight.interface import Parameter, Row
from jaxsat.flight.messages import Item, commanded, measured, tuned, words_of_modes
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import template

FPRIME = "wrappers/fprime/Controller"
"""Folder of the component in an export."""

FILES = ("CMakeLists.txt", "Controller.cpp", "Controller.fpp", "Controller.hpp")

TYPES = {
    "bool": "bool", "int8_t": "I8", "int16_t": "I16", "int32_t": "I32", "int64_t": "I64",
    "uint8_t": "U8", "uint16_t": "U16", "uint32_t": "U32", "uint64_t": "U64", "float": "F32",
    "double": "F64",
}  # fmt: skip
"""Types of the modelling language by those of C."""

PLACES = {
    "input": "this->m_input.", "valid": "this->m_valid.", "output": "output.", "read": "read.",
    "limits": "limits.", "": "",
}  # fmt: skip


def fprime_component(
    program: FlightProgram,
    rows: Sequence[Row],
    of_parameters: Sequence[Parameter],
    intro: Sequence[str],
    hold_samples: int,
) -> dict[str, str]:
    """Return the files of the component by their names, which begin with `FPRIME`.

    `rows` are those of the interface control document, `hold_samples` the guard's default.
    Parameters set by keys of the scenario are parameters of the component, too.
    """
    inputs, outputs = measured(rows), commanded(rows)
    real = real_type(program)
    parameters = tuned(rows, of_parameters, hold_samples)
    items = [*inputs, *outputs, *(item for item, _ in parameters)]
    arrays = {_type(item): item for item in items if item.shape}
    numbers, words = first_attitude(program)
    begin = f"    static const {real} attitude[4] = {numbers}; // {words}\n\n"
    values = {
        "PERIOD": f"{float(np.asarray(program.period)):.9g}",
        "MODES": ascii_text(words_of_modes(program)),
        "ARRAYS": "\n".join(
            f"  array {name} = [{item.count}] {TYPES[item.type]}" for name, item in arrays.items()
        ),
        "MEASUREMENT": _members(inputs),
        "OUTPUT": _members(outputs),
        "ARGUMENTS": ",\n".join(f"    {_argument(item)}" for item in inputs),
        "READ": "\n".join(_take(item, item.name) for item in inputs),
        "WRITE": ",\n".join(f"            {_passed(item)}" for item in outputs),
        "PARAMETERS": "\n".join(
            f"    @ {ascii_text(item.about)}\n"
            f"    param {item.name}: {_type(item)} default {_initialiser(default)} id {number} "
            f"set opcode {256 + 2 * number} save opcode {257 + 2 * number}\n"
            for number, (item, default) in enumerate(parameters)
        ),
        "TAKE": "\n".join(_read(item) for item, _ in parameters),
        "BEGIN": begin * program.estimates,
        "ATTITUDE": "attitude, " * program.estimates,
    }
    head = "\n".join(intro)
    return {
        f"{FPRIME}/{name}": (head if name.endswith((".cpp", ".hpp")) else "")
        + template(f"fprime/{name}", **values)
        for name in FILES
    }


def _type(item: Item) -> str:
    kind = TYPES[item.type]
    return f"{kind}x{item.count}" if item.shape else kind


def _members(items: Sequence[Item]) -> str:
    return "\n".join(
        f"    {item.name}: {_type(item)} @< {ascii_text(item.about)}" for item in items
    )


def _initialiser(default: np.ndarray) -> str:
    numbers = [str(x).lower() for x in default.ravel()]
    return f"[{', '.join(numbers)}]" if default.ndim else numbers[0]


def _argument(item: Item) -> str:
    return f"const {_type(item)}& {item.name}" if item.shape else f"{_type(item)} {item.name}"


def _passed(item: Item) -> str:
    if item.place == ("", "sample"):
        return "this->m_input.sample"
    place = item.place_in(PLACES)
    return f"fromField<{_type(item)}>({place})" if item.shape else place


def _take(item: Item, value: str) -> str:
    if item.shape:
        return f"    toField({value}, {item.place_in(PLACES)});"
    return f"    {item.place_in(PLACES)} = {value};"


def _read(item: Item) -> str:
    """Return statements that read a parameter, if it is set."""
    return "\n".join(
        [
            f"    const {_type(item)} {item.name} = this->paramGet_{item.name}(valid);",
            "    if (isSet(valid)) {",
            f"    {_take(item, item.name)}",
            "    }",
        ]
    )
