"""Plots of a rare event: how its probability falls with the margin, and where cases violate."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxsat.report.plot import Axis, Line, Plot
from jaxsat.studies.statistics import Interval

Record = Mapping[str, Any]

SHOWN = 2
"""Quantities whose distributions are shown."""

PERCENTS = (1.0, 5.0, 10.0, 25.0, 50.0, 75.0, 90.0, 95.0, 99.0)


def rare_event_plots(record: Record) -> list[Plot]:
    """Plots of the record of an estimate; raises `KeyError` or `TypeError` for another form."""
    return [_levels(record), *map(_distributions, _decisive(record))]


def chance_distance(record: Record) -> float:
    """The distance that the violating cases have to all by chance in one quantity of 20, about.

    N. Smirnov, Ann. Math. Stat. 19, 1948, for as many cases as are independent.
    """
    return 1.36 / np.sqrt(max(record["independent"], 1))


def probability_text(interval: Interval) -> str:
    """A probability with its interval, "1.02e-06 (0.81e-06 to 1.3e-06)"."""
    return f"{interval.value:.3g} ({interval.low:.3g} to {interval.high:.3g})"


def _levels(record: Record) -> Plot:
    """How probable each margin is not to be exceeded, in every replication."""
    rows = [one for one in record["levels"] if one["margin"] is not None]
    margins = np.array([one["margin"] for one in rows])
    fractions = np.array([one["fractions"] for one in rows])
    probabilities = np.cumprod(fractions, axis=0)
    means = np.array([one["probability"] for one in rows])
    lines = [Line(margins, _positive(one), faint=True) for one in probabilities.T]
    lines.append(Line(margins, _positive(means), "mean of all replications", points=True))
    unit = record["unit"]
    return Plot(
        "Probability of a margin at most as large",
        f"Violated with probability {probability_text(Interval(**record['probability']))}.",
        Axis("margin", unit),
        Axis("probability", log=True),
        lines,
    )


def _decisive(record: Record) -> list[Record]:
    """The quantities in which violating cases surely differ most, of those with percentiles."""
    least = chance_distance(record)
    rows = [one for one in record["differences"] if one["everywhere"] and one["distance"] > least]
    return rows[:SHOWN]


def _distributions(one: Record) -> Plot:
    """The distribution of a quantity in all cases, and in those that violate."""
    percents = np.array(PERCENTS)
    lines = [
        Line(np.array(one[key]), percents, label, points=True)
        for key, label in (("everywhere", "all cases"), ("violating", "violating cases"))
    ]
    axis = Axis(one["quantity"], one["unit"])
    sentence = f"The distributions differ by at most {one['distance']:.0%}."
    return Plot(
        f"Where cases violate: {one['quantity']}", sentence, axis, Axis("cases below", "%"), lines
    )


def _positive(values: np.ndarray) -> np.ndarray:
    """The values, without those that a logarithmic axis does not have."""
    return np.where(values > 0, values, np.nan)
