"""Every line of a figure is drawn, and told from the others without colour."""

import numpy as np
import pytest

from jaxsat.report.comparison_figures import settling_comparison
from jaxsat.report.figure_painter import paint_grid
from jaxsat.report.page.plots import chart_of
from jaxsat.report.plot import TIME, Axis, Plot, Strips
from jaxsat.report.study_plots import settled_by_law
from jaxsat.report.style import MARKERS
from jaxsat.report.tuning_document import methods_plot

COUNT = 9


def looks(axis):
    return [(line.get_marker(), str(line.get_linestyle()), line.get_color()) for line in axis.lines]


@pytest.mark.parametrize("count", [2, COUNT])
def test_each_law_of_a_comparison_has_a_line_of_its_own(count):
    times = np.random.default_rng(0).uniform(20, 200, (count, 50))
    laws = {f"law {number}": one for number, one in enumerate(times)}
    figure = settling_comparison({("hard", 5.0): laws}, {("hard", 5.0): 300.0}, "many laws")
    axis = figure.axes[0]
    assert len(axis.lines) == count
    assert len(set(looks(axis))) == count
    assert len({marker for marker, *_ in looks(axis)}) == min(count, len(MARKERS))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(laws)


def test_cases_that_settle_at_once_are_drawn_where_the_logarithmic_axis_begins():
    plot = settled_by_law("k2", {"held": np.array([0.0, 0.0, np.inf])}, 300.0)
    (line,) = plot.lines
    assert line.x.min() == plot.x.limits[0] > 0
    assert line.y[line.x == line.x.min()].max() == line.y[-1] == pytest.approx(2 / 3)


def test_each_method_of_a_baseline_has_a_line_of_its_own():
    trace = np.stack([np.linspace(10, 1000, 8), np.geomspace(9, 1, 8)], axis=1)
    traces = {f"method {n}": trace * (1 + n / 10) for n in range(COUNT)}
    figure = paint_grid([[methods_plot(traces)]], "many")
    (axis,) = figure.axes
    assert len(set(looks(axis))) == COUNT


@pytest.mark.parametrize(
    ("ends", "told"),
    [
        ((-1.0, -1e-20), "from -1 (dark) to 0 (bright) N m"),
        ((1e-23, 2e-13), "from 0 (dark) to 2e-13 (bright) N m"),
        ((-1.0, -1.0), "-1 all the time N m"),
    ],
)
def test_shades_of_strips_are_told_without_round_off(ends, told):
    strips = Strips(np.arange(2.0), np.array([ends, ends]).T, ["a", "b"])
    chart = chart_of(Plot("torque", "", TIME, Axis("torque", "N m"), strips=strips))
    assert chart.title == f"torque, {told}"
