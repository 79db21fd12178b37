"""The torque axes of a scenario's thrusters after failures."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from jaxsat.allocation import allocation_matrix, torque_axis, torque_directions, unit_columns
from jaxsat.scenario.laws import find_law
from jaxsat.scenario.thruster_tables import working_torques


def working_axes(
    axes: tuple[tuple[float, ...], ...], failed: Sequence[int]
) -> Float[np.ndarray, "3 m"]:
    """A unit column for each thruster left, of one row of direction cosines for each thruster."""
    kept = [row for number, row in enumerate(axes, 1) if number not in failed]
    return unit_columns(np.array(kept, dtype=float).reshape(-1, 3).T)


def believed_axes(scenario: Any) -> Float[np.ndarray, "3 m"]:
    """A unit column for each torque that a law of one torque, or of two in any plane, counts on.

    `scenario` is a checked one. Of thrusters that push these are the directions in which they make
    torques of either sign, of wheels body x and y.
    """
    table = scenario.spacecraft
    if scenario.wheel:
        return np.eye(3)[:, :2]
    if scenario.thruster:
        torques = unit_columns(working_torques(scenario.thruster))
        if find_law(scenario.control.law).declaration.torques == 1:
            return torque_axis(torques)[:, None]
        return torque_directions(torques)
    return working_axes(table.thruster_torque_axes or (), table.failed_thrusters)


def command_map(axes: tuple[tuple[float, ...], ...], failed: Sequence[int]) -> np.ndarray | None:
    """Body torque for each unit of commanded torque, (3, 2); None where there is no such map."""
    working = working_axes(axes, failed)
    try:
        return working @ allocation_matrix(working)
    except ValueError:
        return None
