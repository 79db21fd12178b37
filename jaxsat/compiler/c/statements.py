"""Statements of a C function's text as a tree, with their sizes."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from jaxsat.compiler.c.tidying import in_lines

LINE = 100
"""Largest number of characters in a line."""

_DECIDES = re.compile(r"\?|&&|\|\||\b(?:if|for|while|case)\b")
_RECORD = re.compile(r"const \w+ (\w+) = \{\.")


@dataclass
class Statement:
    """A statement: its text, or `blocks`, each behind one of the `heads`.

    The text is one line, or two with a required predecessor. `part` is the number of the function
    that the statement calls in place of others.
    """

    text: str = ""
    heads: list[str] = field(default_factory=list)
    blocks: list[list["Statement"]] = field(default_factory=list)
    part: int | None = None

    @property
    def is_comment(self) -> bool:
        """Whether the text is a comment."""
        return self.text.startswith("/*")

    @property
    def leaves(self) -> bool:
        """Whether the statement ends the function, or an enclosing loop or case."""
        head = self.heads[0] if self.heads else self.text
        if head.startswith(("for", "switch")):
            return False
        if head.startswith(("case", "default", "return", "break")):
            return True
        return any(one.leaves for block in self.blocks for one in block)

    def texts(self) -> Iterator[str]:
        """Yield all texts without comments."""
        if not self.is_comment:
            yield from self.heads or self.text.split("\n")
        for block in self.blocks:
            for one in block:
                yield from one.texts()

    @property
    def decisions(self) -> int:
        """Contribution to the cyclomatic complexity of the function."""
        return sum(len(_DECIDES.findall(text)) for text in self.texts())

    def lines(self, depth: int) -> list[str]:
        """Return its lines at this depth of blocks."""
        indent = "  " * depth
        if not self.heads:
            return _lines(self.text, indent)
        lines = []
        for head, block in zip(self.heads, self.blocks, strict=True):
            lines += _lines(head, indent)
            lines += [line for one in block for line in one.lines(depth + 1)]
        return [*lines, f"{indent}}}"]


def texts_of(block: Iterable[Statement]) -> Iterator[str]:
    """Yield the texts of statements."""
    for one in block:
        yield from one.texts()


def _lines(text: str, indent: str) -> list[str]:
    if "\n" in text:
        return [line for one in text.split("\n") for line in _lines(one, indent)]
    place, sign, value = text.partition(" = ")
    if len(indent) + len(text) <= LINE or not sign or value.startswith("{") or "(" in place:
        return in_lines(text, indent)
    return [f"{indent}{place} =", *in_lines(value, f"{indent}    ")]


def statements(lines: Sequence[str]) -> list[Statement]:
    """Return the statements of a function's lines."""
    texts: list[str] = []
    is_open = False
    for line in lines:
        plain = line.strip()
        if is_open:
            texts[-1] += f" {plain}"
        else:
            texts.append(plain)
        is_open = not plain.endswith((";", "{", "}", "*/"))
    parts, end = _block(texts, 0)
    assert end == len(texts)
    return parts


def _block(texts: Sequence[str], place: int) -> tuple[list[Statement], int]:
    """Return the statements up to the end of a block, and the index of that end."""
    parts: list[Statement] = []
    while place < len(texts) and not texts[place].startswith("}"):
        if not texts[place].endswith("{"):
            parts.append(Statement(texts[place]))
            place += 1
            continue
        one = Statement()
        while texts[place] != "}":
            one.heads.append(texts[place])
            block, place = _block(texts, place + 1)
            one.blocks.append(block)
        parts.append(one)
        place += 1
    return _with_records(parts), place


def _with_records(block: list[Statement]) -> list[Statement]:
    """Join records of arguments with the calls for which they are made."""
    parts: list[Statement] = []
    for one in block:
        record = _RECORD.match(parts[-1].text) if parts else None
        if record and re.search(rf"&{record[1]}\b", one.text):
            parts[-1] = Statement(f"{parts[-1].text}\n{one.text}")
        else:
            parts.append(one)
    return parts
