"""Where the loop of (43), in error coordinates, holds for a scenario."""

import numpy as np

from jaxsat.core.ranges import STATE_LIMIT
from jaxsat.scenario.layout import command_map
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.scenario.rules import Values

ERROR_COORDINATE_KEYS = (
    "control.law",
    "spacecraft.inertia_kg_m2",
    "spacecraft.thruster_torque_axes",
    "spacecraft.failed_thrusters",
    "spacecraft.torque_limit_N_m",
    "wheel",
    "failure",
    "orbit.rate_rad_s",
    "orbit.altitude_km",
    "orbit.relation",
)
"""Keys that `error_coordinate_obstacle` reads of every scenario (and `[control.model]`)."""


def torque_jumps(values: Values) -> bool:
    """Whether the law's torque jumps, as that of the printed (42), for want of a width."""
    widths = values["control.law"].declaration.jumps_without
    return any(not values.get(f"control.{width}", 0) for width in widths)


def error_coordinate_obstacle(values: Values) -> str | None:
    """Why error coordinates do not hold, as a clause; None where they do."""
    if not values["control.law"].declaration.tracks_rates:
        return f'the law is "{values["control.law"]}"'
    if values["spacecraft.torque_limit_N_m"] is not None:
        return "the torque is limited"
    if values["wheel"]:
        return "the spacecraft has wheels"
    if values["failure"]:
        return "something fails in flight"
    if "actuators.kind" in values:
        return "the actuators are not jaxsat's own"
    if values["spacecraft.thruster_torque_axes"] is None:
        return "the thrusters push"
    inertia = inertia_matrix(values["spacecraft.inertia_kg_m2"])
    if np.any(inertia != np.diag(np.diag(inertia))):
        return "the body axes are not principal axes"
    torque = command_map(
        values["spacecraft.thruster_torque_axes"], values["spacecraft.failed_thrusters"]
    )
    if torque is None or np.abs(torque - np.eye(3)[:, :2]).max() > 1e-12:
        return "the thrusters do not turn a command into torques about body x and y alone"
    if not _model_is_plant(values, inertia):
        return "the controller's model differs from the plant"
    return None


def uses_error_coordinates(values: Values) -> bool:
    """What `simulation.coordinates` comes to."""
    asked = values["simulation.coordinates"]
    if asked != "auto":
        return asked == "error"
    return torque_jumps(values) and error_coordinate_obstacle(values) is None


def is_upside_down(quaternion: tuple[float, ...]) -> bool:
    """Whether (w, z) of an attitude are beyond what a run goes on with."""
    return quaternion[0] ** 2 + quaternion[3] ** 2 < 1 / STATE_LIMIT**2  # cos² of half the tilt


def _model_is_plant(values: Values, inertia: np.ndarray) -> bool:
    believed = values.get("control.model.inertia_kg_m2")
    if believed is not None and not np.array_equal(inertia_matrix(believed), inertia):
        return False
    relation = values.get("control.model.orbit_relation")
    if relation not in (None, values["orbit.relation"]):
        return False
    rate = values.get("control.model.orbit_rate_rad_s")
    return rate is None or rate == values["orbit.rate_rad_s"]
