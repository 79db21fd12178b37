"""From a scenario to its actuators."""

import dataclasses
import math
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxsat.allocation import (
    direction_matrix,
    largest_torque,
    least_propellant,
    least_squares_map,
    plane_map,
    torque_directions,
    unit_columns,
)
from jaxsat.assembly.plugin_trial import made_part, require_events, require_torque
from jaxsat.assembly.wheels import limits_of
from jaxsat.checks import as_array, as_float
from jaxsat.control.context import ThrusterContext
from jaxsat.declaration.sensors import DELAY, GYRO_KEYS, SENSOR_KEYS
from jaxsat.diagnosis import ThrusterModel
from jaxsat.scenario.declared import values_of
from jaxsat.scenario.laws import find_law
from jaxsat.scenario.plugins import ACTUATORS, find_part
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.thruster_tables import (
    FailureTable,
    ModulationTable,
    ThrusterTable,
    number_of,
    signs,
    working_torques,
)
from jaxsat.scenario.wheel_tables import failed_wheels, left_by_wheels, wheel_axes
from jaxsat.vehicle import (
    AbstractActuators,
    AbstractModulation,
    AbstractPulsedActuators,
    ActuatorContext,
    Actuators,
    ActuatorsWithWheels,
    DeltaSigma,
    FailureEvents,
    FailureKind,
    Gyro,
    IdealThrottle,
    LeastPropellant,
    PulsedActuatorsWithWheels,
    PulsedThrusters,
    PulseWidth,
    PulseWidthPulseFrequency,
    Thrusters,
    ThrusterSet,
)
from jaxsat.vehicle.thruster_set import STANDARD_GRAVITY

ONE_WAY = ("stuck-on", "stuck-at", "leaking")
"""Failures that strike a two-sided thruster the way that it is declared."""


def build_actuators(scenario: Scenario) -> AbstractActuators | AbstractPulsedActuators:
    """The thrusters left, and how they share the torque that the law commands.

    Or what the scenario has in place of thrusters that make that torque exactly.
    """
    torques = find_law(scenario.control.law).declaration.torques
    if scenario.wheel and torques:
        return _with_wheels(scenario, torques)
    if scenario.thruster:
        return _pulsed_thrusters(scenario, torques)
    ideal, table = ideal_thrusters(scenario, torques), scenario.actuators
    if table is None:
        return _failing(scenario, ideal)
    part, location = find_part(ACTUATORS, table.kind), ("actuators", "kind")
    made = made_part(part, location, table, ActuatorContext(ideal, torques))
    require_torque(part, location, made, jnp.zeros(torques or 2))
    require_events(part, location, made, jnp.zeros(torques or 2))
    return made


def _with_wheels(
    scenario: Scenario, torques: int
) -> ActuatorsWithWheels | PulsedActuatorsWithWheels:
    """Wheels that make what they can of the law's command, and thrusters for the rest."""
    tables = scenario.wheel
    axes, failed = wheel_axes(tables), failed_wheels(tables)
    limit = limits_of(tables, "torque_limit_N_m")
    if not left_by_wheels(tables, torques).any():
        return ActuatorsWithWheels.of(axes, torques, limit, failed=failed)
    ideal = _failing(scenario, ideal_thrusters(scenario, torques))
    mixed = ActuatorsWithWheels.of(axes, torques, limit, ideal, failed)
    if not scenario.thruster or mixed.rest is None:
        return mixed
    alone = ActuatorsWithWheels(mixed.wheel_map, mixed.wheel_limit)
    return PulsedActuatorsWithWheels(alone, _pulsed_thrusters(scenario, torques), mixed.rest)


def ideal_thrusters(scenario: Scenario, torques: int) -> Actuators:
    """The thrusters left as makers of torques; any will do where no torque is commanded."""
    table = scenario.spacecraft
    limit = math.inf if table.torque_limit_N_m is None else table.torque_limit_N_m
    if scenario.thruster:
        axes = unit_columns(working_torques(scenario.thruster))
        return Actuators(axes, jnp.zeros((axes.shape[1], torques or 2)), as_float(limit))
    axes = np.array(table.thruster_torque_axes or (), dtype=float).reshape(-1, 3).T
    thrusters = Thrusters(axes).without(table.failed_thrusters)
    any_plane = find_law(scenario.control.law).declaration.any_plane
    if torques and scenario.wheel:
        left = np.asarray(thrusters.torque_axes)
        return Actuators(left, least_squares_map(left, torques), as_float(limit))
    if not torques:
        return Actuators(thrusters.torque_axes, jnp.zeros((thrusters.count, 2)), as_float(limit))
    if any_plane:
        known = np.asarray(thrusters.torque_axes)
        shared = as_array(direction_matrix(known, torque_directions(known)))
        return Actuators(thrusters.torque_axes, shared, as_float(limit))
    return Actuators.of(thrusters, limit, torques)


