"""Whole numbers of flight code: their bits, and the names of those of enumerations."""

import enum
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.c.layout import Field, Struct
from jaxsat.compiler.c.naming import Names, identifier
from jaxsat.compiler.passes.holders import Classes, Content, functions_of, slots, steps_in
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


Words = Mapping[int, str]
"""Names of the numbers of an enumeration."""

ALIKE = frozenset(("select", "min", "max"))
"""Operations whose results are operands."""

EQUAL, ORDER = frozenset(("eq", "ne")), frozenset(("lt", "le", "gt", "ge"))


def name_numbers(
    programs: Sequence[Ports], words: Mapping[Hashable, Words]
) -> dict[Hashable, Words]:
    """Name the constants of programs, in place, that the holders of ports may hold.

    `words` has the names of the numbers of each holder; of two that exchange numbers, the first has
    the names of both. Constants that choices, limits and comparisons for equality exchange with
    them are theirs, with the tables that they are read from and the blocks that they choose; others
    have 32 bits, and remain numbers. So does zero in a comparison by order, which tests a sign.
    Returns the names of the numbers of all holders of ports.
    """
    functions = {id(x): x for one in programs for x in functions_of(one.function)}.values()
    steps = [step for function in functions for step in steps_in(function.block)]
    places = [one for function in functions for one in slots(function, ALIKE, EQUAL)]
    classes = _classes(programs, steps, places)
    words_of: dict[Hashable, Words] = {}
    for holder, names in words.items():
        words_of.setdefault(classes.of(holder), names)

    def names_of(holder: Hashable) -> Words:
        return words_of.get(classes.of(holder), {})

    for slot in places:
        if isinstance(slot.content, np.generic):
            slot.put(ir.NamedNumber.of(slot.content, names_of(slot.holder)))
    for step in steps:
        _name_in(step, names_of)
    ports = {key for one in programs for key in (*one.params, *one.results)}
    return {key: names for key in ports if key is not None and (names := names_of(key))}


def _classes(
    programs: Iterable[Ports], steps: Iterable[ir.Step], places: Iterable[Content]
) -> Classes:
    """Return the sets of holders that exchange numbers."""
    classes = Classes()
    for one in programs:
        for after, before in one.links():
            classes.join(after, before)
    for slot in places:
        if slot.source is not None:
            classes.join(slot.holder, slot.source)
    for step in steps:
        match step:
            case ir.Operation(name="convert", args=(ir.Value() as before,), out=after):
                if before.dtype == after.dtype:
                    classes.join(after.number, before.number)
    return classes


def _name_in(step: ir.Step, names_of: Callable[[Hashable], Words]) -> None:
    """Name the numbers of a step in a comparison by order, in a table, and of blocks."""
    match step:
        case ir.Operation(name=name, args=args) if name in ORDER:
            candidates = [names_of(x.number) for x in args if isinstance(x, ir.Value)]
            names = next(filter(None, candidates), {})
            step.args = tuple(
                ir.NamedNumber.of(x, names) if isinstance(x, np.generic) and x != 0 else x
                for x in args
            )
        case ir.Load(memory=memory) if memory.initial is not None:
            memory.names = names_of(memory.number)
        case ir.BlockSwitch(index=ir.Value(number=number)):
            step.names = names_of(number)
        case _:
            pass
