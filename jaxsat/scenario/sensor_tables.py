"""The tables of sensors with a state, and of the estimator behind them."""

from typing import Annotated, ClassVar

from pydantic import ConfigDict, SerializeAsAny

from jaxsat.core.declaration.sensors import ATTITUDE_SIGMA, ESTIMATOR, GYRO_KEYS, TRACKER_KEYS
from jaxsat.scenario.declared import fields_of, table_with
from jaxsat.scenario.part_tables import PartTable, by_its_kind
from jaxsat.scenario.plugins import ESTIMATOR as ESTIMATOR_KIND
from jaxsat.scenario.plugins import PluginKind
from jaxsat.scenario.quantities import choice


class GyroTable(table_with(fields_of(GYRO_KEYS))):
    """`[gyro]`: three rate gyros, sampled with the law."""


class StarTrackerTable(table_with(fields_of(TRACKER_KEYS))):
    """`[star_tracker]`: the attitude that a star tracker measures."""


class EstimatorTable(table_with(fields_of([ATTITUDE_SIGMA]), PartTable)):
    """`[estimator]`: what is made of the measurements for the law."""

    plugin: ClassVar[PluginKind] = ESTIMATOR_KIND

    kind: str = choice(
        f'{ESTIMATOR.meaning}; or an estimator that does not come with jaxsat, "module:Class" or '
        "the name of an installed one, whose keys follow",
        ESTIMATOR.default,
    )


class OwnEstimatorTable(table_with(fields_of([ESTIMATOR]), EstimatorTable)):
    """`[estimator]` of a kind that comes with jaxsat."""

    model_config = ConfigDict(extra="forbid")


EstimatorOfAKind = Annotated[
    SerializeAsAny[EstimatorTable], by_its_kind(EstimatorTable, OwnEstimatorTable)
]
