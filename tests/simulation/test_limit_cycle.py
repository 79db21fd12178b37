"""The rate limit cycle of a minimum pulse (Wie, Space Vehicle Dynamics and Control, 9.4)."""

import numpy as np
import pytest

from helpers.thruster_layouts import allocated, pairs, thruster_set
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.core.attitude import Quaternion
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.modulation import PulseWidth
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.spacecraft import Spacecraft

TORQUE, INERTIA, MIN_ON, PERIOD = 0.05, 0.3, 0.02, 0.1
FREQUENCY, DAMPING = 1.0, 0.7


@pytest.mark.slow
@pytest.mark.parametrize("rate", [1.2e-3, 0.5e-3])
def test_a_pulse_at_each_end_of_the_dead_band_makes_the_rate_of_the_formula(rate):
    """Half the range of the rate is T t_min / 2J, wherever it lies, and the attitude drifts between
    the angles at which the command asks for t_min.

    A pulse is as wide as the command of its sample, which is beyond t_min by what the attitude has
    drifted in a period, under 1 %.
    """
    torque = pairs((TORQUE,) * 3)
    model = RigidBody(Spacecraft([INERTIA, 0.55, 0.62]), ExactOrbit(0.0))
    actuators = PulsedThrusters(thruster_set(torque, MIN_ON), allocated(torque), PulseWidth())
    law = QuaternionFeedback(model, FREQUENCY, DAMPING, 0.5, PERIOD)
    loop = SampledLoop(model.with_effectors((actuators,)), law, substeps=1)
    start = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), [rate, 0.0, 0.0])
    found = simulate(loop, start, np.arange(3001) * PERIOD)
    omega = np.asarray(found.signals.omega)
    half = np.ptp(omega[:, 0]) / 2
    formula = TORQUE * MIN_ON / (2 * INERTIA)
    assert formula * (1 - 1e-9) <= half < 1.01 * formula
    np.testing.assert_allclose(omega[:, 1:], 0.0, atol=1e-15)
    openings = np.asarray(found.signals.parts["valve_openings"])
    assert np.abs(openings[-1, 0] - openings[-1, 1]) <= 1  # by turns
    assert openings[-1, :2].sum() >= 4
    angle = 2 * np.asarray(found.signals.quaternion)[:, 1]
    edge = TORQUE * MIN_ON / PERIOD / (INERTIA * FREQUENCY**2)
    rates = np.array([omega[:, 0].min(), -omega[:, 0].max()])
    reach = edge + 2 * DAMPING / FREQUENCY * rates  # of a law that leads by its damping
    np.testing.assert_allclose([-angle.min(), angle.max()], reach, rtol=0.02)
