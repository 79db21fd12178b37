"""Figures of the pointing error and of all other signals of a trajectory."""

import textwrap

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter

from jaxsat.core.pointing import euler_angles, pointing_error
from jaxsat.report.style import FURTHER_LINES, LINES, escape_mathematics, panels
from jaxsat.report.time_axes import (
    draw_lines,
    figure_title,
    finish,
    place_legend,
    shade_modes,
)
from jaxsat.store.labels import PARTS, part_names

OWN_FIGURES = frozenset(
    (
        *("w", "z", "quaternion", "omega", "relative_rate", "rate_error", "lyapunov", "mode"),
        *("torque", "torque_min", "torque_max", "torque_mean", "constraint_torque", "disturbance"),
        *("pointing_error", "pointing_error_total", "euler_angle"),
    )
)
"""The signals that every trajectory has, or that have a figure made for them."""

STRIP_PARTS = 300
"""Into how many parts the time of a strip is divided."""

BOUND = "_3sigma"
"""Ending of a signal that bounds an error, in place of "_error": three standard deviations."""

UNITS = {"1": "–", "degree": "°", "rad s-1": "rad/s", "A m2": "A m²"}
"""How units are shown that do not read as they are."""


def pointing_figure(dataset: xr.Dataset, *, title: str = "") -> Figure:
    """The pointing error in degrees, total and about each body axis, and the Euler angles 3-2-1."""
    heading = figure_title(dataset, "pointing error to the orbit frame", title)
    figure, (total, axes, euler) = panels(3, heading, 1.9)
    time, quaternion = dataset["time"].values, dataset["quaternion"].values
    error = pointing_error(quaternion)
    size = np.linalg.norm(error, axis=1)
    total.semilogy(time, np.where(size > 0, size, np.nan), **LINES[0])
    total.yaxis.set_major_formatter(LogFormatter())
    total.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(1.5, 0.5)))
    total.set_ylabel("total error (°)")
    draw_lines(axes, time, _broken_at_wraps(error), ("about x", "about y", "about z"))
    axes.set_ylabel("error about\nbody axes (°)")
    draw_lines(euler, time, _broken_at_wraps(euler_angles(quaternion)), ("roll", "pitch", "yaw"))
    euler.set_ylabel("Euler angles\n3-2-1 (°)")
    shade_modes(dataset, total)
    finish(dataset, [total, axes, euler])
    figure.align_ylabels([total, axes, euler])
    return figure


def further_signals(dataset: xr.Dataset) -> list[str]:
    """The signals over time that have no figure made for them, such as an estimator's error."""
    return [
        str(name)
        for name, variable in dataset.data_vars.items()
        if variable.dims[:1] == ("time",)
        and variable.ndim <= 2
        and name not in OWN_FIGURES
        and not str(name).endswith(BOUND)
    ]


def signals_figure(dataset: xr.Dataset, *, title: str = "") -> Figure:
    """A panel for each of the `further_signals`, told by its long name and unit.

    Beside a variable "…_error" the one "…_3sigma" is drawn as a bound on either side of zero.
    One of more components than lines can be told apart is drawn as a strip for each.
    """
    names = further_signals(dataset)
    figure, axes = panels(len(names), figure_title(dataset, "further signals", title), 1.9)
    styles = (*LINES, *FURTHER_LINES)
    for panel, name in zip(axes, names, strict=True):
        variable = dataset[name]
        if variable.ndim == 2 and variable.shape[1] > len(styles):
            _draw_strips(figure, panel, dataset, variable)
            continue
        values = variable.values.reshape(len(dataset["time"]), -1)
        labels = [name] if variable.ndim == 1 else _labels(dataset, variable)
        for column, label in enumerate(labels):
            style = styles[column % len(styles)]
            panel.plot(dataset["time"], values[:, column], label=escape_mathematics(label), **style)
        bound = name.removesuffix("_error") + BOUND
        if bound in dataset:
            _draw_bounds(panel, dataset, bound)
        place_legend(panel, min(8, values.shape[1] + 1))
        unit = str(variable.attrs.get("units", "1"))
        unit = UNITS.get(unit, unit)
        meaning = escape_mathematics(str(variable.attrs.get("long_name", name)))
        panel.set_ylabel(f"{textwrap.fill(meaning, 22, max_lines=3)}\n({unit})", fontsize=8)
    finish(dataset, axes)
    return figure


def _labels(dataset: xr.Dataset, variable: xr.DataArray) -> list[str]:
    """What each column is of: a coordinate, or the name of a part of the spacecraft."""
    component = str(variable.dims[1])
    if component in PARTS:
        return part_names(dataset.attrs.get("scenario", ""), component, variable.shape[1])
    return [str(one) for one in variable[component].values]


def _draw_strips(figure: Figure, panel: Axes, dataset: xr.Dataset, variable: xr.DataArray) -> None:
    """A strip in shades of grey for each component over time, and what the shades mean.

    Each shade is of the largest value of a time that is wide enough to be seen.
    """
    component, time = variable.dims[1], variable["time"].values
    begins = np.unique(np.linspace(0, len(time) - 1, STRIP_PARTS, dtype=int)[:-1])
    drawn = panel.pcolormesh(
        np.append(time[begins], time[-1]),
        np.arange(variable.shape[1] + 1) + 0.5,
        np.maximum.reduceat(variable.values, begins).T,
        cmap="Greys",
        rasterized=True,
    )
    names = _labels(dataset, variable)
    panel.set_yticks(np.arange(1, len(names) + 1), names, fontsize=7)
    panel.set_ylabel(str(component))
    panel.grid(visible=False)
    bar = figure.colorbar(drawn, ax=panel, pad=0.01, aspect=12)
    meaning = escape_mathematics(str(variable.attrs.get("long_name", variable.name)))
    bar.set_label(textwrap.fill(meaning, 20), fontsize=7)
    bar.ax.tick_params(labelsize=7)


def _draw_bounds(panel: Axes, dataset: xr.Dataset, name: str) -> None:
    """Both signs of a bound, a thin line for each component.

    What is larger in the first fiftieth of the time, before an estimator has settled, is cut off.
    """
    bounds = dataset[name].values.reshape(len(dataset["time"]), -1)
    begin = len(bounds) // 50
    drawn = [np.asarray(line.get_ydata(), float)[begin:] for line in panel.lines]
    largest = np.nanmax(np.abs(np.concatenate([*drawn, bounds[begin:].ravel()])), initial=0.0)
    if largest > 0:
        panel.set_ylim(-1.1 * largest, 1.1 * largest)
    for column, bound in enumerate(bounds.T):
        color = LINES[column % len(LINES)]["color"]
        for sign in (1, -1):
            label = "±3σ" if column == 0 and sign == 1 else None
            panel.plot(dataset["time"], sign * bound, ":", color=color, linewidth=0.8, label=label)


def _broken_at_wraps(angles: np.ndarray) -> np.ndarray:
    """Angles (times, n) in degrees that a line through them does not join where they jump."""
    jumps = np.abs(np.diff(angles, axis=0, prepend=angles[:1])) > 180
    return np.where(jumps, np.nan, angles)
