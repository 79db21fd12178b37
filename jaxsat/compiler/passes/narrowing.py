"""Whole numbers of 32 bits in place of 64 where a program counts, divides, compares and chooses.

NumPy's and JAX's default integers have 64 bits beside doubles. A number becomes shorter where it
begins as one of at most `MOST`, and where nothing that is made of it can leave 32 bits but by
counting 2^30 times: additions of anything other than -1, 0 and 1 may not feed themselves, from one
call of the program to the next either. Of other sums it would take a thousand in a row. What the
program itself makes longer, from 32 to 64 bits, stays so.
"""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.passes.holders import (
    Classes,
    functions_of,
    node,
    result,
    slots,
    steps_in,
)

WIDE, NARROW = np.dtype(np.int64), np.dtype(np.int32)

ALIKE = frozenset(("select", "add", "sub", "min", "max", "neg", "abs", "and", "or", "xor", "rem",
                   "div", "shift_right_arithmetic"))  # fmt: skip
"""Operations whose results have the type of their operands, and stay within 32 bits."""

MOST = 2**20
"""Largest size of parameters, tables and terms of sums that become shorter."""

COMPARED = frozenset(("lt", "le", "gt", "ge", "eq", "ne"))


@dataclass(frozen=True)
class Ports:
    """A function with holders of its parameters and results, None for those outside of all others.

    Parameters and results of several functions may have the same holder, such as a number that one
    call leaves to the next.
    """

    function: ir.Function
    params: Sequence[Hashable | None]
    results: Sequence[Hashable | None]

    def links(self) -> Iterator[tuple[Hashable, Hashable]]:
        """Yield the holders of parameters and results with those of the function."""
        pairs = [(x.number, key) for x, key in zip(self.function.params, self.params, strict=True)]
        pairs += [(key, result(self.function, i)) for i, key in enumerate(self.results)]
        yield from (pair for pair in pairs if None not in pair)


def narrow(programs: Sequence[Ports], refused: Sequence[Hashable] = ()) -> set[Hashable]:
    """Shorten whole numbers of programs in place; return the holders of ports that are shorter.

    `refused` are holders that must keep their 64 bits.
    """
    functions = {id(x): x for one in programs for x in functions_of(one.function)}
    return _Narrowing(programs, list(functions.values())).apply(refused)


