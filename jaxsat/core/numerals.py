"""Numbers as a person reads them: with the digits that are asked for, and no sign of zero."""

import contextvars
import math
from collections.abc import Iterable
from contextlib import AbstractContextManager
from typing import SupportsFloat

from jaxsat.core.once import holding

MOST_DIGITS = 17
"""A double has no more significant digits."""

ROUNDING = 1e-14
"""Of the size of a quantity: what is smaller is rounding alone."""

NOTHING = "-"

_LEAST = contextvars.ContextVar("digits", default=0)


def at_least_digits(count: int | None) -> AbstractContextManager[None]:
    """Show so many significant digits where fewer are usual; None changes nothing."""
    return holding(_LEAST, count or 0)


def number_text(value: SupportsFloat, digits: int = 4, *, scale: float = 0.0) -> str:
    """A number to significant digits; zero where it is rounding of a quantity of size `scale`."""
    number = float(value)
    if math.isnan(number):
        return NOTHING
    number = 0.0 if abs(number) <= ROUNDING * scale else number + 0.0
    return f"{number:.{max(digits, _LEAST.get())}g}"


def fixed_text(value: SupportsFloat, places: int) -> str:
    """A number to so many places after the point, or to the digits that are asked for."""
    number = float(value)
    if math.isnan(number):
        return NOTHING
    if _LEAST.get():
        integral = len(f"{abs(number):.0f}") if abs(number) >= 1 else 0
        places = max(places, _LEAST.get() - integral)
    text = f"{number:.{places}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def vector_text(values: Iterable[SupportsFloat], *, scale: float = 0.0) -> str:
    """Numbers in parentheses; zero where one is rounding of the largest, or of `scale`."""
    numbers = [float(value) for value in values]
    largest = max((abs(one) for one in numbers if math.isfinite(one)), default=0.0)
    largest = max(largest, scale)
    return f"({', '.join(number_text(one, scale=largest) for one in numbers)})"
