"""Construction of the inputs of a sampled law: sensors, delay, navigation."""

import dataclasses
from typing import Any, cast

import numpy as np

from jaxsat.control.navigation.dynamics_filter import DynamicsFilter, TorqueModel
from jaxsat.control.navigation.estimator import AbstractEstimator, EstimatorContext, RawMeasurements
from jaxsat.control.navigation.innovation import InnovationTest
from jaxsat.control.navigation.mekf import MultiplicativeFilter
from jaxsat.control.navigation.navigation import Navigation
from jaxsat.core.allocation import unit_columns
from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.sensor import TACHOMETER, VectorDeclaration, vector_sensor
from jaxsat.core.declaration.sensors import (
    GYRO,
    OTHER_SENSORS,
    PATIENCE,
    PROBATION,
    SENSORS,
    STAR_TRACKER,
)
from jaxsat.core.noise import key_of_seed
from jaxsat.scenario.build.plant import gravity_gradient, orbit_of, sensor_context
from jaxsat.scenario.build.plugin_trial import made_part, require_estimates, require_vector
from jaxsat.scenario.derived import attitude_tables, has_invalid_momenta, predicts_by_dynamics
from jaxsat.scenario.parts.estimator import OwnEstimatorTable
from jaxsat.scenario.parts.named import PartTable, number_of
from jaxsat.scenario.parts.sensors import SamplingTable
from jaxsat.scenario.plugins import ESTIMATOR, SENSOR, find_part
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.environment.disturbances import NoDisturbance
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.navigation_sensors import SensorContext
from jaxsat.spacecraft.sensor_failures import GyroFailures, SensorFailures, TachometerFailures
from jaxsat.spacecraft.sensors import Sensors, Tachometers
from jaxsat.spacecraft.vector_sensors import VectorSensor


def build_sampling(scenario: Scenario) -> tuple[Sensors | None, RealScalar | None]:
    """Return sensors and delay; None for those that are perfect in every case.

    Both are None with sensors of the attitude, see `build_navigation`.
    """
    values = dict(scenario.sampling or SamplingTable())

    def differs(name: str) -> bool:
        return values[name] > 0 or getattr(scenario.dispersion, name, None) is not None

    white = scenario.gyro is None and not attitude_tables(scenario)
    noisy = white and (differs("rate_noise_rad_s") or differs("attitude_noise_rad"))
    key = key_of_seed(scenario.simulation.seed)
    return (
        Sensors.from_table(values, key) if noisy else None,
        as_float(values["delay_s"]) if differs("delay_s") else None,
    )


def build_tachometers(scenario: Scenario) -> Tachometers | None:
    """Return the tachometers of a sampled law; None if all are exact and none has an outage or
    fails."""
    noise, key = tachometer_noise(scenario), key_of_seed(scenario.simulation.seed)
    strikes = ((number_of(one.of, TACHOMETER, scenario.wheel), one) for one in scenario.failure)
    numbered = [(number, one) for number, one in strikes if number is not None]
    failures = TachometerFailures.from_tables(numbered)
    if has_invalid_momenta(scenario):
        names = (f"tachometer_outage{end}_s" for end in ("_start", "", "_every"))
        times = [[getattr(one, name) for one in scenario.wheel] for name in names]
        start, length, every = (
            [other if x is None else x for x in numbers]
            for numbers, other in zip(times, (np.inf, 0.0, np.inf), strict=True)
        )
        is_single = np.isinf(every).all()
        return Tachometers(noise, key, start, length, None if is_single else every, failures)
    fails = noise.any() or failures is not None
    return Tachometers(noise, key, failures=failures) if fails else None


def tachometer_noise(scenario: Scenario) -> np.ndarray:
    """Standard deviation of the noise on the momentum of each wheel, N m s."""
    return np.array([one.tachometer_noise_N_m_s for one in scenario.wheel])


def _sensors(scenario: Scenario) -> dict[str, Any]:
    """The sensors of a scenario by the names of their tables, those of packages last."""
    context = sensor_context(scenario)
    tables = [(one, getattr(scenario, one.name)) for one in SENSORS]
    own = {
        one.name: one.from_table(dict(table), context) for one, table in tables if table is not None
    }
    others = {name: _other(name, table, context) for name, table in scenario.sensor.items()}
    return own | others


def _other(name: str, table: PartTable, context: SensorContext) -> VectorSensor:
    """A sensor that does not come with jaxsat."""
    part, location = find_part(SENSOR, table.kind), (OTHER_SENSORS, name, "kind")
    vector = made_part(part, location, table, context)
    require_vector(part, location, vector)
    unit = cast(VectorDeclaration, part.declaration).unit
    return vector_sensor(name, unit, vector, dict(table), context)


