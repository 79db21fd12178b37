"""Types of scenario values, keys with their units, and tables of declared keys."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal, TypeVar, Union

import numpy as np
from annotated_types import Ge, Gt, Interval, Le, Len
from pydantic import (
    AfterValidator,
    AllowInfNan,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    create_model,
)
from pydantic.types import Strict

from jaxsat.core import declaration
from jaxsat.core.declaration import LARGEST, Choice, Key, Numeric
from jaxsat.core.errors import ArgumentError
from jaxsat.core.inertia import require_known_inertia
from jaxsat.core.ranges import LENGTH, MOMENT, PRODUCT, SECONDS, Range

_UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff]"
)
"""Control characters, rare line separators, changes of the writing direction, and code points that
no file can hold. Tabs and line feeds have their own rule."""


def _printable(text: str) -> str:
    match = _UNPRINTABLE.search(text)
    if match:
        raise ArgumentError("text", "must have no control characters")
    return text


def _one_line(text: str) -> str:
    if "\n" in text or "\t" in text:
        raise ArgumentError("text", "must be one line of text without tabs")
    return text


Text = Annotated[str, Strict(), Len(0, 10_000), AfterValidator(_printable)]
Line = Annotated[str, Strict(), Len(1, 200), AfterValidator(_printable), AfterValidator(_one_line)]
Switch = Annotated[bool, Strict()]
Whole = Annotated[int, Strict()]
Number = Annotated[float, Strict(), AllowInfNan(False)]
Positive = Annotated[Number, Gt(0), Le(1e12)]
NonNegative = Annotated[Number, Ge(0), Le(1e12)]


def within(values: Range) -> Interval:
    """Annotation of a number within this range."""
    return Interval(ge=values.low, le=values.high)


Vector2 = Annotated[tuple[Number, ...], Len(2, 2)]
Vector3 = Annotated[tuple[Number, ...], Len(3, 3)]
Vector4 = Annotated[tuple[Number, ...], Len(4, 4)]
Products3 = Annotated[tuple[Annotated[Number, within(PRODUCT)], ...], Len(3, 3)]
Matrix3 = Annotated[tuple[Products3, ...], Len(3, 3)]
Switches3 = Annotated[tuple[Switch, ...], Len(3, 3)]


def is_list(value: Any) -> bool:
    """Whether a value of a file is a list."""
    return isinstance(value, list | tuple)


def _inertia_form(value: Any) -> str:
    return "matrix" if is_list(value) and any(map(is_list, value)) else "moments"


MIN_SHARE = 1e-9
"""Smallest principal moment of an inertia that is not singular, relative to the largest."""


def inertia_matrix(inertia: Sequence) -> np.ndarray:
    """Inertia matrix (3, 3), kg m², from either form of the key."""
    array = np.array(inertia, dtype=float)
    return np.diag(array) if array.ndim == 1 else array


def _sound_inertia(value: tuple) -> tuple:
    matrix = inertia_matrix(value)
    require_known_inertia("inertia", matrix)
    moments = np.linalg.eigvalsh(matrix)
    if not MOMENT.low <= moments[0] <= moments[-1] <= MOMENT.high:
        rule = f"must have principal moments from {MOMENT.low:g} to {MOMENT.high:g} kg m²"
        raise ArgumentError("inertia", rule)
    if moments[0] < MIN_SHARE * moments[-1]:
        rule = f"must have no principal moment below {MIN_SHARE:g} of the largest"
        got = f"{moments[0]:.6g} and {moments[-1]:.6g} kg m²"
        raise ArgumentError("inertia", rule, got)
    return value


Inertia = Annotated[
    Annotated[Products3, Tag("moments")] | Annotated[Matrix3, Tag("matrix")],
    Discriminator(_inertia_form),
    AfterValidator(_sound_inertia),
]


def _directions(rows: tuple) -> tuple:
    for number, row in enumerate(rows, 1):
        if not 1e-12 <= sum(entry * entry for entry in row) <= 1e12:
            got = "a zero row" if not any(row) else "one that is none"
            rule = "must have a direction in every row"
            raise ArgumentError("rows", rule, f"{got} as row {number}")
    return rows


TorqueAxes = Annotated[tuple[Vector3, ...], Len(1, 1000), AfterValidator(_directions)]


def _direction(value: tuple) -> tuple:
    if not 1e-12 <= sum(entry * entry for entry in value) <= 1e12:
        raise ArgumentError("value", "must be a direction", value)
    return value


Direction = Annotated[Vector3, AfterValidator(_direction)]
Position3 = Annotated[tuple[Annotated[Number, within(LENGTH)], ...], Len(3, 3)]
Relation = Literal["exact", "small-angle"]
"""Form in which the rate of the orbit frame enters (11)."""

Time = Annotated[Number, Ge(0), Le(SECONDS.high)]

UNIT_LENGTH_TOLERANCE = 1e-6


def _unit_length(q: tuple) -> tuple:
    length = float(np.linalg.norm(q))
    if abs(length - 1) > UNIT_LENGTH_TOLERANCE:
        way = f"; divide each entry by {length:.9g}" if length > 0 else ""
        raise ArgumentError("q", "must have unit length to 1e-6", f"length {length:.9g}{way}")
    return q


UnitQuaternion = Annotated[Vector4, AfterValidator(_unit_length)]


Table = TypeVar("Table", bound=BaseModel)


class ScenarioTable(BaseModel):
    """A frozen table of a scenario file that rejects unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def with_keys(self: Table, table: str, **keys: Any) -> Table:
        """Return a copy with unchecked values of keys in a table, such as "simulation.solver"."""
        name, _, inner = table.partition(".")
        part = getattr(self, name)
        part = part.with_keys(inner, **keys) if inner else part.model_copy(update=keys)
        return self.model_copy(update={name: part})


