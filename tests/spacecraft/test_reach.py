"""What effectors say that they can do is what they do: torque = columns @ use within the limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.failures import FailureKind
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField
from jaxsat.spacecraft.failures import FailureEvents
from jaxsat.spacecraft.magnetorquers import MagnetorquerFailures, Magnetorquers
from jaxsat.spacecraft.wheel_failures import WheelFailures
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels

AXES = np.array([[1.0, 0.3, 0.0], [0.0, 1.0, 0.4], [0.2, 0.0, 1.0]])
ZERO = jnp.zeros(())
NONE = jnp.zeros(0, bool)
FIELD = DipoleField(CircularOrbit(1.1e-3, 1.2, 0.3, 0.4, 2.0))
PLANT = PlantState(Quaternion([0.8, 0.6, 0.0, 0.0]), np.array([0.01, 0.02, -0.01]))


@pytest.mark.parametrize(
    ("made", "state"),
    [
        (Wheels(AXES, [0.1, 0.2, 0.3]), WheelMomenta([0.3, 0.0, -0.2])),
        (Magnetorquers(AXES, [1.0, 2.0, 3.0], FIELD), None),
    ],
)
def test_columns_are_the_torques_of_commands_and_limits_are_theirs(made, state):
    reach = made.reach(ZERO, PLANT, state, NONE, ZERO)

    def torque(command):
        return made.effect(made.piece(made.mode(state), command), ZERO, PLANT, state).torque

    np.testing.assert_allclose(jax.jacobian(torque)(reach.high / 2), reach.columns, atol=1e-18)
    for bound, beyond in ((reach.high, 2.0), (reach.low, 3.0)):
        np.testing.assert_allclose(torque(beyond * bound), reach.columns @ bound, rtol=1e-14)


def test_rods_reach_the_plane_across_the_field():
    rods = Magnetorquers(AXES, 1.0, FIELD)
    columns = rods.reach(ZERO, PLANT, None, NONE, ZERO).columns
    field = FIELD.in_body(ZERO, PLANT.attitude)
    np.testing.assert_allclose(field @ columns, np.zeros(3), atol=1e-20)
    assert np.linalg.matrix_rank(columns) == 2


def test_a_wheel_near_its_limit_can_do_less_the_longer_it_lasts():
    """h - c span stays within ±L for each torque c on the body."""
    wheels, state = Wheels(np.eye(3), 0.5, [1.0, 1.0, 1.0]), WheelMomenta([0.9, -0.9, 1.0])
    reach = wheels.reach(ZERO, PLANT, state, NONE, jnp.array(2.0))
    np.testing.assert_allclose(reach.low, [-0.05, -0.5, 0.0])
    np.testing.assert_allclose(reach.high, [0.5, 0.05, 0.5])
    now = wheels.reach(ZERO, PLANT, state, NONE, ZERO)
    np.testing.assert_allclose(now.low, [-0.5, -0.5, 0.0])


def test_failures_take_what_they_should_from_the_reach():
    kinds = WheelFailureKind
    events = WheelFailures(
        [0, 1, 2], [1.0] * 3, [kinds.DEAD, kinds.FRICTION_TO, kinds.RUNAWAY], [0, 0.2, 0]
    )
    wheels, state = Wheels(np.eye(3), 0.5, failures=events), WheelMomenta([0.1, 0.1, 0.1])
    left = wheels.reach(ZERO, PLANT, state, jnp.array([True] * 3), ZERO)
    np.testing.assert_allclose(left.low, [0.0, -0.3, -0.5])
    np.testing.assert_allclose(left.high, [0.0, 0.3, -0.5])
    kinds = [FailureKind.STUCK_AT, FailureKind.DEGRADED]
    rods = Magnetorquers(
        AXES, 2.0, FIELD, MagnetorquerFailures([0, 2], [1.0, 1.0], kinds, [-0.4, 0.5])
    )
    left = rods.reach(ZERO, PLANT, None, jnp.array([True, True]), ZERO)
    np.testing.assert_allclose(left.low, [-0.8, -2.0, -1.0])
    np.testing.assert_allclose(left.high, [-0.8, 2.0, 1.0])
    struck = FailureEvents([0, 1], [1.0, 1.0], kinds, [0.25, 0.5], np.zeros((2, 3, 3)))
    thrusters = Actuators(AXES, np.eye(3), 2.0, failures=struck)
    left = thrusters.reach(ZERO, PLANT, None, jnp.array([True, True]), ZERO)
    np.testing.assert_allclose(left.low, [0.5, -1.0, -2.0])
    np.testing.assert_allclose(left.high, [0.5, 1.0, 2.0])
