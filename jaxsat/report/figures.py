"""One function per figure: a trajectory dataset in, a matplotlib `Figure` out.

The datasets are those of `jaxsat.store.dataset`. No figure is shown or saved here.
"""

import tomllib
from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxsat.core.pointing import pointing_error
from jaxsat.report.failure_figure import failure_figure
from jaxsat.report.signal_figures import further_signals, pointing_figure, signals_figure
from jaxsat.report.style import LINES, escape_mathematics, panels
from jaxsat.report.time_axes import (
    Span,
    draw_lines,
    figure_title,
    finish,
    mode_names,
    place_legend,
    shade_modes,
)

PEAK = 20.0
"""How many times its usual size a signal may reach before its axis becomes logarithmic there."""


def trajectory_figures(dataset: xr.Dataset) -> dict[str, Figure]:
    """The figures of one run by file name, those that its law gives something to show in."""
    figures = {
        "attitude": attitude_figure(dataset),
        "pointing": pointing_figure(dataset),
        "rates": rates_figure(dataset, linear_to=_usual_size(dataset["omega"])),
        "torque": torque_figure(dataset, linear_to=_usual_size(dataset["torque"])),
    }
    if np.isfinite(dataset["lyapunov"]).any():
        figures["lyapunov"] = lyapunov_figure(dataset)
    if mode_names(dataset):
        figures["steering"] = steering_figure(dataset)
    story = failure_figure(dataset)
    if story is not None:
        figures["failure"] = story
    if further_signals(dataset):
        figures["signals"] = signals_figure(dataset)
    return figures


def rates_figure(
    dataset: xr.Dataset,
    *,
    zoom: Span | None = None,
    linear_to: float | None = None,
    title: str = "",
) -> Figure:
    """Angular velocity, whole and enlarged over `zoom` (s; by default the last fifth).

    With `linear_to` (rad/s) the upper axis is logarithmic beyond that rate.
    """
    figure, (whole, enlarged) = panels(2, figure_title(dataset, "angular velocity", title))
    zoom = _last_fifth(dataset) if zoom is None else zoom
    labels = ("ω1", "ω2", "ω3")
    draw_lines(whole, dataset["time"], dataset["omega"], labels)
    part = dataset.sel(time=slice(*zoom))
    draw_lines(enlarged, part["time"], part["omega"], labels, legend=False)
    if linear_to is not None:
        whole.set_yscale("symlog", linthresh=linear_to)
    whole.set_ylabel("angular velocity ω\n(rad/s)")
    enlarged.set_ylabel("enlarged\n(rad/s)")
    shade_modes(dataset, whole)
    finish(dataset, [whole], enlarged, zoom)
    return figure


def attitude_figure(dataset: xr.Dataset, *, title: str = "") -> Figure:
    """The tilt w, and the turn z with the whole angle between body and orbit frame."""
    figure, (tilt, turn) = panels(2, figure_title(dataset, "attitude to the orbit frame", title))
    draw_lines(tilt, dataset["time"], dataset["w"], ("w1", "w2"))
    tilt.set_ylabel("tilt w (–)")
    total = np.linalg.norm(pointing_error(dataset["quaternion"].values), axis=1)
    angles = np.stack([np.degrees(dataset["z"].values), total], axis=1)
    draw_lines(turn, dataset["time"], angles, ("z", "whole rotation"))
    turn.set_ylabel("rotation angle (°)")
    shade_modes(dataset, tilt)
    finish(dataset, [tilt, turn])
    return figure


def torque_figure(
    dataset: xr.Dataset,
    *,
    zoom: Span | None = None,
    linear_to: float | None = None,
    title: str = "",
) -> Figure:
    """Torque of the actuators, whole and enlarged over `zoom` (s; by default the last fifth).

    Where the third rate is held the ideal torque that holds it has a panel of its own. With
    `linear_to` (N m) the upper axis is logarithmic beyond that torque, for runs whose first instant
    dwarfs the rest.
    """
    names = [f"T{axis + 1}" for axis in range(_working_axes(dataset))]
    ranged = "torque_max" in dataset
    held = "constraint_torque" in dataset
    count = (len(names) if ranged else 1) + held + 1
    others = {"wheel_torque", "dipole", "gimbal_rate"} & set(dataset.data_vars)
    heading = figure_title(
        dataset, "torque of all actuators" if others else "thruster torque", title
    )
    figure, axes = panels(count, heading, 2.1 if count == 2 else 1.9)
    *above, enlarged = axes
    if ranged:
        for column, (panel, name) in enumerate(zip(above, names, strict=False)):
            _torque_range(dataset, panel, column)
            panel.set_ylabel(f"torque {name} (N m)")
        place_legend(above[0], 2)
    else:
        draw_lines(above[0], dataset["time"], dataset["torque"], names)
        above[0].set_ylabel("torque T (N m)")
    if linear_to is not None:
        for panel in above[: len(names) if ranged else 1]:
            panel.set_yscale("symlog", linthresh=linear_to)
    if held:
        above[-1].plot(dataset["time"], dataset["constraint_torque"], **LINES[2], label="axis 3")
        above[-1].set_ylabel("torque that holds\nω3 (N m)")
    zoom = _last_fifth(dataset) if zoom is None else zoom
    part = dataset.sel(time=slice(*zoom))
    shown = part["torque_mean" if ranged else "torque"]
    draw_lines(enlarged, part["time"], shown, names, legend=ranged)
    if ranged:
        for column, style in enumerate(LINES[: len(names)]):
            low, high = (part[name][:, column] for name in ("torque_min", "torque_max"))
            enlarged.fill_between(
                part["time"], low, high, step="post", color=style["color"], alpha=0.2, linewidth=0
            )
    enlarged.set_ylabel(f"enlarged{', mean' if ranged else ''}\n(N m)")
    finish(dataset, above, enlarged, zoom)
    figure.align_ylabels(axes)
    return figure


