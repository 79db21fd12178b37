"""Inputs and outputs of a controller, as messages of flight software's frameworks.

They follow the rows of the interface control document; the rest of a wrapper is in templates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jaxsat.flight.interface import Row
from jaxsat.flight.program import FlightProgram


@dataclass(frozen=True)
class Item:
    """A number, or an array of numbers, of a message.

    `type` is that of C, `size` the bytes of an element, `about` its unit and range; `place` is the
    controller's structure, "input", "valid" or "output", and the name of the field.
    """

    name: str
    type: str
    shape: tuple[int, ...]
    size: int
    about: str
    place: tuple[str, str]

    def place_in(self, structures: Mapping[str, str]) -> str:
        """Return the C expression of the field, with these prefixes of the structures."""
        structure, field = self.place
        return structures[structure] + field

    @property
    def count(self) -> int:
        """Number of elements."""
        return int(np.prod(self.shape))


def _item(row: Row, structure: str, prefix: str = "") -> Item:
    shape = tuple(map(int, row.dimensions.split(" x "))) if row.dimensions else ()
    about = ", ".join(text for text in (row.unit, row.range) if text)
    size = row.bytes // int(np.prod(shape))
    return Item(prefix + row.name, row.type, shape, size, about, (structure, row.name))


def measured(rows: Sequence[Row]) -> list[Item]:
    """Return the items of a sample's measurements and their validity, largest first."""
    items = [
        _item(row, "input")
        for row in rows
        if row.structure == "controller_input" and row.path != "sample"
    ]
    validity = [row for row in rows if row.structure == "controller_validity"]
    return _sorted([*items, *(_item(row, "valid", "valid_") for row in validity)])


def commanded(rows: Sequence[Row]) -> list[Item]:
    """Return the items of a sample's outputs, largest first, then its status and number."""
    items = [_item(row, "output") for row in rows if row.structure == "controller_output"]
    return [
        *_sorted(items),
        Item("status", "uint32_t", (), 4, "a sum of CONTROLLER_STATUS_...", ("", "status")),
        Item("sample", "int32_t", (), 4, "the number of the sample", ("", "sample")),
    ]


def _sorted(items: Sequence[Item]) -> list[Item]:
    return sorted(items, key=lambda item: -item.size)


def words_of_modes(program: FlightProgram) -> str:
    """Return the numbers of the modes and their names."""
    return ", ".join(f"{number} {name}" for name, number in program.modes.items())
