"""Average run length of the one-sided CUSUM test of standard normal scores, in closed form.

g' = max(0, g + z - k), an alarm where g' > h. Siegmund, Sequential Analysis (1985), section 2.6:
the walk's overshoot over a boundary is 0.583 on average, at either end.
"""

import math

OVERSHOOT = 1.166
"""Of a walk with standard normal steps, at both boundaries together."""

SMALL = 1e-6
"""A drift below which the series takes the place of the quotient."""


def average_run_length(reference: float, threshold: float, shift: float = 0.0) -> float:
    """Mean number of scores until an alarm, for scores N(shift, 1), k and h in their sigmas.

    Without a shift it is the mean distance of false alarms, with one the detection delay.
    """
    drift, width = shift - reference, threshold + OVERSHOOT
    if abs(drift) < SMALL:
        return width**2
    return (math.expm1(-2 * drift * width) + 2 * drift * width) / (2 * drift**2)


def cusum_threshold(reference: float, run_length: float) -> float:
    """The threshold h for a mean distance of false alarms, in scores; k and h in sigmas.

    Raises `ValueError` for a distance that even h = 0 exceeds.
    """
    if not average_run_length(reference, 0.0) < run_length < math.inf:
        raise ValueError(
            "Argument `run_length` must be finite and above that of the threshold 0, "
            f"{average_run_length(reference, 0.0):.3g}, but got {run_length}."
        )
    low, high = 0.0, 1.0
    while average_run_length(reference, high) < run_length:
        high *= 2
    for _ in range(60):
        middle = (low + high) / 2
        short = average_run_length(reference, middle) < run_length
        low, high = (middle, high) if short else (low, middle)
    return high
