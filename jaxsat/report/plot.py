"""What a picture shows, as plain data: matplotlib paints it for paper, Bokeh for pages.

Colours and dashes are the painters', by the order of lines. Both draw long signals decimated, with
the extremes of every interval kept.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Axis:
    """A quantity, its unit ("1" for a pure number, "" where it has none), and what is shown of it.

    `limits` are its ends, None for one that follows the data. On paper an axis is logarithmic
    beyond `linear_to` on either side of zero; a page, which can be enlarged, stays linear. `names`
    stand at some values in place of numbers.
    """

    label: str
    unit: str = ""
    log: bool = False
    limits: tuple[float | None, float | None] = (None, None)
    linear_to: float | None = None
    names: Mapping[int, str] = field(default_factory=dict)

    @property
    def unit_text(self) -> str:
        """The unit behind a number, nothing for a pure one."""
        return "" if self.unit == "1" else self.unit

    @property
    def text(self) -> str:
        """What stands beside the axis."""
        return f"{self.label} ({self.unit_text})" if self.unit_text else self.label


TIME = Axis("time", "s")


@dataclass(frozen=True)
class Band:
    """What lies between two values (n,) over the points of a line, and what that is."""

    low: np.ndarray
    high: np.ndarray
    label: str = ""


@dataclass(frozen=True)
class Line:
    """A line through points (n,), or with `steps` one that keeps each value until the next.

    With `points` each is marked. A `faint` line is one of many alike behind the others.
    """

    x: np.ndarray
    y: np.ndarray
    label: str = ""
    steps: bool = False
    points: bool = False
    faint: bool = False
    band: Band | None = None


@dataclass(frozen=True)
class Bars:
    """Heights (n,) between edges (n + 1,)."""

    edges: np.ndarray
    heights: np.ndarray


@dataclass(frozen=True)
class Strips:
    """Values (n, m) at `x` (n,), too many for lines: a strip in shades for each of the `labels`."""

    x: np.ndarray
    values: np.ndarray
    labels: Sequence[str]


@dataclass(frozen=True)
class Plot:
    """One panel: its title, what it tells in a sentence, and what is drawn.

    Without a sentence the numbers of its lines stand where only a screen reader finds them.
    """

    title: str
    sentence: str
    x: Axis
    y: Axis
    lines: Sequence[Line] = ()
    bars: Bars | None = None
    strips: Strips | None = None


@dataclass(frozen=True)
class Timeline:
    """What happens while signals last: instants (s) with their names, and named spans of time.

    `shades` say of each sample of `times` (n,) whether it belongs to a span of that name.
    """

    times: np.ndarray
    marks: Sequence[tuple[float, str]] = ()
    shades: Mapping[str, np.ndarray] = field(default_factory=dict)


MOST = 4000
"""Samples of a plot, about: two for each pixel of a wide screen."""


def kept_samples(signals: np.ndarray, most: int = MOST) -> np.ndarray:
    """The numbers of the samples to keep of `signals` (samples, n), about `most` of them, in order.

    Time is divided into equal numbers of samples. Of each part the first sample stays, and those at
    which a signal is smallest and largest; of all, the last one, and the last before a signal ends
    (NaN) and the first from which on it is there.
    """
    count, columns = signals.shape
    if count <= most:
        return np.arange(count)
    parts = max(1, most // (2 * columns + 1))
    begins = np.linspace(0, count, parts, endpoint=False).astype(int)
    numbers = [begins, [count - 1]]
    for column in signals.T:
        there = np.isfinite(column)
        numbers += [
            np.flatnonzero(there[1:] != there[:-1]),
            1 + np.flatnonzero(there[1:] != there[:-1]),
        ]
        for sign in (1, -1):
            numbers.append(_places_of_largest(np.where(there, sign * column, -np.inf), begins))
    return np.unique(np.concatenate(numbers))


def _places_of_largest(values: np.ndarray, begins: np.ndarray) -> np.ndarray:
    """The place of the largest value of each part."""
    ends = [*begins[1:], len(values)]
    return np.array(
        [begin + np.argmax(values[begin:end]) for begin, end in zip(begins, ends, strict=True)]
    )


def largest_of_parts(values: np.ndarray, parts: int) -> tuple[np.ndarray, np.ndarray]:
    """The begin of each of about `parts` parts of the samples (n, m), and its largest values."""
    begins = np.unique(
        np.linspace(0, len(values), min(parts, len(values)), endpoint=False, dtype=int)
    )
    return begins, np.fmax.reduceat(values, begins)
