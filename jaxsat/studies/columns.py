"""Columns of a study's store."""

from collections import ChainMap

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.actuators import STUDIED
from jaxsat.simulation.engine.progress import peaks_of
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.simulation.requirements import Requirements
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.simulation.trajectory import Signals
from jaxsat.store import labels
from jaxsat.store.chunks import Column

DRAWN = "drawn_"
"""Prefix of the columns of a case's drawn values."""

HISTORY = "history_"
"""Prefix of the columns of a case's history, (times, components)."""

HISTORY_TIME = HISTORY + "time"

COLUMNS = {
    "code": Column((), "int8", "1", "how the case ended, 0 for its end"),
    "settling_time": Column((), "float64", "s", "settling time, infinite if not settled"),
    "effort": Column((), "float64", "N m s", "integral of the sum of the torques' sizes"),
    "cost": Column((), "float64", "1", "integral of the running cost"),
    "peak_rate": Column((), "float64", "rad s-1", "largest angular velocity seen"),
    "ended_at": Column((), "float64", "s", "time up to which the case was computed"),
    "w": Column((2,), "float64", "1", "final tilt relative to the orbit frame", ("w_component",)),
    "z": Column((), "float64", "rad", "final turn about the third axis"),
    "quaternion": Column(
        (4,),
        "float64",
        "1",
        "final attitude, orbit to body frame, scalar first",
        ("quaternion_component",),
    ),
    "pointing_error": Column((), "float64", "degree", "final rotation angle from the orbit frame"),
    "omega": Column(
        (3,), "float64", "rad s-1", "final inertial angular velocity in body axes", ("body_axis",)
    ),
}

UNMADE = {
    "peak_torque_unmade": Column(
        (), "float64", "N m", "largest torque commanded beyond what actuators make"
    ),
    "unmade_fraction": Column(
        (), "float64", "1", "fraction of samples at which actuators do not make the torque"
    ),
}
"""Columns of sampled loops that report unmade torque."""

REJECTIONS = {
    "rejected_readings": Column(
        (0,), "float64", "1", "readings that the filter rejected", (labels.ATTITUDE_SENSOR,)
    ),
    "sensor_exclusions": Column(
        (0,), "float64", "1", "how often the filter excluded it", (labels.ATTITUDE_SENSOR,)
    ),
}
"""Columns of filters that test innovations, each of all sensors that they test."""

ERRORS = {
    name: (part, Column((), "float64", label.units, label.long_name))
    for name, (part, label) in labels.ERRORS.items()
}
"""Columns of integration errors, see `jaxsat.simulation.assessment.IntegrationError`."""

REQUIREMENT = "requirement"
"""The axis of requirements."""

REQUIREMENTS = {
    "requirement_margin": (
        "value",
        Column((0,), "float64", "1", "margin of each requirement in SI", (REQUIREMENT,)),
    ),
    "requirement_comparison": (
        "comparison",
        Column((0,), "int32", "1", "comparison of its formula that decided", (REQUIREMENT,)),
    ),
    "requirement_time": (
        "time",
        Column((0,), "float64", "s", "time at which it was decided", (REQUIREMENT,)),
    ),
}
"""Columns of programs with requirements, see `jaxsat.simulation.requirements.Margin`."""


def requirement_columns(requirements: Requirements | None) -> dict[str, Column]:
    """Return the columns of the requirements; empty without any."""
    if requirements is None:
        return {}
    shape = (len(requirements.names),)
    return {name: column._replace(shape=shape) for name, (_, column) in REQUIREMENTS.items()}


HISTORIES = {
    name: Column(
        tuple(len(labels.AXES[axis]) for axis in label.dimensions),
        "float64",
        label.units,
        label.long_name,
        label.dimensions,
    )
    for name in ("w", "z", "omega", "relative_rate", "torque")
    for label in [labels.VARIABLES[name]]
}
"""Signals of which a study can keep a history."""

RANGES = {
    name: (
        part,
        HISTORIES["torque"]._replace(long_name=f"{what} torque until the next kept instant"),
    )
    for part, (name, what) in labels.RANGES.items()
}
"""Columns of sampled loops: range of the torque between the instants of a history."""


def histories_of(loop: AbstractLoop) -> dict[str, Column]:
    """Return the histories of a loop, by name."""
    ranges = {name: column for name, (_, column) in RANGES.items()}
    return HISTORIES | ranges if isinstance(loop, SampledLoop) else HISTORIES


def history_of(signals: Signals, name: str) -> Array | np.ndarray:
    """Return the values of a history by its name."""
    if name not in RANGES:
        return getattr(signals, name)
    return getattr(signals.torque_range, RANGES[name][0])


def attitude_sensors(loop: AbstractLoop) -> tuple[str, ...]:
    """Return the names of the sensors that the filter of a loop tests, in their order."""
    navigation = getattr(loop, "navigation", None)
    if navigation is None:
        return ()
    return tuple(
        name for name in navigation.sensors if name != "gyro" or navigation.body is not None
    )


def _first_counts(loop: AbstractLoop) -> dict[str, Array]:
    """What the estimator of a loop has counted before the first sample."""
    navigation = getattr(loop, "navigation", None)
    if navigation is None:
        return {}
    estimator, attitude = navigation.estimator, Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0]))
    return estimator.counts(estimator.init(attitude, jnp.zeros(())))


def columns_of(loop: AbstractLoop) -> dict[str, Column]:
    """Return the columns of a study of this loop, other than drawn values and histories."""
    plant = loop.plant

    def of_parts() -> dict[str, Array]:
        consumptions = [one.consumption(one.init_memory()) for one in plant.effectors]
        rest = tuple(one.init() for one in plant.effectors)
        stored = [one.stored(own) for one, own in zip(plant.effectors, rest, strict=True)]
        return dict(ChainMap(peaks_of(ChainMap(*stored)), _first_counts(loop), *consumptions))

    shapes = {name: one.shape for name, one in jax.eval_shape(of_parts).items()}
    unmade = UNMADE if loop.tells_unmade else {}
    return (
        COLUMNS
        | unmade
        | {
            name: one._replace(shape=shapes[name])
            for name, one in REJECTIONS.items()
            if name in shapes
        }
        | {
            name: Column(
                shapes[name],
                "float64",
                signal.units,
                signal.meaning if signal.total else f"largest {signal.meaning}",
                (kind.name,) * signal.each,
            )
            for name, (signal, kind) in STUDIED.items()
            if name in shapes
        }
    )
