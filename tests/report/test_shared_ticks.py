"""One tick drawn in many places looks like many."""

import re
from xml.etree import ElementTree

import numpy as np
from matplotlib.axes import Axes

from jaxsat.report import figure_painter
from jaxsat.report.plot import TIME, Axis, Line, Plot
from jaxsat.report.saving import save_figures


def plots() -> list[Plot]:
    """Axes of all kinds: small ticks and numbers on them, names, an offset."""
    x = np.linspace(0.0, 300.0, 50)
    axes = [
        (Axis("size", "m", log=True), 10 ** np.linspace(-0.7, 0.2, 50)),
        (Axis("rate", "rad/s", linear_to=1e-3), np.linspace(-1, 1, 50)),
        (Axis("phase", names={0: "off", 2: "on"}), np.linspace(0, 2, 50)),
        (Axis("far", "m"), 1e7 + x),
    ]
    return [Plot(axis.label, "", TIME, axis, [Line(x, y)]) for axis, y in axes]


def drawn() -> dict[str, bytes]:
    """The files of the figure."""
    files: dict[str, bytes] = {}
    save_figures({"all": figure_painter.paint(plots(), "All", 1.2)}, files.__setitem__)
    return files


def strokes(svg: bytes) -> set[tuple[str | None, ...]]:
    """All lines and signs of an SVG file, however they are grouped."""
    elements = [*ElementTree.fromstring(svg).iter()]
    lines = {
        (" ".join(line.split()), one.get("style"))
        for one in elements
        for line in re.findall("M[^M]*", one.get("d", ""))
    }
    return lines | {
        (one.get("x"), one.get("y"), one.get("style"), one.get("transform")) for one in elements
    }


def test_figure_is_the_same_as_with_a_tick_for_each_place(monkeypatch):
    shared = drawn()
    monkeypatch.setattr(figure_painter, "SharedTicksAxes", Axes)
    apart = drawn()
    assert shared["all.png"] == apart["all.png"]
    assert strokes(shared["all.svg"]) == strokes(apart["all.svg"])


def test_numbers_can_be_read_one_by_one():
    figure = figure_painter.paint(plots(), "All", 1.2)
    texts = [label.get_text() for label in figure.axes[2].get_yticklabels()]
    assert texts == ["off", "on"]
    log = figure.axes[0].get_yticklabels(which="both")
    assert len({label.get_text() for label in log}) > 2
