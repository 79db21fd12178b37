"""Line numbers of the keys and array entries of a TOML file."""

import bisect
import re
import tomllib

from jaxsat.scenario.errors import Location

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_QUOTED = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'')
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_LONG_TEXT = re.compile(r'"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?\'{3,5}', re.DOTALL)
_SCALAR = re.compile(r"[^,\]}\n#]+")


def line_map(text: str) -> dict[Location, int]:
    """Line numbers, from 1, by location; `text` must be valid TOML (checked by `tomllib` first)."""
    return _Scanner(text).document()


def nearest_line(lines: dict[Location, int], location: Location) -> int:
    """Line of a location, or of the closest enclosing table or array; 1 without any."""
    while location and location not in lines:
        location = location[:-1]
    return lines.get(location, 1)


class _Scanner:
    """One pass over a valid document."""

    def __init__(self, text: str):
        self.text = text
        self.position = 0
        self.newlines = [match.start() for match in re.finditer("\n", text)]
        self.lines: dict[Location, int] = {}
        self.array_tables: dict[Location, int] = {}

    def document(self) -> dict[Location, int]:
        table: Location = ()
        self._skip(_BLANK)
        while self.position < len(self.text):
            if self._peek() == "[":
                table = self._header()
            else:
                self._pair(table)
            self._skip(_BLANK)
        return self.lines

    def _header(self) -> Location:
        line = self._line()
        is_array = self.text.startswith("[[", self.position)
        self.position += 2 if is_array else 1
        self._skip(_SPACE)
        path = self._key()
        self.position += 2 if is_array else 1
        for end in range(1, len(path)):
            self.lines.setdefault(path[:end], line)
        if not is_array:
            self.lines[path] = line
            return path
        self.lines.setdefault(path, line)
        number = self.array_tables.get(path, -1) + 1
        self.array_tables[path] = number
        self.lines[(*path, number)] = line
        return (*path, number)

    def _pair(self, table: Location) -> None:
        line = self._line()
        path = table + self._key()
        for end in range(len(table) + 1, len(path) + 1):
            self.lines.setdefault(path[:end], line)
        self.position += 1  # the equals sign
        self._skip(_SPACE)
        self._value(path)

    def _key(self) -> Location:
        parts: list[str | int] = []
        while True:
            quoted = _QUOTED.match(self.text, self.position)
            match = quoted or _BARE.match(self.text, self.position)
            if match is None:
                raise ValueError(f"no key at character {self.position}")
            name = match.group()
            parts.append(tomllib.loads(f"key = {name}")["key"] if quoted else name)
            self.position = match.end()
            self._skip(_SPACE)
            if self._peek() != ".":
                return tuple(parts)
            self.position += 1
            self._skip(_SPACE)

    def _value(self, path: Location) -> None:
        character = self._peek()
        if character == "[":
            self._array(path)
        elif character == "{":
            self._inline_table(path)
        else:
            match = (
                _LONG_TEXT.match(self.text, self.position)
                or _QUOTED.match(self.text, self.position)
                or _SCALAR.match(self.text, self.position)
            )
            if match is None:
                raise ValueError(f"no value at character {self.position}")
            self.position = match.end()

    def _array(self, path: Location) -> None:
        self.position += 1
        number = 0
        while True:
            self._skip(_BLANK)
            if self._peek() == "]":
                self.position += 1
                return
            self.lines[(*path, number)] = self._line()
            self._value((*path, number))
            number += 1
            self._skip(_BLANK)
            if self._peek() == ",":
                self.position += 1

    def _inline_table(self, path: Location) -> None:
        self.position += 1
        while True:
            self._skip(_BLANK)
            if self._peek() == "}":
                self.position += 1
                return
            self._pair(path)
            self._skip(_BLANK)
            if self._peek() == ",":
                self.position += 1

    def _peek(self) -> str:
        return self.text[self.position : self.position + 1]

    def _skip(self, pattern: re.Pattern[str]) -> None:
        match = pattern.match(self.text, self.position)
        self.position = match.end() if match else self.position

    def _line(self) -> int:
        return bisect.bisect_left(self.newlines, self.position) + 1
