"""Plots of a study by fractions and percentiles, whose size does not grow with the study."""

from collections.abc import Mapping

import numpy as np

from jaxsat.report.plot import Axis, Band, Bars, Line, Plot
from jaxsat.studies.statistics import fraction_text, percent_texts, wilson

EARLIEST = 10.0
"""Begin of logarithmic time axes (s), before which nothing that tumbles settles."""

POINTS, BINS = 400, 20
"""Points of a line, and bins of a quantity."""

LEAST = 10
"""Least number of cases of a bin that is drawn."""

SETTLED_VIEW = 30
"""Number of cases from which on the interval of an estimate sets the visible range."""

INTERVAL = "with its 95 % Wilson interval"
SETTLED = Axis("fraction settled", limits=(-0.02, 1.02))


def settling_plots(times: np.ndarray) -> list[Plot]:
    """Return plots of settling times (s, infinite if never), with their uncertainty."""
    plots = [settled_by(times), settling_times(times), convergence(np.isfinite(times))]
    return [plot for plot in plots if plot is not None]


def settled_by(times: np.ndarray) -> Plot | None:
    """Plot the fraction of all cases that is settled by a time; None where none settles."""
    good = np.sort(times[np.isfinite(times)])
    if not len(good):
        return None
    at = np.unique(np.quantile(good, np.linspace(0, 1, POINTS), method="inverted_cdf"))
    at = np.concatenate([[0.0], at])
    fractions = [wilson(int(n), len(times)) for n in np.searchsorted(good, at, side="right")]
    half = np.quantile(times, 0.5, method="inverted_cdf")
    middle = f", half of all cases by {half:.4g} s" if np.isfinite(half) else ""
    sentence = f"{percent_texts(fractions[-1])[0]} of the cases settle{middle}."
    title = f"Fraction settled by a time, {INTERVAL}"
    return _band_plot(title, sentence, at, np.array(fractions), _until(good), SETTLED, steps=True)


def settling_times(times: np.ndarray) -> Plot | None:
    """Plot the distribution of settling times of settled cases; None for less than two."""
    good = times[np.isfinite(times)]
    if len(good) < 2:
        return None
    heights, edges = np.histogram(good, bins=min(60, max(5, int(np.sqrt(len(good))))))
    low, middle, high = np.quantile(good, [0.1, 0.5, 0.9])
    sentence = (
        f"Of {len(good):,} settled cases, 10 % settle by {low:.4g} s, half by {middle:.4g} s, 90 % "
        f"by {high:.4g} s; {len(times) - len(good):,} cases do not settle."
    )
    title = "Settling times of settled cases"
    return Plot(title, sentence, _until(good), Axis("cases"), bars=Bars(edges, heights))


def _until(good: np.ndarray) -> Axis:
    return Axis("settling time", "s", limits=(0.0, 1.02 * float(good.max()) or 1.0))


def convergence(settled: np.ndarray) -> Plot:
    """Plot the settled fraction over the number of cases, in their order."""
    counts = np.cumsum(settled)
    at = np.unique(np.geomspace(1, len(settled), POINTS).astype(int))
    fractions = [wilson(int(counts[n - 1]), int(n)) for n in at]
    _, low, high = np.array(fractions).T
    in_view = at >= min(SETTLED_VIEW, len(settled) / 2)
    room = 0.05 * (high[in_view].max() - low[in_view].min())
    bottom, top = low[in_view].min() - room, high[in_view].max() + room
    limits = (max(-0.02, float(bottom)), min(1.02, float(top)))
    sentence = f"After {len(settled):,} cases {fraction_text(fractions[-1])}."
    title = f"Fraction settled over the number of cases, {INTERVAL}"
    x = Axis("cases", log=True, limits=(1.0, float(max(2, len(settled)))))
    y = Axis("fraction settled", limits=limits)
    return _band_plot(title, sentence, at, np.array(fractions), x, y)


