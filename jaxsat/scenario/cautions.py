"""Cautions about valid scenarios that are likely mistakes."""

import math

import numpy as np

from jaxsat.core.allocation import usable_share
from jaxsat.core.declaration.settling import (
    HOLDING_AMPLITUDE,
    LARGEST_FALL,
    TUNED_PERIOD,
    holding_amplitude,
)
from jaxsat.core.declaration.tuned_gains import MORIN_SAMSON, TWO_CHANNEL, Scaling, tuned_frequency
from jaxsat.core.inertia import torque_axis_frame
from jaxsat.core.ranges import SETTLED_W
from jaxsat.scenario.actuator_cautions import actuator_cautions, torque_beyond_actuators
from jaxsat.scenario.derived import believed_axes, is_upside_down, torque_limit
from jaxsat.scenario.domain import believed_normal_form, domain_cautions, held_turn
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.failure_cautions import failure_cautions
from jaxsat.scenario.flexibility import flexibility_cautions
from jaxsat.scenario.parts.estimator import estimator_cautions
from jaxsat.scenario.parts.sensors import sensor_cautions
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.scenario.resolution import resolution_cautions
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.wording import shown

GAINS = {"oscillatory": MORIN_SAMSON, "three-slew": TWO_CHANNEL, "planned": TWO_CHANNEL}
"""Gains of the laws that hold the attitude by an oscillation."""

LEAST_TILT = 0.1
"""Smallest verified tangent of the angle between the one torque and its acceleration under the law
of one torque."""

LEAST_STEERING = 0.01
"""Smallest |δ - α| or |η| (docs/one_torque.md) over α; if both vanish, rest is unreachable."""

HELD_TURN = 0.02
"""Largest rotation (rad) to an attitude that is treated as held; settled means within 0.05 rad."""


def cautions(scenario: Scenario, law: bool = True) -> list[Issue]:
    """Return all cautions about a valid scenario; without `law` those about the law are omitted."""
    if not law:
        return [
            *_inertia_cautions(scenario),
            *_origin_cautions(scenario),
            *torque_beyond_actuators(scenario),
        ]
    return [
        *_inertia_cautions(scenario),
        *_origin_cautions(scenario),
        *_start_cautions(scenario),
        *_law_cautions(scenario),
        *domain_cautions(scenario),
        *_holding_cautions(scenario),
        *_end_game_cautions(scenario),
        *_one_torque_cautions(scenario),
        *failure_cautions(scenario),
        *sensor_cautions(scenario),
        *estimator_cautions(scenario),
        *actuator_cautions(scenario),
        *flexibility_cautions(scenario),
        *resolution_cautions(scenario),
    ]


def _origin_cautions(scenario: Scenario) -> list[Issue]:
    """Caution about a centre of mass given without any position that refers to it."""
    centre = scenario.spacecraft.centre_of_mass_m
    if centre is None:
        return []
    message = "should be given with positions of thrusters or panels, or a drag_centre_m or"
    location = ("spacecraft", "centre_of_mass_m")
    return [Issue(location, f"{message} solar_centre_m, got {shown(centre)} and none of them")]


def _start_cautions(scenario: Scenario) -> list[Issue]:
    """Caution about an upside-down start, where laws that do not work in (w, z) may begin."""
    quaternion = scenario.initial.quaternion
    if quaternion is None or not is_upside_down(quaternion):
        return []
    message = (
        "should not be upside down, where w is infinite and z undefined: their signals are NaN "
        f"there, got {shown(quaternion)}"
    )
    return [Issue(("initial", "quaternion"), message)]


def _inertia_cautions(scenario: Scenario) -> list[Issue]:
    issues = []
    model_inertia = getattr(getattr(scenario.control, "model", None), "inertia_kg_m2", None)
    places = {
        ("spacecraft", "inertia_kg_m2"): scenario.spacecraft.inertia_kg_m2,
        ("control", "model", "inertia_kg_m2"): model_inertia,
    }
    for location, inertia in places.items():
        if inertia is not None and not _obeys_triangle_inequality(inertia):
            issues.append(
                Issue(
                    location,
                    "should have no principal moment above the sum of the other two, as no real "
                    f"body has, got {shown(inertia)}",
                )
            )
    return issues


def _obeys_triangle_inequality(inertia: tuple) -> bool:
    low, middle, high = np.linalg.eigvalsh(inertia_matrix(inertia))
    return bool(low + middle >= high * (1 - 1e-9))


