"""Figures of a run: what is drawn is what the signals say, and nothing is left out."""

import dataclasses

import numpy as np
import pytest
import xarray as xr

from jaxsat.core.attitude import euler_angles, pointing_error
from jaxsat.report.figure_painter import paint
from jaxsat.report.figures import (
    pointing_figure,
    rates_figure,
    torque_figure,
    trajectory_drawings,
)
from jaxsat.report.plot import TIME, Axis, Line, Plot, Strips, Timeline
from jaxsat.report.run_plots import further_signals
from jaxsat.store.dataset import pointing

TIMES = np.arange(101.0)
AXES = {"body_axis": ["x", "y", "z"], "thruster": [str(i) for i in range(1, 9)]}


def signal(values, units="1", axis=None, name="a signal"):
    dims = ("time",) if axis is None else ("time", axis)
    return xr.Variable(dims, values, {"units": units, "long_name": name})


def dataset(**more):
    """A body that turns once about y under a torque about x that decays, then changes."""
    angle = np.radians(400 * TIMES / 100 - 200)
    quaternion = np.stack([np.cos(angle / 2), 0 * angle, np.sin(angle / 2), 0 * angle], 1)
    torque = np.exp(-TIMES)[:, None] * [1.0, 0.0, 0.0]
    return xr.Dataset(
        {
            "w": (("time", "w_component"), np.zeros((101, 2))),
            "z": signal(angle, "rad"),
            "quaternion": (("time", "quaternion_component"), quaternion),
            "omega": signal(torque, "rad s-1", "body_axis"),
            "torque": signal(torque, "N m", "body_axis"),
            "lyapunov": signal(np.full(101, np.nan), "J"),
            "mode": signal(np.zeros(101)),
            **pointing(quaternion),
            **more,
        },
        {"time": TIMES, **AXES, "euler_axis": ["roll", "pitch", "yaw"]},
        {"title": "Cost $5 and $6"},
    )


def test_the_pointing_error_is_drawn_in_degrees_and_broken_where_it_jumps():
    run = dataset()
    total, axes, euler = pointing_figure(run).axes
    quaternion = run["quaternion"].values
    error = pointing_error(quaternion)
    size = np.linalg.norm(error, axis=1)
    size[50] = np.nan  # zero, which a logarithmic axis has no place for
    np.testing.assert_allclose(total.lines[0].get_ydata(), size)
    drawn = np.asarray(axes.lines[1].get_ydata())
    assert np.isnan(drawn).sum() == 2, "at 180 degrees, twice"
    kept = np.isfinite(drawn)
    np.testing.assert_allclose(drawn[kept], error[kept, 1])
    np.testing.assert_allclose(euler.lines[1].get_ydata(), euler_angles(quaternion)[:, 1])
    assert [axis.get_ylabel().replace("\n", " ") for axis in (total, axes, euler)] == [
        "Total pointing error (°)",
        "Pointing error about body axes (°)",
        "Euler angles 3-2-1 (°)",
    ]


def test_a_torque_that_changes_between_saved_times_shows_its_range():
    """Bang-bang: saved it is 1 N m throughout."""
    size = np.ones((101, 1)) * [1.0, 0.0, 0.0]
    run = dataset(
        torque=signal(size, "N m", "body_axis"),
        torque_min=signal(-size, "N m", "body_axis"),
        torque_max=signal(size, "N m", "body_axis"),
        torque_mean=signal(0 * size, "N m", "body_axis"),
    )
    first, second, enlarged = torque_figure(run).axes
    band = first.collections[0].get_paths()[0].vertices[:, 1]
    assert (band.min(), band.max()) == (-1.0, 1.0)
    assert np.all(np.asarray(first.lines[0].get_ydata()) == 0)
    assert first.get_ylabel() == "Torque T1 (N m)"
    assert second.get_ylabel() == "Torque T2 (N m)"
    assert len(enlarged.collections) == 2
    third = dataset(**{name: run[name].roll(body_axis=1) for name in run if "torque" in str(name)})
    assert len(torque_figure(third.roll(body_axis=1)).axes) == 4, "about the third axis too"


@pytest.mark.parametrize(("peak", "scale"), [(1e4, "symlog"), (2.0, "linear")])
def test_a_peak_that_would_hide_the_rest_is_compressed(peak, scale):
    values = np.where(TIMES == 0, peak, 0.7)[:, None] * [1.0, 0.0, 0.0]
    run = dataset(
        torque=signal(values, "N m", "body_axis"), omega=signal(values, "rad s-1", "body_axis")
    )
    drawings = trajectory_drawings(run)
    for name in ("torque", "rates"):
        whole, enlarged = drawings[name]().axes
        assert (whole.get_yscale(), enlarged.get_yscale()) == (scale, "linear")
    assert rates_figure(run).axes[0].get_yscale() == "linear"


