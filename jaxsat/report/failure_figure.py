"""Figure of a failure in flight: pointing error with phases, and the tests that detect it."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxsat.pointing import pointing_error
from jaxsat.report.style import FURTHER_LINES, LINES, escape_mathematics, panels
from jaxsat.report.time_axes import failures, figure_title, part_names, place_legend, verdicts

GREYS = ("1.0", "0.72", "0.86", "0.94")
"""Of the phases, light ones beside dark ones."""

NARROW = 0.07
"""A phase below this part of the time has its name above, a second one to the right."""


def failure_figure(dataset: xr.Dataset, *, title: str = "") -> Figure | None:
    """Total pointing error over the phases of a run in which something fails, and each CUSUM.

    None where nothing fails, or the law does not diagnose its thrusters.
    """
    struck = failures(dataset)
    if not struck or "detection_statistic" not in dataset:
        return None
    heading = figure_title(dataset, "failure, diagnosis, recovery", title)
    figure, (total, tests) = panels(2, heading, 2.2)
    time = dataset["time"].values
    size = np.linalg.norm(pointing_error(dataset["quaternion"].values), axis=1)
    total.plot(time, size, **LINES[0])
    total.set_ylabel("pointing\nerror (°)")
    total.set_ylim(0, 1.45 * np.nanmax(size))
    _draw_phases(dataset, total)
    _draw_tests(dataset, tests)
    told = [*struck[:1], *verdicts(dataset)]
    for row, (at, name) in enumerate(told[:3]):
        for panel in (total, tests):
            panel.axvline(at, color="black", linewidth=0.9, linestyle=(0, (1, 1.5)))
        total.annotate(
            f"{escape_mathematics(name)}, {at:.0f} s",
            (at, total.get_ylim()[1] * (0.55 - 0.14 * row)),
            xytext=(24, 0),
            textcoords="offset points",
            arrowprops={"arrowstyle": "-", "linewidth": 0.7},
            verticalalignment="center",
            bbox={"facecolor": "white", "alpha": 0.85, "linewidth": 0, "pad": 1},
        )
    for panel in (total, tests):
        panel.set_xlim(time[0], time[-1])
    tests.set_xlabel("time (s)")
    figure.align_ylabels([total, tests])
    return figure


def phases(dataset: xr.Dataset) -> list[tuple[float, float, str]]:
    """Begin and end (s) of the phases of a run in which something fails, and their names."""
    start, end = float(dataset["time"][0]), float(dataset["time"][-1])
    failed = failures(dataset)[0][0]
    known = [at for at, name in verdicts(dataset) if at >= failed and "isolated" in name]
    settled = float(dataset["settled_from"]) if "settled_from" in dataset else np.inf
    instants = [(start, "healthy: three axes"), (failed, "failed,\nnot known")]
    if known:
        instants.append((known[0], "settling by\nwhat is left"))
    if np.isfinite(settled) and settled > instants[-1][0]:
        instants.append((settled, "settled"))
    ends = [at for at, _ in instants[1:]] + [end]
    return [(at, to, name) for (at, name), to in zip(instants, ends, strict=True)]


def _draw_phases(dataset: xr.Dataset, axes: Axes) -> None:
    found = phases(dataset)
    whole = found[-1][1] - found[0][0]
    before = False
    for number, (begin, end, name) in enumerate(found):
        axes.axvspan(begin, end, color=GREYS[number % len(GREYS)], linewidth=0, zorder=0)
        narrow = end - begin < NARROW * whole
        side, before = "left" if before else "right", narrow
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


def _draw_tests(dataset: xr.Dataset, axes: Axes) -> None:
    """The CUSUM statistic of those thrusters that came near an alarm most."""
    time, values = dataset["time"].values, dataset["detection_statistic"].values
    styles = (*LINES, *FURTHER_LINES)
    order = np.argsort(-np.nanmax(values, axis=0))[:3]
    names = part_names(dataset, "thruster", values.shape[1])
    for style, place in zip(styles, order, strict=False):
        label = f"thruster {names[place]}"
        axes.plot(time, values[:, place], label=label, **style)
    axes.axhline(1.0, color="black", linewidth=1.2, linestyle="--", label="alarm")
    axes.set_ylim(0, 1.15 * max(1.0, float(np.nanmax(values))))
    axes.set_ylabel("CUSUM over\nits threshold (–)")
    place_legend(axes, 4)
