"""`[sampling]`, or `[gyro]` and `[star_tracker]` with `[estimator]` behind them.

They stand between a sampled law and the plant. Of a table that is given, the keys of the table are
among the values that rules receive; of one that is not, the table itself is, as None.
"""

from typing import Annotated, Any, ClassVar

from annotated_types import Ge, Le
from pydantic import ConfigDict, SerializeAsAny

from jaxsat.core.declaration.keys import choice as key_choice
from jaxsat.core.declaration.keys import number
from jaxsat.core.declaration.sensors import (
    DELAY,
    HOLD_SAMPLES,
    SENSORS,
    WHITE_NOISE,
    SensorDeclaration,
)
from jaxsat.core.ranges import TRACKER_NOISE
from jaxsat.scenario.parts.named import PartTable, by_its_kind
from jaxsat.scenario.plugins import ESTIMATOR, PluginKind
from jaxsat.scenario.quantities import (
    ScenarioTable,
    Whole,
    choice,
    fields_of,
    quantity,
    table_class,
    table_with,
)
from jaxsat.scenario.rules import at, is_multiple, rule, rule_over, sampled_laws
from jaxsat.scenario.wording import shown

MAX_PERIODS = 1_000_000
"""Control periods between two measurements of a star tracker, or for which commands are held."""

ESTIMATOR_KIND = key_choice(
    "kind",
    'What the law receives: the estimates of a multiplicative extended Kalman filter ("mekf"), '
    'or what was measured last ("none")',
    ESTIMATOR.own,
    "mekf",
)

ATTITUDE_SIGMA = number(
    "attitude_sigma_rad",
    "Standard deviation of the random error of the first attitude estimate, about each axis",
    "rad",
    at_least=0,
    at_most=TRACKER_NOISE.high,
    default=0.01,
)


class SamplingTable(table_with(fields_of((*WHITE_NOISE.keys, DELAY)))):
    """`[sampling]`: what is between a sampled law and the plant."""

    hold_samples: Annotated[Whole, Ge(0), Le(MAX_PERIODS)] = quantity(
        "Samples in a row with invalid measurements for which commands are held, before they are "
        "zero",
        "1",
        HOLD_SAMPLES,
    )


def _table_of(sensor: SensorDeclaration) -> Any:
    """The class of the table of a sensor."""
    doc = f"`[{sensor.name}]`: {sensor.meaning[0].lower()}{sensor.meaning[1:]}."
    name = sensor.name.replace("_", "-")
    return table_class(name, doc, fields_of(sensor.keys), ScenarioTable, "Table")


TABLES = {one.name: (_table_of(one) | None, choice(one.meaning, None)) for one in SENSORS}
"""The table of each sensor that has one of its own, and what it means."""


class EstimatorTable(table_with(fields_of([ATTITUDE_SIGMA]), PartTable)):
    """`[estimator]`: what is made of the measurements for the law."""

    plugin: ClassVar[PluginKind] = ESTIMATOR

    kind: str = choice(
        f"{ESTIMATOR_KIND.meaning}; or an estimator that does not come with jaxsat, "
        '"module:Class" or the name of an installed one, whose keys follow',
        ESTIMATOR_KIND.default,
    )


class OwnEstimatorTable(table_with(fields_of([ESTIMATOR_KIND]), EstimatorTable)):
    """`[estimator]` of a kind that comes with jaxsat."""

    model_config = ConfigDict(extra="forbid")


EstimatorOfAKind = Annotated[
    SerializeAsAny[EstimatorTable], by_its_kind(EstimatorTable, OwnEstimatorTable)
]


MAX_LATENCY = 1000
"""Control periods until a measurement arrives; as many are waiting."""


@rule("gyro", "star_tracker.latency_s")
def _tracker_has_a_gyro(gyro, latency):
    yield at("gyro", "must be given with [star_tracker], got nothing", True)


@rule("star_tracker", "gyro.limit_rad_s")
def _gyro_has_a_tracker(tracker, limit):
    yield at("star_tracker", "must be given with [gyro], got nothing", True)


@rule("gyro", "star_tracker", "estimator.kind")
def _estimator_has_sensors(gyro, tracker, kind):
    yield at("estimator", f'must belong to [gyro] and [star_tracker], got kind "{kind}" alone')


@rule_over("gyro.limit_rad_s")
def _noise_is_that_of_the_gyro(values):
    for key in (f"sampling.{one.name}" for one in WHITE_NOISE.keys):
        if values.get(key):
            yield at(
                key, f"must be omitted with [gyro] and [star_tracker], got {shown(values[key])}"
            )


@rule("control.period_s", "star_tracker.update_period_s")
def _updates_fall_on_samples(period, update):
    if update is not None:
        yield from _whole_periods("update_period_s", update, period, MAX_PERIODS)


@rule("control.period_s", "star_tracker.latency_s")
def _arrivals_fall_on_samples(period, latency):
    if latency > 0:
        yield from _whole_periods("latency_s", latency, period, MAX_LATENCY)


def _whole_periods(name, value, period, most):
    if not is_multiple(value, period):
        message = f"must be a multiple of control.period_s = {shown(period)}, got {shown(value)}"
        yield at(f"star_tracker.{name}", message)
    elif round(value / period) > most:
        message = f"must be at most {most} times control.period_s, got {shown(value)}"
        yield at(f"star_tracker.{name}", message)


@rule("star_tracker.outage_start_s", "star_tracker.outage_s")
def _an_outage_of_the_tracker_has_begin_and_length(start, length):
    yield from _both("star_tracker", start, length)


@rule("gyro.outage_start_s", "gyro.outage_s")
def _an_outage_of_the_gyro_has_begin_and_length(start, length):
    yield from _both("gyro", start, length)


def _both(table, start, length):
    if (start is None) != (length is None):
        names = ("outage_start_s", "outage_s")
        lacking, other = names if start is None else names[::-1]
        yield at(f"{table}.{lacking}", f"must be given with {other}, got nothing", True)


@rule("star_tracker.boresight")
def _boresight_is_a_direction(boresight):
    if sum(entry * entry for entry in boresight) < 1e-12:
        yield at("star_tracker.boresight", f"must be a direction, got {shown(boresight)}")


@rule_over("control.law")
def _sensors_belong_to_a_sampled_law(values):
    law = values["control.law"]
    for table in ("sampling", *TABLES):
        present = any(key.startswith(f"{table}.") for key in values)
        if present and not law.declaration.sampled:
            yield at(table, f'must belong to a sampled law ({sampled_laws()}), got "{law}"')


@rule("control.period_s", "sampling.delay_s")
def _delay_within_a_period(period, delay):
    if delay > period:
        yield at("sampling.delay_s", f"must be at most control.period_s, got {shown(delay)}")
