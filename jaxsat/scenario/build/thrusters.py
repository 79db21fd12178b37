"""Construction of pushing thrusters from tables `[[thruster]]`, and their model for a law."""

import dataclasses
import math
from typing import Any

import numpy as np

from jaxsat.control.controller import ThrusterContext
from jaxsat.control.diagnosis.thruster_filter import ThrusterModel
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.failures import FailureKind, failure_kind
from jaxsat.core.declaration.sensors import GYRO
from jaxsat.scenario.build.plant import sensor_context
from jaxsat.scenario.derived import command_torques, has_invalid_samples, thruster_costs
from jaxsat.scenario.parts.failures import FailureTable
from jaxsat.scenario.parts.named import number_of
from jaxsat.scenario.parts.thrusters import ModulationTable, ThrusterTable, modulation_kind
from jaxsat.scenario.parts.torque_makers import TorqueMakers, signs, working_torques
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.failures import FailureEvents
from jaxsat.spacecraft.least_propellant import LeastPropellant
from jaxsat.spacecraft.modulation import (
    AbstractModulation,
    DeltaSigma,
    IdealThrottle,
    PulseWidth,
    PulseWidthPulseFrequency,
)
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.thrusters import ThrusterSet


def pulsed_thrusters(scenario: Scenario) -> PulsedThrusters:
    """Return the working thrusters, their allocation for the law's torques, and failures."""
    working = [one for one in scenario.thruster if not one.failed]
    draws_delay = getattr(scenario.dispersion, "delay_s", None) is not None
    delay = draws_delay or (scenario.sampling is not None and scenario.sampling.delay_s > 0)
    thrusters = _thruster_set(working)
    draws_kinds = getattr(scenario.dispersion, "failure_kind", None) is not None
    late = delay or draws_kinds or any(one.kind == "delayed" for one in scenario.failure)
    makers = TorqueMakers.of(scenario)
    as_commanded = makers.law.commands_actuators
    behind = makers.relieved and (makers.wheels_make_all or not makers.thrusters_make_all)
    return PulsedThrusters(
        thrusters=thrusters,
        allocation=None
        if as_commanded
        else LeastPropellant.of(*command_torques(scenario), tabled=not behind),
        modulation=_modulation(scenario),
        failures=thruster_failures(scenario.failure, scenario.thruster),
        late=late or thrusters.valve_delay is not None or has_invalid_samples(scenario),
    )


def thruster_context(scenario: Scenario) -> ThrusterContext | None:
    """Return the model of working thrusters for a law that commands each; None for others, and
    where none works."""
    working = [one for one in scenario.thruster if not one.failed]
    if not scenario.law.declaration.commands_actuators or not working:
        return None
    thrusters = _thruster_set(working)
    zero = np.zeros(thrusters.count)
    delay = 0.0 if scenario.sampling is None else scenario.sampling.delay_s

    def late(ramp: Any) -> np.ndarray:
        times = (thrusters.valve_delay, None if ramp is None else np.asarray(ramp) / 2)
        return sum((np.asarray(one) for one in times if one is not None), zero + delay)

    model = ThrusterModel(
        thrusters.torque,
        thrusters.min_on_time,
        late(thrusters.rise_time),
        late(thrusters.fall_time),
        _modulation(scenario),
    )
    whole = isinstance(model.modulation, DeltaSigma | PulseWidth)
    pulse = np.asarray(thrusters.min_on_time) if whole else zero
    return ThrusterContext(model, thruster_costs(scenario), rate_noise(scenario), pulse)


def rate_noise(scenario: Scenario) -> float:
    """Standard deviation (rad/s) of the measurement noise of a sampled law's rates, per sample.

    Without a gyro it is that of the change of a rate in a period by the torques that the filter
    does not know, about the axis with the smallest moment of inertia.
    """
    estimator = scenario.estimator
    if scenario.gyro is None and estimator is not None and estimator.torque_noise_N_m_sqrt_Hz:
        least = np.linalg.eigvalsh(inertia_matrix(scenario.spacecraft.inertia_kg_m2))[0]
        impulse = estimator.torque_noise_N_m_sqrt_Hz * scenario.control.period_s**0.5
        return float(impulse / least)
    if scenario.gyro is not None:
        context = sensor_context(scenario)
        gyro = GYRO.from_table(dict(scenario.gyro), context)
        return float(gyro.rate_variance(as_float(context.period))) ** 0.5
    return 0.0 if scenario.sampling is None else scenario.sampling.rate_noise_rad_s


