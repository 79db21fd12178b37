"""Times at which stored quantities, such as the momentum of a wheel, approach and reach limits."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.text import capitalised, number_text
from jaxsat.report.run_plots import part_labels
from jaxsat.store.labelled import Dataset

STORE = "disc"
"""Shape of a device that stores momentum."""

AT_LIMIT = 1 - 1e-6
"""Fraction of a limit from which a device counts as at the limit."""

MARKS = (0.9, 1.0)
"""Fractions of a limit whose first times are reported."""

TREND = 0.1
"""Largest deviation from a straight line, over its rise, for a trend."""

LEAST_RISE = 0.01
"""Least rise of a trend, over the limit, in the second half of a run."""


def first_time(
    time: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"], level: float
) -> float | None:
    """Return the first saved time (s) at which the size of `values` is at a level, or None."""
    reached = np.flatnonzero(np.abs(values) >= AT_LIMIT * level)
    return float(time[reached[0]]) if len(reached) else None


def full_at_trend(
    time: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"], limit: float
) -> float | None:
    """Extrapolate the time (s) at which the size of `values` reaches its limit.

    The trend is the least-squares line of the second half of the run; None where it does not rise,
    or does not fit.
    """
    later = time >= (time[0] + time[-1]) / 2
    if np.count_nonzero(later) < 3:
        return None
    clock, sizes = time[later] - time[-1], np.abs(values[later])
    slope, end = np.polyfit(clock, sizes, 1)
    rise = -slope * clock[0]
    if rise < LEAST_RISE * limit or np.abs(sizes - end - slope * clock).max() > TREND * rise:
        return None
    return float(time[-1] + (limit - end) / slope)


def saturation_sentences(dataset: Dataset, scenario: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence on each device that came near the limit of its storage, or soon will."""
    time = dataset["time"].values
    stores = ((kind, one) for kind in ACTUATORS for one in kind.signals if one.shape == STORE)
    for kind, signal in stores:
        if signal.name not in dataset:
            continue
        labels, tables = part_labels(dataset, signal.name), scenario.get(kind.name, ())
        for label, table, values in zip(
            labels, tables, dataset[signal.name].values.T, strict=False
        ):
            limit = table.get(signal.limit)
            text = _state(time, values, limit) if limit else ""
            if text:
                yield f"{capitalised(kind.called)} {label} {text}."


def _state(time: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"], limit: float) -> str:
    """Describe how a history approaches its limit; empty where that is far."""
    near, full = (first_time(time, values, part * limit) for part in MARKS)
    expected = full_at_trend(time, values, limit) if full is None else None
    texts = []
    if near is not None:
        texts.append(f"held 90 % of its limit from {number_text(near, 6)} s")
    if full is not None:
        texts.append(f"was full at {number_text(full, 6)} s")
    if expected is not None:
        texts.append(
            f"will be full at {number_text(expected, 3)} s by the trend of the second half"
        )
    return " and ".join(texts)
