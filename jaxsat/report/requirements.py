"""Requirements of a scenario and the margins by which a run, or a study, meets them."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxsat.core.declaration.requirements import comparisons
from jaxsat.core.declaration.sensor import TACHOMETER
from jaxsat.core.declaration.sensors import FAILING
from jaxsat.core.text import number_text
from jaxsat.report.document import Cell, Shown, Table
from jaxsat.report.facts import scenario_tables
from jaxsat.scenario.parts.orbit import OrbitTable
from jaxsat.scenario.parts.requirements import RequirementTable
from jaxsat.simulation.requirements import raw_signals, saved_margin
from jaxsat.spacecraft.environment.orbital_torques import Sunlight
from jaxsat.store.labelled import Dataset
from jaxsat.studies.statistics import fraction_text
from jaxsat.studies.summary import RequirementSummary

NOTE = (
    "A margin is how far the deciding signal is on the right side of its limit. It is judged at "
    "the saved times, between which signals count as linear."
)


STUDY_NOTE = (
    "A margin is how far the deciding signal is on the right side of its limit. It is judged at "
    "every sample, or at least once a second, between which signals count as linear. Intervals are "
    "of 95 %."
)


class RunMargin(NamedTuple):
    """A requirement with its margin in a run.

    The `margin`, in `unit`, is negative where the run violates the requirement, infinite where none
    of its windows has begun, and NaN where the run ended before or has no such signal. `signal`
    decided it, at `time` (s).
    """

    id: str
    text: str
    margin: float
    unit: str
    signal: str
    time: float

    @property
    def met(self) -> bool:
        """Whether the run meets the requirement."""
        return self.margin >= 0


def judgements(dataset: Dataset) -> list[RunMargin]:
    """Judge every requirement of a run's scenario by the signals at its saved times."""
    scenario = scenario_tables(dataset)
    return [
        _judgement(dataset, scenario, RequirementTable.model_validate(table))
        for table in scenario.get("requirement", ())
    ]


def _judgement(dataset: Dataset, scenario: dict, requirement: RequirementTable) -> RunMargin:
    formula = requirement.parsed
    sentence = requirement.text or requirement.formula
    if missing := raw_signals(formula) - set(dataset.data_vars):
        return RunMargin(requirement.id, sentence, math.nan, "", min(missing), math.nan)
    signals = {name: np.asarray(dataset[name].values) for name in raw_signals(formula)}
    failures = _failure_times(dataset, scenario)
    needs_sun = any(one.signal == "sun_angle" for one in comparisons(formula))
    light = _light(scenario) if needs_sun else None
    margin = saved_margin(formula, dataset["time"].values, signals, np.ravel(failures), light)
    decisive = comparisons(formula)[int(margin.comparison)]
    return RunMargin(
        requirement.id,
        sentence,
        float(margin.value) / decisive.size,
        decisive.unit,
        decisive.signal,
        float(margin.time),
    )


def _failure_times(dataset: Dataset, scenario: dict) -> np.ndarray:
    """Times (s) of all failures of actuators and sensors, as drawn for the case of a study."""
    tables, sensors = scenario.get("failure", ()), [TACHOMETER, *FAILING]
    each = []
    for name, of_sensors in (("drawn_failure_time", False), ("drawn_sensor_failure_time", True)):
        each_of = ((one["of"].partition(" ")[0] in sensors, one["at_s"]) for one in tables)
        times = [float(at) for of_sensor, at in each_of if of_sensor == of_sensors]
        each.append(np.ravel(dataset.attrs.get(name, times)))
    return np.concatenate(each)


def _light(scenario: dict) -> Sunlight:
    from jaxsat.scenario.build.plant import sunlight_of

    orbit = OrbitTable.model_validate(scenario["orbit"])
    return sunlight_of(orbit, scenario["disturbance"]["sun_direction"])


def requirement_table(margins: Sequence[RunMargin]) -> Table:
    """Return the table of requirements: margin, whether it is met, and the deciding time."""
    return Table(
        "Requirements",
        ["requirement", "text", "margin", "met", "decided at"],
        [[one.id, one.text, _margin(one), _met(one), _time(one)] for one in margins],
        NOTE,
    )


def study_requirements(
    summaries: Sequence[RequirementSummary], scenario: Mapping[str, Any]
) -> list[Table]:
    """Return the fraction of cases that meet each requirement, and the worst case.

    Empty without requirements. Those that a study does not judge have no fraction.
    """
    tables = [RequirementTable.model_validate(one) for one in scenario.get("requirement", ())]
    by_name = {one.name: one for one in summaries}
    rows = [_of_cases(one, by_name.get(one.id)) for one in tables]
    columns = ["requirement", "text", "met", "worst margin", "in case", "decided at"]
    return [Table("Requirements", columns, rows, STUDY_NOTE)] if rows else []


def _of_cases(requirement: RequirementTable, summary: RequirementSummary | None) -> list[Cell]:
    sentence = requirement.text or requirement.formula
    if summary is None:
        return [requirement.id, sentence, "not judged in studies", None, None, None]
    decisive = comparisons(requirement.parsed)[summary.comparison]
    margin = summary.margin / decisive.size
    row = RunMargin(requirement.id, sentence, margin, decisive.unit, decisive.signal, summary.time)
    met = Shown(fraction_text(summary.met), summary.met.value)
    if summary.margin == math.inf:
        met = Shown("nothing to judge", None, None)
    return [requirement.id, sentence, met, _margin(row), summary.worst, _time(row)]


def _margin(one: RunMargin) -> Shown | None:
    if not math.isfinite(one.margin):
        return None
    text = f"{number_text(one.margin, 4)} {one.unit}".strip()
    return Shown(f"{text} of {one.signal}", one.margin)


def _met(one: RunMargin) -> Shown:
    if math.isnan(one.margin):
        return Shown("not shown", 0, False)
    if math.isinf(one.margin) and one.met:
        return Shown("yes: nothing to judge", 1, None)
    return Shown("yes" if one.met else "no", int(one.met), one.met)


def _time(one: RunMargin) -> Shown | None:
    return None if math.isnan(one.time) else Shown(f"{number_text(one.time, 6)} s", one.time)
