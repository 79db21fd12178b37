"""Errors of pydantic in the words of a scenario file: "must …, got …, did you mean …?"."""

import copy
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from jaxsat.core.declaration.laws import LAWS
from jaxsat.core.errors import ArgumentError
from jaxsat.core.once import once
from jaxsat.core.text import clean, suggestion
from jaxsat.scenario.control import known_law, law_names, table_of
from jaxsat.scenario.errors import Issue, Location, entry_of
from jaxsat.scenario.parts.named import PartTable, table_of_part
from jaxsat.scenario.plugins import PluginError, known_part
from jaxsat.scenario.toml_text import toml_value

MAX_SHOWN_LENGTH = 60
MAX_VECTOR_LENGTH = 4
"""Largest fixed length of a list; longer lists may have any number of entries up to theirs."""


def shown(value: Any) -> str:
    """Value as in the file, shortened."""
    return clean(toml_value(value), MAX_SHOWN_LENGTH)


def table_at(root: type[BaseModel], data: Any, location: Location) -> type[BaseModel] | None:
    """Table class at a location, following `control.law`."""
    kind: Any = root
    for part in location:
        if get_origin(kind) is dict:
            kind = item_kind(kind)
        elif isinstance(part, int) and get_origin(kind) is tuple:
            kind = get_args(kind)[0]
        else:
            table = _table_class(kind, data)
            field = table.model_fields.get(part) if table and isinstance(part, str) else None
            kind = field.annotation if field else None
        data = _entry(data, part)[1]
    return _table_class(kind, data)


def item_kind(annotation: Any) -> Any:
    """Type of the values of a table with keys of any name; None for any other annotation."""
    return get_args(annotation)[1] if get_origin(annotation) is dict else None


def _table_class(annotation: Any, data: Any) -> type[BaseModel] | None:
    tables = _tables_in(annotation)
    table = tables[0] if tables else None
    if len(tables) > 1:  # the laws, distinguished by name
        law = known_law(data.get("law") if isinstance(data, Mapping) else None)
        return None if law is None else table_of(law)
    if table is not None and issubclass(table, PartTable):
        part = known_part(table.plugin, data.get("kind") if isinstance(data, Mapping) else None)
        return table if part is None else table_of_part(table, part)
    return table


def _tables_in(annotation: Any) -> list[type[BaseModel]]:
    """Table classes that an annotation, or one of its alternatives, names."""
    if get_origin(annotation) is dict:
        return []
    options = [annotation, *get_args(annotation)]
    options += [inner for one in options if get_origin(one) is Annotated for inner in get_args(one)]
    tables = (one for one in options if isinstance(one, type) and issubclass(one, BaseModel))
    return list(dict.fromkeys(tables))


def known_location(data: Any, raw: Location, missing: bool) -> Location:
    """A pydantic location without the labels of union members."""
    parts: list[str | int] = []
    for position, part in enumerate(raw):
        last = position == len(raw) - 1
        present, inner = _entry(data, part)
        if present:
            data = inner
        elif not (missing and last):
            continue
        parts.append(part)
    return tuple(parts)


def _entry(data: Any, part: str | int) -> tuple[bool, Any]:
    """Whether a table or list has this key or position, and its value."""
    if isinstance(data, Mapping) and part in data:
        return True, data[part]
    if isinstance(data, list | tuple) and isinstance(part, int) and part < len(data):
        return True, data[part]
    return False, None


def issue_of(root: type[BaseModel], data: Any, error: Mapping[str, Any]) -> Issue | None:
    """Convert an error of pydantic to an issue; None if it only repeats another."""
    kind, value, bounds = error["type"], error["input"], error.get("ctx", {})
    if kind == "too_short" and len(value) >= bounds["min_length"]:
        return None  # pydantic does not count entries that it has rejected
    missing = kind == "missing"
    location = known_location(data, error["loc"], missing)
    if kind == "union_tag_not_found":
        return Issue(
            (*location, "law"), f"must be one of {_quoted_list(law_names())}, got nothing", (), True
        )
    if kind == "union_tag_invalid":
        return Issue((*location, "law"), _choice_message(value.get("law"), law_names()))
    if kind == "extra_forbidden":
        return Issue(location, _unknown_key(root, data, location))
    if kind == "literal_error":
        return Issue(location, _choice_message(value, _choices(root, data, location)))
    if kind == "value_error" and isinstance(bounds["error"], PluginError):
        return Issue((*location, bounds["error"].key), str(bounds["error"]))
    if kind == "value_error":
        return Issue(location, refusal_text(bounds["error"], value))
    unit = _unit(root, data, location)
    if missing:
        return Issue(location, f"must be given{unit and f' in {unit}'}, got nothing", (), True)
    rule = _rule(kind, bounds, unit)
    if rule is None:
        rule = f"be valid ({error['msg'][0].lower() + error['msg'][1:]})"
    return Issue(location, f"must {rule}, got {shown(value)}{entry_of(location)}")


def refusal(table: type[BaseModel], name: str, value: Any) -> str | None:
    """Message about a value that a key of a table rejects; None if the key accepts it."""
    try:
        validated(table.model_fields[name], value)
    except ValidationError as error:
        line = {**error.errors()[0], "loc": (name,)}
        issue = issue_of(table, {name: value}, line)
        return issue and issue.message
    return None


