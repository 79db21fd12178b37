"""Ideal thrusters that fail under a continuous or a sampled law, in two engines."""

import dataclasses

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float
from scipy.integrate import solve_ivp

from jaxsat.control.controller import AbstractFeedbackLaw
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.failures import FailureKind
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.fixed import SampledStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case, program_of
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import AbstractLoop, ContinuousLoop
from jaxsat.simulation.methods import fixed
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.failures import FailureEvents
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters

INERTIA = np.array([[4.0, 0.3, -0.2], [0.3, 2.5, 0.1], [-0.2, 0.1, 3.2]])
AXES = np.eye(3)
TURNED = np.array([[0.0, 0.0, 0.0], [0.8, 1.0, 0.0], [0.6, 0.0, 1.0]])
LIMIT, SECONDS = 0.3, 8.0
OMEGA = [0.05, -0.03, 0.1]


class Waves(AbstractFeedbackLaw):
    """Torques that go beyond the limit, and damping."""

    def torque(self, t, state):
        wave = jnp.stack([jnp.sin(t), jnp.cos(0.7 * t), 0.3 + 0.1 * jnp.sin(2 * t)])
        return -0.4 * state.omega + 0.35 * wave


class Struck(AbstractCaseFactory):
    """A loop with other events in every case: (thruster, time, kind, amount) of two."""

    loop: AbstractLoop
    start: PlantState

    def __call__(self, case, gains):
        del gains
        events = FailureEvents(*case.reshape(4, 2), jnp.stack([jnp.asarray(TURNED)] * 2))
        loop = eqx.tree_at(lambda loop: loop.plant.effectors[0].failures, self.loop, events)
        return Case(loop, self.start, {"failure": case}, jnp.array(True))


def factory():
    never = FailureEvents([0, 0], [np.inf] * 2, [0, 0], [0, 0], np.stack([TURNED] * 2))
    actuators = dataclasses.replace(Actuators.of(Thrusters(AXES), LIMIT, torques=3), failures=never)
    plant = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0))
    start = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), OMEGA)
    return Struck(ContinuousLoop(plant.with_effectors((actuators,)), Waves()), start)


K, NEVER = FailureKind, np.inf
CASES = np.array(
    [  # thrusters, times, kinds, amounts
        [0, 0, NEVER, NEVER, K.DEAD, K.DEAD, 0, 0],
        [0, 1, 2.345, NEVER, K.DEAD, K.DEAD, 0, 0],
        [1, 1, 4.25, 1.5, K.REVERSED, K.DEGRADED, 0, 0.4],  # not in the order of time
        [2, 0, 3.3, 3.3, K.STUCK_AT, K.STUCK_ON, -0.7, 0],
        [0, 0, 1.1, 5.0, K.TURNED, K.DEAD, 0, 0],
        [2, 1, 0.0, 7.999, K.REVERSED, K.STUCK_ON, 0, 0],
    ],
    float,
)


class ThreeThrusters:
    """Gain, level and axis of three thrusters, each as its last event leaves it."""

    def __init__(self):
        self.gain, self.level, self.axes = np.ones(3), np.zeros(3), AXES.copy()

    def strike(self, which, kind, amount):
        which = int(which)
        self.gain[which], self.level[which], self.axes[:, which] = 1.0, 0.0, AXES[:, which]
        if kind in (K.DEAD, K.STUCK_ON, K.STUCK_AT):
            self.gain[which] = 0.0
            self.level[which] = {K.DEAD: 0.0, K.STUCK_ON: 1.0, K.STUCK_AT: amount}[kind]
        elif kind in (K.DEGRADED, K.REVERSED):
            self.gain[which] = amount if kind == K.DEGRADED else -1.0
        elif kind == K.TURNED:
            self.axes[:, which] = TURNED[:, which]

    def torque(self, thrust):
        return self.axes @ (self.gain * thrust + self.level * LIMIT)


def asked(t, omega):
    """The torque in its direction, as far as the thruster that is most in use reaches."""
    wave = np.array([np.sin(t), np.cos(0.7 * t), 0.3 + 0.1 * np.sin(2 * t)])
    wanted = -0.4 * omega + 0.35 * wave
    return wanted * min(1.0, LIMIT / np.max(np.abs(wanted)))


def events_of(case):
    """(time, thruster, kind, amount) in the order of their times."""
    return sorted(zip(*case.reshape(4, 2)[[1, 0, 2, 3]], strict=True), key=lambda x: x[0])


