"""Laws compared on the dispersed cases of any scenario, with its failures in flight."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxsat.scenario import Scenario, ScenarioError
from jaxsat.scenario.build.actuator_set import fitting_laws, judge_scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import refined_study
from jaxsat.scenario.control import law_names, required_law
from jaxsat.scenario.dispersion_tables import DispersionTable
from jaxsat.store.labels import named_store
from jaxsat.store.resumable import ResumableFolder
from jaxsat.store.tables import open_study
from jaxsat.studies.ensemble import Study
from jaxsat.studies.recovery_summary import RecoverySummary, summarise_recovery
from jaxsat.synthesis.comparison.acceptance import FILE, validated
from jaxsat.synthesis.comparison.run import (
    KIND,
    UnsuitableLaw,
    scenario_figures,
    write_comparison,
)
from jaxsat.synthesis.comparison.verdict import (
    ComparisonRow,
    ScenarioSetting,
    chosen_law,
    comparison_row,
    prices_of,
)
from jaxsat.synthesis.controller_design.candidates import SLOW_LAWS, usual_control
from jaxsat.synthesis.execution import Execution, Listener, folder_of_call, run_columns

ALL = "all"
"""Name for the scenario's own law and all others that fit its actuators."""


class ScenarioVerdict(NamedTuple):
    """The best law in a scenario, None where none settles, and the reason."""

    scenario: str
    law: str | None
    reason: str


class ScenarioComparison(NamedTuple):
    """A row for every law, its recoveries from failures in flight (None without), and a verdict."""

    rows: list[ComparisonRow]
    recoveries: list[RecoverySummary | None]
    verdict: ScenarioVerdict

    def as_data(self) -> dict[str, Any]:
        """Convert everything but single times and cases to plain data."""
        return {
            "scenario": self.verdict.scenario,
            "rows": [
                row.as_data() | ({} if recovery is None else {"recovered": _by_kind(recovery)})
                for row, recovery in zip(self.rows, self.recoveries, strict=True)
            ],
            "verdicts": [self.verdict._asdict()],
        }


def scenario_under(scenario: Scenario, law: str) -> Scenario:
    """Return the scenario under another law, without `[tuning]`.

    Keys of `[control]` that both laws have keep their values, the others of the new law have their
    defaults. Where one of these lacks a default, they all have the values that `design` begins
    with: gains, limits and period are scaled together. A sampled law in place of a continuous one,
    or the reverse, has the default solver. `law` is a law's name, `"module:Class"`, or a scenario
    file whose `[control]` is used.

    Raises `ValueError` for an unknown law and `ScenarioError` for one that does not suit.
    """
    data = scenario.model_dump(exclude_none=True, exclude={"tuning"})
    if law.endswith(FILE):
        data["control"] = load(law, purpose="text").control.model_dump(exclude_none=True)
    elif law != scenario.control.law:
        of_law = required_law(
            law,
            f'one of {", ".join(law_names())}, a law of the form "module:Class" or the name of a '
            f"{FILE} file",
        ).declaration
        shared_keys = {key.name for key in of_law.keys}
        shared_keys |= {"model"} if of_law.has_model else set()
        shared_keys |= {"measured_disturbance"} if of_law.measures_disturbance else set()
        shared_values = {key: value for key, value in data["control"].items() if key in shared_keys}
        needed_keys = {key.name for key in of_law.keys if key.default is ...} - shared_values.keys()
        usual_values = usual_control(scenario, law) if needed_keys else {}
        data["control"] = usual_values | shared_values | {"law": law}
        if of_law.sampled != scenario.law.declaration.sampled:
            data["simulation"].pop("solver", None)
    return validated(data, f"{scenario.title}: {law}")


