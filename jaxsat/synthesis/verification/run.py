"""A verification in one call: nominal run, studies of all conditions, and verdicts."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jaxsat.core.declaration.requirements import Inequality, comparisons
from jaxsat.report.requirements import judgements
from jaxsat.report.verification_document import failure_csv, matrix_csv
from jaxsat.scenario import Scenario, dump
from jaxsat.scenario.build.datasets import simulated_finely
from jaxsat.scenario.build.study import refined_study
from jaxsat.store.labels import named_store
from jaxsat.store.resumable import ResumableFolder
from jaxsat.studies.columns import REQUIREMENT
from jaxsat.studies.ensemble import Study
from jaxsat.studies.recovery_summary import KindRecovery, recovery_by_devices
from jaxsat.studies.statistics import WhenAllDecided, WhenDecided
from jaxsat.studies.summary import summarise_requirements
from jaxsat.studies.torques_left import TorquesLeft
from jaxsat.synthesis.execution import (
    Execution,
    Listener,
    folder_of_call,
    run_columns,
    write_record,
)
from jaxsat.synthesis.flights import require_tables
from jaxsat.synthesis.verification.conditions import Condition, conditions_of
from jaxsat.synthesis.verification.result import (
    Criterion,
    Demonstration,
    FailureRow,
    Severity,
    VerdictName,
    Verification,
)

KIND = "verification"
"""Kind of the output folder."""

MATRIX, FAILURES = "matrix.csv", "failures.csv"
NOMINAL = "nominal"

CHUNK = 256
"""Cases between two checks of the stop rule."""

Columns = Mapping[str, np.ndarray]


def verify(
    scenario: Scenario,
    *,
    fraction: float = 0.99,
    confidence: float = 0.95,
    cases: int = 20_000,
    failures: bool = True,
    pairs: bool = False,
    out: str | Path | None = None,
    execution: Execution = Execution(),
    listener: Listener = Listener(),
) -> Verification:
    """Verify the requirements of a scenario: nominal, dispersed, and with actuators that fail.

    Each condition flies at most `cases` cases, until each requirement is decided: met by at least
    `fraction` of all cases, or by less. The decision is sequential, by `WhenDecided`, and has the
    `confidence` for all requirements and conditions together. With `failures` there is one more
    condition for each kind of actuator, one of which fails, and with `pairs` one for each two
    kinds, of which two fail. With `out` the studies, the scenarios of all conditions and the
    results are kept in that folder, and the same call resumes, also with another number of cases.

    Raises `MissingTable` for a scenario without requirements or dispersions, `ArgumentError` for
    invalid numbers, `OutputError` for a folder that cannot be used, and `ValueError` for an engine
    that cannot run the studies.
    """
    demand = Criterion(fraction, confidence, cases)
    require_tables(scenario)
    conditions, not_tried = conditions_of(scenario, failures, pairs)
    rule = demand.rule(len(conditions) * len(scenario.requirement))
    studies = [_Study.of(one, demand.cases, execution, listener) for one in conditions]
    listener.approve([execution.work(one.study) for one in studies])
    shown_with = {"fraction": fraction, "confidence": confidence}  # of any number of cases
    identity = {"scenario": scenario.model_dump(mode="json"), "demand": shown_with}
    identity |= {"failures": failures, "pairs": pairs, "engine": execution.engine}
    with folder_of_call(out, KIND, identity) as folder:
        listener.progress("nominal run", None)
        evidence = list(_of_nominal(scenario, folder, listener.remark))
        rows: list[FailureRow] = []
        for one in studies:
            columns = one.columns(folder, rule, execution, listener) if one.names else {}
            again = f"jaxsat montecarlo {folder.path / one.file} --case {{}}"
            evidence += one.shown(columns, rule, again)
            rows += one.failure_rows(columns, again)
        sentences = {one.id: one.text or one.formula for one in scenario.requirement}
        result = Verification(scenario.title, demand, sentences, evidence, rows, not_tried)
        if out is not None:
            _write(folder, result)
        return result


def _of_nominal(
    scenario: Scenario, folder: ResumableFolder, tell: Callable[[str], None]
) -> Iterator[Demonstration]:
    """Judge the run of the scenario itself, with steps as fine as those of `jaxsat simulate`."""
    scenario, dataset = simulated_finely(scenario, tell)
    folder.write(f"{NOMINAL}.toml", dump(scenario))
    command = f"jaxsat simulate {folder.path / f'{NOMINAL}.toml'}"
    for one in judgements(dataset):
        verdict: VerdictName = "met" if one.met else "violated"
        verdict = "not judged" if math.isnan(one.margin) else verdict
        yield Demonstration(
            one.id, NOMINAL, _if_tried(verdict, one.margin), 1, int(one.met), None,
            one.margin, one.unit, one.signal, one.time, None, command,
        )  # fmt: skip


@dataclass(frozen=True)
class _Study:
    """The study of a condition, and its scenario with the steps that `refined_study` chooses."""

    condition: Condition
    scenario: Scenario
    study: Study

    @staticmethod
    def of(condition: Condition, count: int, execution: Execution, listener: Listener) -> "_Study":
        """Return the study of at most `count` cases."""
        listener.progress(condition.text, None)
        scenario, study = refined_study(
            condition.scenario, count, listener.remark, engine=execution.engine, chunk=CHUNK
        )
        return _Study(condition, scenario, study)

    @property
    def file(self) -> str:
        """File name of the scenario."""
        return f"{self.condition.name}.toml"

    def columns(
        self, folder: ResumableFolder, rule: WhenDecided, execution: Execution, listener: Listener
    ) -> Columns:
        """Run as many cases as decide every judged requirement; return their columns."""
        folder.write(self.file, dump(self.scenario))
        store = named_store(folder.path, self.condition.name)
        until, what = WhenAllDecided(rule), self.condition.text
        return run_columns(self.study, self.scenario, store, what, execution, listener, until=until)

    @property
    def names(self) -> tuple[str, ...]:
        """Requirements that the study judges."""
        requirements = self.study.program.requirements
        return () if requirements is None else requirements.names

    def shown(self, columns: Columns, rule: WhenDecided, again: str) -> Iterator[Demonstration]:
        """Yield the evidence of the cases on each requirement."""
        count, condition = len(columns.get("code", ())), self.condition.text
        formulas = {one.id: one.parsed for one in self.scenario.requirement}
        summaries = {}
        if columns:
            labelled = {**columns, REQUIREMENT: np.array(self.names)}
            results = summarise_requirements(labelled, np.arange(count))
            summaries = {one.name: one for one in results}
        for name, formula in formulas.items():
            one = summaries.get(name)
            if one is None:
                yield Demonstration(
                    name, condition, "not judged", 0, 0, None, math.nan, "", "", math.nan, None, ""
                )
                continue
            met = round(one.met.value * count)
            decisive = comparisons(formula)[one.comparison]
            verdict = _if_tried(_verdict(rule, met, count), one.margin)
            yield Demonstration(
                name, condition, verdict, count, met, rule.interval(met, count),
                one.margin / decisive.size, decisive.unit, decisive.signal, one.time, one.worst,
                again.format(one.worst),
            )  # fmt: skip

    def _decisive(self, columns: Columns, case: int, place: int) -> Inequality:
        """Return the comparison that decided the margin of a requirement in a case."""
        formula = next(x.parsed for x in self.scenario.requirement if x.id == self.names[place])
        return comparisons(formula)[int(columns["requirement_comparison"][case, place])]

    def failure_rows(self, columns: Columns, again: str) -> Iterator[FailureRow]:
        """Yield the outcome of each failure of each device, or of each pair of them."""
        failures = self.study.failures
        if failures is None or not columns or columns["failure_kind"].shape[1] > 2:
            return
        for device, places, one in recovery_by_devices(columns, failures.names):
            margins = columns["requirement_margin"][places]
            counts = (margins >= 0).sum(axis=0)
            fewest = int(counts.argmin())
            worst = int(places[np.argmin(np.nan_to_num(margins[:, fewest], nan=-np.inf))])
            decisive = self._decisive(columns, worst, fewest)
            torques = np.bincount(columns["torques_left"][places]).argmax()
            diagnosis, settling = one.diagnosis, one.settling_delay
            detection = {} if diagnosis is None else diagnosis.detection_delay
            yield FailureRow(
                device=device,
                failure=one.kind,
                severity=_severity(one, counts),
                cases=one.cases,
                left=TorquesLeft(torques).name.lower().replace("_", " "),
                detected=None if diagnosis is None else diagnosis.detected,
                detection_time=detection[50.0].value if detection else math.nan,
                isolated=None if diagnosis is None else diagnosis.isolated,
                recovered=one.settled,
                settling_time=settling[50.0].value if settling else math.nan,
                propellant=_median(columns, "propellant", places),
                met=dict(zip(self.names, counts.tolist(), strict=True)),
                requirement=self.names[fewest],
                margin=float(columns["requirement_margin"][worst, fewest]) / decisive.size,
                unit=decisive.unit,
                worst=worst,
                command=again.format(worst),
            )


def _severity(recovery: KindRecovery, met: np.ndarray) -> Severity:
    if recovery.settled < recovery.cases:
        return "critical"
    return "major" if np.any(met < recovery.cases) else "minor"


def _if_tried(verdict: VerdictName, margin: float) -> VerdictName:
    """Replace a verdict by "not tried" for an infinite margin: no window began."""
    return "not tried" if margin == math.inf else verdict


def _verdict(rule: WhenDecided, met: int, count: int) -> VerdictName:
    if rule.above(met, count):
        return "met"
    return "violated" if rule.met(met, count) else "undecided"


def _median(columns: Columns, name: str, places: np.ndarray) -> float:
    """Return the median total of all devices; NaN where the study has no such column."""
    if name not in columns:
        return math.nan
    return float(np.median(columns[name][places].reshape(len(places), -1).sum(axis=1)))


def _write(folder: ResumableFolder, result: Verification) -> None:
    record = write_record(folder, "jaxsat.synthesis.verification", "verification", result)
    folder.write(MATRIX, matrix_csv(record))
    if result.failures:
        folder.write(FAILURES, failure_csv(record))
