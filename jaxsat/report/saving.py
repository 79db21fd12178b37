"""Figures to files."""

from collections.abc import Mapping
from pathlib import Path

from matplotlib import rc_context
from matplotlib.figure import Figure


def save_figures(figures: Mapping[str, Figure], folder: Path) -> None:
    """Write every figure as PNG and SVG, without a date so that equal runs give equal files."""
    with rc_context({"svg.hashsalt": "jaxsat"}):  # names inside the SVG are random otherwise
        for name, figure in figures.items():
            figure.savefig(folder / f"{name}.png", metadata={"Software": None})
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
