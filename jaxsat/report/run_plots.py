"""Plots of a run: titles, labels and form of each signal."""

import dataclasses

import numpy as np

from jaxsat.core.declaration.actuators import ACTUATORS, SIGNALS
from jaxsat.core.declaration.units import shown_unit
from jaxsat.core.text import capitalised
from jaxsat.report.plot import TIME, Axis, Band, Line, Plot, Strips
from jaxsat.report.style import MOST_LINES
from jaxsat.report.timeline import mode_names
from jaxsat.store.labelled import Dataset

Span = tuple[float, float]

TITLES = {
    "pointing_error_total": "Total pointing error",
    "pointing_error": "Pointing error about body axes",
    "euler_angle": "Euler angles 3-2-1",
    "omega": "Angular velocity ω",
    "relative_rate": "Rate relative to the orbit frame",
    "rate_error": "Rate minus its reference",
    "torque": "Torque T",
    "torque_unmade": "Unmet torque",
    "constraint_torque": "Ideal torque that holds the third rate",
    "disturbance": "Disturbance torque",
    "lyapunov": "Lyapunov function V",
    "mode": "Phase of the control law",
}
"""Titles of signals; others have their long name."""

OWN = frozenset(
    {
        *TITLES.keys() - {"torque_unmade"},
        "w",
        "z",
        "quaternion",
        "torque_min",
        "torque_max",
        "torque_mean",
    }
)
"""Signals that every trajectory has, or that have their own figure."""

SYMBOLS = {"omega": "ω", "torque": "T"}
"""Symbols of vectors whose components are numbered; others have the dataset's labels."""

LOGARITHMIC = frozenset({"pointing_error_total", "lyapunov"})
STEPS = frozenset(
    {"mode", *(name for name, one in SIGNALS.items() if one.total and one.units == "1")}
)
MUTE = frozenset(
    {
        "constraint_torque",
        "disturbance",
        "rate_error",
        "lyapunov",
        "torque_unmade",
        *(name for name, one in SIGNALS.items() if one.mute),
    }
)
"""Signals that are not plotted where they are zero or unknown throughout."""

WRAPPED = frozenset({"pointing_error", "euler_angle"})
"""Angles in degrees that jump by a whole turn."""

BOUND = "_3sigma"
"""Suffix of a signal that bounds an error, in place of "_error": three standard deviations."""


def has_effectors(dataset: Dataset) -> bool:
    """Whether other actuators than thrusters make torques."""
    names = {signal.name for actuator in ACTUATORS if actuator.maker for signal in actuator.signals}
    return not names.isdisjoint(dataset.data_vars)


def part_labels(dataset: Dataset, name: str) -> list[str]:
    """Return the label of each column of a signal; "" for a scalar."""
    axes = dataset[name].dims
    if len(axes) == 1:
        return [""]
    axis = str(axes[1])
    columns = dataset[axis].values if axis in dataset else range(dataset.sizes[axis])
    return [str(one) for one in columns]


def further_signals(dataset: Dataset) -> list[str]:
    """Return the signals over time without their own figure, such as an estimator's error."""
    return [
        str(name)
        for name, variable in dataset.data_vars.items()
        if variable.dims[:1] == ("time",)
        and len(variable.dims) <= 2
        and name not in OWN
        and not str(name).endswith(BOUND)
    ]


def signal_plots(dataset: Dataset, name: str) -> list[Plot]:
    """Return the plot of one signal; empty where it is missing or uninformative.

    A signal "…_3sigma" is drawn as a band about zero of the signal "…_error". More components than
    distinguishable lines are drawn as strips.
    """
    if name not in dataset:
        return []
    variable, time = dataset[name], dataset["time"].values
    values = variable.values.reshape(len(time), -1).astype(float)
    names = mode_names(dataset) if name == "mode" else {}
    if (name in MUTE and not np.nan_to_num(values).any()) or (name == "mode" and len(names) < 2):
        return []
    title = TITLES.get(name) or capitalised(str(variable.attrs.get("long_name", name)))
    unit = shown_unit(str(variable.attrs.get("units", "1"))) or "1"
    parts = part_labels(dataset, name)
    if len(parts) > MOST_LINES:
        return [Plot(title, "", TIME, Axis(title, unit), strips=Strips(time, values, parts))]
    if name in WRAPPED:
        values = _break_at_wraps(values)
    bound, bands, limits = name.removesuffix("_error") + BOUND, [None] * len(parts), (None, None)
    if bound in dataset:
        sizes = dataset[bound].values.reshape(values.shape)
        bands = [Band(-size, size, "±3σ") for size in sizes.T]
        limits = _limits_once_settled(values, sizes)
    labels = [_label(name, number, part) for number, part in enumerate(parts, 1)]
    lines = [
        Line(time, column, label, steps=name in STEPS, band=band)
        for column, label, band in zip(values.T, labels, bands, strict=True)
    ]
    axis = Axis(title, unit, log=name in LOGARITHMIC, limits=limits, names=names)
    return [Plot(title, "", TIME, axis, lines)]


