"""Laws compared on the dispersed cases of any scenario, its failures in flight among them."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from jaxsat.scenario import Scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.scenario.laws import known_law, law_names
from jaxsat.store import open_study
from jaxsat.store.study_names import named_store
from jaxsat.studies import RecoverySummary
from jaxsat.studies.recovery_summary import summarise_recovery
from jaxsat.synthesis.comparison.acceptance import FILE, validated
from jaxsat.synthesis.comparison.run import ComparisonRun
from jaxsat.synthesis.comparison.verdict import (
    ComparisonRow,
    ScenarioSetting,
    chosen_law,
    comparison_row,
)


class ScenarioVerdict(NamedTuple):
    """Which law to take in a scenario, None where none settles, and why."""

    scenario: str
    law: str | None
    reason: str


class ScenarioComparison(NamedTuple):
    """A row for every law, what came of failures in flight under each (None without), a verdict."""

    rows: list[ComparisonRow]
    recoveries: list[RecoverySummary | None]
    verdict: ScenarioVerdict

    def as_data(self) -> dict[str, Any]:
        """Everything but the single times and cases, as plain data."""
        return {
            "scenario": self.verdict.scenario,
            "rows": [
                row.as_data() | ({} if found is None else {"recovered": _by_kind(found)})
                for row, found in zip(self.rows, self.recoveries, strict=True)
            ],
            "verdicts": [self.verdict._asdict()],
        }


def scenario_under(scenario: Scenario, law: str) -> Scenario:
    """The scenario under another law, without `[tuning]`.

    Keys of `[control]` that both laws have keep their values, the others of the new law have their
    defaults. `law` is a law's name, `"module:Class"`, or a scenario file whose `[control]` is
    taken. Raises `ValueError` for a law that there is not and `ScenarioError` for one that does not
    suit the scenario.
    """
    data = scenario.model_dump(exclude_none=True, exclude={"tuning"})
    if law.endswith(FILE):
        data["control"] = load(law, purpose="text").control.model_dump(exclude_none=True)
    elif law != scenario.control.law:
        found = known_law(law)
        if found is None:
            raise ValueError(
                f"Argument `law` must be one of {', '.join(law_names())}, a law of the form "
                f'"module:Class" or the name of a {FILE} file, but got {law}.'
            )
        of_law = found.declaration
        shared = {key.name for key in of_law.keys}
        shared |= {"model"} if of_law.has_model else set()
        shared |= {"measured_disturbance"} if of_law.measures_disturbance else set()
        kept = {key: value for key, value in data["control"].items() if key in shared}
        data["control"] = kept | {"law": law}
    return validated(data, f"{scenario.title}: {law}")


def compare_in_scenario(
    scenario: Scenario, laws: Iterable[str], run: ComparisonRun
) -> ScenarioComparison:
    """Run the same cases of a scenario under each law, or what the stores lack of them.

    Case i has the same spacecraft, start, failures and noise under every law. Raises as
    `scenario_under` and `run_study` do.
    """
    rows, recoveries = [], []
    for law in dict.fromkeys(laws):
        study = build_study(
            scenario_under(scenario, law), run.count, seed=run.seed, engine=run.engine
        )
        store = named_store(run.folder, law)
        columns = run.columns(study, law, store)
        rows.append(comparison_row(ScenarioSetting(scenario.title, law), columns))
        recoveries.append(summarise_recovery(open_study(store), np.arange(run.count)))
    return ScenarioComparison(rows, recoveries, ScenarioVerdict(scenario.title, *chosen_law(rows)))


def _by_kind(found: RecoverySummary) -> dict[str, Any]:
    return {
        row.kind: {
            "cases": row.cases,
            "recovered": row.settled,
            "recoverable": row.recoverable,
            "fraction": row.recovered._asdict(),
        }
        for row in found.by_kind
    }
