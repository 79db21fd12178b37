"""Quantities derived from a scenario: torque axes, limits, and the coordinates of its loop."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jaxsat.core.allocation import (
    allocation_matrix,
    direction_matrix,
    largest_torque,
    least_propellant,
    least_squares_map,
    plane_map,
    torque_axis,
    torque_directions,
    unit_columns,
)
from jaxsat.core.declaration.actuators import PASSIVE, STEERED
from jaxsat.core.declaration.sensor import TACHOMETER
from jaxsat.core.declaration.sensors import ATTITUDE_SENSORS, HOLD_SAMPLES, OTHER_SENSORS
from jaxsat.core.ranges import STATE_LIMIT
from jaxsat.scenario.parts.torque_makers import TorqueMakers, signs
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.scenario.rules import Values
from jaxsat.scenario.tables import working_axes


def believed_axes(scenario: Any) -> Float[np.ndarray, "3 m"]:
    """Unit columns of the torques that a law of one torque, or of two in any plane, relies on.

    `scenario` is a checked one. For thrusters that push these are the directions in which they make
    torques of either sign, for wheels the `directions` of `TorqueMakers`.
    """
    table, makers = scenario.spacecraft, TorqueMakers.of(scenario)
    if makers.working_wheels:
        return makers.directions[:, :2]
    if makers.thrusters:
        if makers.law.torques == 1:
            return torque_axis(unit_columns(makers.pushes))[:, None]
        return makers.driven_directions
    return working_axes(table.thruster_torque_axes or (), table.failed_thrusters)


def has_invalid_samples(scenario: Any) -> bool:
    """Whether a checked scenario may have samples at which its law makes no step."""
    tachometer_fails = any(one.part == TACHOMETER for one in scenario.failure)
    if tachometer_fails or has_invalid_momenta(scenario):
        return True
    if scenario.gyro is None or predicts_by_dynamics(scenario):
        return False
    fails = any(one.of == "gyro" for one in scenario.failure)
    return fails or scenario.gyro.outage_start_s is not None


def predicts_by_dynamics(scenario: Any) -> bool:
    """Whether the filter of a checked scenario with a sensor of the attitude predicts rates by the
    dynamics."""
    table = scenario.estimator
    by_request = table is not None and table.torque_noise_N_m_sqrt_Hz is not None
    return scenario.gyro is None or by_request


def has_sensors(scenario: Any) -> bool:
    """Whether a checked scenario declares what its sampled law measures."""
    return bool(scenario.sampling or scenario.gyro or attitude_tables(scenario))


def attitude_tables(scenario: Any) -> dict[str, Any]:
    """Tables of the sensors of the attitude that a checked scenario has, in the filter's order.

    They go by their names in `[[failure]]`.
    """
    own = {one.name: getattr(scenario, one.name) for one in ATTITUDE_SENSORS}
    others = {f"{OTHER_SENSORS} {name}": table for name, table in scenario.sensor.items()}
    return {name: table for name, table in (own | others).items() if table is not None}


def has_invalid_momenta(scenario: Any) -> bool:
    """Whether the tachometer of a wheel of a checked scenario has an outage."""
    return any(one.tachometer_outage_start_s is not None for one in scenario.wheel)


def hold_samples_of(scenario: Any) -> int:
    """Number of consecutive samples without a step for which commands are held."""
    return HOLD_SAMPLES if scenario.sampling is None else scenario.sampling.hold_samples


def command_map(axes: tuple[tuple[float, ...], ...], failed: Sequence[int]) -> np.ndarray | None:
    """Body torque per unit of commanded torque, (3, 2); None if the thrusters allow no such map."""
    working = working_axes(axes, failed)
    try:
        return working @ allocation_matrix(working)
    except ValueError:
        return None


def torque_limit(scenario: Any) -> float | None:
    """Largest torque (N m) that the law commands about each axis; None for no limit.

    By default wheels and thrusters can make it about all commanded axes at once.
    """
    limit, makers = scenario.spacecraft.torque_limit_N_m, TorqueMakers.of(scenario)
    torques = makers.law.torques
    if limit is not None or not torques:
        return limit
    if makers.relieved and not makers.thrusters_make_all and makers.all_ways:
        return makers.limit_of_both
    limits = [makers.wheel_limit]
    if makers.pushes.size and not makers.wheels_make_all:
        try:
            torque, cost, command = command_torques(scenario)
            least_propellant(torque, cost, command)
            limits.append(largest_torque(torque, 0.0, 1.0, command))
        except ValueError:
            if not makers.law.commands_actuators:
                raise
    return min((one for one in limits if one is not None), default=None)


def command_torques(scenario: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Full-thrust torques (N m) of the working thrusters, their costs, and the torque per unit
    command.

    Raises `ValueError` where their plane contains no such torques.
    """
    makers = TorqueMakers.of(scenario)
    command = plane_map(makers.pushes, *makers.torques_of_thrusters)
    return makers.pushes, thruster_costs(scenario), command


