"""What is allowed in a scenario and yet is likely a mistake."""

import numpy as np

from jaxsat.allocation import torque_directions
from jaxsat.inertia import normal_axes
from jaxsat.scenario.coordinates import inertia_matrix, is_upside_down
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.laws import find_law
from jaxsat.scenario.layout import working_axes
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.wording import shown


def cautions(scenario: Scenario, law: bool = True) -> list[Issue]:
    """Everything about a valid scenario that a person should be told, if told of its law too."""
    if not law:
        return _inertia_cautions(scenario)
    return [
        *_inertia_cautions(scenario),
        *_start_cautions(scenario),
        *_law_cautions(scenario),
        *_limit_cautions(scenario),
    ]


def _start_cautions(scenario: Scenario) -> list[Issue]:
    """Laws that do not work in (w, z) may begin where there are none."""
    quaternion = scenario.initial.quaternion
    if quaternion is None or not is_upside_down(quaternion):
        return []
    message = (
        "should not be upside down, where w is without bound and z unknown: what is told of them "
        f"there is NaN, got {shown(quaternion)}"
    )
    return [Issue(("initial", "quaternion"), message)]


def _inertia_cautions(scenario: Scenario) -> list[Issue]:
    found = []
    believed = getattr(getattr(scenario.control, "model", None), "inertia_kg_m2", None)
    places = {
        ("spacecraft", "inertia_kg_m2"): scenario.spacecraft.inertia_kg_m2,
        ("control", "model", "inertia_kg_m2"): believed,
    }
    for location, inertia in places.items():
        if inertia is not None and not _obeys_triangle_inequality(inertia):
            found.append(
                Issue(
                    location,
                    "should have no principal moment above the sum of the other two, as no real "
                    f"body has, got {shown(inertia)}",
                )
            )
    return found


def _obeys_triangle_inequality(inertia: tuple) -> bool:
    low, middle, high = np.linalg.eigvalsh(inertia_matrix(inertia))
    return bool(low + middle >= high * (1 - 1e-9))


def _law_cautions(scenario: Scenario) -> list[Issue]:
    """Some laws move ω3 through the gyroscopic torque (J1 - J2) ω1 ω2 alone."""
    if not find_law(scenario.control.law).declaration.needs_unequal_moments:
        return []
    inertia = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    if inertia[0, 0] != inertia[1, 1]:
        return []
    message = (
        f'should have J1 apart from J2 under the law "{scenario.control.law}", which cannot move '
        f"ω3 otherwise, got {shown(scenario.spacecraft.inertia_kg_m2)}"
    )
    return [Issue(("spacecraft", "inertia_kg_m2"), message)]


def _limit_cautions(scenario: Scenario) -> list[Issue]:
    limit = scenario.spacecraft.torque_limit_N_m
    limits_of = find_law(scenario.control.law).declaration.tuned_limits
    if limits_of is None or limit is None:
        return []
    believed = getattr(scenario.control, "model", None)
    inertia = getattr(believed, "inertia_kg_m2", None) or scenario.spacecraft.inertia_kg_m2
    axes = working_axes(
        scenario.spacecraft.thruster_torque_axes, scenario.spacecraft.failed_thrusters
    )
    _, moments = normal_axes(inertia_matrix(inertia), torque_directions(axes))
    limits = limits_of(moments)
    if any(np.isclose(limit, one, rtol=1e-9) for one in limits):
        return []
    tuned = ", ".join(f"{one:.4g}" for one in limits)
    message = (
        f'should be one of {tuned} N m under the law "{scenario.control.law}", whose gains are '
        "tuned for these, interpolated between them and beyond them those of the nearest, "
        f"got {shown(limit)}"
    )
    return [Issue(("spacecraft", "torque_limit_N_m"), message)]
