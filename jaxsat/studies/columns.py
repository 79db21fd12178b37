"""What the store of a study has of every case."""

from collections.abc import Mapping

import jax
import numpy as np
from jaxtyping import Array

from jaxsat.simulation import AbstractLoop, SampledLoop, Signals
from jaxsat.spacecraft import Wheels
from jaxsat.store import Column, labels

DRAWN = "drawn_"
"""Prefix of the columns that hold what was drawn for a case."""

HISTORY = "history_"
"""Prefix of the columns that hold a case's history, (times, components)."""

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

CONSUMPTION = {
    "propellant": Column((), "float64", "kg", "propellant used"),
    "valve_openings": Column((0,), "float64", "1", "openings of each valve", ("thruster",)),
}
"""Of loops whose thrusters push; as many openings as there are thrusters."""

PEAK_MOMENTUM = {
    "peak_wheel_momentum": Column(
        (0,), "float64", "N m s", "largest wheel momentum seen relative to the body", ("wheel",)
    )
}
"""Of loops with wheels; as many as there are."""

ERRORS = {
    name: (part, Column((), "float64", label.units, label.long_name))
    for name, (part, label) in labels.ERRORS.items()
}
"""Of programs that estimate it, see `jaxsat.simulation.IntegrationError`."""


HISTORIES = {
    "w": Column((2,), "float64", "1", "tilt relative to the orbit frame", ("w_component",)),
    "z": Column((), "float64", "rad", "turn about the third axis"),
    "omega": Column(
        (3,), "float64", "rad s-1", "inertial angular velocity in body axes", ("body_axis",)
    ),
    "relative_rate": Column(
        (3,),
        "float64",
        "rad s-1",
        "angular velocity relative to the orbit frame in body axes",
        ("body_axis",),
    ),
    "torque": Column((3,), "float64", "N m", "torque of all actuators", ("body_axis",)),
}
"""The signals of which a study can keep a history."""

RANGES = {
    f"torque_{name}": (
        part,
        Column(
            (3,), "float64", "N m", f"{what} torque until the next kept instant", ("body_axis",)
        ),
    )
    for name, part, what in (
        ("min", "least", "least"),
        ("max", "largest", "largest"),
        ("mean", "mean", "mean"),
    )
}
"""Of sampled loops: what the torque was between the instants of a history."""


def histories_of(loop: AbstractLoop) -> dict[str, Column]:
    """The histories of such a loop, by name."""
    ranges = {name: column for name, (_, column) in RANGES.items()}
    return HISTORIES | ranges if isinstance(loop, SampledLoop) else HISTORIES


def history_of(signals: Signals, name: str) -> Array | np.ndarray:
    """The values of one of them."""
    if name not in RANGES:
        return getattr(signals, name)
    return getattr(signals.torque_range, RANGES[name][0])


def columns_of(loop: AbstractLoop) -> dict[str, Column]:
    """The columns that every study of such a loop has, besides what is drawn and histories."""
    columns = dict(COLUMNS)
    effectors = loop.plant.effectors
    used = jax.eval_shape(lambda: [one.consumption(one.init_memory()) for one in effectors])
    for one in used:
        columns |= {} if one is None else _of_size(CONSUMPTION, one.openings.shape)
    wheels = loop.plant.find(Wheels)
    return columns if wheels is None else columns | _of_size(PEAK_MOMENTUM, (wheels.count,))


def _of_size(columns: Mapping[str, Column], shape: tuple[int, ...]) -> dict[str, Column]:
    return {
        name: column._replace(shape=shape) if column.dims else column
        for name, column in columns.items()
    }
