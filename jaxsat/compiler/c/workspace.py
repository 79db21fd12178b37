"""Workspace of a C function: variables that several of its parts need, as fields of a structure."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from jaxsat.compiler.c.statements import Statement, statements, texts_of
from jaxsat.compiler.c.tidying import rolled

_MANY = 24
"""Largest number of elements that are set one by one; larger arrays use loops if possible."""

_DECLARED = re.compile(r"(?:const )?((?!(?:return|case)\b)\w+) (\w+(?:, \w+)*)((?:\[\d+\])*)")


def declared(text: str) -> tuple[str, list[str], str]:
    """Return type, names and dimensions of the variables that a statement declares."""
    match = _DECLARED.match(text)
    return (match[1], match[2].split(", "), match[3]) if match else ("", [], "")


class Workspace:
    """The structure behind a pointer; `kinds` are types and dimensions of its fields."""

    def __init__(
        self, pointer: str, kinds: Mapping[str, tuple[str, str]], block: Iterable[Statement]
    ):
        self._kinds, self._pointer = kinds, pointer
        self._rows = {
            name: f"(const {kinds[name][0]} (*)[{kinds[name][1].split('[', 2)[2]})"
            for text in texts_of(block)
            if text.startswith("const ")
            for name in declared(text)[1]
            if name in kinds and kinds[name][1].count("[") > 1
        }
        self._place = re.compile(rf"(?<![\w>.])({'|'.join(kinds)})\b(\[)?")

    def declaration(self, kind: str) -> list[str]:
        """Return the lines that define its type."""
        fields = [f"  {kind} {name}{shape};" for name, (kind, shape) in self._kinds.items()]
        return ["typedef struct {", *fields, f"}} {kind};", ""]

    def moved(self, block: Iterable[Statement]) -> list[Statement]:
        """Return the statements with its variables as fields: not declared, but set."""
        parts: list[Statement] = []
        for one in block:
            if one.heads:
                heads = [self._there(head) for head in one.heads]
                parts.append(Statement("", heads, [self.moved(inner) for inner in one.blocks]))
            elif one.is_comment:
                parts.append(one)
            else:
                texts = [
                    self._there(text)
                    for line in one.text.split("\n")
                    for text in _without_declaration(line, self._kinds)
                ]
                if "\n" in one.text:
                    texts = ["\n".join(texts)]
                if len(texts) > _MANY:
                    parts += statements(rolled([f"  {text}" for text in texts]))
                else:
                    parts += [Statement(text) for text in texts]
        return parts

    def _there(self, text: str) -> str:
        """Return a text with its variables as fields.

        No array is constant there: a row array must be cast where it is passed.
        """

        def place(match: re.Match) -> str:
            cast = "" if match[2] else self._rows.get(match[1], "")
            return f"{cast}{self._pointer}->{match[1]}{match[2] or ''}"

        return self._place.sub(place, text)


def _without_declaration(text: str, moved: Mapping[str, tuple[str, str]]) -> Sequence[str]:
    kind, names, dimensions = declared(text)
    if not any(name in moved for name in names):
        return [text]
    if " = " not in text:
        others = [name for name in names if name not in moved]
        return [f"{kind} {', '.join(others)}{dimensions};"] if others else []
    value = text.split(" = ", 1)[1].removesuffix(";")
    return [f"{place} = {element};" for place, element in _elements(names[0], value)]


def _elements(place: str, value: str) -> Iterator[tuple[str, str]]:
    """Yield the assignments of an initialiser, element by element."""
    if not value.startswith("{"):
        yield place, value
        return
    depth, begin, number = 0, 1, 0
    for end, letter in enumerate(value):
        depth += (letter in "{(") - (letter in "})")
        if (letter == "," and depth == 1) or (letter == "}" and depth == 0):
            yield from _elements(f"{place}[{number}]", value[begin:end].strip())
            begin, number = end + 1, number + 1
