"""Document and plots of the probability of violating a requirement, from `rare-event.json`."""

from collections.abc import Iterator

import numpy as np

from jaxsat.core.text import number_text
from jaxsat.report.document import (
    Block,
    Cell,
    Document,
    Facts,
    Lines,
    Record,
    Shown,
    Table,
    Verdict,
)
from jaxsat.report.plot import Axis, Line, Plot
from jaxsat.studies.statistics import Interval

FIRST = 8
"""Number of quantities that text shows."""

MIDDLE, LOW, HIGH = 4, 1, 7
"""Indices of the median and of the 5th and 95th percentile."""


def rare_event_document(record: Record) -> Document:
    """Return the document: probability, doubts, levels, and where cases violate.

    Raises `KeyError` or `TypeError` for a record of another form.
    """
    blocks: list[Block] = [Facts("Estimate", dict(_facts(record)))]
    if record["doubts"]:
        blocks.append(Lines("Why the interval may not hold", record["doubts"]))
    blocks.append(_levels(record))
    if record["differences"]:
        blocks.append(_differences(record))
    title = f"Rare event: {record['title']}, {record['requirement']}"
    return Document(title, _verdict(record), blocks)


def _verdict(record: Record) -> Verdict:
    probability, settings = Interval(**record["probability"]), record["settings"]
    confidence = f"{100 * settings['confidence']:.6g} %"
    how = f"probability {probability_text(probability)}"
    if probability.value == 0:
        how = f"a probability below {probability.high:.2g}"
    trust = (
        "It may not hold, for the reasons below."
        if record["doubts"]
        else "Nothing speaks against it."
    )
    text = f"{record['requirement']} is violated with {how}."
    return Verdict(None, text, [f"The interval is of {confidence}. {trust}"])


def _facts(record: Record) -> Iterator[tuple[str, str]]:
    settings = record["settings"]
    yield "requirement", record["sentence"]
    yield (
        "replications",
        f"{settings['replications']} with {settings['cases']:,} cases of each level: "
        + ", ".join(f"{one:.2g}" for one in record["estimates"]),
    )
    yield "flights", f"{record['flights']:,}"
    descent = f"which descend from {record['independent']} independent draws"
    yield "violating flights", f"{record['violating']:,}, in violations.csv, {descent}"
    if record["worst"] is not None:
        margin = "none, it ended early"
        if record["margin"] is not None:
            margin = f"{number_text(record['margin'])} {record['unit']}"
        yield "least margin", f"{margin}; `{record['again']}` flies it again"


def _levels(record: Record) -> Table:
    unit = record["unit"] or "1"
    rows: list[list[Cell]] = [
        [
            Shown("none" if one["margin"] is None else number_text(one["margin"]), one["margin"]),
            Shown(f"{one['probability']:.3g}", one["probability"]),
            _percent(one["moved"]),
            _percent(one["redrawn"]),
        ]
        for one in record["levels"]
    ]
    note = (
        "The mean probability of a margin at most as large. On the way to the next level chains "
        "accepted these parts of their moves, and of the trials to draw again what does not move."
    )
    columns = [f"margin ({unit})", "probability", "moves accepted", "new draws accepted"]
    return Table("Levels", columns, rows, note)


def _percent(fraction: float | None) -> Cell:
    return None if fraction is None else Shown(f"{fraction:.1%}", fraction)


def _differences(record: Record) -> Table:
    rows = [list(_difference_cells(one)) for one in record["differences"]]
    note = (
        "Medians with 5th and 95th percentiles, or the commonest values with their shares. The "
        "distance is the largest difference of the two distribution functions; one below "
        f"{chance_distance(record):.2f} may be chance."
    )
    columns = ["quantity", "all cases", "violating cases", "distance"]
    return Table("Where cases violate", columns, rows, note, FIRST)


def _difference_cells(one: Record) -> Iterator[Cell]:
    unit = f" ({one['unit']})" if one["unit"] else ""
    yield one["quantity"] + unit
    if one["shares"]:
        commonest = sorted(one["shares"], key=lambda share: -share[2])[:3]
        yield _shares(commonest, 1)
        yield _shares(commonest, 2)
    else:
        yield _percentiles(one["everywhere"])
        yield _percentiles(one["violating"])
    yield Shown(f"{one['distance']:.2f}", one["distance"])


def _percentiles(values: list[float]) -> str:
    middle, low, high = (number_text(values[place], 3) for place in (MIDDLE, LOW, HIGH))
    return f"{middle} ({low} to {high})"


def _shares(shares: list[list[float]], column: int) -> str:
    return ", ".join(f"{number_text(one[0])}: {one[column]:.0%}" for one in shares)


SHOWN = 2
"""Number of quantities whose distributions are shown."""

PERCENTS = (1.0, 5.0, 10.0, 25.0, 50.0, 75.0, 90.0, 95.0, 99.0)
"""Percentiles that describe a distribution."""


def rare_event_plots(record: Record) -> list[Plot]:
    """Return the plots of an estimate; raises `KeyError` or `TypeError` for another record."""
    return [_level_plot(record), *map(_distributions, _decisive(record))]


def chance_distance(record: Record) -> float:
    """Return the distance by which violating cases differ by chance in one quantity of 20.

    It is approximate: N. Smirnov, Ann. Math. Stat. 19, 1948, for as many cases as are independent.
    """
    return 1.36 / np.sqrt(max(record["independent"], 1))


def probability_text(interval: Interval) -> str:
    """Format a probability with its interval, "1.02e-06 (0.81e-06 to 1.3e-06)"."""
    return f"{interval.value:.3g} ({interval.low:.3g} to {interval.high:.3g})"


def _level_plot(record: Record) -> Plot:
    """Plot the probability of not exceeding each margin, in every replication."""
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
    """Return the quantities with percentiles in which violating cases differ beyond chance."""
    least = chance_distance(record)
    rows = [one for one in record["differences"] if one["everywhere"] and one["distance"] > least]
    return rows[:SHOWN]


def _distributions(one: Record) -> Plot:
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
    """Replace values that a logarithmic axis cannot show by NaN."""
    return np.where(values > 0, values, np.nan)
