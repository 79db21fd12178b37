"""Kinds of values that scenario keys hold, and how a key is declared together with its unit."""

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Len
from pydantic import AfterValidator, AllowInfNan, BaseModel, ConfigDict, Discriminator, Field, Tag
from pydantic.types import Strict

from jaxsat.checks import require_inertia

Text = Annotated[str, Strict()]
Switch = Annotated[bool, Strict()]
Whole = Annotated[int, Strict()]
Number = Annotated[float, Strict(), AllowInfNan(False)]
Positive = Annotated[Number, Gt(0)]
NonNegative = Annotated[Number, Ge(0)]

Vector2 = Annotated[tuple[Number, ...], Len(2, 2)]
Vector3 = Annotated[tuple[Number, ...], Len(3, 3)]
Vector4 = Annotated[tuple[Number, ...], Len(4, 4)]
Matrix3 = Annotated[tuple[Vector3, ...], Len(3, 3)]
PositivePair = Annotated[tuple[Positive, ...], Len(2, 2)]
Switches3 = Annotated[tuple[Switch, ...], Len(3, 3)]


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple)


def _inertia_form(value: Any) -> str:
    return "matrix" if _is_list(value) and any(map(_is_list, value)) else "moments"


def _sound_inertia(value: tuple) -> tuple:
    array = np.array(value, dtype=float)
    require_inertia("inertia", np.diag(array) if array.ndim == 1 else array)
    return value


Inertia = Annotated[
    Annotated[Vector3, Tag("moments")] | Annotated[Matrix3, Tag("matrix")],
    Discriminator(_inertia_form),
    AfterValidator(_sound_inertia),
]
PositiveOrPair = Annotated[
    Annotated[Positive, Tag("one")] | Annotated[PositivePair, Tag("each")],
    Discriminator(lambda value: "each" if _is_list(value) else "one"),
]


def _directions(rows: tuple) -> tuple:
    for number, row in enumerate(rows, 1):
        if not 0 < sum(entry * entry for entry in row) < math.inf:
            found = "a zero row" if not any(row) else "one that is none"
            raise ValueError(f"must have a direction in every row, got {found} as row {number}")
    return rows


TorqueAxes = Annotated[tuple[Vector3, ...], Len(1, 1000), AfterValidator(_directions)]

UNIT_LENGTH_TOLERANCE = 1e-6


def _unit_length(q: tuple) -> tuple:
    length = float(np.linalg.norm(q))
    if abs(length - 1) > UNIT_LENGTH_TOLERANCE:
        way = f"; divide each entry by {length:.9g}" if length > 0 else ""
        raise ValueError(f"must have unit length to 1e-6, got length {length:.9g}{way}")
    return q


UnitQuaternion = Annotated[Vector4, AfterValidator(_unit_length)]


class Table(BaseModel):
    """A table of a scenario file: frozen, and without keys that it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def quantity(what: str, unit: str, default: Any = ..., **constraints: Any) -> Any:
    """Declare a numeric key: its meaning, its unit ("1" for none), its default and its bounds."""
    shown = "no unit" if unit == "1" else unit
    return Field(
        default,
        description=f"{what} ({shown})",
        json_schema_extra={"unit": unit},
        **constraints,
    )


def choice(what: str, default: Any = ...) -> Any:
    """Declare a key that is no quantity: a name, a switch, a text or a table."""
    return Field(default, description=what)
