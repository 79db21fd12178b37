"""A design in one call: verdict, candidates, screening, tuning, verification, and their folder."""

import json
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.assembly.study import EngineName
from jaxsat.comparison import choose_law, settles_fewer
from jaxsat.controller_design.candidates import (
    Candidate,
    Fitting,
    fitting_candidates,
    written_out,
)
from jaxsat.controller_design.completion import completed
from jaxsat.controller_design.explanation import MOST_FLOWN, Remedy, remedies, separations
from jaxsat.controller_design.files import write_files
from jaxsat.controller_design.reading import ALL
from jaxsat.controller_design.result import ControllerDesign, Step, Verification
from jaxsat.controller_design.settings import Attitude, DesignSettings
from jaxsat.controller_design.studies import Columns, Report, Studies, row_of
from jaxsat.controller_design.tuning import TUNED, Tuned, tune_candidate, tuning_table
from jaxsat.controller_design.turned import turned
from jaxsat.controller_design.vehicle import (
    Scale,
    VehicleVerdict,
    scale_of,
    vehicle_verdict,
)
from jaxsat.montecarlo import AbstractExecutor, Serial, Threads, summarise
from jaxsat.processors import processors
from jaxsat.results import OutputError, ResumableFolder
from jaxsat.results.differences import differences
from jaxsat.scenario import Scenario
from jaxsat.scenario.laws import known_law
from jaxsat.scenario.tuning_tables import TuningTable

KIND = "design"
"""Of the output folder."""

SLOWER, LESS_SURE = 1.5, 0.02
"""A candidate is worth tuning in place of the best one, which has no gains to tune, if it takes at
most this many times as long and settles at most so many fewer cases."""


def design(
    scenario: Scenario,
    *,
    law: str | None = None,
    settled: float = 0.99,
    cases: int = 2000,
    steps: int = 16,
    seed: int | None = None,
    attitude: Attitude = "wanted",
    engine: EngineName = "auto",
    executor: AbstractExecutor | None = None,
    out: str | Path | None = None,
    elsewhere: bool = False,
    timed: bool = True,
    report: Report = lambda what, progress: None,
    remark: Callable[[str], None] = lambda text: None,
) -> ControllerDesign:
    """Design a controller for the vehicle of a scenario, and verify it on cases never seen before.

    `law` is the law to design, "all" for every law of jaxsat that fits, None for the scenario's own
    ("all" if that is "coast"). At least a fraction `settled` of `cases` cases must settle; `steps`
    are those of the tuner, 0 for none. The seeds of the steps are `seed` (the scenario's own if
    left out) and the three that follow. With `attitude` "nearest" the target is the nearest
    attitude that can be held. Without `timed` the scenario's duration counts for nothing. With
    `out` the design is kept in that folder, as by `jaxsat design`, and the same call resumes it;
    `engine`, `executor` and `elsewhere` are those of a study. `report` is called with what runs
    and how far it is, `remark` with what there is to be told besides.

    Raises `ValueError` for arguments that cannot be and `OutputError` for a folder that cannot be
    used. A vehicle with nothing to design raises nothing: see `ControllerDesign.outcome`.
    """
    own = scenario.control.law
    settings = DesignSettings(
        law=(ALL if own == "coast" else own) if law is None else law,
        settled=settled,
        cases=cases,
        steps=steps,
        seed=scenario.simulation.seed if seed is None else seed,
        attitude=attitude,
        engine=engine,
    )
    _require_law(settings.law)
    identity = {"scenario": scenario.model_dump(mode="json"), "timed": timed, **settings.identity()}
    with ExitStack() as stack:
        place = out
        if place is None:
            place = Path(stack.enter_context(tempfile.TemporaryDirectory())) / KIND
        folder = stack.enter_context(_folder(place, identity))
        chosen = executor or (Threads(processors()) if processors() > 1 else Serial())
        studies = Studies(folder, engine, chosen, elsewhere, report, remark)
        found = DesignRun(scenario, settings, studies, timed).run()
        if out is not None:
            report("figures and files", None)
            write_files(found, folder)
        return found


def _folder(place: str | Path, identity: dict[str, Any]) -> ResumableFolder:
    """The folder of this design, new or to be resumed."""
    identity = json.loads(json.dumps(identity))
    folder = ResumableFolder(place, KIND, {"identity": identity})
    other = differences(folder.about["identity"], identity)
    if other:
        folder.close()
        raise OutputError(
            f"{folder.path} holds another design ({'; '.join(other)}); give another folder."
        )
    return folder


