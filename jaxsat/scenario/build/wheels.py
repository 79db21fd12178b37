"""From a scenario to its wheels."""

import numpy as np

from jaxsat.control.context import WheelContext
from jaxsat.core.declaration.sensors import DELAY
from jaxsat.core.noise import key_of_seed
from jaxsat.scenario.build.plant import place_of
from jaxsat.scenario.build.pulsed_thrusters import rate_noise
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft import EffectorContext, Tachometers, Wheels


def wheel_context(scenario: Scenario) -> WheelContext | None:
    """What a law that commands each wheel is told of them; None for others."""
    if not scenario.law.declaration.commands_wheels:
        return None
    wheels, _ = Wheels.from_tables(scenario.wheel, EffectorContext(place_of(scenario.orbit), ()))
    delay = 0.0 if scenario.sampling is None else getattr(scenario.sampling, DELAY.name)
    failed = np.array([one.failed for one in scenario.wheel])
    return WheelContext(wheels, failed, _tachometer_noise(scenario), delay, rate_noise(scenario))


def build_tachometers(scenario: Scenario) -> Tachometers | None:
    """Those of a sampled law; None where all are exact."""
    noise = _tachometer_noise(scenario)
    return Tachometers(noise, key_of_seed(scenario.simulation.seed)) if noise.any() else None


def _tachometer_noise(scenario: Scenario) -> np.ndarray:
    return np.array([one.tachometer_noise_N_m_s for one in scenario.wheel])