def quantity(what: str, unit: str, default: Any = ..., **constraints: Any) -> Any:
    """Declare a numeric key: its meaning, its unit ("1" for none), its default and its bounds."""
    unit_text = "no unit" if unit == "1" else unit
    return Field(
        default,
        description=f"{what} ({unit_text})",
        json_schema_extra={"unit": unit},
        **constraints,
    )


def choice(what: str, default: Any = ..., **constraints: Any) -> Any:
    """Declare a key that is not a quantity: a name, a switch, a text or a table."""
    return Field(default, description=what, **constraints)


STAND_IN: Mapping[str, Any] = {"default": None, "exclude": True}
"""Keyword arguments of `quantity` and `choice` for a key that stands in for another, see
`jaxsat.scenario.stand_ins`."""


def fields_of(keys: Iterable[Key]) -> dict[str, tuple[Any, Any]]:
    """Field definitions of declared keys for `pydantic.create_model`."""
    return {key.name: (_annotation(key), _field(key)) for key in keys}


def table_with(fields: Mapping[str, Any], base: type[ScenarioTable] = ScenarioTable) -> Any:
    """Return a table with these fields, as a base class."""
    return create_model("Declared", __base__=base, **fields)


def table_class(
    name: str, doc: str, fields: Mapping[str, Any], base: type[ScenarioTable], ending: str
) -> Any:
    """Return the table class of a part that is declared under a name, such as "pid-law"."""
    words = "".join(word.capitalize() for word in re.split(r"\W+", name))
    return create_model(
        f"{words}{ending}", __base__=base, __doc__=doc, __module__=base.__module__, **fields
    )


def values_of(keys: Iterable[Key], table: ScenarioTable) -> dict[str, Any]:
    """Values of declared keys in a checked table, for `from_table`."""
    return {key.name: getattr(table, key.name) for key in keys}


def _field(key: Key) -> Any:
    if key.unit is None:
        return choice(key.meaning, key.default)
    return quantity(key.meaning, key.unit, key.default)


def _annotation(key: Key) -> Any:
    if isinstance(key.kind, Numeric):
        kind: Any = _numeric(key.kind)
    elif isinstance(key.kind, Choice):
        kind = Literal[key.kind.among]
    elif isinstance(key.kind, declaration.Direction):
        kind = Direction
    else:
        kind = Switch
    return kind | None if key.default is None else kind


def _numeric(kind: Numeric) -> Any:
    one = Annotated[Number, _lower(kind), Le(kind.at_most)]
    if kind.size is None:
        return one
    several = Annotated[tuple[one, ...], Len(kind.size, kind.size)]
    if not kind.or_one:
        return several
    return Annotated[
        Union[Annotated[one, Tag("one")], Annotated[several, Tag("each")]],  # noqa: UP007
        Discriminator(lambda value: "each" if is_list(value) else "one"),
    ]


def _lower(kind: Numeric) -> Gt | Ge:
    if kind.above is not None:
        return Gt(kind.above)
    return Ge(-LARGEST if kind.at_least is None else kind.at_least)
