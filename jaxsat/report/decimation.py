"""Decimation for plots: keeps the extremes of every signal in every interval."""

import numpy as np

MOST = 4000
"""Samples of a plot, about: two for each pixel of a wide screen."""


def kept_samples(signals: np.ndarray, most: int = MOST) -> np.ndarray:
    """The numbers of the samples to keep of `signals` (samples, n), about `most` of them, in order.

    Time is divided into equal numbers of samples. Of each part the first sample stays, and those at
    which a signal is smallest and largest; of all, the last one, and the last before a signal ends
    (NaN) and the first from which on it is there.
    """
    count, columns = signals.shape
    if count <= most:
        return np.arange(count)
    parts = max(1, most // (2 * columns + 1))
    begins = np.linspace(0, count, parts, endpoint=False).astype(int)
    kept = [begins, [count - 1]]
    for column in signals.T:
        there = np.isfinite(column)
        kept += [
            np.flatnonzero(there[1:] != there[:-1]),
            1 + np.flatnonzero(there[1:] != there[:-1]),
        ]
        for sign in (1, -1):
            kept.append(_places_of_largest(np.where(there, sign * column, -np.inf), begins))
    return np.unique(np.concatenate(kept))


def _places_of_largest(values: np.ndarray, begins: np.ndarray) -> np.ndarray:
    """Where in each part the largest value is."""
    ends = [*begins[1:], len(values)]
    return np.array(
        [begin + np.argmax(values[begin:end]) for begin, end in zip(begins, ends, strict=True)]
    )


def largest_of_parts(values: np.ndarray, parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Where each of about `parts` parts of the samples (n, m) begins, and its largest values."""
    begins = np.unique(
        np.linspace(0, len(values), min(parts, len(values)), endpoint=False, dtype=int)
    )
    return begins, np.fmax.reduceat(values, begins)
