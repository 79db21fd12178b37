"""From tables `[[thruster]]` to thrusters that push, and what a law is told of them."""

from typing import Any

import numpy as np

from jaxsat.control.context import ThrusterContext
from jaxsat.control.diagnosis import ThrusterModel
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.sensors import DELAY, GYRO_KEYS, SENSOR_KEYS
from jaxsat.scenario.build.failures import thruster_failures
from jaxsat.scenario.declared import values_of
from jaxsat.scenario.layout import command_torques, thruster_costs
from jaxsat.scenario.parts.thrusters import (
    ModulationTable,
    ThrusterTable,
    modulation_kind,
    signs,
)
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft import (
    AbstractModulation,
    DeltaSigma,
    Gyro,
    IdealThrottle,
    LeastPropellant,
    PulsedThrusters,
    PulseWidth,
    PulseWidthPulseFrequency,
    ThrusterSet,
)


def pulsed_thrusters(scenario: Scenario, torques: int) -> PulsedThrusters:
    """The thrusters that work, how they share a command of so many torques, and what fails."""
    working = [one for one in scenario.thruster if not one.failed]
    sampling = scenario.sampling and scenario.sampling.model_dump()
    dispersed = getattr(scenario.dispersion, DELAY.name, None) is not None
    delay = dispersed or bool(sampling and sampling[DELAY.name] > 0)
    thrusters = _thruster_set(working)
    drawn = getattr(scenario.dispersion, "failure_kind", None) is not None
    late = delay or drawn or any(one.kind == "delayed" for one in scenario.failure)
    as_commanded = scenario.law.declaration.commands_duties
    commanded = command_torques(scenario, torques or 3)
    return PulsedThrusters(
        thrusters,
        None if as_commanded else LeastPropellant.of(*commanded, tabled=True),
        _modulation(scenario),
        thruster_failures(scenario.failure, scenario.thruster),
        late or thrusters.valve_delay is not None,
    )


def thruster_context(scenario: Scenario) -> ThrusterContext | None:
    """What a law that commands duties is told of the thrusters that work; None for others."""
    if not scenario.law.declaration.commands_duties:
        return None
    working = [one for one in scenario.thruster if not one.failed]
    thrusters = _thruster_set(working)
    zero = np.zeros(thrusters.count)
    delay = 0.0 if scenario.sampling is None else getattr(scenario.sampling, DELAY.name)

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
        flow=np.array([one.propellant_flow() for one, _ in sided]),
        min_on_time=each("min_on_time_s"),
        valve_delay=unless_zero("valve_delay_s")[0],
        rise_time=rise,
        fall_time=fall,
    )


def _modulation(scenario: Scenario) -> AbstractModulation:
    table = scenario.modulation or ModulationTable()
    kind = modulation_kind(table, scenario.thruster)
    if kind == "pwpf":
        period: Any = getattr(scenario.control, "period_s")  # noqa: B009
        return PulseWidthPulseFrequency.of(
            period, table.gain, table.time_constant_s, table.on_level, table.off_level
        )
    return {"pwm": PulseWidth, "delta-sigma": DeltaSigma, "ideal": IdealThrottle}[kind]()
