"""Tables of a scenario made from the keys that a part of the core declares."""

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, Union

from annotated_types import Ge, Gt, Le, Len
from pydantic import Discriminator, Tag, create_model

from jaxsat.core.declaration import LARGEST, Choice, Key, Numeric
from jaxsat.scenario.quantities import Number, Switch, Table, choice, is_list, quantity


def fields_of(keys: Iterable[Key]) -> dict[str, tuple[Any, Any]]:
    """What `pydantic.create_model` takes, for declared keys."""
    return {key.name: (_annotation(key), _field(key)) for key in keys}


def table_with(fields: Mapping[str, Any], base: type[Table] = Table) -> Any:
    """A table with these fields, to derive a class with a name of its own from."""
    return create_model("Declared", __base__=base, **fields)


def values_of(keys: Iterable[Key], table: Table) -> dict[str, Any]:
    """What a checked table has under declared keys, as `from_table` takes it."""
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
