"""`[sampling]`, or `[gyro]` and attitude sensors with an `[estimator]`.

They are between the plant and a sampled law. If such a table is given, rules receive the values of
its keys; if not, they receive the table itself, as None.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from annotated_types import Ge, Le
from pydantic import ConfigDict, SerializeAsAny

from jaxsat.core.declaration.disturbances import needs_orbit
from jaxsat.core.declaration.keys import choice as key_choice
from jaxsat.core.declaration.keys import number
from jaxsat.core.declaration.sensors import (
    ATTITUDE_SENSORS,
    DELAY,
    HOLD_SAMPLES,
    PATIENCE,
    PROBATION,
    SENSORS,
    WHITE_NOISE,
    SensorDeclaration,
)
from jaxsat.core.earth import EARTH_GRAVITY
from jaxsat.core.ranges import PROBABILITY, TRACKER_NOISE
from jaxsat.scenario.errors import Issue
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
from jaxsat.scenario.rules import (
    Values,
    at,
    is_multiple,
    outage_mistakes,
    rule,
    rule_over,
    sampled_laws,
)
from jaxsat.scenario.wording import shown

MAX_PERIODS = 1_000_000
"""Control periods between two measurements of a sensor, or for which commands are held."""

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
    at_least=0,
    at_most=TRACKER_NOISE.high,
    default=0.01,
)


FALSE_ALARM_PROBABILITY = number(
    "false_alarm_probability",
    "Probability that the filter rejects a good reading of a sensor of the attitude, as one that "
    "does not agree with its prediction; by default no reading is tested",
    at_least=PROBABILITY.low,
    at_most=0.5,
    default=None,
)


class SamplingTable(table_with(fields_of((*WHITE_NOISE.keys, DELAY)))):
    """`[sampling]`: noise and delay between a sampled law and the plant."""

    hold_samples: Annotated[Whole, Ge(0), Le(MAX_PERIODS)] = quantity(
        "Samples in a row with invalid measurements for which commands are held, before they are "
        "zero",
        "1",
        HOLD_SAMPLES,
    )


def _table_of(sensor: SensorDeclaration) -> Any:
    doc = f"`[{sensor.name}]`: {sensor.meaning[0].lower()}{sensor.meaning[1:]}."
    name = sensor.name.replace("_", "-")
    return table_class(name, doc, fields_of(sensor.keys), ScenarioTable, "Table")


TABLES = {one.name: (_table_of(one) | None, choice(one.meaning, None)) for one in SENSORS}
"""Table and meaning of each sensor that has a table of its own."""


class EstimatorTable(table_with(fields_of([ATTITUDE_SIGMA, FALSE_ALARM_PROBABILITY]), PartTable)):
    """`[estimator]`: estimates of attitude and rates for the law from the measurements."""

    plugin: ClassVar[PluginKind] = ESTIMATOR

    kind: str = choice(
        f"{ESTIMATOR_KIND.meaning}; or an estimator that does not come with jaxsat, "
        '"module:Class" or the name of an installed one, whose keys follow',
        ESTIMATOR_KIND.default,
    )
    patience: Annotated[Whole, Ge(1), Le(MAX_PERIODS)] | None = quantity(
        "Readings of a sensor in a row that the filter rejects before it excludes the sensor; "
        f"{PATIENCE} by default",
        "1",
        None,
    )
    probation: Annotated[Whole, Ge(1), Le(MAX_PERIODS)] | None = quantity(
        "Readings of an excluded sensor in a row that pass the test before the filter uses it "
        f"again; {PROBATION} by default",
        "1",
        None,
    )


class OwnEstimatorTable(table_with(fields_of([ESTIMATOR_KIND]), EstimatorTable)):
    """`[estimator]` of a kind that comes with jaxsat."""

    model_config = ConfigDict(extra="forbid")


EstimatorOfAKind = Annotated[
    SerializeAsAny[EstimatorTable], by_its_kind(EstimatorTable, OwnEstimatorTable)
]


MAX_LATENCY = 1000
"""Largest latency of a measurement in control periods; as many measurements are buffered."""


ATTITUDE = tuple(one.name for one in ATTITUDE_SENSORS)
"""Tables of the attitude sensors."""


def _given(values: Values) -> list[str]:
    """Tables of `ATTITUDE` that a scenario has."""
    return [one for one in ATTITUDE if any(key.startswith(f"{one}.") for key in values)]


@rule_over("gyro")
def _sensors_of_the_attitude_have_a_gyro(values):
    for name in _given(values)[:1] if values["gyro"] is None else ():
        yield at("gyro", f"must be given with [{name}], got nothing", True)


@rule_over("gyro.limit_rad_s", *ATTITUDE)
def _gyro_has_a_sensor_of_the_attitude(values):
    message = "must be given with [gyro], or else [magnetometer], got none of them"
    yield at("star_tracker", message, True)


@rule("star_tracker", "magnetometer", "horizon_sensor", "sun_sensor.noise_rad")
def _sun_sensor_has_another_beside_it(*others):
    yield at(
        "magnetometer",
        "must be given with [sun_sensor], or else [horizon_sensor] or [star_tracker]: no Sun "
        "sensor measures a turn about the direction to the Sun, which is fixed in inertial axes; "
        "got none of them",
        True,
    )


@rule_over("gyro", *ATTITUDE, "estimator.kind")
def _estimator_has_sensors(values):
    if values["gyro"] is None:
        kind = values["estimator.kind"]
        yield at("estimator", f'must belong to [gyro] and [star_tracker], got kind "{kind}" alone')


@rule("star_tracker", "gyro.limit_rad_s", "estimator.kind")
def _a_law_without_estimator_has_a_tracker(tracker, limit, kind):
    if kind == "none":
        yield at("estimator.kind", 'must be "mekf" without [star_tracker], got "none"')


@rule(
    "estimator.kind",
    "estimator.false_alarm_probability",
    "estimator.patience",
    "estimator.probation",
)
def _the_filter_alone_tests_innovations(kind, probability, patience, probation):
    if kind != "mekf" and probability is not None:
        message = f'must be left out with kind "{kind}", got {shown(probability)}'
        yield at("estimator.false_alarm_probability", message)
    for key, count in (("patience", patience), ("probation", probation)):
        if probability is None and count is not None:
            message = f"must be left out without false_alarm_probability, got {shown(count)}"
            yield at(f"estimator.{key}", message)


@rule_over("orbit.rate_rad_s")
def _sensors_are_in_orbit(values):
    for name in {"magnetometer", "horizon_sensor"}.intersection(_given(values)):
        in_orbit = needs_orbit(name, f"[{name}]")
        yield from (at(*one) for one in in_orbit.check(values["orbit.rate_rad_s"], True))


@rule_over("gyro.limit_rad_s")
def _noise_is_that_of_the_gyro(values):
    for key in (f"sampling.{one.name}" for one in WHITE_NOISE.keys):
        if values.get(key):
            yield at(
                key, f"must be omitted with [gyro] and [star_tracker], got {shown(values[key])}"
            )


@rule_over("control.period_s")
def _measurements_fall_on_samples(values):
    for name in _given(values):
        for key, most in (("update_period_s", MAX_PERIODS), ("latency_s", MAX_LATENCY)):
            value = values.get(f"{name}.{key}")
            if value:
                yield from _whole_periods(f"{name}.{key}", value, values["control.period_s"], most)


def _whole_periods(key, value, period, most):
    if not is_multiple(value, period):
        message = f"must be a multiple of control.period_s = {shown(period)}, got {shown(value)}"
        yield at(key, message)
    elif round(value / period) > most:
        yield at(key, f"must be at most {most} times control.period_s, got {shown(value)}")


@rule_over()
def _outages_are_complete(values):
    for one in SENSORS:
        begin = f"{one.name}."
        table = {
            key.removeprefix(begin): values[key]
            for key in (f"{begin}outage{end}_s" for end in ("_start", "", "_every"))
            if key in values
        }
        if len(table) == 3:
            for name, message, absent in outage_mistakes(table):
                yield at(begin + name, message, absent)


@rule_over()
def _boresights_are_directions(values):
    for one in ATTITUDE:
        boresight = values.get(f"{one}.boresight")
        if boresight is not None and sum(entry * entry for entry in boresight) < 1e-12:
            yield at(f"{one}.boresight", f"must be a direction, got {shown(boresight)}")


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


def sensor_cautions(scenario: Any) -> Iterator[Issue]:
    """Yield a caution about a single vector: turns about it are observable only as it rotates."""
    given = [name for name in ATTITUDE if getattr(scenario, name) is not None]
    alone = len(given) == 1 and given != ["star_tracker"]
    orbit, duration = scenario.orbit, scenario.simulation.duration_s
    ellipse = orbit.ellipse()
    rate = math.sqrt(EARTH_GRAVITY / ellipse[0] ** 3) if ellipse else orbit.rate()
    if alone and duration * rate < math.pi:
        message = (
            "should be given with [sun_sensor] or [star_tracker] in a run shorter than half an "
            f"orbit, {math.pi / rate:.4g} s: before, what it measures has hardly turned, and a "
            f"turn about that is hardly observable, got a run of {shown(duration)} s"
        )
        yield Issue((given[0],), message)
