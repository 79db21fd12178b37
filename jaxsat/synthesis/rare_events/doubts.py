"""Reasons to distrust the interval of a rare-event estimate."""

from collections.abc import Iterator

import numpy as np

from jaxsat.simulation.trajectory import Outcome
from jaxsat.studies.columns import DRAWN
from jaxsat.studies.splitting import Level, Replications, Space
from jaxsat.synthesis.flights import Batch
from jaxsat.synthesis.rare_events.violations import MOST_VALUES, Violations, counted

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
