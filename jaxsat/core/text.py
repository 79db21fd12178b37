"""Text from outside, made harmless where it is shown: terminals, figures, pages, attributes; and
rows as CSV."""

import csv
import io
import unicodedata
from collections.abc import Iterable
from typing import Any

JOINERS = "\u200c\u200d"
"""Format characters that scripts and emoji need; all others only hide or reorder what is read."""

_HIDDEN = frozenset({"Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp"})
_MARKDOWN = {ord(mark): f"\\{mark}" for mark in "\\`*_[]#|~$!"}
_MARKUP = {ord("&"): "&amp;", ord("<"): "&lt;", ord(">"): "&gt;"}


def clean(text: str, longest: int | None = None) -> str:
    """One line that shows what it holds: control and format characters become their escapes.

    So do line breaks, and the bytes of a file name that cannot be decoded. What is longer than
    `longest` characters is cut and ends with an ellipsis.
    """
    if not text.isprintable():
        text = "".join(map(_shown, text))
    return text if longest is None or len(text) <= longest else text[: longest - 1] + "…"


def markdown(text: str) -> str:
    """Clean text for a page: what Markdown, HTML or mathematics takes for a mark is escaped."""
    return clean(text).translate(_MARKDOWN | _MARKUP)


def capitalised(text: str) -> str:
    """The text with a capital first letter; the others stay, as those of names must."""
    return text[:1].upper() + text[1:]


def csv_text(rows: Iterable[Iterable[Any]]) -> str:
    """Rows as comma-separated values, with numbers in full precision."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _shown(character: str) -> str:
    if unicodedata.category(character) not in _HIDDEN or character in JOINERS:
        return character
    if "\udc80" <= character <= "\udcff":  # a byte that is no UTF-8, as Python carries it along
        return f"\\x{ord(character) - 0xDC00:02x}"
    return character.encode("unicode_escape").decode("ascii")