def _working_axes(dataset: xr.Dataset) -> int:
    """Three where the thrusters turn about the third axis, else two."""
    told = ("torque", "torque_min", "torque_max")
    return (
        3 if any((np.abs(dataset[name][:, 2]) > 0).any() for name in told if name in dataset) else 2
    )


def _torque_range(dataset: xr.Dataset, panel: Axes, column: int) -> None:
    """What the torque about an axis was from each saved time to the next, and its mean."""
    time = dataset["time"].values
    low, high, mean = (
        dataset[name].values[:, column] for name in ("torque_min", "torque_max", "torque_mean")
    )
    panel.fill_between(
        time,
        low,
        high,
        step="post",
        color="#bbbbbb",
        linewidth=0.4,
        label="least to largest between saved times",
    )
    panel.plot(time, mean, drawstyle="steps-post", label="mean", **LINES[0])


def steering_figure(dataset: xr.Dataset, *, title: str = "") -> Figure:
    """How two torques steer the third rate: ω1 and ω2, their product, and ω3 that it makes.

    The dashed line is ω3 as the gyroscopic torque alone would make it, (J1 - J2)/J3 ∫ω1 ω2 dt.
    """
    figure, (driven, product, third) = panels(
        3, figure_title(dataset, "steering ω3", title), height=1.9
    )
    time, omega = dataset["time"].values, dataset["omega"].values
    draw_lines(driven, time, omega[:, :2], ("ω1", "ω2"))
    shade_modes(dataset, driven)
    products = omega[:, 0] * omega[:, 1]
    for axes in (driven, product, third):
        axes.set_yscale("symlog", linthresh=1e-3 if axes is driven else 1e-5)
    product.plot(time, products, **LINES[0])
    steps = np.diff(time) * (products[1:] + products[:-1]) / 2
    made = omega[0, 2] + _gyroscopic_ratio(dataset) * np.concatenate([[0], np.cumsum(steps)])
    draw_lines(third, time, np.stack([omega[:, 2], made], 1), ("ω3", "made by ω1 ω2"))
    driven.set_ylabel("rate (rad/s)")
    product.set_ylabel("ω1 ω2 (rad²/s²)")
    third.set_ylabel("ω3 (rad/s)")
    finish(dataset, [driven, product, third])
    return figure


def lyapunov_figure(dataset: xr.Dataset, *, title: str = "") -> Figure:
    """The Lyapunov function of the law's proof on a logarithmic axis."""
    figure, (axes,) = panels(1, figure_title(dataset, "Lyapunov function", title), height=2.6)
    value = np.where(dataset["lyapunov"] > 0, dataset["lyapunov"], np.nan)
    axes.semilogy(dataset["time"], value, **LINES[0])
    axes.set_ylabel("Lyapunov function V (J)")
    finish(dataset, [axes])
    return figure


def comparison_figure(
    datasets: Sequence[xr.Dataset], labels: Sequence[str], *, title: str
) -> Figure:
    """Up to three runs over each other: size of w, angle z and size of the relative rate."""
    figure, (tilt, turn, rate) = panels(3, title, height=1.9)
    for dataset, label, style in zip(datasets, labels, LINES, strict=False):
        time = dataset["time"]
        tilt.semilogy(
            time, np.linalg.norm(dataset["w"], axis=1), label=escape_mathematics(label), **style
        )
        turn.plot(time, dataset["z"], **style)
        rate.semilogy(time, np.linalg.norm(dataset["relative_rate"], axis=1), **style)
    tilt.set_ylabel("|w| (–)")
    turn.set_ylabel("z (rad)")
    rate.set_ylabel("|ω_r| (rad/s)")
    place_legend(tilt, len(labels))
    finish(datasets[0], [tilt, turn, rate])
    return figure


def _last_fifth(dataset: xr.Dataset) -> Span:
    start, end = float(dataset["time"][0]), float(dataset["time"][-1])
    return (end - (end - start) / 5, end)


def _gyroscopic_ratio(dataset: xr.Dataset) -> float:
    """(J1 - J2)/J3 of (37), from the scenario that the dataset carries."""
    inertia = np.array(tomllib.loads(dataset.attrs["scenario"])["spacecraft"]["inertia_kg_m2"])
    j1, j2, j3 = inertia if inertia.ndim == 1 else np.diag(inertia)
    return float((j1 - j2) / j3)


def _usual_size(signal: xr.DataArray) -> float | None:
    """What a signal seldom exceeds, if it exceeds that by far: its peaks would hide the rest."""
    size = np.abs(signal.values)
    size = size[np.isfinite(size).all(axis=1)].max(axis=1)
    usual = float(np.percentile(size, 95)) if len(size) else 0.0
    if usual == 0 or size.max() <= PEAK * usual:
        return None
    return 10.0 ** np.ceil(np.log10(usual))  # on a tick
