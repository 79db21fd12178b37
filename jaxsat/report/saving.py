"""Saving of figures to files; a figure that fails is reported and left out.

A user's settings of matplotlib have no effect: equal results give equal figures.
"""

import contextlib
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from jaxsat.core.process import no_collection
from jaxsat.core.text import clean
from jaxsat.store.files import FAILURES, reason

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Figures = Mapping[str, "Figure | Callable[[], Figure]"]
"""Figures by file name, or functions that make them."""

OF_PROCESS = ("backend", "interactive", "toolbar", "timezone", "date.epoch", "webagg", "tk.")
"""Prefixes of matplotlib's settings that do not concern style."""


def save_figures(figures: Figures | Callable[[], Figures], write: Callable[[str, bytes], Any]):
    """Pass every figure as PNG and SVG to `write`, which takes a file name and its content.

    The files have no date. Warns of figures that cannot be drawn, and of those left out on a full
    disk. Other exceptions of `write` are raised.
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
        with rc_context(style), no_collection(), undocumented():
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


@contextlib.contextmanager
def undocumented() -> Iterator[None]:
    """Import matplotlib without docstrings and signatures of `set`.

    Composing them for its hundred classes takes a third of the import time. (`kwdoc` is public; the
    other name is that of matplotlib 3.9 to 3.11, and idle elsewhere.)
    """
    from matplotlib import artist

    owners: Any = ((artist, "kwdoc"), (artist.Artist, "_update_set_signature_and_docstring"))
    composed = [(owner, name, vars(owner)[name]) for owner, name in owners if name in vars(owner)]
    for owner, name, _ in composed:
        setattr(owner, name, lambda *_: "")
    try:
        yield
    finally:
        for owner, name, function in composed:
            setattr(owner, name, function)


def _draw(name: str, figure: "Figure | Callable[[], Figure]") -> dict[str, bytes]:
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
