"""Writer of values and nested tables as TOML."""

import math
import re
from collections.abc import Mapping
from typing import Any

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_LARGEST_WHOLE = 10**100
_ESCAPES = {"\\": "\\\\", '"': '\\"', "\b": "\\b", "\t": "\\t", "\f": "\\f", "\r": "\\r"}


def toml_value(value: Any) -> str:
    """Value of a TOML document: text, number, truth value, array or table on one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, float) and math.isnan(value):
        return "nan"
    if isinstance(value, int) and abs(value) >= _LARGEST_WHOLE:
        return hex(value)  # Python writes at most 4300 decimal digits
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, Mapping):
        pairs = (f"{toml_key(key)} = {toml_value(entry)}" for key, entry in value.items())
        return "{" + ", ".join(pairs) + "}"
    return str(value)  # dates and times


def toml_key(key: str) -> str:
    """Key, quoted if necessary."""
    return key if _BARE_KEY.fullmatch(key) else _text(key)


def toml_document(tables: Mapping[str, Any], prefix: tuple[str, ...] = ()) -> str:
    """Nested tables as a document; keys with the value None and empty tables are omitted."""
    plain = {
        k: v
        for k, v in tables.items()
        if v is not None and not isinstance(v, Mapping) and not _is_array_of_tables(v)
    }
    lines = [f"{toml_key(key)} = {_long(value)}" for key, value in plain.items()]
    if prefix and lines:
        lines.insert(0, f"[{'.'.join(map(toml_key, prefix))}]")
    blocks = ["\n".join(lines) + "\n"] if lines else []
    for key, value in tables.items():
        if isinstance(value, Mapping):
            block = toml_document(value, (*prefix, key))
            blocks += [block] if block else []
        elif _is_array_of_tables(value):
            header = f"[[{'.'.join(map(toml_key, (*prefix, key)))}]]\n"
            blocks += [header + toml_document(entry) for entry in value]
    return "\n".join(blocks)


def _is_array_of_tables(value: Any) -> bool:
    """Whether a list holds only tables without nested tables: then each has a header."""
    if not isinstance(value, list | tuple) or not value:
        return False
    return all(isinstance(entry, Mapping) and _is_flat(entry) for entry in value)


def _is_flat(table: Mapping[str, Any]) -> bool:
    lists = (one for one in table.values() if isinstance(one, list | tuple))
    inside = [entry for one in lists for entry in one]
    return not any(isinstance(entry, Mapping) for entry in [*table.values(), *inside])


def _long(value: Any) -> str:
    """Value with the lines of a multi-line text kept; everything else is on one line."""
    if isinstance(value, str) and "\n" in value:
        return '"""\n' + "\n".join(_escape(line) for line in value.split("\n")) + '"""'
    return toml_value(value)


def _text(value: str) -> str:
    return '"' + _escape(value).replace("\n", "\\n") + '"'


def _escape(value: str) -> str:
    return "".join(_ESCAPES.get(character) or _visible(character) for character in value)


def _visible(character: str) -> str:
    if character == "\n" or character.isprintable():
        return character
    code = ord(character)
    return f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"
