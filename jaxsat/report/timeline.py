"""Events of a run: failures, alarms, verdicts, and phases of the law."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.report.facts import scenario_tables
from jaxsat.report.plot import Timeline
from jaxsat.store.labelled import Dataset
from jaxsat.store.labels import ALL_PARTS

DIAGNOSED = tuple(kind.word for kind in DiagnosedKind)
"""Text of diagnosed kinds of failure, by number."""

MOST_VERDICTS = 6
"""Number of alarms and verdicts that a figure names."""

EXCLUDED = ("used again", "excluded")
"""What the filter does with a sensor of the attitude."""


def timeline_of(dataset: Dataset) -> Timeline:
    """Return failures, alarms, verdicts and excluded sensors, and spans of unusual modes.

    The usual mode is 0 or, without one, the mode in which the run ends.
    """
    time = dataset["time"].values
    failures = failures_of(scenario_tables(dataset), time)
    marks = [*failures, *verdicts(dataset), *exclusions(dataset)]
    names, modes = mode_names(dataset), dataset["mode"].values
    last = modes[np.isfinite(modes)][-1:]
    usual = 0 if 0 in names else int(last.sum())
    shades = {name: modes == mode for mode, name in names.items() if mode != usual}
    return Timeline(time, marks, shades)


def subject_title(dataset: Dataset, subject: str) -> str:
    """Return the title of a run with the subject of a figure."""
    return f"{dataset.attrs.get('title', 'Trajectory')}: {subject}"


def failures_of(scenario: Mapping[str, Any], times: np.ndarray) -> list[tuple[float, str]]:
    """Return times (s) and names of failures up to the last time, such as (300, "wheel 2 dead")."""
    return sorted(
        (at, f"{words_of(table.get('of', ''))} {table.get('kind', 'fails')}")
        for table in scenario.get("failure", ())
        if (at := float(table.get("at_s", 0.0))) <= times[-1]
    )


def verdicts(dataset: Dataset) -> list[tuple[float, str]]:
    """Return times (s) and names of the first alarms and isolations by a diagnosing law."""
    if "diagnosed_kind" not in dataset:
        return _verdicts_on_dipoles(dataset)[:MOST_VERDICTS]
    time, kinds = dataset["time"].values, dataset["diagnosed_kind"].values
    alarm = [mode for mode, name in mode_names(dataset).items() if name == "alarm"]
    in_alarm = np.isin(dataset["mode"].values, alarm)
    events = [(float(time[row]), "alarm") for row in np.flatnonzero(np.diff(in_alarm * 1) > 0) + 1]
    names = diagnosed_names(dataset)
    for row, place in np.argwhere(np.diff(kinds, axis=0) != 0):
        kind = kinds[row + 1, place]
        if np.isfinite(kind):
            verdict = f"isolated, {DIAGNOSED[int(kind)]}" if kind >= 0 else "works again"
            events.append((float(time[row + 1]), f"{names[place]}: {verdict}"))
    return sorted([*events, *_verdicts_on_dipoles(dataset)])[:MOST_VERDICTS]


def _verdicts_on_dipoles(dataset: Dataset) -> list[tuple[float, str]]:
    """Return times (s) and names of verdicts on magnetorquers."""
    if "diagnosed_dipole" not in dataset:
        return []
    time, part = dataset["time"].values, dataset["diagnosed_dipole"].values
    names, events = dataset["magnetorquer"].values, []
    for row, place in np.argwhere(np.diff((part != 1) & np.isfinite(part), axis=0)):
        left = part[row + 1, place]
        if np.isfinite(left):
            verdict = "works again" if left == 1 else f"isolated, makes {left:.0%}"
            events.append((float(time[row + 1]), f"magnetorquer {names[place]}: {verdict}"))
    return events


def words_of(part: str) -> str:
    """Return what `of` of a failure names, a sensor in words: "star tracker"."""
    return part if " " in part else part.replace("_", " ")


def exclusions(dataset: Dataset) -> list[tuple[float, str]]:
    """Return times (s) and names of the first sensors that the filter excluded, and of those that
    it used again, at the saved times."""
    if "sensor_excluded" not in dataset:
        return []
    excluded, time = dataset["sensor_excluded"], dataset["time"].values
    names, states = dataset[str(excluded.dims[-1])].values, excluded.values
    states = states[np.isfinite(states).all(axis=1)]  # a run that ended early has none later on
    changes = np.diff(states, axis=0, prepend=0 * states[:1])
    events = [
        (float(time[row]), f"{words_of(str(names[place]))} {EXCLUDED[int(states[row, place])]}")
        for row, place in np.argwhere(changes != 0)
    ]
    return events[:MOST_VERDICTS]


def diagnosed_part(dataset: Dataset) -> str:
    """Return the diagnosed kind of actuator: "thruster", "wheel", or "actuator" for both."""
    return str(dataset["diagnosed_kind"].dims[-1])


def diagnosed_names(dataset: Dataset) -> list[str]:
    """Return kind and name of each diagnosed actuator, such as "wheel A"."""
    part = diagnosed_part(dataset)
    names = dataset[part].values
    return [str(name) if part == ALL_PARTS else f"{part} {name}" for name in names]


def mode_names(dataset: Dataset) -> dict[int, str]:
    """Return the meanings of the numbers of `mode` that occur in a run."""
    attributes, modes = dataset["mode"].attrs, dataset["mode"].values
    meanings = str(attributes.get("flag_meanings", "")).split()
    values = np.atleast_1d(attributes.get("flag_values", [])).astype(int).tolist()
    present = set(modes[np.isfinite(modes)].astype(int).tolist())
    return {
        mode: meaning.replace("_", " ")
        for mode, meaning in zip(values, meanings, strict=True)
        if mode in present
    }
