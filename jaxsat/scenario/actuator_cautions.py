"""Cautions about valid actuators that cannot make the torques that the law commands."""

from collections.abc import Iterator

import numpy as np

from jaxsat.core.allocation import unit_columns
from jaxsat.core.declaration.actuators import STEERED
from jaxsat.scenario.control import is_plugin
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.idle_actuators import idle_actuators
from jaxsat.scenario.parts.torque_makers import (
    TorqueMakers,
    wheel_axes,
    working_torques,
)
from jaxsat.scenario.pulse_cautions import pulse_cautions
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.tables import working_axes
from jaxsat.scenario.wheel_loads import (
    NOTHING,
    ROUNDING,
    UNLIMITED,
    largest_load,
    momentum_beyond_wheels,
)
from jaxsat.scenario.wording import shown


def actuator_cautions(scenario: Scenario) -> Iterator[Issue]:
    """Yield cautions about idle, slow or coarse actuators and about excessive momentum."""
    if scenario.law.declaration.torques or scenario.law.declaration.commands_actuators:
        yield from torque_beyond_actuators(scenario)
    yield from idle_actuators(scenario)
    yield from _wheels_for_a_part(scenario)
    yield from momentum_beyond_wheels(scenario)
    yield from pulse_cautions(scenario)
    if not is_plugin(scenario.control.law):  # whose keys may mean something else
        yield from _slow_samples(scenario)


def torque_beyond_actuators(scenario: Scenario) -> Iterator[Issue]:
    """Yield a caution if working actuators can oppose only a part of the constant external torque.

    If their torques span a plane, only the component in it counts. Magnetorquers, gyros and
    actuators of packages have no limit known here.
    """
    torque = np.array(scenario.disturbance.constant_N_m)
    others = [getattr(scenario, name) for name in STEERED] + [scenario.actuators]
    units, low, high = _reach(scenario, UNLIMITED * float(np.linalg.norm(torque)))
    if not torque.any() or any(others) or not units.size:
        return
    directions, sizes, _ = np.linalg.svd(units)
    along = directions[:, : int(np.sum(sizes > ROUNDING * sizes[0]))]
    share, _ = largest_load(units, low, high, -along @ (along.T @ torque))
    if share > 1 + ROUNDING:
        part = f"at most {100 / share:.3g} %" if share < NOTHING else "nothing"
        message = f"should be a torque that the actuators can oppose, which they do of {part}, got"
        yield Issue(("disturbance", "constant_N_m"), f"{message} {shown(tuple(torque))}")


def _reach(scenario: Scenario, unlimited: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit axes (3, m) of devices that work at the start, and their least and largest torques, N m.

    Devices without a limit make `unlimited`.
    """
    body, wheels = scenario.spacecraft, tuple(one for one in scenario.wheel if not one.failed)
    ideal = working_axes(body.thruster_torque_axes or (), body.failed_thrusters)
    pushes = working_torques(scenario.thruster)
    limits = [body.torque_limit_N_m] * ideal.shape[1] + [one.torque_limit_N_m for one in wheels]
    both_ways = np.array([unlimited if one is None else one for one in limits], float)
    one_way = np.linalg.norm(pushes, axis=0)
    axes = np.hstack([ideal, wheel_axes(wheels), unit_columns(pushes)])
    return axes, np.r_[-both_ways, 0 * one_way], np.r_[both_ways, one_way]


def _wheels_for_a_part(scenario: Scenario) -> Iterator[Issue]:
    """Yield a caution if wheels make a part of two torques: with their momentum h, ω × h turns the
    third axis, which laws that turn it by (J1 - J2) ω1 ω2, or rest it, ignore."""
    makers = TorqueMakers.of(scenario)
    working = len(makers.working_wheels)
    if makers.law.torques != 2 or not working:
        return
    remainder = makers.remainder
    if remainder.any() and np.abs(remainder - np.eye(2)).max() > ROUNDING:
        message = (
            f'should make both torques that the law "{scenario.control.law}" commands, or none: '
            "their momentum turns a body that rotates about the third axis, which the law does not "
            f'expect, so that it may not settle ("fault-tolerant" does), got {working}'
        )
        yield Issue(("wheel",), message)


def _slow_samples(scenario: Scenario) -> Iterator[Issue]:
    """Yield a caution about a period plus delay so long that rate errors are overcorrected."""
    frequency = getattr(scenario.control, "natural_frequency_rad_s", None)
    damping = getattr(scenario.control, "damping", None)
    period = getattr(scenario.control, "period_s", None)
    if frequency is None or damping is None or period is None:
        return
    delay = 0.0 if scenario.sampling is None else scenario.sampling.delay_s
    most = 1 / (2 * damping * frequency)
    if period + delay > most:
        message = (
            "should be, with sampling.delay_s, at most 1 / (2 damping natural_frequency_rad_s) = "
            f"{most:.4g} s, else the control turns a rate error into one of opposite sign"
        )
        yield Issue(("control", "period_s"), f"{message}, got {shown(period)}")
