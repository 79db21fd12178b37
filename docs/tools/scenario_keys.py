"""The page of all keys of a scenario file, from the schema that the program checks files with."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

MAX_DEFAULT = 40


def page(schema: Mapping[str, Any]) -> str:
    """Markdown: a table of keys for each table of a file."""
    definitions = schema["$defs"]
    places = _places(schema)
    top = {key: one for key, one in schema["properties"].items() if not list(_tables(one))}
    parts = [
        "# Keys of a scenario file",
        "Made from the JSON Schema of the program (`jaxsat scenarios schema`) when these pages are "
        "built. {doc}`scenarios` explains how the tables go together, and in which other units "
        "keys in radians may be given.",
        "## Top of the file",
        "\n".join(_table(top, schema.get("required", ()))),
    ]
    for name, definition in sorted(definitions.items(), key=lambda one: places.get(one[0], one[0])):
        heading, about = places.get(name, name), definition.get("description", "")
        parts += [f"## `{heading}`", about.replace("\n", " ")]
        if definition.get("properties"):
            parts.append("\n".join(_table(definition["properties"], _required(definition))))
    return "\n\n".join(parts) + "\n"


def _tables(entry: Any) -> Iterator[tuple[str, bool]]:
    """The definitions that an entry refers to, and whether as a list of tables."""
    if isinstance(entry, Mapping):
        if "$ref" in entry:
            yield entry["$ref"].rpartition("/")[2], False
        for key, value in entry.items():
            for name, several in _tables(value):
                yield name, several or key == "items"
    elif isinstance(entry, list):
        for one in entry:
            yield from _tables(one)


def _places(schema: Mapping[str, Any]) -> dict[str, str]:
    """What a file calls each definition, such as [orbit] or [[thruster]]."""
    found: dict[str, str] = {}

    def follow(properties: Mapping[str, Any], above: str) -> None:
        uses = Counter(name for entry in properties.values() for name, _ in _tables(entry))
        for key, entry in properties.items():
            for name, several in _tables(entry):
                if name in found:
                    continue
                path = f"{above}{'NAME' if uses[name] > 1 else key}"
                path += ".NAME" if "additionalProperties" in entry else ""
                inside = schema["$defs"][name].get("properties", {})
                law = inside.get("law", {}).get("const")
                found[name] = f"[[{path}]]" if several else f"[{path}]"
                found[name] += f' law = "{law}"' if law else ""
                follow(inside, f"{path}.")

    follow(schema["properties"], "")
    return found


def _table(properties: Mapping[str, Any], required: Any) -> list[str]:
    rows = ["| key | unit | allowed | default | what it is |", "|---|---|---|---|---|"]
    for key, entry in properties.items():
        if "in_place_of" in entry:
            continue
        unit = entry.get("unit", "")
        about = entry.get("description", "").removesuffix(f" ({unit})")
        about = about.removesuffix(" (no unit)")
        default = "required" if key in required else _default(entry)
        cells = [f"`{key}`", unit, _allowed(entry), default, about]
        rows.append(
            "| "
            + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells)
            + " |"
        )
    return rows


def _required(definition: Mapping[str, Any]) -> set[str]:
    """The keys that a table must have, in any unit; those of a device may stand in its type."""
    needed = definition.get("then", definition)
    families = (rule["anyOf"] for rule in needed.get("allOf", ()) if "anyOf" in rule)
    return {*needed.get("required", ()), *(family[0]["required"][0] for family in families)}


def _default(entry: Mapping[str, Any]) -> str:
    value = entry.get("default")
    if value is None:
        return "none"
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return text if len(text) <= MAX_DEFAULT else "see below"


def _allowed(entry: Mapping[str, Any]) -> str:
    """Type and range in a few words."""
    for several in ("anyOf", "oneOf"):
        if several in entry:
            parts = map(_allowed, entry[several])
            return " or ".join(dict.fromkeys(part for part in parts if part))
    if "enum" in entry:
        return ", ".join(f"`{one}`" for one in entry["enum"])
    if "const" in entry:
        return f"`{entry['const']}`"
    if entry.get("type") == "array":
        return _list(entry)
    ends = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    limits = [f"{sign} {entry[key]:.6g}" for key, sign in ends.items() if key in entry]
    kind = {"boolean": "true or false", "object": "table"}.get(
        entry.get("type", ""), entry.get("type", "table" if "$ref" in entry else "")
    )
    return ", ".join([kind, *limits]) if kind else ", ".join(limits)


def _list(entry: Mapping[str, Any]) -> str:
    """How long a list is, and what is in it."""
    inside = _allowed(entry.get("items", {}))
    least, most = entry.get("minItems", 0), entry.get("maxItems")
    size = "" if least != most else f" of {most}"
    return f"list{size}: {inside}" if inside else f"list{size}"
