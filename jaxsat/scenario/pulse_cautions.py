"""Cautions about thruster pulses that are too short, too weak or too strong for the law."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jaxsat.core.allocation import least_propellant, plane_map
from jaxsat.core.declaration.three_torques import CALM
from jaxsat.core.ranges import SETTLED_W
from jaxsat.scenario.control import is_plugin
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.thrusters import ModulationTable, modulation_kind
from jaxsat.scenario.parts.torque_makers import TorqueMakers, signs
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.wording import shown

ROUNDING = 1e-9
"""Round-off tolerance on duties."""

PLANE = 1e-6
"""Tolerance on the rank of unit wheel axes: the smallest component across a plane."""


def pulse_cautions(scenario: Scenario) -> Iterator[Issue]:
    """Yield cautions about pulses that end before full thrust, a dead zone, and coarse pulses."""
    yield from _slow_thrust(scenario)
    if is_plugin(scenario.control.law):  # its keys may have other meanings
        return
    kind = modulation_kind(scenario.modulation or ModulationTable(), scenario.thruster)
    frequency = getattr(scenario.control, "natural_frequency_rad_s", None)
    three = scenario.law.declaration.torques == 3
    if not scenario.thruster or kind == "ideal" or not three or frequency is None:
        return
    makers = TorqueMakers.of(scenario)
    axes = makers.axes
    if np.linalg.matrix_rank(axes, tol=PLANE) == 2:
        yield from _coarse_about_one_axis(scenario, np.linalg.svd(axes)[0][:, 2])
    elif not scenario.wheel and makers.thrusters_make_all:
        yield from _dead_zone(scenario, kind)
        yield from _coarse_pulses(scenario)


def _slow_thrust(scenario: Scenario) -> Iterator[Issue]:
    for number, one in enumerate(scenario.thruster):
        if 0 < one.min_on_time_s < one.rise_time_s:
            message = f"should be at least rise_time_s = {shown(one.rise_time_s)}"
            problem = f"{message}, else its shortest pulse ends before full thrust, got"
            location = ("thruster", number, "min_on_time_s")
            yield Issue(location, f"{problem} {shown(one.min_on_time_s)}")


def _dead_zone(scenario: Scenario, kind: str) -> Iterator[Issue]:
    """Yield a caution about attitude errors beyond the tolerance at which no thruster fires."""
    table = scenario.modulation or ModulationTable()
    if kind not in ("pwm", "pwpf"):
        return
    angle = _idle_angle(scenario, table.on_level / table.gain if kind == "pwpf" else 0.0)
    tolerance = scenario.settled.turn_rad
    if angle > tolerance:
        below = f"below {math.degrees(angle):.3g} degrees" if angle < math.pi else "at any error"
        message = (
            "should fire thrusters within the attitude error that counts as settled, "
            f"{math.degrees(tolerance):.3g} degrees: none fires {below} about one axis "
            f'("delta-sigma" has no dead zone), got {shown(kind)}'
        )
        yield Issue(("modulation", "kind"), message)


def _idle_angle(scenario: Scenario, duty: float) -> float:
    """Largest angle (rad) about a body axis for which no thruster's duty reaches a pulse.

    The commanded torque is J ω² times the angle, up to that of the largest rate.
    """
    period, frequency = scenario.control.period_s, scenario.control.natural_frequency_rad_s
    shortest = np.array([one.shortest / period for one in _pushes(scenario)])
    shortest = np.maximum(shortest, duty)
    largest = 0.0
    for duties in _duties_of_axes(scenario) * frequency**2:  # per radian
        active = duties > ROUNDING * duties.max()
        largest = max(largest, float(np.min(shortest[active] / duties[active])))
    most = getattr(scenario.control, "max_rate_rad_s", None)
    damping = getattr(scenario.control, "damping", 1.0)
    return math.inf if most is not None and largest > 2 * damping * most / frequency else largest


def _coarse_pulses(scenario: Scenario) -> Iterator[Issue]:
    """Yield a caution if each pulse leaves a rate, or a turn in a period, beyond the tolerance."""
    pushes = _pushes(scenario)
    inverse = np.linalg.inv(inertia_matrix(scenario.spacecraft.inertia_kg_m2))
    steps = np.linalg.norm(inverse @ TorqueMakers.of(scenario).pushes, axis=0)
    steps *= [one.shortest for one in pushes]
    finest = [
        np.where(duties > ROUNDING * duties.max(), steps, np.inf).argmin()
        for duties in _duties_of_axes(scenario)
    ]
    worst = max(finest, key=lambda push: steps[push])
    yield from _left_rate(scenario, pushes[worst], steps[worst] / 2)


def coarse_unloading(scenario: Scenario, momentum: np.ndarray) -> Iterator[Issue]:
    """Yield a caution if each pulse that takes momentum (body axes) out of wheels leaves a rate, or
    a turn in a period, beyond the tolerance."""
    kind = modulation_kind(scenario.modulation or ModulationTable(), scenario.thruster)
    if kind == "ideal" or is_plugin(scenario.control.law):
        return
    torque, pushes = TorqueMakers.of(scenario).pushes, _pushes(scenario)
    inverse = np.linalg.inv(inertia_matrix(scenario.spacecraft.inertia_kg_m2))
    steps = np.linalg.norm(inverse @ torque, axis=0) * [one.shortest for one in pushes]
    steps = np.where(momentum @ torque < 0, steps, np.inf)
    finest = int(steps.argmin())
    if np.isfinite(steps[finest]):
        yield from _left_rate(scenario, pushes[finest], steps[finest] / 2)


def _left_rate(scenario: Scenario, push: "_Push", half: float) -> Iterator[Issue]:
    """Yield a caution if half of what the pulse changes (rad/s) is beyond the tolerance."""
    settled = scenario.settled
    turn = 2 * max(settled.turn_rad, settled.tilt_rad or 2 * math.atan(SETTLED_W))
    most = min(settled.rate_rad_s, turn / scenario.control.period_s)
    if half > most:
        message = (
            f"should be at most {push.shortest * most / half:.4g} s: of the rate that a pulse "
            f"changes at least half is left, {half:.3g} rad/s, with which a case does not count as "
            f"settled, got {shown(push.shortest)}"
        )
        yield Issue(("thruster", push.number, "min_on_time_s"), message)


def _coarse_about_one_axis(scenario: Scenario, axis: np.ndarray) -> Iterator[Issue]:
    """Yield a caution if pulses about the axis that no wheel drives leave too large a rate.

    With a band, that is one that sends the body from edge to edge, so that the external torque does
    not; without, one beyond the tolerance.
    """
    inertia = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    pushes = _pushes(scenario)
    steps = axis @ TorqueMakers.of(scenario).pushes / (axis @ inertia @ axis)
    steps *= [one.shortest for one in pushes]
    sides = [np.flatnonzero(side * steps > 0) for side in (1, -1)]
    if not all(len(side) for side in sides):
        return
    worst = max(
        (min(side, key=lambda push: abs(steps[push])) for side in sides),
        key=lambda push: abs(steps[push]),
    )
    half = abs(steps[worst]) / 2
    band = getattr(scenario.control, "third_axis_band_rad", None)
    if band is None:
        yield from _left_rate(scenario, pushes[worst], half)
        return
    least = half / (CALM * scenario.control.natural_frequency_rad_s)
    if band < least:
        message = (
            f"should be at least {least:.3g} rad: of the rate that the least pulse changes about "
            f"the axis that no wheel drives half is left, {half:.3g} rad/s, which crosses the band "
            f"in {2 * band / half:.3g} s, so that thrusters fire from edge to edge, got "
            f"{shown(band)}"
        )
        yield Issue(("control", "third_axis_band_rad"), message)


class _Push(NamedTuple):
    """A direction of thrust: the number of the thruster's table, and its shortest pulse (s)."""

    number: int
    shortest: float


def _pushes(scenario: Scenario) -> list[_Push]:
    """Return a push for each column of `TorqueMakers.pushes`."""
    return [
        _Push(number, one.min_on_time_s)
        for number, one in enumerate(scenario.thruster)
        if not one.failed
        for _ in signs(one)
    ]


def _duties_of_axes(scenario: Scenario) -> np.ndarray:
    """Duties (6, m) that accelerate the body by ±1 rad/s² about each body axis."""
    torque = TorqueMakers.of(scenario).pushes
    bases = least_propellant(torque, np.ones(torque.shape[1]), plane_map(torque, 3, False))
    inertia = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    duties = []
    for axis in (*np.eye(3), *-np.eye(3)):
        of_bases = bases @ (inertia @ axis)
        duties.append(of_bases[np.argmax(of_bases.min(axis=1))])
    return np.array(duties)
