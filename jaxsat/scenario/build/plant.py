"""Construction of the plant of a scenario."""

import pkgutil
from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxsat.core.array_types import Matrix, RealScalar
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.actuators import EFFECTORS
from jaxsat.core.declaration.disturbances import DISTURBANCES
from jaxsat.core.earth import EARTH_OBLATENESS, epoch_of
from jaxsat.scenario.build.plugin_trial import at_code_of, made_part, require_torque
from jaxsat.scenario.parts.disturbances import DisturbanceTable
from jaxsat.scenario.parts.named import PartTable, number_of
from jaxsat.scenario.parts.orbit import OrbitTable
from jaxsat.scenario.plugins import DISTURBANCE, find_part
from jaxsat.scenario.quantities import inertia_matrix, values_of
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.effector import AbstractEffector, EffectorContext
from jaxsat.spacecraft.environment.disturbances import (
    AbstractDisturbance,
    DisturbanceContext,
    GravityGradient,
    PeriodicTorque,
    SumOfDisturbances,
)
from jaxsat.spacecraft.environment.ellipse import EllipticOrbit
from jaxsat.spacecraft.environment.igrf import IgrfField
from jaxsat.spacecraft.environment.orbit import (
    AbstractMagneticField,
    AbstractOrbit,
    AbstractPlace,
    CircularOrbit,
    DipoleField,
    ExactOrbit,
    SmallAngleOrbit,
)
from jaxsat.spacecraft.environment.orbital_torques import Sunlight
from jaxsat.spacecraft.navigation_sensors import SensorContext
from jaxsat.spacecraft.spacecraft import Spacecraft


def build_plant(scenario: Scenario) -> RigidBody:
    """Return the rigid body in its orbit under its disturbances."""
    table = scenario.spacecraft
    spacecraft = Spacecraft(as_float(table.inertia_kg_m2))
    orbit = orbit_of(scenario.orbit.relation, scenario.orbit.rate())
    holds_third_rate = table.third_rate == "held"
    disturbance = _disturbance(scenario, np.asarray(spacecraft.inertia))
    effectors = tuple(effector for effector, _ in build_effectors(scenario))
    return RigidBody(spacecraft, orbit, disturbance, holds_third_rate, effectors)


def build_effectors(scenario: Scenario) -> list[tuple[AbstractEffector, Any]]:
    """Return the effectors of a scenario's body in their order there, and their initial states."""
    effectors = []
    for kind in EFFECTORS:
        tables = getattr(scenario, kind.name)
        if tables:
            strikes = ((number_of(one.of, kind.name, tables), one) for one in scenario.failure)
            failures = tuple((number, one) for number, one in strikes if number is not None)
            context = effector_context(scenario, failures)
            with at_code_of(kind.effector, (kind.name,), "can be built"):
                effectors.append(kind.from_tables(tables, context))
    return effectors


def effector_context(
    scenario: Scenario, failures: tuple[tuple[int, Any], ...] = ()
) -> EffectorContext:
    """Return the inputs of a scenario for effectors of one kind, with these failures of theirs."""
    return EffectorContext(field_of(scenario.orbit), _sunlight(scenario), failures)


def orbit_of(relation: str, rate: float) -> AbstractOrbit:
    """Return the orbit of the scenario or of a model of it."""
    return (ExactOrbit if relation == "exact" else SmallAngleOrbit)(as_float(rate))


def sunlight_of(
    table: OrbitTable, sun_direction: Sequence[float], eclipses: bool = False
) -> Sunlight:
    """Return the Sun's position for a direction in inertial axes, along the orbit of a table."""
    return Sunlight(np.asarray(sun_direction, float), place_of(table), eclipses)


def place_of(table: OrbitTable) -> AbstractPlace:
    """Return the orbit of a table, with the position about the Earth."""
    ellipse = table.ellipse()
    if ellipse is not None:
        return EllipticOrbit(
            *ellipse,
            table.inclination_rad,
            table.ascending_node_rad,
            table.argument_of_perigee_rad or 0.0,
            table.mean_anomaly_rad or 0.0,
            table.greenwich(),
            EARTH_OBLATENESS if table.j2 else 0.0,
        )
    angles = (
        table.inclination_rad,
        table.ascending_node_rad,
        table.argument_of_latitude_rad,
        table.greenwich(),
    )
    return CircularOrbit(table.rate(), *angles)


def sensor_context(scenario: Scenario) -> SensorContext:
    """Return the data that sensors need of a scenario with a sampled law."""
    field, sunlight = field_of(scenario.orbit), _sunlight(scenario)
    return SensorContext(scenario.control.period_s, field, sunlight)


def _sunlight(scenario: Scenario) -> Sunlight:
    light = scenario.disturbance
    return sunlight_of(scenario.orbit, light.sun_direction, light.eclipses)


def field_of(table: OrbitTable) -> AbstractMagneticField:
    """Return the magnetic field along the orbit of a table."""
    place = place_of(table)
    if table.field == "dipole" or table.epoch is None or not isinstance(place, CircularOrbit):
        return DipoleField(place)
    return IgrfField(place, epoch_of(table.epoch))


def periodic_torque(
    amplitude: tuple[float, ...] | np.ndarray, table: DisturbanceTable
) -> PeriodicTorque:
    """Return a periodic torque with these amplitudes (N m), the rest from the table."""
    return PeriodicTorque(
        as_float(amplitude), as_float(table.frequency_rad_s), as_float(table.phase_rad)
    )


def _disturbance(scenario: Scenario, inertia: np.ndarray) -> AbstractDisturbance:
    """All torques of the scenario; that of (2) is always included."""
    table = scenario.disturbance
    context, values = _disturbance_inputs(scenario, inertia)
    own = [pkgutil.resolve_name(name).from_table(values, context) for name in DISTURBANCES]
    terms: list[AbstractDisturbance] = [one for one in own if one is not None]
    in_wz = scenario.simulation.attitude == "wz"
    terms += [_other(name, other, context, in_wz) for name, other in table.torques.items()]
    return terms[0] if len(terms) == 1 else SumOfDisturbances(tuple(terms))


def _disturbance_inputs(
    scenario: Scenario, inertia: np.ndarray
) -> tuple[DisturbanceContext, dict[str, Any]]:
    """The context of jaxsat's own disturbances, and the values of all their keys."""
    field, light = field_of(scenario.orbit), _sunlight(scenario)
    context = DisturbanceContext(inertia, scenario.orbit.rate(), field, scenario.panel, light)
    keys = (key for part in DISTURBANCES.values() for key in part.keys)
    return context, values_of(keys, scenario.disturbance)


def gravity_gradient(scenario: Scenario) -> AbstractDisturbance | None:
    """Return the gravity-gradient torque of the scenario; None where it is disabled."""
    inertia = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    context, values = _disturbance_inputs(scenario, inertia)
    return GravityGradient.from_table(values, context)


def _other(
    name: str, table: PartTable, context: DisturbanceContext, in_wz: bool
) -> AbstractDisturbance:
    """A disturbance that does not come with jaxsat."""
    part = find_part(DISTURBANCE, table.kind)
    location = ("disturbance", "torques", name, "kind")
    disturbance = made_part(part, location, table, context)

    def torque(t: RealScalar, inertia: Matrix) -> Any:
        attitude = Quaternion(as_float([1.0, 0.0, 0.0, 0.0]))
        return disturbance(t, attitude.as_wz() if in_wz else attitude, inertia)

    require_torque(part, location, torque, as_float(0.0), as_float(context.inertia))
    return disturbance
