"""A comparison in one call: the studies of every setting, their rows, and the verdicts."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jaxsat.core.declaration.settling import TUNED_LIMITS
from jaxsat.core.errors import JaxsatError
from jaxsat.scenario.build.run import build
from jaxsat.store.labels import acceptance_store
from jaxsat.store.provenance import record_of
from jaxsat.store.resumable import ResumableFolder
from jaxsat.store.tables import case_table, open_study
from jaxsat.studies.work import Work
from jaxsat.synthesis.comparison.acceptance import (
    LAWS,
    PERIOD,
    ComparisonSetting,
    Start,
    comparison_scenario,
    comparison_study,
    horizon,
)
from jaxsat.synthesis.comparison.least_times import LeastTime, least_bounds, least_times
from jaxsat.synthesis.comparison.verdict import (
    ComparisonRow,
    ComparisonVerdict,
    choose_laws,
    comparison_row,
)
from jaxsat.synthesis.execution import Execution, Listener, folder_of_call, run_columns
from jaxsat.synthesis.optima.manoeuvre import End

if TYPE_CHECKING:
    import pandas as pd

KIND = "comparison"
"""Kind of the output folder."""

CASE = 400
"""Approximate bytes of a case in memory and on disk."""


class UnsuitableSetting(JaxsatError, ValueError):
    """An engine that cannot run a law on the acceptance set."""


class UnsuitableLaw(JaxsatError, ValueError):
    """A law that is unknown or cannot fly the cases."""


class Comparison(NamedTuple):
    """A row for every law, limit and level, and a verdict for every limit and level.

    `bounds` are the least time and effort from the paper's start under every limit, if requested,
    and `least_times` the medians of the starts as far as they are stored.
    """

    rows: Sequence[ComparisonRow]
    verdicts: Sequence[ComparisonVerdict]
    bounds: Sequence[dict[str, Any]] = ()
    least_times: Sequence[LeastTime] = ()

    def as_data(self) -> dict[str, Any]:
        """Convert everything but single times to plain data."""
        return {
            "rows": [row.as_data() for row in self.rows],
            "verdicts": [one._asdict() for one in self.verdicts],
            "bounds_from_papers_start": list(self.bounds),
            "median_least_times": [
                {"torque_limit": one.torque_limit, "end": one.end, "seconds": one.median}
                for one in self.least_times
            ],
        }

    def table(self, folder: str | Path) -> "pd.DataFrame":
        """Return a row per case in the folder: setting, start, and the columns of `case_table`.

        Raises `OutputError` for a damaged store.
        """
        import pandas as pd  # takes its time, and few ask for a table

        settings: list[Any] = [row.setting for row in self.rows]
        parts = {
            (level, limit, law, start.value): case_table(
                open_study(acceptance_store(Path(folder), level, limit, law, start.value)).isel(
                    case=slice(count)
                )
            )
            for level, limit, law in settings
            for start, count in ((Start.RANDOM, self.rows[0].cases), (Start.PAPER, 1))
        }
        names: list[Any] = ["level", "torque_limit_N_m", "law", "start", "case"]
        return pd.concat(parts, names=names).reset_index()


def compare(
    laws: str | Iterable[str] = tuple(LAWS),
    *,
    level: str | Iterable[str] = "hard",
    torque_limit: float | int | Iterable[float | int] = 5.0,
    count: int = 200,
    seed: int = 0,
    bounds: int = 0,
    end: End = "settled",
    out: str | Path | None = None,
    execution: Execution = Execution(),
    listener: Listener = Listener(),
) -> Comparison:
    """Compare laws on `count` cases of the acceptance set at each level and torque limit (N m).

    A law is one of `LAWS` or `MORE_LAWS` of `jaxsat.synthesis.comparison.acceptance`,
    `"module:Class"`, an installed law, or a scenario file whose `[control]` is used; a level is
    "nominal", "mc" or "hard". `bounds` starts search for the least time and effort from the paper's
    start; they and the least times end where `end` says. With `out` the studies, the record and the
    figure are kept in that folder, as by `jaxsat compare`, and the same call resumes them. Raises
    `UnsuitableLaw`, `UnsuitableSetting`, `ValueError` for an unknown level, `ScenarioError` for a
    torque limit that no scenario can have, and `OutputError` for a folder that cannot be used.
    """
    limits = tuple(map(float, _several(torque_limit)))
    settings = comparison_settings(_several(laws), _several(level), limits)
    require_suitable(settings)
    _tell_of_untuned(limits, listener)
    listener.approve([_work(one, count) for one in settings])
    with folder_of_call(out, KIND) as folder:
        run = ComparisonRun(count, seed, folder.path, execution, listener)
        rows = run.rows(settings)
        least = [least_bounds(one, bounds, seed, end, folder, listener) for one in limits if bounds]
        comparison = Comparison(rows, choose_laws(rows), least, least_times(rows, seed, end))
        if out is not None:
            data = {"seed": seed, **comparison.as_data()}
            write_comparison(folder, data, lambda: acceptance_figures(rows))
        return comparison


def comparison_settings(
    laws: Iterable[str], levels: Iterable[str], limits: Iterable[float | int]
) -> list[ComparisonSetting]:
    """Return every law under every limit at every level, laws varying fastest."""
    laws, levels = tuple(laws), tuple(levels)
    return [
        ComparisonSetting(level, float(limit), law)
        for limit in limits
        for level in levels
        for law in laws
    ]


def require_suitable(settings: Iterable[ComparisonSetting]) -> None:
    """Build the loops of laws outside `LAWS`; raises as `compare` does."""
    for setting in settings:
        if setting.law not in LAWS:
            try:
                build(comparison_scenario(setting))
            except ValueError as error:
                raise UnsuitableLaw(str(error)) from error


def _tell_of_untuned(limits: Sequence[float], listener: Listener) -> None:
    tuned_limits = ", ".join(f"{one:g}" for one in TUNED_LIMITS)
    for limit in limits:
        if limit not in TUNED_LIMITS:
            inside = min(TUNED_LIMITS) < limit < max(TUNED_LIMITS)
            how = "interpolated" if inside else "those of the nearest"
            listener.warn(f"gains are tuned for {tuned_limits} N m, for {limit:g} N m {how}")


def _work(setting: ComparisonSetting, count: int) -> Work:
    steps = round(horizon(setting.torque_limit) / PERIOD)
    return Work(count + 1, (count + 1) * steps, count * CASE, count * CASE)


@dataclass(frozen=True)
class ComparisonRun:
    """Execution of a comparison: cases, seed, and the folder of the stores."""

    count: int
    seed: int
    folder: Path
    execution: Execution = Execution()
    listener: Listener = Listener()

    def rows(self, settings: Iterable[ComparisonSetting]) -> list[ComparisonRow]:
        """Run the missing cases of the studies, and return their rows.

        Raises `UnsuitableSetting`, and as `run_study` does.
        """
        return [
            comparison_row(
                setting,
                self._columns(setting, Start.RANDOM, self.count),
                self._columns(setting, Start.PAPER, 1),
            )
            for setting in settings
        ]

    def _columns(
        self, setting: ComparisonSetting, start: Start, count: int
    ) -> dict[str, np.ndarray]:
        single: Any = {} if start is Start.RANDOM else {"batch_size": 1, "chunk": 1}
        engine = self.execution.engine
        try:
            study = comparison_study(setting, start, count, self.seed, engine=engine, **single)
        except ValueError as error:
            raise UnsuitableSetting(str(error)) from error
        level, limit, law = setting
        what = f"{law}, {limit:g} N m, {level}, {start.value} start"
        store = acceptance_store(self.folder, *setting, start.value)
        scenario = comparison_scenario(setting)
        return run_columns(study, scenario, store, what, self.execution, self.listener)


def _several(values: Any) -> tuple:
    return (values,) if isinstance(values, str | float | int) else tuple(values)


if TYPE_CHECKING:
    from matplotlib.figure import Figure

RECORD = "comparison.json"

Panel = tuple[str, float | None]
"""Level and torque limit (N m) of a panel of the figure."""


def write_comparison(
    folder: ResumableFolder, data: Mapping[str, Any], figures: "Callable[[], dict[str, Figure]]"
) -> None:
    """Write the record with its provenance as JSON, and the figures; raises `OutputError`."""
    from jaxsat.report.saving import save_figures

    text = json.dumps(record_of(data), indent=2, ensure_ascii=False, allow_nan=False)
    folder.write(RECORD, text + "\n")
    save_figures(figures, folder.write)


def acceptance_figures(rows: Sequence[ComparisonRow]) -> "dict[str, Figure]":
    """Plot settling times on the acceptance set, a panel for every limit and level."""
    from jaxsat.report.comparison_figures import settling_comparison

    panels: dict[Panel, dict[str, Any]] = {}
    for row in rows:
        panels.setdefault(row.setting[:2], {})[row.setting.law] = row.settling_times
    horizons = {row.setting[:2]: horizon(row.setting.torque_limit) for row in rows}
    title = "Three axes with two torques, third rate free"
    return {"comparison": settling_comparison(panels, horizons, title)}


def scenario_figures(
    title: str, duration: float, rows: Sequence[ComparisonRow], recoveries: Mapping[str, Any]
) -> "dict[str, Figure]":
    """Plot settling times in a scenario of `duration` s, and recoveries under each law."""
    from jaxsat.report.comparison_figures import recovery_comparison, settling_comparison

    panel: Panel = ("the same cases under every law", None)
    times = {row.setting.law: row.settling_times for row in rows}
    figures = {"comparison": settling_comparison({panel: times}, {panel: duration}, title)}
    if recoveries:
        figures["recovered"] = recovery_comparison(recoveries, title)
    return figures
