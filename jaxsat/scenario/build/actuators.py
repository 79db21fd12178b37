"""From a scenario to its actuators."""

import dataclasses
import math
from typing import cast

import jax.numpy as jnp
import numpy as np

from jaxsat.control.controller import WheelContext
from jaxsat.control.steering import AbstractSteering, GimbalSteering, MagneticSteering
from jaxsat.core.allocation import (
    direction_matrix,
    least_squares_map,
    torque_directions,
    unit_columns,
)
from jaxsat.core.checks import as_array, as_float
from jaxsat.core.declaration.actuators import STEERED
from jaxsat.scenario.build.plant import place_of
from jaxsat.scenario.build.plugin_trial import made_part, require_events, require_torque
from jaxsat.scenario.build.sensors import tachometer_noise
from jaxsat.scenario.build.thrusters import failing, pulsed_thrusters, rate_noise
from jaxsat.scenario.parts.thrusters import working_torques
from jaxsat.scenario.parts.wheels import (
    UnloadingTable,
    failed_wheels,
    left_by_wheels,
    wheel_axes,
    wheels_make_all,
)
from jaxsat.scenario.plugins import ACTUATORS, find_part
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft import (
    AbstractActuators,
    AbstractPulsedActuators,
    ActuatorContext,
    Actuators,
    ActuatorsWithWheels,
    ControlMomentGyros,
    EffectorContext,
    Magnetorquers,
    NoThrusters,
    PulsedActuatorsWithWheels,
    Thrusters,
    WheelDrives,
    Wheels,
)
from jaxsat.spacecraft.dynamics import RigidBody


def build_actuators(scenario: Scenario) -> AbstractActuators | AbstractPulsedActuators:
    """The thrusters left, and how they share the torque that the law commands.

    Or what the scenario has in place of thrusters that make that torque exactly.
    """
    declaration = scenario.law.declaration
    torques = declaration.torques
    if scenario.wheel and declaration.commands_actuators:
        return _as_commanded(scenario)
    if scenario.wheel and torques:
        return _with_wheels(scenario, torques)
    if scenario.thruster:
        return pulsed_thrusters(scenario, torques)
    steered = any(getattr(scenario, name) for name in STEERED)
    if steered and not scenario.spacecraft.thruster_torque_axes:
        return NoThrusters()
    ideal, table = ideal_thrusters(scenario, torques), scenario.actuators
    if table is None:
        return failing(scenario, ideal)
    part, location = find_part(ACTUATORS, table.kind), ("actuators", "kind")
    actuators = made_part(part, location, table, ActuatorContext(ideal, torques))
    require_torque(part, location, actuators, jnp.zeros(torques or 2))
    require_events(part, location, actuators, jnp.zeros(torques or 2))
    return actuators


def _as_commanded(scenario: Scenario) -> WheelDrives | PulsedActuatorsWithWheels:
    """Wheels, and thrusters if there are any, under a law that commands each of them."""
    if not scenario.thruster:
        return WheelDrives()
    thrusters, wheels = pulsed_thrusters(scenario, 3), len(scenario.wheel)
    all_devices = np.eye(thrusters.thrusters.count + wheels)
    drives = ActuatorsWithWheels(wheel_axes(scenario.wheel), all_devices[-wheels:])
    return PulsedActuatorsWithWheels(drives, thrusters, all_devices[:-wheels])


def _with_wheels(
    scenario: Scenario, torques: int
) -> ActuatorsWithWheels | PulsedActuatorsWithWheels:
    """Wheels that make what they can of the law's command, and thrusters for the rest."""
    tables = scenario.wheel
    axes, failed = wheel_axes(tables), failed_wheels(tables)
    limits = np.array([one.torque_limit_N_m or np.inf for one in tables])
    limit = limits if np.isfinite(limits).any() else None
    if wheels_make_all(tables, torques):
        return ActuatorsWithWheels.of(axes, torques, limit, failed=failed)
    thrusters = bool(scenario.thruster or scenario.spacecraft.thruster_torque_axes)
    ideal = failing(scenario, ideal_thrusters(scenario, torques)) if thrusters else NoThrusters()
    mixed = ActuatorsWithWheels.of(axes, torques, limit, ideal, failed)
    if not scenario.thruster or mixed.rest is None:
        return mixed
    alone = dataclasses.replace(mixed, thrusters=None, rest=None)
    return PulsedActuatorsWithWheels(alone, pulsed_thrusters(scenario, torques), mixed.rest)


