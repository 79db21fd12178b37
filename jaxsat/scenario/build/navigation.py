"""From a scenario to gyro, star tracker and estimator."""

from typing import Any, cast

from jaxsat.control.navigation import (
    AbstractEstimator,
    EstimatorContext,
    MultiplicativeFilter,
    Navigation,
    RawMeasurements,
)
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.sensors import GYRO_KEYS, TRACKER_KEYS
from jaxsat.core.noise import key_of_seed
from jaxsat.scenario.build.plant import orbit_of, orbit_rate
from jaxsat.scenario.build.plugin_trial import made_part, require_estimates
from jaxsat.scenario.declared import values_of
from jaxsat.scenario.plugins import ESTIMATOR, find_part
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.sensor_tables import EstimatorTable, OwnEstimatorTable
from jaxsat.spacecraft import Gyro, StarTracker


def build_navigation(scenario: Scenario) -> Navigation | None:
    """What stands between the truth and a sampled law, None without `[gyro]`, `[star_tracker]`.

    The estimator knows the sensors as they are declared, and the orbit of the scenario.
    """
    if scenario.gyro is None or scenario.star_tracker is None:
        return None
    gyro = Gyro.from_table(values_of(GYRO_KEYS, scenario.gyro))
    period = cast(Any, scenario.control).period_s
    tracker = StarTracker.from_table(values_of(TRACKER_KEYS, scenario.star_tracker), period)
    table: Any = scenario.estimator or OwnEstimatorTable()
    orbit = orbit_of(scenario.orbit.relation, orbit_rate(scenario))
    estimator = _estimator(table, EstimatorContext(gyro, tracker, orbit, as_float(period)))
    key = key_of_seed(scenario.simulation.seed)
    return Navigation(gyro, tracker, estimator, table.attitude_sigma_rad, key)


def _estimator(table: EstimatorTable, context: EstimatorContext) -> AbstractEstimator:
    if table.kind == "none":
        return RawMeasurements()
    if table.kind == "mekf":
        return MultiplicativeFilter(context.orbit, context.gyro, context.tracker)
    part, location = find_part(ESTIMATOR, table.kind), ("estimator", "kind")
    made = made_part(part, location, table, context)
    require_estimates(part, location, made, context.period)
    return made
