"""A comparison in one call: the studies of every setting, their rows, and the verdicts."""

import tempfile
import warnings
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxsat.core.errors import JaxsatError
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import EngineName
from jaxsat.store import ResumableFolder, case_table, open_study, study_columns
from jaxsat.store.study_names import acceptance_store
from jaxsat.studies import AbstractExecutor, Study, StudyProgress, run_study
from jaxsat.synthesis.comparison.acceptance import LAWS, ComparisonSetting, comparison_scenario
from jaxsat.synthesis.comparison.studies import Start, comparison_study
from jaxsat.synthesis.comparison.verdict import (
    ComparisonRow,
    ComparisonVerdict,
    choose_laws,
    comparison_row,
)

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("settling_time", "effort", "peak_rate", "code")

Report = Callable[[str, StudyProgress | None], None]
"""Called with what runs and how far it is, None while it is being compiled."""


class UnsuitableSetting(JaxsatError, ValueError):
    """A law, or an engine for it, with which the acceptance set cannot be run."""


class Comparison(NamedTuple):
    """A row for every law, limit and level, and a verdict for every limit and level."""

    rows: Sequence[ComparisonRow]
    verdicts: Sequence[ComparisonVerdict]


def compare(
    laws: str | Iterable[str] = tuple(LAWS),
    *,
    level: str | Iterable[str] = "hard",
    torque_limit: float | int | Iterable[float | int] = 5.0,
    count: int = 200,
    seed: int = 0,
    engine: EngineName = "auto",
    executor: AbstractExecutor | None = None,
    out: str | Path | None = None,
    elsewhere: bool = False,
    report: Report = lambda what, progress: None,
) -> Comparison:
    """Compare laws on `count` cases of the acceptance set at each level and torque limit (N m).

    A law is one of `jaxsat.synthesis.comparison.LAWS` or `MORE_LAWS`, `"module:Class"`, an
    installed law, or a scenario file whose `[control]` is taken; a level is "nominal", "mc" or
    "hard". With `out` the studies are kept in that folder, as by `jaxsat compare`, and the same
    call resumes them. `engine`, `executor` and `elsewhere` are those of a study. Raises
    `ValueError` for a level, a law or an engine that there is not or that does not suit,
    `ScenarioError` for a torque limit that no scenario can have, and `OutputError` for a folder
    that cannot be used.
    """
    settings = comparison_settings(_several(laws), _several(level), _several(torque_limit))
    require_suitable(settings)
    with ExitStack() as stack:
        if out is None:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        else:
            folder = stack.enter_context(ResumableFolder(out, "comparison", {})).path
        return ComparisonRun(count, seed, folder, engine, executor, elsewhere, report).run(settings)


def comparison_settings(
    laws: Iterable[str], levels: Iterable[str], limits: Iterable[float | int]
) -> list[ComparisonSetting]:
    """Every law under every limit at every level, the laws of one of each after one another."""
    laws, levels = tuple(laws), tuple(levels)
    return [
        ComparisonSetting(level, float(limit), law)
        for limit in limits
        for level in levels
        for law in laws
    ]


def require_suitable(settings: Iterable[ComparisonSetting]) -> None:
    """Build the loops of laws that do not come with the set; raises as `compare` does."""
    for setting in settings:
        if setting.law not in LAWS:
            build(comparison_scenario(setting))


@dataclass(frozen=True)
class ComparisonRun:
    """How the studies of a comparison are run: cases and seed, the folder of their stores, and
    the options of a study.

    `remark` is called with why a study does not take an engine, `tell` with repairs of stores.
    """

    count: int
    seed: int
    folder: Path
    engine: EngineName = "auto"
    executor: AbstractExecutor | None = None
    elsewhere: bool = False
    report: Report = lambda what, progress: None
    remark: Callable[[str], None] = lambda text: None
    tell: Callable[[str], None] = warnings.warn

    def run(self, settings: Iterable[ComparisonSetting]) -> Comparison:
        """Run the studies, or what their stores lack of them.

        Raises `UnsuitableSetting` besides what `run_study` raises.
        """
        rows = [
            comparison_row(
                setting,
                self._columns(setting, Start.RANDOM, self.count),
                self._columns(setting, Start.PAPER, 1),
            )
            for setting in settings
        ]
        return Comparison(rows, choose_laws(rows))

    def _columns(
        self, setting: ComparisonSetting, start: Start, count: int
    ) -> dict[str, np.ndarray]:
        single: Any = {} if start is Start.RANDOM else {"batch_size": 1, "chunk": 1}
        try:
            study = comparison_study(setting, start, count, self.seed, engine=self.engine, **single)
        except ValueError as error:
            raise UnsuitableSetting(str(error)) from error
        level, limit, law = setting
        what = f"{law}, {limit:g} N m, {level}, {start.value} start"
        return self.columns(study, what, acceptance_store(self.folder, *setting, start.value))

    def columns(self, study: Study, what: str, store: Path) -> dict[str, np.ndarray]:
        """The `COLUMNS` of a study, which is run as far as its store lacks cases."""
        if study.remark is not None:
            self.remark(study.remark)
        self.report(what, None)
        run_study(
            study,
            store,
            executor=self.executor,
            report=lambda progress: self.report(what, progress),
            tell=self.tell,
            elsewhere=self.elsewhere,
        )
        columns = study_columns(store)
        return {name: np.asarray(columns[name][: study.count]) for name in COLUMNS}

    def table(self, settings: Iterable[ComparisonSetting]) -> "pd.DataFrame":
        """All cases that were run, a row each: law, level, torque limit, start, and `case_table`.

        Raises `OutputError` for a damaged store.
        """
        import pandas as pd  # takes its time, and few ask for a table

        parts = {
            (*setting, start.value): case_table(
                open_study(acceptance_store(self.folder, *setting, start.value)).isel(
                    case=slice(count)
                )
            )
            for setting in settings
            for start, count in ((Start.RANDOM, self.count), (Start.PAPER, 1))
        }
        names: list[Any] = ["level", "torque_limit_N_m", "law", "start", "case"]
        return pd.concat(parts, names=names).reset_index()


def _several(given: Any) -> tuple:
    return (given,) if isinstance(given, str | float | int) else tuple(given)
