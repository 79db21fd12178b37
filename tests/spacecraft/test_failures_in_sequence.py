"""Failures of the same actuator one after another: the later one replaces the earlier.

What each actuator then makes is held against a plain program of one actuator at one instant.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.thruster_layouts import allocated, pairs, thruster_set
from jaxsat.core.declaration.failures import FailureKind
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.failures import FailureEvents
from jaxsat.spacecraft.magnetorquers import MagnetorquerFailures
from jaxsat.spacecraft.modulation import PulseWidth
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.thrusters import Thrusters
from jaxsat.spacecraft.wheel_failures import WheelFailures

K, W = FailureKind, WheelFailureKind
EVENTS, COUNT, CASES = 6, 3, 60
TORQUE = np.random.default_rng(4).normal(size=(3, 2 * COUNT))
TURNED = np.stack(
    [Rotation.from_rotvec([0.1 * n, 0.5, -0.3]).apply(TORQUE.T).T for n in range(EVENTS)]
)
PARTNER = [1, 0, 3, 2, 4, 5]
"""Of six columns: two thrusters that are two-sided, and two that are not."""


def drawn(kinds, count, *, signed=False):
    """Number, time, kind and amount (cases, events) of random failures; some times are never."""
    random = np.random.default_rng(7)
    shape = (CASES, EVENTS)
    number = random.integers(0, count, shape) + random.uniform(-0.4, 0.4, shape)
    at = np.where(random.random(shape) < 0.1, np.inf, random.uniform(0, 60, shape))
    kind = random.choice(kinds, shape) + random.uniform(-0.4, 0.4, shape)
    return number, at, kind, random.uniform(-1.0 if signed else 0.0, 1.0, shape)


def last(case, which, t, both=()):
    """(event, kind, amount, time) that actuator `which` is under at t, or None."""
    found = None
    for event, (number, at, kind, amount) in sorted(
        enumerate(zip(*case, strict=True)), key=lambda one: one[1][1]
    ):
        number, kind = round(number), round(kind)
        hits = number == which or (
            number in both and kind not in (K.STUCK_ON, K.STUCK_AT, K.LEAKING)
        )
        if at <= t and hits:
            found = (event, kind, amount, at)
    return found


def pushes(case, which, t, sample):
    """Gain, floor, delay and torque (three) of a thruster that pushes; the last sample is told."""
    found = last(case, which, t, (PARTNER[which],))
    gain, floor, delay, torque = 1.0, 0.0, 0.0, TORQUE[:, which]
    if found is None:
        return gain, floor, delay, *torque
    event, kind, amount, at = found
    if kind in (K.DEAD, K.STUCK_AT) or (
        kind == K.INTERMITTENT and (sample - at) % 10 < 10 * amount
    ):
        gain = 0.0
    elif kind == K.DEGRADED:
        gain = amount
    if kind == K.STUCK_ON:
        floor = 1.0
    elif kind in (K.STUCK_AT, K.LEAKING):
        floor = amount
    elif kind == K.DELAYED:
        delay = amount
    elif kind == K.TURNED:
        torque = TURNED[event][:, which]
    return gain, floor, delay, *torque


INSTANTS = np.arange(0.0, 70.0, 3.7)


def expected(cases, count, of_one):
    """What `of_one` makes of each case, instant and actuator, (cases, times, count, ...)."""
    rows = zip(*cases, strict=True)
    return np.array(
        [[[of_one(one, which, t) for which in range(count)] for t in INSTANTS] for one in rows],
        float,
    )


def test_thrusters_that_push_are_under_their_last_failure():
    cases = drawn([k for k in K if k != K.REVERSED], 6)

    @jax.jit
    @jax.vmap
    def states(number, at, kind, amount):
        events = FailureEvents(number, at, kind, amount, TURNED, PARTNER)
        torque = jnp.asarray(TORQUE)
        return jax.vmap(lambda t: events.condition(t, jnp.array(1.3), torque))(INSTANTS)

    gain, floor, delay, torque = states(*cases)
    found = np.concatenate([np.stack([gain, floor, delay], axis=2), torque], axis=2)
    truth = expected(cases, 6, lambda one, which, t: pushes(one, which, t + 1.3, t))
    np.testing.assert_array_equal(np.moveaxis(found, 2, -1), truth)


EITHER = {
    K.DEAD: lambda a: (0.0, 0.0),
    K.DEGRADED: lambda a: (a, 0.0),
    K.STUCK_ON: lambda a: (0.0, 1.0),
    K.STUCK_AT: lambda a: (0.0, a),
    K.REVERSED: lambda a: (-1.0, 0.0),
    K.TURNED: lambda a: (1.0, 0.0),
}
"""Gain and level of an actuator of either sign."""


@pytest.mark.parametrize("part", ["thruster", "magnetorquer"])
def test_actuators_of_either_sign_are_under_their_last_failure(part):
    ideal = part == "thruster"
    cases = drawn([k for k in EITHER if ideal or k != K.TURNED], COUNT, signed=True)
    axes = TORQUE[:, :COUNT]

    @jax.jit
    @jax.vmap
    def states(number, at, kind, amount):
        if ideal:
            events = FailureEvents(number, at, kind, amount, TURNED[:, :, :COUNT])
            return jax.vmap(lambda t: events.two_signed(t >= at, jnp.asarray(axes)))(INSTANTS)
        events = MagnetorquerFailures(number, at, kind, amount)
        return jax.vmap(lambda t: events.two_signed(t >= at, COUNT))(INSTANTS)

    def truth(one, which, t):
        event, kind, amount, _ = last(one, which, t) or (0, K.DEGRADED, 1.0, 0.0)
        torque = TURNED[event][:, which] if kind == K.TURNED else axes[:, which]
        return *EITHER[kind](amount), *(torque if ideal else ())

    gain, level, *turned = states(*cases)
    found = np.stack([gain, level], axis=2)
    if ideal:
        found = np.concatenate([found, turned[0]], axis=2)
    np.testing.assert_array_equal(np.moveaxis(found, 2, -1), expected(cases, COUNT, truth))


def test_wheels_are_under_their_last_failure():
    cases = drawn(list(W), COUNT)

    @jax.jit
    @jax.vmap
    def states(number, at, kind, amount):
        events = WheelFailures(number, at, kind, amount)
        return jax.vmap(lambda t: events.condition(t >= at, COUNT))(INSTANTS)

    def truth(one, which, t):
        _, kind, amount, _ = last(one, which, t) or (0, None, 0.0, 0.0)
        return (
            {W.DEAD: 0.0, W.STOPPED: 0.0, W.DEGRADED: amount}.get(kind, 1.0),
            amount if kind == W.FRICTION_BY else 1.0,
            amount if kind == W.FRICTION_TO else 0.0,
            kind == W.RUNAWAY,
            kind == W.STOPPED,
        )

    found = np.stack([np.asarray(part, float) for part in states(*cases)], axis=-1)
    np.testing.assert_array_equal(found, expected(cases, COUNT, truth))


def test_of_two_failures_at_one_instant_the_last_one_counts():
    """Where a study draws so; a scenario that says so is refused."""
    events = WheelFailures([1, 1], [5, 5], [W.RUNAWAY, W.DEAD], [0, 0])
    found = events.condition(jnp.array([True, True]), 2)
    np.testing.assert_array_equal(found.gain, [1, 0])
    assert not found.runaway.any()


def test_failures_in_sequence_strike_inside_a_period():
    """The impulse of a thruster: nothing asked, stuck on from 0.7 s, at 0.25 from 1.1, dead later.

    The tables are in no order of time.
    """
    torque = pairs()
    at, kinds = [1.1, 1.36, 0.7], [K.STUCK_AT, K.DEAD, K.STUCK_ON]
    events = FailureEvents([2] * 3, at, kinds, [0.25, 0, 0], np.stack([torque] * 3))
    thrusters = PulsedThrusters(thruster_set(torque, 0.01), allocated(torque), PulseWidth(), events)
    period = jnp.array(0.5)

    @jax.jit
    def one(memory, t):
        plan = thrusters.plan(t, jnp.zeros(3), memory, period, None)
        memory, mean = thrusters.finish(plan, thrusters.run(plan, period))
        return memory, mean.usage.level * period

    _, used = jax.lax.scan(one, thrusters.init_memory(), period * jnp.arange(4.0))
    made = np.zeros(len(torque.T))
    made[2] = 0.4 + 0.25 * 0.26
    np.testing.assert_allclose(used.sum(axis=0), made, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("ideal", [True, False])
def test_a_dispersed_thruster_is_turned_with_its_own_gain_and_mounting(ideal):
    """What turns its torque before the failure turns it by the same rotation after it."""
    size, count = np.linalg.norm(TORQUE, axis=0), 2 * COUNT
    torque, events = TORQUE / size, FailureEvents([1], [0], [K.TURNED], [0], TURNED[1:2] / size)
    thrusters = (
        dataclasses.replace(Actuators.of(Thrusters(torque), 1.0, 3), failures=events)
        if ideal
        else PulsedThrusters(thruster_set(torque), None, PulseWidth(), events)
    )
    random = np.random.default_rng(8)
    angles, change = random.uniform(-0.2, 0.2, (count, 2)), random.uniform(-0.5, 0.5, count)
    dispersed = thrusters.misaligned(jnp.asarray(angles)).stronger(jnp.asarray(change))

    def columns(one, struck):
        reach = one.reach(jnp.array(0.0), None, None, jnp.array([struck]), 0.0)
        return np.array(reach.columns)

    before, after = columns(dispersed, False)[:, 1], columns(dispersed, True)[:, 1]
    mounted = before / (1 + change[1])
    np.testing.assert_allclose(np.linalg.norm(mounted), 1.0, rtol=1e-14)
    axis = np.cross(torque[:, 1], mounted)
    angle = np.arctan2(np.linalg.norm(axis), torque[:, 1] @ mounted)
    rotation = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
    turned = columns(thrusters, True)[:, 1]
    np.testing.assert_allclose(after, (1 + change[1]) * rotation.apply(turned), rtol=1e-13)
    others = np.arange(count) != 1
    np.testing.assert_array_equal(
        columns(dispersed, True)[:, others], columns(dispersed, False)[:, others]
    )