def _failing(scenario: Scenario, ideal: Actuators) -> Actuators:
    """Thrusters of `spacecraft.thruster_torque_axes` with what strikes those that work."""
    table = scenario.spacecraft
    if scenario.thruster or not scenario.failure:
        return ideal
    rows = range(1, len(table.thruster_torque_axes or ()) + 1)
    working = [number for number in rows if number not in table.failed_thrusters]
    axes = np.asarray(ideal.torque_axes)
    found = [(number_of(one.of, "thruster", rows), one) for one in scenario.failure]
    events = []
    for number, one in found:
        if number is None or number + 1 not in working:
            continue
        place, turned = working.index(number + 1), axes.copy()
        if one.turn_rad is not None:
            turned[:, place] = _rotated(turned[:, place], one.turn_rad)
        events.append((one, place, turned))
    return dataclasses.replace(ideal, failures=_events(events))


def torque_limit(scenario: Scenario) -> float | None:
    """The largest torque (N m) that the law asks for about each axis; None for no limit."""
    given, torques = (
        scenario.spacecraft.torque_limit_N_m,
        find_law(scenario.control.law).declaration.torques,
    )
    if given is not None or not scenario.thruster or not torques:
        return given
    return largest_torque(_duties(scenario, torques))


def _pulsed_thrusters(scenario: Scenario, torques: int) -> PulsedThrusters:
    working = [one for one in scenario.thruster if not one.failed]
    modulation = scenario.modulation or ModulationTable()
    sampling = scenario.sampling and scenario.sampling.model_dump()
    dispersed = getattr(scenario.dispersion, DELAY.name, None) is not None
    delay = dispersed or bool(sampling and sampling[DELAY.name] > 0)
    thrusters = _thruster_set(working)
    drawn = getattr(scenario.dispersion, "failure_kind", None) is not None
    late = delay or drawn or any(one.kind == "delayed" for one in scenario.failure)
    as_commanded = find_law(scenario.control.law).declaration.commands_duties
    duties = np.eye(thrusters.count)[None] if as_commanded else _duties(scenario, torques or 3)
    return PulsedThrusters(
        thrusters,
        LeastPropellant.of(duties),
        _modulation(modulation, scenario),
        _failures(scenario.failure, scenario.thruster),
        late or thrusters.valve_delay is not None,
    )


def thruster_context(scenario: Scenario) -> ThrusterContext | None:
    """What a law that commands duties is told of the thrusters that work; None for others."""
    if not find_law(scenario.control.law).declaration.commands_duties:
        return None
    working = [one for one in scenario.thruster if not one.failed]
    thrusters = _thruster_set(working)
    zero = np.zeros(thrusters.count)
    delay = 0.0 if scenario.sampling is None else getattr(scenario.sampling, DELAY.name)

    def late(ramp: Any) -> np.ndarray:
        times = (thrusters.valve_delay, None if ramp is None else ramp / 2)
        return sum((np.asarray(one) for one in times if one is not None), zero + delay)

    model = ThrusterModel(
        thrusters.torque,
        thrusters.min_on_time,
        late(thrusters.rise_time),
        late(thrusters.fall_time),
        _modulation(scenario.modulation or ModulationTable(), scenario),
    )
    whole = isinstance(model.modulation, DeltaSigma | PulseWidth)
    pulse = np.asarray(thrusters.min_on_time) if whole else zero
    return ThrusterContext(model, _costs(scenario), _rate_noise(scenario), pulse)


def _rate_noise(scenario: Scenario) -> float:
    """Standard deviation (rad/s) of the rates that a sampled law is told, from sample to sample."""
    if scenario.gyro is not None:
        gyro = Gyro.from_table(values_of(GYRO_KEYS, scenario.gyro))
        period = getattr(scenario.control, "period_s")  # noqa: B009
        return float(gyro.rate_variance(as_float(period))) ** 0.5
    return 0.0 if scenario.sampling is None else getattr(scenario.sampling, SENSOR_KEYS[0].name)


