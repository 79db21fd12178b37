"""Declaration of a sensor with a table of its own."""

import dataclasses
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.keys import Key, PartDeclaration, number, require_own_keys
from jaxsat.core.declaration.units import with_unit
from jaxsat.core.ranges import (
    FIELD_BIAS,
    FIELD_NOISE,
    FROM_ZERO,
    GYRO_BIAS,
    HALF_ANGLE,
    MISALIGNMENT,
    PROBABILITY,
    RATE_NOISE,
    SCALE_FACTOR,
    SECONDS,
    TORQUE,
    TRACKER_NOISE,
    VECTOR_BIAS,
    VECTOR_NOISE,
    WHEEL_NOISE,
    Range,
)

DRIFT = number(
    "drift_rad_s",
    "Rate at which its readings turn, body axes",
    within=GYRO_BIAS,
    size=3,
    default=None,
)
SPIKE = number(
    "spike_rad",
    "Standard deviation of the turn of a spike about each body axis",
    within=TRACKER_NOISE,
    default=None,
)
RATE_DRIFT = number(
    "drift_rad_s2",
    "How fast its rates drift, body axes",
    within=GYRO_BIAS,
    size=3,
    default=None,
)
RATE_SPIKE = number(
    "spike_rad_s",
    "Standard deviation of the error of each rate in a spike",
    within=RATE_NOISE,
    default=None,
)
MOMENTUM_DRIFT = number("drift_N_m", "How fast its momentum drifts", within=TORQUE, default=None)
MOMENTUM_SPIKE = number(
    "spike_N_m_s",
    "Standard deviation of the error of the momentum in a spike",
    within=WHEEL_NOISE,
    default=None,
)
SPIKE_PROBABILITY = number(
    "spike_probability",
    "Probability that a reading is a spike",
    within=PROBABILITY,
    default=None,
)


class SensorFailureKind(AbstractFailureKind):
    """Kinds of failure of a sensor of the attitude."""

    DEAD = 0, "dead", "it measures nothing any more"
    STUCK = 1, "stuck", "it repeats its last reading"
    DRIFTING = 2, "drifting", "its readings turn by drift_rad_s more and more", DRIFT
    SPIKING = 3, "spiking", "readings drawn at random are turned", SPIKE, SPIKE_PROBABILITY


class GyroFailureKind(AbstractFailureKind):
    """Kinds of failure of gyros."""

    DEAD = 0, "dead", "its rates are invalid from then on"
    STUCK = 1, "stuck", "it repeats its last rates"
    DRIFTING = 2, "drifting", "its rates are off by drift_rad_s2 more and more", RATE_DRIFT
    SPIKING = 3, "spiking", "rates drawn at random are off", RATE_SPIKE, SPIKE_PROBABILITY


class TachometerFailureKind(AbstractFailureKind):
    """Kinds of failure of the tachometer of a wheel."""

    DEAD = 0, "dead", "its momentum is invalid from then on"
    STUCK = 1, "stuck", "it repeats its last momentum"
    DRIFTING = 2, "drifting", "its momentum is off by drift_N_m more and more", MOMENTUM_DRIFT
    SPIKING = 3, "spiking", "momenta drawn at random are off", MOMENTUM_SPIKE, SPIKE_PROBABILITY


TACHOMETER = "tachometer"
"""The part of a wheel that a failure `of = "tachometer NAME"` strikes, by the wheel's name."""


@dataclass(frozen=True, kw_only=True)
class SensorDeclaration(PartDeclaration):
    """A sensor of a sampled law with a table of its own.

    - `name`: of its table `[name]`.
    - `meaning`: one line, for the schema.
    - `maker`: "module:Class.method" of the function that returns the sensor from a checked table
      and a `SensorContext`. Imports happen at first use.
    - `unit`: that of the vector that the sensor measures, see `VectorDeclaration`; `maker` then
      returns this vector, an `AbstractSensedVector`. None for other sensors.
    - `kinds`: kinds of failure in flight.
    """

    name: str
    meaning: str
    maker: str
    unit: str | None = None
    kinds: tuple[AbstractFailureKind, ...] = tuple(SensorFailureKind)

    def from_table(self, table: Mapping[str, Any], context: Any) -> Any:
        """Return the sensor of a checked table in a `SensorContext`."""
        part = pkgutil.resolve_name(self.maker)(table, context)
        if self.unit is None:
            return part
        return vector_sensor(self.name, self.unit, part, table, context)


@dataclass(frozen=True, kw_only=True)
class VectorDeclaration(PartDeclaration):
    """A vector that a sensor of a package's own measures.

    `unit` is that of the sensor's noise, "rad" for a unit vector, of which only the direction
    counts. `keys` are those of the vector itself; noise, errors, times and outages of the sensor
    follow them.
    """

    unit: str = "rad"

    def __post_init__(self):
        common = vector_keys(self.unit)
        require_own_keys(self.keys, "sensor", ("kind", *(key.name for key in common)))
        object.__setattr__(self, "keys", (*self.keys, *common))
        super().__post_init__()


