"""Events of a run: failures, alarms, verdicts, and phases of the law."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.sensors import OTHER_SENSORS
from jaxsat.core.declaration.units import unit_of, with_unit
from jaxsat.core.text import capitalised, number_text, vector_text
from jaxsat.report.facts import scenario_tables
from jaxsat.report.plot import Timeline
from jaxsat.store.labelled import Dataset
from jaxsat.store.labels import ALL_PARTS

DIAGNOSED = tuple(kind.word for kind in DiagnosedKind)
"""Text of diagnosed kinds of failure, by number."""

MOST_VERDICTS = 6
"""Number of alarms and verdicts that a figure names."""

RETURNED = "works again"
"""Verdict on an actuator that a law takes into service again."""

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


class Isolation(NamedTuple):
    """A law's verdict on an actuator, `part`, at a saved time `at` (s)."""

    at: float
    part: str
    what: str


def failures_of(scenario: Mapping[str, Any], times: np.ndarray) -> list[tuple[float, str]]:
    """Return times (s) and names of failures up to the last time, such as (300, "wheel 2 dead")."""
    return [
        (at, f"{words_of(str(table.get('of', '')))} {_kind_of(table, amounts=False)}")
        for at, table in _failures(scenario, times)
    ]


def failures_of_part(scenario: Mapping[str, Any], part: str, times: np.ndarray) -> str:
    """Describe the failures of a part up to the last time: "degraded (fraction 0.4) at 30 s"."""
    return "; ".join(
        f"{_kind_of(table, amounts=True)} at {number_text(at, 6)} s"
        for at, table in _failures(scenario, times)
        if table.get("of") == part
    )


def _failures(
    scenario: Mapping[str, Any], times: np.ndarray
) -> list[tuple[float, Mapping[str, Any]]]:
    """Return times (s) and tables of failures up to the last time, in order."""
    every = [(float(table.get("at_s", 0.0)), table) for table in scenario.get("failure", ())]
    return sorted((one for one in every if one[0] <= times[-1]), key=lambda one: one[0])


def _kind_of(table: Mapping[str, Any], amounts: bool) -> str:
    """Return a failure's kind in words."""
    kind = str(table.get("kind", "fails")).replace("-", " ")
    numbers = {key: one for key, one in table.items() if key not in ("of", "at_s", "kind")}
    if not amounts or not numbers:
        return kind
    return f"{kind} ({', '.join(_amount(key, one) for key, one in numbers.items())})"


def _amount(key: str, value: Any) -> str:
    """Return name, value and unit of a key of a failure."""
    unit = unit_of(key)
    name = key.removesuffix(with_unit("", unit)).replace("_", " ")
    text = vector_text(value) if isinstance(value, list) else number_text(value)
    return f"{name} {text}" if unit == "1" else f"{name} {text} {unit}"


def verdicts(dataset: Dataset) -> list[tuple[float, str]]:
    """Return times (s) and names of the first alarms and isolations by a diagnosing law."""
    events = [(one.at, f"{one.part}: {one.what}") for one in isolations(dataset)]
    if "diagnosed_kind" in dataset:
        time = dataset["time"].values
        alarm = [mode for mode, name in mode_names(dataset).items() if name == "alarm"]
        rises = np.diff(np.isin(dataset["mode"].values, alarm) * 1) > 0
        events += [(float(time[row]), "alarm") for row in np.flatnonzero(rises) + 1]
    return sorted(events)[:MOST_VERDICTS]


def isolations(dataset: Dataset) -> list[Isolation]:
    """Return all verdicts of a diagnosing law, in order of time."""
    verdicts, time = [], dataset["time"].values
    if "diagnosed_kind" in dataset:
        kinds, names = dataset["diagnosed_kind"].values, diagnosed_names(dataset)
        for row, place in np.argwhere(np.diff(kinds, axis=0) != 0):
            kind = kinds[row + 1, place]
            if np.isfinite(kind):
                what = f"isolated as {DIAGNOSED[int(kind)]}" if kind >= 0 else RETURNED
                verdicts.append(Isolation(float(time[row + 1]), names[place], what))
    if "diagnosed_dipole" in dataset:
        parts, names = dataset["diagnosed_dipole"].values, _diagnosed_rods(dataset)
        for place, name in enumerate(names):
            finite = parts[np.isfinite(parts[:, place]), place]
            changes = np.flatnonzero(np.diff(finite != 1)) + 1
            for row, end in pairwise([*changes, len(finite)]):
                share = finite[end - 1]
                what = RETURNED if share == 1 else f"isolated, makes {share:.0%}"
                verdicts.append(Isolation(float(time[row]), name, what))
    return sorted(verdicts)


def diagnosed_parts(dataset: Dataset) -> list[str]:
    """Return kind and name of each actuator on which a law gives verdicts."""
    kinds = diagnosed_names(dataset) if "diagnosed_kind" in dataset else []
    return [*kinds, *(_diagnosed_rods(dataset) if "diagnosed_dipole" in dataset else [])]


def _diagnosed_rods(dataset: Dataset) -> list[str]:
    return [f"magnetorquer {name}" for name in dataset["magnetorquer"].values]


def failure_sentences(dataset: Dataset, scenario: Mapping[str, Any]) -> Iterator[tuple[float, str]]:
    """Yield times (s) and sentences of failures, and of verdicts on actuators that work.

    That of a failure says when the law isolated it, if the law diagnoses such actuators.
    """
    every, scope = isolations(dataset), set(diagnosed_parts(dataset))
    others, failures = every, _failures(scenario, dataset["time"].values)
    for number, (at, table) in enumerate(failures):
        of = str(table.get("of", ""))
        later = [then for then, one in failures[number + 1 :] if one.get("of") == of]
        parts = scope & {of, f"{of}+", f"{of}-"}  # both ways of a two-sided thruster
        own = [one for one in others if one.part in parts and at <= one.at <= min([*later, np.inf])]
        others = [one for one in others if one not in own]
        before = [one.what for one in every if one.part in parts and one.at < at]
        verdict = "; not isolated" if parts else ""
        if own:
            verdict = f"; {_told(own)}"
        elif before and before[-1] != RETURNED:
            verdict = f"; still {before[-1]}"
        what = f"{words_of(of)} {_kind_of(table, amounts=True)} at {number_text(at, 6)} s"
        yield at, f"{capitalised(what)}{verdict}."
    lost = _failed_before(scenario)
    for one in others:
        excuse = "" if one.part.rstrip("+-") in lost else ", although it had not failed"
        yield one.at, f"{capitalised(one.part)} {_told([one])}{excuse}."


def _failed_before(scenario: Mapping[str, Any]) -> set[str]:
    """Return kind and name of the actuators that failed before the start."""
    return {
        f"{kind.name} {table.get('name', number)}"
        for kind in ACTUATORS
        for number, table in enumerate(scenario.get(kind.name, ()), 1)
        if table.get("failed")
    }


def _told(verdicts: Sequence[Isolation]) -> str:
    return ", ".join(f"{one.what} at {number_text(one.at, 6)} s" for one in verdicts)


def diagnoses(dataset: Dataset) -> dict[str, str]:
    """Return the law's verdicts on each actuator that it diagnoses; empty texts without one."""
    verdicts = isolations(dataset)
    return {
        part: _told([one for one in verdicts if one.part == part])
        for part in diagnosed_parts(dataset)
    }


def words_of(part: str) -> str:
    """Return what `of` of a failure names, a sensor in words: "star tracker"."""
    name = part.removeprefix(f"{OTHER_SENSORS} ")
    return name if " " in name else name.replace("_", " ")


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