def validated(field: FieldInfo, value: Any) -> Any:
    """Validate the value of one field, with the bounds that its declaration adds to its type.

    Raises pydantic's `ValidationError`.
    """
    bare = copy.copy(field)
    bare.exclude = None  # pydantic warns of options that only tables take
    kind = Annotated[bare.annotation, bare]  # pyright: ignore
    return TypeAdapter(kind).validate_python(value)  # pyright: ignore


def _rule(kind: str, bounds: Mapping[str, Any], unit: str) -> str | None:
    in_unit = f" in {unit}" if unit else ""
    match kind:
        case "float_type" | "float_parsing":
            return f"be a number{in_unit}"
        case "finite_number":
            return f"be a finite number{in_unit}"
        case "greater_than":
            return f"be greater than {bounds['gt']:g}{unit and ' ' + unit}"
        case "greater_than_equal":
            return f"be at least {bounds['ge']:g}{unit and ' ' + unit}"
        case "less_than":
            return f"be less than {bounds['lt']:g}{unit and ' ' + unit}"
        case "less_than_equal":
            return f"be at most {bounds['le']:g}{unit and ' ' + unit}"
        case "too_short" | "too_long":
            return _length_rule(kind, bounds, unit)
        case "tuple_type":
            return f"be a list{in_unit}"
        case "int_type" | "int_parsing" | "int_from_float" | "int_parsing_size":
            return "be a whole number"
        case "bool_type" | "bool_parsing":
            return "be true or false"
        case "string_type":
            return "be text in quotes"
        case "string_unicode":
            return "be text of valid characters"
        case "string_too_short":
            return "not be empty"
        case "string_too_long":
            return f"have at most {bounds['max_length']} characters"
        case "model_type" | "model_attributes_type" | "dict_type":
            return "be a table"
    return None


def _length_rule(kind: str, bounds: Mapping[str, Any], unit: str) -> str:
    count = bounds["min_length"] if kind == "too_short" else bounds["max_length"]
    of = f" in {unit}" if unit else ""
    if kind == "too_long" and count > MAX_VECTOR_LENGTH:
        return f"have at most {count} entries{of}"
    return f"have {'at least 1 entry' if count == 1 else f'{count} entries'}{of}"


def _field(root: type[BaseModel], data: Any, location: Location) -> FieldInfo | None:
    names = tuple(part for part in location if isinstance(part, str))
    table = table_at(root, data, names[:-1])
    return table.model_fields.get(names[-1]) if table and names else None


def _choices(root: type[BaseModel], data: Any, location: Location) -> list[str]:
    """Texts that are valid for the key of a location."""
    field = _field(root, data, location)
    kinds = [] if field is None else [field.annotation, *get_args(field.annotation)]
    return [text for kind in kinds if get_origin(kind) is Literal for text in get_args(kind)]


def _unit(root: type[BaseModel], data: Any, location: Location) -> str:
    field = _field(root, data, location)
    extra = field.json_schema_extra if field else None
    unit = extra.get("unit") if isinstance(extra, dict) else None
    return unit if isinstance(unit, str) and unit != "1" else ""


def _choice_message(value: Any, choices: Iterable[str]) -> str:
    choices = list(choices)
    hint = suggestion(value, choices) if isinstance(value, str) else ""
    return f"must be one of {_quoted_list(choices)}, got {shown(value)}{hint}"


def _quoted_list(choices: Iterable[str]) -> str:
    return ", ".join(f'"{choice}"' for choice in choices)


def refusal_text(error: ArgumentError, value: Any) -> str:
    """Refusal of the value of a key by a validator or a constructor, as a message."""
    return f"{error.rule}, got {shown(value) if error.got is None else error.got}"


def _unknown_key(root: type[BaseModel], data: Any, location: Location) -> str:
    table = table_at(root, data, location[:-1])
    parents = [part for part in location[:-1] if isinstance(part, str)]
    name = str(location[-1])
    keys = list(table.model_fields) if table else []
    is_array = len(parents) < len(location) - 1
    place = f"{'[' * (1 + is_array)}{'.'.join(parents)}{']' * (1 + is_array)}"
    place = place if parents else "the scenario"
    message = f"must be one of the keys of {place} ({', '.join(keys)}), got {shown(name)}"
    is_part = any(key.startswith(name) or f"_{name}_" in f"_{key}_" for key in keys)
    hint = "" if is_part else _elsewhere(root, name, parents)
    return message + (hint or suggestion(name, keys))


def _elsewhere(root: type[BaseModel], name: str, parents: list[str]) -> str:
    if parents[:1] == ["control"]:
        laws = [law for law, one in LAWS.items() if name in table_of(one).model_fields]
        if laws:
            return f" (a key of the law {_quoted_list(laws)})"
    places = [".".join(path) for path in dotted_keys(root) if path[-1] == name and len(path) > 1]
    return f", did you mean {' or '.join(places)}?" if len(places) in (1, 2) else ""


@once
def dotted_keys(root: type[BaseModel]) -> list[tuple[str, ...]]:
    """Every key of a table class and the tables inside it."""
    keys: dict[tuple[str, ...], None] = {}
    for name, field in root.model_fields.items():
        keys[(name,)] = None
        for option in _tables_in(field.annotation):
            keys.update({(name, *rest): None for rest in dotted_keys(option)})
    return list(keys)
