"""Statistics and costs of a law on a set of cases, and the choice of the best law."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import special

from jaxsat.core.text import number_text
from jaxsat.scenario import Scenario
from jaxsat.simulation.trajectory import Outcome
from jaxsat.studies.statistics import LEVEL, Interval, percentile, wilson
from jaxsat.synthesis.comparison.acceptance import ComparisonSetting
from jaxsat.synthesis.execution import plain_data

DAY = 86400.0


class Prices(NamedTuple):
    """Median costs over the cases that reach their end; None where the vehicle lacks the device.

    `propellant_kg_day` is kg a day at the mean use of a case, manoeuvres and failures included.
    `momentum_margin` is the part of its limit that the fullest wheel never holds, and
    `pointing_error_deg` (degree) the angle to the target attitude at the end.
    """

    propellant_kg_day: float | None = None
    momentum_margin: float | None = None
    pointing_error_deg: float | None = None


NO_PRICES = Prices()


def prices_of(scenario: Scenario, columns: Mapping[str, Any]) -> Prices:
    """Return the costs of a study of a scenario, from its columns."""
    complete = np.asarray(columns["code"]) == int(Outcome.SUCCESS)
    if not complete.any():
        return NO_PRICES

    def cases(name: str) -> np.ndarray:
        return np.asarray(columns[name], float)[complete]

    propellant, margin = None, None
    if any(one.specific_impulse_s for one in scenario.thruster):
        propellant = float(np.median(cases("propellant") / cases("ended_at"))) * DAY
    limits = [one.momentum_limit_N_m_s for one in scenario.wheel]
    if limits and all(limits):
        parts = cases("peak_wheel_momentum") / np.array(limits, float)
        margin = 1.0 - float(np.median(parts.max(axis=1)))
    return Prices(propellant, margin, float(np.median(cases("pointing_error"))))


class ScenarioSetting(NamedTuple):
    """A law in a scenario, by the scenario's title."""

    scenario: str
    law: str


class ComparisonRow(NamedTuple):
    """Results of one law on the acceptance set, or in a scenario.

    `settled` is a fraction with Wilson's interval. `t50` and `t90` (s) are the times within which
    half and nine tenths of *all* cases settle, infinite where fewer do, as is the upper end of an
    interval where too few cases settle. `effort` (N m s) is the median over the cases that did not
    diverge and `peak_rate` (rad/s) the largest, `paper_start` (s) the settling time from the
    paper's initial state, infinite if never.
    """

    setting: Any  # a ComparisonSetting or a ScenarioSetting
    cases: int
    settled: Interval
    t50: Interval
    t90: Interval
    effort: float
    peak_rate: float
    paper_start: float
    settling_times: np.ndarray
    prices: Prices = NO_PRICES

    def as_data(self) -> dict[str, Any]:
        """Convert to plain data without single times; None for infinite or unknown numbers."""
        numbers = {
            "cases": self.cases,
            "settled": self.settled,
            "t50": self.t50,
            "t90": self.t90,
            "effort_N_m_s": self.effort,
            "peak_rate_rad_s": self.peak_rate,
            "paper_start_settled_s": self.paper_start,
            "prices": self.prices,
        }
        return plain_data(self.setting._asdict() | numbers)


class ComparisonVerdict(NamedTuple):
    """The best law under one limit at one level, None where none settles, and the reason."""

    level: str
    torque_limit: float
    law: str | None
    reason: str


def comparison_row(
    setting: ComparisonSetting | ScenarioSetting,
    random: Mapping[str, Any],
    paper: Mapping[str, Any] | None = None,
    prices: Prices = NO_PRICES,
) -> ComparisonRow:
    """Return the row of one law from the columns of its studies; `paper` is optional."""
    times = np.asarray(random["settling_time"], float)
    efforts = np.asarray(random["effort"], float)
    rates = np.asarray(random["peak_rate"], float)
    return ComparisonRow(
        setting=setting,
        cases=len(times),
        settled=wilson(int(np.isfinite(times).sum()), len(times)),
        t50=percentile(times, 50.0),
        t90=percentile(times, 90.0),
        effort=_or_nan(np.median, efforts[np.isfinite(efforts)]),
        peak_rate=_or_nan(np.max, rates[np.isfinite(rates)]),
        paper_start=np.inf if paper is None else float(np.asarray(paper["settling_time"])[0]),
        settling_times=times,
        prices=prices,
    )


def choose_law(rows: Sequence[ComparisonRow]) -> ComparisonVerdict:
    """Choose among rows of one level and limit, whose cases are the same.

    A law settles significantly fewer cases than the law that settles most if, of the cases that
    only one of the two settles, more than chance allows (95 %, two-sided) are the other's:
    McNemar's exact test. Of the other laws the one with the least median is chosen, ties decided by
    the tail (t90), or of those whose times do not differ significantly from it the one with the
    least effort. Raises `ValueError` for rows of different numbers of cases.
    """
    level, limit, _ = rows[0].setting
    return ComparisonVerdict(level, limit, *chosen_law(rows))


