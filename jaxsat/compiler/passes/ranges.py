"""Ranges of numbers, also by comparisons, and the integers and predicates that they decide."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

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

    def replaced(self, predicate: Scalar, no: Scalar) -> int | None:
        """Return the constant in whose place an integer (`no`) has another number, or None."""
        name, args = self._of(predicate)
        if name != "eq" or self.subject(predicate) is not no:
            return None
        return int(args[1] if args[0] is no else args[0])  # pyright: ignore

    def _of(self, predicate: Scalar) -> tuple[str, tuple[Scalar, ...]]:
        parts = self._made.get(predicate.number) if isinstance(predicate, Value) else None
        return parts or ("", ())


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


_DECIDED = {
    "lt": lambda a, b: True if a[1] < b[0] else False if a[0] >= b[1] else None,
    "le": lambda a, b: True if a[1] <= b[0] else False if a[0] > b[1] else None,
    "gt": lambda a, b: True if a[0] > b[1] else False if a[1] <= b[0] else None,
    "ge": lambda a, b: True if a[0] >= b[1] else False if a[1] < b[0] else None,
    "eq": lambda a, b: False if a[1] < b[0] or a[0] > b[1] else None,
    "ne": lambda a, b: True if a[1] < b[0] or a[0] > b[1] else None,
}

_ROUNDED: Mapping[str, Callable[[float], float]] = {
    "floor": math.floor, "ceil": math.ceil, "trunc": math.trunc, "round_even": round,
}  # fmt: skip
"""Functions that keep the order of numbers, of finite ones."""


class Ranges:
    """Known ranges of integers, and of floats that were limited (which may be NaN)."""

    def __init__(self):
        self._known: dict[int, Bounds] = {}
        self._steps: dict[int, tuple[int, int]] = {}
        self._sums: dict[int, tuple[Value, int]] = {}
        self._limits: dict[int, tuple[float, float]] = {}
        self._never: dict[int, int] = {}
        self._comparisons = Comparisons()

    def note(self, value: Value, least: int, largest: int) -> None:
        """Note the range of a value, both ends included."""
        self._known[value.number] = (least, largest)

    def of(self, x: Scalar) -> Bounds | None:
        """Return the range of an integer, or None if none is known."""
        if isinstance(x, Value):
            return self._known.get(x.number)
        return (int(x), int(x)) if x.dtype.kind in "iu" else None

    def note_among(self, value: Value, sources: Iterable[Scalar]) -> None:
        """Note that a value is one of others of its type."""
        if value.dtype.kind in "iu":
            bounds = [self._within(x) for x in sources]
            self._known[value.number] = (min(b[0] for b in bounds), max(b[1] for b in bounds))

    def note_converted(self, x: Scalar, out: Value) -> None:
        """Note that a value as another type, in which it fits, keeps its range."""
        if out.dtype.kind not in "iu" or x.dtype.kind not in "iubf":
            return
        limits = np.iinfo(out.dtype)
        if x.dtype.kind == "f":
            least, largest = self._limits_of(x)
            bounds = (
                0 if least > 0 else math.trunc(max(least, limits.min)),
                0 if largest < 0 else math.trunc(min(largest, limits.max)),
            )  # NaN becomes zero
        else:
            bounds = (0, 1) if x.dtype == BOOL else self._within(x)
        if limits.min <= bounds[0] and bounds[1] <= limits.max:
            self._known[out.number] = bounds

    def note_result(self, name: str, args: tuple[Scalar, ...], out: Value) -> None:
        """Note the range of a result: of a choice, a masked integer, and of arithmetic with known
        ranges."""
        self._comparisons.note(name, args, out)
        if out.dtype.kind == "f":
            self._note_limits(name, args, out)
        if out.dtype.kind not in "iu":
            return
        if name in ("min", "max"):
            limit = min if name == "min" else max
            x, y = (self._within(arg) for arg in args)
            self._known[out.number] = (limit(x[0], y[0]), limit(x[1], y[1]))
        if name == "select":
            self._note_choice(args, out)
        if name not in ("and", "add", "sub", "rem", "mul"):
            return
        x, y = (self._within(arg) for arg in args)
        if name == "and":
            most = [b[0] for b in (x, y) if b[0] == b[1] and b[0] >= 0]
            if most:
                self._known[out.number] = (0, most[0])
            return
        limits = np.iinfo(out.dtype)
        if name == "add":
            least, largest = x[0] + y[0], x[1] + y[1]
        elif name == "sub":
            least, largest = x[0] - y[1], x[1] - y[0]
        elif name == "rem" and y[0] > 0:
            least, largest = max(min(x[0], 0), 1 - y[1]), min(max(x[1], 0), y[1] - 1)
        elif name == "mul" and x[0] >= 0 and y[0] == y[1] > 0:
            least, largest = x[0] * y[0], x[1] * y[0]
        else:
            return
        self._note_sum(name, args, out)
        if limits.min <= least and largest <= limits.max:
            self._known[out.number] = (least, largest)
            if name == "mul":
                self._steps[out.number] = (y[0], 0)
            elif name == "add" and y[0] == y[1] and (steps := self._steps_of(args[0])):
                self._steps[out.number] = (steps[0], (steps[1] + y[0]) % steps[0])

    def simplified(self, name: str, args: Sequence[Scalar]) -> Scalar | None:
        """Return the result of an operation if the ranges determine it, else None."""
        if name in ("and", "or") and args[0].dtype == BOOL:
            return self._implied(name, args[0], args[1])
        if name not in _DECIDED and name not in ("min", "max"):
            return None
        if args[0].dtype.kind not in "iu":
            return None
        x, y = (self._within(arg) for arg in args)
        if name in ("eq", "ne") and (self._is_between_steps(args[0], y) or self._is_never(args)):
            return np.bool_(name == "ne")
        if name in _DECIDED:
            decided = _DECIDED[name](x, y)
            return None if decided is None else np.bool_(decided)
        if _DECIDED["le"](x, y):
            return args[0 if name == "min" else 1]
        return args[1 if name == "min" else 0] if _DECIDED["le"](y, x) else None

    def _implied(self, name: str, p: Scalar, q: Scalar) -> Scalar | None:
        """Return one of two predicates of an integer if it implies the other, or a constant."""
        x = self._comparisons.subject(p) or self._comparisons.subject(q)
        if x is None:
            return None

        def never(p_holds: bool, q_holds: bool) -> bool:
            pairs = ((p, p_holds), (q, q_holds))
            of = [self._comparisons.allowed(x, self._within(x), y, holds=z) for y, z in pairs]
            return is_empty(common(of[0], of[1]))

        alike = name == "and"
        if never(alike, alike):
            return np.bool_(not alike)
        if never(alike, not alike):
            return p
        return q if never(not alike, alike) else None

    def _note_choice(self, args: tuple[Scalar, ...], out: Value) -> None:
        """Note the range of a selection, whose parts the predicate may limit."""
        predicate, *parts = args
        both = [
            self._chosen(x, predicate, holds=holds)
            for x, holds in zip(parts, (True, False), strict=True)
        ]
        self._known[out.number] = united(*both)
        number = self._comparisons.replaced(args[0], args[2])
        if number is not None and is_empty(common(self._within(args[1]), (number, number))):
            self._never[out.number] = number

    def _chosen(self, x: Scalar, predicate: Scalar, *, holds: bool) -> Bounds:
        """Return the range of a number where a predicate holds or does not."""
        within = self._within(x)
        if not isinstance(x, Value):
            return within
        term, added = self._sums.get(x.number, (x, 0))
        least, largest = self._comparisons.allowed(term, self._within(term), predicate, holds=holds)
        limits = np.iinfo(x.dtype)
        fits = limits.min <= least + added and largest + added <= limits.max
        return common(within, (least + added, largest + added)) if fits else within

    def _note_sum(self, name: str, args: Sequence[Scalar], out: Value) -> None:
        """Note a sum of an integer and a constant."""
        x, y = args if isinstance(args[0], Value) else args[::-1]
        if isinstance(x, Value) and not isinstance(y, Value):
            if name == "add":
                self._sums[out.number] = (x, int(y))
            elif name == "sub" and x is args[0]:
                self._sums[out.number] = (x, -int(y))

    def _note_limits(self, name: str, args: Sequence[Scalar], out: Value) -> None:
        """Note the limits of a float."""
        if name in ("min", "max"):
            limit = min if name == "min" else max
            x, y = (self._limits_of(arg) for arg in args)
            limits = limit(x[0], y[0]), limit(x[1], y[1])
        elif name in _ROUNDED:
            low, high = (
                _ROUNDED[name](x) if math.isfinite(x) else x for x in self._limits_of(args[0])
            )
            limits = float(low), float(high)
        else:
            return
        if limits != (-math.inf, math.inf):
            self._limits[out.number] = limits

    def _limits_of(self, x: Scalar) -> tuple[float, float]:
        if isinstance(x, Value):
            return self._limits.get(x.number, (-math.inf, math.inf))
        number = float(x)  # pyright: ignore
        return (-math.inf, math.inf) if math.isnan(number) else (number, number)

    def _steps_of(self, x: Scalar) -> tuple[int, int] | None:
        """Return step and remainder of a value that is a multiple plus a constant, or None."""
        return self._steps.get(x.number) if isinstance(x, Value) else None

    def _is_never(self, args: Sequence[Scalar]) -> bool:
        """Whether a value was chosen not to be a constant."""
        pairs = (args, args[::-1])
        return any(
            isinstance(x, Value) and not isinstance(y, Value) and self._never.get(x.number) == y
            for x, y in pairs
        )

    def _is_between_steps(self, x: Scalar, number: Bounds) -> bool:
        """Whether a value has a step, and a number is not on it."""
        steps = self._steps_of(x)
        return steps is not None and number[0] == number[1] and number[0] % steps[0] != steps[1]

    def _within(self, x: Scalar) -> Bounds:
        dtype: np.dtype = x.dtype
        limits = np.iinfo(dtype)
        return self.of(x) or (int(limits.min), int(limits.max))
