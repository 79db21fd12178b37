"""Least times by which settling times on the acceptance set are judged.

`least_bounds` searches for those from the paper's start. Those of the random starts are stored:
plans with the whole torque, without dispersions, by `benchmarks/least_times.py`. Each is the best
optimum found, not a certified one. Plans end where a case counts as settled, or at rest.
"""

import json
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxsat.core.package_files import text_of
from jaxsat.scenario.build.run import build
from jaxsat.store.files import parse_json
from jaxsat.store.resumable import ResumableFolder
from jaxsat.synthesis.comparison.acceptance import ComparisonSetting, comparison_scenario, horizon
from jaxsat.synthesis.comparison.verdict import ComparisonRow
from jaxsat.synthesis.execution import Listener
from jaxsat.synthesis.optima.manoeuvre import End, manoeuvre_of
from jaxsat.synthesis.optima.run import end_data, search_bound, tolerances_at
from jaxsat.synthesis.optima.transcription import BoundObjective

STORED = "least_times.json"


class LeastTime(NamedTuple):
    """Median least time (s) of the starts of a comparison under one limit (N m)."""

    torque_limit: float
    median: float
    end: End = "settled"


def median_least_time(
    seed: int, torque_limit: float, count: int, end: End = "settled"
) -> float | None:
    """Return the median least time (s) of the first `count` random starts; None if not stored."""
    for table in json.loads(text_of("jaxsat.synthesis.comparison", STORED)):
        times = [np.inf if one is None else one for one in table["least_times_s"]]
        of_table = (table["seed"], table["torque_limit_N_m"], table["end"])
        if of_table == (seed, torque_limit, end) and 0 < count <= len(times):
            return float(np.median(times[:count]))
    return None


def least_times(rows: Sequence[ComparisonRow], seed: int, end: End = "settled") -> list[LeastTime]:
    """Return the median least time under every torque limit that has stored ones."""
    medians = []
    for limit in dict.fromkeys(row.setting.torque_limit for row in rows):
        cases = next(row.cases for row in rows if row.setting.torque_limit == limit)
        median = median_least_time(seed, limit, cases, end)
        if median is not None:
            medians.append(LeastTime(limit, median, end))
    return medians


BOUNDS = "bounds"
"""Subfolder of the bounds."""


def least_bounds(
    limit: float, starts: int, seed: int, end: End, folder: ResumableFolder, listener: Listener
) -> dict[str, Any]:
    """Return least time and effort under a torque limit (N m), kept in the folder."""
    scenario = comparison_scenario(ComparisonSetting("nominal", limit, "rate"))
    run, tolerances = build(scenario), tolerances_at(scenario, end)
    manoeuvre = manoeuvre_of(run.loop, run.start, tolerances=tolerances)
    numbers = {name: np.asarray(value).tolist() for name, value in vars(manoeuvre).items()}
    request = {"torque_limit": limit, "starts": starts, "seed": seed, "manoeuvre": numbers}
    request |= end_data(end, tolerances)
    name = f"{BOUNDS}/{limit:g}-{end}.json"
    earlier = _matching_record(folder.read(name), request)
    if earlier is not None:
        return earlier
    record: dict[str, Any] = dict(request)
    for objective in BoundObjective:
        best = search_bound(
            (run.loop, run.start),
            manoeuvre,
            objective,
            tolerances,
            starts=starts,
            longest=horizon(limit) / 5,
            seed=seed,
            report=lambda what: listener.progress(f"{limit:g} N m: {what}", None),
        )
        record[objective.value] = None if best is None else best.solution.value
    folder.write(name, json.dumps(record))
    return record


def _matching_record(content: bytes | None, request: dict[str, Any]) -> dict[str, Any] | None:
    """Return the record of an earlier search for the same request, if any."""
    record = parse_json(content)
    objectives = [one.value for one in BoundObjective]
    if not isinstance(record, dict) or set(record) != {*request, *objectives}:
        return None
    values = [record[name] for name in objectives]
    good = all(x is None or (isinstance(x, float) and 0 < x < math.inf) for x in values)
    return record if good and request.items() <= record.items() else None