def _require_law(name: str) -> None:
    """Raise `ValueError` for a law that there is not or that aims at no attitude."""
    if name == ALL:
        return
    law = known_law(name)
    if law is None:
        raise ValueError(f"Argument `law` must be a law or all, but got {name}.")
    if not law.declaration.regulates_attitude or not law.declaration.torques:
        raise ValueError(f"Argument `law` must be one that aims at an attitude, but got {name}.")


@dataclass(frozen=True)
class DesignRun:
    """The steps of a design, each of which resumes what the folder has of it."""

    original: Scenario
    settings: DesignSettings
    studies: Studies
    timed: bool = True

    def run(self) -> ControllerDesign:
        """All steps, as far as there is something to design."""
        self.studies.report("verdict on the actuators left", None)
        verdict = vehicle_verdict(self.original)
        scenario = self._aimed(verdict)
        fitting, assumed = self._candidates(scenario, verdict)
        found = ControllerDesign(
            self.original, self.settings, verdict, assumed, fitting.candidates, fitting.left_out
        )
        if not fitting.candidates:
            return found
        screening = self._step("screening", 2, fitting.candidates)
        names = {one.name: one for one in fitting.candidates}
        best = names[screening.verdict.law or fitting.candidates[0].name]
        tuned, not_tuned = self._tuned(fitting.candidates, screening, best)
        chosen, validation = best, None
        contenders = _contenders(fitting.candidates, screening, tuned)
        if len(contenders) > 1:
            validation = self._step("validation", 4, contenders)
            by_name = {one.name: one for one in contenders}
            chosen = by_name[validation.verdict.law or best.name]
        chosen = Candidate(chosen.name, self._ready(chosen))
        others = tuple(one for one in fitting.candidates if one.name != chosen.name)
        verification = self._verification(chosen, others, verdict)
        return replace(
            found,
            chosen=chosen,
            screening=screening,
            tuned=tuned,
            not_tuned=not_tuned,
            validation=validation,
            verification=verification,
        )

    def _aimed(self, verdict: VehicleVerdict) -> Scenario:
        """The scenario with the attitude that is designed for."""
        if self.settings.attitude == "wanted" or verdict.holds or verdict.turn is None:
            return self.original
        return turned(self.original, verdict.turn)

    def _candidates(
        self, scenario: Scenario, verdict: VehicleVerdict
    ) -> tuple[Fitting, tuple[str, ...]]:
        """The laws that fit, and what was assumed of the first that does."""
        assumed: list[tuple[str, ...]] = []

        def complete(known: Scenario, scale: Scale) -> Scenario:
            made = completed(known, verdict, scale, self.timed)
            assumed.append(made.assumed)
            return made.scenario

        fitting = fitting_candidates(scenario, verdict, self.settings.law, complete)
        return fitting, assumed[0] if assumed else ()

    def _step(self, step: str, number: int, candidates: tuple[Candidate, ...]) -> Step:
        """The candidates on the same cases."""
        count = getattr(self.settings, f"{step}_cases")
        seed = getattr(self.settings.seeds, step)
        rows = []
        for one in candidates:
            what = f"step {number} of 5, {step} of {one.name}"
            columns = self.studies.columns(what, f"{step}-{one.name}", one.scenario, count, seed)
            rows.append(row_of(step, scale_of(one.scenario).torque, one.name, columns))
        torque = rows[0].setting.torque_limit
        alike = [row._replace(setting=row.setting._replace(torque_limit=torque)) for row in rows]
        return Step(tuple(alike), choose_law(alike))

    def _tuned(
        self, candidates: tuple[Candidate, ...], screening: Step, best: Candidate
    ) -> tuple[Tuned | None, str | None]:
        """The best candidate with tuned gains, or that nearly as good where it has none to tune."""
        if not self.settings.steps:
            return None, "no steps were asked for"
        rows = {row.setting.law: row for row in screening.rows}
        start = _worth_tuning(candidates, screening, best)
        if start is None:
            return None, f"{best.name} has no gains that are keys of [control]"
        if rows[start.name].settled.value == 0:
            return None, f"{start.name} settled no case, so no cost tells better gains from worse"
        table = self._tuning_table(start)
        what = f"step 3 of 5, tuning of {start.name}"
        self.studies.report(what, None)
        try:
            found = tune_candidate(
                start,
                rows[start.name],
                table,
                self.settings.seeds.tuning,
                self.studies.folder,
                elsewhere=self.studies.elsewhere,
                report=lambda progress: self.studies.report(what, progress),
            )
        except OutputError:
            raise
        except ValueError as error:
            return None, f"{start.name} cannot be tuned: {error}"
        return found, None

    def _ready(self, chosen: Candidate) -> Scenario:
        """The scenario for every command: gains written out, and how they can be tuned again."""
        scenario = written_out(chosen.scenario)
        changes: dict[str, Any] = {"title": f"{self.original.title[:150]}, designed"}
        if chosen.tunable:
            table = self._tuning_table(Candidate(chosen.name, scenario))
            changes["tuning"] = table if table.parameters else None
        return scenario.model_copy(update=changes)

    def _tuning_table(self, candidate: Candidate) -> TuningTable:
        settings, scenario = self.settings, candidate.scenario
        steps = max(1, settings.steps)
        return tuning_table(scenario, scale_of(scenario), steps, settings.validation_cases)

    def _verification(
        self, chosen: Candidate, others: tuple[Candidate, ...], verdict: VehicleVerdict
    ) -> Verification:
        """The chosen controller on unseen cases; where too few settle, why."""
        settings, count = self.settings, self.settings.cases
        seed = settings.seeds.verification
        name = f"verification-{chosen.name}"
        what = f"step 5 of 5, verification of {chosen.name}"
        columns = dict(self.studies.columns(what, name, chosen.scenario, count, seed))
        found = Verification(summarise(columns), columns)
        if found.settled.value >= settings.settled:
            return found
        two = verdict.judgement.laws == "two torques"
        return replace(
            found,
            separations=separations(chosen.scenario, columns, two),
            remedies=self._remedies(chosen, others, verdict, columns),
        )

    def _remedies(
        self,
        chosen: Candidate,
        others: tuple[Candidate, ...],
        verdict: VehicleVerdict,
        columns: Columns,
    ) -> tuple[Remedy, ...]:
        """How many of the failing cases settle with one thing changed, each flown again."""
        failing = np.flatnonzero(~np.isfinite(columns["settling_time"]))[:MOST_FLOWN]
        count, seed = self.settings.cases, self.settings.seeds.verification
        found = []
        aimed = verdict if self.settings.attitude == "wanted" else replace(verdict, turn=(0, 0, 0))
        for change, made in remedies(chosen, others, aimed):
            what = f"what would help: {len(failing)} failing cases with {change}"
            try:
                again = self.studies.settled_again(what, made(), count, seed, failing)
            except ValueError:  # a number out of its range, or a law that cannot be built for it
                continue
            found.append(Remedy(change, int(again.sum()), len(failing)))
        return tuple(found)


