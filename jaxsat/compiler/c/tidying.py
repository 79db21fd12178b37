"""Tidying of C text: line breaks, fewer comments and declarations, loops, constants."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from jaxsat.compiler.c.naming import COUNTERS, comment

WIDTH = 92
"""Largest number of characters of an expression in a line."""

WIDEST = 100
"""Largest number of characters of a line."""


def wrapped(text: str) -> list[str]:
    """Return the words of a text in lines."""
    lines, line = [], " "
    for word in text.split(" "):
        if len(line) + len(word) > WIDTH:
            lines.append(line)
            line = " "
        line += f" {word}"
    return [*lines, line]


def in_lines(text: str, indent: str) -> list[str]:
    """Break a long statement or function head, at commas if there are any."""
    room = WIDEST - len(indent)
    if len(text) <= room:
        return [indent + text]
    words = re.split(r"(?<=,) " if re.match(r"[\w* ]+\(|[^=]*= \{", text) else " ", text)
    lines, line = [], ""
    for word in words:
        if line and len(line) + 1 + len(word) > room:
            lines.append(indent + line)
            line = f"    {word}"
        else:
            line = f"{line} {word}" if line else word
    return [*lines, indent + line]


def dimensions(shape: tuple[int, ...]) -> str:
    """Return the dimensions of an array of C."""
    return "".join(f"[{n}]" for n in shape)


def braced(texts: Sequence[str], shape: tuple[int, ...]) -> str:
    """Return the initialiser of an array of this shape."""
    if len(shape) <= 1:
        return f"{{{', '.join(texts)}}}"
    size = len(texts) // shape[0]
    rows = [braced(texts[i : i + size], shape[1:]) for i in range(0, len(texts), size)]
    return f"{{{', '.join(rows)}}}"


FEW_LINES = 8
"""Number of statements of another function of the source that need no comment."""


def tidied(lines: list[str], own: str | None, single: Mapping[str, str]) -> list[str]:
    """Replace arrays with one used element by variables, and repetitions by loops.

    `own` is the Python function's name; `single` has the elements that are alone in their arrays,
    such as "x[2]", and their types.
    """
    text = "\n".join(_declared_together(_with_few_comments(lines, own)))
    for element, kind in single.items():
        name, part = element.split("[")[0], re.escape(element)
        text = re.sub(rf"\n *\w+ {name}(\[\d+\])+;(?=\n)", "", f"\n{text}")[1:]
        text = re.sub(rf"(^|\n)( *){part} =", rf"\1\2const {kind} {name} =", text, count=1)
        text = re.sub(rf"(?<![\w>.]){part}", name, text)
    return rolled(text.split("\n")) if text else []


def _with_few_comments(lines: list[str], own: str | None) -> list[str]:
    """Remove the comments on the origin of a line or two.

    A comment on the function's `own` statements follows only statements of another function.
    """
    places = [i for i, line in enumerate(lines) if line.lstrip().startswith("/*")]
    left_out = set()
    away = False
    for place, end in pairwise([*places, len(lines)]):
        inside = [line for line in lines[place + 1 : end] if line.endswith(";")]
        back = own is not None and lines[place].strip() == comment(own)[0]
        if len(inside) < FEW_LINES or (back and not away):
            left_out.add(place)
        else:
            away = not back
    return [line for i, line in enumerate(lines) if i not in left_out]


def _declared_together(lines: list[str]) -> list[str]:
    merged: list[str] = []
    for line in lines:
        here = _DECLARED.fullmatch(line)
        before = _DECLARED.fullmatch(merged[-1]) if merged and here else None
        if here and before and here[1] == before[1] and len(merged[-1]) + len(here[2]) < 98:
            merged[-1] = f"{merged[-1][:-1]}, {here[2]};"
        else:
            merged.append(line)
    return merged


_DECLARED = re.compile(r"( *(?:double|float|bool|u?int\d+_t)) (\w+(?:, \w+)*);")


_INDEX = re.compile(r"\[(\d+)\]")


@dataclass
class _Unit:
    """A statement: its lines, and its depth of loops; -1 for other statements than assignments."""

    lines: list[str]
    depth: int

    @property
    def text(self) -> str:
        return "\n".join(self.lines)


def rolled(lines: list[str]) -> list[str]:
    """Return the statements in their order, with equal ones of neighbouring elements in loops."""
    units = _units(lines)
    while True:
        shorter = _rolled_once(units)
        if len(shorter) == len(units):
            return [line for unit in units for line in unit.lines]
        units = shorter


def _units(lines: list[str]) -> list[_Unit]:
    units: list[_Unit] = []
    place = 0
    while place < len(lines):
        line = lines[place]
        if line.endswith(" =") and place + 1 < len(lines):
            end = next(i for i in range(place, len(lines)) if lines[i].endswith(";")) + 1
            units.append(_Unit(lines[place:end], 0))
            place = end
            continue
        plain = re.match(r"\s*[\w>.\-]+(\[\d+\])+ = .*;$", line) is not None
        units.append(_Unit([line], 0 if plain else -1))
        place += 1
    return units


def _rolled_once(units: list[_Unit]) -> list[_Unit]:
    result: list[_Unit] = []
    place = 0
    while place < len(units):
        run = _run(units, place)
        size = len(units[place].lines)
        if run * size >= size + 2 and run > 2 and units[place].depth < len(COUNTERS):
            result.append(_loop(units[place : place + run]))
            place += run
        else:
            result.append(units[place])
            place += 1
    return result


def _numbers(unit: _Unit) -> list[int]:
    return [int(number) for number in _INDEX.findall(unit.text)]


def _run(units: list[_Unit], first: int) -> int:
    """Return how many units from the first on differ by indices that go up by one or stay."""
    one = units[first]
    if one.depth < 0 or not _INDEX.search(one.text):
        return 1
    template = _INDEX.sub("[#]", one.text)
    before, steps, count = _numbers(one), None, 1
    for unit in units[first + 1 :]:
        if unit.depth != one.depth or _INDEX.sub("[#]", unit.text) != template:
            break
        now = _numbers(unit)
        change = [b - a for a, b in zip(before, now, strict=True)]
        if steps is None:
            text = one.lines[-1] if one.depth == 0 and len(one.lines) == 1 else one.text
            target = len(_INDEX.findall(text.split(" = ")[0])) if one.depth == 0 else len(change)
            if not set(change) <= {0, 1} or not any(change[:target]):
                break
            steps = change
        if change != steps:
            break
        before, count = now, count + 1
    return count


def _loop(run: list[_Unit]) -> _Unit:
    first, second = _numbers(run[0]), _numbers(run[1])
    moving = [a != b for a, b in zip(first, second, strict=True)]
    begin = first[moving.index(True)]
    variable = COUNTERS[run[0].depth]
    places = iter(range(len(first)))

    def index(match: re.Match) -> str:
        place = next(places)
        if not moving[place]:
            return match.group()
        offset = first[place] - begin
        if not offset:
            return f"[{variable}]"
        return f"[{variable} {'+' if offset > 0 else '-'} {abs(offset)}]"

    text = _INDEX.sub(index, run[0].text)
    margin = re.match(r"\s*", run[0].lines[0])
    indent = margin.group() if margin else ""
    body = [f"  {line}" for line in text.split("\n")]
    turns = f"int32_t {variable} = {begin}; {variable} < {begin + len(run)}; {variable}++"
    head = f"{indent}for ({turns}) {{"
    return _Unit([head, *body, f"{indent}}}"], run[0].depth + 1)


_ARRAY = re.compile(r"( *)(double|float|bool|u?int\d+_t) (\w+)((?:\[\d+\])+);")
_CONSTANT = re.compile(r" *const \w+ \w+(\[\d+\])* =")


def with_initialisers(lines: Sequence[str]) -> list[str]:
    """Turn arrays that are set once, element by element, into constants with initialisers."""
    statements = _statements(lines)
    place = 0
    while place < len(statements):
        declaration = _ARRAY.fullmatch("\n".join(statements[place]))
        assignment = _assigned(statements, place, declaration) if declaration else None
        if declaration and assignment:
            statements[place : assignment[1]] = [
                *assignment[2],
                _initialised(declaration, assignment[0]),
            ]
            place += len(assignment[2])
            if declaration[4].count("[") > 1:
                statements = [_without_casts(one, declaration[3]) for one in statements]
        place += 1
    return [line for one in statements for line in one]


def _statements(lines: Sequence[str]) -> list[list[str]]:
    """Group lines by statement."""
    statements: list[list[str]] = []
    is_open = False
    for line in lines:
        if is_open:
            statements[-1].append(line)
        else:
            statements.append([line])
        plain = line.strip()
        is_open = not plain.endswith((";", "{", "}", "*/", ":")) and plain != ""
    return statements


def _assigned(
    statements: Sequence[list[str]], first: int, declaration: re.Match
) -> tuple[list[str], int, list[list[str]]] | None:
    """Return the elements' expressions, the index after the last, and the statements in between."""
    name = declaration[3]
    shape = [int(n) for n in re.findall(r"\d+", declaration[4])]
    elements = [f"{name}{''.join(f'[{i}]' for i in index)}" for index in np.ndindex(*shape)]
    values: list[str] = []
    between: list[list[str]] = []
    place = first + 1
    while len(values) < len(elements):
        if place == len(statements):
            return None
        text = " ".join(line.strip() for line in statements[place])
        target, sign, value = text.partition(" = ")
        if sign and target == elements[len(values)] and not re.search(rf"\b{name}\b", value):
            values.append(value.removesuffix(";"))
        elif _CONSTANT.match(statements[place][0]) and not re.search(rf"\b{name}\b", text):
            between.append(statements[place])
        else:
            return None
        place += 1
    rest = "\n".join(line for one in statements[place:] for line in one)
    if re.search(rf"(&|^ *){name}\[", rest, re.MULTILINE):
        return None
    return values, place, between


def _initialised(declaration: re.Match, values: Sequence[str]) -> list[str]:
    indent, kind, name, dimensions = declaration.groups()
    shape = tuple(int(n) for n in re.findall(r"\d+", dimensions))
    begin = f"{indent}const {kind} {name}{dimensions} = "
    text = f"{begin}{braced(values, shape)};"
    if len(text) <= WIDEST or len(shape) > 1:
        return in_lines(text.strip(), indent)
    lines = [f"{begin}{{"]
    for number, value in enumerate(values):
        end = "};" if number == len(values) - 1 else ","
        lines += in_lines(f"{value}{end}", f"{indent}    ")
    return lines


def _without_casts(lines: list[str], name: str) -> list[str]:
    return [
        re.sub(rf"\(const \w+ \(\*\)(?:\[\d+\])+\){name}\b(?!\[)", name, line) for line in lines
    ]
