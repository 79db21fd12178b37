"""`[magnetometer]`, `[sun_sensor]`, `[horizon_sensor]`: sensors of vectors known in orbit."""

from jaxsat.core.declaration.keys import Key, number
from jaxsat.core.declaration.sensor import (
    SensorDeclaration,
    boresight,
    measurement_times,
    misalignment,
    outage,
)
from jaxsat.core.ranges import FIELD_BIAS, FIELD_NOISE, HALF_ANGLE, SCALE_FACTOR, TRACKER_NOISE


def _common_keys(name: str, noise: Key) -> tuple[Key, ...]:
    """What all have: noise, misalignment, times of measurements, and an outage."""
    return (
        noise,
        misalignment("Small rotation of the measured vector, in body axes", f"{name}_misalignment"),
        *measurement_times("; measurements of faster sensors wait for the slowest"),
        *outage(name.replace("_", " "), name),
    )


def _direction_keys(name: str) -> tuple[Key, ...]:
    """What sensors of a direction have: noise across it, and a field of view."""
    noise = number(
        "noise_rad",
        "Standard deviation of the measured direction about each axis across it",
        "rad",
        within=TRACKER_NOISE,
        drawn=f"{name}_noise",
    )
    return (
        *_common_keys(name, noise),
        boresight("the middle of the field of view"),
        number(
            "half_angle_rad",
            "Half of the angle of the conical field of view; by default everything is in view",
            "rad",
            within=HALF_ANGLE,
            default=None,
        ),
    )


MAGNETOMETER = SensorDeclaration(
    name="magnetometer",
    meaning="Three-axis magnetometer of a sampled law",
    place="navigation.magnetometer",
    maker="jaxsat.spacecraft.vector_sensors:magnetometer",
    summary="magnetometer",
    keys=(
        *_common_keys(
            "magnetometer",
            number(
                "noise_T",
                "Standard deviation of white noise on each component of the measured field",
                "T",
                within=FIELD_NOISE,
                drawn="magnetometer_noise",
            ),
        ),
        number(
            "bias_T",
            "Error of the measured field that is fixed in body axes, of all or of each",
            "T",
            within=FIELD_BIAS,
            size=3,
            or_one=True,
            default=0.0,
            drawn="magnetometer_bias",
        ),
        number(
            "scale_factor",
            "Relative error of the measured field, of all axes or of each",
            "1",
            within=SCALE_FACTOR,
            size=3,
            or_one=True,
            default=0.0,
            drawn="magnetometer_scale_factor",
        ),
    ),
)

SUN_SENSOR = SensorDeclaration(
    name="sun_sensor",
    meaning="Sun sensor of a sampled law",
    place="navigation.sun_sensor",
    maker="jaxsat.spacecraft.vector_sensors:sun_sensor",
    summary="Sun sensor",
    keys=_direction_keys("sun_sensor"),
)

HORIZON_SENSOR = SensorDeclaration(
    name="horizon_sensor",
    meaning="Horizon sensor of a sampled law",
    place="navigation.horizon_sensor",
    maker="jaxsat.spacecraft.vector_sensors:horizon_sensor",
    summary="horizon sensor",
    keys=_direction_keys("horizon_sensor"),
)

VECTOR_SENSORS: tuple[SensorDeclaration, ...] = (MAGNETOMETER, SUN_SENSOR, HORIZON_SENSOR)
"""The sensors of a vector, in the order of a scenario."""
