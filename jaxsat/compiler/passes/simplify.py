"""Simplification: neutral and absorbing operands, and comparisons of integers of known range."""

from collections.abc import Iterable, Sequence

import numpy as np

from jaxsat.compiler.ir import Scalar, Value
from jaxsat.compiler.operations import BOOL


def identity(x: Scalar):
    """Return a key that is the same for the same value or constant."""
    return x.number if isinstance(x, Value) else (x.dtype.char, x.tobytes())


def _is(x: Scalar, number) -> bool:
    """Whether `x` is this constant, the sign of zero included."""
    if isinstance(x, Value) or x != number:
        return False
    return x.dtype.kind != "f" or bool(np.signbit(x) == np.signbit(number))


def simplified(name: str, args: tuple[Scalar, ...], dtype: np.dtype) -> Scalar | None:
    """Return an existing value equal in all bits, or None."""
    floating = dtype.kind == "f"
    match name, args:
        case "select", (predicate, yes, no):
            if not isinstance(predicate, Value):
                return yes if predicate else no
            return yes if identity(yes) == identity(no) else None
        case "convert" | "bitcast", (x,):
            return x if x.dtype == dtype else None
        case "mul", (x, y):
            return _with_neutral(x, y, 1) or (None if floating else _with_absorbing(x, y, 0))
        case "div", (x, y):
            return x if _is(y, 1) else None
        case "add", (x, y):
            return _with_neutral(x, y, -0.0 if floating else 0)
        case "sub", (x, y):
            return x if _is(y, 0.0 if floating else 0) else None
        case "and", (x, y):
            full = True if dtype == BOOL else np.invert(dtype.type(0))
            return _with_neutral(x, y, full) or _with_absorbing(x, y, False if dtype == BOOL else 0)
        case "or", (x, y):
            nothing = False if dtype == BOOL else 0
            absorbing = _with_absorbing(x, y, True) if dtype == BOOL else None
            return _with_neutral(x, y, nothing) or absorbing
        case "min" | "max", (x, y):
            return x if identity(x) == identity(y) else None
        case "xor", (x, y):
            return _with_neutral(x, y, False if dtype == BOOL else 0)
        case "shift_left" | "shift_right_logical" | "shift_right_arithmetic", (x, y):
            return x if _is(y, 0) else None
    return None


def _with_neutral(x: Scalar, y: Scalar, neutral) -> Scalar | None:
    if _is(y, neutral):
        return x
    return y if _is(x, neutral) else None


def _with_absorbing(x: Scalar, y: Scalar, absorbing) -> Scalar | None:
    if _is(y, absorbing):
        return y
    return x if _is(x, absorbing) else None


_DECIDED = {
    "lt": lambda a, b: True if a[1] < b[0] else False if a[0] >= b[1] else None,
    "le": lambda a, b: True if a[1] <= b[0] else False if a[0] > b[1] else None,
    "gt": lambda a, b: True if a[0] > b[1] else False if a[1] <= b[0] else None,
    "ge": lambda a, b: True if a[0] >= b[1] else False if a[1] < b[0] else None,
    "eq": lambda a, b: False if a[1] < b[0] or a[0] > b[1] else None,
    "ne": lambda a, b: True if a[1] < b[0] or a[0] > b[1] else None,
}


