"""Cases that violate a requirement: weights, distribution, and number of independent ones."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.core.text import csv_text
from jaxsat.report.rare_event_document import PERCENTS
from jaxsat.studies.columns import DRAWN
from jaxsat.studies.sensitivities import numbers_of
from jaxsat.studies.splitting import Replications
from jaxsat.synthesis.flights import ROUNDED, Batch
from jaxsat.synthesis.rare_events.result import Difference

MOST_VALUES = 40
"""Largest number of values of a discrete quantity that are described by their shares."""


class Violations(NamedTuple):
    """Each violating case once: its number, weight (the sum is 1), replication and root."""

    number: Int[np.ndarray, " n"]
    weight: Float[np.ndarray, " n"]
    replication: Int[np.ndarray, " n"]
    root: Int[np.ndarray, " n"]

    @staticmethod
    def of(runs: Replications) -> "Violations":
        """Return the violating cases of the last populations, in the order of their numbers."""
        row, place = np.nonzero(runs.last.margin < 0)
        numbers, first, inverse = np.unique(
            runs.last.number[row, place], return_index=True, return_inverse=True
        )
        weight = np.bincount(inverse, runs.of_last[runs.alive[row]], len(numbers))
        row, place = row[first], place[first]
        total = weight.sum() or 1.0
        return Violations(numbers, weight / total, runs.alive[row], runs.last.root[row, place])

    def table(self, flights: Batch) -> str:
        """Return the violating cases of all `flights` as CSV, those with the least margin first."""
        columns = {
            "case": self.number,
            "replication": self.replication + 1,
            "share_of_the_probability": self.weight,
            "independent_draw": self.root,
            "margin_SI": flights["margin"][self.number],
            "decided_at_s": flights["time"][self.number],
        }
        for name, values in flights.items():
            if name.startswith(DRAWN):
                each = values.reshape(len(values), -1)[self.number].T
                names = [name] if len(each) == 1 else [f"{name}_{i + 1}" for i in range(len(each))]
                columns |= dict(zip(names, each, strict=True))
        order = np.argsort(np.nan_to_num(columns["margin_SI"], nan=-np.inf))
        rows = zip(*(values[order].tolist() for values in columns.values()), strict=True)
        return csv_text([columns, *rows])


def differences(
    flights: Batch, draws: Int[np.ndarray, " draws"], violations: Violations
) -> list[Difference]:
    """Return differences of violating cases from independent draws in each quantity, the clearest
    first; empty where none violates."""
    if not len(violations.number):
        return []
    rows = [
        _difference(name, unit, values[draws], values[violations.number], violations.weight)
        for name, unit, values in _quantities(flights)
    ]
    return sorted(rows, key=lambda one: -one.distance)


def _quantities(flights: Batch) -> Iterator[tuple[str, str, np.ndarray]]:
    for column, values in flights.items():
        if column.startswith(DRAWN):
            name = column.removeprefix(DRAWN)
            unit = DISPERSIBLE[name].unit.removesuffix("1")
            for component, numbers in numbers_of(name, values).items():
                yield component, unit, numbers


def counted(name: str, values: np.ndarray) -> np.ndarray:
    """Return the values, rounded if the quantity is discrete."""
    return np.rint(values) if name.split("[")[0] in ROUNDED else values


def _difference(
    name: str, unit: str, everywhere: np.ndarray, violating: np.ndarray, weight: np.ndarray
) -> Difference:
    everywhere, violating = counted(name, everywhere), counted(name, violating)
    order = np.argsort(violating)
    violating, weight = violating[order], weight[order]
    values, counts = np.unique(everywhere, return_counts=True)
    distance = _distance(np.sort(everywhere), violating, weight)
    if len(values) <= MOST_VALUES < len(everywhere):
        shares = [
            (float(value), float(count / len(everywhere)), float(weight[violating == value].sum()))
            for value, count in zip(values, counts, strict=True)
        ]
        return Difference(name, unit, distance, [], [], shares)
    places = np.searchsorted(np.cumsum(weight), np.array(PERCENTS) / 100)
    return Difference(
        name,
        unit,
        distance,
        np.percentile(everywhere, PERCENTS).tolist(),
        violating[np.minimum(places, len(violating) - 1)].tolist(),
        [],
    )


def _distance(everywhere: np.ndarray, violating: np.ndarray, weight: np.ndarray) -> float:
    """Return the largest difference of two distribution functions of sorted values."""
    grid = np.concatenate([everywhere, violating])
    one = np.searchsorted(everywhere, grid, "right") / len(everywhere)
    sums = np.concatenate([[0.0], np.cumsum(weight)])
    return float(np.abs(one - sums[np.searchsorted(violating, grid, "right")]).max())
