"""Parser of requirements: text to formula; a mistake is reported with its column.

formula    = conjunction { "or" conjunction }
conjunction = clause { "and" clause }
clause     = unit [ "until" window unit ]
unit       = "not" unit | "(" formula ")" | comparison
           | ("always" | "eventually") [window] unit
           | "within" time "of" "failure" unit
comparison = signal ("<" | "<=" | ">" | ">=") number [unit]
window     = "[" instant "," instant "]"
instant    = time | ("end" | "failure") [("+" | "-") time]
"""

import re
from collections.abc import Callable, Iterable
from typing import Literal, NoReturn

from jaxsat.core.declaration.requirements import (
    REQUIRED_SIGNALS,
    UNITS,
    Formula,
    Inequality,
    Instant,
    Junction,
    Negation,
    Temporal,
    all_parts,
)
from jaxsat.core.errors import ArgumentError
from jaxsat.core.text import suggestion

_TOKEN = re.compile(r"\s*([A-Za-z_]\w*|<=|>=|[-+<>()\[\],:]|$)")
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")
_WORD = re.compile(r"\s*([^\s()\[\],]+)")
_TIMES = ("always", "eventually", "within")
_RESERVED = (*_TIMES, "not", "and", "or", "until", "of", "end", "failure")
MAX_DEPTH = 20
"""Largest nesting depth of brackets and words such as `not`."""


def parse(text: str) -> Formula:
    """Parse a text into a formula.

    Raises `ArgumentError`, whose rule gives the column, if the text is no formula.
    """
    parser = _Parser(text)
    formula = parser.formula()
    if parser.peek():
        parser.fail("must end, or continue with and, or, until", ("and", "or", "until"))
    _require_times(formula)
    return formula


def _require_times(formula: Formula) -> None:
    """Raise `ArgumentError` unless every comparison is inside one temporal operator."""
    if isinstance(formula, Inequality):
        rule = "must say when with always, eventually, until or within"
        raise ArgumentError("formula", rule, f"{formula.signal} at column {formula.column}")
    if isinstance(formula, Junction):
        for part in formula.parts:
            _require_times(part)
    if isinstance(formula, Negation):
        _require_times(formula.part)