class Ranges:
    """Known ranges of integers."""

    def __init__(self):
        self._known: dict[int, tuple[int, int]] = {}
        self._steps: dict[int, tuple[int, int]] = {}

    def note(self, value: Value, least: int, largest: int) -> None:
        """Note the range of a value, both ends included."""
        self._known[value.number] = (least, largest)

    def note_among(self, value: Value, sources: Iterable[Scalar]) -> None:
        """Note that a value is one of others of its type."""
        if value.dtype.kind in "iu":
            bounds = [self._within(x) for x in sources]
            self._known[value.number] = (min(b[0] for b in bounds), max(b[1] for b in bounds))

    def note_converted(self, x: Scalar, out: Value) -> None:
        """Note that a value as another type, in which it fits, keeps its range."""
        if x.dtype.kind not in "iu" or out.dtype.kind not in "iu":
            return
        bounds = self._within(x)
        limits = np.iinfo(out.dtype)
        if limits.min <= bounds[0] and bounds[1] <= limits.max:
            self._known[out.number] = bounds

    def note_result(self, name: str, args: Sequence[Scalar], out: Value) -> None:
        """Note the range of a result: of a choice, a masked integer, and of arithmetic with known
        ranges."""
        if out.dtype.kind not in "iu":
            return
        if name in ("min", "max"):
            limit = min if name == "min" else max
            x, y = (self._within(arg) for arg in args)
            self._known[out.number] = (limit(x[0], y[0]), limit(x[1], y[1]))
        if name == "select":
            self.note_among(out, args[1:])
        if name not in ("and", "add", "sub", "rem", "mul"):
            return
        x, y = (self._of(arg) for arg in args)
        if name == "and":
            most = [b[0] for b in (x, y) if b is not None and b[0] == b[1] and b[0] >= 0]
            if most:
                self._known[out.number] = (0, most[0])
        if x is None or y is None:
            return
        limits = np.iinfo(out.dtype)
        if name == "add":
            least, largest = x[0] + y[0], x[1] + y[1]
        elif name == "sub":
            least, largest = x[0] - y[1], x[1] - y[0]
        elif name == "rem" and x[0] >= 0 and y[0] > 0:
            least, largest = 0, min(x[1], y[1] - 1)
        elif name == "mul" and x[0] >= 0 and y[0] == y[1] > 0:
            least, largest = x[0] * y[0], x[1] * y[0]
        else:
            return
        if limits.min <= least and largest <= limits.max:
            self._known[out.number] = (least, largest)
            if name == "mul":
                self._steps[out.number] = (y[0], 0)
            elif name == "add" and y[0] == y[1] and (steps := self._steps_of(args[0])):
                self._steps[out.number] = (steps[0], (steps[1] + y[0]) % steps[0])

    def simplified(self, name: str, args: Sequence[Scalar]) -> Scalar | None:
        """Return the result of an operation if the ranges determine it, else None."""
        if name not in _DECIDED and name not in ("min", "max"):
            return None
        if args[0].dtype.kind not in "iu":
            return None
        x, y = (self._within(arg) for arg in args)
        if name in ("eq", "ne") and self._is_between_steps(args[0], y):
            return np.bool_(name == "ne")
        if name in _DECIDED:
            decided = _DECIDED[name](x, y)
            return None if decided is None else np.bool_(decided)
        if _DECIDED["le"](x, y):
            return args[0 if name == "min" else 1]
        return args[1 if name == "min" else 0] if _DECIDED["le"](y, x) else None

    def _steps_of(self, x: Scalar) -> tuple[int, int] | None:
        """Return step and remainder of a value that is a multiple plus a constant, or None."""
        return self._steps.get(x.number) if isinstance(x, Value) else None

    def _is_between_steps(self, x: Scalar, number: tuple[int, int]) -> bool:
        """Whether a value has a step, and a number is not on it."""
        steps = self._steps_of(x)
        return steps is not None and number[0] == number[1] and number[0] % steps[0] != steps[1]

    def _within(self, x: Scalar) -> tuple[int, int]:
        dtype: np.dtype = x.dtype
        limits = np.iinfo(dtype)
        return self._of(x) or (int(limits.min), int(limits.max))

    def _of(self, x: Scalar) -> tuple[int, int] | None:
        if isinstance(x, Value):
            return self._known.get(x.number)
        return (int(x), int(x)) if x.dtype.kind in "iu" else None


class Predicates:
    """Known opposites among predicates, and selections by them."""

    def __init__(self):
        self._opposite: dict[int, Scalar] = {}
        self._selected: dict[int, tuple[Scalar, ...]] = {}

    def note(self, name: str, args: tuple[Scalar, ...], out: Value) -> None:
        """Note the result of an operation."""
        if name == "select":
            self._selected[out.number] = args
        elif name == "xor" and out.dtype == BOOL and _is(args[1], True):
            self._opposite[out.number] = args[0]

    def parts(self, name: str, args: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the operands, of a selection without inner selections by the same predicate."""
        if name != "select":
            return args
        predicate, *others = args
        parts = []
        for which, one in enumerate(others, 1):
            again = self._selected.get(one.number) if isinstance(one, Value) else None
            same = again is not None and identity(again[0]) == identity(predicate)
            parts.append(again[which] if again is not None and same else one)
        return (predicate, *parts)

    def simplified(self, name: str, args: tuple[Scalar, ...]) -> Scalar | None:
        """Decide a predicate and its opposite (false), or one of them (true); None for others."""
        if name not in ("and", "or") or args[0].dtype != BOOL:
            return None
        for one, other in (args, args[::-1]):
            opposite = self._opposite.get(one.number) if isinstance(one, Value) else None
            if opposite is not None and identity(opposite) == identity(other):
                return np.bool_(name == "or")
        return None
