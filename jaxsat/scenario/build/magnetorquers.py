"""From a scenario to its magnetorquers, and how they share in a command."""

import numpy as np

from jaxsat.control.steering import MagneticSteering
from jaxsat.core.allocation import unit_columns
from jaxsat.scenario.build.failures import magnetorquer_failures
from jaxsat.scenario.magnetorquer_tables import UnloadingTable
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.wheel_tables import left_by_wheels, wheel_axes
from jaxsat.spacecraft import Magnetorquers
from jaxsat.spacecraft.environment import DipoleField


def build_magnetorquers(scenario: Scenario, field: DipoleField) -> Magnetorquers | None:
    """The magnetorquers of a scenario in a field; None without any."""
    if not scenario.magnetorquer:
        return None
    failures = magnetorquer_failures(scenario)
    return Magnetorquers(_axes(scenario), _limits(scenario), field, failures)


def build_steering(scenario: Scenario, field: DipoleField) -> MagneticSteering:
    """Dipoles for what wheels do not make of a command of three torques, and that unload them."""
    axes, working = _axes(scenario), [not one.failed for one in scenario.magnetorquer]
    shares = np.zeros((axes.shape[1], 3))
    shares[working] = np.linalg.pinv(axes[:, working])
    unloading = scenario.unloading or UnloadingTable()
    wheels = scenario.wheel
    return MagneticSteering(
        field,
        axes,
        shares,
        _limits(scenario),
        left_by_wheels(wheels, 3) if wheels else np.eye(3),
        1 / unloading.time_constant_s,
        wheel_axes(wheels) if wheels else None,
    )


def _axes(scenario: Scenario) -> np.ndarray:
    return unit_columns(np.array([one.axis for one in scenario.magnetorquer], float).T)


def _limits(scenario: Scenario) -> np.ndarray:
    return np.array([one.dipole_limit_A_m2 for one in scenario.magnetorquer])
