"""One function a figure: a trajectory dataset in, a matplotlib `Figure` out.

The datasets are those of `jaxsat.results.dataset`. No figure is shown or saved here.
"""

import tomllib
from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxsat.report.style import LINES, escape_mathematics, panels

Span = tuple[float, float]


def trajectory_figures(dataset: xr.Dataset) -> dict[str, Figure]:
    """The figures of one run by file name, those that its law gives something to show in."""
    figures = {
        "attitude": attitude_figure(dataset),
        "rates": rates_figure(dataset),
        "torque": torque_figure(dataset),
    }
    if np.isfinite(dataset["lyapunov"]).any():
        figures["lyapunov"] = lyapunov_figure(dataset)
    if _mode_names(dataset):
        figures["steering"] = steering_figure(dataset)
    return figures


def rates_figure(dataset: xr.Dataset, *, zoom: Span | None = None, title: str = "") -> Figure:
    """Angular velocity, whole and enlarged over `zoom` (s; by default the last fifth)."""
    figure, (whole, enlarged) = panels(2, _title(dataset, "angular velocity", title))
    zoom = _last_fifth(dataset) if zoom is None else zoom
    labels = ("ω1", "ω2", "ω3")
    _lines(whole, dataset["time"], dataset["omega"], labels)
    part = dataset.sel(time=slice(*zoom))
    _lines(enlarged, part["time"], part["omega"], labels, legend=False)
    whole.set_ylabel("rate (rad/s)")
    enlarged.set_ylabel("enlarged (rad/s)")
    _shade_modes(dataset, whole)
    _finish(dataset, [whole], enlarged, zoom)
    return figure


def attitude_figure(dataset: xr.Dataset, *, title: str = "") -> Figure:
    """The tilt w, and the turn z with the whole angle between body and orbit frame."""
    figure, (tilt, turn) = panels(2, _title(dataset, "attitude to the orbit frame", title))
    _lines(tilt, dataset["time"], dataset["w"], ("w1", "w2"))
    tilt.set_ylabel("tilt (–)")
    angles = np.stack([np.degrees(dataset["z"].values), _angle_degrees(dataset)], axis=1)
    _lines(turn, dataset["time"], angles, ("z", "rotation angle"))
    turn.set_ylabel("angle (°)")
    _shade_modes(dataset, tilt)
    _finish(dataset, [tilt, turn])
    return figure


def torque_figure(
    dataset: xr.Dataset,
    *,
    zoom: Span | None = None,
    linear_to: float | None = None,
    title: str = "",
) -> Figure:
    """Thruster torque, whole and enlarged over `zoom` (s; by default the last fifth).

    Where the third rate is held the ideal torque that holds it has a panel of its own. With
    `linear_to` (N m) the upper axis is logarithmic beyond that torque, for runs whose first instant
    dwarfs the rest.
    """
    held = "constraint_torque" in dataset
    heading = _title(dataset, "thruster torque", title)
    figure, (whole, *above, enlarged) = panels(3 if held else 2, heading, 1.9 if held else 2.1)
    for axes in above:
        axes.plot(dataset["time"], dataset["constraint_torque"], **LINES[2], label="about axis 3")
        axes.set_ylabel("held by (N m)")
        _legend(axes, 1)
    zoom = _last_fifth(dataset) if zoom is None else zoom
    torque = dataset["torque"]
    third_axis_works = bool((np.abs(torque[:, 2]) > 0).any())
    labels = ("T1", "T2", "T3")[: 3 if third_axis_works else 2]
    _lines(whole, dataset["time"], torque[:, : len(labels)], labels)
    part = dataset.sel(time=slice(*zoom))
    _lines(enlarged, part["time"], part["torque"][:, : len(labels)], labels, legend=False)
    if linear_to is not None:
        whole.set_yscale("symlog", linthresh=linear_to)
    whole.set_ylabel("torque (N m)")
    enlarged.set_ylabel("enlarged (N m)")
    _finish(dataset, [whole, *above], enlarged, zoom)
    return figure


def steering_figure(dataset: xr.Dataset, *, title: str = "") -> Figure:
    """How two torques steer the third rate: ω1 and ω2, their product, and ω3 that it makes.

    The dashed line is ω3 as the gyroscopic torque alone would make it, (J1 - J2)/J3 ∫ω1 ω2 dt.
    """
    figure, (driven, product, third) = panels(3, _title(dataset, "steering ω3", title), height=1.9)
    time, omega = dataset["time"].values, dataset["omega"].values
    _lines(driven, time, omega[:, :2], ("ω1", "ω2"))
    _shade_modes(dataset, driven)
    products = omega[:, 0] * omega[:, 1]
    for axes in (driven, product, third):
        axes.set_yscale("symlog", linthresh=1e-3 if axes is driven else 1e-5)
    product.plot(time, products, **LINES[0])
    steps = np.diff(time) * (products[1:] + products[:-1]) / 2
    made = omega[0, 2] + _gyroscopic_ratio(dataset) * np.concatenate([[0], np.cumsum(steps)])
    _lines(third, time, np.stack([omega[:, 2], made], 1), ("ω3", "made by ω1 ω2"))
    driven.set_ylabel("rate (rad/s)")
    product.set_ylabel("ω1 ω2 (rad²/s²)")
    third.set_ylabel("ω3 (rad/s)")
    _finish(dataset, [driven, product, third])
    return figure


