"""Statements that repeat for one element of an array after the other, written as loops."""

import re
from dataclasses import dataclass

_INDEX = re.compile(r"\[(\d+)\]")
VARIABLES = "ijkmn"
"""Of loops, from the innermost."""


@dataclass
class _Unit:
    """A statement: its lines, and how many loops it is made of; -1 is one that is no assignment."""

    lines: list[str]
    depth: int

    @property
    def text(self) -> str:
        return "\n".join(self.lines)


def rolled(lines: list[str]) -> list[str]:
    """The same statements in the same order, equal ones of neighbouring elements in loops."""
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
    found: list[_Unit] = []
    place = 0
    while place < len(units):
        run = _run(units, place)
        size = len(units[place].lines)
        if run * size >= size + 2 and run > 2 and units[place].depth < len(VARIABLES):
            found.append(_loop(units[place : place + run]))
            place += run
        else:
            found.append(units[place])
            place += 1
    return found


def _numbers(unit: _Unit) -> list[int]:
    return [int(number) for number in _INDEX.findall(unit.text)]


def _run(units: list[_Unit], first: int) -> int:
    """How many units from the first on differ by indices that go up by one or stay."""
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
            written = one.lines[-1] if one.depth == 0 and len(one.lines) == 1 else one.text
            target = len(_INDEX.findall(written.split(" = ")[0])) if one.depth == 0 else len(change)
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
    variable = VARIABLES[run[0].depth]
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
