"""Figure of a failure in flight: pointing error with phases, and the tests that detect it."""

import numpy as np
from matplotlib.figure import Figure

from jaxsat.report.facts import scenario_tables
from jaxsat.report.figure_painter import paint
from jaxsat.report.plot import TIME, Axis, Line, Plot, Timeline
from jaxsat.report.run_plots import signal_plots
from jaxsat.report.style import MOST_LINES
from jaxsat.report.timeline import (
    DIAGNOSED,
    diagnosed_names,
    diagnosed_part,
    failures_of,
    mode_names,
    subject_title,
    verdicts,
)
from jaxsat.store.labelled import Dataset

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
