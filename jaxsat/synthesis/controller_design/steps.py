"""Steps of a design: verdict, candidates, screening, tuning, validation, verification."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from jaxsat.scenario import Scenario
from jaxsat.scenario.tuning import TuningTable
from jaxsat.store.files import OutputError
from jaxsat.studies.statistics import LEVEL, WhenDecided, wilson
from jaxsat.studies.summary import summarise
from jaxsat.synthesis.comparison.verdict import choose_law, settles_fewer
from jaxsat.synthesis.controller_design.candidates import (
    Candidate,
    Fitting,
    fitting_candidates,
    with_larger_end_game,
    written_out,
)
from jaxsat.synthesis.controller_design.completion import completed
from jaxsat.synthesis.controller_design.explanation import MOST_FLOWN, Remedy, remedies, separations
from jaxsat.synthesis.controller_design.lost_holds import design_cautions
from jaxsat.synthesis.controller_design.request import DesignSettings
from jaxsat.synthesis.controller_design.result import ControllerDesign, DesignVerification, Step
from jaxsat.synthesis.controller_design.studies import Columns, Studies, first_answer, row_of
from jaxsat.synthesis.controller_design.tuning import TUNED, Tuned, tune_candidate, tuning_table
from jaxsat.synthesis.controller_design.variants import turned
from jaxsat.synthesis.controller_design.vehicle import (
    Scale,
    VehicleVerdict,
    scale_of,
    vehicle_verdict,
)

Flight = tuple[Candidate, Columns]


class Screening(NamedTuple):
    """Result of the screening: all candidates, and the first sufficient one, if any."""

    step: Step
    candidates: tuple[Candidate, ...]
    enough: Candidate | None


@dataclass(frozen=True)
class DesignRun:
    """Run of the steps of a design, each resumed from its folder."""

    original: Scenario
    settings: DesignSettings
    studies: Studies
    timed: bool = True

    def run(self) -> ControllerDesign:
        """Run all steps, as far as there is something to design."""
        self.studies.listener.progress("verdict on the actuators left", None)
        verdict = vehicle_verdict(self.original)
        self.studies.listener.remark(verdict.lines()[0])
        scenario = self._target_scenario(verdict)
        fitting, assumptions = self._candidates(scenario, verdict)
        design = ControllerDesign(
            self.original,
            self.settings,
            verdict,
            assumptions,
            fitting.candidates,
            fitting.left_out,
            design_cautions(self.original, verdict, fitting.candidates),
        )
        for caution in filter(None, (design.misses_attitude, *design.cautions)):
            self.studies.listener.warn(caution)
        if not fitting.candidates:
            return design
        screening, candidates, enough = self._screening(fitting.candidates)
        names = {one.name: one for one in candidates}
        best = enough or names[screening.verdict.law or candidates[0].name]
        tuned, not_tuned, contenders = None, None, (best,)
        if enough is None:
            tuned, not_tuned = self._tune(screening, best)
            contenders = _contenders(candidates, screening, tuned)
        else:
            not_tuned = f"{best.name} meets the requirement with 95 % confidence"
        chosen, validation = best, None
        if len(contenders) > 1 or self.settings.goal == "quickest":
            validation, contenders = self._validation(contenders)
            names |= {one.name: one for one in contenders}
            chosen = names[validation.verdict.law or best.name]
        chosen = Candidate(chosen.name, self._ready(chosen))
        others = tuple(one for name, one in names.items() if name != chosen.name)
        verification = self._verification(chosen, others, verdict)
        return replace(
            design,
            chosen=chosen,
            screening=screening,
            tuned=tuned,
            not_tuned=not_tuned,
            validation=validation,
            verification=verification,
        )

    def _target_scenario(self, verdict: VehicleVerdict) -> Scenario:
        if self.settings.attitude == "wanted" or verdict.turn is None or not any(verdict.turn):
            return self.original
        return turned(self.original, verdict.turn)

    def _candidates(
        self, scenario: Scenario, verdict: VehicleVerdict
    ) -> tuple[Fitting, tuple[str, ...]]:
        """Return the laws that fit, and the assumptions made for the first."""
        assumptions: list[tuple[str, ...]] = []

        def complete(under_law: Scenario, scale: Scale) -> Scenario:
            completion = completed(under_law, verdict, scale, self.timed)
            assumptions.append(completion.assumed)
            return completion.scenario

        fitting = fitting_candidates(scenario, verdict, self.settings.law, complete)
        return fitting, assumptions[0] if assumptions else ()

    def _screening(self, fitting: tuple[Candidate, ...]) -> Screening:
        """Fly the candidates on the same cases, up to a sufficient one if the goal is settling.

        With that goal, without such a candidate, each flies again with a larger end game.
        """
        if self.settings.goal == "quickest":
            flights = list(self._announce_first(self._fly("screening", 2, fitting)))
            return Screening(self._compare("screening", flights), fitting, None)
        rule = WhenDecided(self.settings.settled, 2 * len(fitting))
        stream = self._announce_first(self._fly("screening", 2, fitting, rule))
        candidates, (flights, enough) = fitting, _up_to_enough(stream, rule)
        if not enough:
            larger = tuple(filter(None, map(with_larger_end_game, fitting)))
            more, enough = _up_to_enough(self._fly("screening", 2, larger, rule), rule)
            candidates, flights = (*fitting, *larger), flights + more
        return Screening(self._compare("screening", flights), candidates, enough)

    def _announce_first(self, flights: Iterator[Flight]) -> Iterator[Flight]:
        for number, (candidate, columns) in enumerate(flights):
            if number == 0:
                self.studies.listener.remark(first_answer(candidate.name, columns))
            yield candidate, columns

    def _validation(self, contenders: tuple[Candidate, ...]) -> tuple[Step, tuple[Candidate, ...]]:
        """Fly the contenders on the same cases; return the step and all that flew.

        Where none settles the required fraction with confidence, each flies once more with a larger
        end game, as in the screening where settling is the goal.
        """
        flights = list(self._fly("validation", 4, contenders))
        level = 1 - (1 - LEVEL) / len(contenders)
        low = max(wilson(*_settled_of(columns), level).low for _, columns in flights)
        if self.settings.goal == "quickest" and low < self.settings.settled:
            larger = tuple(filter(None, map(with_larger_end_game, contenders)))
            flights += self._fly("validation", 4, larger)
            contenders = (*contenders, *larger)
        return self._compare("validation", flights), contenders

    def _compare(self, step: str, flights: list[Flight]) -> Step:
        """Compare the candidates on the cases that all of them flew, under one torque limit.

        The quickest is chosen of those that settle the required fraction; the surest if none does,
        or where settling is the goal.
        """
        torque = scale_of(flights[0][0].scenario).torque
        count = min(len(columns["settling_time"]) for _, columns in flights)
        rows = tuple(
            row_of(step, torque, one, {key: values[:count] for key, values in columns.items()})
            for one, columns in flights
        )
        least_fraction = max(row.settled.value for row in rows)
        if self.settings.goal == "quickest":
            least_fraction = min(self.settings.settled, least_fraction)
        return Step(rows, choose_law([row for row in rows if row.settled.value >= least_fraction]))

    def _fly(
        self,
        step: str,
        number: int,
        candidates: tuple[Candidate, ...],
        rule: WhenDecided | None = None,
    ) -> Iterator[Flight]:
        count = getattr(self.settings, f"{step}_cases")
        seed = getattr(self.settings.seeds, step)
        for place, one in enumerate(candidates, 1):
            law = f"{step} of {one.name} ({place} of {len(candidates)} laws)"
            what, name = f"step {number} of 5, {law}", f"{step}-{one.name}"
            yield one, self.studies.columns(what, name, one.scenario, count, seed, rule)

    def _tune(self, screening: Step, best: Candidate) -> tuple[Tuned | None, str | None]:
        if not self.settings.steps:
            return None, "no steps were requested"
        row = next(row for row in screening.rows if row.setting.law == best.name)
        if not best.tunable:
            return None, f"{best.name} has no gains that are keys of [control]"
        if not _has_derivatives(best.scenario):
            return None, f"alarms and pulses of {best.name} have no derivatives"
        if row.settled.value == 0:
            return None, f"{best.name} settled no case, so the cost cannot rank gains"
        table = self._tuning_table(best)
        what = f"step 3 of 5, tuning of {best.name}"
        seed = self.settings.seeds.tuning
        try:
            return tune_candidate(best, row, table, seed, self.studies, what), None
        except OutputError:
            raise
        except ValueError as error:
            return None, f"{best.name} cannot be tuned: {error}"

    def _ready(self, chosen: Candidate) -> Scenario:
        """Return the final scenario: gains written out, and a table to tune them again."""
        scenario = written_out(chosen.scenario)
        changes: dict[str, Any] = {"title": f"{self.original.title[:150]}, designed"}
        if chosen.tunable and _has_derivatives(scenario):
            table = self._tuning_table(Candidate(chosen.name, scenario))
            changes["tuning"] = table if table.parameters else None
        return scenario.model_copy(update=changes)

    def _tuning_table(self, candidate: Candidate) -> TuningTable:
        settings, scenario = self.settings, candidate.scenario
        steps = max(1, settings.steps)
        return tuning_table(scenario, scale_of(scenario), steps, settings.validation_cases)

    def _verification(
        self, chosen: Candidate, others: tuple[Candidate, ...], verdict: VehicleVerdict
    ) -> DesignVerification:
        """Fly the chosen controller on unseen cases; where too few settle, find the causes."""
        settings, count = self.settings, self.settings.cases
        seed = settings.seeds.verification
        name = f"verification-{chosen.name}"
        what = f"step 5 of 5, verification of {chosen.name}"
        columns = dict(self.studies.columns(what, name, chosen.scenario, count, seed))
        verification = DesignVerification(summarise(columns), columns)
        if verification.settled.value >= settings.settled:
            return verification
        return replace(
            verification,
            separations=separations(chosen.scenario, columns, verdict.two_torques),
            remedies=self._remedies(chosen, others, verdict, columns),
        )

    def _remedies(
        self,
        chosen: Candidate,
        others: tuple[Candidate, ...],
        verdict: VehicleVerdict,
        columns: Columns,
    ) -> tuple[Remedy, ...]:
        """Fly the failing cases again with one change each, and count those that settle."""
        failing = np.flatnonzero(~np.isfinite(columns["settling_time"]))[:MOST_FLOWN]
        count, seed = self.settings.cases, self.settings.seeds.verification
        measurements = []
        target_verdict = (
            verdict if self.settings.attitude == "wanted" else replace(verdict, turn=(0, 0, 0))
        )
        changes = list(remedies(chosen, others, target_verdict))
        for place, (change, make) in enumerate(changes, 1):
            what = f"remedies, {place} of {len(changes)}: {len(failing)} cases with {change}"
            try:
                again = self.studies.settled_again(what, make(), count, seed, failing)
            except ValueError:  # a number out of its range, or a law that cannot be built for it
                continue
            measurements.append(Remedy(change, int(again.sum()), len(failing)))
        return tuple(measurements)


def _has_derivatives(scenario: Scenario) -> bool:
    """Whether gains can be tuned by derivatives, or by a `[tuning]` table that takes none."""
    return scenario.tuning is not None or not scenario.law.declaration.commands_actuators


def _up_to_enough(
    flights: Iterator[Flight], rule: WhenDecided
) -> tuple[list[Flight], Candidate | None]:
    """Return the flights up to the first sufficient law, and that law."""
    first_flights = []
    for candidate, columns in flights:
        first_flights.append((candidate, columns))
        if rule.above(*_settled_of(columns)):
            return first_flights, candidate
    return first_flights, None


def _settled_of(columns: Columns) -> tuple[int, int]:
    times = columns["settling_time"]
    return int(np.isfinite(times).sum()), len(times)


def _contenders(
    candidates: tuple[Candidate, ...], screening: Step, tuned: Tuned | None
) -> tuple[Candidate, ...]:
    """Return the candidates that may be surest by the screening's few cases, and the tuned one."""
    top = max(screening.rows, key=lambda row: (row.settled.value, -row.t50.value))
    rows = {row.setting.law: row for row in screening.rows}
    contenders = [one for one in candidates if not settles_fewer(rows[one.name], top)]
    if tuned is None or not tuned.improved:
        return tuple(contenders)
    start = tuned.candidate.name.removesuffix(TUNED)
    contenders += [one for one in candidates if one.name == start and one not in contenders]
    return (*contenders, tuned.candidate)
