"""Detection and isolation on prescribed commands: kinds, false alarms, delays."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import nnls

from helpers.thruster_layouts import canted
from jaxsat.control.diagnosis.diagnosis import Diagnosis, average_run_length
from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.control.diagnosis.residual import RESTLESSNESS, Reading
from jaxsat.control.diagnosis.thruster_filter import ThrusterFilter, ThrusterModel
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.environment.orbit import SmallAngleOrbit
from jaxsat.spacecraft.modulation import DeltaSigma
from jaxsat.spacecraft.spacecraft import Spacecraft

MOMENTS = np.array([0.30, 0.55, 0.62])
PERIOD, NOISE, SHORTEST = 0.2, 3e-5, 0.02
TORQUE = canted()[0]
COUNT = TORQUE.shape[1]


def watching(noise=NOISE):
    model = RigidBody(Spacecraft(MOMENTS), SmallAngleOrbit(0.0))
    late = np.zeros(COUNT)
    thrusters = ThrusterModel(TORQUE, np.full(COUNT, SHORTEST), late, late, DeltaSigma())
    return ThrusterFilter(model, thrusters, noise)


def commanded(rng, samples, rate=0.2):
    """On-times (s): now and then some whole pulses of each thruster."""
    return (rng.random((samples, COUNT)) < rate) * SHORTEST * rng.integers(1, 4, (samples, COUNT))


def followed(watch, on_time, made, noise, outside=None):
    """Verdicts where thrusters really made `made` (s of full thrust) of what was commanded.

    Besides, torques act from `outside` (N m), and what is believed of them is told.
    """
    body, diagnosis = watch.model, Diagnosis()

    def sample(carry, now):
        omega, memory = carry
        commanded, real, error, beside = now
        omega = omega + body.spacecraft.inverse_inertia @ (
            jnp.asarray(TORQUE) @ real + PERIOD * (beside - jnp.cross(omega, MOMENTS * omega))
        )
        memory = diagnosis.step(
            watch, Reading(omega + NOISE * error), commanded, jnp.array(PERIOD), memory
        )
        condition = memory.condition
        believed = watch.believed(condition, jnp.array(PERIOD))
        seen = (memory.stage, condition.failed, memory.kind, condition.flow, believed)
        return (omega, memory), seen

    start = (jnp.zeros(3), diagnosis.init(watch, Reading(jnp.zeros(3))))
    outside = jnp.zeros_like(noise) if outside is None else outside
    return jax.lax.scan(sample, start, (on_time, made, noise, outside))[1]


PARTS = {  # missing of what is commanded, and made all the time, both of full thrust
    DiagnosedKind.DEAD: (1.0, 0.0),
    DiagnosedKind.DEGRADED: (0.5, 0.0),
    DiagnosedKind.STUCK_ON: (1.0, 1.0),
    DiagnosedKind.STUCK_AT: (1.0, 0.3),
    DiagnosedKind.LEAKING: (0.15, 0.15),
    DiagnosedKind.REVERSED: (2.0, 0.0),
}


@pytest.mark.slow
def test_every_thruster_and_kind_is_isolated():
    rng = np.random.default_rng(18)
    samples, begin = 160, 40
    on_time = commanded(rng, samples)
    cases = [(thruster, kind) for thruster in range(COUNT) for kind in PARTS]
    made = np.repeat(on_time[None], len(cases), axis=0)
    for case, (thruster, kind) in zip(made, cases, strict=True):
        missing, always = PARTS[kind]
        after = (1 - missing) * on_time[begin:, thruster] + always * PERIOD
        case[begin:, thruster] = after
    noise = rng.standard_normal((len(cases), samples, 3))
    each = jax.jit(jax.vmap(lambda real, error: followed(watching(), on_time, real, error)))
    stage, failed, kinds, flow, _ = map(np.asarray, each(made, noise))
    assert not failed[:, :begin].any()
    assert not stage[:, :begin].any()
    right = 0
    for row, (thruster, kind) in enumerate(cases):
        first = np.argmax(failed[row].any(axis=1))
        assert failed[row, first].tolist() == [k == thruster for k in range(COUNT)], (row, kind)
        assert first > begin
        right += kinds[row, first, thruster] == kind
        assert flow[row, first, thruster] == pytest.approx(PARTS[kind][1], abs=0.1)
    assert right >= 0.9 * len(cases)


@pytest.mark.slow
def test_a_thruster_that_returns_is_used_again_twice_and_no_more():
    """Dead in every other stretch of 100 samples; at last it is not commanded any more."""
    rng = np.random.default_rng(20)
    stretch, stretches = 100, 7
    on_time = commanded(rng, stretch * stretches)
    on_time[-stretch:, 2] = 0.0
    dead = np.repeat(np.arange(stretches) % 2 == 1, stretch)
    made = on_time.copy()
    made[dead, 2] = 0.0
    noise = rng.standard_normal((len(on_time), 3))
    failed = np.asarray(jax.jit(lambda: followed(watching(), on_time, made, noise))()[1])
    assert not np.delete(failed, 2, axis=1).any()
    at_end = failed[stretch - 1 :: stretch, 2]  # of each stretch
    assert at_end.tolist() == [False, True, False, True, False, True, True]


@pytest.mark.slow
def test_two_thrusters_that_fail_one_after_the_other_are_both_isolated():
    rng = np.random.default_rng(21)
    samples, first, second = 200, 40, 110
    on_time = commanded(rng, samples)
    made = on_time.copy()
    made[first:, 1] = 0.3 * PERIOD  # stuck at a level
    made[second:, 6] *= 0.4  # degraded
    noise = rng.standard_normal((samples, 3))
    _, failed, kind, flow, _ = map(
        np.asarray, jax.jit(lambda: followed(watching(), on_time, made, noise))()
    )
    assert not failed[:first].any()
    assert failed[second].tolist() == [k == 1 for k in range(COUNT)]
    assert failed[-1].tolist() == [k in (1, 6) for k in range(COUNT)]
    assert kind[-1, [1, 6]].tolist() == [DiagnosedKind.STUCK_AT, DiagnosedKind.DEGRADED]
    assert flow[-1, 1] == pytest.approx(0.3, abs=0.05)


@pytest.mark.slow
def test_a_torque_from_outside_is_learned_and_no_thruster_is_isolated():
    """From 0.3 to 30 % of a thruster's, any direction, from the beginning or later on.

    After a while it is opposed. (Thrust that opposes it from the same instant on might be missing.)
    """
    rng = np.random.default_rng(23)
    samples, begin, lag, directions = 1500, 200, 20, 24
    units = rng.standard_normal((directions, 3))
    units /= np.linalg.norm(units, axis=1)[:, None]
    full = np.linalg.norm(TORQUE, axis=0).mean()
    sizes = full * np.repeat([0.003, 0.01, 0.03, 0.1, 0.3], directions)
    outside = sizes[:, None] * np.tile(units, (5, 1))
    opposed = PERIOD * np.array([nnls(TORQUE, -torque)[0] for torque in outside])
    noise = rng.standard_normal((len(sizes), samples, 3))
    each = jax.jit(jax.vmap(lambda on, error, now: followed(watching(), on, on, error, now)))
    for since in (0, begin):
        acts, opposes = ((np.arange(samples) >= x)[None, :, None] for x in (since, since + lag))
        on_time = commanded(rng, samples)[None] + opposes * opposed[:, None]
        _, failed, _, _, believed = map(np.asarray, each(on_time, noise, acts * outside[:, None]))
        assert not failed.any(), np.argwhere(failed.any(axis=1))
        off = np.linalg.norm(believed[:, -1] - outside, axis=1)
        assert np.all(off < 0.02 * sizes + 0.012 * full)


@pytest.mark.slow
@pytest.mark.parametrize("rest", [0, 280])
def test_thrust_off_by_a_tenth_in_a_slew_is_not_kept_as_a_torque_from_outside(rest):
    """Pulses in all of 60 s, after a rest or none: of the rate that they missed nothing is left."""
    rng = np.random.default_rng(25)
    runs, samples, slew = 24, 1500, 300
    on_time = np.zeros((runs, samples, COUNT))
    on_time[:, rest : rest + slew] = SHORTEST * rng.integers(0, 2, (runs, 1, COUNT))
    made = on_time * (1 + rng.uniform(-0.1, 0.1, (runs, 1, COUNT)))
    noise = rng.standard_normal((runs, samples, 3))
    each = jax.jit(jax.vmap(lambda on, real, error: followed(watching(), on, real, error)))
    _, failed, _, _, believed = map(np.asarray, each(on_time, made, noise))
    assert not failed.any()
    missed = np.linalg.norm((made - on_time)[:, rest] @ TORQUE.T, axis=1) / PERIOD
    left = np.linalg.norm(believed[:, -1], axis=1)
    assert np.median(missed) > 1e-5
    assert np.all(left < 0.1 * missed + 2e-6)


@pytest.mark.slow
def test_without_a_torque_from_outside_none_is_believed():
    """Of 400,000 samples with noise, and none of the random impulses that the filter allows for."""
    rng = np.random.default_rng(24)
    runs, samples = 200, 2000
    none = np.zeros((samples, COUNT))
    noise = rng.standard_normal((runs, samples, 3))
    each = jax.jit(jax.vmap(lambda error: followed(watching(), none, none, error)))
    believed = np.asarray(each(noise)[4])
    assert np.count_nonzero(believed.any(axis=2)) < 1e-3 * runs * samples


@pytest.mark.slow
def test_thrust_that_comes_late_is_not_taken_for_the_failure_of_another_thruster():
    """A valve late by one period: its thruster is isolated, and no other in half an hour."""
    rng = np.random.default_rng(22)
    samples, begin, late, runs = 9000, 40, 2, 8
    on_time = commanded(rng, samples, rate=0.01)
    made = on_time.copy()
    made[begin:, late] = on_time[begin - 1 : -1, late]
    noise = rng.standard_normal((runs, samples, 3))
    each = jax.jit(jax.vmap(lambda error: followed(watching(), on_time, made, error)))
    failed = np.asarray(each(noise)[1])
    assert failed[:, -1, late].all()
    assert not np.delete(failed, late, axis=2).any()


@pytest.mark.slow
def test_false_alarms_come_as_seldom_as_the_closed_form_says():
    """Of the tests of flow, which run at every sample: the mean run L, from 1 - e^(-n/L)."""
    threshold, samples, runs = 3.0, 400, 1000
    alarms = _alarms(threshold, samples, runs, leak=0.0)
    expected = 1 - np.exp(-samples / average_run_length(1.0, threshold))
    spread = np.sqrt(expected * (1 - expected) / runs)  # tests of one run depend on each other
    assert (alarms < samples).mean() == pytest.approx(expected, abs=3 * spread + 0.06 * expected)


@pytest.mark.slow
def test_pulses_below_the_noise_tell_of_a_dead_thruster_when_there_are_enough():
    """The mean of the likelihood ratio grows by half the square of a signature, in sigmas."""
    noise, samples, begin, runs, dead = 8e-4, 1800, 600, 100, 3
    watch, diagnosis = watching(noise), Diagnosis()
    rng = np.random.default_rng(25)
    on_time = SHORTEST * (rng.random((samples, COUNT)) < 0.5)
    made = on_time.copy()
    made[begin:, dead] = 0.0
    errors = noise / NOISE * rng.standard_normal((runs, samples, 3))
    each = jax.jit(
        jax.vmap(lambda real, error: followed(watch, on_time, real, error), in_axes=(None, 0))
    )
    stage = np.asarray(each(made, errors)[0])
    effect = np.linalg.norm(TORQUE[:, dead] / MOMENTS)
    impulses, signature, squares = on_time[begin:, dead] * effect, 0.0, []
    for impulse in impulses:
        signature += impulse
        squares.append(signature**2)
        signature *= 1 - _steady_gain()
    variance = noise**2 / (1 - _steady_gain())
    assert np.sqrt(max(squares) / variance) < 2 * float(diagnosis.reference)
    needed = 2 * float(diagnosis.reference * diagnosis.threshold)
    expected = np.argmax(np.cumsum(squares) / (2 * variance) > needed)
    alarms = np.where(stage.any(axis=1), stage.argmax(axis=1), samples) - begin
    assert np.median(alarms) == pytest.approx(expected, rel=0.25)
    assert not np.asarray(each(on_time, errors)[0]).any()


@pytest.mark.slow
def test_the_delay_of_detection_is_that_of_the_closed_form():
    """Of a leak that begins with the run; its signature takes three samples to build up."""
    leak, threshold = 0.01, 10.0
    effect = np.linalg.norm(TORQUE[:, 0] / MOMENTS) * PERIOD
    decay = _steady_gain()
    variance = NOISE**2 / (1 - decay)
    shift = leak * effect / decay / np.sqrt(variance)
    assert 1.5 < shift < 4
    alarms = _alarms(threshold, 60, 500, leak)[:, 0]
    expected = average_run_length(1.0, threshold, shift)
    assert expected - 1 < alarms.mean() < expected + 3


def _steady_gain():
    """Of the filter of thrusters at rest: K² / (1 - K) is the process noise over that of a rate."""
    ratio = RESTLESSNESS
    return (-ratio + np.sqrt(ratio**2 + 4 * ratio)) / 2


def _alarms(threshold, samples, runs, leak):
    """When each test of flow first exceeds a threshold, (runs, thrusters); else `samples`.

    No thruster is commanded, and the first leaks. Random impulses are those that the filter allows
    for; without them false alarms are rarer.
    """
    watch, none = watching(), jnp.zeros(COUNT)
    diagnosis = Diagnosis()
    condition = diagnosis.init(watch, Reading(jnp.zeros(3))).condition
    change = jnp.asarray(leak * PERIOD * TORQUE[:, 0] / MOMENTS)

    def sample(carry, draws):
        (omega, memory, statistic), (error, impulse) = carry, draws
        omega = omega + change - PERIOD * jnp.cross(omega, MOMENTS * omega) / MOMENTS
        omega = omega + np.sqrt(RESTLESSNESS) * NOISE * impulse
        residual, memory = watch.step(
            Reading(omega + NOISE * error),
            none,
            condition,
            jnp.array(PERIOD),
            memory,
            diagnosis.uncertainty,
        )
        size = jnp.sqrt(jnp.sum(residual.flow**2, axis=0) * residual.variance)
        along = jnp.sum(residual.flow * residual.innovation, axis=0)
        score = along / jnp.where(size > 0, size, 1.0)
        statistic = jnp.maximum(0.0, statistic + score - diagnosis.reference)
        return (omega, memory, statistic), statistic > threshold

    def run(key):
        start = (jnp.zeros(3), watch.init(Reading(jnp.zeros(3))), none)
        alarm = jax.lax.scan(sample, start, jax.random.normal(key, (samples + 1, 2, 3)))[1][1:]
        return jnp.where(alarm.any(axis=0), jnp.argmax(alarm, axis=0) + 1, samples)

    return np.asarray(jax.jit(jax.vmap(run))(jax.random.split(jax.random.key(7), runs)))