def _contenders(
    candidates: tuple[Candidate, ...], screening: Step, tuned: Tuned | None
) -> tuple[Candidate, ...]:
    """Those that may be the surest by the screening, whose cases are few, and the tuned one."""
    top = max(screening.rows, key=lambda row: (row.settled.value, -row.t50.value))
    rows = {row.setting.law: row for row in screening.rows}
    kept = [one for one in candidates if not settles_fewer(rows[one.name], top)]
    if tuned is None or not tuned.improved:
        return tuple(kept)
    start = tuned.candidate.name.removesuffix(TUNED)
    kept += [one for one in candidates if one.name == start and one not in kept]
    return (*kept, tuned.candidate)


def _worth_tuning(
    candidates: tuple[Candidate, ...], screening: Step, best: Candidate
) -> Candidate | None:
    """The best candidate, or the quickest that is nearly as good and has gains to tune."""
    if best.tunable:
        return best
    rows = {row.setting.law: row for row in screening.rows}
    top = rows[best.name]
    near = [
        one
        for one in candidates
        if one.tunable
        and rows[one.name].t50.value <= SLOWER * top.t50.value
        and rows[one.name].settled.value >= top.settled.value - LESS_SURE
    ]
    return min(near, key=lambda one: rows[one.name].t50.value, default=None)
