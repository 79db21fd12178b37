"""Names of the numbers of enumerations, such as modes, in programs."""

from collections.abc import Hashable, Mapping, Sequence

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.passes.holders import Classes, functions_of, slots
from jaxsat.compiler.passes.narrowing import NARROW, Ports

Words = Mapping[int, str]
"""Names of the numbers of an enumeration."""


def name_numbers(programs: Sequence[Ports], words: Mapping[Hashable, Words]) -> None:
    """Name the constants of programs, in place, that the holders of ports may hold.

    `words` has the names of the numbers of each holder; of two that exchange numbers, the first has
    the names of both. Constants that choices and comparisons for equality exchange with them are
    theirs; others have 32 bits, and remain numbers.
    """
    classes = Classes()
    for one in programs:
        for after, before in one.links():
            classes.join(after, before)
    functions = {id(x): x for one in programs for x in functions_of(one.function)}
    places = [
        slot
        for function in functions.values()
        for slot in slots(function, frozenset(("select",)), frozenset(("eq", "ne")))
    ]
    for slot in places:
        if slot.source is not None:
            classes.join(slot.holder, slot.source)
    words_of: dict[Hashable, Words] = {}
    for holder, names in words.items():
        words_of.setdefault(classes.of(holder), names)
    for slot in places:
        names = words_of.get(classes.of(slot.holder), {})
        number = slot.content
        if isinstance(number, np.generic) and number.dtype == NARROW and int(number) in names:
            slot.put(ir.NamedNumber(int(number), names[int(number)]))
