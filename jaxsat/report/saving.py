"""Figures to files."""

import io
from collections.abc import Callable, Mapping

from matplotlib import rc_context
from matplotlib.figure import Figure


def save_figures(figures: Mapping[str, Figure], write: Callable[[str, bytes], object]) -> None:
    """Give every figure as PNG and SVG to `write`, which takes a file's name and its content.

    They bear no date, so that equal runs give equal files.
    """
    with rc_context({"svg.hashsalt": "jaxsat"}):  # names inside the SVG are random otherwise
        for name, figure in figures.items():
            for ending, metadata in (("png", {"Software": None}), ("svg", {"Date": None})):
                buffer = io.BytesIO()
                figure.savefig(buffer, format=ending, metadata=metadata)
                write(f"{name}.{ending}", buffer.getvalue())
