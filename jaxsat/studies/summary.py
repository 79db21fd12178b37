"""The summary of a study, from its store or from its columns."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxsat.core.declaration.actuators import STUDIED
from jaxsat.simulation.trajectory import Outcome
from jaxsat.store.chunks import DONE
from jaxsat.store.labels import ATTITUDE_SENSOR, SETTLED, UNSETTLED, components
from jaxsat.studies.columns import DRAWN, ERRORS, REJECTIONS, REQUIREMENT, REQUIREMENTS, UNMADE
from jaxsat.studies.recovery_summary import RecoverySummary, summarise_recovery
from jaxsat.studies.sensitivities import Sensitivities, Sensitivity
from jaxsat.studies.statistics import Interval, percentile, wilson

PERCENTS = (50.0, 90.0, 99.0)


class RequirementSummary(NamedTuple):
    """Results of a study for one requirement.

    `met` is the fraction of cases that meet it, `worst` the case with the smallest margin, or one
    that ended before the requirement was evaluated: its `margin` (SI) is then NaN. The margin was
    decided by the `comparison` of that number at `time` (s).
    """

    name: str
    met: Interval
    worst: int
    margin: float
    comparison: int
    time: float


class SensorSummary(NamedTuple):
    """What the filters of a study did with one attitude sensor.

    Of the completed cases, `rejected` is the number of readings that they rejected in all together,
    and `excluded` the fraction in which they excluded the sensor.
    """

    name: str
    rejected: int
    excluded: Interval


class Summary(NamedTuple):
    """Results of a study.

    `settled` is a fraction; `settling_time` (s, of the settled cases) and `effort` (N m s, of the
    cases that reached their end) are by percent, empty without such cases. So are `actuators`, by
    column: the consumption of all devices together, the largest peak of any, as actuators declare,
    and the torque (N m) that they did not make, with the fraction of samples at which they did not.
    `outcomes` counts the cases by how they ended, `worst` lists case numbers, failed ones first.
    The rankings order dispersions by their effect on the cost and on settling. Intervals are of 95
    %, those of independent draws, and open (infinite) for too few cases; those of a ranking hold
    together. `recovery` is None without failures in flight. `rate_error` (rad/s) and
    `attitude_error` (rad) are the largest estimates of the integration error, None without any.
    `requirements` are those that could be evaluated. `sensors` are the attitude sensors of filters
    that test innovations.
    """

    cases: int
    settled: Interval
    settling_time: dict[float, Interval]
    effort: dict[float, Interval]
    outcomes: dict[str, int]
    worst: list[int]
    cost_sensitivity: list[Sensitivity]
    settling_sensitivity: list[Sensitivity]
    actuators: dict[str, dict[float, Interval]]
    recovery: RecoverySummary | None = None
    rate_error: float | None = None
    attitude_error: float | None = None
    requirements: Sequence[RequirementSummary] = ()
    sensors: Sequence[SensorSummary] = ()

    @property
    def ranking(self) -> list[Sensitivity]:
        """Ranking for settling, or for the cost if all cases settle or none."""
        some = 0 < self.settled.value < 1
        return self.settling_sensitivity if some else self.cost_sensitivity


def summarise(dataset: Mapping[Any, Any], count: int | None = None, worst: int = 10) -> Summary:
    """Summarise the done cases among the first `count` (all by default).

    `dataset` is that of `open_study`, or columns by name.
    """
    is_done = np.ones(dataset["code"].shape, bool)[:count]
    if "status" in dataset:
        is_done = np.asarray(dataset["status"])[:count] == DONE
    if not is_done.any():
        raise ValueError("A summary must have at least one case that is done, but got none.")

    def column(name: str) -> np.ndarray:
        return np.asarray(dataset[name])[:count][is_done]

    numbers = np.flatnonzero(is_done)
    columns = {name: column(name) for name in ("code", "settling_time", "effort", "cost")}
    settled = np.isfinite(columns["settling_time"])
    success = columns["code"] == int(Outcome.SUCCESS)
    names = [str(name) for name in dataset if str(name).startswith(DRAWN)]
    measure = Sensitivities([columns["cost"], settled])
    for name in names:  # one at a time to save memory
        measure.add(name.removeprefix(DRAWN), column(name))
    of_cost, of_settling = measure.ranked()
    errors = largest_errors({name: column(name) for name in ERRORS if name in dataset})
    return Summary(
        cases=len(numbers),
        settled=wilson(int(settled.sum()), len(numbers)),
        settling_time=_percentiles(columns["settling_time"][settled]),
        effort=_percentiles(columns["effort"][success]),
        outcomes=_outcomes(columns["code"], settled),
        worst=numbers[_worst_first(columns)[:worst]].tolist(),
        cost_sensitivity=of_cost,
        settling_sensitivity=of_settling,
        recovery=summarise_recovery(dataset, numbers),
        rate_error=errors["rate_error"],
        attitude_error=errors["attitude_error"],
        requirements=summarise_requirements(dataset, numbers),
        sensors=_of_sensors(dataset, numbers),
        actuators={
            name: _percentiles(_of_all(column(name)[success], signal.total))
            for name, (signal, _) in STUDIED.items()
            if name in dataset
        }
        | {name: _percentiles(column(name)[success]) for name in UNMADE if name in dataset},
    )


def summarise_requirements(
    dataset: Mapping[Any, Any], numbers: np.ndarray
) -> tuple[RequirementSummary, ...]:
    """Return the results for every requirement of a study, by the cases of these numbers."""
    if not set(REQUIREMENTS) <= set(dataset):
        return ()
    margins, by, at = (np.asarray(dataset[name])[numbers] for name in REQUIREMENTS)
    summaries = []
    for column, name in enumerate(_labels(dataset, "requirement_margin", REQUIREMENT)):
        worst = int(np.argmin(np.nan_to_num(margins[:, column], nan=-np.inf)))
        summaries.append(
            RequirementSummary(
                str(name),
                wilson(int((margins[:, column] >= 0).sum()), len(numbers)),
                int(numbers[worst]),
                float(margins[worst, column]),
                int(by[worst, column]),
                float(at[worst, column]),
            )
        )
    return tuple(summaries)


def _of_sensors(dataset: Mapping[Any, Any], numbers: np.ndarray) -> tuple[SensorSummary, ...]:
    """What the filters did with each attitude sensor, by the completed ones of these cases."""
    if not set(REJECTIONS) <= set(dataset):
        return ()
    both = np.stack([np.asarray(dataset[name])[numbers] for name in REJECTIONS])
    rejected, excluded = both[:, np.isfinite(both).all(axis=(0, 2))]
    names = _labels(dataset, "rejected_readings", ATTITUDE_SENSOR)
    return tuple(
        SensorSummary(str(name), int(count.sum()), wilson(int((times > 0).sum()), len(times)))
        for name, count, times in zip(names, rejected.T, excluded.T, strict=True)
        if len(times)
    )


def _labels(dataset: Mapping[Any, Any], name: str, axis: str) -> np.ndarray:
    """The labels of the second axis of a column, numbers in plain columns."""
    of_store = getattr(dataset[name], "labels", None)
    if of_store is None and axis not in dataset:
        return np.asarray(components(axis, dataset[name].shape[1]))
    return np.asarray(dataset[axis] if of_store is None else of_store(axis))


def _of_all(values: np.ndarray, total: bool) -> np.ndarray:
    """One number per case: the sum over all devices, or the largest value."""
    each = values.reshape(len(values), -1)
    return each.sum(axis=1) if total else each.max(axis=1)


def largest_errors(columns: Mapping[Any, np.ndarray]) -> dict[str, float | None]:
    """Largest estimates of the integration error, `rate_error` (rad/s) and `attitude_error` (rad),
    of all cases; None without any."""
    return {
        f"{part}_error": _largest(columns[name]) if name in columns else None
        for name, (part, _) in ERRORS.items()
    }


def _largest(values: np.ndarray) -> float | None:
    numbers = values[~np.isnan(values)]
    return float(numbers.max()) if numbers.size else None


def _percentiles(values: np.ndarray) -> dict[float, Interval]:
    return {percent: percentile(values, percent) for percent in PERCENTS} if len(values) else {}


def _outcomes(codes: np.ndarray, settled: np.ndarray) -> dict[str, int]:
    counts = {SETTLED: int(settled.sum())}
    counts[UNSETTLED] = int(((codes == int(Outcome.SUCCESS)) & ~settled).sum())
    for outcome in Outcome:
        number = int((codes == int(outcome)).sum())
        if outcome is not Outcome.SUCCESS and number:
            counts[outcome.name.lower()] = number
    return counts


def _worst_first(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Order from the worst on: failed, then not settled, then slow; ties by higher cost."""
    failed = columns["code"] != int(Outcome.SUCCESS)
    cost = np.nan_to_num(columns["cost"], nan=np.inf)
    return np.lexsort((-cost, -columns["settling_time"], ~failed))
