"""Construction of the inputs of a sampled law: sensors, delay, navigation."""

import dataclasses
from typing import Any

import numpy as np

from jaxsat.control.navigation.dynamics_filter import DynamicsFilter, TorqueModel
from jaxsat.control.navigation.estimator import AbstractEstimator, EstimatorContext, RawMeasurements
from jaxsat.control.navigation.innovation import InnovationTest
from jaxsat.control.navigation.mekf import MultiplicativeFilter
from jaxsat.control.navigation.navigation import Navigation
from jaxsat.core.allocation import unit_columns
from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.sensor import TACHOMETER, SensorDeclaration
from jaxsat.core.declaration.sensors import ATTITUDE_SENSORS, PATIENCE, PROBATION, SENSORS
from jaxsat.core.noise import key_of_seed
from jaxsat.scenario.build.plant import gravity_gradient, orbit_of, orbit_rate, sensor_context
from jaxsat.scenario.build.plugin_trial import made_part, require_estimates
from jaxsat.scenario.derived import has_invalid_momenta, predicts_by_dynamics
from jaxsat.scenario.parts.estimator import OwnEstimatorTable
from jaxsat.scenario.parts.named import number_of
from jaxsat.scenario.parts.sensors import SamplingTable
from jaxsat.scenario.plugins import ESTIMATOR, find_part
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.environment.disturbances import NoDisturbance
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.sensor_failures import GyroFailures, SensorFailures, TachometerFailures
from jaxsat.spacecraft.sensors import Sensors, Tachometers


def build_sampling(scenario: Scenario) -> tuple[Sensors | None, RealScalar | None]:
    """Return sensors and delay; None for those that are perfect in every case.

    Both are None with sensors of the attitude, see `build_navigation`.
    """
    values = dict(scenario.sampling or SamplingTable())

    def differs(name: str) -> bool:
        return values[name] > 0 or getattr(scenario.dispersion, name, None) is not None

    white = not _sensor_tables(scenario)
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


def _sensor_tables(scenario: Scenario) -> list[tuple[SensorDeclaration, Any]]:
    """The sensors with a table in a scenario, and these tables."""
    tables = [(one, getattr(scenario, one.name)) for one in SENSORS]
    return [(one, table) for one, table in tables if table is not None]


def build_navigation(scenario: Scenario, plant: RigidBody) -> Navigation | None:
    """Return sensors and estimator between the plant and a sampled law; None without sensors.

    The estimator knows the declared sensors and the orbit of the scenario. If it predicts rates by
    the dynamics, it also knows the spacecraft of the scenario: `plant`, but without failures, and
    of its disturbances the gravity gradient alone.
    """
    tables = _sensor_tables(scenario)
    if not tables:
        return None
    context, period = sensor_context(scenario), as_float(scenario.control.period_s)
    sensors = {
        one.place.removeprefix("navigation."): one.made(dict(table), context)
        for one, table in tables
    }
    sensors = {"tracker": None, "gyro": None} | sensors
    strikes = [(0, one) for one in scenario.failure if one.of == "gyro"]
    if sensors["gyro"] is not None:
        failures = GyroFailures.from_tables(strikes)
        sensors["gyro"] = dataclasses.replace(sensors["gyro"], failures=failures)
    table: Any = scenario.estimator or OwnEstimatorTable()
    orbit = orbit_of(scenario.orbit.relation, orbit_rate(scenario))
    navigation = Navigation(
        estimator=RawMeasurements(),
        attitude_sigma=table.attitude_sigma_rad,
        key=key_of_seed(scenario.simulation.seed),
        failures=_failures(scenario, orbit),
        body=_declared(scenario, plant) if predicts_by_dynamics(scenario) else None,
        **sensors,
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
    names = [one.name for one in ATTITUDE_SENSORS if getattr(scenario, one.name) is not None]
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
        seen: dict[str, Any] = {
            "tracker": context.tracker,
            "vector_noise": noise,
            "vector_latency": context.latency,
            "test": _test(table),
        }
        if context.body is None:
            assert context.gyro is not None
            return MultiplicativeFilter(orbit=context.orbit, gyro=context.gyro, **seen)
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
            **seen,
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
