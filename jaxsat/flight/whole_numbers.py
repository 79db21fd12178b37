"""Whole numbers of flight code: their bits, and the names of those of enumerations."""

import enum
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from jaxsat.compiler.c.layout import Field, Struct
from jaxsat.compiler.c.naming import Names, identifier
from jaxsat.compiler.passes.enumerations import name_numbers
from jaxsat.compiler.passes.narrowing import MOST, Ports, narrow

MEANINGS = frozenset(("default", "input", "output", "state", "status"))
"""Words after CONTROLLER_ in macros of the interface."""

Macros = dict[type[enum.IntEnum], dict[int, str]]
"""Names of the numbers of enumerations in C."""


def narrowed(
    ports: Sequence[Ports], structs: Mapping[str, Struct], defaults: Sequence[Any]
) -> dict[str, Struct]:
    """Shorten whole numbers of stages to 32 bits, and return the structures with such fields.

    `ports` name a field by its structure and its name, such as "state.law_leg".
    """
    long = [
        f"parameters.{one.name}"
        for one in structs["parameters"].fields
        if one.dtype.kind == "i" and np.any(np.abs(np.asarray(defaults[one.number])) > MOST)
    ]
    short = narrow(ports, long)

    def fields(name: str) -> Iterator[Field]:
        for one in structs[name].fields:
            is_short = f"{name}.{one.name}" in short
            yield replace(one, dtype=np.dtype(np.int32)) if is_short else one

    return {name: replace(struct, fields=tuple(fields(name))) for name, struct in structs.items()}


def named(
    ports: Sequence[Ports], structs: Mapping[str, Struct], modes: type[enum.IntEnum]
) -> tuple[dict[str, Struct], Macros]:
    """Name the numbers of enumerations in stages, in place; return their names.

    Parameters that exchange numbers with a field of an enumeration have it in the structures
    returned.
    """
    structs = {**structs, "output": _with_modes(structs["output"], modes)}
    macros = _macros(structs, modes)
    words = name_numbers(
        ports,
        {
            f"{name}.{one.name}": macros[one.choices]
            for name in ("output", "state")
            for one in structs[name].fields
            if one.choices is not None
        },
    )

    def choices(field: Field) -> type[enum.IntEnum] | None:
        own = words.get(f"parameters.{field.name}")
        return next((one for one, names in macros.items() if names is own), None)

    parameters = structs["parameters"]
    fields = tuple(replace(one, choices=choices(one)) for one in parameters.fields)
    return {**structs, "parameters": replace(parameters, fields=fields)}, macros


def _with_modes(output: Struct, modes: type[enum.IntEnum]) -> Struct:
    """Return the structure of outputs with the enumeration of the mode."""
    fields = (replace(one, choices=modes) if one.path == "mode" else one for one in output.fields)
    return replace(output, fields=tuple(fields))


def _macros(structs: Mapping[str, Struct], modes: type[enum.IntEnum]) -> Macros:
    """Return the names of the numbers of all enumerations of outputs and state."""
    names, macros = Names(fields=True), {}
    fields = [*structs["output"].fields, *structs["state"].fields]
    for choices in dict.fromkeys(one.choices for one in fields if one.choices is not None):
        word = "mode" if choices is modes else identifier(choices.__name__)
        word = f"{word}_of_law" if word in MEANINGS else word
        macros[choices] = {
            int(one): f"CONTROLLER_{names.new(identifier(word, one.name)).upper()}"
            for one in choices
        }
    return macros
