"""One style for all figures: readable in grey, by the colour-blind, and in print.

Colours are three of Okabe and Ito's palette whose lightness differs; every line also has its own
dash pattern, so that no figure depends on colour.
"""

import io
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from jaxsat.core.text import clean

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class NotebookFigure(Figure):
    """A figure of matplotlib as the value of a notebook's cell: its PNG."""

    def _repr_png_(self) -> bytes:
        """Return the PNG file."""
        file = io.BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


LETTERS_PER_INCH = 10.4
"""Letters per inch of a bold title of 10 points, with a margin."""

MAX_TITLE_LENGTH, MAX_LABEL_LENGTH = 200, 60
"""Largest numbers of characters that fit on a figure."""

STYLES: tuple[Mapping[str, Any], ...] = tuple(
    MappingProxyType({"color": color, "linestyle": dash, "linewidth": width})
    for color, dash, width in (
        ("#000000", "-", 1.0),
        ("#D55E00", (0, (6, 2)), 1.2),
        ("#56B4E9", (0, (1.2, 1.2)), 1.7),
        ("#009E73", (0, (6, 1.5, 1.2, 1.5)), 1.2),
        ("#777777", (0, (3, 1, 1, 1, 1, 1)), 1.0),
    )
)
MOST_LINES = len(STYLES)
"""Number of distinguishable lines; more signals are drawn as strips."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X")


def line_of(number: int) -> dict[str, Any]:
    """Return the style of line `number` (from 0): no two of 35 share both marker and dashes.

    The markers distinguish the first seven in grey, also where they lie close.
    """
    marker = {"marker": MARKERS[number % len(MARKERS)], "markersize": 4.0}
    return {**STYLES[number % MOST_LINES], **marker}


SETTINGS: Mapping[str, Any] = MappingProxyType(
    {
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": "#dddddd",
        "grid.linewidth": 0.6,
        "legend.frameon": False,
        "svg.hashsalt": "jaxsat",
        "svg.fonttype": "path",
        "figure.dpi": 130,
        "axes.formatter.limits": (-3, 5),
    }
)


def set_title(figure: Figure, title: str, top: float | None = None) -> None:
    """Give a figure a title as plain text: one line, without mathematics.

    Long titles are smaller, so that they fit. `top` is the position as a fraction of the height;
    None leaves it to the figure's layout, which then makes room for it.
    """
    text = clean(title, MAX_TITLE_LENGTH)
    size = min(10.0, max(6.0, LETTERS_PER_INCH * 10 * figure.get_figwidth() / max(1, len(text))))
    look: dict[str, Any] = {"fontsize": size, "fontweight": "bold", "ha": "left", "va": "top"}
    look |= {} if top is None else {"y": top}
    figure.suptitle(text, x=0.01, parse_math=False, **look)


def escape_mathematics(label: str) -> str:
    """Escape dollar signs of a label, which would begin mathematics."""
    return clean(label, MAX_LABEL_LENGTH).replace("$", "\\$")


def panels(
    title: str, size: tuple[float, float], rows: int = 1, columns: int = 1
) -> "tuple[Figure, list[list[Axes]]]":
    """Return a figure of this size (inches) with a title, and its rows of panels."""
    with rc_context(dict[Any, Any](SETTINGS)):
        figure = NotebookFigure(figsize=size, layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False)
        set_title(figure, title)
    return figure, axes.tolist()
