"""From a scenario to its wheels."""

import equinox as eqx
import numpy as np
from jaxtyping import Array

from jaxsat.control.context import WheelContext
from jaxsat.core.checks import as_array
from jaxsat.core.declaration.sensors import DELAY
from jaxsat.core.noise import key_of_seed
from jaxsat.scenario.build.pulsed_thrusters import rate_noise
from jaxsat.scenario.laws import find_law
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.thruster_tables import FailureTable, number_of
from jaxsat.scenario.wheel_tables import WheelTable, wheel_axes
from jaxsat.spacecraft import Tachometers, WheelFailureKind, WheelFailures, Wheels


def build_wheels(scenario: Scenario) -> Wheels | None:
    """The wheels of a scenario; None without any. What none of them has is left out."""
    tables = scenario.wheel
    if not tables:
        return None
    return Wheels(
        wheel_axes(tables),
        limits_of(tables, "torque_limit_N_m"),
        limits_of(tables, "momentum_limit_N_m_s"),
        _unless_zero(tables, "rotor_inertia_kg_m2"),
        _unless_zero(tables, "viscous_friction_N_m_s"),
        _unless_zero(tables, "coulomb_friction_N_m"),
        _failures(scenario),
    )


def wheel_context(scenario: Scenario) -> WheelContext | None:
    """What a law that commands each wheel is told of them; None for others."""
    if not find_law(scenario.control.law).declaration.commands_wheels:
        return None
    wheels = build_wheels(scenario)
    assert wheels is not None  # a rule of the scenario
    delay = 0.0 if scenario.sampling is None else getattr(scenario.sampling, DELAY.name)
    failed = np.array([one.failed for one in scenario.wheel])
    known = eqx.tree_at(lambda x: x.failures, wheels, None, is_leaf=lambda x: x is None)
    return WheelContext(known, failed, _tachometer_noise(scenario), delay, rate_noise(scenario))


def build_tachometers(scenario: Scenario) -> Tachometers | None:
    """Those of a sampled law; None where all are exact."""
    noise = _tachometer_noise(scenario)
    return Tachometers(noise, key_of_seed(scenario.simulation.seed)) if noise.any() else None


def _tachometer_noise(scenario: Scenario) -> np.ndarray:
    return np.array([one.tachometer_noise_N_m_s for one in scenario.wheel])


def _failures(scenario: Scenario) -> WheelFailures | None:
    """What strikes wheels in flight."""
    found = [(number_of(one.of, "wheel", scenario.wheel), one) for one in scenario.failure]
    events = [(number, one) for number, one in found if number is not None]
    if not events:
        return None
    return WheelFailures(
        wheel=[number for number, _ in events],
        at=[one.at_s for _, one in events],
        kind=[_kind(one) for _, one in events],
        amount=[
            next((x for x in (one.fraction, one.factor, one.friction_N_m) if x is not None), 0.0)
            for _, one in events
        ],
    )


def _kind(table: FailureTable) -> WheelFailureKind:
    if table.kind == "friction-up":
        by = table.factor is not None
        return WheelFailureKind.FRICTION_BY if by else WheelFailureKind.FRICTION_TO
    return WheelFailureKind[table.kind.upper()]


def limits_of(tables: tuple[WheelTable, ...], name: str) -> np.ndarray | None:
    """Limits, infinite for a wheel without; None where no wheel has one."""
    values = np.array([getattr(one, name) or np.inf for one in tables])
    return values if np.isfinite(values).any() else None


def _unless_zero(tables: tuple[WheelTable, ...], name: str) -> np.ndarray | None:
    values = np.array([getattr(one, name) or 0.0 for one in tables])
    return values if values.any() else None


def wheel_momentum(scenario: Scenario) -> Array | None:
    """Momenta at the start, N m s; None without wheels."""
    if not scenario.wheel:
        return None
    return as_array(np.array([one.momentum_N_m_s for one in scenario.wheel]))
