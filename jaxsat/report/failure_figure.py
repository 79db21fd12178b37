"""Figure of a failure in flight: pointing error with phases, and the tests that detect it."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxsat.report.facts import scenario_tables
from jaxsat.report.figure_painter import paint
from jaxsat.report.plot import TIME, Axis, Line, Plot, Timeline
from jaxsat.report.run_plots import signal_plots
from jaxsat.report.style import MOST_LINES, escape_mathematics
from jaxsat.report.timeline import (
    DIAGNOSED,
    diagnosed_names,
    diagnosed_part,
    failures_of,
    mode_names,
    subject_title,
    verdicts,
)

GREYS = ("1.0", "0.72", "0.86", "0.94")
"""Greys of the phases, alternating light and dark."""

IN_SERVICE = ("degraded", "friction up")
"""Failures of wheels that stay in use."""

ROWS = 4
"""Rows for the names of events, one below the other."""

NARROW = 0.07
"""Fraction of the time below which a phase has its name above, a second one to the right."""


def failure_figure(dataset: xr.Dataset, *, title: str = "") -> Figure | None:
    """Plot total pointing error over the phases of a run with failures, and each CUSUM.

    Below them are the momenta of diagnosed wheels. None where nothing fails, or the law does not
    diagnose its actuators.
    """
    failures = _failures(dataset)
    if not failures or "detection_statistic" not in dataset:
        return None
    time, size = dataset["time"].values, dataset["pointing_error_total"].values
    axis = Axis("Pointing error", "°", limits=(0.0, 1.45 * float(np.nanmax(size))))
    plots = [Plot("Pointing error", "", TIME, axis, [Line(time, size)]), _tests(dataset)]
    if diagnosed_part(dataset) != "thruster":
        plots += signal_plots(dataset, "wheel_momentum")
    events = [*failures[:1], *verdicts(dataset)][:3]
    if len(failures) > 1:  # failures and what was isolated, without the alarms
        events = sorted([*failures, *(one for one in verdicts(dataset) if one[1] != "alarm")])
    timeline = Timeline(time, [(at, "") for at, _ in events])
    heading = title or subject_title(dataset, "failure, diagnosis, recovery")
    figure = paint(plots, heading, 1.7, timeline)
    total = figure.axes[0]
    _draw_phases(dataset, total)
    for row, (at, name) in enumerate(events):
        total.annotate(
            f"{escape_mathematics(name)}, {at:.0f} s",
            (at, total.get_ylim()[1] * (0.55 - 0.14 * (row % ROWS))),
            xytext=(24, 0),
            textcoords="offset points",
            arrowprops={"arrowstyle": "-", "linewidth": 0.7},
            verticalalignment="center",
            fontsize="small",
            bbox={"facecolor": "white", "alpha": 0.85, "linewidth": 0, "pad": 1},
        )
    return figure


def _failures(dataset: xr.Dataset) -> list[tuple[float, str]]:
    return failures_of(scenario_tables(dataset), dataset["time"].values)


def phases(dataset: xr.Dataset) -> list[tuple[float, float, str]]:
    """Return begin and end (s) and names of the phases of a run with failures."""
    start, end = float(dataset["time"][0]), float(dataset["time"][-1])
    strikes = [at for at, _ in _failures(dataset)]
    settled = float(dataset["settled_from"]) if "settled_from" in dataset else np.inf
    instants = [(start, "healthy: three axes")]
    for strike, following in zip(strikes, [*strikes[1:], np.inf], strict=True):
        instants.append((strike, "failed,\nnot known"))
        isolations = [at for at, name in verdicts(dataset) if at >= strike and "isolated" in name]
        if isolations and isolations[0] < following:
            what = "settling" if following == np.inf else "flying"
            instants.append(
                (isolations[0], f"{what} by\n{_remaining_wheels(dataset, isolations[0])}")
            )
    if np.isfinite(settled) and settled > instants[-1][0]:
        instants.append((settled, "settled"))
    ends = [at for at, _ in instants[1:]] + [end]
    return [(at, to, name) for (at, name), to in zip(instants, ends, strict=True)]


def _remaining_wheels(dataset: xr.Dataset, at: float) -> str:
    """Describe what is left at a time (s): number of diagnosed wheels, and magnetorquers in use."""
    if diagnosed_part(dataset) != "wheel":
        return "what is left"
    kinds = dataset["diagnosed_kind"].sel(time=at).values
    out_of_service = [kind >= 0 and DIAGNOSED[int(kind)] not in IN_SERVICE for kind in kinds]
    after = dataset.sel(time=slice(at, None)).isel(time=slice(2))  # the law may act one later
    rods = " and rods" if "rods" in mode_names(after).values() else ""
    count = len(kinds) - sum(out_of_service)
    return f"{count} wheel{'' if count == 1 else 's'}{rods}"


def _draw_phases(dataset: xr.Dataset, axes: Axes) -> None:
    spans, one = phases(dataset), len(_failures(dataset)) == 1
    whole = spans[-1][1] - spans[0][0]
    before = False
    for number, (begin, end, name) in enumerate(spans):
        axes.axvspan(begin, end, color=GREYS[number % len(GREYS)], linewidth=0, zorder=0)
        narrow = end - begin < NARROW * whole
        side, before = "left" if before else "right", narrow
        if narrow and not one:
            continue  # of several failures the names of what happened tell enough
        if not one:
            name = name.replace(": ", ":\n")
        axes.text(
            (begin + end) / 2,
            1.01 if narrow else 0.97,
            name if not narrow else name.replace("\n", " "),
            transform=axes.get_xaxis_transform(),
            horizontalalignment=side if narrow else "center",
            verticalalignment="bottom" if narrow else "top",
            fontweight="bold",
            fontsize="small",
        )


def _tests(dataset: xr.Dataset) -> Plot:
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
