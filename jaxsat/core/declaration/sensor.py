"""Declaration of a sensor with a table of its own."""

import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.keys import Key, PartDeclaration, number
from jaxsat.core.ranges import (
    FROM_ZERO,
    GYRO_BIAS,
    MISALIGNMENT,
    PROBABILITY,
    RATE_NOISE,
    SECONDS,
    TORQUE,
    TRACKER_NOISE,
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
    - `place`: the attribute of a sampled loop that has the sensor.
    - `maker`: "module:Class.method" of the function that returns the sensor from a checked table
      and a `SensorContext`. Imports happen at first use.
    - `kinds`: kinds of failure in flight.
    """

    name: str
    meaning: str
    place: str
    maker: str
    kinds: tuple[AbstractFailureKind, ...]

    def made(self, table: Mapping[str, Any], context: Any) -> Any:
        """Return the sensor of a checked table in a `SensorContext`."""
        return pkgutil.resolve_name(self.maker)(table, context)


def misalignment(meaning: str, drawn: str) -> Key:
    """Declare a small rotation in body axes, which studies draw under the name `drawn`."""
    return number(
        "misalignment_rad",
        meaning,
        within=MISALIGNMENT,
        size=3,
        default=(0.0, 0.0, 0.0),
        drawn=drawn,
    )


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


def measurement_times(remark: str = "", drawn: str | None = None) -> tuple[Key, Key]:
    """Declare period and latency of measurements; `drawn` prefixes their names in studies."""
    return (
        number(
            "update_period_s",
            "Time between measurements, a whole multiple of control.period_s, which it is by "
            "default",
            within=SECONDS,
            default=None,
            drawn=drawn and f"{drawn}_update_period",
        ),
        number(
            "latency_s",
            "Time from a measurement to its arrival, a whole multiple of control.period_s, or "
            f"zero{remark}",
            within=FROM_ZERO,
            default=0.0,
            drawn=drawn and f"{drawn}_latency",
        ),
    )


def outage(
    sensor: str,
    drawn: str | None = None,
    start: Range = FROM_ZERO,
    *,
    prefix: str = "",
    effect: str = "nothing is measured",
) -> tuple[Key, Key, Key]:
    """Declare start and length of an outage of a `sensor`, and the time from one to the next.

    `drawn` prefixes their names in studies, and `prefix` the keys; `effect` is that of an outage.
    """

    def key(end: str, meaning: str, within: Range) -> Key:
        name = drawn and f"{drawn}_outage{end}"
        return number(f"{prefix}outage{end}_s", meaning, within=within, default=None, drawn=name)

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
