"""Simplification: neutral and absorbing operands, and predicates that are known."""

from collections.abc import Sequence

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


class Predicates:
    """Known opposites among predicates, what others are made of, and selections by them."""

    def __init__(self):
        self._joined: dict[int, tuple[str, tuple[Scalar, ...]]] = {}
        self._opposite: dict[int, Scalar] = {}
        self._selected: dict[int, tuple[Scalar, ...]] = {}

    def note(self, name: str, args: tuple[Scalar, ...], out: Value) -> None:
        """Note the result of an operation."""
        if name == "select":
            self._selected[out.number] = args
        elif name == "xor" and out.dtype == BOOL and _is(args[1], True):
            self._opposite[out.number] = args[0]
        elif name in ("and", "or") and out.dtype == BOOL:
            self._joined[out.number] = (name, args)

    def implied(self, predicate: Scalar, *, holds: bool) -> dict[int, bool]:
        """Return the outcomes of predicates, by number, that follow from the outcome of one."""
        if not isinstance(predicate, Value):
            return {}
        outcomes = {predicate.number: holds}
        if predicate.number in self._opposite:
            outcomes |= self.implied(self._opposite[predicate.number], holds=not holds)
        name, args = self._joined.get(predicate.number, ("", ()))
        if (name == "and") == holds:
            for one in args:
                outcomes |= self.implied(one, holds=holds)
        return outcomes

    def tested(
        self, active: Scalar, params: Sequence[Value], before: Sequence[Scalar]
    ) -> dict[int, bool]:
        """Return the outcomes of predicates in the body of a loop that runs while `active`.

        The first test held too, of the initial values (`before`) of the loop's params.
        """
        outcomes = self.implied(active, holds=True)
        for param, first in zip(params, before, strict=True):
            if param.number in outcomes:
                outcomes |= self.implied(first, holds=outcomes[param.number])
        return outcomes

    def selection(self, x: Value) -> tuple[Scalar, ...] | None:
        """Return the predicate and the parts of a selection, None for another value."""
        return self._selected.get(x.number)

    def parts(self, name: str, args: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """Return the operands, of a selection those by a predicate that is no negation, without
        inner selections by the same predicate."""
        if name != "select":
            return args
        predicate, *others = args
        while isinstance(predicate, Value) and predicate.number in self._opposite:
            predicate, others = self._opposite[predicate.number], others[::-1]
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
