"""Names of failures and verdicts in a figure cover neither each other nor the edge."""

import itertools

import numpy as np

from jaxsat.report.figure_painter import paint
from jaxsat.report.plot import TIME, Axis, Line, Plot, Timeline


def test_names_of_marks_at_one_instant_and_at_the_end_are_all_read():
    time = np.linspace(0.0, 1800.0, 50)
    names = ["wheel 1 dead", "wheel 3 dead", "thruster A stuck-on", "magnetorquer x dead", "alarm"]
    marks = [(300.0 + 8 * (row > 3), name) for row, name in enumerate(names)]
    marks += [(1200.0, "wheel 2 dead"), (1790.0, "wheel 4 degraded"), (1790.0, "thruster B dead")]
    plot = Plot("Torque", "", TIME, Axis("|T|", "N m"), [Line(time, time)])
    (panel,) = paint([plot], "Failures", timeline=Timeline(time, marks)).axes
    texts = {one.get_text().strip(): one for one in panel.texts}
    assert [*texts] == [name for _, name in marks]
    boxes, edge = [one.get_window_extent() for one in texts.values()], panel.get_window_extent()
    for one, other in itertools.combinations(boxes, 2):
        assert not one.overlaps(other)
    for box in boxes:
        assert edge.x0 <= box.x0 < box.x1 <= edge.x1
        assert edge.y0 <= box.y0 < box.y1 <= edge.y1