def _law_cautions(scenario: Scenario) -> list[Issue]:
    """Caution about equal moments under laws that move ω3 by the torque (J1 - J2) ω1 ω2 alone."""
    if not scenario.law.declaration.needs_unequal_moments:
        return []
    inertia = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    if inertia[0, 0] != inertia[1, 1]:
        return []
    message = (
        f'should have J1 apart from J2 under the law "{scenario.control.law}", which cannot move '
        f"ω3 otherwise, got {shown(scenario.spacecraft.inertia_kg_m2)}"
    )
    return [Issue(("spacecraft", "inertia_kg_m2"), message)]


def _holding_cautions(scenario: Scenario) -> list[Issue]:
    """Attitudes that cannot be held without a torque about one axis."""
    if not scenario.law.declaration.any_plane:
        return []
    location, law = ("spacecraft", "inertia_kg_m2"), scenario.control.law
    issues = []
    turn = held_turn(scenario, believed_normal_form(scenario)[0])
    if turn is None or np.abs(turn).max() > HELD_TURN:
        nearest = (
            "no attitude can be held"
            if turn is None
            else (
                "the nearest attitude that can be held is rotated from it by the rotation vector "
                f"{shown(tuple(float(f'{part:.3g}') for part in turn))} rad"
            )
        )
        message = (
            f'should let the law "{law}" hold the attitude of the orbit frame, where a torque '
            f"about the unactuated axis would be needed: {nearest}"
        )
        issues.append(Issue(location, message))
    return issues


def _end_game_cautions(scenario: Scenario) -> list[Issue]:
    """Caution about a holding oscillation that is larger than the tolerances of settling.

    Two in-phase rates of amplitude ρ have the norm √2 ρ, and at frequency ν a tilt of √2 ρ/ν if
    they are sines, up to π/2 times as large if they are flat-topped.
    """
    control, settled = scenario.control, scenario.settled
    torque, gains = torque_limit(scenario), GAINS.get(control.law)
    if gains is None or torque is None:
        return []
    _, frame, (first, second, _) = believed_normal_form(scenario)
    limit = torque * usable_share(believed_axes(scenario), frame[:2])
    scaling = Scaling.of(
        math.sqrt(first * second), limit, getattr(control, "period_s", TUNED_PERIOD)
    )
    amplitude = getattr(control, HOLDING_AMPLITUDE)
    amplitude = amplitude or holding_amplitude(scaling, scenario.orbit.rate())
    frequency = getattr(control, "frequency_rad_s", None) or tuned_frequency(gains, scaling)
    rate = math.sqrt(2) * amplitude
    swing = rate / frequency * (LARGEST_FALL if _has_flat_tops(scenario) else 1.0)
    tilt = 2 * math.atan(SETTLED_W) if settled.tilt_rad is None else settled.tilt_rad
    needs = [("rate_rad_s", rate, settled.rate_rad_s), ("tilt_rad", swing, tilt)]
    return [
        Issue(
            ("settled", key),
            f'should be above {size:.3g}, as the law "{control.law}" holds the attitude by an '
            f"oscillation of {frequency:.3g} rad/s with two rates of {amplitude:.3g} rad/s "
            f"(control.{HOLDING_AMPLITUDE}), got {tolerance:.3g}",
            (("control", HOLDING_AMPLITUDE), ("control", "law")),
        )
        for key, size, tolerance in needs
        if size >= tolerance
    ]


def _has_flat_tops(scenario: Scenario) -> bool:
    """Whether the law holds the attitude by flat-topped waves."""
    acts = scenario.disturbance.gravity_gradient and scenario.orbit.rate() != 0
    control = scenario.control
    return acts and control.law == "three-slew" and getattr(control, "observe_ripple", False)


def _one_torque_cautions(scenario: Scenario) -> list[Issue]:
    """Caution about torque axes near a principal axis, and axes that cannot stop every rotation."""
    if scenario.law.declaration.torques != 1:
        return []
    inertia = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    axis = believed_axes(scenario)[:, 0]
    _, mobility = torque_axis_frame(inertia, axis)
    tilt, axis_entries = mobility[0, 2] / mobility[0, 0], axis.round(6).tolist()
    location, issues = ("spacecraft", "inertia_kg_m2"), []
    if not tilt >= LEAST_TILT:
        message = (
            "should give the one torque an acceleration at least a tenth of a radian from its "
            f'axis under the law "{scenario.control.law}", which takes longer the nearer this is '
            f"to a principal axis, got {tilt:.2g} rad, torque axis {axis_entries}"
        )
        issues.append(Issue(location, message))
    steering = max(abs(mobility[1, 1] - mobility[0, 0]), abs(mobility[1, 2]))
    if steering < LEAST_STEERING * mobility[0, 0]:
        message = (
            "should let the one torque turn a momentum against J⁻¹b × b, b its axis; otherwise it "
            f"cannot stop a rotation that begins there, got b = {axis_entries}"
        )
        issues.append(Issue(location, message))
    return issues
