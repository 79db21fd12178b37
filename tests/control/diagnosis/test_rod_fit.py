"""Losses of magnetorquers by the momentum of body and wheels: against SciPy, NumPy and flights."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxsat.control.diagnosis.diagnosis import MOST_RETURNS
from jaxsat.control.diagnosis.rod_fit import (
    DOUBTED,
    INTERVAL,
    ROUGH,
    TURNED,
    UNTOLD,
    WALK,
    Outside,
    RodSample,
)
from jaxsat.control.rod_trial import TRIAL
from jaxsat.control.tolerant_rods import RodMemory
from jaxsat.core.trees import Symmetric
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.magnetorquers import NEAREST

PERIOD = 0.5
LEFT, LIMIT = np.array([1.0, 0.0, 0.3]), 0.2
TURN = np.array([[0, 0, 0.02], [0.02, 0, 0.01], [-0.03, 0, 0]])  # of x and z, towards others
BODY, PUSH = np.array([0.004, -0.006, 0.003]), np.array([2e-8, -3e-8, 1e-8])  # A m², N m
KNOWN = np.array([4e-8, 3e-8, -2e-8])  # N m
FLIGHT = 5000


@pytest.fixture(scope="module")
def law():
    return build(load("cubesat-3w3m")).loop.controller


def rate(t):
    return np.stack([2e-3 * np.sin(0.01 * t), -1.1e-3 + 0 * t, 1e-3 * np.cos(0.017 * t)])


def field(t):
    return 1e-5 * np.stack([2 * np.cos(2.2e-3 * t), 1.5 + np.sin(1e-3 * t), 3 * np.sin(2.2e-3 * t)])


def dipoles(t):
    """Commands, held over a period."""
    t = PERIOD * np.floor(t / PERIOD + 1e-9)
    return 0.1 * np.stack([np.sin(0.011 * t), np.cos(0.007 * t), np.sin(0.005 * t + 1)])


@pytest.fixture(scope="module")
def flight():
    """Momentum by SciPy, of magnetorquers of which one is dead and one makes less."""

    def momentum_rate(t, momentum):
        made = LEFT * dipoles(t) + TURN @ dipoles(t) + BODY
        made = np.cross(made, field(t)) + PUSH + KNOWN
        return made - np.cross(rate(t), momentum)

    times = PERIOD * np.arange(FLIGHT)
    start = np.array([1e-3, -5e-4, 2e-3])
    # a step for each period: RK23 needs no rate at its end, where the next command begins
    steps = {"method": "RK23", "first_step": PERIOD, "max_step": PERIOD, "rtol": 1.0, "atol": 1.0}
    return times, solve_ivp(momentum_rate, (0, times[-1]), start, t_eval=times, **steps).y.T


def driven(times):
    """Commands times the mean field, in the period before every time."""
    middle = times - PERIOD / 2
    return field(middle).T[:, :, None] * dipoles(middle).T[:, None]


def torques(times):
    """Mean torque of each magnetorquer in the period before every time, as commanded."""
    return np.cross(np.eye(3), driven(times), axisa=0, axisb=1).swapaxes(1, 2)


def samples(times, momentum, quiet=True):
    count = len(times)
    none, known = jnp.zeros((count, 3)), np.tile(KNOWN, (count, 1))
    outside = Outside(none, jnp.full(count, quiet))
    fields = field(times - PERIOD / 2).T
    each = (rate(times).T, momentum, fields, driven(times), known)
    return RodSample(*map(jnp.asarray, each), outside)


@eqx.filter_jit
def flown(law, samples, memory=None):
    fit = law.rods.fit
    memory = fit.init(samples.rate[0]) if memory is None else memory

    def one(memory, sample):
        after = fit.step(sample, law.period, memory, law.diagnosis)
        return after, after

    return jax.lax.scan(one, memory, samples)[1]


def filtered(law, times, momentum):
    """Losses, dipole and torque with their standard deviations, all three equations at once."""
    fit, count = law.rods.fit, int(np.ceil(float(law.rods.fit.span) / PERIOD - 1e-9))
    unit, omega = float(fit.model.spacecraft.momentum_unit), rate(times).T
    inertia = np.asarray(fit.model.spacecraft.inertia)
    mean = (omega[1:] + omega[:-1]) / 2
    change = np.diff(momentum, axis=0)
    change = change + PERIOD * np.cross(mean, (momentum[1:] + momentum[:-1]) / 2)
    each = torques(times)[1:]
    change = change - PERIOD * (each.sum(axis=2) + KNOWN)
    fields = field(times - PERIOD / 2).T[1:]
    moved = PERIOD * driven(times)[1:]
    estimate, covariance = np.zeros(15), np.eye(15)
    across = [TURNED * np.eye(3)[[1, 0, 0]], TURNED * np.eye(3)[[2, 2, 1]]]  # of x, of y, of z
    begin = 0
    while begin + count < len(times):
        one, age = slice(begin, begin + count), count * PERIOD
        impulses = PERIOD * each[one].sum(axis=0)
        of_field = np.cross(np.eye(3), PERIOD * fields[one].sum(axis=0)).T * float(fit.dipole)
        of_torque = np.eye(3) * age * float(fit.dipole) * float(fit.strength)
        turns = [np.cross(way, moved[one].sum(axis=0).T).T for way in across]
        rows = np.concatenate([-impulses, of_field, of_torque, *turns], axis=1)
        turned = np.linalg.norm(np.cross(mean[one], mean[one] @ inertia), axis=1)
        doubtful = PERIOD * np.sum(np.linalg.norm(KNOWN) + turned)
        doubtful += unit * np.linalg.norm(omega[begin + count] - omega[begin])
        squares = (0.1 * doubtful) ** 2 + (ROUGH * np.linalg.norm(impulses)) ** 2
        squares += (UNTOLD * float(fit.model.orbit.rate) ** 2 * unit * age) ** 2
        noise = (2 * float(fit.noise) ** 2 + squares / 3) * np.eye(3)
        read = change[one].sum(axis=0)
        covariance = covariance + np.diag(np.repeat(WALK, (3, 3, 3, 6))) ** 2
        spread, surprise = rows @ covariance @ rows.T + noise, read - rows @ estimate
        if surprise @ np.linalg.solve(spread, surprise) > 2 * 24:
            covariance = np.eye(15)
            spread = rows @ covariance @ rows.T + noise
        gain = np.linalg.solve(spread, rows @ covariance).T
        estimate = estimate + gain @ surprise
        covariance = (np.eye(15) - gain @ rows) @ covariance
        begin += count
    return estimate, np.sqrt(np.diag(covariance))


def columns(turns):
    """Vectors of turns, over their first deviations: of x, y, z towards a first axis, a second."""
    (xy, yx, zx), (xz, yz, zy) = TURNED * turns.reshape(2, 3)
    return np.array([[0, yx, zx], [xy, 0, zy], [xz, yz, 0]])


def test_the_filter_is_that_of_numpy_and_finds_what_scipy_flew(law, flight):
    """Between intervals, and of losses, a dipole and a torque at once."""
    times, momentum = flight
    seen = flown(law, samples(times, momentum))
    last = jax.tree.map(lambda one: one[-1], seen)
    estimate, sigma = filtered(law, times, momentum)
    np.testing.assert_allclose(last.estimate[:9], estimate[:9], rtol=1e-6, atol=1e-9)
    found = np.sqrt(np.diag(last.covariance.matrix))
    np.testing.assert_allclose(found[:9], sigma[:9], rtol=1e-6)
    turns = columns(estimate[9:])
    np.testing.assert_allclose(law.rods.fit.turns(last), turns, atol=1e-8)
    assert np.all((np.abs(turns - TURN) <= 2 * columns(sigma[9:]))[:, [0, 2]])
    unit = float(law.rods.fit.dipole), float(law.rods.fit.dipole * law.rods.fit.strength)
    truth = np.concatenate([1 - LEFT, BODY / unit[0], PUSH / unit[1]])
    assert np.all(np.abs(estimate[:9] - truth) < sigma[:9])
    np.testing.assert_allclose(estimate[:3], 1 - LEFT, atol=0.1)
    assert list(last.failed) == [False, True, True]
    np.testing.assert_allclose(last.part, [1.0, 0.0, LEFT[2]], atol=0.1)
    assert last.part[1] == 0


def test_an_interval_ends_after_a_hundredth_of_an_orbit(law):
    circle = law.rods.steering.field.circle
    assert float(law.rods.fit.span) == pytest.approx(INTERVAL * 2 * np.pi / float(circle.rate))


def test_false_verdicts_count_among_the_false_alarms_of_the_law(law):
    """One test of each magnetorquer an interval, beside those of the wheels."""
    only = eqx.tree_at(lambda one: one.actuators, law, ())
    samples = float(law.rods.fit.span / law.period)
    assert only.false_alarm_rate(0.5, 10.0) == pytest.approx(3 * np.exp(-10) / samples)
    assert law.false_alarm_rate(0.5, 10.0) > only.false_alarm_rate(0.5, 10.0)


def test_what_no_magnetorquer_explains_and_what_is_not_quiet_changes_no_estimate(law, flight):
    times, momentum = flight
    known = torques(times).sum(axis=2)
    noise = np.random.default_rng(4).normal(0, 1e-5, momentum.shape)
    pushed = momentum + np.where(times > 800, 1e-2 * (times - 800), 0)[:, None]
    assert np.abs(known).max() < 1e-4 * 1e-1
    before = flown(law, samples(times[times < 800], momentum[times < 800]))
    seen = flown(law, samples(times, pushed + noise * 0))
    np.testing.assert_array_equal(
        np.asarray(seen.part)[times > 900], np.tile(before.part[-1], (sum(times > 900), 1))
    )
    assert not np.any(flown(law, samples(times, momentum, quiet=False)).failed)


@pytest.mark.parametrize("weak", [0, 1, 2, None])
def test_a_loss_that_dipoles_along_the_field_show_is_that_of_one_alone(law, weak):
    """They show differences of losses, which all three could have: one that makes half has failed,
    rather than two that make more. Conditioned on the others by their information."""
    times, half = PERIOD * np.arange(FLIGHT), np.where(np.arange(3) == weak, 0.5, 1.0)
    middle = times - PERIOD / 2
    sense = np.where(times // float(law.rods.fit.span) % 2, 0.3, -0.3)
    along = field(middle).T / np.linalg.norm(field(middle), axis=0)[:, None]
    moved = field(middle).T[:, :, None] * (sense[:, None] * along)[:, None]
    made = np.cross(np.eye(3), half * moved, axisa=0, axisb=1).sum(axis=1) + KNOWN
    momentum = np.zeros((FLIGHT, 3))
    for number in range(1, FLIGHT):
        turn = np.cross(rate(middle[number]), momentum[number - 1])
        momentum[number] = momentum[number - 1] + PERIOD * (made[number] - turn)
    read = samples(times, momentum)._replace(driven=jnp.asarray(moved))
    last = jax.tree.map(lambda one: one[-1], flown(law, read))
    covariance = np.asarray(last.covariance.matrix)[:3, :3]
    spread = np.sqrt(np.diag(covariance))
    assert np.all(spread > 0.5)
    assert list(last.failed) == [one == weak for one in range(3)]
    if weak is None:
        return
    works = np.arange(3) != weak
    others = np.diag(works / (DOUBTED * 0.1) ** 2)
    information = np.linalg.inv(covariance)
    alone = np.linalg.solve(information + others, information @ np.asarray(last.estimate[:3]))
    np.testing.assert_allclose(last.part[weak], 1 - alone[weak], rtol=1e-6)
    np.testing.assert_allclose(last.part[weak], 0.5, atol=0.01)


@pytest.mark.parametrize("other", [0.5, 0.0])
def test_a_loss_beside_an_unknown_one_is_that_of_the_filter(law, other):
    """The errors of all have 0.04 in common: z would lack 0.2 less if x lacked nothing."""
    memory = law.rods.fit.init(jnp.zeros(3))
    covariance = np.eye(15)
    covariance[:3, :3] = 0.04**2 + 0.005**2 * np.eye(3)
    memory = memory._replace(
        estimate=jnp.zeros(15).at[jnp.array([0, 2])].set(jnp.array([other, 0.5])),
        covariance=Symmetric(jnp.asarray(covariance)),
        failed=jnp.arange(3) == 2,
    )
    times = PERIOD * np.arange(200)
    read = samples(times, np.zeros((200, 3)))
    read = read._replace(driven=jnp.zeros((200, 3, 3)), known=jnp.zeros((200, 3)))
    last = jax.tree.map(lambda one: one[-1], flown(law, read, memory))
    np.testing.assert_allclose(last.part, [1 - other, 1.0, 0.5], atol=0.01)
    assert list(last.failed) == [other != 0, False, True]


@pytest.fixture(scope="module")
def sound():
    """Times and momentum of magnetorquers which all work."""
    times = PERIOD * np.arange(FLIGHT)
    whole = np.zeros((FLIGHT, 3))
    for number in range(FLIGHT - 1):
        torque = torques(times[number + 1 :][:1])[0].sum(axis=1) + KNOWN
        turn = PERIOD * np.cross(rate(times[number] + PERIOD / 2), whole[number])
        whole[number + 1] = whole[number] + PERIOD * torque - turn
    return times, whole


def test_magnetorquers_that_work_are_not_isolated(law, sound):
    """Noise of rates and tachometers alone: 24 flights."""
    times, whole = sound
    rng = np.random.default_rng(5)
    for _ in range(24):
        noise = rng.normal(0, 1e-5, whole.shape)
        assert not np.any(flown(law, samples(times, whole + noise)).failed)


@pytest.mark.parametrize("returns", [0, 1, 2])
def test_a_magnetorquer_that_works_again_returns_to_service_twice_and_no_more(law, sound, returns):
    memory = law.rods.fit.init(jnp.zeros(3))
    dead = jnp.arange(3) == 1
    spread = jnp.where(jnp.arange(15) == 1, 0.05, 1.0)
    memory = memory._replace(
        estimate=jnp.where(jnp.arange(15) == 1, 1.0, 0.0),
        covariance=Symmetric(jnp.diag(spread**2)),
        failed=dead,
        part=jnp.where(dead, 0.0, 1.0),
        returns=jnp.where(dead, float(returns), 0.0),
    )
    assert list(memory.tested) == [False, returns < MOST_RETURNS, False]
    seen = flown(law, samples(*sound), memory)
    part = np.asarray(seen.part)
    assert np.all(part[:, [0, 2]] == 1)
    assert np.all(part[: FLIGHT // 50, 1] == 0)
    back = returns < MOST_RETURNS
    assert part[-1, 1] == back
    assert bool(seen.failed[-1, 1]) != back
    np.testing.assert_array_equal(seen.returns[-1], [0, returns + back, 0])


def test_those_given_up_are_tested_by_dipoles_of_alternating_sense(law):
    memory = law.rods.begin(jnp.zeros(3))
    field, wanted = jnp.array([1e-5, 2e-5, 3e-5]), jnp.array([0.01, 0.0, 0.03])
    for sense in (1.0, -1.0, 0.0):
        for returns in (1.0, 2.0):
            fit = memory.fit._replace(
                part=jnp.array([1.0, 0.0, 1.0]),
                returns=jnp.array([0.0, returns, 0.0]),
                sense=jnp.array(sense),
            )
            before = memory._replace(fit=fit)
            left = law.rods.diagnosed(before)
            commands, torque, after = left.act(field, wanted, law.period, before)
            test = sense * TRIAL * LIMIT if returns < MOST_RETURNS else 0.0
            np.testing.assert_allclose(commands, [0.01, test, 0.03], rtol=1e-12, atol=1e-18)
            made = np.cross([0.01, 0.0, 0.03], field)
            np.testing.assert_allclose(torque, made, rtol=1e-12)
            assert np.all(np.asarray(after.commanded)[:, 1] == test * np.asarray(field))


def test_what_is_left_makes_the_dipoles_of_the_others(law):
    """Shares are the pseudo-inverse of the axes of those that work, commands make up for losses."""
    rods, axes = law.rods, np.asarray(law.rods.steering.axes)
    memory = rods.begin(jnp.zeros(3))
    assert memory.fit is not None
    for parts in ([1.0, 1.0, 1.0], [0.5, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.0]):
        part = np.array(parts)
        now = memory._replace(fit=memory.fit._replace(part=jnp.asarray(part)))
        left = rods.diagnosed(now)
        expected = np.zeros((3, 3))
        expected[part != 0] = np.linalg.pinv(axes[:, part != 0])
        np.testing.assert_allclose(left.steering.shares, expected, atol=1e-12)
        np.testing.assert_allclose(left.power, rods.only(part != 0).power, rtol=1e-9)
        wanted = left.steering.reach(jnp.array([1e-5, 2e-5, 3e-5])).high
        np.testing.assert_allclose(wanted, LIMIT * np.abs(part), rtol=1e-12)
        commands, torque, after = left.act(jnp.array([1e-5, 2e-5, 3e-5]), wanted, law.period, now)
        np.testing.assert_allclose(part * commands, wanted, rtol=1e-12)
        made = np.cross(axes @ (part * np.asarray(commands)), [1e-5, 2e-5, 3e-5])
        np.testing.assert_allclose(torque, made, atol=1e-18)
        delayed = (PERIOD - float(rods.delay)) / PERIOD
        np.testing.assert_allclose(left.torque(after), delayed * made, atol=1e-18)
    assert isinstance(memory, RodMemory)


@pytest.mark.parametrize("part", [[1.0, 1.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
def test_known_turns_of_axes_leave_no_torque(law, part):
    """Also of two, which make a dipole along the third axis by a field that is not near theirs."""
    memory, working = law.rods.begin(jnp.zeros(3)), np.array(part) != 0
    sound = memory.fit.estimate.shape[0] - 6
    away = np.random.default_rng(3).normal(0, 1, 6)
    fit = memory.fit._replace(
        estimate=jnp.concatenate([jnp.zeros(sound), away]), part=jnp.array(part)
    )
    left = law.rods.diagnosed(memory._replace(fit=fit))
    turns = np.asarray(law.rods.fit.turns(fit))
    np.testing.assert_allclose(np.diag(turns), 0, atol=1e-16)
    np.testing.assert_allclose(np.sum(turns**2), TURNED**2 * np.sum(away**2), rtol=1e-12)
    axes = np.eye(3) + turns
    np.testing.assert_allclose(left.steering.axes, axes, rtol=1e-12, atol=1e-16)
    b, body = np.array([1.2e-5, 2e-5, -1.7e-5]), np.array([0.03, -0.02, 0.04])
    nearest = eqx.filter_jit(lambda one: one.turned(jnp.asarray(b), jnp.asarray(body)))
    unknown = law.rods.diagnosed(memory._replace(fit=memory.fit._replace(part=jnp.array(part))))
    each = (nearest(left.steering), nearest(unknown.steering))
    rest = [np.linalg.norm(np.cross(axes @ np.asarray(one) - body, b)) for one in each]
    sine = np.linalg.norm(b[~working]) / np.linalg.norm(b)
    unmade = 0.0 if working.all() else NEAREST**2 / (NEAREST**2 + sine**2)
    error = unmade + np.sum(turns**2)
    assert rest[0] < error * np.linalg.norm(np.cross(body, b))
    assert rest[1] > 2 * rest[0]


def test_trials_change_sign_and_end_once_losses_are_known(law, flight):
    times, momentum = flight
    seen = flown(law, samples(times, momentum))
    count = int(np.ceil(float(law.rods.fit.span) / PERIOD - 1e-9))
    sense = np.asarray(seen.sense)[count // 2 :: count]
    spread = np.sqrt(np.diagonal(seen.covariance.matrix, axis1=1, axis2=2))[count // 2 :: count, :3]
    doubted = np.any(spread > DOUBTED * 0.1, axis=1)
    assert doubted[:3].all()
    assert not doubted[-1]
    np.testing.assert_array_equal(sense[~doubted], 0)
    signs = sense[: np.argmin(doubted)]
    np.testing.assert_array_equal(signs[1:], -signs[:-1])


def test_the_dipole_of_body_and_stuck_ones_has_the_error_that_the_filter_says(law, flight):
    times, momentum = flight
    seen = flown(law, samples(times, momentum))
    fit, unit = law.rods.fit, float(law.rods.fit.dipole)
    spread = np.sqrt(np.diagonal(seen.covariance.matrix, axis1=1, axis2=2))[:, 3:6] * unit
    for number in (0, len(times) // 8, len(times) - 1):
        dipole, sigma = fit.body_dipole(jax.tree.map(lambda one, n=number: one[n], seen))
        np.testing.assert_allclose(sigma, spread[number], rtol=1e-12)
        assert np.all(np.abs(dipole - BODY) < 2 * np.asarray(sigma))
    assert np.all(np.asarray(sigma) < 0.1 * LIMIT)


def fly(failures, *changes):
    """Instants, attitudes, and parts of three dipoles beside one wheel; with two failures, so that
    all flights are one program."""
    control = '{law="fault-tolerant", natural_frequency_rad_s=0.02, period_s=2}'
    changes = [f"control={control}", f"failure=[{failures}]", *changes]
    scenario = load("wheel-and-rods", changes, caution=lambda text: None)
    found = build(scenario).simulate()
    part = np.asarray(found.signals.parts["diagnosed_dipole"])
    return np.asarray(found.times), np.asarray(found.signals.quaternion), part


NEVER = '{of="magnetorquer x", at_s=1e6, kind="dead"}'


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dead", "degraded", "stuck-at"])
def test_a_failed_magnetorquer_is_found_in_flight(kind):
    """The others work on."""
    fraction = "" if kind == "dead" else ", fraction=0.3"
    failing = f'{{of="magnetorquer y", at_s=100, kind="{kind}"{fraction}}}'
    times, _, part = fly(f"{failing}, {NEVER}")
    assert np.all(part[:, [0, 2]] == 1)
    assert np.all(part[times < 100] == 1)
    late = part[times > 8000, 1]
    np.testing.assert_allclose(late, 0.3 if kind == "degraded" else 0.0, atol=0.05)


@pytest.mark.slow
def test_a_magnetorquer_that_is_stuck_at_little_is_found_by_trials_and_opposed():
    """It opposes itself by its command, which then is constant: a trial tells that it does not."""
    start = (
        "initial.quaternion=[-0.43823810, 0.13314972, 0.64829762, -0.60821766]",
        "initial.omega_rad_s=[-0.018778, 0.014204, -0.018968]",
    )
    stuck = '{of="magnetorquer z", at_s=100, kind="stuck-at", fraction=0.2}'
    times, quaternion, part = fly(f"{stuck}, {NEVER}", *start)
    assert np.all(part[:, :2] == 1)
    assert np.all(part[times > 8000, 2] == 0)
    turn = 2 * np.linalg.norm(quaternion[:, 1:], axis=1)
    assert np.max(turn[times > 11400]) < 0.02


@pytest.mark.slow
def test_a_magnetorquer_that_works_again_in_flight_is_used_again():
    dead = '{of="magnetorquer y", at_s=100, kind="dead"}'
    again = '{of="magnetorquer y", at_s=6000, kind="degraded", fraction=0.99}'
    times, _, part = fly(f"{dead}, {again}")
    assert np.all(part[:, [0, 2]] == 1)
    assert np.all(part[(times > 5000) & (times < 6000), 1] == 0)
    np.testing.assert_allclose(part[-1, 1], 1, atol=0.1)
