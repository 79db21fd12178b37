"""What is between a sampled controller and the plant: noise, delay, misalignment."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float
from scipy.spatial.transform import Rotation

from helpers.switching import CASE, start, switching_loop
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import WZ, Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.noise import key_of_seed, sample_noise
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.sensors import Sensors, turned_slightly
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters

INERTIA = (2.0, 3.0, 4.0)


class Memory(NamedTuple):
    heard: Float[Array, "3"]


class Damper(AbstractSampledController):
    """u1 = -gain ω1 from what is measured, which it remembers."""

    period: Float[Array, ""] = eqx.field(converter=as_float)
    gain: Float[Array, ""] = eqx.field(converter=as_float)

    def init(self, state):
        return Memory(state.omega)

    def step(self, t, state, memory):
        command = jnp.stack([-self.gain * state.omega[0], jnp.zeros(())])
        return command, Memory(state.omega)

    def rate_error(self, state, memory):
        return state.omega[:2]

    def mode(self, memory):
        return jnp.array(0)


def damped(**options):
    plant = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0))
    thrusters = Actuators.of(Thrusters(jnp.eye(3)).without([3]))
    return SampledLoop(plant.with_effectors((thrusters,)), Damper(0.5, 0.7), substeps=2, **options)


SPIN = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), [0.3, 0.0, 0.0])
TIMES = np.arange(21) * 0.5


@pytest.mark.slow
@pytest.mark.parametrize("delay", [None, 0.0, 0.2, 0.35, 0.5])
def test_delayed_rate_damping_has_its_exact_solution(delay):
    """J1 ω1(k+1) = J1 ω1(k) - gain (d ω1(k-1) + (T - d) ω1(k)) with no torque before the start."""
    run = simulate(damped(delay=delay), SPIN, TIMES).signals
    wait, rates, before = delay or 0.0, [0.3], 0.0
    for _ in range(20):
        impulse = 0.7 * (wait * before + (0.5 - wait) * rates[-1])
        before = rates[-1]
        rates.append(before - impulse / INERTIA[0])
    np.testing.assert_allclose(run.omega[:, 0], rates, rtol=1e-12)
    late = 1 if wait else 0
    torque = np.concatenate([np.zeros(late), -0.7 * np.array(rates)])[:21]
    np.testing.assert_allclose(run.torque[:, 0], torque, atol=1e-12)


@pytest.mark.parametrize("delay", [-0.1, 0.51])
def test_an_impossible_delay_is_refused(delay):
    with pytest.raises(ValueError, match="`delay` must"):
        damped(delay=delay)


@pytest.mark.slow
def test_the_controller_hears_the_noise_and_the_signals_tell_the_truth():
    key = key_of_seed(3)
    run = simulate(damped(sensors=Sensors(0.01, 0.0, key)), SPIN, TIMES)
    rates = [0.3]
    for number in range(20):
        heard = rates[-1] + 0.01 * float(sample_noise(key, jnp.array(number), 6)[0])
        rates.append(rates[-1] - 0.5 * 0.7 * heard / INERTIA[0])
    np.testing.assert_allclose(run.signals.omega[:, 0], rates, rtol=1e-12)
    assert not np.allclose(run.final.memory.heard, run.final.plant.omega, atol=1e-5)


def test_other_keys_give_other_noise_and_nothing_retraces():
    traced = []

    @jax.jit
    def measure(sensors, number):
        traced.append(1)
        return sensors(number, SPIN.attitude, SPIN.omega)[1]

    found = [
        measure(Sensors(0.1, 0.1, key_of_seed(seed)), jnp.array(number))
        for seed in (0, 1)
        for number in (0, 1)
    ]
    assert len({tuple(map(float, value)) for value in found}) == 4
    assert len(traced) == 1


@pytest.mark.parametrize("kind", ["as_quaternion", "as_wz", "as_dcm"])
def test_attitude_noise_is_a_small_rotation_of_the_body(kind):
    """Against SciPy: C' = exp(-skew(rotation)) C."""
    rng = np.random.default_rng(0)
    for _ in range(5):
        q = rng.normal(size=4)
        attitude = getattr(Quaternion(q / np.linalg.norm(q)), kind)()
        rotation = 1e-3 * rng.normal(size=3)
        expected = Rotation.from_rotvec(-rotation).as_matrix() @ attitude.as_dcm().matrix
        found = turned_slightly(attitude, jnp.array(rotation))
        assert type(found) is type(attitude)
        np.testing.assert_allclose(found.as_dcm().matrix, expected, atol=1e-9)


