"""The statements of a C function made short: fewer comments and declarations, loops, constants."""

import re
from collections.abc import Mapping
from itertools import pairwise

from jaxsat.compiler.c.initialisers import with_initialisers
from jaxsat.compiler.c.naming import comment
from jaxsat.compiler.c.rolling import rolled

FEW_LINES = 8
"""Statements of another function of the source that need no comment."""


def tidied(lines: list[str], own: str | None, single: Mapping[str, str]) -> list[str]:
    """Arrays of which one element is used are no arrays, and repetitions are loops.

    `own` is the Python function's name; `single` has the elements that are alone in their arrays,
    such as "x[2]", and their types.
    """
    text = "\n".join(_declared_together(_with_few_comments(lines, own)))
    for element, kind in single.items():
        name, part = element.split("[")[0], re.escape(element)
        text = re.sub(rf"\n *\w+ {name}(\[\d+\])+;(?=\n)", "", f"\n{text}")[1:]
        text = re.sub(rf"(^|\n)( *){part} =", rf"\1\2const {kind} {name} =", text, count=1)
        text = re.sub(rf"(?<![\w>.]){part}", name, text)
    return with_initialisers(rolled(text.split("\n"))) if text else []


def _with_few_comments(lines: list[str], own: str | None) -> list[str]:
    """Without the comments that tell where a line or two come from.

    That the function's `own` statements go on is told after those of another one alone.
    """
    places = [i for i, line in enumerate(lines) if line.lstrip().startswith("/*")]
    gone = set()
    away = False
    for place, end in pairwise([*places, len(lines)]):
        inside = [line for line in lines[place + 1 : end] if line.endswith(";")]
        back = own is not None and lines[place].strip() == comment(own)[0]
        if len(inside) < FEW_LINES or (back and not away):
            gone.add(place)
        else:
            away = not back
    return [line for i, line in enumerate(lines) if i not in gone]


def _declared_together(lines: list[str]) -> list[str]:
    """Neighbouring variables of one type, which functions set, in one declaration."""
    found: list[str] = []
    for line in lines:
        here = _DECLARED.fullmatch(line)
        before = _DECLARED.fullmatch(found[-1]) if found and here else None
        if here and before and here[1] == before[1] and len(found[-1]) + len(here[2]) < 98:
            found[-1] = f"{found[-1][:-1]}, {here[2]};"
        else:
            found.append(line)
    return found


_DECLARED = re.compile(r"( *(?:double|float|bool|u?int\d+_t)) (\w+(?:, \w+)*);")