def vector_sensor(name: str, unit: str, vector: Any, table: Mapping[str, Any], context: Any) -> Any:
    """Return the `VectorSensor` of a vector from a checked table in a `SensorContext`."""
    maker = pkgutil.resolve_name("jaxsat.spacecraft.vector_sensors:VectorSensor.from_table")
    return maker(name, unit, vector, table, context.period)


def drawn(prefix: str, *keys: Key) -> tuple[Key, ...]:
    """Return keys that studies draw, by the name with this prefix; none for an empty prefix."""
    if not prefix:
        return keys
    return tuple(dataclasses.replace(key, drawn=f"{prefix}_{key.stem}") for key in keys)


def vector_keys(unit: str, sensor: str = "sensor", prefix: str = "") -> tuple[Key, ...]:
    """Declare the keys of a `sensor` of a vector in this unit, "rad" for a direction.

    `prefix` is that of the names in studies, see `drawn`.
    """
    direction = unit == "rad"
    noises, biases = _RANGES.get(unit, (VECTOR_NOISE, VECTOR_BIAS))
    meaning = (
        "Standard deviation of the measured direction about each axis across it"
        if direction
        else "Standard deviation of white noise on each component of the measured vector"
    )
    noise = number(with_unit("noise", unit), meaning, unit, within=noises)
    turn = misalignment("Small rotation of the measured vector, in body axes")
    times = measurement_times("; measurements of faster sensors wait for the slowest")
    rest = _view() if direction else drawn(prefix, *_errors(unit, biases))
    return (*drawn(prefix, noise, turn), *times, *drawn(prefix, *outage(sensor)), *rest)


_RANGES = {"rad": (TRACKER_NOISE, VECTOR_BIAS), "T": (FIELD_NOISE, FIELD_BIAS)}
"""Standard deviations and biases of measured vectors, by unit."""


def _view() -> tuple[Key, Key]:
    half_angle = number(
        "half_angle_rad",
        "Half of the angle of the conical field of view; by default everything is in view",
        within=HALF_ANGLE,
        default=None,
    )
    return boresight("the middle of the field of view"), half_angle


def _errors(unit: str, biases: Range) -> tuple[Key, Key]:
    return (
        number(
            with_unit("bias", unit),
            "Error of the measured vector that is fixed in body axes, of all axes or of each",
            unit,
            within=biases,
            size=(1, 3),
            default=0.0,
        ),
        scale_factor("vector"),
    )


def scale_factor(what: str) -> Key:
    """Declare the relative error of what is measured."""
    return number(
        "scale_factor",
        f"Relative error of the measured {what}, of all axes or of each",
        within=SCALE_FACTOR,
        size=(1, 3),
        default=0.0,
    )


def misalignment(meaning: str) -> Key:
    """Declare a small rotation in body axes."""
    zero = (0.0, 0.0, 0.0)
    return number("misalignment_rad", meaning, within=MISALIGNMENT, size=3, default=zero)


def boresight(what: str) -> Key:
    """Declare the direction of `what`."""
    return number(
        "boresight",
        f"Direction of {what} in body axes",
        at_least=-1e6,
        at_most=1e6,
        size=3,
        default=(0.0, 0.0, 1.0),
    )


def measurement_times(remark: str = "") -> tuple[Key, Key]:
    """Declare period and latency of measurements."""
    return (
        number(
            "update_period_s",
            "Time between measurements, a whole multiple of control.period_s, which it is by "
            "default",
            within=SECONDS,
            default=None,
        ),
        number(
            "latency_s",
            "Time from a measurement to its arrival, a whole multiple of control.period_s, or "
            f"zero{remark}",
            within=FROM_ZERO,
            default=0.0,
        ),
    )


def outage(
    sensor: str,
    start: Range = FROM_ZERO,
    *,
    prefix: str = "",
    effect: str = "nothing is measured",
) -> tuple[Key, Key, Key]:
    """Declare start and length of an outage of a `sensor`, and the time from one to the next.

    `prefix` is that of the keys; `effect` is that of an outage.
    """

    def key(end: str, meaning: str, within: Range) -> Key:
        return number(f"{prefix}outage{end}_s", meaning, within=within, default=None)

    return (
        key("_start", f"Time at which an outage begins, in which {effect}; by default none", start),
        key("", f"Length of the outage of the {sensor}", FROM_ZERO),
        key(
            "_every",
            "Time from the begin of an outage to that of the next one, above its length; by "
            "default there is only one",
            SECONDS,
        ),
    )
