"""One tick drawn in many places looks like many."""

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


def test_figure_is_the_same_to_the_byte_as_with_a_tick_for_each_place(monkeypatch):
    shared = drawn()
    monkeypatch.setattr(figure_painter, "SharedTicksAxes", Axes)
    assert shared.keys() == {"all.png", "all.svg"}
    assert shared == drawn()


def test_numbers_can_be_read_one_by_one():
    figure = figure_painter.paint(plots(), "All", 1.2)
    texts = [label.get_text() for label in figure.axes[2].get_yticklabels()]
    assert texts == ["off", "on"]
    log = figure.axes[0].get_yticklabels(which="both")
    assert len({label.get_text() for label in log}) > 2
