"""Inputs and outputs of a controller, as messages of flight software's frameworks.

They follow the rows of the interface control document; the rest of a wrapper is in templates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from jaxsat.flight.guard import NORM_TOLERANCE, RATE_LIMIT
from jaxsat.flight.interface import Parameter, Row, is_of_plan
from jaxsat.flight.program import FlightProgram


@dataclass(frozen=True)
class Item:
    """A number, or an array of numbers, of a message.

    `type` is that of C, `size` the bytes of an element, `about` its unit and range; `place` is the
    controller's structure, "input", "valid", "output", "read" (parameters) or "limits" (of the
    guard), and the name of the field.
    """

    name: str
    type: str
    shape: tuple[int, ...]
    size: int
    about: str
    place: tuple[str, str]
    unit: str = ""

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
    size = row.bytes // int(np.prod(shape))
    place = (structure, row.name)
    return Item(prefix + row.name, row.type, shape, size, _about(row), place, row.unit)


def _about(row: Row) -> str:
    return ", ".join(text for text in (row.unit, row.range) if text)


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


def tuned(
    rows: Sequence[Row], of_parameters: Sequence[Parameter], hold_samples: int
) -> list[tuple[Item, np.ndarray]]:
    """Return the parameters that keys of `[control]` set, if finite, and the limits of the guard,
    with their defaults; `hold_samples` is the guard's."""
    row_of = {row.name: row for row in rows if row.structure == "controller_parameters"}
    items = []
    for one in of_parameters:
        default, field = np.asarray(one.default), one.field
        is_plan = is_of_plan(field)  # larger than a framework's parameters usually may be
        if one.key is not None and not is_plan and np.isfinite(default).all():
            row = row_of[field.name]
            item = _item(row, "read")
            items.append((replace(item, about=f"{row.path}, {item.about}"), default))
    limits = {
        "hold_samples": hold_samples,
        "rate_limit": RATE_LIMIT,
        "norm_tolerance": NORM_TOLERANCE,
    }
    for row in rows:
        if row.structure == "controller_guard_parameters":
            items.append((_item(row, "limits", "guard_"), np.asarray(limits[row.name])))
    return items


def _sorted(items: Sequence[Item]) -> list[Item]:
    return sorted(items, key=lambda item: -item.size)


def words_of_modes(program: FlightProgram) -> str:
    """Return the numbers of the modes and their names."""
    return ", ".join(f"{number} {name}" for name, number in program.modes.items())