def success_over(label: str, values: np.ndarray, settled: np.ndarray, unit: str) -> Plot | None:
    """Plot the fraction settled over a dispersed quantity, in bins of equally many cases."""
    parts = _bins(values)
    if not parts:
        return None
    fractions = np.array([wilson(int(settled[one].sum()), len(one)) for one in parts])
    middles = np.array([np.median(values[one]) for one in parts])
    low, high = fractions[:, 0].argmin(), fractions[:, 0].argmax()
    ends = {"Least": low, "most": high}
    clauses = [f"{k} {fractions[n, 0]:.1%} near {middles[n]:.3g} {unit}" for k, n in ends.items()]
    sentence = f"{', '.join(clauses)}."
    title = f"Fraction settled over {label}, {INTERVAL}"
    y = Axis("fraction settled")
    return _band_plot(title, sentence, middles, fractions, Axis(label, unit), y, points=True)


def settling_over(label: str, values: np.ndarray, times: np.ndarray, unit: str) -> Plot | None:
    """Plot median settling time over a dispersed quantity, with the 10 % and 90 % points."""
    good = np.isfinite(times)
    parts = _bins(values[good])
    if not parts:
        return None
    settled_values, settled_times = values[good], times[good]
    middles = np.array([np.median(settled_values[one]) for one in parts])
    points = np.array([np.quantile(settled_times[one], [0.5, 0.1, 0.9]) for one in parts])
    sentence = f"Medians from {points[:, 0].min():.4g} to {points[:, 0].max():.4g} s."
    title = f"Settling time over {label}: median, 10 % and 90 % points of settled cases"
    y = Axis("settling time", "s")
    return _band_plot(title, sentence, middles, points, Axis(label, unit), y, points=True)


def settled_by_law(
    title: str, times: Mapping[str, np.ndarray], horizon: float | None = None
) -> Plot:
    """Plot the fraction settled by a time (s, infinite if never) under each law.

    The axis ends with the `horizon` (s) or, without one, with the last case that settles. Cases
    that settle before it begins are drawn there.
    """
    shares = {}
    for law, of_law in times.items():
        good = np.maximum(np.sort(of_law[np.isfinite(of_law)]), EARLIEST)
        share = np.arange(len(good) + 1) / max(1, len(of_law))
        ends = [] if horizon is None else [horizon]
        at = np.concatenate([[EARLIEST], good, ends])
        shares[law] = (at, np.append(share, share[-1:] if ends else []))
    x = Axis("time", "s", log=True, limits=(EARLIEST, horizon))
    return curves(title, shares, x, Axis("fraction settled", limits=(-0.03, 1.03)), steps=True)


def curves(
    title: str,
    of: Mapping[str, tuple[np.ndarray, np.ndarray]],
    x: Axis,
    y: Axis,
    *,
    steps: bool = False,
) -> Plot:
    """Plot lines with individual x values, by name; no more than `MOST_LINES` differ in style."""
    sentence = []
    for label, (_, values) in of.items():
        good = values[np.isfinite(values)]
        sentence.append(f"{label}: ends at {good[-1]:.4g}" if len(good) else f"{label}: no values")
    lines = [Line(*points, label, steps=steps) for label, points in of.items()]
    return Plot(title, f"{'; '.join(sentence)}.", x, y, lines)


def _bins(values: np.ndarray) -> list[np.ndarray]:
    """Return indices of the values in bins of equally many; empty where the values do not vary."""
    if len(values) < 2 * LEAST or not np.ptp(values) > 0:
        return []
    bins = max(2, min(BINS, len(values) // (5 * LEAST)))
    edges = np.unique(np.quantile(values, np.linspace(0, 1, bins + 1)))
    places = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    parts = [np.flatnonzero(places == one) for one in range(len(edges) - 1)]
    return [part for part in parts if len(part) >= LEAST]


def _band_plot(
    title: str,
    sentence: str,
    at: np.ndarray,
    values: np.ndarray,
    x: Axis,
    y: Axis,
    *,
    steps: bool = False,
    points: bool = False,
) -> Plot:
    middle, low, high = values.T
    line = Line(at, middle, y.label, steps=steps, points=points, band=Band(low, high))
    return Plot(title, sentence, x, y, [line])