def _thruster_set(working: list[ThrusterTable]) -> ThrusterSet:
    pairs = [(one, sign) for one in working for sign in signs(one)]

    def each(name: str) -> np.ndarray:
        return np.array([getattr(one, name) for one, _ in pairs], float)

    def unless_zero(*names: str) -> list[Any]:
        values = [each(name) for name in names]
        return values if any(value.any() for value in values) else [None] * len(names)

    rise, fall = unless_zero("rise_time_s", "fall_time_s")
    return ThrusterSet(
        torque=np.array([sign * one.torque() for one, sign in pairs]).T,
        force=np.array([sign * one.force() for one, sign in pairs]).T,
        flow=np.array([one.propellant_flow() for one, _ in pairs]),
        min_on_time=each("min_on_time_s"),
        valve_delay=unless_zero("valve_delay_s")[0],
        rise_time=rise,
        fall_time=fall,
    )


def _modulation(scenario: Scenario) -> AbstractModulation:
    table = scenario.modulation or ModulationTable()
    kind = modulation_kind(table, scenario.thruster)
    if kind == "pwpf":
        period = scenario.control.period_s
        return PulseWidthPulseFrequency.of(
            period, table.gain, table.time_constant_s, table.on_level, table.off_level
        )
    return {"pwm": PulseWidth, "delta-sigma": DeltaSigma, "ideal": IdealThrottle}[kind]()


def with_failures(scenario: Scenario, ideal: Actuators) -> Actuators:
    """Thrusters of `spacecraft.thruster_torque_axes` with the failures of those that work."""
    table = scenario.spacecraft
    if scenario.thruster or not scenario.failure:
        return ideal
    rows = range(1, len(table.thruster_torque_axes or ()) + 1)
    working = [number for number in rows if number not in table.failed_thrusters]
    axes = np.asarray(ideal.torque_axes)
    targets = [(number_of(one.of, "thruster", rows), one) for one in scenario.failure]
    events = []
    for number, one in targets:
        if number is None or number + 1 not in working:
            continue
        place, turned_axes = working.index(number + 1), axes.copy()
        if one.turn_rad is not None:
            turned_axes[:, place] = _rotate(turned_axes[:, place], one.turn_rad)
        events.append((one, place, turned_axes))
    return dataclasses.replace(ideal, failures=_events(events, None))


def thruster_failures(
    tables: tuple[FailureTable, ...], thrusters: tuple[ThrusterTable, ...]
) -> FailureEvents | None:
    """Return failure events of working thrusters; those of an already failed thruster are omitted.

    Kinds that strike one direction of a two-sided thruster strike the declared direction.
    """
    events = []
    places = _places(thrusters)
    nominal = working_torques(thrusters)
    for table in tables:
        number = number_of(table.of, "thruster", thrusters)
        if number is None or not places[number]:
            continue
        turned_torques = nominal.copy()
        if table.turn_rad is not None:
            for place in places[number]:
                turned_torques[:, place] = _turn_thrust(
                    thrusters[number], nominal[:, place], table.turn_rad
                )
        events.append((table, places[number][0], turned_torques))
    partner = [place for both in places for place in reversed(both)]
    return _events(events, partner if any(len(both) > 1 for both in places) else None)


def _events(
    events: list[tuple[FailureTable, int, np.ndarray]], partner: list[int] | None
) -> FailureEvents | None:
    """Events from tables, the column that each strikes, and the torques as turned by each."""
    if not events:
        return None
    kinds = [failure_kind(FailureKind, table) for table, _, _ in events]
    return FailureEvents(
        number=[place for _, place, _ in events],
        at=[table.at_s for table, _, _ in events],
        kind=kinds,
        amount=[kind.amount(table) for kind, (table, _, _) in zip(kinds, events, strict=True)],
        turned=np.stack([turned_torques for _, _, turned_torques in events]),
        partner=partner,
    )


def _places(thrusters: tuple[ThrusterTable, ...]) -> list[list[int]]:
    """Columns of each thruster among the working ones: none, one, or two for a two-sided one."""
    places, column = [], 0
    for one in thrusters:
        count = 0 if one.failed else len(signs(one))
        places.append(list(range(column, column + count)))
        column += count
    return places


def _turn_thrust(
    thruster: ThrusterTable, torque: np.ndarray, rotation: tuple[float, ...]
) -> np.ndarray:
    """Torque (N m) after the force, or the torque itself, is turned by a rotation vector (rad)."""
    if thruster.position_m is None:
        return _rotate(torque, rotation)
    way = math.copysign(1.0, float(torque @ thruster.torque()))
    return np.cross(np.array(thruster.position_m), _rotate(way * thruster.force(), rotation))


def _rotate(vector: np.ndarray, rotation: tuple[float, ...]) -> np.ndarray:
    from scipy.spatial.transform import Rotation  # slow to import, and seldom needed

    return Rotation.from_rotvec(rotation).apply(vector)
