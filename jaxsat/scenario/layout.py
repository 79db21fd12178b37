"""The thrusters of a scenario as the objects of `jaxsat.vehicle`."""

from collections.abc import Sequence

import numpy as np

from jaxsat.vehicle import Thrusters, allocation


def working_thrusters(axes: tuple[tuple[float, ...], ...], failed: Sequence[int]) -> Thrusters:
    """What the failures leave of thrusters given as one row of direction cosines each."""
    return Thrusters(np.array(axes, dtype=float).T).without(failed)


def command_map(axes: tuple[tuple[float, ...], ...], failed: Sequence[int]) -> np.ndarray | None:
    """Body torque for each unit of commanded torque, (3, 2); None where there is no such map."""
    try:
        thrusters = working_thrusters(axes, failed)
        thrust_map = allocation(thrusters)
    except ValueError:
        return None
    return np.asarray(thrusters.torque_axes) @ np.asarray(thrust_map)