def lyapunov_figure(dataset: xr.Dataset, *, title: str = "") -> Figure:
    """The Lyapunov function of the law's proof on a logarithmic axis."""
    figure, (axes,) = panels(1, _title(dataset, "Lyapunov function", title), height=2.6)
    value = np.where(dataset["lyapunov"] > 0, dataset["lyapunov"], np.nan)
    axes.semilogy(dataset["time"], value, **LINES[0])
    axes.set_ylabel("V (N m)")
    _finish(dataset, [axes])
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
    _legend(tilt, len(labels))
    _finish(datasets[0], [tilt, turn, rate])
    return figure


def _title(dataset: xr.Dataset, subject: str, title: str) -> str:
    return title or f"{dataset.attrs.get('title', 'Trajectory')}: {subject}"


def _lines(axes: Axes, time, values, labels: Sequence[str], *, legend: bool = True) -> None:
    for column, (label, style) in enumerate(zip(labels, LINES, strict=False)):
        axes.plot(time, np.asarray(values)[:, column], label=label, **style)
    if legend:
        _legend(axes, len(labels))


def _legend(axes: Axes, count: int) -> None:
    axes.legend(
        loc="lower right",
        ncols=count + 1,
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.1,
        frameon=False,
    )


def _finish(
    dataset: xr.Dataset, axes: Sequence[Axes], enlarged: Axes | None = None, zoom: Span = (0, 0)
) -> None:
    start, end = float(dataset["time"][0]), float(dataset["time"][-1])
    for one in axes:
        one.set_xlim(start, end)
    if enlarged is not None:
        enlarged.set_xlim(*zoom)
    lowest = axes[-1] if enlarged is None else enlarged
    lowest.set_xlabel("time (s)")


def _last_fifth(dataset: xr.Dataset) -> Span:
    start, end = float(dataset["time"][0]), float(dataset["time"][-1])
    return (end - (end - start) / 5, end)


def _gyroscopic_ratio(dataset: xr.Dataset) -> float:
    """(J1 - J2)/J3 of (37), from the scenario that the dataset carries."""
    inertia = np.array(tomllib.loads(dataset.attrs["scenario"])["spacecraft"]["inertia_kg_m2"])
    j1, j2, j3 = inertia if inertia.ndim == 1 else np.diag(inertia)
    return float((j1 - j2) / j3)


def _angle_degrees(dataset: xr.Dataset) -> np.ndarray:
    """The angle of the single rotation between the frames, from the scalar part, degrees."""
    quaternion = dataset["quaternion"].values
    vector = np.linalg.norm(quaternion[:, 1:], axis=1)
    return np.degrees(2 * np.arctan2(vector, np.abs(quaternion[:, 0])))


def _shade_modes(dataset: xr.Dataset, axes: Axes) -> None:
    """Bands of grey, each with its name, where a sampled controller is not in its usual mode."""
    names = _mode_names(dataset)
    usual = 0 if 0 in names else max(names, default=0)
    unusual = [mode for mode in names if mode != usual]
    for grey, mode in zip(np.linspace(0.7, 0.9, max(len(unusual), 1)), unusual, strict=False):
        axes.fill_between(
            dataset["time"],
            0,
            1,
            where=dataset["mode"].values == mode,
            transform=axes.get_xaxis_transform(),
            color=str(grey),
            linewidth=0,
            step="post",
            label=escape_mathematics(names[mode]),
        )
    if unusual:
        _legend(axes, 3 + len(unusual))


def _mode_names(dataset: xr.Dataset) -> dict[int, str]:
    """What the numbers of `mode` mean, those that occur."""
    attributes = dataset["mode"].attrs
    meanings = str(attributes.get("flag_meanings", "")).split()
    values = np.atleast_1d(attributes.get("flag_values", [])).astype(int).tolist()
    found = set(dataset["mode"].values[np.isfinite(dataset["mode"].values)].astype(int).tolist())
    return {
        mode: meaning.replace("_", " ")
        for mode, meaning in zip(values, meanings, strict=True)
        if mode in found
    }
