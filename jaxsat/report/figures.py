"""Figures of a run: a trajectory dataset in, a matplotlib `Figure` out.

The datasets are those of `jaxsat.store.dataset`. No figure is shown or saved here.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import cast

import numpy as np
from matplotlib.figure import Figure

from jaxsat.report.facts import scenario_tables
from jaxsat.report.figure_painter import paint
from jaxsat.report.plot import TIME, Axis, Line, Plot, Timeline
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
from jaxsat.report.style import MOST_LINES
from jaxsat.report.timeline import (
    DIAGNOSED,
    diagnosed_names,
    diagnosed_part,
    failures_of,
    mode_names,
    subject_title,
    timeline_of,
    verdicts,
)
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


IN_SERVICE = ("degraded", "friction up")
"""Failures of wheels that stay in use."""


def shows_failure(dataset: Dataset) -> bool:
    """Whether something fails in flight, under a law that diagnoses its actuators."""
    return "detection_statistic" in dataset and bool(_failures(dataset))


def failure_figure(dataset: Dataset, *, title: str = "") -> Figure | None:
    """Plot total pointing error over the phases of a run with failures, and each CUSUM.

    Below them are the momenta of diagnosed wheels. None where nothing fails, or the law does not
    diagnose its actuators.
    """
    if not shows_failure(dataset):
        return None
    failures = _failures(dataset)
    time, size = dataset["time"].values, dataset["pointing_error_total"].values
    axis = Axis("Pointing error", "°", limits=(0.0, 1.45 * float(np.nanmax(size))))
    plots = [Plot("Pointing error", "", TIME, axis, [Line(time, size)]), _tests(dataset)]
    if diagnosed_part(dataset) != "thruster":
        plots += signal_plots(dataset, "wheel_momentum")
    events = [*failures[:1], *verdicts(dataset)][:3]
    if len(failures) > 1:  # failures and what was isolated, without the alarms
        events = sorted([*failures, *(one for one in verdicts(dataset) if one[1] != "alarm")])
    marks = [(at, f"{name}, {at:.0f} s") for at, name in events]
    heading = title or subject_title(dataset, "failure, diagnosis, recovery")
    return paint(plots, heading, 1.9, Timeline(time, marks, phases(dataset)))


def _failures(dataset: Dataset) -> list[tuple[float, str]]:
    """Return times (s) and names of failures of actuators, which `of` names by kind and device."""
    every = scenario_tables(dataset).get("failure", ())
    tables = [one for one in every if " " in one.get("of", "")]
    return failures_of({"failure": tables}, dataset["time"].values)


def phases(dataset: Dataset) -> dict[str, np.ndarray]:
    """Return which samples (n,) of a run with failures are in each phase after the first failure.

    Before it all actuators work. Phases of the same name are one.
    """
    time = dataset["time"].values
    strikes = [at for at, _ in _failures(dataset)]
    settled = float(dataset["settled_from"].values) if "settled_from" in dataset else np.inf
    instants: list[tuple[float, str]] = []
    for strike, following in zip(strikes, [*strikes[1:], np.inf], strict=True):
        instants.append((strike, "failed, not known"))
        isolations = [at for at, name in verdicts(dataset) if at >= strike and "isolated" in name]
        if isolations and isolations[0] < following:
            settles = following == np.inf and settled > isolations[0]
            what = "settling" if settles else "flying"
            wheels = _remaining_wheels(dataset, isolations[0])
            instants.append((isolations[0], f"{what} by {wheels}"))
    if np.isfinite(settled) and settled > instants[-1][0]:
        instants.append((settled, "settled"))
    numbers = np.searchsorted([at for at, _ in instants], time, side="right")
    names = np.array(["", *(name for _, name in instants)])[numbers]
    return {name: names == name for _, name in instants}


def _remaining_wheels(dataset: Dataset, at: float) -> str:
    """Describe what is left at a time (s): number of diagnosed wheels, and magnetorquers in use."""
    if diagnosed_part(dataset) != "wheel":
        return "what is left"
    row = int(np.searchsorted(dataset["time"].values, at))
    kinds = dataset["diagnosed_kind"].values[row]
    out_of_service = [kind >= 0 and DIAGNOSED[int(kind)] not in IN_SERVICE for kind in kinds]
    after = dataset.isel(time=slice(row, row + 2))  # the law may act one later
    rods = " and rods" if "rods" in mode_names(after).values() else ""
    count = len(kinds) - sum(out_of_service)
    return f"{count} wheel{'' if count == 1 else 's'}{rods}"


def _tests(dataset: Dataset) -> Plot:
    """Return a plot of the CUSUM statistics, of all actuators or of those nearest to an alarm."""
    time, values = dataset["time"].values, dataset["detection_statistic"].values
    places = np.arange(values.shape[1])
    if len(places) >= MOST_LINES:
        places = np.argsort(-np.nanmax(values, axis=0))[:3]
    names = diagnosed_names(dataset)
    lines = [Line(time, values[:, place], names[place]) for place in places]
    lines.append(Line(time[[0, -1]], np.ones(2), "alarm"))
    top = 1.15 * max(1.0, float(np.nanmax(values)))
    return Plot("Tests", "", TIME, Axis("CUSUM over its threshold", "1", limits=(0.0, top)), lines)
