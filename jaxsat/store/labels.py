"""Names in results: axes and components, variables with units, outcomes of cases, and the stores
of several studies in one folder."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jaxsat.core.declaration.actuators import PARTS as DECLARED
from jaxsat.core.declaration.sensors import ATTITUDE_SENSORS, OTHER_SENSORS
from jaxsat.store.labelled import LabelledArray

AXES: dict[str, tuple[str, ...]] = {
    "body_axis": ("x", "y", "z"),
    "driven_axis": ("x", "y"),
    "w_component": ("w1", "w2"),
    "quaternion_component": ("q0", "q1", "q2", "q3"),
    "euler_axis": ("roll", "pitch", "yaw"),
    "product_of_inertia": ("xy", "xz", "yz"),
}
"""Names of the components along each axis; along any other axis they are numbered from 1."""


PARTS = tuple(one.name for one in DECLARED)
"""Axes along actuators and passive parts, by their kind in a scenario."""

ALL_PARTS = "actuator"
"""Axis of quantities of thrusters and wheels together, in this order."""

DIAGNOSED_PARTS = {"thruster": "thrust_level", "wheel": "wheel_momentum"}
"""Kinds along `ALL_PARTS`, each with a variable that has a component for every part."""

ATTITUDE_SENSOR = "attitude_sensor"
"""Axis of quantities of the attitude sensors of a scenario, in this order."""

SETTLED, UNSETTLED = "settled", "unsettled"
"""Outcomes of a case that reached its end; any other has the name of its failure."""


class Label(NamedTuple):
    """Label of one variable of a trajectory: its dimensions, units and long name."""

    dimensions: tuple[str, ...]
    units: str
    long_name: str

    def array(self, values: ArrayLike, first: tuple[str, ...] = ()) -> LabelledArray:
        """Return values with this label, along the `first` axes and then its dimensions."""
        attributes = {"units": self.units, "long_name": self.long_name}
        return LabelledArray((*first, *self.dimensions), np.asarray(values), attributes)


_body = partial(Label, ("body_axis",))
_CLAIMED = "three standard deviations that the estimator claims of the same"

VARIABLES = {
    "w": Label(("w_component",), "1", "tilt relative to the orbit frame (Tsiotras-Longuski)"),
    "z": Label((), "rad", "turn about the third axis (Tsiotras-Longuski)"),
    "quaternion": Label(
        ("quaternion_component",), "1", "unit quaternion from orbit to body frame, scalar first"
    ),
    "omega": _body("rad s-1", "inertial angular velocity in body axes"),
    "relative_rate": _body("rad s-1", "angular velocity relative to the orbit frame in body axes"),
    "torque": _body("N m", "torque of all actuators in body axes"),
    "torque_unmade": _body(
        "N m", "torque commanded beyond what actuators make within their limits"
    ),
    "disturbance": _body("N m", "disturbance torque in body axes"),
    "rate_error": Label(
        ("driven_axis",), "rad s-1", "angular velocity less the reference of the control law"
    ),
    "lyapunov": Label((), "J", "Lyapunov function of the control law"),
    "mode": Label((), "1", "part of a switching law or supervisor that is active"),
    "constraint_torque": Label(
        (), "N m", "ideal torque about the third axis that holds the third rate"
    ),
    **{
        one.name: Label((actuator.name,) if one.each else (), one.units, one.meaning)
        for actuator in DECLARED
        for one in actuator.signals
    },
    "diagnosed_kind": Label(
        ("thruster",),
        "1",
        "diagnosed failure: -1 none, 0 dead, 1 degraded, 2 stuck on, 3 stuck at, 4 leaking, "
        "5 reversed, 6 friction up, 7 runaway, 8 stopped",
    ),
    "detection_statistic": Label(
        ("thruster",), "1", "CUSUM statistic of each actuator over the threshold of an alarm"
    ),
    "diagnosed_dipole": Label(
        ("magnetorquer",),
        "1",
        "part of its dipole that each magnetorquer makes by diagnosis: 1 works, 0 is dead or stuck",
    ),
    "alarm": Label((), "1", "1 while the cause of an alarm is being isolated"),
    "attitude_estimate_error": _body(
        "rad", "rotation vector from estimated to true attitude in body axes"
    ),
    "attitude_estimate_3sigma": _body("rad", _CLAIMED),
    "rate_estimate_error": _body("rad s-1", "angular velocity less the estimated one in body axes"),
    "rate_estimate_3sigma": _body("rad s-1", _CLAIMED),
    "bias_estimate_error": _body("rad s-1", "gyro bias less the estimated one in body axes"),
    "bias_estimate_3sigma": _body("rad s-1", _CLAIMED),
    "innovation": Label(
        (ATTITUDE_SENSOR,),
        "1",
        "normalised square of the innovation of the last reading, over the threshold of rejection",
    ),
    "sensor_excluded": Label((ATTITUDE_SENSOR,), "1", "1 for a sensor that the filter excludes"),
}
"""Signals, each over `time`; those from `constraint_torque` on only with such a torque, device (a
two-sided thruster counts as two) or estimate."""

RANGES = {
    "least": ("torque_min", "least"),
    "largest": ("torque_max", "largest"),
    "mean": ("torque_mean", "mean"),
}
"""Range of the torque from each saved time to the next, where it differs from the saved one."""

TOTALS = {
    "settled_from": Label(
        (), "s", "when attitude and relative rate came to stay within the tolerances"
    ),
    "at_rest_from": Label((), "s", "when the inertial rate came to stay within its tolerance"),
    "effort": _body("N m s", "integral of the size of the torque"),
    "constraint_effort": Label((), "N m s", "the same of the torque that holds the third rate"),
}
"""Totals of the whole run, computed on the integrator's steps and not at the saved times."""