def test_a_measured_turn_stays_near_the_true_one():
    """z is not wrapped: 2π more than its principal value is kept."""
    for z in (3.2, 12.0, -9.5):
        found = turned_slightly(WZ([0.3, -0.2], z), jnp.array([1e-4, -1e-4, 2e-4]))
        assert abs(float(found.z) - z) < 1e-3


@pytest.mark.slow
def test_noise_drawn_together_is_that_of_one_sample_after_the_other():
    """For several bodies at once, from any sample on, and what the sensors make of it."""
    keys = jnp.stack([key_of_seed(seed) for seed in range(3)])

    @jax.jit
    @jax.vmap
    def together(key):
        return Sensors(0.1, 0.2, key).drawn(jnp.array(37), 16, float)

    drawn = together(keys)
    assert drawn.noise.shape == (3, 16, 6)
    for body, key in enumerate(keys):
        sensors, told = Sensors(0.1, 0.2, key), jax.tree.map(lambda x, b=body: x[b], drawn)
        for number in (37, 44, 52):
            expected = sample_noise(key, jnp.array(number), 6)
            np.testing.assert_allclose(told.noise[number - 37], expected, rtol=1e-13)
            pairs = [s(jnp.array(number), SPIN.attitude, SPIN.omega) for s in (told, sensors)]
            for x, y in zip(*map(jax.tree.leaves, pairs), strict=True):
                np.testing.assert_allclose(x, y, rtol=1e-13)


@pytest.mark.slow
def test_sensor_noise_has_the_deviations_asked_for():
    sensors = Sensors(1e-3, 2e-3, key_of_seed(5))
    attitude = Quaternion([0.5, 0.5, -0.5, 0.5])

    def errors(number):
        measured, omega = sensors(number, attitude, SPIN.omega)
        turn = measured.as_dcm().matrix @ attitude.as_dcm().matrix.T
        return jnp.stack([turn[1, 2], turn[2, 0], turn[0, 1]]), omega - SPIN.omega

    turns, rates = jax.vmap(errors)(jnp.arange(4000))
    np.testing.assert_allclose(rates.std(axis=0), 1e-3, rtol=0.06)
    np.testing.assert_allclose(turns.std(axis=0), 2e-3, rtol=0.06)
    np.testing.assert_allclose(rates.mean(axis=0), 0, atol=6e-5)


def test_misaligned_thrusters_make_a_torque_that_allocation_does_not_know():
    ideal = Actuators.of(Thrusters([[1.0, 0.6], [0.0, 0.8], [0.0, 0.0]]), 5.0)
    angles, gains = jnp.array([[0.01, -0.02], [0.03, 0.0]]), jnp.array([0.1, -0.05])
    real = ideal.misaligned(angles).stronger(gains)
    np.testing.assert_array_equal(real.thrust_map, ideal.thrust_map)
    for j in range(2):
        axis, true = ideal.torque_axes[:, j], real.torque_axes[:, j]
        np.testing.assert_allclose(jnp.linalg.norm(true), 1 + gains[j], rtol=1e-12)
        turned = np.arccos(float(axis @ true / jnp.linalg.norm(true)))
        assert np.isclose(turned, np.linalg.norm(angles[j]), rtol=1e-3)
    parasitic = real(jnp.array([1.0, 2.0])) - ideal(jnp.array([1.0, 2.0]))
    assert abs(float(parasitic[2])) > 1e-3
    same = ideal.misaligned(jnp.zeros((2, 2)))
    np.testing.assert_allclose(same.torque_axes, ideal.torque_axes, rtol=1e-15)


@pytest.mark.slow
def test_a_noisy_delayed_misaligned_loop_is_the_plain_one_when_all_errors_are_zero():
    plain = switching_loop(CASE)
    full = SampledLoop(
        plain.plant.with_effectors((plain.plant.effectors[0].misaligned(jnp.zeros((2, 2))),)),
        plain.controller,
        sensors=Sensors(0.0, 0.0, key_of_seed(1)),
        delay=0.0,
    )
    runs = [simulate(loop, start(), np.arange(51) * 0.1).signals for loop in (plain, full)]
    np.testing.assert_allclose(runs[0].omega, runs[1].omega, atol=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_a_sampled_loop_is_differentiated_in_either_mode(mode):
    """By the gain of ω1 ← (1 - gain h / J1) ω1, with the solver that is taken by default."""

    def last(gain):
        loop = eqx.tree_at(lambda loop: loop.controller.gain, damped(), gain)
        return simulate(loop, SPIN, TIMES[:5]).signals.omega[-1, 0]

    factor = 1 - 0.7 * 0.5 / 2.0
    expected = 0.3 * 4 * factor**3 * (-0.5 / 2.0)
    np.testing.assert_allclose(mode(last)(jnp.array(0.7)), expected, rtol=1e-9)
