"""Quantities that a study can disperse, applied by `jaxsat.studies.quantities`."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from jaxsat.core.declaration.actuators import ACTUATORS, PARTS
from jaxsat.core.declaration.disturbances import DISTURBANCES
from jaxsat.core.declaration.keys import DispersibleQuantity
from jaxsat.core.declaration.sensors import SENSED

BODY = (
    DispersibleQuantity("inertia", "relative change of J1, J2, J3", stage="body", axis="body_axis"),
    DispersibleQuantity(
        "products_of_inertia",
        "Jxy, Jxz, Jyz to add, in parts of the least of J1, J2, J3",
        stage="body",
        axis="product_of_inertia",
    ),
)

BELIEF = (
    DispersibleQuantity(
        "model_inertia",
        "relative change of the J1, J2, J3 that the controller believes",
        axis="body_axis",
    ),
    DispersibleQuantity(
        "model_orbit_rate", "relative change of the orbit rate that the controller believes"
    ),
)

_FIRST, *_LATER = (f"{one.name}s" for one in ACTUATORS)

FAILURES = (
    DispersibleQuantity(
        "failure_time",
        f"time at which each [[failure]] strikes; those of {_FIRST} come first, then those of "
        f"{', '.join(_LATER[:-1])} and {_LATER[-1]}, here and below",
        "s",
    ),
    *(one.failed_quantity for one in ACTUATORS),
    DispersibleQuantity(
        "failure_kind",
        f"kind of each [[failure]], rounded: {'; '.join(one.drawn_kinds for one in ACTUATORS)}",
    ),
    DispersibleQuantity(
        "failure_amount",
        "fraction (or delay or time constant, s; or factor or level, N m, of friction) of each "
        "[[failure]]",
    ),
)

SENSOR_FAILURE_TIME = DispersibleQuantity(
    "sensor_failure_time", "time at which each [[failure]] of a sensor strikes", "s"
)

DELAY = DispersibleQuantity("delay", "time that the controller takes to compute", "s")

START = (
    DispersibleQuantity(
        "attitude",
        "initial attitude, a unit quaternion",
        excludes=("tilt", "tilt_direction", "turn"),
        random_attitude=True,
        turns=True,
        axis="quaternion_component",
    ),
    DispersibleQuantity("tilt", "initial |w|"),
    DispersibleQuantity("tilt_direction", "angle of the initial (w1, w2)", "rad"),
    DispersibleQuantity("turn", "initial z", "rad"),
    DispersibleQuantity(
        "attitude_error",
        "rotation vector, body axes, from the nominal initial attitude",
        "rad",
        turns=True,
        axis="body_axis",
    ),
    DispersibleQuantity(
        "omega", "initial angular velocity", "rad/s", excludes=("rate_error",), axis="body_axis"
    ),
)

RATE_ERROR = DispersibleQuantity(
    "rate_error",
    "initial (ω1, ω2) less the reference of the nominal law",
    "rad/s",
    axis="driven_axis",
)


def _of_parts(stage: str) -> Iterable[DispersibleQuantity]:
    return (one for part in PARTS for one in part.dispersible if one.stage == stage)


DISPERSIBLE: Mapping[str, DispersibleQuantity] = MappingProxyType(
    {
        quantity.name: quantity
        for quantity in (
            *BODY,
            *_of_parts("body"),
            *_of_parts("part"),
            *(one for part in DISTURBANCES.values() for one in part.quantities),
            *BELIEF,
            *(one for part in SENSED.values() for one in part.quantities),
            *FAILURES,
            SENSOR_FAILURE_TIME,
            DELAY,
            *START,
            *_of_parts("start"),
            RATE_ERROR,
        )
    }
)
"""All dispersible quantities by name, in the order in which they are applied."""

EXCLUSIVE = tuple((one.name, other) for one in DISPERSIBLE.values() for other in one.excludes)
"""Pairs of quantities that are not dispersed together."""
