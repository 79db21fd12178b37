"""Quaternion feedback against the linear oscillator that it promises, and as a slew."""

import numpy as np
import pytest

from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.core.attitude import Quaternion
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters

INERTIA = [[3.0, 0.2, -0.1], [0.2, 2.0, 0.15], [-0.1, 0.15, 4.0]]
FREQUENCY, DAMPING = 0.2, 0.7


def flown(start, *, max_rate=np.inf, limit=np.inf, period=0.01, seconds=30.0):
    model = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0011))
    law = QuaternionFeedback(model, FREQUENCY, DAMPING, max_rate, period)
    actuators = Actuators.of(Thrusters(np.eye(3)), limit, torques=3)
    loop = SampledLoop(model.with_effectors((actuators,)), law, substeps=1)
    samples = round(seconds / period)
    return simulate(loop, start, np.arange(0, samples + 1, 10) * period)


def at_rest(axis, angle):
    axis = np.asarray(axis) / np.linalg.norm(axis)
    quaternion = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])
    attitude = Quaternion(quaternion)
    return PlantState(attitude, ExactOrbit(0.0011).frame_rate(attitude))


@pytest.mark.slow
def test_small_errors_are_damped_oscillations_about_any_axis():
    angle = 1e-3
    run = flown(at_rest([1, -2, 0.5], angle))
    damped = FREQUENCY * np.sqrt(1 - DAMPING**2)
    decay = np.exp(-DAMPING * FREQUENCY * run.times)
    wave = np.cos(damped * run.times) + DAMPING * FREQUENCY / damped * np.sin(damped * run.times)
    expected = angle * decay * wave
    axis = np.array([1, -2, 0.5]) / np.linalg.norm([1, -2, 0.5])
    found = 2 * np.asarray(run.signals.quaternion)[:, 1:]
    np.testing.assert_allclose(found, expected[:, None] * axis, atol=3e-3 * angle)


@pytest.mark.slow
def test_a_slew_keeps_to_its_rate_and_settles_under_limited_torque():
    run = flown(at_rest([0.3, 1, -1], 2.5), max_rate=0.05, limit=0.2, period=0.1, seconds=200)
    rates = np.linalg.norm(np.asarray(run.signals.relative_rate), axis=1)
    assert 0.04 < rates.max() < 0.051
    assert run.assessment.settled_from < 120
    assert np.abs(np.asarray(run.signals.quaternion)[-1, 1:]).max() < 1e-3


@pytest.mark.parametrize("name", ["natural_frequency", "damping", "max_rate", "period"])
def test_numbers_must_be_positive(name):
    model = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0011))
    numbers = {"natural_frequency": 0.2, "damping": 1.0, "max_rate": 1.0, "period": 0.1}
    with pytest.raises(ValueError, match=name):
        QuaternionFeedback(model, **{**numbers, name: 0.0})
