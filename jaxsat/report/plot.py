"""What a picture shows, as plain data: matplotlib paints it for paper, Bokeh for pages.

Colours and dashes are the painters', by the order of lines.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Axis:
    """A quantity, its unit ("" or "1" where it has none), and what is shown of it.

    `limits` are its ends, None for one that follows the data.
    """

    label: str
    unit: str = ""
    log: bool = False
    limits: tuple[float | None, float | None] = (None, None)

    @property
    def text(self) -> str:
        """What stands beside the axis."""
        return f"{self.label} ({self.unit})" if self.unit not in ("", "1") else self.label


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


@dataclass(frozen=True)
class Band:
    """What lies between two values (n,) over the points of the first line."""

    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Bars:
    """Heights (n,) between edges (n + 1,)."""

    edges: np.ndarray
    heights: np.ndarray


@dataclass(frozen=True)
class Plot:
    """One panel: its title, what it tells in a sentence, and what is drawn."""

    title: str
    told: str
    x: Axis
    y: Axis
    lines: Sequence[Line] = ()
    band: Band | None = None
    bars: Bars | None = None
