"""Figures that a notebook shows without matplotlib's inline backend."""

import io

from matplotlib.figure import Figure


class NotebookFigure(Figure):
    """A figure of matplotlib as the value of a notebook's cell: its PNG."""

    def _repr_png_(self) -> bytes:
        """Return the PNG file."""
        file = io.BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()
