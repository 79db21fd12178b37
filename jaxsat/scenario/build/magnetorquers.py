"""From a scenario to its magnetorquers, and how they share in a command."""

import numpy as np

from jaxsat.control.steering import MagneticSteering
from jaxsat.scenario.parts.magnetorquers import UnloadingTable
from jaxsat.scenario.parts.wheels import left_by_wheels, wheel_axes
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft import Magnetorquers


def build_steering(scenario: Scenario, torquers: Magnetorquers) -> MagneticSteering:
    """Dipoles for what wheels do not make of a command of three torques, and that unload them."""
    axes, working = np.asarray(torquers.axes), [not one.failed for one in scenario.magnetorquer]
    shares = np.zeros((axes.shape[1], 3))
    shares[working] = np.linalg.pinv(axes[:, working])
    unloading = scenario.unloading or UnloadingTable()
    wheels = scenario.wheel
    return MagneticSteering(
        torquers.field,
        axes,
        shares,
        torquers.dipole_limit,
        left_by_wheels(wheels, 3) if wheels else np.eye(3),
        1 / unloading.time_constant_s,
        wheel_axes(wheels) if wheels else None,
    )
