"""Pulses, valves, ramps and failures against an independent program."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float
from scipy.spatial.transform import Rotation

from helpers.thruster_layouts import allocated, canted, pairs, thruster_set
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.failures import FailureKind
from jaxsat.core.solvers import NamedSolver
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.methods import fixed
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.failures import FailureEvents
from jaxsat.spacecraft.held_effector import hold_by_hold
from jaxsat.spacecraft.modulation import (
    DeltaSigma,
    IdealThrottle,
    PulseWidth,
    PulseWidthPulseFrequency,
)
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.spacecraft import Spacecraft
from oracle import pulses

INERTIA = np.array([[2.0, 0.1, 0.05], [0.1, 3.0, -0.2], [0.05, -0.2, 4.0]])
PERIOD, STEPS = 0.1, 24
SCHMITT = {"gain": 4.5, "lag": 0.12, "high": 0.45, "low": 0.15}
OMEGA = [0.02, -0.01, 0.03]


class Waves(AbstractSampledController):
    """A command of time alone, of `size` (N m)."""

    period: Float[Array, ""] = eqx.field(converter=as_float)
    size: Float[Array, "3"] = eqx.field(converter=as_float)

    def init(self, state):
        return None

    def step(self, t, state, memory):
        return self.size * jnp.sin(jnp.array([3.1, 4.7, 2.3]) * t + jnp.arange(3.0)), memory


MODULATIONS = {
    "ideal": (IdealThrottle(), pulses.throttle),
    "pwm": (PulseWidth(), pulses.pulse_width),
    "delta-sigma": (DeltaSigma(), pulses.delta_sigma),
    "pwpf": (
        PulseWidthPulseFrequency.of(PERIOD, *SCHMITT.values()),
        lambda duties, period, least: pulses.schmitt_trigger(duties, period, least, **SCHMITT),
    ),
}
VALVES = {
    "at once": {},
    "ramps": {"rise_time": 0.013, "fall_time": 0.021},
    "late": {"valve_delay": 0.017},
    "late ramps": {"valve_delay": 0.06, "rise_time": 0.03, "fall_time": 0.045},
}
FAILURES = {
    "dead": ("dead", 0.0),
    "degraded": ("degraded", 0.4),
    "stuck-on": ("stuck-on", 0.0),
    "stuck-at": ("stuck-at", 0.3),
    "leaking": ("leaking", 0.2),
    "delayed": ("delayed", 0.033),
    "intermittent": ("intermittent", 0.1),
    "turned": ("turned", 0.0),
}
KINDS = {name: FailureKind[name.upper().replace("-", "_")] for name in FAILURES}


def loop_of(torque, modulation, valves, least, size, failures=None, late=False, substeps=4):
    late = late or "valve_delay" in valves
    thrusters = thruster_set(torque, least, **valves)
    actuators = PulsedThrusters(thrusters, allocated(torque), modulation, failures, late)
    plant = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0))
    return SampledLoop(
        plant.with_effectors((actuators,)), Waves(PERIOD, np.full(3, size)), substeps=substeps
    )


def flown(loop):
    start = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), OMEGA)
    return simulate(
        loop, start, np.arange(STEPS + 1) * PERIOD, method=fixed(PERIOD, NamedSolver("dopri5"))
    ).signals


def oracle(torque, commands, shape, valves, least, failure=None, turned=(np.inf, None)):
    """ω and on-times at the samples; `failure` is (thruster, time, kind, amount)."""
    cost = np.linalg.norm(torque, axis=0)
    duties = [pulses.least_propellant(torque, cost, wanted) for wanted in commands]
    end = STEPS * PERIOD
    profiles = [
        pulses.thrust(
            shape(one, PERIOD, least),
            end,
            period=PERIOD,
            delay=valves.get("valve_delay", 0.0),
            rise=valves.get("rise_time", 0.0),
            fall=valves.get("fall_time", 0.0),
            failure=failure[1:] if failure is not None and failure[0] == k else None,
        )
        for k, one in enumerate(np.transpose(duties))
    ]
    return pulses.fly(INERTIA, torque, profiles, OMEGA, end, np.arange(STEPS) * PERIOD, turned)


def commands_of(loop):
    instants = jnp.arange(STEPS) * PERIOD
    return np.asarray(jax.vmap(lambda t: loop.controller.step(t, None, None)[0])(instants))


WITH_FOUR_VALVES = ("pwm", "dead")
"""The others with valves that are neither late nor slow, or both, to save time."""

QUICK = {("dead", "at once")}


def combinations(first):
    """All pairs with VALVES; all but a few are slow, as each of VALVES is compiled on its own."""
    return [
        pytest.param(one, valves, marks=() if (one, valves) in QUICK else pytest.mark.slow)
        for one in first
        for valves in VALVES
        if one in WITH_FOUR_VALVES or valves in ("at once", "late ramps")
    ]


@pytest.mark.parametrize(("modulation", "valves"), combinations(MODULATIONS))
def test_pulses_act_at_their_true_instants(modulation, valves):
    made, shape = MODULATIONS[modulation]
    torque, least = pairs(), 0.0 if modulation == "ideal" else 0.008
    loop = loop_of(torque, made, VALVES[valves], least, 0.6)
    found = flown(loop)
    omega, on_time = oracle(torque, commands_of(loop), shape, VALVES[valves], least)
    np.testing.assert_allclose(found.omega, omega, atol=1e-10)
    flow = 0.001 * np.linalg.norm(torque, axis=0)
    used = np.asarray(found.parts["propellant"])  # at a sample, that of the period to come included
    np.testing.assert_allclose(used[:-1], (on_time @ flow)[1:], rtol=1e-9, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize(("failure", "valves"), combinations(FAILURES))
def test_failures_strike_inside_a_period(failure, valves):
    kind, amount = FAILURES[failure]
    torque, _ = canted(force=2.0)
    number, at = 2, 0.7431
    turned = np.array(torque)
    turned[:, number] = Rotation.from_rotvec([0.3, -0.5, 0.9]).apply(turned[:, number])
    events = FailureEvents([number], [at], [KINDS[failure]], [amount], turned[None])
    late = kind == "delayed"
    loop = loop_of(torque, PulseWidth(), VALVES[valves], 0.004, 0.12, events, late)
    found = flown(loop)
    truth = (number, at, kind, amount)
    args = (torque, commands_of(loop), pulses.pulse_width, VALVES[valves], 0.004)
    omega, _ = oracle(*args, truth, (at, turned) if kind == "turned" else (np.inf, None))
    np.testing.assert_allclose(found.omega, omega, atol=1e-10)
    sound, _ = oracle(*args)
    assert np.abs(sound - omega).max() > (1e-6 if late else 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("modulation", MODULATIONS)
def test_a_period_has_as_many_holds_as_it_can_need(modulation):
    """Random commands, ramps, delays and failures: time always comes to the end of the period."""
    torque, _ = canted(force=1.0)
    kinds = [FailureKind.STUCK_AT, FailureKind.INTERMITTENT]
    failures = FailureEvents(
        [1.0, 3.0], [0.5003, 1.2345], kinds, [0.4, 0.3], np.stack([torque, torque])
    )
    sizes = np.random.default_rng(1).choice([0.01, 0.05, 0.2], size=(64, 1, 1))
    commands = np.random.default_rng(2).normal(size=(64, 40, 3)) * sizes
    for valves in VALVES.values():
        made = MODULATIONS[modulation][0]
        thrusters = thruster_set(torque, 0.007, **valves)
        late = "valve_delay" in valves
        actuators = PulsedThrusters(thrusters, allocated(torque), made, failures, late)

        def period(carry, command, actuators=actuators):
            memory, t = carry
            plan = actuators.plan(t, command, memory, jnp.array(PERIOD), None)

            def step(now, ended, running):
                ahead = actuators.ahead(plan, running, now, plan.period)
                running = actuators.passed(plan, running, ahead, now, ahead.until)
                return ahead.until, ahead.until, running

            begun = (jnp.array(0.0), actuators.begin(plan))
            ended, last = hold_by_hold(actuators.holds, plan.period, step, *begun)
            return (actuators.finish(plan, last)[0], t + PERIOD), ended

        def flown(commands, actuators=actuators, period=period):
            return jax.lax.scan(period, (actuators.init_memory(), jnp.array(0.0)), commands)[1]

        np.testing.assert_array_equal(jax.jit(jax.vmap(flown))(jnp.asarray(commands)), PERIOD)


ON, OFF, HALF = 1.0, 0.0, 0.5
FULL_BUT_ROUNDED = 1 - 1e-16
COUNTED = {
    "pwm": (PulseWidth(), 0.1, 0.0, [ON, ON, HALF, ON, ON, OFF, HALF, HALF, OFF, ON], 5),
    "pwm rounded": (PulseWidth(), 0.1, 0.0, [FULL_BUT_ROUNDED] * 9, 1),
    "delta-sigma": (DeltaSigma(), 0.027, 0.009, [ON] * 9, 1),
    "delta-sigma, a third": (DeltaSigma(), 0.027, 0.027, [1 / 3] * 9, 3),
    "throttle": (IdealThrottle(), 0.1, 0.0, [HALF, OFF, HALF], 0),
}
"""Duties of a thruster by periods, and its openings counted by hand; 3 x 0.009 < 0.027 here."""


@pytest.mark.parametrize("name", COUNTED)
def test_openings_are_counted_not_periods(name):
    modulation, period, least, duties, openings = COUNTED[name]
    actuators = PulsedThrusters(thruster_set(np.eye(3)[:, :1], least), None, modulation)
    memory = actuators.init_memory()
    for duty in duties:
        memory = actuators.plan(0.0, jnp.array([duty]), memory, jnp.asarray(period), None).memory
    np.testing.assert_array_equal(memory.openings, [openings])


@pytest.mark.parametrize(
    ("duty", "late", "events", "openings"),
    [
        (HALF, 0.0, {1.0625: "dead"}, 9),
        (HALF, 0.1, {1.0625: "dead"}, 8),
        (HALF, 0.0, {1.0: "stuck-on"}, 8),
        (HALF, 0.0, {1.0: "stuck-at"}, 8),
        (HALF, 0.0, {1.0: "leaking"}, 24),
        (HALF, 0.0, {1.0: "intermittent"}, 16),
        (HALF, 0.1, {1.0: "dead", 2.0: "degraded"}, 16),
        (ON, 0.0, {1.0: "intermittent"}, 2),
    ],
)
def test_a_valve_that_does_not_open_is_not_counted(duty, late, events, openings):
    """24 periods of 1/8 s, counted by hand; a tenth of 10 s is the pause."""
    numbers = {"at": list(events), "amount": [0.1] * len(events), "number": [0] * len(events)}
    kinds = [KINDS[name] for name in events.values()]
    torque = np.eye(3)[:, :1]
    failures = FailureEvents(kind=kinds, turned=np.stack([torque] * len(events)), **numbers)
    valves = thruster_set(torque, 0.0, **({"valve_delay": late} if late else {}))
    actuators = PulsedThrusters(valves, None, PulseWidth(), failures, late > 0)

    def period(memory, t):
        use, length = jnp.array([duty]), jnp.array(0.125)
        return actuators.plan(t, use, memory, length, None).memory, None

    memory, _ = jax.lax.scan(period, actuators.init_memory(), jnp.arange(24) / 8)
    np.testing.assert_array_equal(memory.openings, [openings])


def test_openings_of_a_schmitt_trigger_are_those_of_its_equations():
    """Against Euler steps of the lag that are a thousandth of a period long."""
    duties = np.random.default_rng(4).uniform(0, 1, 20)
    duties[[3, 7]], duties[[5, 6]] = 0.0, 1.0
    actuators = PulsedThrusters(thruster_set(np.eye(3)[:, :1]), None, MODULATIONS["pwpf"][0])
    memory, level, valve, count = actuators.init_memory(), 0.0, 0, 0

    @jax.jit
    def after(duty, memory):
        return actuators.plan(0.0, duty, memory, jnp.array(PERIOD), None).memory

    for duty in duties:
        memory = after(jnp.array([duty]), memory)
        for _ in range(1000):
            goal = SCHMITT["gain"] * (duty - valve)
            level += PERIOD / 1000 * (goal - level) / SCHMITT["lag"]
            opens, shuts = level >= SCHMITT["high"], level <= SCHMITT["low"]
            count += not valve and opens
            valve = 1 if opens and not valve else 0 if shuts and valve else valve
    assert count > 10
    assert float(memory.openings[0]) == count
