"""Momentum that wheels must hold at the target attitude, over what they can hold."""

import math
from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from jaxsat.core.allocation import unit_columns
from jaxsat.core.declaration.actuators import STEERED
from jaxsat.core.declaration.magnetorquers import MAGNETORQUER
from jaxsat.core.declaration.three_torques import FULL
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.holding import rotation
from jaxsat.scenario.parts.torque_makers import (
    TorqueMakers,
    spans_all_ways,
    wheel_axes,
)
from jaxsat.scenario.pulse_cautions import PLANE, coarse_unloading
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.tables import InitialTable

PHASES = 25
"""Phases per revolution of the orbit frame at which momentum and wheel capacity are compared."""

MOST_TURNS = 20
"""Largest number of revolutions with phases of their own; beyond it the phases are wider apart."""

REMOVALS = 12
"""Angles in a revolution of the orbit frame at which thrusters take momentum out of wheels."""

NOTHING = 1e6
"""Ratio of momentum to wheel capacity that is treated as infinite."""

UNLIMITED = 1e3
"""Torque of a device without a limit, as a multiple of the external torque."""

ROUNDING = 1e-9
"""Relative round-off tolerance on a momentum at the limit."""


def momentum_beyond_wheels(scenario: Scenario) -> Iterator[Issue]:
    """Yield a caution if wheels cannot hold the momentum of body and wheels at the target attitude,
    or if thrusters take it out by pulses that are too coarse.

    The only external torque counted is the constant one. With magnetorquers, which unload over
    time, only the momentum at the start counts; gyros store some themselves. Thrusters that do not
    push all ways take out what they can.
    """
    makers = TorqueMakers.of(scenario)
    limit = _limits_that_count(scenario, makers)
    if limit is None:
        return
    relieved = _relieved(makers)
    times, momenta = _momenta_to_hold(scenario)
    if scenario.magnetorquer:
        times, momenta = times[:1], momenta[:1]
    if relieved:
        kept = [largest_load(makers.axes, -limit, limit, momentum)[0] for momentum in momenta]
        if max(kept) > FULL:
            yield from coarse_unloading(scenario, momenta[int(np.argmax(kept))])
        if makers.thrusters_make_all:
            return
    loads = _loads(scenario, makers, limit, times, momenta)
    shares = np.array([share for share, _ in loads])
    worst = int(np.argmax(shares))
    most = shares[worst]
    if most <= 1 + ROUNDING:
        return
    remark = "; thrusters take none of it out" if relieved else ""
    if shares[0] <= 1:  # the external torque or the rotation of the orbit frame is the cause
        full = _first_full(times, shares)
        remark += f"; they are full after {full:.4g} s, counting constant_N_m, no other torque"
    message = (
        "should hold the momentum of body and wheels when the attitude is reached: along one "
        f"direction {abs(momenta[worst] @ loads[worst][1]):.4g} N m s, "
        f"{f'{most:.3g} times what they hold' if most < NOTHING else 'where they hold none'}"
    )
    yield Issue(("wheel",), message + remark)


def _limits_that_count(scenario: Scenario, makers: TorqueMakers) -> Float[np.ndarray, " k"] | None:
    """Momentum limits (N m s) of working wheels; None where others share their momentum, or a wheel
    has no limit."""
    limits = [one.momentum_limit_N_m_s for one in makers.working_wheels]
    if (
        not limits
        or None in limits
        or any(getattr(scenario, name) for name in STEERED if name != MAGNETORQUER.name)
        or not makers.law.regulates_attitude
    ):
        return None
    thrusters_share = makers.law.torques and not makers.wheels_make_all
    if not _relieved(makers) and (makers.relieved or thrusters_share):
        return None
    return np.array(limits)


def _relieved(makers: TorqueMakers) -> bool:
    return makers.relieved and bool(np.linalg.matrix_rank(makers.axes, tol=PLANE) == 3)


def _loads(
    scenario: Scenario,
    makers: TorqueMakers,
    limit: Float[np.ndarray, " k"],
    times: Float[np.ndarray, " n"],
    momenta: Float[np.ndarray, "n 3"],
) -> list[tuple[float, Float[np.ndarray, "3"]]]:
    """Largest part of what wheels hold, over all directions, and that direction, of a momentum (N m
    s, axes of the target) at each of the `times` (s), less what thrusters take out best until then.

    Momentum turns with the orbit frame, so that thrusters take out later what they do not now.
    """
    loads = [largest_load(makers.axes, -limit, limit, one) for one in momenta]
    if not _relieved(makers):
        return loads
    rate, unlimited = scenario.orbit.rate(), UNLIMITED * max(np.abs(momenta).max(), limit.max())
    for number in np.flatnonzero([share > 1 for share, _ in loads]):
        turned = min(rate * times[number], 2 * math.pi)
        angles = np.linspace(0, turned, 1 + math.ceil(REMOVALS * turned / (2 * math.pi)))
        removals = -np.hstack([*(into_frame(angles) @ unit_columns(makers.pushes))])
        if spans_all_ways(removals):  # so they do from then on
            loads[number:] = [(0.0, one) for _, one in loads[number:]]
            break
        low = np.r_[-limit, np.zeros(removals.shape[1])]
        high = np.r_[limit, np.full(removals.shape[1], unlimited)]
        columns = np.hstack([makers.axes, removals])
        loads[number] = largest_load(columns, low, high, momenta[number])
    return loads


