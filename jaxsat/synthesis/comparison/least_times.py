"""Least times of the random starts of the acceptance set, by which settling times are judged.

They are those of plans with the whole torque, without dispersions, by `benchmarks/least_times.py`:
the best optimum that was found, which is not certified. They end where a case begins to count as
settled, as settling times do, or at rest.
"""

import json
from collections.abc import Sequence
from importlib import resources
from typing import NamedTuple

import numpy as np

from jaxsat.synthesis.bounds import End
from jaxsat.synthesis.comparison.verdict import ComparisonRow

STORED = "least_times.json"


class LeastTime(NamedTuple):
    """The median least time (s) of the starts of a comparison under one limit (N m)."""

    torque_limit: float
    median: float
    end: End = "settled"


def median_least_time(
    seed: int, torque_limit: float, count: int, end: End = "settled"
) -> float | None:
    """Of the first `count` random starts of a seed, s; None where they are not stored."""
    for table in json.loads((resources.files("jaxsat.synthesis.comparison") / STORED).read_text()):
        times = [np.inf if one is None else one for one in table["least_times_s"]]
        of_table = (table["seed"], table["torque_limit_N_m"], table["end"])
        if of_table == (seed, torque_limit, end) and 0 < count <= len(times):
            return float(np.median(times[:count]))
    return None


def least_times(rows: Sequence[ComparisonRow], seed: int, end: End = "settled") -> list[LeastTime]:
    """One for every torque limit of which the least times of the rows' starts are stored."""
    found = []
    for limit in dict.fromkeys(row.setting.torque_limit for row in rows):
        cases = next(row.cases for row in rows if row.setting.torque_limit == limit)
        median = median_least_time(seed, limit, cases, end)
        if median is not None:
            found.append(LeastTime(limit, median, end))
    return found
