"""Titles and labels from outside: drawn as they are, whatever is in them."""

import io
import warnings
import xml.etree.ElementTree as xml

import numpy as np
import pytest

from jaxsat.report.comparison_figures import settling_comparison
from jaxsat.report.controllability_figures import inertia_map
from jaxsat.report.figure_painter import paint, paint_grid
from jaxsat.report.study_figures import study_drawings
from jaxsat.report.study_plots import settling_plots
from jaxsat.report.style import escape_mathematics, panels
from jaxsat.report.tuning_document import methods_plot

UGLY = [
    "$k__3$",
    "$\\frac$",
    "a $ b",
    "\\$x$ \\$ \\\\$",
    "$" * 7,
    "<b>&amp;-->]]></b>",
    "nul\0 esc\x1b[31m line\nbreak\r\t\u2028",
    "bytes \udcff\ud800",
    "\u202eright to left",
    "中文 😀 ω√",
    "long " * 4000,
    "",
    " ",
    "{}%s\\",
]


def drawn(figure):
    """Draw as PNG and SVG; gives the SVG, which must be well-formed."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font", UserWarning)
        figure.savefig(io.BytesIO(), format="png", dpi=20)
        file = io.BytesIO()
        figure.savefig(file, format="svg")
    xml.fromstring(file.getvalue())
    return file.getvalue().decode()


@pytest.mark.parametrize("text", UGLY)
def test_titles_and_labels_are_drawn_as_they_are(text):
    figure, ((axes,),) = panels(text, (7.0, 2.7))
    axes.plot([0, 1], [0, 1], label=escape_mathematics(text) or "x")
    axes.legend()
    axes.set_xlabel(escape_mathematics(text))
    drawn(figure)


def test_sentences_above_panels_end_within_the_figure():
    plots = settling_plots(np.linspace(1111.1, 2888.8, 444))
    figure = paint(plots, "settling time")
    figure.draw_without_rendering()
    assert len(plots) == 3
    for panel in figure.axes:
        sentence = panel._left_title
        assert "\n" in sentence.get_text()
        assert sentence.get_window_extent().x1 <= figure.bbox.x1


@pytest.mark.parametrize("length", [40, 84, 120])
def test_a_title_ends_within_its_figure(length):
    figure, _ = panels(("pointing error to the orbit frame " * 4)[:length], (7.0, 2.7))
    figure.draw_without_rendering()
    title = figure.get_suptitle()
    box = next(text for text in figure.texts if text.get_text() == title).get_window_extent()
    assert box.x1 < figure.bbox.x1


@pytest.mark.slow
def test_every_kind_of_figure_takes_any_title():
    text = " ".join(UGLY)[:300]
    times = np.array([1.0, 20.0, np.inf])
    traces = {text: np.array([[1.0, 2.0], [3.0, 1.0]])}
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    figures = [
        *(draw() for draw in study_drawings({"settling_time": times}, {}, text).values()),
        settling_comparison({(text, 5.0): {text: times}}, {(text, 5.0): 100.0}, text),
        paint_grid([[methods_plot(traces)]], text),
        inertia_map(corners, np.ones(3), title=text),
    ]
    for figure in figures:
        drawn(figure)