def attitude_plots(dataset: Dataset) -> list[Plot]:
    """Plot the tilt w, and the turn z with the whole angle between body and orbit frame."""
    time, tilt = dataset["time"].values, dataset["w"].values
    turn = np.degrees(dataset["z"].values)
    whole = dataset["pointing_error_total"].values
    tilts = [Line(time, column, f"w{number}") for number, column in enumerate(tilt.T, 1)]
    turns = [Line(time, turn, "z"), Line(time, whole, "whole rotation")]
    return [
        Plot("Tilt w", "", TIME, Axis("Tilt w", "1"), tilts),
        Plot("Turn z, and the whole rotation", "", TIME, Axis("Rotation angle", "°"), turns),
    ]


def pointing_plots(dataset: Dataset) -> list[Plot]:
    """Plot the pointing error, total and about each body axis, and the Euler angles 3-2-1."""
    names = ("pointing_error_total", "pointing_error", "euler_angle")
    return [plot for name in names for plot in signal_plots(dataset, name)]


def torque_plots(dataset: Dataset) -> list[Plot]:
    """Plot the torque; where it changes between saved times, mean and range for each axis."""
    if "torque_max" not in dataset:
        plots = signal_plots(dataset, "torque")
        return [dataclasses.replace(one, lines=one.lines[: torque_axes(dataset)]) for one in plots]
    title = "Torque {}: mean and range until the next saved time"
    return [
        Plot(title.format(line.label), "", TIME, Axis(f"Torque {line.label}", "N m"), [mean_line])
        for line in torque_lines(dataset)
        if (mean_line := dataclasses.replace(line, label="mean"))
    ]


def torque_lines(dataset: Dataset) -> list[Line]:
    """Return the mean torque about each axis, with any range between saved times."""
    time = dataset["time"].values
    if "torque_max" not in dataset:
        return [line for plot in torque_plots(dataset) for line in plot.lines]
    low, high, mean = (dataset[f"torque_{part}"].values.T for part in ("min", "max", "mean"))
    return [
        Line(time, mean[axis], f"T{axis + 1}", True, band=Band(low[axis], high[axis], "range"))
        for axis in range(torque_axes(dataset))
    ]


def enlarged(plot: Plot, span: Span) -> Plot:
    """Return the part of a plot over a span (s), with its own linear axis."""
    begin, end = np.searchsorted(plot.lines[0].x, span)
    part = slice(max(begin - 1, 0), end + 1)
    lines = []
    for line in plot.lines:
        band = line.band and dataclasses.replace(
            line.band, low=line.band.low[part], high=line.band.high[part]
        )
        lines.append(dataclasses.replace(line, x=line.x[part], y=line.y[part], band=band))
    axis = Axis("enlarged", plot.y.unit)
    return Plot(f"{plot.title}, enlarged", "", Axis("time", "s", limits=span), axis, lines)


def torque_axes(dataset: Dataset) -> int:
    """Return the number of axes with torque: three if any acts about the third axis, else two."""
    names = {"torque", "torque_min", "torque_max"} & set(dataset.data_vars)
    return 3 if any((np.abs(dataset[name].values[:, 2]) > 0).any() for name in names) else 2


def _label(name: str, number: int, part: str) -> str:
    """Return the label of a line; "" for the only one."""
    if name in SYMBOLS:
        return f"{SYMBOLS[name]}{number}"
    if name == "pointing_error":
        return f"about {part}"
    return part


def _limits_once_settled(
    values: np.ndarray, bounds: np.ndarray
) -> tuple[float | None, float | None]:
    """Return limits around errors and bounds (times, n), without the first fiftieth of the time, in
    which an estimator settles."""
    begin = len(values) // 50
    late = np.concatenate([values[begin:].ravel(), bounds[begin:].ravel()])
    largest = 1.1 * float(np.nanmax(np.abs(late), initial=0.0))
    return (-largest, largest) if largest > 0 else (None, None)


def _break_at_wraps(angles: np.ndarray) -> np.ndarray:
    """Break angles (times, n) in degrees where they jump, so that no line joins them."""
    jumps = np.abs(np.diff(angles, axis=0, prepend=angles[:1])) > 180
    return np.where(jumps, np.nan, angles)
