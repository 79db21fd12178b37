"""Arrays whose elements are set one after the other, as constants with initialisers."""

import re
from collections.abc import Sequence

import numpy as np

from jaxsat.compiler.c.text import WIDEST, braced, in_lines

_DECLARED = re.compile(r"( *)(double|float|bool|u?int\d+_t) (\w+)((?:\[\d+\])+);")
_CONSTANT = re.compile(r" *const \w+ \w+(\[\d+\])* =")


def with_initialisers(lines: Sequence[str]) -> list[str]:
    """The same statements with arrays that are set once, element by element, as constants."""
    statements = _statements(lines)
    place = 0
    while place < len(statements):
        declared = _DECLARED.fullmatch("\n".join(statements[place]))
        found = _assigned(statements, place, declared) if declared else None
        if declared and found:
            statements[place : found[1]] = [*found[2], _initialised(declared, found[0])]
            place += len(found[2])
            if declared[4].count("[") > 1:
                statements = [_without_casts(one, declared[3]) for one in statements]
        place += 1
    return [line for one in statements for line in one]


def _statements(lines: Sequence[str]) -> list[list[str]]:
    """Lines of one statement together."""
    found: list[list[str]] = []
    is_open = False
    for line in lines:
        if is_open:
            found[-1].append(line)
        else:
            found.append([line])
        plain = line.strip()
        is_open = not plain.endswith((";", "{", "}", "*/", ":")) and plain != ""
    return found


def _assigned(
    statements: Sequence[list[str]], first: int, declared: re.Match
) -> tuple[list[str], int, list[list[str]]] | None:
    """The elements' expressions, the statement after the last, and what stands in between."""
    name = declared[3]
    shape = [int(n) for n in re.findall(r"\d+", declared[4])]
    wanted = [f"{name}{''.join(f'[{i}]' for i in index)}" for index in np.ndindex(*shape)]
    values: list[str] = []
    between: list[list[str]] = []
    place = first + 1
    while len(values) < len(wanted):
        if place == len(statements):
            return None
        text = " ".join(line.strip() for line in statements[place])
        target, sign, value = text.partition(" = ")
        if sign and target == wanted[len(values)] and not re.search(rf"\b{name}\b", value):
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


def _initialised(declared: re.Match, values: Sequence[str]) -> list[str]:
    indent, kind, name, dimensions = declared.groups()
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
    """A constant array of rows is handed over as it is."""
    return [
        re.sub(rf"\(const \w+ \(\*\)(?:\[\d+\])+\){name}\b(?!\[)", name, line) for line in lines
    ]