def _thruster_set(working: list[ThrusterTable]) -> ThrusterSet:
    sided = [(one, sign) for one in working for sign in signs(one)]

    def each(name: str) -> np.ndarray:
        return np.array([getattr(one, name) for one, _ in sided], float)

    def unless_zero(*names: str) -> list[Any]:
        values = [each(name) for name in names]
        return values if any(value.any() for value in values) else [None] * len(names)

    rise, fall = unless_zero("rise_time_s", "fall_time_s")
    return ThrusterSet(
        torque=np.array([sign * one.torque() for one, sign in sided]).T,
        force=np.array([sign * one.force() for one, sign in sided]).T,
        flow=np.array([_flow(one) for one, _ in sided]),
        min_on_time=each("min_on_time_s"),
        valve_delay=unless_zero("valve_delay_s")[0],
        rise_time=rise,
        fall_time=fall,
    )


def _flow(thruster: ThrusterTable) -> float:
    """Propellant at full thrust, kg/s; none where it is not told."""
    if thruster.specific_impulse_s is None or thruster.force_N is None:
        return 0.0
    return thruster.force_N / (thruster.specific_impulse_s * STANDARD_GRAVITY)


def _duties(scenario: Scenario, torques: int) -> np.ndarray:
    torque = working_torques(scenario.thruster)
    any_plane = find_law(scenario.control.law).declaration.any_plane and not scenario.wheel
    return least_propellant(torque, _costs(scenario), plane_map(torque, torques, any_plane))


def _costs(scenario: Scenario) -> np.ndarray:
    """Of full thrust of each thruster: its propellant flow or, if any has none, its torque."""
    flows = [_flow(one) for one in scenario.thruster if not one.failed for _ in signs(one)]
    if all(flows):
        return np.array(flows)
    return np.sqrt(np.sum(working_torques(scenario.thruster) ** 2, axis=0))


def _modulation(table: ModulationTable, scenario: Scenario) -> AbstractModulation:
    if table.kind == "pwpf":
        period: Any = getattr(scenario.control, "period_s")  # noqa: B009
        return PulseWidthPulseFrequency.of(
            period, table.gain, table.time_constant_s, table.on_level, table.off_level
        )
    return {"pwm": PulseWidth, "delta-sigma": DeltaSigma, "ideal": IdealThrottle}[table.kind]()


def _failures(
    tables: tuple[FailureTable, ...], thrusters: tuple[ThrusterTable, ...]
) -> FailureEvents | None:
    """Events on working thrusters; those on one that has failed already change nothing."""
    events = []
    places = _places(thrusters)
    nominal = working_torques(thrusters)
    for table in tables:
        number = number_of(table.of, "thruster", thrusters)
        if number is None:
            continue
        struck = places[number][:1] if table.kind in ONE_WAY else places[number]
        for place in struck:
            turned = nominal.copy()
            if table.turn_rad is not None:
                turned[:, place] = _turned(thrusters[number], nominal[:, place], table.turn_rad)
            events.append((table, place, turned))
    return _events(events)


def _events(events: list[tuple[FailureTable, int, np.ndarray]]) -> FailureEvents | None:
    """Tables, which column each strikes, and the torques as it would turn them."""
    if not events:
        return None
    return FailureEvents(
        thruster=[place for _, place, _ in events],
        at=[table.at_s for table, _, _ in events],
        kind=[FailureKind[table.kind.upper().replace("-", "_")] for table, _, _ in events],
        amount=[table.delay_s or table.fraction or 0.0 for table, _, _ in events],
        turned=np.stack([turned for _, _, turned in events]),
    )


def _places(thrusters: tuple[ThrusterTable, ...]) -> list[list[int]]:
    """Columns of each thruster among those that work: none, one, or two of a two-sided one."""
    places, column = [], 0
    for one in thrusters:
        count = 0 if one.failed else len(signs(one))
        places.append(list(range(column, column + count)))
        column += count
    return places


def _turned(thruster: ThrusterTable, torque: np.ndarray, rotation: tuple[float, ...]) -> np.ndarray:
    """The torque (N m) once the force, or the torque itself, is turned by a rotation vector."""
    if thruster.position_m is None:
        return _rotated(torque, rotation)
    way = math.copysign(1.0, float(torque @ thruster.torque()))
    return np.cross(np.array(thruster.position_m), _rotated(way * thruster.force(), rotation))


def _rotated(vector: np.ndarray, rotation: tuple[float, ...]) -> np.ndarray:
    """A vector turned by a rotation vector, rad."""
    from scipy.spatial.transform import Rotation  # slow to import, and seldom needed

    return Rotation.from_rotvec(rotation).apply(vector)