ERRORS = {
    "rate_error_estimate": (
        "rate",
        Label((), "rad s-1", "error of the rate that the length of the steps leaves"),
    ),
    "attitude_error_estimate": (
        "attitude",
        Label((), "rad", "error of the attitude that the length of the steps leaves"),
    ),
}
"""Error estimates of runs with equal steps, see `IntegrationError`."""


def flags_of(column: Any) -> tuple[str, ...]:
    """Return the meanings of a column's codes, from 0 on; empty for a column without codes.

    The column is one of `open_study` or of `study_columns`, or a plain array without codes.
    """
    if hasattr(column, "column"):
        return column.column.flags
    meanings = getattr(column, "attrs", {}).get("flag_meanings", "")
    return tuple(meaning.replace("_", " ") for meaning in meanings.split())


def components(axis: str, count: int) -> tuple[str, ...]:
    """Return the names of the `count` components along an axis."""
    return AXES.get(axis, tuple(str(number + 1) for number in range(count)))


def part_names(scenario: str, kind: str, count: int) -> list[str]:
    """Return names, or numbers from 1, of `count` parts of one `kind` in a scenario (TOML).

    A two-sided thruster has two places, `NAME+` and `NAME-`. Parts that failed before the start are
    left out if the others are `count`.
    """
    tables = tomllib.loads(scenario).get(kind, [])
    parts = [
        (one.get("name", str(number)), bool(one.get("failed")))
        for number, one in enumerate(tables, 1)
        for _ in range(2 if one.get("two_sided") else 1)
    ]
    for names in ([name for name, _ in parts], [name for name, failed in parts if not failed]):
        if len(names) == count:
            return distinct(names)
    return [str(number + 1) for number in range(count)]


def attitude_sensor_names(scenario: str, count: int) -> list[str]:
    """Return the names of the sensors that a scenario's (TOML) filter tests, or numbers from 1."""
    tables = tomllib.loads(scenario)
    names = [one.name for one in ATTITUDE_SENSORS if one.name in tables]
    names += tables.get(OTHER_SENSORS, {})
    names += ["gyro"] * (len(names) < count and "gyro" in tables)
    return names if len(names) == count else [str(number + 1) for number in range(count)]


def distinct(names: Sequence[str]) -> list[str]:
    """Return names with + and - appended to pairs of equal ones, the two ways of a part."""
    return [
        name if names.count(name) == 1 else name + ("-" if name in names[:place] else "+")
        for place, name in enumerate(names)
    ]


FOLDER = "studies"


def named_store(folder: Path, name: str) -> Path:
    """Return the store of one study by the name of its law, which may be a module or a file."""
    return folder / FOLDER / f"{_file_name(name)}.zarr"


def acceptance_store(
    folder: Path, level: str, torque_limit: float, law: str, start: str = "random"
) -> Path:
    """Return the store of a law on the acceptance set at a level and a torque limit (N m).

    Its cases start at "random", or in the "paper"'s initial state.
    """
    return folder / FOLDER / f"{level}-{torque_limit:g}-{_file_name(law)}-{start}.zarr"


def store_of_row(folder: Path, row: Mapping[str, Any]) -> Path:
    """Return the store of a row of a comparison's record, of a scenario or the acceptance set."""
    if "scenario" in row:
        return named_store(folder, row["law"])
    return acceptance_store(folder, row["level"], row["torque_limit"], row["law"])


def _file_name(name: str) -> str:
    return re.sub(r"[^\w.-]+", "-", name)
