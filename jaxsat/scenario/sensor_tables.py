"""The tables of sensors with a state, and of the estimator behind them."""

from jaxsat.declaration.sensors import ATTITUDE_SIGMA, ESTIMATOR, GYRO_KEYS, TRACKER_KEYS
from jaxsat.scenario.declared import fields_of, table_with


class GyroTable(table_with(fields_of(GYRO_KEYS))):
    """`[gyro]`: three rate gyros, sampled with the law."""


class StarTrackerTable(table_with(fields_of(TRACKER_KEYS))):
    """`[star_tracker]`: the attitude that a star tracker measures."""


class EstimatorTable(table_with(fields_of((ESTIMATOR, ATTITUDE_SIGMA)))):
    """`[estimator]`: what is made of the measurements for the law."""