def truth(case):
    """ω at the end, by SciPy between the events; shares no code with jaxsat."""
    thrusters, t, omega = ThreeThrusters(), 0.0, np.array(OMEGA)

    def rate(t, omega):
        torque = thrusters.torque(asked(t, omega))
        return np.linalg.solve(INERTIA, torque - np.cross(omega, INERTIA @ omega))

    for end, *event in [*events_of(case), (SECONDS, 0, -1, 0)]:
        end = min(end, SECONDS)
        if end > t:
            run = solve_ivp(rate, (t, end), omega, "DOP853", rtol=1e-11, atol=1e-13, max_step=0.01)
            omega, t = run.y[:, -1], end
        thrusters.strike(*event)
    return omega


@pytest.mark.slow
def test_machine_code_agrees_with_an_independent_program():
    cases = factory()
    program = program_of(cases, cases.loop, SECONDS)
    stepper = AdaptiveStepper(tolerance=Tolerance(1e-11, 1e-11))
    found = NativeEngine(stepper).evaluate(program, CASES)
    expected = np.array([truth(case) for case in CASES])
    assert np.abs(expected[1:] - expected[0]).max(axis=1).min() > 1e-4
    assert np.all(found.code == 0)
    np.testing.assert_allclose(found.omega, expected, atol=2e-9)


@pytest.mark.slow
def test_a_step_ends_where_a_thruster_fails():
    """A body at rest about whose axis a thruster dies at t: ω = t T / J."""

    class Push(AbstractFeedbackLaw):
        def torque(self, t, state):
            del t, state
            return jnp.array([0.2, 0.0])

    events = FailureEvents([0.0], [1.23456], [K.DEAD], [0.0], AXES[None, :, :2])
    actuators = dataclasses.replace(Actuators.of(Thrusters(AXES[:, :2]), LIMIT), failures=events)
    plant = RigidBody(Spacecraft([2.0, 3.0, 4.0]), ExactOrbit(0.0))
    loop = ContinuousLoop(plant.with_effectors((actuators,)), Push())
    assert not loop.is_smooth()
    start = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), [0.0, 0.0, 0.0])
    run = simulate(loop, start, np.array([0.0, 1.0, 2.0, 3.0]))
    np.testing.assert_allclose(
        run.signals.omega[:, 0], [0, 0.1, 0.123456, 0.123456], rtol=0, atol=1e-14
    )
    np.testing.assert_array_equal(run.signals.torque[:, 0], [0.2, 0.2, 0, 0])
    assert run.assessment.effort[0] == pytest.approx(0.2 * 1.23456, rel=1e-9)


class SampledWaves(AbstractSampledController):
    """The same torques, held over a period."""

    period: Float[Array, ""] = eqx.field(converter=as_float)

    def init(self, state):
        return None

    def step(self, t, state, memory):
        return Waves().torque(t, state), memory


PERIOD, LATE = 0.4, 0.15


def held_truth(case):
    """ω at the end under torques held from `LATE` after a sample, by SciPy between the events."""
    thrusters = ThreeThrusters()
    omega, thrust, later = np.array(OMEGA), np.zeros(3), np.zeros(3)
    samples = [(number * PERIOD, "sample", None) for number in range(round(SECONDS / PERIOD))]
    ready = [(t + LATE, "ready", None) for t, *_ in samples]
    struck = [(at, "failure", event) for at, *event in events_of(case) if at < SECONDS]
    t = 0.0
    instants = sorted(samples + ready + struck, key=lambda x: x[0])
    for end, what, event in [*instants, (SECONDS, "end", None)]:
        if end > t:
            torque = thrusters.torque(thrust)
            run = solve_ivp(
                lambda t, omega, torque=torque: np.linalg.solve(
                    INERTIA, torque - np.cross(omega, INERTIA @ omega)
                ),
                (t, end),
                omega,
                "DOP853",
                rtol=1e-12,
                atol=1e-14,
            )
            omega, t = run.y[:, -1], end
        if what == "sample":
            later = asked(t, omega)
        elif what == "ready":
            thrust = later
        elif what == "failure":
            thrusters.strike(*event)
    return omega


@pytest.mark.slow
def test_engines_agree_with_an_independent_program_under_a_sampled_law():
    cases = factory()
    plant, actuators = cases.loop.plant, cases.loop.plant.effectors[0]
    loop = SampledLoop(
        plant.with_effectors((actuators,)), SampledWaves(PERIOD), substeps=2, delay=LATE
    )
    cases = Struck(loop, cases.start)
    program = program_of(cases, loop, SECONDS)
    stepper = SampledStepper(diffrax.Tsit5())
    expected = np.array([held_truth(case) for case in CASES])
    assert np.abs(expected[1:] - expected[0]).max(axis=1).min() > 1e-4
    reference = ReferenceEngine(fixed(PERIOD, diffrax.Tsit5()), batch_size=6)
    for engine in (NativeEngine(stepper), reference):
        found = engine.evaluate(program, CASES)
        assert np.all(found.code == 0)
        np.testing.assert_allclose(found.omega, expected, atol=1e-10)
