"""The same vehicle in body axes that are turned, so that another attitude is the wanted one."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from jaxsat.scenario import Scenario
from jaxsat.scenario.build.run import build_start
from jaxsat.scenario.quantities import inertia_matrix

VECTORS: Mapping[str, Sequence[str]] = {
    "thruster": ("position_m", "direction", "torque_axis"),
    "wheel": ("axis",),
    "disturbance": (
        "constant_N_m",
        "residual_dipole_A_m2",
        "drag_centre_m",
        "solar_centre_m",
    ),
    "star_tracker": ("boresight",),
}
"""Keys that hold a vector in body axes, by table."""


def turned(scenario: Scenario, turn: Sequence[float]) -> Scenario:
    """The scenario in the body axes in which the attitude turned by `turn` is the orbit frame's.

    `turn` (rad) is the rotation vector from the orbit frame to that attitude. Vectors and inertia
    are turned; numbers of single axes (amplitudes of the periodic torque, dispersions) stay with
    the axes of their number.
    """
    back = Rotation.from_rotvec(np.asarray(turn, float)).as_matrix()  # of vectors in body axes
    data = scenario.model_dump(exclude_none=True)
    for name, keys in VECTORS.items():
        tables = data.get(name, ())
        for table in [tables] if isinstance(tables, dict) else tables:
            for key in keys:
                if table.get(key) is not None:
                    table[key] = _plain(back @ np.array(table[key], float))
    spacecraft = data["spacecraft"]
    if "thruster_torque_axes" in spacecraft:
        rows = np.array(spacecraft["thruster_torque_axes"], float) @ back.T
        spacecraft["thruster_torque_axes"] = tuple(map(_plain, rows))
    spacecraft["inertia_kg_m2"] = _turned_inertia(spacecraft["inertia_kg_m2"], back)
    model = data["control"].get("model", {})
    if "inertia_kg_m2" in model:
        model["inertia_kg_m2"] = _turned_inertia(model["inertia_kg_m2"], back)
    start = build_start(scenario)
    into_body = back @ np.asarray(start.attitude.as_dcm().matrix)
    quaternion = Rotation.from_matrix(into_body.T).as_quat(scalar_first=True)
    data["initial"] = {
        "quaternion": _plain(quaternion),
        "omega_rad_s": _plain(back @ np.asarray(start.omega)),
    }
    return Scenario.model_validate(data, context={"law": False})


def _turned_inertia(given: Any, back: Float[np.ndarray, "3 3"]) -> tuple[tuple[float, ...], ...]:
    inertia = back @ inertia_matrix(given) @ back.T
    return tuple(map(_plain, (inertia + inertia.T) / 2))


def _plain(values: np.ndarray) -> tuple[float, ...]:
    return tuple(values.tolist())
