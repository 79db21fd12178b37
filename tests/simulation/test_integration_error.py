"""The error estimate of equal steps against closed forms and against SciPy."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.solvers import NamedSolver
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.assessment import IntegrationError
from jaxsat.simulation.engine.fixed import SampledStepper
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case, Program
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.methods import fixed
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import PeriodicTorque
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.flexible_modes import FlexibleModes, ModeStates
from jaxsat.spacecraft.gimbals import ControlMomentGyros, GyroStates
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels

INERTIA = np.array([4.0, 5.0, 6.0])
AMPLITUDE, FREQUENCY, PHASE = 0.1, 100.0, 1.0
TIMES = np.arange(21.0)


class NoTorque(AbstractSampledController):
    """A law that commands nothing."""

    period: Float[Array, ""] = eqx.field(converter=as_float, default=1.0)

    def init(self, state):
        return jnp.zeros(())

    def step(self, t, state, memory):
        return jnp.zeros(2), memory

    def rate_error(self, state, memory):
        return state.omega[:2]

    def mode(self, memory):
        return jnp.array(0)


def free(substeps, *disturbance):
    plant = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), *disturbance)
    thrusters = Actuators.of(Thrusters(jnp.eye(3)).without([3]))
    return SampledLoop(plant.with_effectors((thrusters,)), NoTorque(), substeps=substeps)


def shaken(substeps):
    torque = PeriodicTorque([AMPLITUDE, 0.0, 0.0], [FREQUENCY, 0.0, 0.0], [PHASE, 0.0, 0.0])
    return free(substeps, torque)


def at_rest(omega=(0.0, 0.0, 0.0)):
    return PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), jnp.asarray(omega))


def flown(loop, start, solver="dopri8"):
    return simulate(loop, start, TIMES, method=fixed(1.0, NamedSolver(solver)))


def rate_under_the_ripple(t):
    turned = np.cos(PHASE) - np.cos(FREQUENCY * t + PHASE)
    return AMPLITUDE / (INERTIA[0] * FREQUENCY) * turned


@pytest.mark.parametrize("substeps", [4, pytest.param(40, marks=pytest.mark.slow)])
def test_estimate_bounds_the_error_of_a_torque_that_steps_hardly_resolve(substeps):
    run = flown(shaken(substeps), at_rest())
    off = np.abs(np.asarray(run.signals.omega[:, 0]) - rate_under_the_ripple(TIMES)).max()
    estimate = float(run.integration_error.rate)
    assert off <= estimate < 300 * off
    assert (off > 1e-2) == (substeps == 4)


@pytest.mark.slow
def test_estimate_vanishes_where_steps_resolve_the_torque():
    run = flown(shaken(400), at_rest())
    np.testing.assert_allclose(run.signals.omega[:, 0], rate_under_the_ripple(TIMES), atol=1e-14)
    assert float(run.integration_error.rate) < 1e-13


def test_estimate_is_that_of_a_spin_by_scipy():
    """The rate and the attitude of a free body, by Heun's method."""
    spin = (0.05, 0.1, -0.08)
    run = flown(free(4), at_rest(spin), "heun")

    def rate(t, y):
        q, omega = y[:4], y[4:]
        turn = np.array([-q[1:] @ omega, *(q[0] * omega + np.cross(q[1:], omega))]) / 2
        return np.r_[turn, -np.cross(omega, INERTIA * omega) / INERTIA]

    y = np.r_[1.0, 0.0, 0.0, 0.0, spin]
    exact = solve_ivp(rate, (0, TIMES[-1]), y, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    off = np.linalg.norm(np.asarray(run.signals.omega[-1]) - exact[4:])
    turned = 2 * np.linalg.norm(np.asarray(run.signals.quaternion[-1]) - exact[:4])
    error = run.integration_error
    # a step of half the length has a quarter of the error
    assert 0.5 * off < float(error.rate) < 5 * off
    assert 0.5 * turned < float(error.attitude) < 5 * turned


class Spun(AbstractCaseFactory):
    """A free body that starts with some rate about the first axis."""

    loop: SampledLoop

    def __call__(self, case, gains):
        del gains
        return Case(self.loop, at_rest(case), {}, jnp.array(True))


@pytest.mark.slow
def test_an_engine_that_looks_at_some_intervals_finds_much_the_same():
    stepper = SampledStepper(NamedSolver("heun"))
    engine = ScanEngine(stepper, 2)
    spins = jnp.array([[0.05, 0.1, -0.08], [0.01, 0.02, 0.03]])
    every = Program(Spun(free(2)), 1.0, 40, error_every=1)
    told = engine.evaluate(every, spins)
    some = engine.evaluate(dataclasses.replace(every, error_every=8), spins)
    plain = engine.evaluate(dataclasses.replace(every, error_every=0), spins)
    assert plain.integration_error is None
    np.testing.assert_allclose(some.integration_error.rate, told.integration_error.rate, rtol=0.5)
    np.testing.assert_array_equal(told.omega, plain.omega)
    np.testing.assert_allclose(some.omega, plain.omega, rtol=0, atol=1e-15)
    assert told.integration_error.rate[0] > 4 * told.integration_error.rate[1]


@pytest.mark.slow
def test_the_reference_engine_estimates_what_the_others_do():
    spins = jnp.array([[0.05, 0.1, -0.08], [0.01, 0.02, 0.03]])
    program = Program(Spun(free(2)), 1.0, 40, error_every=8)
    heun = ReferenceEngine(fixed(1.0, NamedSolver("heun")), 2)
    one, other = (
        engine.evaluate(program, spins).integration_error
        for engine in (heun, ScanEngine(SampledStepper(NamedSolver("heun")), 2))
    )
    np.testing.assert_allclose(one.rate, other.rate, rtol=1e-6)
    np.testing.assert_allclose(one.attitude, other.attitude, rtol=1e-6)


def test_momenta_of_wheels_count_and_a_rate_that_is_off_turns_the_attitude():
    wheels = Wheels(np.eye(3)[:, :2])
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(wheels,))
    q = Quaternion([1.0, 0.0, 0.0, 0.0])
    one = PlantState(q, [0.0, 0.0, 0.0], (WheelMomenta([1.0, 0.0]),))
    other = PlantState(q, [0.0, 0.0, 3e-6], (WheelMomenta([1.0, 2e-6]),))
    none = IntegrationError.none(jnp.zeros(3))
    error = none.after(body, jnp.array(2.0), one, other)
    np.testing.assert_allclose(error.rate, 3e-6 + 2e-6 / 5)
    assert float(error.attitude) == 0
    np.testing.assert_allclose(error.later(jnp.array(10.0)).attitude, 34e-6)
    weighted = none.after(body, jnp.array(2.0), one, other, weight=64.0)
    np.testing.assert_allclose(weighted.rate, 64 * error.rate)