def test_any_further_signal_gets_a_panel_with_its_name_and_unit():
    error = np.random.default_rng(0).normal(size=(101, 3))
    pulses = np.zeros((101, 8))
    pulses[37, 4] = 0.25
    run = dataset(
        rate_estimate_error=signal(error, "rad s-1", "body_axis", "error of the estimator"),
        rate_estimate_3sigma=signal(np.full((101, 3), 3.0), "rad s-1", "body_axis"),
        propellant=signal(TIMES, "kg", name="propellant that costs $5"),
        pulses=signal(pulses, "1", "thruster", "pulses of each thruster"),
    )
    assert further_signals(run) == ["rate_estimate_error", "propellant", "pulses"]
    figure = trajectory_drawings(run)["signals"]()
    figure.canvas.draw()  # dollar signs begin no mathematics
    first, second, third, shades = figure.axes
    assert (len(first.lines), len(first.collections)) == (3, 3), "errors and their bounds"
    assert first.get_ylim()[1] == pytest.approx(1.1 * max(3.0, np.abs(error[2:]).max()))
    np.testing.assert_array_equal(first.lines[1].get_ydata(), error[:, 1])
    assert [text.get_text() for text in first.get_legend().get_texts()] == ["x", "y", "z", "±3σ"]
    assert first.get_ylabel().split("\n")[-1] == "(rad/s)"
    assert second.get_ylabel().endswith("(kg)")
    (strips,) = third.images  # more components than lines can be told apart
    np.testing.assert_array_equal(strips.get_array(), pulses.T)
    assert third.get_ylim() == (0.5, 8.5), "every strip is seen whole"
    assert third.get_ylabel().replace("\n", " ") == "Pulses of each thruster (–)"
    assert shades.get_position().x0 > third.get_position().x1, "a bar beside it"
    assert set(trajectory_drawings(run)) - set(trajectory_drawings(dataset())) == {"signals"}


def test_a_run_that_ended_at_once_is_drawn():
    run = dataset()
    for name in run:
        run[name][1:] = np.nan
    drawings = trajectory_drawings(run)
    assert drawings.keys() == trajectory_drawings(dataset()).keys()
    for draw in drawings.values():
        draw().canvas.draw()


def test_spans_are_shown_and_told_in_the_first_panel_without_strips():
    pulses = Strips(TIMES, np.zeros((101, 2)), ["A", "B"])
    strips = Plot("Pulses", "", TIME, Axis("Pulses"), strips=pulses)
    line = Plot("Propellant", "", TIME, Axis("Propellant"), [Line(TIMES, TIMES, "tank")])
    timeline = Timeline(TIMES, [(30.0, "alarm")], {"holding": TIMES > 40})
    first, second, third, *_ = paint([strips, line, line], "Figure", timeline=timeline).axes
    assert [len(panel.collections) for panel in (first, second, third)] == [0, 1, 0]
    assert np.unique(second.collections[0].get_paths()[0].vertices[:, 0])[0] == 41
    assert [text.get_text() for text in second.get_legend().get_texts()] == ["tank", "holding"]
    assert first.get_legend() is third.get_legend() is None
    assert [text.get_text().strip() for text in first.texts] == ["alarm"]
    for plots in ([strips], [strips, strips]):
        panels = paint(plots, "Figure", timeline=timeline).axes
        assert not any(panel.get_legend() or panel.collections for panel in panels)
    nameless = dataclasses.replace(line, lines=[Line(TIMES, TIMES)])
    (panel,) = paint([nameless], "Figure", timeline=timeline).axes
    assert [text.get_text() for text in panel.get_legend().get_texts()] == ["holding"]


def test_a_legend_is_no_wider_than_a_panel_beside_a_bar():
    pulses = Strips(TIMES, np.zeros((101, 2)), ["A", "B"])
    strips = Plot("Pulses", "", TIME, Axis("Pulses"), strips=pulses)
    lines = [Line(TIMES, TIMES, f"oscillating {number}") for number in range(5)]
    axes = paint([strips, Plot("Commands", "", TIME, Axis("Commands"), lines)], "Figure").axes
    legend, panel = axes[1].get_legend(), axes[1].get_window_extent()
    assert panel.x0 <= legend.get_window_extent().x0 < legend.get_window_extent().x1 <= panel.x1
    assert axes[0].get_window_extent().y0 >= legend.get_window_extent().y1


def test_a_failure_is_marked_in_every_panel_and_named_once():
    run = dataset()
    run.attrs["scenario"] = """
        [[failure]]
        of = "thruster 3"
        at_s = 30
        kind = "stuck-on"
        [[failure]]
        of = "thruster 4"
        at_s = 3000
        kind = "dead"
    """
    panels = rates_figure(run).axes
    for panel in panels:
        marks = [line for line in panel.lines if np.all(np.asarray(line.get_xdata()) == 30)]
        assert len(marks) == 1
    assert [text.get_text().strip() for text in panels[0].texts] == ["thruster 3 stuck on"]
    assert not panels[1].texts
