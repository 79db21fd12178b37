"""Variants of a scenario for tuning: fixed coordinates, finer steps, thrust in place of pulses."""

import math
from typing import Any, cast

from jaxsat.scenario.derived import uses_error_coordinates
from jaxsat.scenario.parts.thrusters import ModulationTable
from jaxsat.scenario.resolution import substeps_of
from jaxsat.scenario.schema import Scenario, flattened
from jaxsat.scenario.tuning import TuningTable

FINER = 10.0
"""Factor by which tolerances of the refined run are smaller; fixed steps are halved."""


STEPS_A_SECOND = 6
"""Default limit of adaptive steps per second of a run: gains that make the loop stiff would delay
all others."""


def in_one_form(scenario: Scenario, table: TuningTable) -> Scenario:
    """Return the scenario with explicit coordinates and steps, common to smooth and exact law."""
    simulation, solver = scenario.simulation, scenario.simulation.solver
    if scenario.law.declaration.sampled:
        return scenario
    error = uses_error_coordinates(flattened(scenario) | {"control.law": scenario.law})
    if solver.step_s is None and solver.steps != "fixed":
        adaptive_keys = {
            "rtol": solver.rtol or table.tolerance,
            "atol": solver.atol or table.tolerance,
            "max_steps": solver.max_steps or math.ceil(STEPS_A_SECOND * simulation.duration_s),
        }
        solver = solver.model_copy(update={"steps": "adaptive", **adaptive_keys})
    coordinates = "error" if error else "torque"
    return scenario.with_keys("simulation", coordinates=coordinates, solver=solver)


def refined(scenario: Scenario) -> Scenario:
    """Return the scenario with finer steps."""
    solver = scenario.simulation.solver
    if scenario.law.declaration.sampled:
        changes: dict[str, Any] = {"substeps": 2 * substeps_of(scenario)}
    elif solver.step_s is not None:
        changes = {"step_s": solver.step_s / 2}
    else:
        changes = {name: cast(float, getattr(solver, name)) / FINER for name in ("rtol", "atol")}
    return scenario.with_keys("simulation.solver", **changes)


def throttled(scenario: Scenario) -> Scenario:
    """Return the scenario with thrust in place of pulses, whose dead zones have no derivative.

    Gradients are taken of it; costs are those of the pulses all the same.
    """
    if not scenario.thruster:
        return scenario
    return scenario.model_copy(update={"modulation": ModulationTable(kind="ideal")})
