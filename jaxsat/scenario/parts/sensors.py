"""`[sampling]`, or `[gyro]` and attitude sensors with an `[estimator]`.

They are between the plant and a sampled law. If such a table is given, rules receive the values of
its keys; if not, they receive the table itself, as None.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from annotated_types import Ge, Le
from pydantic import SerializeAsAny

from jaxsat.core.declaration.disturbances import needs_orbit
from jaxsat.core.declaration.sensors import (
    ATTITUDE_SENSORS,
    DELAY,
    GYRO,
    HOLD_SAMPLES,
    OTHER_SENSORS,
    SENSORS,
    STAR_TRACKER,
    WHITE_NOISE,
    SensorDeclaration,
)
from jaxsat.core.earth import EARTH_GRAVITY
from jaxsat.scenario.derived import attitude_tables
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.named import PartTable, by_its_kind
from jaxsat.scenario.plugins import SENSOR, PluginKind
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


class SensorTable(PartTable):
    """`[sensor.NAME]`: a sensor that does not come with jaxsat, of a vector."""

    plugin: ClassVar[PluginKind] = SENSOR


OneSensor = Annotated[SerializeAsAny[SensorTable], by_its_kind(SensorTable)]


MAX_LATENCY = 1000
"""Largest latency of a measurement in control periods; as many measurements are buffered."""


ATTITUDE = (*(one.name for one in ATTITUDE_SENSORS), OTHER_SENSORS)
"""Tables of the attitude sensors; their keys are absent where no such table is empty."""


def given_sensors(values: Values) -> list[str]:
    """Return the tables of attitude sensors that a scenario has, such as "sensor.NAME"."""
    own = [one for one in ATTITUDE[:-1] if any(key.startswith(f"{one}.") for key in values)]
    kinds = [one for one in values if one.startswith(f"{OTHER_SENSORS}.") and one.endswith(".kind")]
    return [*own, *(one.removesuffix(".kind") for one in kinds)]


@rule_over()
def _other_sensors_have_names_of_their_own(values):
    names = given_sensors(values)
    for one in names:
        name = one.removeprefix(f"{OTHER_SENSORS}.")
        if name != one and (name in (*names, GYRO.name, STAR_TRACKER.name)):
            yield at(one, f"must have a name that no other sensor has, got {name}")
        if name != one and not (name.isascii() and name.isidentifier()):
            yield at(one, f"must have an ASCII name of letters, digits and _, got {shown(name)}")


@rule_over("gyro.limit_rad_s", *ATTITUDE)
def _gyro_has_a_sensor_of_the_attitude(values):
    message = "must be given with [gyro], or else [magnetometer], got none of them"
    yield at("star_tracker", message, True)


@rule("star_tracker", "magnetometer", "horizon_sensor", OTHER_SENSORS, "sun_sensor.noise_rad")
def _sun_sensor_has_another_beside_it(*others):
    yield at(
        "magnetometer",
        "must be given with [sun_sensor], or else [horizon_sensor] or [star_tracker]: no Sun "
        "sensor measures a turn about the direction to the Sun, which is fixed in inertial axes; "
        "got none of them",
        True,
    )


@rule_over("orbit.rate_rad_s")
def _sensors_are_in_orbit(values):
    for name in {"magnetometer", "horizon_sensor"}.intersection(given_sensors(values)):
        in_orbit = needs_orbit(name, f"[{name}]")
        yield from (at(*one) for one in in_orbit.check(values["orbit.rate_rad_s"], True))


@rule_over()
def _noise_is_that_of_the_sensors(values):
    if not given_sensors(values):
        return
    for key in (f"sampling.{one.name}" for one in WHITE_NOISE.keys):
        if values.get(key):
            yield at(
                key, f"must be omitted with [{given_sensors(values)[0]}], got {shown(values[key])}"
            )


@rule_over("control.period_s")
def _measurements_fall_on_samples(values):
    for name in given_sensors(values):
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
    for one in (GYRO.name, *given_sensors(values)):
        begin = f"{one}."
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
    for one in given_sensors(values):
        boresight = values.get(f"{one}.boresight")
        if boresight is not None and sum(entry * entry for entry in boresight) < 1e-12:
            yield at(f"{one}.boresight", f"must be a direction, got {shown(boresight)}")


@rule_over("control.law")
def _sensors_belong_to_a_sampled_law(values):
    law = values["control.law"]
    for table in ("sampling", *TABLES, OTHER_SENSORS):
        present = any(key.startswith(f"{table}.") for key in values)
        if present and not law.declaration.sampled:
            yield at(table, f'must belong to a sampled law ({sampled_laws()}), got "{law}"')


@rule("control.period_s", "sampling.delay_s")
def _delay_within_a_period(period, delay):
    if delay > period:
        yield at("sampling.delay_s", f"must be at most control.period_s, got {shown(delay)}")


def sensor_cautions(scenario: Any) -> Iterator[Issue]:
    """Yield a caution about a single vector: turns about it are observable only as it rotates."""
    names = [*attitude_tables(scenario)]
    alone = len(names) == 1 and names != [STAR_TRACKER.name]
    orbit, duration = scenario.orbit, scenario.simulation.duration_s
    ellipse = orbit.ellipse()
    rate = math.sqrt(EARTH_GRAVITY / ellipse[0] ** 3) if ellipse else orbit.rate()
    if alone and duration * rate < math.pi:
        message = (
            "should be given with [sun_sensor] or [star_tracker] in a run shorter than half an "
            f"orbit, {math.pi / rate:.4g} s: before, what it measures has hardly turned, and a "
            f"turn about that is hardly observable, got a run of {shown(duration)} s"
        )
        yield Issue(tuple(names[0].split(" ")), message)