def compare_in_scenario(
    scenario: Scenario,
    laws: Iterable[str] = (ALL,),
    *,
    count: int = 200,
    seed: int = 0,
    out: str | Path | None = None,
    execution: Execution = Execution(),
    listener: Listener = Listener(),
) -> ScenarioComparison:
    """Run the same `count` cases of a scenario under each law, and compare the laws.

    Case i has the same spacecraft, start, failures and noise under every law. A scenario without
    dispersions has one case. The law "all" stands for the scenario's own and the others that fit
    its actuators, as in `design`; the listener gets the reason for each omission. With `out` the
    studies, the record and the figures are kept in that folder, as by `jaxsat compare`, and the
    same call resumes them. Raises `UnsuitableLaw`, and as `scenario_under` and `run_study` do.
    """
    if scenario.dispersion is None:
        scenario, count = scenario.model_copy(update={"dispersion": DispersionTable()}), 1  # pyright: ignore[reportCallIssue]
        listener.remark("no [dispersion] in the scenario: one flight of each law, from [initial]")
    keys: dict[str, Any] = {"seed": seed, "engine": execution.engine}
    studies = dict(_studies(scenario, laws, count, listener.remark, **keys))
    if len(studies) == 1:
        (law,) = studies
        listener.remark(f"{law} flies alone: no other law was given that suits the scenario")
    listener.approve([execution.work(study) for _, study in studies.values()])
    with folder_of_call(out, KIND) as folder:
        rows, recoveries = [], []
        for law, (under, study) in studies.items():
            store = named_store(folder.path, law)
            columns = run_columns(study, under, store, law, execution, listener)
            setting, prices = ScenarioSetting(scenario.title, law), prices_of(under, columns)
            rows.append(comparison_row(setting, columns, prices=prices))
            recoveries.append(summarise_recovery(open_study(store), np.arange(count)))
        verdict = ScenarioVerdict(scenario.title, *chosen_law(rows))
        comparison = ScenarioComparison(rows, recoveries, verdict)
        if out is not None:
            _write(folder, scenario, comparison, seed)
        return comparison


def _studies(
    scenario: Scenario, laws: Iterable[str], count: int, tell: Callable[[str], None], **keys: Any
) -> Iterator[tuple[str, tuple[Scenario, Study]]]:
    """Yield name, scenario and study of each law; a law of `ALL` that does not suit is left out."""
    named_laws, own = dict.fromkeys(laws), scenario.control.law
    fitting: list[str] = []
    if ALL in named_laws:
        del named_laws[ALL]
        fitting = [own, *fitting_laws(scenario, judge_scenario(scenario))]
    for law in dict.fromkeys([*fitting, *named_laws]):
        optional = law != own and law not in named_laws
        if optional and law in SLOW_LAWS:
            tell(f"{law} is left out: it takes many minutes; name it to include it")
            continue
        try:
            study = _study(scenario, law, count, tell, **keys)
        except (ScenarioError, UnsuitableLaw) as error:
            if not optional:
                raise
            tell(f"left out: {'; '.join(str(error).splitlines())}")
        else:
            yield law, study


def _study(
    scenario: Scenario, law: str, count: int, tell: Callable[[str], None], **keys: Any
) -> tuple[Scenario, Study]:
    """Return scenario and study of a law, with the steps that `refined_study` chooses."""
    try:
        return refined_study(scenario_under(scenario, law), count, tell, **keys)
    except ValueError as error:
        raise UnsuitableLaw(str(error)) from error


def _write(
    folder: ResumableFolder, scenario: Scenario, comparison: ScenarioComparison, seed: int
) -> None:
    data = {"seed": seed, **comparison.as_data()}
    recoveries = {row["law"]: row["recovered"] for row in data["rows"] if "recovered" in row}
    title, duration = scenario.title, scenario.simulation.duration_s
    write_comparison(
        folder, data, lambda: scenario_figures(title, duration, comparison.rows, recoveries)
    )


def _by_kind(summary: RecoverySummary) -> dict[str, Any]:
    return {
        row.kind: {
            "cases": row.cases,
            "recovered": row.settled,
            "recoverable": row.recoverable,
            "fraction": row.recovered._asdict(),
        }
        for row in summary.by_kind
    }
