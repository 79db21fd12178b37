"""Construction of the actuators of a scenario."""

import dataclasses
import math
import pkgutil

import jax.numpy as jnp
import numpy as np

from jaxsat.control.controller import MagneticContext, WheelContext
from jaxsat.core.allocation import unit_columns
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.actuators import ACTUATORS as DECLARED
from jaxsat.core.declaration.actuators import STEERED
from jaxsat.scenario.build.plant import effector_context
from jaxsat.scenario.build.plugin_trial import made_part, require_events, require_torque
from jaxsat.scenario.build.sensors import tachometer_noise
from jaxsat.scenario.build.thrusters import pulsed_thrusters, rate_noise, with_failures
from jaxsat.scenario.derived import ideal_shares, thruster_costs
from jaxsat.scenario.parts.torque_makers import TorqueMakers, left_by_wheels, wheel_axes
from jaxsat.scenario.parts.wheels import UnloadingTable
from jaxsat.scenario.plugins import ACTUATORS, find_part
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft.actuators import ActuatorContext, Actuators, PluginActuators
from jaxsat.spacecraft.distribution import AbstractDistribution, Direct, WheelsFirst
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.effector import AbstractEffector, Reach
from jaxsat.spacecraft.magnetorquers import MagneticSteering, Magnetorquers
from jaxsat.spacecraft.relief import Relief
from jaxsat.spacecraft.steering import AbstractSteering, Steered, SteeringContext
from jaxsat.spacecraft.thrusters import Thrusters
from jaxsat.spacecraft.wheel_friction import WheelFriction
from jaxsat.spacecraft.wheels import Wheels


def build_thrusters(scenario: Scenario) -> AbstractEffector | None:
    """Effector of the working thrusters, or the actuators that replace ideal thrusters.

    None if the law commands other actuators, or other actuators make every command.
    """
    makers = TorqueMakers.of(scenario)
    torques = makers.law.torques
    if makers.law.commands_actuators:
        return pulsed_thrusters(scenario) if makers.pushes.size else None
    none = not (makers.pushes.size or scenario.spacecraft.thruster_torque_axes)
    idle = makers.wheels and torques and (none or makers.wheels_make_all)
    if idle and not makers.relieved:
        return None
    if none and any(getattr(scenario, name) for name in STEERED):
        return None
    if makers.thrusters:
        return pulsed_thrusters(scenario)
    ideal, table = ideal_thrusters(scenario, torques), scenario.actuators
    if table is None:
        return with_failures(scenario, ideal)
    part, location = find_part(ACTUATORS, table.kind), ("actuators", "kind")
    actuators = made_part(part, location, table, ActuatorContext(ideal, torques))
    require_torque(part, location, actuators, jnp.zeros(torques or 2))
    require_events(part, location, actuators, jnp.zeros(torques or 2))
    return PluginActuators(actuators=actuators, torques=torques or 2)


def build_distribution(scenario: Scenario, plant: RigidBody) -> AbstractDistribution:
    """Allocation of the law's command among effectors: steering first, then wheels, thrusters."""
    declaration = scenario.law.declaration
    if declaration.commands_actuators:
        return Direct()
    steering = _steering(scenario, plant)
    steered = {one.kind for one in steering}
    others = [one for one in plant.effectors if one.kind not in steered and one.command_size]
    rest: AbstractDistribution | None = None
    if scenario.wheel and declaration.torques:
        rest = _wheels_first(scenario)
    elif any(one.storage() is None for one in others):
        rest = Direct()
    return Steered(steering, rest) if steering or rest is None else rest


def _wheels_first(scenario: Scenario) -> WheelsFirst:
    """Allocation to wheels first, within their capacity; thrusters, if any, get the rest."""
    makers = TorqueMakers.of(scenario)
    wheels, whole = makers.wheels, makers.wheels_make_all
    limits = np.array([one.torque_limit_N_m or np.inf for one in wheels])
    friction = _known_friction(scenario)
    if friction is not None:  # torque left for the command by a motor that also overcomes friction
        spare = limits - np.asarray(friction.coulomb)
        limits = np.where(spare > 0, spare, limits)
    distribution = WheelsFirst.of(
        wheel_axes(wheels),
        makers.law.torques,
        limits if np.isfinite(limits).any() else None,
        tuple(number for number, one in enumerate(wheels, 1) if one.failed or makers.wheels_idle),
        not whole,
        makers.directions,
    )
    distribution = dataclasses.replace(distribution, friction=friction)
    if not makers.relieved:
        return distribution
    torque, price = makers.pushes, thruster_costs(scenario)
    relief = Relief(
        Reach(as_float(torque), jnp.zeros(price.size), jnp.ones(price.size), as_float(price)),
        distribution.axes,
        distribution.wheel_map,
        limits,
        np.array([one.momentum_limit_N_m_s or np.inf for one in wheels]),
        inertia_matrix(scenario.spacecraft.inertia_kg_m2),
        scenario.control.period_s,
    )
    together = not whole and not makers.thrusters_make_all
    return dataclasses.replace(distribution, relief=relief, together=together)


