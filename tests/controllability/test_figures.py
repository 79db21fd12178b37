"""The figures carry the data they are given and their units."""

import numpy as np
import pytest

from jaxsat.controllability.failures import failure_records, failure_table
from jaxsat.controllability.maps import (
    angle_grid,
    margins_over_angles,
    margins_over_inertias,
    physical_inertias,
    uncontrollable_single_directions,
)
from jaxsat.report import controllability_figures as figures

PAPER = np.array([449.5, 264.6, 312.5])


def texts(figure):
    figure.draw_without_rendering()
    found = []
    for axes in figure.axes:
        found += [axes.get_xlabel(), axes.get_ylabel(), axes.get_title()]
        found += [text.get_text() for text in axes.texts]
        found += [label.get_text() for label in axes.get_yticklabels()]
        if axes.get_legend():
            found += [text.get_text() for text in axes.get_legend().get_texts()]
    return "\n".join(found)


@pytest.mark.slow
def test_inertia_map_shows_the_uncontrollable_line():
    points, moments = physical_inertias(20)
    margins = np.asarray(margins_over_inertias(moments, np.eye(3)[:, :2]))
    figure = figures.inertia_map(points, margins, spacecraft=PAPER)
    marked = figure.axes[0].lines[0].get_xydata()
    np.testing.assert_allclose(marked[:, 0], 0.5)  # J1 = J2 stands upright in the middle
    assert len(marked) == np.sum(np.isclose(moments[:, 0], moments[:, 1]))
    place = next(line for line in figure.axes[0].lines if line.get_marker() == "D").get_xydata()[0]
    second = 1 - 2 * PAPER / PAPER.sum()
    np.testing.assert_allclose(place, [second[1] + 0.5 * second[2], second[2] * np.sqrt(0.75)])
    assert "uncontrollable" in texts(figure)


@pytest.mark.slow
def test_angle_map_is_in_degrees_and_draws_the_curves():
    azimuths, elevations = angle_grid(37, 19)
    inertia = np.diag(PAPER)
    margins = np.asarray(margins_over_angles(inertia, azimuths, elevations))
    curves = uncontrollable_single_directions(inertia, 60)
    figure = figures.angle_map(azimuths, elevations, margins, uncontrollable=curves)
    assert len(figure.axes[0].lines) == len(curves) == 8
    assert figure.axes[0].get_xlim()[1] == pytest.approx(180, abs=6)
    assert "(deg" in texts(figure)


def test_failure_chart_has_a_row_a_case():
    records = failure_records(failure_table([5.0, 5.0 + 1e-8, 7.0], np.eye(3)))
    figure = figures.failure_chart(records)
    shown = texts(figure)
    for record in records:
        assert f"failed: {record['failed']}" in shown
    assert "borderline" in shown
    assert "margin (smallest singular value)" in shown
    records[0]["both_signs_by"] = "magnetorquers and wheels"
    assert "of magnetorquers: least / largest" in texts(figures.failure_chart(records))
    widths = sorted(bar.get_width() for bar in figure.axes[0].patches)
    assert widths == sorted(r["margin"] for r in records if r["verdict"] != "uncontrollable")
    small = [{**record, "margin": 0.01 * record["margin"]} for record in records]
    (axes,) = figures.failure_chart(small).axes
    assert axes.get_xlim() == pytest.approx(0.01 * np.array(figure.axes[0].get_xlim()))


def test_time_charts_have_units():
    times = np.linspace(0, 10, 50)
    figure = figures.recurrence_chart(times, np.abs(np.sin(times)), 0.1)
    assert "time (s)" in texts(figure)
    figure = figures.energy_chart(times, 1 + 0.01 * np.sin(times), 1.005, 1 + 0.01 * times)
    assert "energy (J)" in texts(figure)
    assert "claim (18)" in texts(figure)
