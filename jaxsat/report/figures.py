"""Figures of a run: a trajectory dataset in, a matplotlib `Figure` out.

The datasets are those of `jaxsat.store.dataset`. No figure is shown or saved here.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import cast

import numpy as np
from matplotlib.figure import Figure

from jaxsat.report.facts import scenario_tables
from jaxsat.report.failure_figure import failure_figure, shows_failure
from jaxsat.report.figure_painter import paint
from jaxsat.report.plot import TIME, Axis, Line, Plot
from jaxsat.report.run_plots import (
    Span,
    attitude_plots,
    enlarged,
    further_signals,
    has_effectors,
    pointing_plots,
    signal_plots,
    torque_axes,
    torque_lines,
    torque_plots,
)
from jaxsat.report.shares import share_plots
from jaxsat.report.timeline import mode_names, subject_title, timeline_of
from jaxsat.store.labelled import Dataset

PEAK = 20.0
"""Peak over the usual size of a signal beyond which its axis becomes logarithmic."""


def trajectory_drawings(dataset: Dataset) -> dict[str, Callable[[], Figure]]:
    """Return functions that draw one run, by file name, as far as its law has data for them."""
    drawings: dict[str, Callable[[], Figure]] = {
        "attitude": lambda: attitude_figure(dataset),
        "pointing": lambda: pointing_figure(dataset),
        "rates": lambda: rates_figure(dataset, linear_to=_usual_size(dataset["omega"].values)),
        "torque": lambda: torque_figure(dataset, linear_to=_usual_size(dataset["torque"].values)),
    }
    if np.nan_to_num(dataset["lyapunov"].values).any():
        drawings["lyapunov"] = lambda: lyapunov_figure(dataset)
    if mode_names(dataset) and torque_axes(dataset) == 2:
        drawings["steering"] = lambda: steering_figure(dataset)
    if shares := share_plots(dataset):
        title = "torque by kind of actuator"
        drawings["shares"] = lambda: _figure(dataset, shares, title, height=2.2)
    if shows_failure(dataset):
        drawings["failure"] = lambda: cast(Figure, failure_figure(dataset))
    signals = [plot for name in further_signals(dataset) for plot in signal_plots(dataset, name)]
    if signals:
        drawings["signals"] = lambda: _figure(dataset, signals, "further signals", height=1.4)
    return drawings


def _figure(
    dataset: Dataset,
    plots: Sequence[Plot],
    subject: str,
    title: str = "",
    height: float = 1.6,
    *,
    shaded: bool = True,
) -> Figure:
    """Paint panels under the given title, or that of the run and a subject."""
    title, timeline = title or subject_title(dataset, subject), timeline_of(dataset)
    if not shaded:
        timeline = dataclasses.replace(timeline, shades={})
    return paint(plots, title, height, timeline)


def attitude_figure(dataset: Dataset, *, title: str = "") -> Figure:
    """Plot the tilt w, and the turn z with the whole angle between body and orbit frame."""
    return _figure(dataset, attitude_plots(dataset), "attitude to the orbit frame", title)


def pointing_figure(dataset: Dataset, *, title: str = "") -> Figure:
    """Plot the pointing error in degrees, total and about each axis, and Euler angles 3-2-1."""
    return _figure(dataset, pointing_plots(dataset), "pointing error to the orbit frame", title)


def rates_figure(
    dataset: Dataset,
    *,
    zoom: Span | None = None,
    linear_to: float | None = None,
    title: str = "",
) -> Figure:
    """Plot angular velocity, whole and enlarged over `zoom` (s; by default the last fifth).

    With `linear_to` (rad/s) the upper axis is logarithmic beyond that rate.
    """
    (whole,) = signal_plots(dataset, "omega")
    plots = [_compress(whole, linear_to), enlarged(whole, zoom or _last_fifth(dataset))]
    return _figure(dataset, plots, "angular velocity", title)


def torque_figure(
    dataset: Dataset,
    *,
    zoom: Span | None = None,
    linear_to: float | None = None,
    title: str = "",
) -> Figure:
    """Plot the actuators' torque, whole and enlarged over `zoom` (s; by default the last fifth).

    Where the third rate is held, the ideal torque that holds it has its own panel. With `linear_to`
    (N m) the upper axis is logarithmic beyond that torque, for runs whose first instant dwarfs the
    rest.
    """
    together = Plot("Torque T", "", TIME, Axis("Torque T", "N m"), torque_lines(dataset))
    plots = [
        *(_compress(plot, linear_to) for plot in torque_plots(dataset)),
        *signal_plots(dataset, "constraint_torque"),
        enlarged(together, zoom or _last_fifth(dataset)),
    ]
    subject = "torque of all actuators" if has_effectors(dataset) else "thruster torque"
    return _figure(dataset, plots, subject, title, shaded="torque_max" not in dataset)


def steering_figure(dataset: Dataset, *, title: str = "") -> Figure:
    """Plot how two torques steer the third rate: ω1 and ω2, their product, and the resulting ω3.

    The second line of ω3 is the effect of the gyroscopic torque alone, (J1 - J2)/J3 ∫ω1 ω2 dt.
    """
    time, (first, second, third) = dataset["time"].values, dataset["omega"].values.T
    product = first * second
    steps = np.diff(time) * (product[1:] + product[:-1]) / 2
    gyroscopic_rate = third[0] + _gyroscopic_ratio(dataset) * np.concatenate(
        [[0], np.cumsum(steps)]
    )
    driven = [Line(time, first, "ω1"), Line(time, second, "ω2")]
    results = [Line(time, third, "ω3"), Line(time, gyroscopic_rate, "made by ω1 ω2")]
    rate, small = Axis("Rate", "rad/s", linear_to=1e-3), Axis("ω3", "rad/s", linear_to=1e-5)
    area = Axis("ω1 ω2", "rad²/s²", linear_to=1e-5)
    plots = [
        Plot("Driven rates", "", TIME, rate, driven),
        Plot("Their product", "", TIME, area, [Line(time, product)]),
        Plot("Third rate", "", TIME, small, results),
    ]
    return _figure(dataset, plots, "steering ω3", title)


def lyapunov_figure(dataset: Dataset, *, title: str = "") -> Figure:
    """Plot the Lyapunov function of the law's proof on a logarithmic axis."""
    return _figure(dataset, signal_plots(dataset, "lyapunov"), "Lyapunov function", title, 2.2)


