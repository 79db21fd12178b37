"""Costs of a law: propellant, momentum and pointing error."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxsat.scenario import Scenario
from jaxsat.simulation.trajectory import Outcome

DAY = 86400.0


class Prices(NamedTuple):
    """Median costs over the cases that reach their end; None where the vehicle lacks the device.

    `propellant_kg_day` is kg a day at the mean use of a case, manoeuvres and failures included.
    `momentum_margin` is the part of its limit that the fullest wheel never holds, and
    `pointing_error_deg` (degree) the angle to the target attitude at the end.
    """

    propellant_kg_day: float | None = None
    momentum_margin: float | None = None
    pointing_error_deg: float | None = None


NO_PRICES = Prices()


def prices_of(scenario: Scenario, columns: Mapping[str, Any]) -> Prices:
    """Return the costs of a study of a scenario, from its columns."""
    complete = np.asarray(columns["code"]) == int(Outcome.SUCCESS)
    if not complete.any():
        return NO_PRICES

    def cases(name: str) -> np.ndarray:
        return np.asarray(columns[name], float)[complete]

    propellant, margin = None, None
    if any(one.specific_impulse_s for one in scenario.thruster):
        propellant = float(np.median(cases("propellant") / cases("ended_at"))) * DAY
    limits = [one.momentum_limit_N_m_s for one in scenario.wheel]
    if limits and all(limits):
        parts = cases("peak_wheel_momentum") / np.array(limits, float)
        margin = 1.0 - float(np.median(parts.max(axis=1)))
    return Prices(propellant, margin, float(np.median(cases("pointing_error"))))