def _known_friction(scenario: Scenario) -> WheelFriction | None:
    """Friction of the working wheels that a sampled law knows; None for other laws."""
    if not scenario.law.declaration.sampled:
        return None
    idle = TorqueMakers.of(scenario).wheels_idle
    works = np.array([not (one.failed or idle) for one in scenario.wheel])
    noise, period = tachometer_noise(scenario), scenario.control.period_s
    return WheelFriction.of(_declared_wheels(scenario), works, noise, period)


def _declared_wheels(scenario: Scenario) -> Wheels:
    return Wheels.from_tables(scenario.wheel, effector_context(scenario))[0]


def ideal_thrusters(scenario: Scenario, torques: int) -> Actuators:
    """Ideal torque actuators of the working thrusters; any shares do without a commanded torque."""
    table = scenario.spacecraft
    if scenario.thruster:
        axes = unit_columns(TorqueMakers.of(scenario).pushes)
    else:
        rows = np.array(table.thruster_torque_axes or (), dtype=float).reshape(-1, 3)
        axes = np.asarray(Thrusters(rows.T).without(table.failed_thrusters).torque_axes)
    limit = math.inf if table.torque_limit_N_m is None else table.torque_limit_N_m
    if scenario.thruster or not torques:
        shares = np.zeros((axes.shape[1], torques or 2))
    else:
        shares = ideal_shares(scenario, axes)
    together = torques == 3 and not scenario.thruster
    return Actuators(
        torque_axes=axes,
        thrust_map=shares,
        limit=as_float(limit),
        shared_axes=axes if together else None,
    )


def wheel_context(scenario: Scenario) -> WheelContext | None:
    """Wheel model for a law that commands each wheel; None for other laws."""
    if not scenario.law.declaration.commands_actuators or not scenario.wheel:
        return None
    wheels = _declared_wheels(scenario)
    failed = np.array([one.failed for one in scenario.wheel])
    still = not any(one.momentum_N_m_s for one in scenario.wheel)
    return WheelContext(wheels, failed, tachometer_noise(scenario), rate_noise(scenario), still)


def magnetic_context(scenario: Scenario) -> MagneticContext | None:
    """Model of the working magnetorquers for a law; None without any."""
    tables, wheels = scenario.magnetorquer, scenario.wheel
    if all(one.failed for one in tables):
        return None
    torquers, _ = Magnetorquers.from_tables(tables, effector_context(scenario))
    coasting = np.array([one.momentum_N_m_s if one.failed else 0.0 for one in wheels])
    context = _steering_context(scenario)
    steering = MagneticSteering.from_tables(torquers, tables, context)
    return MagneticContext(steering, context.bias + wheel_axes(wheels) @ coasting)


def _steering_context(scenario: Scenario) -> SteeringContext:
    unloading, wheels = scenario.unloading or UnloadingTable(), scenario.wheel
    working = np.array([not one.failed for one in wheels], float)
    return SteeringContext(
        wheel_axes(wheels) * working if wheels else None,
        left_by_wheels(wheels, 3) if wheels else np.eye(3),
        1 / unloading.time_constant_s,
        np.array([0.0, -unloading.bias_N_m_s, 0.0]),
    )


def _steering(scenario: Scenario, plant: RigidBody) -> tuple[AbstractSteering, ...]:
    """Steering laws of the plant's effectors, in their order of evaluation."""
    context = _steering_context(scenario)
    makers = {one.name: one.steering for one in DECLARED if one.steering}
    return tuple(
        pkgutil.resolve_name(makers[one.kind])(one, getattr(scenario, one.kind), context)
        for one in plant.effectors
        if one.kind in makers
    )