def comparison_figure(datasets: Sequence[Dataset], labels: Sequence[str], *, title: str) -> Figure:
    """Plot several runs together: size of w, angle z and size of the relative rate."""

    def lines(name: str) -> list[Line]:
        values = (one[name].values.reshape(one.sizes["time"], -1) for one in datasets)
        signals = (one[:, 0] if name == "z" else np.linalg.norm(one, axis=1) for one in values)
        times = (one["time"].values for one in datasets)
        return [Line(*line) for line in zip(times, signals, labels, strict=True)]

    plots = [
        Plot("Tilt", "", TIME, Axis("|w|", "1", log=True), lines("w")),
        Plot("Turn", "", TIME, Axis("z", "rad"), lines("z")),
        Plot("Rate", "", TIME, Axis("|ω_r|", "rad/s", log=True), lines("relative_rate")),
    ]
    return _figure(datasets[0], plots, "", title)


def _compress(plot: Plot, linear_to: float | None) -> Plot:
    return dataclasses.replace(plot, y=dataclasses.replace(plot.y, linear_to=linear_to))


def _last_fifth(dataset: Dataset) -> Span:
    start, end = map(float, dataset["time"].values[[0, -1]])
    return (end - (end - start) / 5, end)


def _gyroscopic_ratio(dataset: Dataset) -> float:
    """Return (J1 - J2)/J3 of (37), from the dataset's scenario."""
    inertia = np.array(scenario_tables(dataset)["spacecraft"]["inertia_kg_m2"])
    j1, j2, j3 = inertia if inertia.ndim == 1 else np.diag(inertia)
    return float((j1 - j2) / j3)


def _usual_size(signal: np.ndarray) -> float | None:
    """Return the usual size of a signal if its peaks exceed it by far, else None."""
    size = np.abs(signal)
    size = size[np.isfinite(size).all(axis=1)].max(axis=1)
    usual = float(np.percentile(size, 95)) if len(size) else 0.0
    if usual == 0 or size.max() <= PEAK * usual:
        return None
    return 10.0 ** np.ceil(np.log10(usual))  # on a tick
