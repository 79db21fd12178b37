"""Comparisons of integers with constants, and the numbers for which they hold."""

from jaxsat.compiler.ir import Scalar, Value
from jaxsat.compiler.operations import BOOL

Bounds = tuple[int, int]
"""The least and the largest of some integers; none where the first is above the second."""

NONE: Bounds = (0, -1)
"""Bounds with nothing between them."""

DEPTH = 6
"""Depth to which the operands of "and" and "or" are examined."""

_OPPOSITE = {"lt": "ge", "ge": "lt", "gt": "le", "le": "gt", "eq": "ne", "ne": "eq"}
_MIRRORED = {"lt": "gt", "gt": "lt", "le": "ge", "ge": "le", "eq": "eq", "ne": "ne"}


def common(x: Bounds, y: Bounds) -> Bounds:
    """Return the bounds of numbers within both."""
    return max(x[0], y[0]), min(x[1], y[1])


def united(x: Bounds, y: Bounds) -> Bounds:
    """Return the bounds of numbers within either."""
    if is_empty(x) or is_empty(y):
        return y if is_empty(x) else x
    return min(x[0], y[0]), max(x[1], y[1])


def is_empty(x: Bounds) -> bool:
    """Whether nothing is within the bounds."""
    return x[0] > x[1]


class Comparisons:
    """Known comparisons, and the predicates that are made of them."""

    def __init__(self):
        self._made: dict[int, tuple[str, tuple[Scalar, ...]]] = {}

    def note(self, name: str, args: tuple[Scalar, ...], out: Value) -> None:
        """Note the result of an operation."""
        if out.dtype != BOOL:
            return
        is_comparison = name in _OPPOSITE and args[0].dtype.kind in "iu"
        if is_comparison or name in ("and", "or", "xor"):
            self._made[out.number] = (name, args)

    def subject(self, predicate: Scalar) -> Value | None:
        """Return the integer that a predicate compares with a constant, or None."""
        name, args = self._of(predicate)
        if name not in _OPPOSITE:
            return None
        values = [x for x in args if isinstance(x, Value)]
        return values[0] if len(values) == 1 else None

    def allowed(
        self, x: Value, within: Bounds, predicate: Scalar, *, holds: bool, depth: int = 0
    ) -> Bounds:
        """Return bounds of `x`, which is `within` others, where a predicate holds or does not."""
        name, args = self._of(predicate)
        if name == "xor" and not isinstance(args[1], Value) and args[1]:
            return self.allowed(x, within, args[0], holds=not holds, depth=depth)
        if name in ("and", "or") and depth < DEPTH:
            both = [self.allowed(x, within, y, holds=holds, depth=depth + 1) for y in args]
            return common(*both) if (name == "and") == holds else united(*both)
        if name not in _OPPOSITE or self.subject(predicate) is not x:
            return within
        number = args[1] if args[0] is x else args[0]
        name = name if args[0] is x else _MIRRORED[name]
        return _compared(name if holds else _OPPOSITE[name], within, int(number))  # pyright: ignore

    def _of(self, predicate: Scalar) -> tuple[str, tuple[Scalar, ...]]:
        known = self._made.get(predicate.number) if isinstance(predicate, Value) else None
        return known or ("", ())


def _compared(name: str, within: Bounds, number: int) -> Bounds:
    """Return the bounds of numbers within bounds that compare so with another one."""
    least, largest = within
    if name == "ne":
        return least + (number == least), largest - (number == largest)
    limits = {
        "lt": (least, number - 1),
        "le": (least, number),
        "gt": (number + 1, largest),
        "ge": (number, largest),
        "eq": (number, number),
    }
    return common(within, limits[name])