def build_navigation(scenario: Scenario, plant: RigidBody) -> Navigation | None:
    """Return sensors and estimator between the plant and a sampled law; None without sensors.

    The estimator knows the declared sensors and the orbit of the scenario. If it predicts rates by
    the dynamics, it also knows the spacecraft of the scenario: `plant`, but without failures, and
    of its disturbances the gravity gradient alone.
    """
    if scenario.gyro is None and not attitude_tables(scenario):
        return None
    sensors, period = _sensors(scenario), as_float(scenario.control.period_s)
    gyro, tracker = sensors.pop(GYRO.name, None), sensors.pop(STAR_TRACKER.name, None)
    if gyro is not None:
        strikes = [(0, one) for one in scenario.failure if one.of == GYRO.name]
        gyro = dataclasses.replace(gyro, failures=GyroFailures.from_tables(strikes))
    table: Any = scenario.estimator or OwnEstimatorTable()
    orbit = orbit_of(scenario.orbit.relation, scenario.orbit.rate())
    navigation = Navigation(
        gyro,
        tracker,
        estimator=RawMeasurements(),
        attitude_sigma=table.attitude_sigma_rad,
        key=key_of_seed(scenario.simulation.seed),
        failures=_failures(scenario, orbit),
        body=_declared(scenario, plant) if predicts_by_dynamics(scenario) else None,
        vectors=tuple(sensors.values()),
    )
    parts = (navigation.gyro, navigation.tracker, orbit, period, navigation.vectors)
    estimator = _estimator(scenario, EstimatorContext(*parts, navigation.body), navigation)
    return dataclasses.replace(navigation, estimator=estimator)


def _declared(scenario: Scenario, plant: RigidBody) -> RigidBody:
    """The body that an estimator by the dynamics supposes."""
    effectors = tuple(one.without_corners() for one in plant.effectors)
    disturbance = gravity_gradient(scenario) or NoDisturbance()
    return dataclasses.replace(plant, disturbance=disturbance, effectors=effectors)


def _failures(scenario: Scenario, orbit: AbstractOrbit) -> SensorFailures | None:
    """Failures of the attitude sensors, numbered among those of the scenario."""
    names = [*attitude_tables(scenario)]
    strikes = [(names.index(one.of), one) for one in scenario.failure if one.of in names]
    return SensorFailures.from_tables(strikes, orbit)


def _estimator(
    scenario: Scenario, context: EstimatorContext, navigation: Navigation
) -> AbstractEstimator:
    table: Any = scenario.estimator or OwnEstimatorTable()
    if table.kind == "none":
        return RawMeasurements()
    if table.kind == "mekf":
        noise = tuple(one.noise for one in context.vectors)
        arguments: dict[str, Any] = {
            "tracker": context.tracker,
            "vector_noise": noise,
            "vector_latency": context.latency,
            "test": _test(table),
        }
        if context.body is None:
            assert context.gyro is not None
            return MultiplicativeFilter(orbit=context.orbit, gyro=context.gyro, **arguments)
        torques = TorqueModel(
            table.torque_noise_N_m_sqrt_Hz,
            table.torque_sigma_N_m,
            table.torque_walk_N_m_s_sqrt_Hz,
        )
        return DynamicsFilter(
            body=context.body,
            torques=torques,
            rate_sigma=table.rate_sigma_rad_s,
            momentum_noise=_momentum_noise(scenario),
            gyro=context.gyro,
            **arguments,
        )
    part, location = find_part(ESTIMATOR, table.kind), ("estimator", "kind")
    estimator = made_part(part, location, table, context)
    require_estimates(part, location, estimator, context.period, navigation.example())
    return estimator


def _momentum_noise(scenario: Scenario) -> np.ndarray | None:
    """Covariance of the measured momentum of all wheels in body axes, N² m² s²; None for zero."""
    noise = tachometer_noise(scenario)
    if not noise.any():
        return None
    axes = unit_columns(np.array([one.axis for one in scenario.wheel], float).T)
    return axes @ np.diag(noise**2) @ axes.T


def _test(table: Any) -> InnovationTest | None:
    """The test of innovations that a table `[estimator]` asks for; None without."""
    probability = table.false_alarm_probability
    if probability is None:
        return None
    return InnovationTest(probability, table.patience or PATIENCE, table.probation or PROBATION)