class _Parser:
    """A text and the position up to which it is parsed."""

    def __init__(self, text: str):
        self.text, self.place, self.depth = text, 0, 0

    def peek(self) -> str:
        """Return the next word or mark, or the rest of an invalid word."""
        match = _TOKEN.match(self.text, self.place) or _WORD.match(self.text, self.place)
        return match.group(1) if match else self.text[self.place :].strip()[:1]

    def take(self, *words: str) -> bool:
        """Consume the next word or mark if it is one of `words`; return whether it was."""
        match = _TOKEN.match(self.text, self.place)
        if match is None or match.group(1) not in words:
            return False
        self.place = match.end()
        return True

    def expect(self, mark: str, after: str) -> None:
        """Consume the mark that must follow."""
        if not self.take(mark):
            self.fail(f"must have {mark} after {after}", (mark,))

    def column(self) -> int:
        """Column of the next word or mark, from 1."""
        rest = self.text[self.place :]
        return self.place + len(rest) - len(rest.lstrip()) + 1

    def fail(self, rule: str, choices: Iterable[str] = ()) -> NoReturn:
        """Raise `ArgumentError` about the next word or mark."""
        word = self.peek()
        got = f"{word or 'nothing'} at column {self.column()}"
        raise ArgumentError("formula", rule, got + (suggestion(word, choices) if word else ""))

    def formula(self) -> Formula:
        """Parse a formula."""
        return self._joined("or", lambda: self._joined("and", self.clause))

    def _joined(self, word: str, part: Callable[[], Formula]) -> Formula:
        parts = [part()]
        while self.take(word):
            parts.append(part())
        return parts[0] if len(parts) == 1 else Junction(tuple(parts), word == "and")

    def clause(self) -> Formula:
        """Parse a unit, or a unit until another."""
        operand = self.unit()
        begin = self.column()
        if not self.take("until"):
            return operand
        window = self.window()
        return self._temporal("until", operand, window, begin, self.unit())

    def unit(self) -> Formula:
        """Parse the operand of a word such as `not` or `always`."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            self.fail(f"must not have more than {MAX_DEPTH} operators inside each other")
        try:
            return self._unit()
        finally:
            self.depth -= 1

    def _unit(self) -> Formula:
        begin = self.column()
        if self.take("not"):
            return Negation(self.unit())
        if self.take("("):
            formula = self.formula()
            self.expect(")", "a formula in brackets")
            return formula
        if self.take("within"):
            time = self.time()
            self.expect("of", "a time")
            self.expect("failure", "of")
            window = Instant("failure"), Instant("failure", time)
            return self._temporal("eventually", self.unit(), window, begin)
        for kind in ("always", "eventually"):
            if self.take(kind):
                window = self.window()
                return self._temporal(kind, self.unit(), window, begin)
        return self.comparison()

    def _temporal(
        self,
        kind: Literal["always", "eventually", "until"],
        operand: Formula,
        window: tuple[Instant, Instant],
        column: int,
        until: Formula | None = None,
    ) -> Temporal:
        inside = [one for part in (operand, until) if part is not None for one in all_parts(part)]
        if any(isinstance(one, Temporal) for one in inside):
            rule = "must not have always, eventually, until or within inside each other"
            raise ArgumentError("formula", rule, f"{kind} around another at column {column}")
        return Temporal(kind, operand, window[0], window[1], until)

    def window(self) -> tuple[Instant, Instant]:
        """Parse a window; by default the whole run."""
        if not self.take("["):
            return Instant("start"), Instant("end")
        column = self.column()
        begin = self.instant()
        self.expect(",", "the begin of a window")
        end = self.instant()
        self.expect("]", "the end of a window")
        if begin.anchor == end.anchor and begin.offset > end.offset:
            rule = "must have windows that end after they begin"
            got = f"{begin.offset:g} s before {end.offset:g} s at column {column}"
            raise ArgumentError("formula", rule, got)
        return begin, end

    def instant(self) -> Instant:
        """Parse a time from the start, the end or a failure."""
        for anchor in ("end", "failure"):
            if self.take(anchor):
                sign = 1.0 if self.take("+") else -1.0 if self.take("-") else 0.0
                return Instant(anchor, sign * self.time() if sign else 0.0)
        return Instant("start", self.time())

    def time(self) -> float:
        """Parse a time, s, not negative."""
        column = self.column()
        if not _NUMBER.match(self.text, self.place):
            self.fail("must have a time such as 60 s, end or failure", ("end", "failure"))
        value, unit, size = self.quantity("s", "a time")
        if value < 0:
            got = f"{value:g} {unit} at column {column}"
            raise ArgumentError("formula", "must have times of at least 0 s", got)
        return value * size

    def comparison(self) -> Inequality:
        """Parse a signal and its threshold."""
        column, name = self.column(), self.peek()
        signal = REQUIRED_SIGNALS.get(name)
        if signal is None:
            names = ", ".join(REQUIRED_SIGNALS)
            self.fail(f"must name a signal ({names})", (*REQUIRED_SIGNALS, *_RESERVED))
        self.take(name)
        direction = self.direction(name) if signal.directed else ()
        below = self.peek().startswith("<")
        if not self.take("<", "<=", ">", ">="):
            self.fail(f"must have <, <=, > or >= after {name}")
        value, unit, size = self.quantity(signal.unit, name)
        return Inequality(name, below, value * size, unit, size, column, direction)

    def direction(self, name: str) -> tuple[float, ...]:
        """Parse three numbers in round brackets, not all zero."""
        column = self.column()
        self.expect("(", f"{name}, as in {name}(0, 0, 1)")
        numbers = [self.number(name)]
        while len(numbers) < 3:
            self.expect(",", "a component of a direction")
            numbers.append(self.number(name))
        self.expect(")", "three components of a direction")
        if not any(numbers):
            rule = "must have a direction that is not zero"
            raise ArgumentError("formula", rule, f"zeros at column {column}")
        return tuple(numbers)

    def number(self, of: str) -> float:
        """Parse a number."""
        match = _NUMBER.match(self.text, self.place)
        if match is None:
            self.fail(f"must have a number for {of}")
        if abs(float(match.group(1))) > 1e12:
            self.fail("must have numbers of at most 1e12")
        self.place = match.end()
        return float(match.group(1))

    def quantity(self, si: str, of: str) -> tuple[float, str, float]:
        """Parse a number and its unit; return the number, the unit and its size in SI."""
        value = self.number(of)
        units = UNITS.get(si, {si: 1.0})
        rest = self.text[self.place :].lstrip()
        for unit in sorted(filter(None, units), key=len, reverse=True):
            words = r"\s+".join(map(re.escape, unit.split()))
            match = re.match(rf"{words}(?![\w/²])", rest)
            if match:
                self.place = len(self.text) - len(rest) + match.end()
                return value, unit, units[unit]
        if "" not in units or (rest[:1].isalpha() and self.peek() not in _RESERVED):
            self.fail(f"must have {of} in {' or '.join(filter(None, units)) or 'no unit'}", units)
        return value, "", 1.0