def chosen_law(rows: Sequence[ComparisonRow]) -> tuple[str | None, str]:
    """Return the best law among rows with the same cases, and the reason; see `choose_law`."""
    if len({row.cases for row in rows}) > 1:
        raise ValueError("The rows must have the same cases, but got different numbers of them.")
    surest = max(rows, key=lambda row: (row.settled.value, -row.t50.value))
    if surest.settled.value == 0:
        return None, "no law settled a single case"
    sure = [row for row in rows if not settles_fewer(row, surest)]
    quickest = min(sure, key=_time)
    best = min(
        (row for row in sure if row is quickest or _as_quick(row, quickest)),
        key=lambda row: (np.nan_to_num(row.effort, nan=np.inf), *_time(row)),
    )
    return best.setting.law, _reason(best, surest, sure, rows)


def choose_laws(rows: Iterable[ComparisonRow]) -> list[ComparisonVerdict]:
    """Return the verdict on each group of rows of one level and limit."""
    groups: dict[tuple[str, float], list[ComparisonRow]] = {}
    for row in rows:
        groups.setdefault(row.setting[:2], []).append(row)
    return [choose_law(group) for group in groups.values()]


def _reason(
    best: ComparisonRow,
    surest: ComparisonRow,
    sure: Sequence[ComparisonRow],
    rows: Sequence[ComparisonRow],
) -> str:
    if best.cases == 1:
        flights = (f"{row.setting.law} {_flight(row)}" for row in rows if row is not best)
        return "; ".join([f"in one flight it {_flight(best)}", *flights])
    fraction = best.settled
    half = "no median settling time"
    if np.isfinite(best.t50.value):
        half = f"half within {_seconds(best.t50.value)}"
    interval = f"{fraction.low:.1%} to {fraction.high:.1%}"
    clauses = [f"it settles {fraction.value:.1%} ({interval}), {half}"]
    if best is not surest:
        clauses.append(
            f"not significantly fewer than {surest.setting.law} ({surest.settled.value:.1%})"
        )
    for row in sure:
        if row is best:
            continue
        settles = "at least as many"
        if row.settled.value < fraction.value:
            settles = f"not significantly fewer ({row.settled.value:.1%})"
        clauses.append(f"{row.setting.law} settles {settles} and takes {_seconds(row.t50.value)}")
        clauses[-1] += _quicker(best, row)
    beaten = [row for row in rows if all(row is not one for one in sure)]
    if beaten:
        names = ", ".join(f"{row.setting.law} ({row.settled.value:.1%})" for row in beaten)
        clauses.append(f"significantly fewer cases settle with {names}")
    return "; ".join(clauses)


def _flight(row: ComparisonRow) -> str:
    end = f"settles in {_seconds(row.t50.value)}" if row.settled.value else "does not settle"
    return f"{end} with an effort of {number_text(row.effort, 3)} N m s"


def settles_fewer(row: ComparisonRow, other: ComparisonRow) -> bool:
    """Whether significantly more of the cases that only one law settles are the other's."""
    one, two = (np.isfinite(each.settling_times) for each in (row, other))
    alone, others = int((one & ~two).sum()), int((two & ~one).sum())
    return bool(others > alone and _tail(alone, alone + others) < (1 - LEVEL) / 2)


def _time(row: ComparisonRow) -> tuple[float, float, float]:
    return row.t50.value, row.t90.value, -row.settled.value


def _as_quick(row: ComparisonRow, quickest: ComparisonRow) -> bool:
    """Whether neither median, cases (sign test) nor tail (t90) show that a law is slower."""
    if np.isinf(row.t50.value) and np.isfinite(quickest.t50.value):
        return False  # which few cases alone cannot show
    return not _differ(*_ahead(quickest, row)) and row.t90.value <= quickest.t90.high


def _ahead(one: ComparisonRow, other: ComparisonRow) -> tuple[int, int]:
    """Return in how many of the same cases one law is quicker, and in how many the other."""
    return (
        int((one.settling_times < other.settling_times).sum()),
        int((one.settling_times > other.settling_times).sum()),
    )


def _differ(ahead: int, behind: int) -> bool:
    """Whether the difference is significant by the exact sign test."""
    return _tail(min(ahead, behind), ahead + behind) <= (1 - LEVEL) / 2


def _quicker(best: ComparisonRow, row: ComparisonRow) -> str:
    """Return a clause on the cases in which each law is quicker, and on the other's effort."""
    ahead, behind = _ahead(best, row)
    if not _differ(ahead, behind):
        clause = " (difference in time not significant)"
        if row.effort > best.effort:
            clause += f", with {number_text(row.effort / best.effort, 3)} times the effort"
        return clause
    return f", while {best.setting.law} is quicker in {ahead} of {ahead + behind} cases"


def _tail(fewer: int, count: int) -> float:
    """Return the probability of at most `fewer` heads among `count` fair coins."""
    return float(special.bdtr(fewer, count, 0.5)) if count else 1.0


def _seconds(value: float) -> str:
    return f"{number_text(value)} s" if np.isfinite(value) else "an unknown time"


def _or_nan(statistic, values: np.ndarray) -> float:
    return float(statistic(values)) if len(values) else float("nan")
