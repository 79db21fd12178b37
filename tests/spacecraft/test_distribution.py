"""Who does what of a law's command: parts of it for each effector, and a loop that flies so."""

import jax.numpy as jnp
import numpy as np
import pytest

from helpers.thruster_layouts import thruster_set
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.distribution import Direct
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.modulation import IdealThrottle
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.wheels import Wheels

Z = np.array([[0.0], [0.0], [1.0]])
INERTIA, FULL, PERIOD = 2.0, 0.1, 0.5
STILL = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), np.zeros(3))
THRUSTERS = PulsedThrusters(thruster_set(FULL * np.hstack([Z, -Z]), 0.0), None, IdealThrottle())
WHEELS = Wheels(Z)


class Both(AbstractSampledController):
    """Commands duties of two thrusters and the torque of a wheel, always the same."""

    period: jnp.ndarray

    def init(self, state):
        return None

    def step(self, t, state, memory):
        return jnp.array([0.5, 0.1, 0.02]), memory


def parts(*numbers):
    return Direct()(jnp.zeros(()), STILL, jnp.asarray(numbers), (THRUSTERS, WHEELS)).uses


def test_a_command_is_cut_in_the_order_of_the_effectors():
    for one, expected in zip(parts(0.5, 0.1, 0.02), ([0.5, 0.1], [0.02]), strict=True):
        np.testing.assert_array_equal(one, expected)
    np.testing.assert_array_equal(parts(0.5, 0.1)[1], [0.0])
    with pytest.raises(ValueError, match="2 numbers for thrusters"):
        parts(0.5)
    with pytest.raises(ValueError, match="no more numbers"):
        parts(0.5, 0.1, 0.02, 1.0)


def test_a_law_commands_thrusters_and_wheels_at_once():
    """About one axis, in closed form: 0.4 of full thrust, and a wheel that takes up momentum."""
    body = RigidBody(Spacecraft([1.0, 1.5, INERTIA]), ExactOrbit(0.0))
    loop = SampledLoop(
        body.with_effectors((THRUSTERS, WHEELS)), Both(jnp.array(PERIOD)), substeps=1
    )
    times = PERIOD * np.arange(5)
    found = simulate(loop, STILL, times)
    torque = 0.4 * FULL + 0.02
    np.testing.assert_allclose(found.signals.omega[:, 2], torque / INERTIA * times, atol=1e-14)
    np.testing.assert_allclose(
        found.signals.parts["wheel_momentum"][:, 0], -0.02 * times, atol=1e-15
    )
    np.testing.assert_allclose(found.signals.torque[:, 2], torque, rtol=1e-14)
    np.testing.assert_allclose(found.signals.parts["thrust_level"], [[0.5, 0.1]] * 5, rtol=1e-14)