def _first_full(times: Float[np.ndarray, " n"], shares: Float[np.ndarray, " n"]) -> float:
    """Time (s) at which shares that begin below 1 first reach it."""
    after = int(np.argmax(shares > 1))
    part = (1 - shares[after - 1]) / (shares[after] - shares[after - 1])
    return float(times[after - 1] + part * (times[after] - times[after - 1]))


def thrusters_take_momentum(scenario: Scenario) -> bool:
    """Whether thrusters take momentum of any direction out of wheels."""
    makers = TorqueMakers.of(scenario)
    return makers.relieved and makers.thrusters_make_all


def fills_wheels(
    scenario: Scenario, times: Float[np.ndarray, " n"], gain: Float[np.ndarray, "n 3"]
) -> tuple[float, float] | None:
    """Time (s) at which the wheels are full, and the largest part of what they hold, of a momentum
    `gain` (N m s, axes of the target) from outside until each of the `times`, beside that of the
    start.

    Only momentum about axes of wheels counts. None where they are not full, where
    `momentum_beyond_wheels` warns, or where other actuators take momentum out.
    """
    makers = TorqueMakers.of(scenario)
    limit = _limits_that_count(scenario, makers)
    if (
        limit is None
        or scenario.magnetorquer
        or any(True for _ in momentum_beyond_wheels(scenario))
    ):
        return None
    directions, sizes, _ = np.linalg.svd(makers.axes)
    along = directions[:, : int(np.sum(sizes > PLANE))]
    momenta = (_momentum_of_the_start(scenario, times) + gain) @ along @ along.T
    loads = np.array([one for one, _ in _loads(scenario, makers, limit, times, momenta)])
    if loads[0] > 1 or loads.max() <= 1 + ROUNDING:
        return None
    return _first_full(times, loads), float(loads.max())


def _momenta_to_hold(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and momenta (N m s) that working wheels must hold then, in body axes along the
    orbit frame, with the impulse of the constant external torque."""
    rate, duration = scenario.orbit.rate(), scenario.simulation.duration_s
    torque = np.array(scenario.disturbance.constant_N_m)
    turns = min(math.ceil(rate * duration / (2 * math.pi)), MOST_TURNS)
    moves = bool(rate) or bool(torque.any())
    times = np.linspace(0, duration, 1 + PHASES * max(turns, 1)) if moves else np.zeros(1)
    impulses = []
    for time in times:
        angle = rate * time
        along, across = (
            (math.sin(angle) / rate, (1 - math.cos(angle)) / rate) if rate else (time, 0.0)
        )
        impulses.append(np.array([[along, 0, across], [0, time, 0], [-across, 0, along]]) @ torque)
    return times, _momentum_of_the_start(scenario, times) + np.array(impulses)


def _momentum_of_the_start(
    scenario: Scenario, times: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    """Momentum (N m s) of the start that working wheels must hold at some times (s), in body axes
    along the orbit frame."""
    inertia = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    coasting = [one.momentum_N_m_s if one.failed else 0.0 for one in scenario.wheel]
    wheel_momenta = [one.momentum_N_m_s for one in scenario.wheel]
    axes, start, rate = wheel_axes(scenario.wheel), scenario.initial, scenario.orbit.rate()
    whole = inertia @ np.array(start.omega_rad_s) + axes @ wheel_momenta
    turned = into_frame(rate * times) @ (_body_axes(start).T @ whole)
    return turned - inertia @ [0, -rate, 0] - axes @ coasting


def into_frame(angles: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 3 3"]:
    """Matrices into the orbit frame after it has rotated by -`angles` (rad) about its second
    axis."""
    cos, sin, zero = np.cos(angles), np.sin(angles), np.zeros_like(angles)
    rows = [[cos, zero, sin], [zero, zero + 1, zero], [-sin, zero, cos]]
    return np.moveaxis(np.array(rows), -1, 0)


def _body_axes(start: InitialTable) -> np.ndarray:
    """C of `v_body = C v_orbit` at the start."""
    if start.quaternion is not None:
        return rotation(_turn(math.acos(np.clip(start.quaternion[0], -1, 1)), start.quaternion[1:]))
    assert start.w is not None
    assert start.z_rad is not None
    tilt = _turn(math.atan(math.hypot(*start.w)), (*start.w, 0.0))
    return rotation(tilt) @ rotation(np.array([0.0, 0.0, start.z_rad]))


def _turn(half: float, axis: tuple[float, ...]) -> np.ndarray:
    """Rotation vector (rad) of twice the angle `half` about an axis."""
    size = np.linalg.norm(axis)
    return 2 * half * np.array(axis) / size if size else np.zeros(3)


def largest_load(
    axes: np.ndarray, low: np.ndarray, high: np.ndarray, demand: np.ndarray
) -> tuple[float, np.ndarray]:
    """Largest ratio of a demand to the devices' capacity along any direction, and that direction.

    Each device makes from `low` to `high` along its axis. The reachable set is a zonotope, whose
    faces are normal to two of the axes.
    """
    columns = np.vstack([axes.T, np.eye(3)])
    first, second = np.triu_indices(len(columns), 1)
    normals = np.cross(columns[first], columns[second])
    sizes = np.linalg.norm(normals, axis=1)
    normals = normals[sizes > ROUNDING] / sizes[sizes > ROUNDING, None]
    normals = np.vstack([normals, -normals])
    along, needs = normals @ axes, normals @ demand
    capacity = np.maximum(along * low, along * high).sum(axis=1)
    small = ROUNDING * max(np.linalg.norm(demand), float(high.max()), float(-low.min()))
    share = np.where(needs > small, needs / np.maximum(capacity, small), 0.0)
    worst = int(np.argmax(share))
    return float(share[worst]), normals[worst]