def ideal_shares(scenario: Any, axes: Float[np.ndarray, "3 m"]) -> Float[np.ndarray, "m torques"]:
    """Torques of ideal thrusters along unit `axes` per unit of each commanded torque.

    Raises `ValueError` if they cannot make these torques, and nothing else makes torques.
    """
    law = scenario.law.declaration
    if TorqueMakers.of(scenario).working_wheels or any(getattr(scenario, name) for name in STEERED):
        return least_squares_map(axes, law.torques)
    if law.any_plane:
        return direction_matrix(axes, torque_directions(axes))
    return allocation_matrix(axes, law.torques)


def thruster_costs(scenario: Any) -> np.ndarray:
    """Cost of full thrust of each thruster: its propellant flow or, if any has none, its torque.

    Both are multiplied by the thruster's `price`.
    """
    working = [one for one in scenario.thruster if not one.failed for _ in signs(one)]
    costs = np.array([one.propellant_flow() for one in working])
    if not costs.all():
        costs = np.sqrt(np.sum(TorqueMakers.of(scenario).pushes ** 2, axis=0))
    return costs * [one.price for one in working]


ERROR_COORDINATE_KEYS = (
    "control.law",
    "spacecraft.inertia_kg_m2",
    "spacecraft.thruster_torque_axes",
    "spacecraft.failed_thrusters",
    "spacecraft.torque_limit_N_m",
    "wheel",
    *(one.name for one in PASSIVE),
    "failure",
    "orbit.rate_rad_s",
    "orbit.altitude_km",
    "orbit.relation",
)
"""Keys that `error_coordinate_obstacle` reads of every scenario (and `[control.model]`)."""


def torque_jumps(values: Values) -> bool:
    """Whether the law's torque is discontinuous, as in the printed (42), for lack of a width."""
    widths = values["control.law"].declaration.jumps_without
    return any(not values.get(f"control.{width}", 0) for width in widths)


def error_coordinate_obstacle(values: Values) -> str | None:
    """Reason why error coordinates do not hold, as a clause; None if they hold."""
    if not values["control.law"].declaration.tracks_rates:
        return f'the law is "{values["control.law"]}"'
    if values["spacecraft.torque_limit_N_m"] is not None:
        return "the torque is limited"
    if values["wheel"]:
        return "the spacecraft has wheels"
    if any(values[one.name] for one in PASSIVE):
        return "the spacecraft has parts that move by themselves"
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
    """Whether `simulation.coordinates`, with "auto" resolved, are error coordinates."""
    coordinates = values["simulation.coordinates"]
    if coordinates != "auto":
        return coordinates == "error"
    return torque_jumps(values) and error_coordinate_obstacle(values) is None


def is_upside_down(quaternion: tuple[float, ...]) -> bool:
    """Whether (w, z) of an attitude are beyond the limit at which a run stops."""
    return quaternion[0] ** 2 + quaternion[3] ** 2 < 1 / STATE_LIMIT**2  # cos² of half the tilt


def _model_is_plant(values: Values, inertia: np.ndarray) -> bool:
    model_inertia = values.get("control.model.inertia_kg_m2")
    if model_inertia is not None and not np.array_equal(inertia_matrix(model_inertia), inertia):
        return False
    relation = values.get("control.model.orbit_relation")
    if relation not in (None, values["orbit.relation"]):
        return False
    rate = values.get("control.model.orbit_rate_rad_s")
    return rate is None or rate == values["orbit.rate_rad_s"]
