"""Diagnosis of wheels on prescribed commands: kinds, false alarms, friction, a wheel at rest."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.control.diagnosis.diagnosis import Diagnosis, average_run_length
from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.control.diagnosis.residual import RESTLESSNESS, ActuatorCondition, Reading
from jaxsat.control.diagnosis.wheel_filter import WheelFilter, moved
from jaxsat.spacecraft.wheels import Wheels

PERIOD, NOISE, FULL, COULOMB = 0.1, 2e-3, 0.4, 0.01
COUNT = 4
UNCERTAINTY = jnp.array(0.1)


def watching(noise=NOISE):
    wheels = Wheels(np.eye(3)[:, [0, 1, 2, 0]], FULL, 20.0, coulomb_friction=COULOMB)
    return WheelFilter(wheels, np.full(COUNT, noise))


def read(momentum):
    """Momenta (N m s) as the tachometers of a body at rest tell them."""
    return Reading(jnp.zeros(3), momentum)


def rotors(command, begin, wheel, kind, amount, start=0.5):
    """Momenta of wheels (samples + 1, wheels) at the samples: dh/dt = -(motor + friction), by the
    explicit rule in fine steps, a rotor at rest held by Coulomb friction."""
    steps = 50
    momentum = np.full(COUNT, start)
    found = [momentum.copy()]
    for sample, one in enumerate(command):
        motor, friction = one.copy(), np.full(COUNT, COULOMB)
        if sample >= begin:
            if kind == DiagnosedKind.DEAD or kind == DiagnosedKind.STOPPED:
                motor[wheel] = 0.0
            if kind == DiagnosedKind.DEGRADED:
                motor[wheel] *= 1 - amount
            if kind == DiagnosedKind.FRICTION_UP:
                friction[wheel] += amount * FULL
            if kind == DiagnosedKind.RUNAWAY:
                motor[wheel] = -FULL * np.sign(momentum[wheel])
            if kind == DiagnosedKind.STOPPED:
                momentum[wheel] = 0.0
        for _ in range(steps):
            step = PERIOD / steps
            driven = momentum - step * motor
            slowed = np.maximum(np.abs(driven) - step * friction, 0.0)
            momentum = np.clip(np.sign(driven) * slowed, -20.0, 20.0)
            if sample >= begin and kind == DiagnosedKind.STOPPED:
                momentum[wheel] = 0.0
        found.append(momentum.copy())
    return np.array(found)


def followed(watch, command, momentum, noise):
    """Stage, verdicts and kinds at each sample."""
    diagnosis = Diagnosis()

    def sample(memory, now):
        commanded, told = now
        memory = diagnosis.step(watch, read(told), PERIOD * commanded, jnp.array(PERIOD), memory)
        return memory, (memory.stage, memory.condition, memory.kind)

    told = momentum + watch.momentum_noise[0] * noise
    start = diagnosis.init(watch, read(jnp.asarray(told[0])))
    before = jnp.concatenate([jnp.zeros((1, COUNT)), command])
    return jax.lax.scan(sample, start, (before, told))[1]


CASES = (
    (DiagnosedKind.DEAD, 0.0),
    (DiagnosedKind.DEGRADED, 0.5),
    (DiagnosedKind.STOPPED, 0.0),
    (DiagnosedKind.FRICTION_UP, 0.2),
    (DiagnosedKind.RUNAWAY, 0.0),
)


@pytest.fixture(scope="module")
def follow():
    return jax.jit(lambda command, momentum, noise: followed(watching(), command, momentum, noise))


def test_every_wheel_and_kind_is_isolated(follow):
    rng = np.random.default_rng(18)
    samples, begin = 120, 30
    command = 0.06 * rng.standard_normal((samples, COUNT))
    for wheel in range(COUNT):
        for kind, amount in CASES:
            momentum = rotors(command, begin, wheel, kind, amount)
            noise = rng.standard_normal(momentum.shape)
            stage, condition, kinds = follow(command, momentum, noise)
            kinds = np.asarray(kinds)
            assert not np.asarray(stage)[: begin + 1].any()
            others = np.delete(kinds, wheel, axis=1)
            assert np.all(others < 0), (wheel, kind)
            assert kinds[-1, wheel] == kind, (wheel, kind, kinds[:, wheel])
            in_service = kind in (DiagnosedKind.DEGRADED, DiagnosedKind.FRICTION_UP)
            assert bool(condition.failed[-1, wheel]) != in_service
            if kind == DiagnosedKind.DEGRADED:
                assert float(condition.part[-1, wheel]) == pytest.approx(0.5, abs=0.1)
            if kind == DiagnosedKind.FRICTION_UP:
                assert float(condition.flow[-1, wheel]) == pytest.approx(0.2, abs=0.03)


def test_a_wheel_in_service_is_diagnosed_further(follow):
    """More friction first, then the motor dies."""
    rng = np.random.default_rng(19)
    samples, first, second = 200, 30, 110
    command = 0.06 * rng.standard_normal((samples, COUNT))
    momentum = rotors(command, first, 1, DiagnosedKind.FRICTION_UP, 0.1, start=5.0)
    coasting = momentum[second, 1] - PERIOD * (COULOMB + 0.1 * FULL) * np.arange(
        samples + 1 - second
    )
    momentum[second:, 1] = np.maximum(coasting, 0.0)
    noise = rng.standard_normal(momentum.shape)
    _, condition, kinds = follow(command, momentum, noise)
    assert int(kinds[second, 1]) == DiagnosedKind.FRICTION_UP
    assert not bool(condition.failed[second, 1])
    assert int(kinds[-1, 1]) == DiagnosedKind.DEAD
    assert condition.failed[-1].tolist() == [False, True, False, False]


def test_a_wheel_that_friction_holds_at_rest_raises_no_alarm(follow):
    """Commands below Coulomb friction, and momenta that come to zero and cross it."""
    rng = np.random.default_rng(20)
    samples = 2000
    time = PERIOD * np.arange(samples)
    command = np.stack([
        np.full(samples, 0.8 * COULOMB),
        np.full(samples, -0.95 * COULOMB),
        0.05 * np.sin(0.2 * time),
        0.9 * COULOMB * np.sin(0.5 * time),
    ], axis=1)  # fmt: skip
    momentum = rotors(command, samples, 0, DiagnosedKind.DEAD, 0.0, start=0.0)
    assert np.all(momentum[:, [0, 1, 3]] == 0)
    assert np.ptp(momentum[:, 2]) > 0.1
    stage, condition, kinds = follow(command, momentum, rng.standard_normal(momentum.shape))
    assert not np.asarray(stage).any()
    assert np.all(np.asarray(kinds) < 0)
    assert not np.asarray(condition.failed).any()


def test_a_dead_wheel_that_works_again_is_used_again(follow):
    rng = np.random.default_rng(21)
    samples, begin, end = 160, 30, 90
    command = 0.06 * rng.standard_normal((samples, COUNT))
    momentum = rotors(command, begin, 2, DiagnosedKind.DEAD, 0.0)
    later = rotors(command, samples, 2, DiagnosedKind.DEAD, 0.0)
    momentum[end:, 2] = momentum[end, 2] + later[end:, 2] - later[end, 2]
    _, condition, kinds = follow(command, momentum, rng.standard_normal(momentum.shape))
    failed = np.asarray(condition.failed)
    assert failed[end].tolist() == [False, False, True, False]
    assert not failed[-1].any()
    assert np.all(np.asarray(kinds)[-1] == -1)


def test_a_stopped_wheel_that_works_again_in_part_is_used_again(follow):
    """A part of 0.3 by few pulses, against an independent integration of the rotor."""
    rng = np.random.default_rng(22)
    samples, begin, end = 200, 30, 90
    command = 0.06 * rng.standard_normal((samples, COUNT))
    command[end:, 1] = 0.0
    command[end + 5 :: 20, 1], command[end + 15 :: 20, 1] = FULL, -FULL
    momentum = rotors(command, begin, 1, DiagnosedKind.STOPPED, 0.0)
    later = rotors(command[end:], 0, 1, DiagnosedKind.DEGRADED, 0.7, start=0.0)
    momentum[end:, 1] = later[:, 1]
    _, condition, kinds = follow(command, momentum, rng.standard_normal(momentum.shape))
    assert int(kinds[end, 1]) == DiagnosedKind.STOPPED
    assert bool(condition.failed[end, 1])
    assert not np.asarray(condition.failed)[-1].any()
    assert int(kinds[-1, 1]) == DiagnosedKind.DEGRADED
    assert float(condition.part[-1, 1]) == pytest.approx(0.3, abs=0.1)


def test_what_a_turning_body_does_to_rotors_is_no_failure():
    """Wheels that nothing drives, by hand: h + J_w a·ω stays, whatever the rate."""
    inertia = np.array([0.2, 0.1, 0.3, 0.2])
    axes = np.eye(3)[:, [0, 1, 2, 0]]
    watch = WheelFilter(Wheels(axes, FULL, rotor_inertia=inertia), np.full(COUNT, NOISE))
    times = PERIOD * np.arange(40)
    rates = np.stack([0.5 * np.sin(times), 0.3 * times, 0.4 * np.cos(2 * times)], axis=1)
    momenta = 3.0 - inertia * (rates @ axes)
    assert np.abs(np.diff(momenta, axis=0)).max() > 5 * NOISE
    condition = ActuatorCondition.sound(COUNT)
    memory = watch.init(Reading(jnp.asarray(rates[0]), jnp.asarray(momenta[0])))
    step = jax.jit(lambda *given: watch.step(*given))
    for momentum, rate in zip(momenta, rates, strict=True):
        reading = Reading(jnp.asarray(rate), jnp.asarray(momentum))
        residual, memory = step(
            reading, jnp.zeros(COUNT), condition, jnp.array(PERIOD), memory, UNCERTAINTY
        )
        np.testing.assert_allclose(residual.innovation, 0, atol=1e-14)


def test_a_wheel_moves_through_rest_as_fine_steps_say():
    """Toward rest and beyond, held at it, left by a motor or by friction alone."""
    rng = np.random.default_rng(22)
    before, motor = rng.uniform(-1, 1, (2, 400))
    before[::10] = 0.0
    friction = rng.uniform(0, 1, 400)
    momentum, way, steps = before.copy(), np.zeros(400), 4000
    for _ in range(steps):
        driven = momentum - motor / steps
        slowed = np.maximum(np.abs(driven) - friction / steps, 0.0)
        way += np.sign(driven) * np.where(slowed > 0, 1, 0) / steps
        momentum = np.sign(driven) * slowed
    after, mean_way = moved(*(jnp.asarray(one) for one in (before, motor, friction)))
    rests = np.asarray(after) == 0
    assert 20 < rests.sum() < 300
    assert np.sum(before * momentum < 0) > 20
    np.testing.assert_allclose(after, momentum, atol=2 / steps)
    np.testing.assert_allclose(mean_way, way, atol=3 / steps)
    error = 0.01 * rng.standard_normal(400)
    nearby, _ = moved(jnp.asarray(before + error), jnp.asarray(motor), jnp.asarray(friction))
    assert np.all(np.abs(nearby - after) <= np.abs(error) + 1e-15)


def test_exact_tachometers_blame_no_working_wheel():
    """Test pulses about rest, of which friction is much more than the noise.

    The part that the weak motor makes is found, better than the verdict says.
    """
    rng = np.random.default_rng(23)
    noise, samples, begin, amount = 0.1 * PERIOD * COULOMB, 400, 60, 0.4
    pulses = np.where(np.arange(samples) % 2, 1, -1)[:, None]
    command = pulses * np.array([0.05, 0.2, 0.08, 0.04])
    command += 0.005 * rng.standard_normal((samples, COUNT))
    momentum = rotors(command, begin, 1, DiagnosedKind.DEGRADED, amount, start=0.0)
    told = rng.standard_normal(momentum.shape)
    watch = watching(noise)
    _, condition, kinds = jax.jit(lambda: followed(watch, command, momentum, told))()
    assert np.asarray(kinds)[-1].tolist() == [-1, DiagnosedKind.DEGRADED, -1, -1]
    assert np.all(np.asarray(kinds)[:, [0, 2, 3]] == -1)
    assert float(condition.part[-1, 1]) == pytest.approx(1 - amount, abs=0.03)


@pytest.mark.slow
def test_false_alarms_come_as_seldom_as_the_closed_form_says():
    """Of the tests of friction, on wheels whose momenta are disturbed as the filter allows for."""
    threshold, samples, runs = 3.0, 400, 400
    wheels = Wheels(np.eye(3)[:, [0, 1, 2, 0]], FULL)
    watch = WheelFilter(wheels, np.full(COUNT, NOISE))
    condition = ActuatorCondition.sound(COUNT)
    none = jnp.zeros(COUNT)

    def sample(carry, draws):
        (momentum, memory, statistic), (error, impulse) = carry, draws
        momentum = momentum + np.sqrt(RESTLESSNESS) * NOISE * impulse
        residual, memory = watch.step(
            read(momentum + NOISE * error), none, condition, jnp.array(PERIOD), memory, UNCERTAINTY
        )
        score = jnp.sign(residual.flow[0]) * residual.innovation[0]
        statistic = jnp.maximum(0.0, statistic + score / jnp.sqrt(residual.variance) - 1.0)
        return (momentum, memory, statistic), statistic > threshold

    def run(key):
        start = (none + 5.0, watch.init(read(none + 5.0)), none)
        draws = jax.random.normal(key, (samples + 1, 2, COUNT))
        alarm = jax.lax.scan(sample, start, draws)[1][1:]
        return jnp.any(alarm, axis=0)

    alarms = np.asarray(jax.jit(jax.vmap(run))(jax.random.split(jax.random.key(7), runs)))
    expected = 1 - np.exp(-samples / average_run_length(1.0, threshold))
    spread = np.sqrt(expected * (1 - expected) / alarms.size)
    assert alarms.mean() == pytest.approx(expected, abs=3 * spread + 0.06 * expected)
