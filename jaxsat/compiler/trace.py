"""Trace of a program's values: their source frames, arrays and names."""

import os
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any

import numpy as np

from jaxsat.compiler.ir import Value
from jaxsat.core.jaxprs import Equation


@dataclass(frozen=True)
class Frame:
    """A function of the traced source, and the line in it."""

    function: str
    file: str
    line: int


@dataclass(frozen=True)
class Element:
    """Element of the array to which a value first belonged; `array` is a number, with its place."""

    array: int
    shape: tuple[int, ...]
    index: tuple[int, ...]
    place: tuple[Frame, ...]


@dataclass
class Trace:
    """Trace of values by their numbers.

    `places` are the source calls of a value, the outermost first; `calls` those of equations, by
    identity, that are calls put back into a program. `names` are names of functions' arguments and
    results.
    """

    places: dict[int, tuple[Frame, ...]] = field(default_factory=dict)
    elements: dict[int, Element] = field(default_factory=dict)
    now: tuple[Frame, ...] = ()
    calls: dict[int, tuple[Frame, ...]] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)

    @contextmanager
    def at(self, frames: tuple[Frame, ...]):
        """Within this context, values have these source frames."""
        before, self.now = self.now, frames
        try:
            yield
        finally:
            self.now = before


def note_elements(trace: Trace, arrays: Sequence[Any]) -> None:
    """Note the elements of arrays (object arrays of scalars)."""
    for array in arrays:
        if array.size < 2:
            continue
        shape = tuple(n for n in array.shape if n > 1)
        number = len(trace.elements)
        for index, x in zip(np.ndindex(shape), array.flat, strict=True):
            if isinstance(x, Value):
                element = Element(number, shape, index, trace.now)
                trace.elements.setdefault(x.number, element)


def frames_of(eqn: Equation, trace: Trace) -> tuple[Frame, ...]:
    """Return the source calls of an equation, the outermost first.

    A compiled function keeps the places of its first trace: the inner ones follow its call. Inside
    a function of JAX the place is that of its call.
    """
    if id(eqn) in trace.calls:
        return trace.calls[id(eqn)]
    outer = trace.now
    frames = [
        Frame(one.function.split(".<locals>")[0], one.file, one.line)
        for one in eqn.place
        if not is_wrapper(one.file)
    ]
    if not outer:
        return tuple(frames)
    for number, frame in enumerate(frames):
        if (frame.function, frame.file) == (outer[-1].function, outer[-1].file):
            return (*outer[:-1], *frames[number:])
    return outer


_WRAPPERS = tuple(
    os.path.join(os.path.dirname(spec.origin), "")
    for name in ("equinox", "jaxtyping", "beartype", "diffrax")
    if (spec := find_spec(name)) is not None and spec.origin is not None
)
"""Folders of libraries whose functions only call others."""


def is_wrapper(file: str) -> bool:
    """Whether the functions of a file only call others."""
    return file.startswith((*_WRAPPERS, "<"))
