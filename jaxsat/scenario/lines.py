"""Line numbers of the keys and array entries of a TOML file."""

import tomllib

from jaxsat.scenario.errors import Location
from jaxsat.scenario.limits import TOKEN


def line_map(text: str) -> dict[Location, int]:
    """Line numbers, from 1, by location; `text` must be valid TOML (checked by `tomllib` first)."""
    return _Scanner(text).document()


def nearest_line(lines: dict[Location, int], location: Location) -> int:
    """Line of a location, or of the closest enclosing table or array; 1 without any."""
    while location and location not in lines:
        location = location[:-1]
    return lines.get(location, 1)


class _Scanner:
    """One pass over the tokens of a valid document, without spaces and comments."""

    def __init__(self, text: str):
        self.tokens: list[tuple[str, int]] = []
        line = 1
        for token in TOKEN.findall(text):
            if token == "\n" or not (token.isspace() or token.startswith("#")):
                self.tokens.append((token, line))
            line += token.count("\n")
        self.tokens.append(("", line))
        self.place = 0
        self.lines: dict[Location, int] = {}
        self.array_tables: dict[Location, int] = {}

    def document(self) -> dict[Location, int]:
        table: Location = ()
        while self._skip(("\n",)):
            if self._peek() == "[":
                table = self._header()
            else:
                self._pair(table)
        return self.lines

    def _header(self) -> Location:
        line, is_array = self._take(), self._peek() == "["
        path = self._key("]")
        for end in range(1, len(path)):
            self.lines.setdefault(path[:end], line)
        if not is_array:
            self.lines[path] = line
            return path
        self._take()
        self.lines.setdefault(path, line)
        number = self.array_tables.get(path, -1) + 1
        self.array_tables[path] = number
        self.lines[(*path, number)] = line
        return (*path, number)

    def _pair(self, table: Location) -> None:
        line = self.tokens[self.place][1]
        path = table + self._key("=")
        for end in range(len(table) + 1, len(path) + 1):
            self.lines.setdefault(path[:end], line)
        self._value(path)

    def _key(self, end: str) -> Location:
        """Take a dotted key with the mark after it."""
        parts: list[str] = []
        while (token := self._peek()) != end:
            if token[0] in "\"'":
                parts.append(tomllib.loads(f"key = {token}")["key"])
            elif token not in "[.":
                parts.append(token)
            self._take()
        self._take()
        return tuple(parts)

    def _value(self, path: Location) -> None:
        if self._peek() not in ("[", "{"):
            while self._peek() not in (",", "]", "}", "\n", ""):
                self._take()
            return
        is_array, number = self._peek() == "[", 0
        self._take()
        while self._skip(("\n", ",")) not in ("]", "}"):
            if is_array:
                self.lines[(*path, number)] = self.tokens[self.place][1]
                self._value((*path, number))
                number += 1
            else:
                self._pair(path)
        self._take()

    def _peek(self) -> str:
        return self.tokens[self.place][0]

    def _take(self) -> int:
        """Take a token; return its line."""
        self.place += 1
        return self.tokens[self.place - 1][1]

    def _skip(self, marks: tuple[str, ...]) -> str:
        """Take tokens like these; return the next one."""
        while self._peek() in marks:
            self._take()
        return self._peek()
