"""Functions of C as a reviewer measures them: complexity, parameters and lines."""

import re
from collections.abc import Mapping
from typing import NamedTuple

_FUNCTION = re.compile(
    r"^(?!typedef|struct)\w[^;{}=]*?(\w+)\(([^;{}]*?)\)\s*\{$(.*?)^\}", re.M | re.S
)
_DECIDES = re.compile(r"\b(?:if|for|while|case)\b|&&|\|\||\?")
_COMMENT = re.compile(r"/\*.*?\*/", re.S)


class Size(NamedTuple):
    """McCabe's `complexity` (1, and 1 for each condition), `parameters`, and `lines`."""

    complexity: int
    parameters: int
    lines: int


def sizes(text: str) -> dict[str, Size]:
    """The sizes of the functions of a file by their names."""
    found = {}
    for match in _FUNCTION.finditer(_COMMENT.sub(lambda one: "\n" * one[0].count("\n"), text)):
        name, parameters, body = match.groups()
        count = 0 if parameters.strip() in ("", "void") else parameters.count(",") + 1
        complexity = 1 + len(_DECIDES.findall(body))
        found[name] = Size(complexity, count, match.group().strip().count("\n") + 1)
    return found


def too_large(files: Mapping[str, bytes]) -> dict[str, Size]:
    """Functions that fly and are above 15 in complexity, 10 parameters or 60 lines."""
    every: dict[str, Size] = {}
    for name in ("controller.c", "controller_guard.c", "controller_parameters.c"):
        every |= sizes(files[name].decode())
    limits = Size(15, 10, 60)
    return {
        name: size
        for name, size in every.items()
        if any(one > most for one, most in zip(size, limits, strict=True))
    }