@pytest.mark.parametrize("mass", [1e-6, 1.0, 1e6])
def test_angles_of_gimbals_and_modes_count_as_the_momentum_that_they_change(mass):
    """A gimbal off by δ changes the momentum by H δ, a mode's rate by v that by |d|² v."""
    gyros = ControlMomentGyros([[1.0], [0.0], [0.0]], [[0.0], [1.0], [0.0]], 0.8 * mass, 1.0)
    modes = FlexibleModes([[0.0], [0.0], [1.0]], np.sqrt(2.0 * mass), 1.0)
    body = RigidBody(Spacecraft(mass * INERTIA), ExactOrbit(0.0), effectors=(gyros, modes))
    q, momentum = Quaternion([1.0, 0.0, 0.0, 0.0]), [0.8 * mass]
    one, other = (
        PlantState(q, np.zeros(3), (GyroStates([x], momentum), ModeStates([0.1], [y])))
        for x, y in ((0.3, 0.2), (0.3 + 1e-6, 0.2 + 3e-6))
    )
    error = IntegrationError.none(jnp.zeros(3)).after(body, jnp.array(2.0), one, other)
    np.testing.assert_allclose(error.rate, (0.8 * 1e-6 + 2.0 * 3e-6) / 5, rtol=1e-5)


@pytest.mark.slow
def test_a_long_libration_takes_few_steps_and_keeps_its_integral():
    """Gravity gradient over 40,000 s; steps of 0.01 s would be four millions.

    The Jacobi integral is ½ ω_r·Jω_r + ω0² (3 n·Jn - y·Jy)/2, n and y the third and the second axis
    of the orbit frame.
    """
    rate = 0.00108
    changes = [
        "control={law='coast'}",
        "simulation={duration_s=40000}",
        "spacecraft.third_rate='free'",
        "disturbance={gravity_gradient=true}",
        "initial={quaternion=[0.96,0.28,0,0],omega_rad_s=[0,-0.00108,0]}",
        f"orbit={{rate_rad_s={rate}}}",
    ]
    run = build(load("paper-rate", changes))
    found = run.simulate()
    assert int(found.steps) < 2000
    inertia = np.asarray(run.loop.plant.spacecraft.inertia)
    every = slice(None, None, 400)
    q = np.asarray(found.signals.quaternion)[every]
    axes = Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix()  # of the body in the orbit frame
    y, n = axes[:, 1], axes[:, 2]
    turn = np.asarray(found.signals.relative_rate)[every]
    square = lambda v: np.einsum("ti,ij,tj->t", v, inertia, v)  # noqa: E731
    integral = (square(turn) + rate**2 * (3 * square(n) - square(y))) / 2
    np.testing.assert_allclose(integral, integral[0], rtol=1e-10)
    assert np.ptp(square(n)) > 1  # it moves
