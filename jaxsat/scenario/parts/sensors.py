"""`[sampling]`, or `[gyro]` and `[star_tracker]` with `[estimator]` behind them.

They stand between a sampled law and the plant. Of a table that is given, the keys of the table are
among the values that rules receive; of one that is not, the table itself is, as None.
"""

from typing import Annotated, ClassVar

from pydantic import ConfigDict, SerializeAsAny

from jaxsat.core.declaration.keys import choice as key_choice
from jaxsat.core.declaration.keys import number
from jaxsat.core.ranges import (
    ATTITUDE_NOISE,
    GYRO_BIAS,
    MISALIGNMENT,
    RATE_NOISE,
    RATE_RANGE,
    SCALE_FACTOR,
    SECONDS,
    TRACKER_NOISE,
)
from jaxsat.scenario.parts.named import PartTable, by_its_kind
from jaxsat.scenario.plugins import ESTIMATOR, PluginKind
from jaxsat.scenario.quantities import choice, fields_of, table_with
from jaxsat.scenario.rules import at, is_multiple, rule, rule_over, sampled_laws
from jaxsat.scenario.wording import shown

SENSOR_KEYS = (
    number(
        "rate_noise_rad_s",
        "Standard deviation of white noise on each measured rate, a sample",
        "rad/s",
        within=RATE_NOISE,
        default=0.0,
    ),
    number(
        "attitude_noise_rad",
        "Standard deviation of the measured attitude about each body axis, a sample",
        "rad",
        within=ATTITUDE_NOISE,
        default=0.0,
    ),
)
"""White noise of `[sampling]`."""

DELAY = number(
    "delay_s",
    "Time from a sample to its torque, at most one period of the law",
    "s",
    at_least=0,
    at_most=SECONDS.high,
    default=0.0,
)

GYRO_KEYS = (
    number(
        "noise_density_rad_s_sqrt_Hz",
        "Density of the white noise on each measured rate (angle random walk)",
        "rad/s/√Hz",
        within=RATE_NOISE,
        default=0.0,
    ),
    number(
        "bias_walk_rad_s2_sqrt_Hz",
        "Density of the white noise that moves each bias (rate random walk)",
        "rad/s²/√Hz",
        within=RATE_NOISE,
        default=0.0,
    ),
    number(
        "bias_rad_s",
        "Bias at the start, of all axes or of each",
        "rad/s",
        within=GYRO_BIAS,
        size=3,
        or_one=True,
        default=0.0,
    ),
    number(
        "bias_sigma_rad_s",
        "Standard deviation of what is drawn onto each bias at the start",
        "rad/s",
        within=RATE_NOISE,
        default=0.0,
    ),
    number(
        "scale_factor",
        "Relative error of the measured rate, of all axes or of each",
        "1",
        within=SCALE_FACTOR,
        size=3,
        or_one=True,
        default=0.0,
    ),
    number(
        "misalignment_rad",
        "Small rotation of the three input axes, in body axes",
        "rad",
        within=MISALIGNMENT,
        size=3,
        default=(0.0, 0.0, 0.0),
    ),
    number(
        "limit_rad_s",
        "Largest rate that an axis can tell; by default none",
        "rad/s",
        within=RATE_RANGE,
        default=None,
    ),
)
TRACKER_KEYS = (
    number(
        "across_rad",
        "Standard deviation of the measured attitude about each direction across the boresight",
        "rad",
        within=TRACKER_NOISE,
    ),
    number(
        "along_rad",
        "Standard deviation of the measured attitude about the boresight",
        "rad",
        within=TRACKER_NOISE,
    ),
    number(
        "boresight",
        "Direction of the boresight in body axes",
        "1",
        at_least=-1e6,
        at_most=1e6,
        size=3,
        default=(0.0, 0.0, 1.0),
    ),
    number(
        "update_period_s",
        "Time between measurements, a whole multiple of control.period_s, which it is by default",
        "s",
        within=SECONDS,
        default=None,
    ),
    number(
        "latency_s",
        "Time from a measurement to its arrival, a whole multiple of control.period_s, or zero",
        "s",
        at_least=0,
        at_most=SECONDS.high,
        default=0.0,
    ),
    number(
        "rate_limit_rad_s",
        "Largest size of ω at which there are measurements; by default none",
        "rad/s",
        within=RATE_RANGE,
        default=None,
    ),
    number(
        "outage_start_s",
        "Time at which an outage begins, in which nothing is measured; by default none",
        "s",
        at_least=0,
        at_most=SECONDS.high,
        default=None,
    ),
    number(
        "outage_s",
        "Length of the outage",
        "s",
        at_least=0,
        at_most=SECONDS.high,
        default=None,
    ),
)
ESTIMATOR_KIND = key_choice(
    "kind",
    'What the law is told: the estimates of a multiplicative extended Kalman filter ("mekf"), '
    'or what was measured last ("none")',
    ESTIMATOR.own,
    "mekf",
)

