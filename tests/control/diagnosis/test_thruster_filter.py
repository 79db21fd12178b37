"""What thrusters' filter expects of a body that turns with wheels, against SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

from helpers.thruster_layouts import canted
from jaxsat.control.diagnosis.residual import ActuatorCondition, Reading
from jaxsat.control.diagnosis.thruster_filter import (
    ThrusterFilter,
    ThrusterModel,
    samples_of_torque,
)
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.modulation import PulseWidth
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.wheels import Wheels

INERTIA = np.array([[0.05, 0.002, -0.001], [0.002, 0.04, 0.003], [-0.001, 0.003, 0.03]])
AXES = np.array([[1.0, 0.2, 0.1], [0.0, 1.0, 0.3], [0.2, -0.1, 1.0]])
AXES = AXES / np.linalg.norm(AXES, axis=0)
OMEGA, MOMENTUM = np.array([0.03, -0.05, 0.02]), np.array([0.02, -0.03, 0.01])
MOTOR, BY_RODS = np.array([2e-3, -1e-3, 1.5e-3]), np.array([2e-3, 1e-3, -3e-3])


def after(period):
    """Rate and momenta after a period under torques of motors and magnetorquers."""

    def rate(_, y):
        omega, h = y[:3], y[3:]
        total = INERTIA @ omega + AXES @ h
        torque = BY_RODS + AXES @ MOTOR - np.cross(omega, total)
        return np.concatenate([np.linalg.solve(INERTIA, torque), -MOTOR])

    begin = np.concatenate([OMEGA, MOMENTUM])
    found = solve_ivp(rate, (0, period), begin, method="DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
    return found[:3], found[3:]


def test_wheels_and_magnetorquers_are_not_taken_for_thrusters():
    """What is left falls with the cube of the period, as of a rule of the second order."""
    torque, none = canted(force=0.01)[0], np.zeros(8)
    model = ThrusterModel(torque, none, none, none, PulseWidth())
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0))
    watch = ThrusterFilter(body, model, 1e-5, Wheels(AXES, 0.1))

    @jax.jit
    def missed(begin, end, period):
        memory = watch.init(begin)._replace(started=jnp.array(True))
        sound = ActuatorCondition.sound(8)
        return watch.step(end, jnp.zeros(8), sound, period, memory, jnp.array(0.1))[0].innovation

    begin, sizes = Reading(jnp.asarray(OMEGA), jnp.asarray(MOMENTUM)), []
    for period in (0.4, 0.2):
        omega, momentum = map(jnp.asarray, after(period))
        end = Reading(omega, momentum, jnp.asarray(BY_RODS))
        sizes.append(float(np.linalg.norm(missed(begin, end, jnp.array(period)))))
        by_rods = np.linalg.norm(np.linalg.solve(INERTIA, BY_RODS)) * period
        assert sizes[-1] < 1e-2 * by_rods
        silent = missed(begin, end._replace(unwatched=jnp.zeros(3)), jnp.array(period))
        np.testing.assert_allclose(np.linalg.norm(silent), by_rods, rtol=2e-2)
    assert 7 < sizes[0] / sizes[1] < 9


def test_wrong_moments_leave_a_gyroscopic_torque_that_nearly_equal_ones_do_not():
    """What each moment leaves in the rate, by differences of the gyroscopic torque."""
    moments, period, step = np.diag([0.47, 0.46, 0.19]), 0.1, 1e-6
    none = np.zeros(8)
    model = ThrusterModel(canted(force=0.01)[0], none, none, none, PulseWidth())
    watch = ThrusterFilter(RigidBody(Spacecraft(moments), ExactOrbit(0.0)), model, 1e-5)
    reading, sound = Reading(jnp.asarray(OMEGA)), ActuatorCondition.sound(8)
    memory = watch.init(reading)
    found = jax.jit(
        lambda: watch.predicted(reading, jnp.zeros(8), sound, jnp.array(period), memory).squares
    )()
    changes = step * np.einsum("ij,ki->kij", moments, np.eye(3))
    left = [np.linalg.solve(moments, np.cross(OMEGA, one @ OMEGA)) / step for one in changes]
    np.testing.assert_allclose(found, period**2 * np.sum(np.square(left)), rtol=1e-12)


def test_what_each_wrong_number_leaves_is_that_of_differences():
    """Of a plant whose thrusters and moments differ from the model, one by one."""
    torque, none = canted(force=0.01)[0], np.zeros(8)
    model = ThrusterModel(torque, none, none, none, PulseWidth())
    watch = ThrusterFilter(RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0)), model, 1e-5)
    period, step, on_time = 0.1, 1e-6, np.linspace(0.0, 0.07, 8)
    reading, sound = Reading(jnp.asarray(OMEGA)), ActuatorCondition.sound(8)
    memory = watch.init(reading)

    @jax.jit
    def predicted():
        commanded = jnp.asarray(on_time)
        return watch.predicted(reading, commanded, sound, jnp.array(period), memory).errors

    def change(thrust, inertia):
        gyroscopic = np.cross(OMEGA, inertia @ OMEGA)
        return np.linalg.solve(inertia, torque @ (thrust * on_time) - period * gyroscopic)

    numbers = [(1 + step * one, INERTIA) for one in np.eye(8)]
    moments = np.diag(np.diag(INERTIA))
    numbers += [(np.ones(8), INERTIA + step * one * moments) for one in np.eye(3)]
    left = [(change(*one) - change(np.ones(8), INERTIA)) / step for one in numbers]
    found = np.asarray(predicted())[..., 0]
    assert not found[8:10].any()
    np.testing.assert_allclose(np.delete(found, (8, 9), axis=0), left, atol=1e-5 * np.max(left))


def test_a_torque_that_turns_a_body_by_a_degree_is_believed_once_learned():
    """And nothing of half of it; with slow gains and a noisy gyro it takes more samples."""
    torque, none = canted(force=0.01)[0], np.zeros(8)
    model = ThrusterModel(torque, none, none, none, PulseWidth())
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0))
    period, noise, frequency = jnp.array(0.1), 3e-5, 0.03
    samples = samples_of_torque(noise, 0.1, frequency)
    assert samples == samples_of_torque(noise / 4, 0.1, frequency / 2) > 1200
    assert samples_of_torque(noise / 4, 0.1, frequency) == 300
    watch = ThrusterFilter(body, model, noise, None, samples)
    outside = INERTIA @ np.array([0.0, 0.6, -0.8]) * np.radians(1.0) * frequency**2
    for part, share in ((1.0, 1.0), (0.75, 0.5), (0.5, 0.0)):
        condition = ActuatorCondition.sound(8)._replace(
            torque=jnp.asarray(part * outside), samples=jnp.array(samples)
        )
        found = watch.believed(condition, period)
        np.testing.assert_allclose(found, share * part * outside, atol=2e-3 * abs(outside).max())

    def read(carry, rate):
        memory, condition = carry
        residual, memory = watch.step(
            Reading(rate), jnp.zeros(8), condition, period, memory, jnp.array(0.1)
        )
        condition = watch.tracked(residual, condition, period, jnp.array(True))
        return (memory, condition), condition.samples

    still = jnp.zeros((1600, 3))
    start = watch.init(Reading(still[0])), ActuatorCondition.sound(8)
    counts = np.asarray(jax.lax.scan(read, start, still)[1])
    assert 1200 < np.argmax(counts >= samples) < 1.02 * samples
    assert samples <= counts[-1] < samples + 1
