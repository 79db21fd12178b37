"""Long functions of C cut into parts of reviewable length.

Statements stay in their order, so that all bits do. A function is cut where few variables are
needed on both sides; those that several parts need are fields of a structure, its workspace.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count, pairwise

from jaxsat.compiler.c.naming import Names
from jaxsat.compiler.c.statements import Statement, statements, texts_of
from jaxsat.compiler.c.tidying import in_lines, with_initialisers
from jaxsat.compiler.c.workspace import Workspace, declared

COMPLEXITY, LINES = 15, 60
"""Limits of a function: cyclomatic complexity, and lines with its head and braces."""

_ROOM = 50
"""Lines of statements in a part; further ones are its head, and breaks of long lines."""

_PART = 6
"""Number of variables on both sides of a cut that weighs as much as one more part."""

_SET = re.compile(r" *\*?(?:(\w+)->)?(\w+)(?:\[[^]]*\])* =")
_WORD = re.compile(r"(?<![\w>.])[A-Za-z_]\w*")


@dataclass(frozen=True)
class Text:
    """A function of C: head without parentheses, declared parameters by name, and lines. `@` stands
    for its name, and `@` with a word for that of a part."""

    head: str
    parameters: dict[str, str]
    lines: Sequence[str]
    about: str = ""
    declarations: Sequence[str] = ()


@dataclass(frozen=True)
class Parts:
    """A function in parts: declarations before them, and the parts, callers last.

    `wishes` are the suffixes of the names for which `@` with a word stands.
    """

    declarations: Sequence[str]
    functions: Sequence[Text]
    wishes: dict[str, str]


def in_parts(function: Text, names: Names) -> Parts:
    """Return a short function unchanged, others in parts; `names` are those in use."""
    block = statements(function.lines)
    if _fits(block, 1, LINES - 2 - len(in_lines(_head(function), ""))):
        return Parts(function.declarations, (function,), {})
    space, work = names.new("space"), names.new("work")
    room = _ROOM
    while True:
        parts = _Cutter(function, room, space, work).parts()
        if all(_is_small(one) for one in parts.functions) or room < LINES // 3:
            return parts
        room -= 4


def _is_small(function: Text) -> bool:
    decisions = sum(one.decisions for one in statements(function.lines))
    lines = len(lines_of(function)) - 1 + len(in_lines(_head(function), ""))
    return lines <= LINES - 2 and decisions < COMPLEXITY


def lines_of(function: Text) -> list[str]:
    """Return all lines of a function; its head, where names follow, is one."""
    return [_head(function), "{", *with_initialisers(function.lines), "}"]


def _head(function: Text) -> str:
    return f"{function.head}({', '.join(function.parameters.values()) or 'void'})"


def _fits(block: Sequence[Statement], depth: int, room: int) -> bool:
    lines = sum(len(one.lines(depth)) for one in block)
    return lines <= room and sum(one.decisions for one in block) < COMPLEXITY


class _Cutter:
    def __init__(self, function: Text, room: int, space: str, work: str):
        self._function, self._room, self._space, self._work = function, room, space, work
        block = statements(function.lines)
        self._kinds = {
            name: (kind, dimensions)
            for text in texts_of(block)
            for kind, names, dimensions in [declared(text)]
            for name in names
        }
        self._numbers = count(1)
        self._parts: dict[int, list[Statement]] = {}
        self._shorten(block, 1)
        self._main = self._cut(block, 1)

    def _shorten(self, block: Sequence[Statement], depth: int) -> None:
        for one in block:
            if one.heads and not _is_rolled(one) and not _fits([one], depth, self._room):
                for inner in one.blocks:
                    self._shorten(inner, depth + 1)
                for inner in sorted(one.blocks, key=_size, reverse=True):
                    is_switch = any(x.heads and x.heads[0].endswith(": {") for x in inner)
                    if not is_switch and not _fits([one], depth, self._room // 2):
                        inner[:] = self._cut(inner, depth + 1)

    def _cut(self, block: Sequence[Statement], depth: int) -> list[Statement]:
        """Reduce a block to at most a page of calls of parts and of statements that must stay."""
        cuts = _best_cuts(block, depth, self._room, self._kinds)
        remaining: list[Statement] = []
        for begin, end in pairwise(cuts):
            part = list(block[begin:end])
            alone = len(part) == 1 and not (part[0].heads or part[0].decisions)
            alone = alone and " = {" not in part[0].text
            if alone or part[0].leaves:
                remaining += part
                continue
            number = next(self._numbers)
            self._parts[number] = part
            remaining.append(Statement(part=number))
        if len(remaining) < len(block) and not _fits(remaining, depth, self._room):
            return self._cut(remaining, depth)  # calls of so many parts are parts, too
        return remaining

    def parts(self) -> Parts:
        """Return the parts of the function."""
        function, shared = self._function, self._shared()
        every = [*self._main, *chain(*self._parts.values())]
        workspace = Workspace(self._work, shared, every) if shared else None
        parameters = dict(function.parameters)
        if workspace is not None:
            parameters[self._work] = f"@work *{self._work}"
        numbers = {part: number for number, part in enumerate(self._in_order(self._main), 1)}
        needs: dict[int, list[str]] = {}
        functions: list[Text] = []
        wishes: dict[str, str] = {}
        for part, block in (*self._parts.items(), (0, self._main)):
            block = list(self._with_calls(block, needs))
            block = block if workspace is None else workspace.moved(block)
            lines = [line for one in block for line in one.lines(1)]
            words = set(_words(block))
            needs[part] = [name for name in parameters if name in words]
            if part:
                wishes[str(part)] = self._name(lines)
                parameters_there = {name: parameters[name] for name in needs[part]}
                about = f"Part {numbers[part]} of {len(numbers)} of @."
                functions.append(Text(f"static void @{part}", parameters_there, lines, about))
            else:
                space = [f"@work {self._space};", f"@work *{self._work} = &{self._space};"]
                begin = [f"  {line}" for line in space if workspace is not None]
                functions.append(replace(function, lines=[*begin, *lines]))
        wishes = {str(part): wishes[str(part)] for part in numbers}
        if workspace is None:
            return Parts(function.declarations, functions, wishes)
        declarations = [*function.declarations, *workspace.declaration("@work")]
        return Parts(declarations, functions, wishes | {"work": "work"})

    def _shared(self) -> dict[str, tuple[str, str]]:
        """Return the variables that several parts need, with types and dimensions."""
        homes: dict[str, set[int]] = {}
        for part, block in ((0, self._main), *self._parts.items()):
            for word in _words(block):
                homes.setdefault(word, set()).add(part)
        return {name: kind for name, kind in self._kinds.items() if len(homes.get(name, ())) > 1}

    def _in_order(self, block: Iterable[Statement]) -> Iterator[int]:
        """Yield the numbers of parts in the order of their calls."""
        for one in block:
            if one.part is not None:
                yield one.part
                yield from self._in_order(self._parts[one.part])
            for inner in one.blocks:
                yield from self._in_order(inner)

    def _name(self, lines: Iterable[str]) -> str:
        """Return the name of the last result of a part for others."""
        own = self._function.parameters
        matches = [match for line in lines if (match := _SET.match(line))]
        results = [one[2] for one in matches if one[1] in (self._work, "found") or one[2] in own]
        return re.sub(r"_\d+$", "", results[-1]) if results else "part"

    def _with_calls(
        self, block: Iterable[Statement], needs: dict[int, list[str]]
    ) -> Iterator[Statement]:
        """Yield the statements with calls of the parts and their arguments."""
        for one in block:
            if one.part is not None:
                yield Statement(f"@{one.part}({', '.join(needs[one.part])});")
            elif one.heads:
                blocks = [list(self._with_calls(inner, needs)) for inner in one.blocks]
                yield Statement(heads=one.heads, blocks=blocks)
            else:
                yield one


def _best_cuts(
    block: Sequence[Statement], depth: int, room: int, names: Iterable[str]
) -> list[int]:
    crossing = _crossing(block, set(names))
    lines = [len(one.lines(depth)) for one in block]
    decisions = [one.decisions for one in block]
    alone = [one.leaves for one in block]
    best: list[tuple[float, int]] = [(0.0, 0)]
    for end in range(1, len(block) + 1):
        choices = []
        for begin in range(end - 1, -1, -1):
            many = sum(lines[begin:end]) > room or sum(decisions[begin:end]) >= COMPLEXITY
            if (many or any(alone[begin:end])) and begin < end - 1:
                break
            before = best[begin][0] + crossing[begin] + _PART
            choices.append((before - _PART * block[begin].is_comment, begin))
        best.append(min(choices))
    cuts = [len(block)]
    while cuts[-1]:
        cuts.append(best[cuts[-1]][1])
    return cuts[::-1]


def _crossing(block: Sequence[Statement], names: set[str]) -> list[int]:
    """Return how many variables are needed both before and behind each place of a block."""
    first: dict[str, int] = {}
    last: dict[str, int] = {}
    for place, one in enumerate(block):
        for word in _words([one]):
            if word in names:
                first.setdefault(word, place)
                last[word] = place
    changes = [0] * (len(block) + 2)
    for name, place in first.items():
        changes[place + 1] += 1
        changes[last[name] + 1] -= 1
    total, counts = 0, []
    for change in changes[: len(block)]:
        total += change
        counts.append(total)
    return counts


def _words(block: Iterable[Statement]) -> Iterator[str]:
    for text in texts_of(block):
        yield from _WORD.findall(text)


def _size(block: Sequence[Statement]) -> int:
    return sum(len(one.lines(1)) + 4 * one.decisions for one in block)


def _is_rolled(one: Statement) -> bool:
    return one.heads[0].startswith("for (int32_t ")
