"""Motor torques that make up for friction, against the sum of what motor and friction do."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxsat.spacecraft.wheel_friction import SLIGHT, WheelFriction
from jaxsat.spacecraft.wheels import Wheels

COULOMB, VISCOUS, INERTIA, PERIOD = 0.002, 5e-4, 0.01, 0.1


def known(noise: float = 0.0, works: tuple[bool, ...] = (True, True, True)) -> WheelFriction:
    wheels = Wheels(np.eye(3), None, None, INERTIA, VISCOUS, COULOMB)
    friction = WheelFriction.of(wheels, np.array(works), np.full(3, noise), PERIOD)
    assert friction is not None
    return friction


def test_a_wheel_that_turns_does_to_the_body_what_is_asked():
    """c + b h/J_w + τ sign h of SPACECRAFT's gyrostat, the sum that the plant integrates."""
    momentum, torque = np.array([0.5, -0.2, 0.001]), np.array([0.01, 0.02, -0.03])
    motor = known().motor_torque(jnp.array(torque), jnp.array(momentum))
    made = motor + VISCOUS * momentum / INERTIA + COULOMB * np.sign(momentum)
    np.testing.assert_allclose(made, torque, rtol=1e-14)


def test_a_wheel_at_rest_breaks_away_for_all_but_slight_torques():
    """Of one that sticks, friction takes back up to its size, against the motor."""
    torque = np.array([0.001, -3e-4, SLIGHT * COULOMB / 2])
    motor = np.asarray(known().motor_torque(jnp.array(torque), jnp.zeros(3)))
    made = np.sign(motor) * np.maximum(np.abs(motor) - COULOMB, 0.0)
    np.testing.assert_allclose(made[:2], torque[:2], rtol=1e-12)
    assert made[2] == 0


def test_between_rest_and_turning_the_motor_torque_is_continuous():
    friction = known(noise=1e-3)
    momenta = np.linspace(-0.01, 0.01, 4001)
    each = jnp.broadcast_to(jnp.array(momenta)[:, None], (4001, 3))
    motor = jax.vmap(lambda one: friction.motor_torque(jnp.full(3, 0.001), one))(each)
    assert np.abs(np.diff(motor, axis=0)).max() < 0.01 * COULOMB


def test_a_failed_motor_is_asked_for_nothing_and_no_friction_is_nothing():
    motor = known(works=(True, False, True)).motor_torque(jnp.zeros(3), jnp.full(3, 0.3))
    assert motor[1] == 0
    assert motor[0] < 0
    assert WheelFriction.of(Wheels(np.eye(3)), np.ones(3, bool), np.zeros(3), PERIOD) is None


@pytest.mark.parametrize("start", [0.02, -0.02, 0.0])
def test_a_slowing_wheel_passes_rest_as_one_without_friction(start):
    """SciPy integrates h' = -u with the motor's torque held over each period."""
    friction, momentum, ideal, torque = known(), start, start, 0.004
    for _ in range(150):
        motor = friction.motor_torque(jnp.full(3, torque), jnp.full(3, momentum))[0].item()

        def rate(_, h, motor=motor):
            drag = VISCOUS * h / INERTIA + COULOMB * np.tanh(h / 1e-9)
            return -(motor + drag)

        solution = solve_ivp(rate, (0, PERIOD), [momentum], method="Radau", rtol=1e-9, atol=1e-13)
        momentum = solution.y[0, -1]
        ideal -= PERIOD * torque
    assert abs(momentum - ideal) < 2 * PERIOD * COULOMB
