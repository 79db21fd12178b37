"""What is known of a program's values beside the program: where they come from in the source."""

from contextlib import contextmanager
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Frame:
    """A function of the source that was being traced, and the line in it."""

    function: str
    file: str
    line: int


@dataclass(frozen=True)
class Element:
    """Which element of which array a value was first; `array` is a number, with its place."""

    array: int
    shape: tuple[int, ...]
    index: tuple[int, ...]
    place: tuple[Frame, ...]


@dataclass
class Trace:
    """What is known of values beside their program, by their numbers.

    `places` are the calls of the source that a value comes from, from the outermost; `calls` those
    of equations, by identity, that are calls put back into a program. `names` are those of values
    that functions give and take.
    """

    places: dict[int, tuple[Frame, ...]] = field(default_factory=dict)
    elements: dict[int, Element] = field(default_factory=dict)
    now: tuple[Frame, ...] = ()
    calls: dict[int, tuple[Frame, ...]] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)

    @contextmanager
    def at(self, frames: tuple[Frame, ...]):
        """While inside, values come from there."""
        before, self.now = self.now, frames
        try:
            yield
        finally:
            self.now = before
