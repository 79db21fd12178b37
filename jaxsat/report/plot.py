"""Content of plots as plain data, painted by matplotlib on paper and by Bokeh on pages.

Painters choose colours and dashes by the order of lines. Both draw long signals decimated, with the
extremes of every interval kept.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Axis:
    """A quantity with its unit ("1" for a pure number, "" without), and the range of its axis.

    `limits` are its ends, None for one that follows the data. On paper an axis is logarithmic
    beyond `linear_to` on either side of zero; a page, which can be enlarged, stays linear. `names`
    replace the numbers of some ticks.
    """

    label: str
    unit: str = ""
    log: bool = False
    limits: tuple[float | None, float | None] = (None, None)
    linear_to: float | None = None
    names: Mapping[int, str] = field(default_factory=dict)

    @property
    def unit_text(self) -> str:
        """Unit behind a number, empty for a pure one."""
        return "" if self.unit == "1" else self.unit

    @property
    def text(self) -> str:
        """Text beside the axis."""
        return f"{self.label} ({self.unit_text})" if self.unit_text else self.label


TIME = Axis("time", "s")


@dataclass(frozen=True)
class Band:
    """Area between two values (n,) over the points of a line, and its meaning."""

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
    """Values (n, m) at `x` (n,), too many for lines: a shaded strip for each of the `labels`."""

    x: np.ndarray
    values: np.ndarray
    labels: Sequence[str]


@dataclass(frozen=True)
class Plot:
    """One panel: its title, its message as a sentence, and the data.

    Without a sentence the numbers of its lines are there for screen readers alone.
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
    """Events during signals: instants (s) with their names, and named spans of time.

    `shades` say of each sample of `times` (n,) whether it belongs to a span of that name.
    """

    times: np.ndarray
    marks: Sequence[tuple[float, str]] = ()
    shades: Mapping[str, np.ndarray] = field(default_factory=dict)


MOST = 4000
"""Approximate samples of a plot: two for each pixel of a wide screen."""


def kept_samples(signals: np.ndarray, most: int = MOST) -> np.ndarray:
    """Return about `most` indices of the samples of `signals` (samples, n) to keep, in order.

    Time is divided into equal numbers of samples. Each part keeps its first sample, and those at
    which a signal is smallest and largest; the last sample of all is kept, and the samples beside
    the begin and the end of finite values.
    """
    count, columns = signals.shape
    if count <= most:
        return np.arange(count)
    parts = max(1, most // (2 * columns + 1))
    begins = np.linspace(0, count, parts, endpoint=False).astype(int)
    numbers = [begins, [count - 1]]
    for column in signals.T:
        finite = np.isfinite(column)
        numbers += [
            np.flatnonzero(finite[1:] != finite[:-1]),
            1 + np.flatnonzero(finite[1:] != finite[:-1]),
        ]
        for sign in (1, -1):
            numbers.append(_places_of_largest(np.where(finite, sign * column, -np.inf), begins))
    return np.unique(np.concatenate(numbers))


def _places_of_largest(values: np.ndarray, begins: np.ndarray) -> np.ndarray:
    """Return the index of the largest value of each part."""
    ends = np.append(begins[1:], len(values))
    places = begins[:, None] + np.arange((ends - begins).max())
    return begins + np.argmax(values[np.minimum(places, ends[:, None] - 1)], axis=1)


def largest_of_parts(values: np.ndarray, parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the begins of about `parts` parts of the samples (n, m), and their largest values."""
    begins = np.unique(
        np.linspace(0, len(values), min(parts, len(values)), endpoint=False, dtype=int)
    )
    return begins, np.fmax.reduceat(values, begins)
