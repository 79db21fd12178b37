"""Rules on gyro, star tracker and estimator.

Of a table that is given, the keys of the table are among the values; of one that is not, the table
itself is, as None.
"""

from jaxsat.core.declaration.sensors import SENSOR_KEYS
from jaxsat.scenario.checks import is_multiple
from jaxsat.scenario.rules import at, rule
from jaxsat.scenario.wording import shown

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


def _other_noise(name: str) -> None:
    """Register that noise of `[sampling]` does not go with sensors that have their own."""

    @rule(f"sampling.{name}", "gyro.limit_rad_s")
    def _check(noise, limit):
        del limit
        if noise > 0:
            message = f"must be omitted with [gyro] and [star_tracker], got {shown(noise)}"
            yield at(f"sampling.{name}", message)


for _key in SENSOR_KEYS:
    _other_noise(_key.name)


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
