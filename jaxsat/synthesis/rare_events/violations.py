"""Cases that violate a requirement: weights, distribution, and reasons to distrust the interval."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.core.text import csv_text
from jaxsat.report.rare_event_document import PERCENTS
from jaxsat.simulation.trajectory import Outcome
from jaxsat.studies.columns import DRAWN
from jaxsat.studies.sensitivities import numbers_of
from jaxsat.studies.splitting import Level, Replications, Space
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


LEAST_ROOTS = 20
"""Least number of independent draws from which violating cases descend."""

LARGEST_SHARE, LARGEST_SPREAD = 0.5, 1.0
"""Largest share of one replication in the sum, and largest spread of estimates over the mean."""

LEAST_MOVED, LEAST_REDRAWN = 0.1, 0.02
"""Least accepted fractions of moves and of whole draws."""

COMMON, SELDOM = 0.1, 1 / 3
"""Share of the violations with one value of a quantity, and the least part of the replications that
must reach such a value."""

MOST_ENDED = 0.01
"""Largest share of the probability from cases that ended early."""


def doubts_of(
    replications: Replications,
    levels: list[Level],
    reached: bool,
    space: Space,
    flights: Batch,
    violations: Violations,
) -> list[str]:
    """Return sentences on reasons to doubt the interval; empty where there are none."""
    if not replications.probabilities.any():
        return [*_of_nothing(levels, reached), *_of_chains(replications.levels, space)]
    return [
        *([] if reached else ["The pilot run did not reach a violation."]),
        *_of_replications(replications, violations),
        *_of_chains(replications.levels, space),
        *_of_values(replications, flights, violations),
        *_of_endings(flights, violations),
    ]


def _of_nothing(levels: list[Level], reached: bool) -> Iterator[str]:
    yield "No case violates the requirement; only an upper bound is known."
    if reached:
        yield "The pilot run found violations that no replication found."
    elif not levels or not np.isfinite(levels[-1].margin):
        yield "Margins do not tell how near cases are to a violation: too few have a finite one."


def _of_replications(replications: Replications, violations: Violations) -> Iterator[str]:
    """Check that replications agree, and the number of independent draws behind them."""
    estimates = replications.probabilities
    share = estimates.max() / estimates.sum()
    if share > LARGEST_SHARE:
        yield (
            f"One of {len(estimates)} replications has {share:.0%} of the sum of all: most missed "
            "what it found, and all may have missed more."
        )
    spread = estimates.std(ddof=1) / estimates.mean()
    if spread > LARGEST_SPREAD:
        yield (
            f"One replication scatters by {spread:.2g} times the mean; use more cases a population."
        )
    roots = len(np.unique(violations.root))
    if roots < LEAST_ROOTS:
        yield (
            f"All violating cases descend from {roots} independent draws; use more cases a "
            "population or more replications."
        )


def _of_chains(levels: list[Level], space: Space) -> Iterator[str]:
    moved = min((one.moved for one in levels if one.moved == one.moved), default=1.0)
    if moved < LEAST_MOVED:
        yield f"The chains hardly move: on one level {moved:.1%} of the moves were accepted."
    redrawn = min((one.redrawn for one in levels if one.redrawn == one.redrawn), default=1.0)
    if redrawn < LEAST_REDRAWN:
        what = " or ".join(
            ["quantities that jump"] * bool(space.whole.any()) + ["sensor noise"] * space.noisy
        )
        yield (
            f"A new draw of {what} was accepted in {redrawn:.1%} of the trials on one level: "
            "chains keep those with which they began."
        )


def _of_values(replications: Replications, flights: Batch, violations: Violations) -> Iterator[str]:
    """Check that values of discrete quantities are not reached by few replications alone."""
    for column, values in flights.items():
        name = column.removeprefix(DRAWN)
        rounded = counted(name, values)
        if not column.startswith(DRAWN) or len(np.unique(rounded)) > MOST_VALUES:
            continue
        for component in rounded.reshape(len(rounded), -1)[violations.number].T:
            for value in np.unique(component):
                here = component == value
                share = violations.weight[here].sum()
                count = len(np.unique(violations.replication[here]))
                if share > COMMON and count < SELDOM * len(replications.probabilities):
                    yield (
                        f"{name} = {value:g} has {share:.0%} of the probability, but {count} of "
                        f"{len(replications.probabilities)} replications alone found it; estimate "
                        "it by itself."
                    )


def _of_endings(flights: Batch, violations: Violations) -> Iterator[str]:
    codes = flights["code"][violations.number]
    for outcome in Outcome:
        share = violations.weight[codes == int(outcome)].sum()
        if outcome is not Outcome.SUCCESS and share > MOST_ENDED:
            yield (
                f"{share:.0%} of the probability is of cases that ended early and so violate the "
                f"requirement: a case {outcome.explanation}."
            )
