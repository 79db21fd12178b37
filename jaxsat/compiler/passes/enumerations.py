"""Names of the numbers of enumerations, such as modes, in programs."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.passes.holders import Classes, Content, functions_of, slots, steps_in
from jaxsat.compiler.passes.narrowing import Ports

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
            held = [names_of(x.number) for x in args if isinstance(x, ir.Value)]
            names = next(filter(None, held), {})
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
