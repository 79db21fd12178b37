"""C text in lines: statements broken where they are too long, dimensions and initialisers."""

import re
from collections.abc import Sequence

WIDTH = 92
"""Characters of an expression in a line."""

WIDEST = 100
"""Characters of a line."""


def wrapped(text: str) -> list[str]:
    """Words in lines."""
    lines, line = [], " "
    for word in text.split(" "):
        if len(line) + len(word) > WIDTH:
            lines.append(line)
            line = " "
        line += f" {word}"
    return [*lines, line]


def in_lines(text: str, indent: str) -> list[str]:
    """A statement or a function's head, broken where it is too long, at commas if there are any."""
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
    """The dimensions of an array of C."""
    return "".join(f"[{n}]" for n in shape)


def braced(texts: Sequence[str], shape: tuple[int, ...]) -> str:
    """An initialiser."""
    if len(shape) <= 1:
        return f"{{{', '.join(texts)}}}"
    size = len(texts) // shape[0]
    rows = [braced(texts[i : i + size], shape[1:]) for i in range(0, len(texts), size)]
    return f"{{{', '.join(rows)}}}"
