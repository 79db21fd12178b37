"""From a scenario to the plant."""

from typing import cast

import numpy as np

from jaxsat.checks import as_float
from jaxsat.dynamics import RigidBody
from jaxsat.environment import (
    AbstractDisturbance,
    AbstractOrbit,
    ConstantTorque,
    ExactOrbit,
    GravityGradient,
    PeriodicTorque,
    SmallAngleOrbit,
    SumOfDisturbances,
    circular_orbit_rate,
)
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.tables import DisturbanceTable
from jaxsat.vehicle import Spacecraft


def build_plant(scenario: Scenario) -> RigidBody:
    """The rigid body in its orbit under its disturbances."""
    table = scenario.spacecraft
    spacecraft = Spacecraft(as_float(table.inertia_kg_m2))
    orbit = orbit_of(scenario.orbit.relation, orbit_rate(scenario))
    held = table.third_rate == "held"
    return RigidBody(spacecraft, orbit, _disturbance(scenario), held)


def orbit_rate(scenario: Scenario) -> float:
    """ω0, rad/s, given or by the altitude."""
    rate, altitude = scenario.orbit.rate_rad_s, scenario.orbit.altitude_km
    return circular_orbit_rate(1000 * cast(float, altitude)) if rate is None else rate


def orbit_of(relation: str, rate: float) -> AbstractOrbit:
    """The orbit of the scenario or of a model of it."""
    return (ExactOrbit if relation == "exact" else SmallAngleOrbit)(as_float(rate))


def periodic_torque(
    amplitude: tuple[float, ...] | np.ndarray, table: DisturbanceTable
) -> PeriodicTorque:
    """A periodic torque of these amplitudes (N m), the rest as the table says."""
    return PeriodicTorque(
        as_float(amplitude), as_float(table.frequency_rad_s), as_float(table.phase_rad)
    )


def _disturbance(scenario: Scenario) -> AbstractDisturbance:
    table = scenario.disturbance
    terms: list[AbstractDisturbance] = [periodic_torque(table.amplitude_N_m, table)]
    if any(table.constant_N_m):
        terms.append(ConstantTorque(as_float(table.constant_N_m)))
    if table.gravity_gradient:
        terms.append(GravityGradient(as_float(orbit_rate(scenario))))
    return terms[0] if len(terms) == 1 else SumOfDisturbances(tuple(terms))