def ideal_thrusters(scenario: Scenario, torques: int) -> Actuators:
    """The thrusters left as makers of torques; any will do where no torque is commanded."""
    table = scenario.spacecraft
    limit = math.inf if table.torque_limit_N_m is None else table.torque_limit_N_m
    if scenario.thruster:
        axes = unit_columns(working_torques(scenario.thruster))
        return Actuators(axes, jnp.zeros((axes.shape[1], torques or 2)), as_float(limit))
    axes = np.array(table.thruster_torque_axes or (), dtype=float).reshape(-1, 3).T
    thrusters = Thrusters(axes).without(table.failed_thrusters)
    any_plane = scenario.law.declaration.any_plane
    if torques and any(getattr(scenario, name) for name in ("wheel", *STEERED)):
        columns = np.asarray(thrusters.torque_axes)
        shares, all_axes = least_squares_map(columns, torques), columns if torques == 3 else None
        return Actuators(columns, shares, as_float(limit), shared_axes=all_axes)
    if not torques:
        return Actuators(thrusters.torque_axes, jnp.zeros((thrusters.count, 2)), as_float(limit))
    if any_plane:
        columns = np.asarray(thrusters.torque_axes)
        shared = as_array(direction_matrix(columns, torque_directions(columns)))
        return Actuators(thrusters.torque_axes, shared, as_float(limit))
    return Actuators.of(thrusters, limit, torques)


def wheel_context(scenario: Scenario) -> WheelContext | None:
    """What a law that commands each wheel is told of them; None for others."""
    if not scenario.law.declaration.commands_actuators or not scenario.wheel:
        return None
    wheels, _ = Wheels.from_tables(scenario.wheel, EffectorContext(place_of(scenario.orbit), ()))
    delay = 0.0 if scenario.sampling is None else scenario.sampling.delay_s
    failed = np.array([one.failed for one in scenario.wheel])
    return WheelContext(wheels, failed, tachometer_noise(scenario), delay, rate_noise(scenario))


def build_steering(scenario: Scenario, plant: RigidBody) -> tuple[AbstractSteering, ...]:
    """What steers effectors of the plant, in the order in which they are asked."""
    steering: list[AbstractSteering] = []
    torquers, gyros = plant.find(Magnetorquers), plant.find(ControlMomentGyros)
    if torquers is not None:
        steering.append(_magnetic_steering(scenario, torquers))
    if gyros is not None:
        working = np.array([not one.failed for one in scenario.gimbal], float)
        steering.append(GimbalSteering(cast(ControlMomentGyros, gyros.without_corners()), working))
    return tuple(steering)


def _magnetic_steering(scenario: Scenario, torquers: Magnetorquers) -> MagneticSteering:
    """Dipoles for what wheels do not make of a command of three torques, and that unload them."""
    axes, working = np.asarray(torquers.axes), [not one.failed for one in scenario.magnetorquer]
    shares = np.zeros((axes.shape[1], 3))
    shares[working] = np.linalg.pinv(axes[:, working])
    unloading = scenario.unloading or UnloadingTable()
    wheels = scenario.wheel
    return MagneticSteering(
        torquers.field,
        axes,
        shares,
        torquers.dipole_limit,
        left_by_wheels(wheels, 3) if wheels else np.eye(3),
        1 / unloading.time_constant_s,
        wheel_axes(wheels) if wheels else None,
    )
