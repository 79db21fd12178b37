"""Figures to files. A figure that fails is told and left out; matplotlib is imported here at last.

What a user has set for matplotlib has no part in it: equal results give equal figures.
"""

import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from jaxsat.core.process import no_collection
from jaxsat.core.text import clean
from jaxsat.store.files import FAILURES, reason

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Figures = Mapping[str, "Figure | Callable[[], Figure]"]
"""Figures by file name, or what makes them."""

OF_PROCESS = ("backend", "interactive", "toolbar", "timezone", "date.epoch", "webagg", "tk.")
"""Settings of matplotlib, by their beginnings, that are no matter of style."""


def save_figures(figures: Figures | Callable[[], Figures], write: Callable[[str, bytes], Any]):
    """Give every figure as PNG and SVG to `write`, which takes a file's name and its content.

    They bear no date. Warns, with the name, of one that cannot be drawn; of all if `figures`, where
    it makes them, cannot; and of those left out for which a full disk has no room. What else
    `write` raises is raised.
    """
    files: dict[str, bytes] = {}
    try:
        from matplotlib import rc_context, rcParamsDefault

        style: dict[Any, Any] = {
            name: value
            for name, value in dict.items(rcParamsDefault)
            if not name.startswith(OF_PROCESS)
        }
        style["svg.hashsalt"] = "jaxsat"  # names in SVG are random otherwise
        with rc_context(style), no_collection():
            by_name = figures() if callable(figures) else figures
            for name, figure in by_name.items():
                files |= _draw(name, figure)
    except Exception as error:
        _tell("figures", error)
    for number, (name, content) in enumerate(files.items()):
        try:
            write(name, content)
        except OSError as error:
            if error.errno not in FAILURES:
                raise
            left_out = ", ".join(list(files)[number:])
            warnings.warn(f"{left_out}: not written, {reason(error)}", RuntimeWarning, stacklevel=2)
            return


def _draw(name: str, figure: "Figure | Callable[[], Figure]") -> dict[str, bytes]:
    """A figure's files; none where it cannot be drawn."""
    from jaxsat.report.png_and_svg import png_and_svg

    try:
        drawing = figure() if callable(figure) else figure
        png, svg = png_and_svg(drawing)
    except Exception as error:
        _tell(f"figure {name}", error)
        return {}
    return {f"{name}.png": png, f"{name}.svg": svg}


def _tell(what: str, error: Exception) -> None:
    reason = clean(str(error).strip().split("\n")[0], 200)
    text = f"{what}: not drawn, {type(error).__name__}{': ' * bool(reason)}{reason}"
    warnings.warn(text, RuntimeWarning, stacklevel=3)