class _Narrowing:
    """Holders of 64 bits, in sets of one type, and the successors of each."""

    def __init__(self, programs: Sequence[Ports], functions: Sequence[ir.Function]):
        self._functions = functions
        self._classes = Classes()
        self._after: dict[Hashable, set[Hashable]] = {}
        self._remainders = {
            step.out.number
            for function in functions
            for step in steps_in(function.block)
            if isinstance(step, ir.Operation) and step.name == "rem"
            if isinstance(step.args[1], np.generic)
        }
        self._units = {number for function in functions for number in _units(function)}
        self._wide: set[Hashable] = set()
        self._ports: set[Hashable] = set()
        for one in programs:
            for after, before in one.links():
                self._join(after, before)
            kinds = [(key, x) for key, x in zip(one.params, one.function.params, strict=True)]
            kinds += list(zip(one.results, one.function.results, strict=True))
            self._ports |= {key for key, x in kinds if key is not None and x.dtype == WIDE}
        for slot in self._slots():
            source = slot.source
            if source is not None:
                self._join(slot.holder, source)
            elif not _fits(slot.content):
                self._wide.add(slot.holder)

    def apply(self, refused: Sequence[Hashable]) -> set[Hashable]:
        """Shorten numbers in place; return the holders of ports that are shorter."""
        self._wide.update(refused)
        for function in self._functions:
            for step in steps_in(function.block):
                self._refuse(step)
        wide = {self._classes.of(holder) for holder in self._wide}

        def is_short(holder: Hashable) -> bool:
            return self._classes.of(holder) not in wide

        constants = [one for one in self._slots() if one.source is None and is_short(one.holder)]
        for slot in constants:
            slot.put(np.int32(int(slot.content)))  # pyright: ignore
        for function in self._functions:
            values = [*function.params, *function.results]
            for step in steps_in(function.block):
                values += ir.definitions(step)
                if isinstance(step, ir.Load | ir.Store):
                    values.append(step.memory)  # pyright: ignore
            for x in values:
                if not isinstance(x, np.generic) and x.dtype == WIDE and is_short(x.number):
                    _shorten(x)
        return {key for key in self._ports if is_short(key)}

    def _slots(self):
        for function in self._functions:
            for slot in slots(function, ALIKE, COMPARED):
                if getattr(slot.content, "dtype", WIDE) == WIDE:
                    yield slot

    def _join(self, after: Hashable, before: Hashable) -> None:
        self._classes.join(after, before)
        if after not in self._remainders:  # which are bounded, whatever the number before
            self._after.setdefault(before, set()).add(after)

    def _refuse(self, step: ir.Step) -> None:
        """Note the holders that a step keeps at 64 bits."""
        match step:
            case ir.Operation(name=name, args=args, out=out):
                wide = [
                    x.number for x in (*args, out) if isinstance(x, ir.Value) if x.dtype == WIDE
                ]
                if name == "convert":
                    kind = args[0].dtype
                    is_long = kind.kind in "iu" and kind.itemsize > 2 and kind != WIDE
                    if kind.kind == "f" or is_long:
                        self._wide.update(wide)
                elif name not in ALIKE | COMPARED or (out.dtype == WIDE and self._grows(step)):
                    self._wide.update(wide)
            case ir.Call(function=ir.Function(source=None)):
                values = [x for x in (*step.args, *step.outs) if isinstance(x, ir.Value)]
                self._wide.update(x.number for x in values)
            case ir.Load(memory=memory) | ir.Store(memory=memory):
                numbers = memory.initial if memory.dtype == WIDE else None
                if numbers is not None and np.any((numbers < -MOST) | (numbers > MOST)):
                    self._wide.add(memory.number)

    def _grows(self, step: ir.Operation) -> bool:
        """Whether an operation is a sum by more than `MOST`, one by more than one that may be an
        operand of itself later, or a shift that 32 bits do not have."""
        if step.name == "shift_right_arithmetic":
            places = step.args[1]
            return isinstance(places, ir.Value) or not 0 <= int(places) < 32
        if step.name not in ("add", "sub"):
            return False
        sizes = [abs(int(x)) for x in step.args if isinstance(x, np.generic)]
        if any(_is_unit(x, self._units) for x in step.args):
            return False
        if sizes and max(sizes) > MOST:
            return True
        before = {node(x) for x in step.args if isinstance(x, ir.Value)}
        visited: set[Hashable] = set()
        waiting: list[Hashable] = [step.out.number]
        while waiting:
            one = waiting.pop()
            if one not in visited:
                visited.add(one)
                waiting += self._after.get(one, ())
        return bool(before & visited)


def _units(function: ir.Function) -> set[int]:
    """Return the numbers of long values that are -1, 0 or 1: truth values and choices of these."""
    units: set[int] = set()
    for step in steps_in(function.block):
        if isinstance(step, ir.Operation) and step.out.dtype == WIDE:
            is_truth = step.name == "convert" and step.args[0].dtype == bool
            parts = step.args[1:] if step.name == "select" else ()
            if is_truth or (parts and all(_is_unit(x, units) for x in parts)):
                units.add(step.out.number)
    return units


def _is_unit(x: ir.Scalar, units: set[int]) -> bool:
    return abs(int(x)) <= 1 if isinstance(x, np.generic) else x.number in units


def _fits(x: object) -> bool:
    info = np.iinfo(NARROW)
    return info.min <= int(x) <= info.max  # pyright: ignore


def _shorten(x: ir.Value | ir.Memory) -> None:
    x.dtype = NARROW
    if isinstance(x, ir.Memory) and x.initial is not None:
        x.initial = x.initial.astype(NARROW)
