"""Control period of a law in a design."""

import math

from jaxsat.core.declaration.laws import Law
from jaxsat.core.declaration.tuned_gains import STEPS
from jaxsat.scenario import Scenario
from jaxsat.scenario.control import known_law
from jaxsat.scenario.derived import has_sensors
from jaxsat.scenario.resolution import fastest
from jaxsat.synthesis.controller_design.vehicle import Scale

PERIOD = 0.1
"""Control period (s) of a law that has none by default."""

LARGEST_STEP, LARGEST_ANGLE = STEPS[0], 0.08
"""Up to which a period is made longer: parts of τ, and radians of the fastest motion.

So it is on the acceptance set at 1 N m, with 0.1 s. Gains of shorter periods are the same; longer
periods settle later.
"""

QUICKEST = 0.8
"""Largest natural frequency of a candidate, over 1/τ."""


def control_period(scenario: Scenario, law: Law, scale: Scale, orbital: Law | None = None) -> float:
    """Return the period (s) that the scenario gives; or the law's own, longer for slow bodies.

    Beside sensors it is not made longer, as they give their noise per sample. Where magnetorquers
    decide, it is that of the law `orbital`, which is made for them, or shorter, so that the
    quickest candidate turns by at most `LARGEST_ANGLE`.
    """
    usual, control, own_law = _usual(law), scenario.control, known_law(scenario.control.law)
    period = getattr(control, "period_s", None) or usual
    if own_law is None or period != _usual(own_law):
        return period
    if law.declaration.takes_orbits:
        return usual
    if "period_s" in control.model_fields_set:
        return period
    if orbital is not None:
        longest = min(_usual(orbital), LARGEST_ANGLE / QUICKEST * scale.time)
    elif has_sensors(scenario):
        return usual
    else:
        motion = fastest(scenario)
        by_motion = math.inf if motion is None else LARGEST_ANGLE / motion.rate
        longest = min(LARGEST_STEP * scale.time, by_motion)
    return float(f"{usual * max(1, math.floor(longest / usual)):.6g}")


def _usual(law: Law) -> float:
    """Return the default period (s) of a law."""
    defaults = [key.default for key in law.declaration.keys if key.name == "period_s"]
    return PERIOD if defaults in ([], [...]) else defaults[0]
