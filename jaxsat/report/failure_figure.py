"""Figure of a failure in flight: pointing error with phases, and the tests that detect it."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxsat.core.pointing import pointing_error
from jaxsat.report.style import FURTHER_LINES, LINES, escape_mathematics, panels
from jaxsat.report.time_axes import (
    DIAGNOSED,
    diagnosed_part,
    failures,
    figure_title,
    place_legend,
    verdicts,
)
from jaxsat.store.labels import part_names

STYLES = (*LINES, *FURTHER_LINES)
"""Of the lines of a panel, one after the other."""

GREYS = ("1.0", "0.72", "0.86", "0.94")
"""Of the phases, light ones beside dark ones."""

IN_SERVICE = ("degraded", "friction up")
"""Failures of wheels that are used further."""

ROWS = 4
"""Of names of what happened, one below the other."""

NARROW = 0.07
"""A phase below this part of the time has its name above, a second one to the right."""


def failure_figure(dataset: xr.Dataset, *, title: str = "") -> Figure | None:
    """Total pointing error over the phases of a run in which something fails, and each CUSUM.

    Below them are the momenta of wheels where these are diagnosed.

    None where nothing fails, or the law does not diagnose its actuators.
    """
    struck = failures(dataset)
    if not struck or "detection_statistic" not in dataset:
        return None
    heading = figure_title(dataset, "failure, diagnosis, recovery", title)
    wheels = diagnosed_part(dataset) == "wheel"
    figure, (total, tests, *others) = panels(3 if wheels else 2, heading, 2.2)
    time = dataset["time"].values
    size = np.linalg.norm(pointing_error(dataset["quaternion"].values), axis=1)
    total.plot(time, size, **LINES[0])
    total.set_ylabel("pointing\nerror (°)")
    total.set_ylim(0, 1.45 * np.nanmax(size))
    _draw_phases(dataset, total)
    _draw_tests(dataset, tests)
    told = [*struck[:1], *verdicts(dataset)][:3]
    if len(struck) > 1:  # failures and what was isolated, without the alarms
        told = sorted([*struck, *(one for one in verdicts(dataset) if one[1] != "alarm")])
    for row, (at, name) in enumerate(told):
        for panel in (total, tests, *others):
            panel.axvline(at, color="black", linewidth=0.9, linestyle=(0, (1, 1.5)))
        total.annotate(
            f"{escape_mathematics(name)}, {at:.0f} s",
            (at, total.get_ylim()[1] * (0.55 - 0.14 * (row % ROWS))),
            xytext=(24, 0),
            textcoords="offset points",
            arrowprops={"arrowstyle": "-", "linewidth": 0.7},
            verticalalignment="center",
            bbox={"facecolor": "white", "alpha": 0.85, "linewidth": 0, "pad": 1},
        )
    for momenta in others:
        values = dataset["wheel_momentum"].values
        names = part_names(dataset.attrs.get("scenario", ""), "wheel", values.shape[1])
        for number, (name, line) in enumerate(zip(names, values.T, strict=True)):
            momenta.plot(time, line, label=f"wheel {name}", **STYLES[number % len(STYLES)])
        place_legend(momenta, len(names))
        momenta.set_ylabel("wheel momentum\n(N m s)")
    for panel in (total, tests, *others):
        panel.set_xlim(time[0], time[-1])
    (tests, *others)[-1].set_xlabel("time (s)")
    figure.align_ylabels([total, tests, *others])
    return figure


def phases(dataset: xr.Dataset) -> list[tuple[float, float, str]]:
    """Begin and end (s) of the phases of a run in which something fails, and their names."""
    start, end = float(dataset["time"][0]), float(dataset["time"][-1])
    struck = [at for at, _ in failures(dataset)]
    settled = float(dataset["settled_from"]) if "settled_from" in dataset else np.inf
    instants = [(start, "healthy: three axes")]
    for failed, following in zip(struck, [*struck[1:], np.inf], strict=True):
        instants.append((failed, "failed,\nnot known"))
        known = [at for at, name in verdicts(dataset) if at >= failed and "isolated" in name]
        if known and known[0] < following:
            what = "settling" if following == np.inf else "flying"
            instants.append((known[0], f"{what} by\n{_left(dataset, known[0])}"))
    if np.isfinite(settled) and settled > instants[-1][0]:
        instants.append((settled, "settled"))
    ends = [at for at, _ in instants[1:]] + [end]
    return [(at, to, name) for (at, name), to in zip(instants, ends, strict=True)]


def _left(dataset: xr.Dataset, at: float) -> str:
    """What is left at a time (s): how many wheels, where these are diagnosed."""
    if diagnosed_part(dataset) != "wheel":
        return "what is left"
    kinds = dataset["diagnosed_kind"].sel(time=at).values
    lost = [kind >= 0 and DIAGNOSED[int(kind)] not in IN_SERVICE for kind in kinds]
    return f"{len(kinds) - sum(lost)} wheels"


def _draw_phases(dataset: xr.Dataset, axes: Axes) -> None:
    found, one = phases(dataset), len(failures(dataset)) == 1
    whole = found[-1][1] - found[0][0]
    before = False
    for number, (begin, end, name) in enumerate(found):
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


def _draw_tests(dataset: xr.Dataset, axes: Axes) -> None:
    """The CUSUM statistic of those actuators that came near an alarm most."""
    time, values = dataset["time"].values, dataset["detection_statistic"].values
    order = np.argsort(-np.nanmax(values, axis=0))[:3]
    part = diagnosed_part(dataset)
    names = part_names(dataset.attrs.get("scenario", ""), part, values.shape[1])
    for rank, place in enumerate(order):
        number = place if part == "wheel" else rank  # a wheel looks as it does among the momenta
        label = f"{part} {names[place]}"
        axes.plot(time, values[:, place], label=label, **STYLES[number % len(STYLES)])
    axes.axhline(1.0, color="black", linewidth=1.2, linestyle="--", label="alarm")
    axes.set_ylim(0, 1.15 * max(1.0, float(np.nanmax(values))))
    axes.set_ylabel("CUSUM over\nits threshold (–)")
    place_legend(axes, 4)
