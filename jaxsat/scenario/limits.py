"""Limits on the size of a scenario, checked by one pass over its text before it is parsed.

TOML allows keys of any number of parts, numbers of any number of digits and brackets of any depth,
for which a parser takes time and memory that grow faster than the file.
"""

import re

from jaxsat.core.errors import JaxsatError

MAX_FILE_SIZE = 1_000_000
"""Largest file, bytes; larger files are no scenarios."""

MAX_OVERRIDE_LENGTH = 100_000
"""Largest number of characters of one `--set`."""

MAX_OVERRIDES = 1000
MAX_KEYS = 2000
"""Largest number of keys and table headings of one file."""

MAX_PARTS = 16
"""Largest number of parts of one dotted key; no key of a scenario has more than four."""

MAX_DEPTH = 16
MAX_ENTRIES = 1000
"""Largest number of entries of one list."""

MAX_WORD_LENGTH = 100
"""Largest number of characters of one bare key, or of one number."""

MAX_TEXT_LENGTH = 20_000
"""Largest number of characters of one text, quotes and escapes included."""

TOKEN = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*+"{3,5}'  # multi-line texts, then single-line texts
    r"|'''(?:[^']|'(?!''))*+'{3,5}"
    r'|"(?!"")(?:[^"\\\n]|\\.)*+"'
    r"|'(?!'')[^'\n]*+'"
    r"|#[^\n]*+"
    r"|[^\s\"'#\[\]{}.,=]++"  # bare keys, numbers and truth values
    r"|[\s\"'\[\]{}.,=]",
    re.DOTALL,
)
"""A token of TOML: a text, a comment, a word, or one other character."""


class Excess(JaxsatError, ValueError):
    """A scenario that exceeds a limit; `line` counts from 1."""

    line: int

    def __init__(self, message: str, line: int):
        super().__init__(message)
        self.line = line


def require_modest(text: str) -> None:
    """Raise `Excess` if the text of a TOML document exceeds a limit.

    Linear in time, with negligible memory. Invalid TOML is left to the parser, which stops at the
    first mistake.
    """
    line = 1
    keys = parts = 0
    in_value = False  # on this line, after an equals sign
    entries: list[int] = []  # of each open bracket
    for match in TOKEN.finditer(text):
        token = match.group()
        first = token[0]
        if token in ('"', "'"):
            return  # start of an unterminated text
        if first in "\"'":
            line += token.count("\n")
            _require(
                len(token) <= MAX_TEXT_LENGTH,
                f"texts of at most {MAX_TEXT_LENGTH} characters",
                line,
            )
        elif token == "\n":
            line, parts, in_value = line + 1, 0, bool(entries)
        elif token == ".":
            parts += 1
            _require(parts < MAX_PARTS, f"keys of at most {MAX_PARTS} parts", line)
        elif token in "[{":
            keys += not in_value and not entries  # a heading
            entries.append(0)
            _require(keys <= MAX_KEYS, f"at most {MAX_KEYS} keys", line)
            _require(len(entries) <= MAX_DEPTH, f"brackets at most {MAX_DEPTH} deep", line)
        elif token in "]}":
            del entries[-1:]
        elif token == ",":
            parts = 0
            if entries:
                entries[-1] += 1
                _require(
                    entries[-1] <= MAX_ENTRIES, f"lists of at most {MAX_ENTRIES} entries", line
                )
        elif token == "=":
            keys, parts, in_value = keys + 1, 0, True
            _require(keys <= MAX_KEYS, f"at most {MAX_KEYS} keys", line)
        elif first != "#":
            _require(
                len(token) <= MAX_WORD_LENGTH,
                f"numbers and bare keys of at most {MAX_WORD_LENGTH} characters",
                line,
            )


def _require(good: bool, allowed: str, line: int) -> None:
    if not good:
        raise Excess(f"must have {allowed}, got more", line)
