"""Figures of studies: what is drawn is what the numbers say."""

import jax.numpy as jnp
import numpy as np

from jaxsat.report.study_figures import (
    DrawnNumber,
    convergence,
    fan_chart,
    fan_figures,
    settling_distribution,
    study_drawings,
    success_map,
)
from jaxsat.simulation.trajectory import Signals
from jaxsat.studies.statistics import wilson

RNG = np.random.default_rng(0)


def test_a_fan_chart_draws_median_and_bands():
    values = RNG.normal(size=(200, 11, 2))
    values[0, 5:] = np.nan
    figure = fan_chart(np.arange(11.0), values, ("a (m)", "b (m)"), "title")
    first, second = figure.axes
    np.testing.assert_allclose(first.lines[0].get_ydata(), np.nanmedian(values[:, :, 0], axis=0))
    assert len(second.collections) == 3
    top = first.collections[0].get_paths()[0].vertices[:, 1].max()
    assert np.isclose(top, np.nanpercentile(values[:, :, 0], 99, axis=0).max())
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        *("1 to 99 %", "10 to 90 %", "25 to 75 %", "median")
    ]
    assert legend.get_title().get_text() == "percentiles of 200 cases"
    dead = fan_chart(np.arange(11.0), values * np.nan, ("a", "b"), "title")
    assert dead.axes[0].get_title(loc="right") == "no case can exist"


def test_the_fans_of_a_study_have_the_pointing_error_in_degrees():
    turns = RNG.uniform(0, 1, (20, 11))
    quaternion = np.stack([np.cos(turns), np.sin(turns), 0 * turns, 0 * turns], axis=2)
    rates = np.full((20, 11, 3), 0.1)
    arrays = {
        "w": rates[..., :2],
        "z": turns,
        "quaternion": quaternion,
        **dict.fromkeys(("omega", "relative_rate", "torque", "disturbance"), rates),
        "rate_error": rates[..., :2],
        **dict.fromkeys(("lyapunov", "mode"), turns),
    }
    signals = Signals(**{name: jnp.asarray(array) for name, array in arrays.items()})
    figures = fan_figures(np.arange(11.0), signals, "title")
    assert set(figures) == {"pointing-fan", "attitude-fan", "rates-fan"}
    error, rate = figures["pointing-fan"].axes
    assert (error.get_yscale(), rate.get_yscale()) == ("log", "log")
    median = np.median(np.degrees(2 * turns), axis=0)
    np.testing.assert_allclose(error.lines[0].get_ydata(), median)
    np.testing.assert_allclose(rate.lines[0].get_ydata(), np.degrees(0.1 * np.sqrt(3)))


def test_the_settling_distribution_ends_at_the_fraction_settled():
    times = np.concatenate([RNG.exponential(size=150), np.full(50, np.inf)])
    fraction, counts = settling_distribution(times, "title").axes
    assert fraction.lines[0].get_ydata()[-1] == 0.75
    assert sum(patch.get_height() for patch in counts.patches) == 150
    (panel,) = settling_distribution(np.full(3, np.inf), "nothing settles").axes
    assert panel.texts[0].get_text() == "none of 3 cases settled"


def test_the_success_map_shows_fractions():
    x, y = RNG.random((2, 4000))
    figure = success_map(x, y, x > 0.5, ("x", "y"), "title")
    shown = figure.axes[0].collections[0].get_array()
    columns = np.nanmean(shown, axis=0)
    assert columns[0] == 0
    assert columns[-1] == 1
    assert len(figure.axes[0].lines) == 0, "too many to be told apart"
    few = success_map(x[:50], y[:50], x[:50] > 0.5, ("x", "y"), "title").axes[0]
    np.testing.assert_array_equal(few.lines[0].get_xdata(), x[:50][x[:50] > 0.5])
    np.testing.assert_array_equal(few.lines[1].get_xdata(), x[:50][x[:50] <= 0.5])


def test_convergence_ends_at_the_wilson_interval():
    settled = RNG.random(500) < 0.9
    (panel,) = convergence(settled, "title").axes
    found = wilson(int(settled.sum()), 500)
    assert np.isclose(panel.lines[0].get_ydata()[-1], found.value)
    edges = panel.collections[0].get_paths()[0].vertices
    last = edges[edges[:, 0] == 500][:, 1]
    np.testing.assert_allclose([last.min(), last.max()], [found.low, found.high])


def test_the_figures_of_a_study():
    times = RNG.exponential(size=50)
    drawn = {
        "omega[1]": DrawnNumber(times, "rad/s", "initial angular velocity"),
        "turn": DrawnNumber(-times, "rad", "initial z"),
    }
    drawings = study_drawings({"settling_time": times}, drawn, "t")
    assert set(drawings) == {"settling", "convergence", "success"}
    panel = drawings["success"]().axes[0]
    assert panel.get_xlabel() == "ω1 (rad/s)\ninitial angular velocity"
    assert panel.get_ylabel() == "turn (rad)\ninitial z"
    assert set(study_drawings({"settling_time": times}, {}, "t")) == {"settling", "convergence"}


def test_a_fan_of_cases_that_cannot_exist_says_so():
    nothing = np.full((3, 11, 2), np.nan)
    figure = fan_chart(np.arange(11.0), nothing, ["w1", "w2"], "title")
    assert [axes.get_title(loc="right") for axes in figure.axes] == ["no case can exist"] * 2
    assert not figure.axes[0].lines


def test_rare_peaks_do_not_hide_the_fan():
    values = RNG.normal(size=(200, 11, 2))
    values[:4, 5, 0] = 1e3
    cut, whole = fan_chart(np.arange(11.0), values, ("a", "b"), "title").axes
    assert cut.get_ylim()[1] < 5
    assert cut.get_title(loc="right") == "rare peaks are cut off"
    assert whole.get_title(loc="right") == ""