ATTITUDE_SIGMA = number(
    "attitude_sigma_rad",
    "Standard deviation of what is drawn onto the first estimate of the attitude, about each axis",
    "rad",
    at_least=0,
    at_most=TRACKER_NOISE.high,
    default=0.01,
)


class SamplingTable(table_with(fields_of((*SENSOR_KEYS, DELAY)))):
    """`[sampling]`: what is between a sampled law and the plant."""


class GyroTable(table_with(fields_of(GYRO_KEYS))):
    """`[gyro]`: three rate gyros, sampled with the law."""


class StarTrackerTable(table_with(fields_of(TRACKER_KEYS))):
    """`[star_tracker]`: the attitude that a star tracker measures."""


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


MAX_PERIODS = 1_000_000
"""Control periods between two measurements of a star tracker."""

MAX_LATENCY = 1000
"""Control periods until one arrives; as many are waiting."""


@rule("gyro", "star_tracker.latency_s")
def _tracker_has_a_gyro(gyro, latency):
    del gyro, latency
    yield at("gyro", "must be given with [star_tracker], got nothing", True)


@rule("star_tracker", "gyro.limit_rad_s")
def _gyro_has_a_tracker(tracker, limit):
    del tracker, limit
    yield at("star_tracker", "must be given with [gyro], got nothing", True)


@rule("gyro", "star_tracker", "estimator.kind")
def _estimator_has_sensors(gyro, tracker, kind):
    del gyro, tracker
    yield at("estimator", f'must belong to [gyro] and [star_tracker], got kind "{kind}" alone')


@rule_over("gyro.limit_rad_s")
def _noise_is_that_of_the_gyro(values):
    for key in (f"sampling.{one.name}" for one in SENSOR_KEYS):
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
def _an_outage_has_begin_and_length(start, length):
    if (start is None) != (length is None):
        names = ("outage_start_s", "outage_s")
        lacking, other = names if start is None else names[::-1]
        yield at(f"star_tracker.{lacking}", f"must be given with {other}, got nothing", True)


@rule("star_tracker.boresight")
def _boresight_is_a_direction(boresight):
    if sum(entry * entry for entry in boresight) < 1e-12:
        yield at("star_tracker.boresight", f"must be a direction, got {shown(boresight)}")


@rule_over("control.law")
def _sensors_belong_to_a_sampled_law(values):
    law = values["control.law"]
    for table in ("sampling", "gyro", "star_tracker"):
        given = any(key.startswith(f"{table}.") for key in values)
        if given and not law.declaration.sampled:
            yield at(table, f'must belong to a sampled law ({sampled_laws()}), got "{law}"')


@rule("control.period_s", "sampling.delay_s")
def _delay_within_a_period(period, delay):
    if delay > period:
        yield at("sampling.delay_s", f"must be at most control.period_s, got {shown(delay)}")
