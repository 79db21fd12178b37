"""Wrappers of an exported controller for frameworks of flight software: an app of NASA's cFS.

What differs between controllers are the numbers that go in and come out. The rows of the interface
control document tell of them; all else is in templates.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jaxsat.compiler.c.naming import comment
from jaxsat.flight.guard_source import default_limits
from jaxsat.flight.interface import Row
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.source import default_parameters
from jaxsat.flight.templates import template

CFS = "wrappers/cfs/controller_app"
"""The folder of the app in an export."""

CFS_FILES = (
    "CMakeLists.txt",
    "controller_app.c",
    "controller_app.h",
    "controller_app_msg.h",
    "controller_app_tbl.h",
    "controller_app_topicids.h",
    "controller_tbl.c",
)


@dataclass(frozen=True)
class Item:
    """A number, or an array of them, of a message: `place` is where the controller has it."""

    name: str
    type: str
    shape: tuple[int, ...]
    size: int
    about: str
    place: str

    @classmethod
    def of(cls, row: Row, place: str, prefix: str = "") -> "Item":
        """What a row of the interface control document tells; truth values are bytes."""
        shape = tuple(map(int, row.dimensions.split(" x "))) if row.dimensions else ()
        kind = "uint8_t" if row.type == "bool" else row.type
        about = ", ".join(text for text in (row.unit, row.range) if text)
        count = int(np.prod(shape))
        name = prefix + row.name
        return cls(name, kind, shape, row.bytes // count, about, f"{place}{row.name}")

    @property
    def declaration(self) -> list[str]:
        """A member of a structure of C."""
        sizes = "".join(f"[{size}]" for size in self.shape)
        first, *rest = comment(self.about)
        return [f"  {self.type} {self.name}{sizes}; {first}", *rest]

    @property
    def bytes(self) -> int:
        """Of all its elements."""
        return int(np.prod(self.shape)) * self.size


def measured(rows: Sequence[Row]) -> list[Item]:
    """What a sample needs: measurements, and what the sensors say of them; largest first."""
    found = [
        Item.of(row, "Input->")
        for row in rows
        if row.structure == "controller_input" and row.path != "sample"
    ]
    validity = [row for row in rows if row.structure == "controller_validity"]
    return _sorted([*found, *(Item.of(row, "Valid->", "valid_") for row in validity)])


def commanded(rows: Sequence[Row]) -> list[Item]:
    """What comes out of a sample, largest first."""
    found = [row for row in rows if row.structure == "controller_output"]
    return _sorted([Item.of(row, "Output.") for row in found])


def _sorted(items: Sequence[Item]) -> list[Item]:
    return sorted(items, key=lambda item: -item.size)


def cfs_app(
    program: FlightProgram, rows: Sequence[Row], intro: Sequence[str], hold_samples: int
) -> dict[str, str]:
    """The files of the app by their names, which begin with `CFS`.

    `rows` are those of the interface control document, `hold_samples` the guard's default.
    """
    given, told = measured(rows), commanded(rows)
    told += [
        Item("status", "uint32_t", (), 4, "a sum of CONTROLLER_STATUS_...", ""),
        Item("sample", "int32_t", (), 4, "the number of the sample", ""),
    ]
    modes = ", ".join(f"{number} {name}" for name, number in program.modes.items())
    real = "float" if program.single else "double"
    begin = (
        f"  static const {real} attitude[4] = {{0}}; /* begin with the first measured one */\n\n"
    )
    values = {
        "PERIOD": f"{float(np.asarray(program.period)):.9g}",
        "PROGRAM": program.hash[:12],
        "MODES": modes,
        "MEASUREMENT": _members(given),
        "OUTPUT": _members(told),
        "READ": "\n".join(_copy(item.place, f"Payload->{item.name}", item) for item in given),
        "WRITE": "\n".join(
            _copy(f"Payload->{item.name}", item.place, item) for item in told if item.place
        ),
        "BEGIN": begin * program.estimates,
        "ATTITUDE": "attitude, " * program.estimates,
        "PARAMETERS": "\n".join(default_parameters(program)),
        "LIMITS": "\n".join(default_limits(program, hold_samples)),
    }
    head = "\n".join(intro)
    return {
        f"{CFS}/{name}": (head if name.endswith((".c", ".h")) else "")
        + template(f"cfs/{name}", **values)
        for name in CFS_FILES
    }


def _members(items: Sequence[Item]) -> str:
    """Members of a structure that has no padding."""
    lines = [line for item in items for line in item.declaration]
    spare = -sum(item.bytes for item in items) % max(item.size for item in items)
    return "\n".join([*lines, *[f"  uint8_t spare[{spare}];"] * bool(spare)])


def _copy(to: str, source: str, item: Item) -> str:
    """A statement that copies an item; a byte is read as a truth value."""
    if item.shape:
        return f"  (void)memcpy({to}, {source}, sizeof({to}));"
    truth = " != 0u" if item.place == to and item.type == "uint8_t" else ""
    return f"  {to} = {source}{truth};"
