"""Variants of a scenario: other body axes, stronger actuators, smaller errors."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jaxsat.core.declaration.sensors import ATTITUDE_SENSORS, OTHER_SENSORS
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.run import build_start
from jaxsat.scenario.quantities import inertia_matrix

VECTORS: Mapping[str, Sequence[str]] = {
    "thruster": ("position_m", "direction", "torque_axis"),
    "wheel": ("axis",),
    "magnetorquer": ("axis",),
    "disturbance": ("constant_N_m", "residual_dipole_A_m2", "drag_centre_m", "solar_centre_m"),
    "panel": ("normal", "centre_m"),
    **{one.name: ("boresight",) for one in ATTITUDE_SENSORS},
    OTHER_SENSORS: ("boresight",),
}
"""Keys that hold a vector in body axes, by table."""

TORQUES: Mapping[str, tuple[str, ...]] = {
    "spacecraft": ("torque_limit_N_m",),
    "thruster": ("force_N", "torque_N_m"),
    "wheel": ("torque_limit_N_m",),
}
"""Keys of actuator torques, by table."""

NOISE: Mapping[str, tuple[str, ...]] = {
    "sampling": ("rate_noise_rad_s", "attitude_noise_rad"),
    "gyro": ("noise_density_rad_s_sqrt_Hz", "bias_walk_rad_s2_sqrt_Hz", "bias_sigma_rad_s"),
    **dict.fromkeys(
        (*(one.name for one in ATTITUDE_SENSORS), OTHER_SENSORS),
        ("across_rad", "along_rad", "noise_rad", "noise_T"),
    ),
}
"""Keys of sensor noise, by table."""

DISTURBANCE = {"disturbance": ("amplitude_N_m", "constant_N_m")}

DURATION = {"simulation": ("duration_s",)}

POWERS = {"s": -1, "rad/s": 1, "1/s": 1, "N m s": 1, "N m": 2}
"""Power of √torque by which a gain scales for the same motion in scaled time, by the gain's unit.
"""


def entries(
    data: Mapping[str, Any], keys: Mapping[str, Sequence[str]]
) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield each table of a dumped scenario that has one of these `keys`, with the key."""
    for name, of_table in keys.items():
        tables = data.get(name, ())
        tables = [*tables.values()] if name == OTHER_SENSORS and tables else tables
        for table in [tables] if isinstance(tables, dict) else tables:
            yield from ((table, key) for key in of_table if table.get(key) is not None)


def turned(scenario: Scenario, turn: Sequence[float]) -> Scenario:
    """Return the scenario in body axes turned such that the attitude `turn` is the new target.

    `turn` (rad) is the rotation vector from the orbit frame to that attitude. Vectors and inertia
    are rotated; numbers of single axes (amplitudes of the periodic torque, dispersions) keep their
    axis number.
    """
    from scipy.spatial.transform import Rotation  # slow to import, and seldom needed

    back = Rotation.from_rotvec(np.asarray(turn, float)).as_matrix()  # of vectors in body axes
    data = scenario.model_dump(exclude_none=True)
    for table, key in entries(data, VECTORS):
        table[key] = _plain(back @ np.array(table[key], float))
    spacecraft = data["spacecraft"]
    if "thruster_torque_axes" in spacecraft:
        rows = np.array(spacecraft["thruster_torque_axes"], float) @ back.T
        spacecraft["thruster_torque_axes"] = tuple(map(_plain, rows))
    spacecraft["inertia_kg_m2"] = _rotate_inertia(spacecraft["inertia_kg_m2"], back)
    model = data["control"].get("model", {})
    if "inertia_kg_m2" in model:
        model["inertia_kg_m2"] = _rotate_inertia(model["inertia_kg_m2"], back)
    start = build_start(scenario)
    into_body = back @ np.asarray(start.attitude.as_dcm().matrix)
    quaternion = Rotation.from_matrix(into_body.T).as_quat(scalar_first=True)
    data["initial"] = {
        "quaternion": _plain(quaternion),
        "omega_rad_s": _plain(back @ np.asarray(start.omega)),
    }
    return Scenario.model_validate(data, context={"law": False})


def _rotate_inertia(moments: Any, back: Float[np.ndarray, "3 3"]) -> tuple[tuple[float, ...], ...]:
    inertia = back @ inertia_matrix(moments) @ back.T
    return tuple(map(_plain, (inertia + inertia.T) / 2))


def _plain(values: np.ndarray) -> tuple[float, ...]:
    return tuple(values.tolist())


def stronger(scenario: Scenario, factor: float) -> Scenario:
    """Return the scenario with `factor` times the torque of every actuator, and scaled gains."""
    control = {"control": with_scaled_gains(scenario, factor)}
    return multiplied(scenario, factor, TORQUES, **control)


def multiplied(
    scenario: Scenario, factor: float, keys: Mapping[str, tuple[str, ...]], **tables: Any
) -> Scenario:
    """Return the scenario with the numbers of `keys`, by table, times `factor`; `tables` replace
    others."""
    data = scenario.model_dump(exclude_none=True) | tables
    for table, key in entries(data, keys):
        table[key] = _times(table[key], factor)
    return Scenario.model_validate(data)


def narrowed(scenario: Scenario, key: str, share: float = 0.5) -> Scenario:
    """Narrow a uniform distribution about its middle by `share`; draws keep their places."""

    def ends(low: Any, high: Any) -> tuple[Any, Any]:
        first, last = np.asarray(low, float), np.asarray(high, float)
        middle, half = (first + last) / 2, share * (last - first) / 2
        return (middle - half).tolist(), (middle + half).tolist()

    data = scenario.model_dump(exclude_none=True)
    table = data["dispersion"][key]
    table["low"], table["high"] = ends(table["low"], table["high"])
    return Scenario.model_validate(data)


def with_scaled_gains(scenario: Scenario, factor: float) -> dict[str, Any]:
    """Return the `[control]` table for `factor` times the torque, with times over √factor."""
    table = scenario.control.model_dump(exclude_none=True)
    for key in scenario.law.declaration.keys:
        power = POWERS.get(getattr(key, "unit", ""), 0)
        value = table.get(key.name)
        is_rate = key.name.endswith("_rad_s") and not key.name.startswith(("ripple", "holding"))
        if value is None or not power or not (key.tunable or (is_rate and key.unit == "rad/s")):
            continue
        table[key.name] = _times(value, math.sqrt(factor) ** power)
    return table


def _times(value: Any, factor: float) -> Any:
    """Scale a number, or each of a tuple."""
    return tuple(factor * one for one in value) if isinstance(value, tuple) else factor * value
