"""Sanitised text for terminals, figures, pages and attributes; CSV; numbers for people."""

import contextvars
import csv
import difflib
import io
import math
import unicodedata
from collections.abc import Iterable
from contextlib import AbstractContextManager
from typing import Any, SupportsFloat

from jaxsat.core.once import holding

JOINERS = "\u200c\u200d"
"""Format characters that scripts and emoji need; all others only hide or reorder text."""

_HIDDEN = frozenset({"Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp"})
_MARKDOWN = {ord(mark): f"\\{mark}" for mark in "\\`*_[]#|~$!"}
_MARKUP = {ord("&"): "&amp;", ord("<"): "&lt;", ord(">"): "&gt;"}


def clean(text: str, longest: int | None = None) -> str:
    """Return one line with control and format characters as visible escapes.

    Also escaped are line breaks, and undecodable bytes of a file name. Text beyond `longest`
    characters is cut and ends with an ellipsis.
    """
    if not text.isprintable():
        text = "".join(map(_shown, text))
    return text if longest is None or len(text) <= longest else text[: longest - 1] + "…"


def markdown(text: str) -> str:
    """Return clean text for a page, with marks of Markdown, HTML and mathematics escaped."""
    return clean(text).translate(_MARKDOWN | _MARKUP)


def capitalised(text: str) -> str:
    """Return the text with a capital first letter; the others stay, as those of names must."""
    return text[:1].upper() + text[1:]


LONGEST_WORD = 60
"""Number of characters of a word beyond which nothing is suggested in its place."""


def suggestion(word: str, choices: Iterable[str], similarity: float = 0.6) -> str:
    """Return `, did you mean …?` for the choice closest to a misspelt word, or an empty text.

    Case does not matter. `similarity` is the least one, from 0 to 1.
    """
    if len(word) > LONGEST_WORD:
        return ""
    names, word = {one.lower(): one for one in choices}, word.lower()
    close = [one for one in names if len(word) > 2 and one.startswith(word)]
    close = close or [one for one in names if one.endswith(f" {word}")]
    close = close or difflib.get_close_matches(word, names, 1, similarity)
    return f", did you mean {names[close[0]]}?" if close else ""


def csv_text(rows: Iterable[Iterable[Any]]) -> str:
    """Return rows as comma-separated values, with numbers in full precision."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _shown(character: str) -> str:
    if unicodedata.category(character) not in _HIDDEN or character in JOINERS:
        return character
    if "\udc80" <= character <= "\udcff":  # a byte that is not UTF-8 (surrogateescape)
        return f"\\x{ord(character) - 0xDC00:02x}"
    return character.encode("unicode_escape").decode("ascii")


MOST_DIGITS = 17
"""Significant digits of a double."""

ROUNDING = 1e-14
"""Size relative to a quantity below which a number is round-off."""

NOTHING = "-"

_LEAST = contextvars.ContextVar("digits", default=0)


def at_least_digits(count: int | None) -> AbstractContextManager[None]:
    """Show at least `count` significant digits inside the `with` block; None changes nothing."""
    return holding(_LEAST, count or 0)


def number_text(value: SupportsFloat, digits: int = 4, *, scale: float = 0.0) -> str:
    """Format a number to significant digits; zero for round-off of a quantity of size `scale`."""
    number = float(value)
    if math.isnan(number):
        return NOTHING
    number = 0.0 if abs(number) <= ROUNDING * scale else number + 0.0
    return f"{number:.{max(digits, _LEAST.get())}g}"


def fixed_text(value: SupportsFloat, places: int) -> str:
    """Format a number to `places` decimals, or more for `at_least_digits`."""
    number = float(value)
    if math.isnan(number):
        return NOTHING
    if _LEAST.get():
        integral = len(f"{abs(number):.0f}") if abs(number) >= 1 else 0
        places = max(places, _LEAST.get() - integral)
    text = f"{number:.{places}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def vector_text(values: Iterable[SupportsFloat], *, scale: float = 0.0) -> str:
    """Format numbers in parentheses; zero for round-off of the largest, or of `scale`."""
    numbers = [float(value) for value in values]
    largest = max((abs(one) for one in numbers if math.isfinite(one)), default=0.0)
    largest = max(largest, scale)
    return f"({', '.join(number_text(one, scale=largest) for one in numbers)})"
