"""An estimate in one call: pilot run, replications, and their evaluation."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from jaxsat.core.errors import ArgumentError
from jaxsat.report.rare_event_document import rare_event_plots
from jaxsat.scenario import Scenario, dump
from jaxsat.scenario.parts.requirements import RequirementTable
from jaxsat.store.files import OutputError
from jaxsat.store.header import differences as where_other
from jaxsat.store.marker import Marker
from jaxsat.store.resumable import ResumableFolder
from jaxsat.studies.designs import Listed
from jaxsat.studies.ensemble import Study
from jaxsat.studies.splitting import LENGTH, Level, Replications, Splitting, interval_of
from jaxsat.studies.statistics import Interval
from jaxsat.synthesis.execution import Execution, Listener, folder_of_call, write_record
from jaxsat.synthesis.flights import (
    Batch,
    Flights,
    chosen_requirement,
    excess_of,
    identity_of,
    listed_flights,
    space_of,
    study_of_requirements,
    unit_of,
)
from jaxsat.synthesis.rare_events.result import EstimateSettings, LevelRow, RareEvent
from jaxsat.synthesis.rare_events.violations import Violations, differences, doubts_of

KIND = "rare event"
"""Kind of the output folder."""

SCENARIO, TABLE = "scenario.toml", "violations.csv"


def rare_event(
    scenario: Scenario,
    requirement: str | None = None,
    *,
    cases: int = 1000,
    replications: int = 10,
    least: float = 1e-9,
    confidence: float = 0.95,
    out: str | Path | None = None,
    execution: Execution = Execution(),
    listener: Listener = Listener(),
) -> RareEvent:
    """Estimate the probability, however small, that a requirement is violated.

    The requirement is that of this id, or the only one that studies judge. A pilot run finds levels
    of the margin down to zero; the `replications`, each with `cases` of every level, then give
    independent unbiased estimates, see `jaxsat.studies.splitting`. The draws of a case move along
    Markov chains; discrete numbers and the noise of sensors are drawn again whole. With `out`
    flights and results are kept in that folder, and the same call resumes.

    Raises `MissingTable` for a scenario without requirements or dispersions, `ArgumentError` for
    invalid numbers or a requirement that studies do not judge, `OutputError` for a folder that
    cannot be used, and `ValueError` for an engine that cannot run the study.
    """
    settings = EstimateSettings(cases, replications, least, confidence)
    scenario, study = study_of_requirements(scenario, execution, listener)
    table = chosen_requirement(scenario, study, requirement)
    listener.approve([execution.work(replace(study, count=_most_flights(settings)))])
    identity = identity_of(scenario, study)
    identity |= {"requirement": table.id, "settings": vars(settings)}
    with folder_of_call(out, KIND, identity, execution.elsewhere) as folder:
        folder.write(SCENARIO, dump(scenario))
        flights = Flights(study, table.id, folder, execution.executor, listener)
        splitting = Splitting(space_of(study), flights.margins, cases, scenario.simulation.seed)
        levels, reached = splitting.pilot(least)
        samples = splitting.replicate(levels, replications)
        estimate = _Estimate(scenario, table, settings, levels, reached, samples)
        everything = flights.together()
        if excess := excess_of(everything, scenario):
            listener.warn(excess)
        result = estimate.result(study, everything, str(folder.path))
        if out is not None:
            _write(folder, result, estimate.violations, everything)
        return result


def flown_again(
    scenario: Scenario,
    out: str | Path,
    number: int,
    execution: Execution = Execution(),
    listener: Listener = Listener(),
) -> tuple[Scenario, Study]:
    """Return the scenario with its steps, and a study whose cases are the flights of an estimate.

    Raises `OutputError` where the folder has no estimate of this scenario, and `ArgumentError` for
    an unknown flight number.
    """
    marker = Marker.read(Path(out)) if Path(out).is_dir() else None
    if marker is None or marker.kind != KIND:
        raise OutputError(f"{out} holds no estimate of a rare event; give the folder of one.")
    scenario, study = study_of_requirements(scenario, execution, listener)
    stored = {key: marker.about["identity"].get(key) for key in ("scenario", "engine", "program")}
    current = json.loads(json.dumps(identity_of(scenario, study)))
    if other := where_other(stored, {key: current[key] for key in stored}):
        raise OutputError(f"{out} holds an estimate of another scenario ({'; '.join(other)}).")
    with ResumableFolder(out, KIND, {}) as folder:
        points, noise = listed_flights(folder)
    if not number < len(points):
        raise ArgumentError("case", f"must be below {len(points)}, the number of flights", number)
    design = Listed(study.design.seed, points, noise)
    return scenario, replace(study, design=design, count=len(points))


def _most_flights(settings: EstimateSettings) -> int:
    levels = math.ceil(-math.log(settings.least) / math.log(LENGTH))
    population = settings.cases + levels * (settings.cases - settings.cases // LENGTH)
    return (1 + settings.replications) * population


@dataclass(frozen=True)
class _Estimate:
    """Samples and levels of an estimate, before its evaluation."""

    scenario: Scenario
    table: RequirementTable
    settings: EstimateSettings
    levels: list[Level]
    reached: bool
    samples: Replications

    @property
    def violations(self) -> Violations:
        return Violations.of(self.samples)

    def result(self, study: Study, flights: Batch, folder: str) -> RareEvent:
        """Evaluate the estimate, whose flights are in `folder`."""
        violations = self.violations
        doubts = doubts_of(
            self.samples, self.levels, self.reached, space_of(study), flights, violations
        )
        margins = flights["margin"][violations.number]
        worst = None
        margin, unit, again = math.nan, unit_of(self.table)[0], ""
        if len(margins):
            place = int(np.argmin(np.nan_to_num(margins, nan=-np.inf)))
            worst = int(violations.number[place])
            margin = float(margins[place]) / unit_of(self.table)[1]
            again = f"jaxsat rare {folder}/{SCENARIO} --out {folder} --case {worst}"
        return RareEvent(
            self.scenario.title,
            self.table.id,
            self.table.text or self.table.formula,
            self.settings,
            self._probability(),
            self.samples.probabilities.tolist(),
            len(flights["margin"]),
            len(violations.number),
            len(np.unique(violations.root)),
            doubts,
            list(self._levels()),
            differences(flights, self.samples.draws, violations),
            worst,
            margin,
            unit,
            again,
        )

    def _probability(self) -> Interval:
        """Return mean and interval; without violations its upper end is that of the last level."""
        probability = interval_of(self.samples.probabilities, self.settings.confidence)
        if probability.value > 0:
            return probability
        if self.levels:
            high = interval_of(self.samples.of_last, self.settings.confidence).high
        else:
            count = len(self.samples.draws)
            high = 1 - ((1 - self.settings.confidence) / 2) ** (1 / count)
        return probability._replace(high=min(1.0, high))

    def _levels(self) -> Iterator[LevelRow]:
        """Yield the levels with their probabilities, the last with margin zero."""
        size = unit_of(self.table)[1]
        fractions = self.samples.fractions
        probabilities = np.cumprod(fractions, axis=1).mean(axis=0)
        by_margin = {one.margin: one for one in self.samples.levels}
        margins = [*(one.margin for one in self.levels), 0.0]
        for place, margin in enumerate(margins):
            level = by_margin.get(margin) if place < len(self.levels) else None
            moved, redrawn = (math.nan,) * 2 if level is None else (level.moved, level.redrawn)
            yield LevelRow(
                margin / size,
                float(probabilities[place]),
                fractions[:, place].tolist(),
                moved,
                redrawn,
            )


def _write(
    folder: ResumableFolder, result: RareEvent, violations: Violations, flights: Batch
) -> None:
    from jaxsat.report.figure_painter import paint
    from jaxsat.report.saving import save_figures

    record = write_record(folder, "jaxsat.synthesis.rare_events", "rare-event", result)
    folder.write(TABLE, violations.table(flights))
    title = f"{result.title}: {result.requirement}"
    save_figures(lambda: {"levels": paint(rare_event_plots(record), title)}, folder.write)
