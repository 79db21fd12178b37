"""Monte-Carlo studies of a design in its folder, and re-flights of single cases."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from jaxsat.core.text import number_text
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.study import build_study
from jaxsat.store.labels import named_store
from jaxsat.store.resumable import ResumableFolder
from jaxsat.studies.executors import Serial
from jaxsat.studies.statistics import AbstractStopRule, fraction_text, percentile, wilson
from jaxsat.synthesis.comparison.acceptance import ComparisonSetting
from jaxsat.synthesis.comparison.verdict import ComparisonRow, comparison_row, prices_of
from jaxsat.synthesis.controller_design.candidates import Candidate
from jaxsat.synthesis.execution import Execution, Listener, run_columns

CHUNK = 256
"""Cases computed together: the largest loss per thread when a design is interrupted."""

RULED_CHUNK = 128
"""Cases computed together under a stop rule: 640 settled cases show 99 % of one law."""

Columns = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Studies:
    """Studies with their stores in a folder, of which only missing cases are run."""

    folder: ResumableFolder
    execution: Execution = Execution()
    listener: Listener = Listener()

    def columns(
        self,
        what: str,
        name: str,
        scenario: Scenario,
        count: int,
        seed: int,
        until: AbstractStopRule | None = None,
    ) -> Columns:
        """Return the columns of `count` cases of a scenario, or as many as `until` requires.

        `what` describes the step, `name` names the store.
        """
        self.listener.progress(what, None)
        chunk = CHUNK if until is None else RULED_CHUNK
        study = build_study(scenario, count, seed=seed, engine=self.execution.engine, chunk=chunk)
        store = named_store(self.folder.path, name)
        return run_columns(study, scenario, store, what, self.execution, self.listener, until=until)

    def settled_again(
        self, what: str, scenario: Scenario, count: int, seed: int, numbers: np.ndarray
    ) -> np.ndarray:
        """Fly these cases of a study of `count` cases in another scenario; return which settle."""
        self.listener.progress(what, None)
        study = build_study(scenario, count, seed=seed, engine=self.execution.engine)
        parts = [numbers[first : first + CHUNK] for first in range(0, len(numbers), CHUNK)]
        executor = self.execution.executor or Serial()
        times = dict(
            executor.run(lambda i: study.values(parts[i])["settling_time"], range(len(parts)))
        )
        return np.isfinite(np.concatenate([times[i] for i in range(len(parts))]))


def first_answer(name: str, columns: Columns) -> str:
    """Return a sentence on the first law in the screening, while the design goes on."""
    times = np.asarray(columns["settling_time"])
    fraction = wilson(int(np.isfinite(times).sum()), len(times))
    half = percentile(times, 50.0).value
    within = f", half within {number_text(half)} s" if np.isfinite(half) else ""
    return (
        f"first answer: {name} settles {fraction_text(fraction)} of {len(times)} unseen "
        f"cases{within}; the design continues"
    )


def row_of(step: str, torque: float, candidate: Candidate, columns: Columns) -> ComparisonRow:
    """Return the results of a candidate in one step as a row for comparison."""
    setting = ComparisonSetting(step, torque, candidate.name)
    return comparison_row(setting, columns, prices=prices_of(candidate.scenario, columns))
