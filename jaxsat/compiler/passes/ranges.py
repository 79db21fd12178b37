"""Whole numbers of which the range is known: what their comparisons and limits give."""

from collections.abc import Sequence

import numpy as np

from jaxsat.compiler.ir import Scalar, Value

_DECIDED = {
    "lt": lambda a, b: True if a[1] < b[0] else False if a[0] >= b[1] else None,
    "le": lambda a, b: True if a[1] <= b[0] else False if a[0] > b[1] else None,
    "gt": lambda a, b: True if a[0] > b[1] else False if a[1] <= b[0] else None,
    "ge": lambda a, b: True if a[0] >= b[1] else False if a[1] < b[0] else None,
}


class Ranges:
    """The least and the largest number that values can be."""

    def __init__(self):
        self._known: dict[int, tuple[int, int]] = {}

    def note(self, value: Value, least: int, largest: int) -> None:
        """Let a value be known to be within these, both included."""
        self._known[value.number] = (least, largest)

    def note_converted(self, x: Scalar, out: Value) -> None:
        """A value as another type, in which it fits, keeps its range."""
        found = self._of(x)
        if found is None or out.dtype.kind not in "iu":
            return
        limits = np.iinfo(out.dtype)
        if limits.min <= found[0] and found[1] <= limits.max:
            self._known[out.number] = found

    def simplified(self, name: str, args: Sequence[Scalar]) -> Scalar | None:
        """What an operation gives, or None where that is not known before."""
        if name not in _DECIDED and name not in ("min", "max"):
            return None
        x, y = (self._of(arg) for arg in args)
        if x is None or y is None:
            return None
        if name in _DECIDED:
            decided = _DECIDED[name](x, y)
            return None if decided is None else np.bool_(decided)
        if _DECIDED["le"](x, y):
            return args[0 if name == "min" else 1]
        return args[1 if name == "min" else 0] if _DECIDED["le"](y, x) else None

    def _of(self, x: Scalar) -> tuple[int, int] | None:
        if isinstance(x, Value):
            return self._known.get(x.number)
        return (int(x), int(x)) if x.dtype.kind in "iu" else None
