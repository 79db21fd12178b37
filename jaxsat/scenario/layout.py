"""The torque axes of a scenario's thrusters after failures."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jaxsat.core.allocation import (
    allocation_matrix,
    largest_torque,
    least_propellant,
    plane_map,
    pushed_directions,
    torque_axis,
    unit_columns,
)
from jaxsat.scenario.parts.thrusters import signs, working_torques
from jaxsat.scenario.parts.wheels import limit_of_wheels, wheels_make_all
from jaxsat.scenario.tables import working_axes


def believed_axes(scenario: Any) -> Float[np.ndarray, "3 m"]:
    """A unit column for each torque that a law of one torque, or of two in any plane, counts on.

    `scenario` is a checked one. Of thrusters that push these are the directions in which they make
    torques of either sign, of wheels body x and y.
    """
    table = scenario.spacecraft
    if scenario.wheel:
        return np.eye(3)[:, :2]
    if scenario.thruster:
        torques = working_torques(scenario.thruster)
        if scenario.law.declaration.torques == 1:
            return torque_axis(unit_columns(torques))[:, None]
        return pushed_directions(torques)
    return working_axes(table.thruster_torque_axes or (), table.failed_thrusters)


def command_map(axes: tuple[tuple[float, ...], ...], failed: Sequence[int]) -> np.ndarray | None:
    """Body torque for each unit of commanded torque, (3, 2); None where there is no such map."""
    working = working_axes(axes, failed)
    try:
        return working @ allocation_matrix(working)
    except ValueError:
        return None


def torque_limit(scenario: Any) -> float | None:
    """The largest torque (N m) that the law asks for about each axis; None for no limit.

    By default it is what wheels and thrusters can make about all commanded axes at once.
    """
    given = scenario.spacecraft.torque_limit_N_m
    torques = scenario.law.declaration.torques
    if given is not None or not torques:
        return given
    limits = []
    if scenario.wheel:
        limits.append(limit_of_wheels(scenario.wheel, torques))
    if scenario.thruster and not (scenario.wheel and wheels_make_all(scenario.wheel, torques)):
        limits.append(largest_torque(least_propellant(*command_torques(scenario, torques))))
    return min((one for one in limits if one is not None), default=None)


def command_torques(scenario: Any, torques: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Torques (N m) of the thrusters that work, their costs, and the torque of a unit of command.

    All are at full thrust.
    """
    torque = working_torques(scenario.thruster)
    any_plane = scenario.law.declaration.any_plane and not scenario.wheel
    return torque, thruster_costs(scenario), plane_map(torque, torques, any_plane)


def thruster_costs(scenario: Any) -> np.ndarray:
    """Of full thrust of each thruster: its propellant flow or, if any has none, its torque."""
    flows = [
        one.propellant_flow() for one in scenario.thruster if not one.failed for _ in signs(one)
    ]
    if all(flows):
        return np.array(flows)
    return np.sqrt(np.sum(working_torques(scenario.thruster) ** 2, axis=0))
