"""A body with wheels: conserved momentum, saturation, and the paper's law on two wheels.

Gyrostat: Hughes, Spacecraft Attitude Dynamics, 1986, section 3.4.
"""

import dataclasses

import diffrax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.paper import PAPER_THREE_AXIS, actuators, bodies, three_axis_law, three_axis_start
from jaxsat.control.controller import AbstractFeedbackLaw, Coast
from jaxsat.core.attitude import Quaternion
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import adaptive, fixed
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.distribution import WheelsFirst
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import NoDisturbance
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels

INERTIA = np.array([[400.0, 30.0, -20.0], [30.0, 250.0, 15.0], [-20.0, 15.0, 320.0]])
AXES = np.array([[1.0, 0.0, 0.5, 0.3], [0.0, 1.0, -0.5, 0.2], [0.1, 0.0, 0.7, -0.9]])
AXES = AXES / np.linalg.norm(AXES, axis=0)


class Wave(AbstractFeedbackLaw):
    """Torques about all axes that have nothing to do with the state."""

    def torque(self, t, state):
        del state
        return jnp.stack([3 * jnp.sin(0.7 * t), 2 * jnp.cos(0.4 * t), jnp.sin(1.1 * t + 1)])


def inertial(signals, vectors):
    """Vectors in body axes over time, in orbit axes (which are inertial where ω0 = 0)."""
    q = np.roll(np.array(signals.quaternion), -1, axis=1)
    return Rotation.from_quat(q).apply(vectors)


def momentum_of(signals, inertia=INERTIA, axes=AXES):
    h = np.array(signals.parts["wheel_momentum"])
    return inertial(signals, np.array(signals.omega) @ inertia.T + h @ axes.T)


@pytest.mark.slow
def test_total_momentum_stays_in_inertial_axes():
    """Four oblique wheels with friction and torque limits, and no external torque."""
    wheels = Wheels(AXES, 2.5, None, 0.05, 2e-4)
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(wheels,))
    loop = ContinuousLoop(body, Wave(), WheelsFirst.of(AXES, 3, wheel_limit=2.0))
    start = PlantState(
        Quaternion([1.0, 0, 0, 0]), [0.03, -0.05, 0.08], (WheelMomenta([3.0, -2.0, 5.0, 1.0]),)
    )
    run = simulate(loop, start, jnp.linspace(0, 60, 61), method=adaptive()).signals
    momentum = momentum_of(run)
    size = np.linalg.norm(momentum[0])
    assert np.abs(momentum - momentum[0]).max() < 1e-12 * size
    assert np.ptp(np.array(run.omega), axis=0).min() > 0.01
    np.testing.assert_allclose(run.torque, np.array(run.parts["wheel_torque"]) @ AXES.T, atol=1e-12)


@pytest.mark.slow
def test_two_wheels_without_momentum_leave_none_about_their_normal():
    axes = AXES[:, :2]
    normal = np.cross(*axes.T)
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(Wheels(axes),))

    class TwoWaves(Wave):
        def torque(self, t, state):
            return super().torque(t, state)[:2]

    loop = ContinuousLoop(body, TwoWaves(), WheelsFirst.of(axes, 2))
    start = PlantState(Quaternion([1.0, 0, 0, 0]), [0.0, 0.0, 0.0])
    run = simulate(loop, start, jnp.linspace(0, 60, 61), method=fixed(0.05, diffrax.Dopri8()))
    omega = np.array(run.signals.omega)
    assert np.abs(omega @ INERTIA @ normal).max() < 1e-13 * np.abs(omega @ INERTIA).max()
    assert np.abs(omega).max() > 0.01


@pytest.mark.slow
def test_the_papers_law_on_two_wheels_without_momentum_is_its_run_with_the_third_rate_held():
    """(40)-(42), rounded, at torque level: gyroscopic torques of body and wheels cancel."""
    held, believed = bodies(PAPER_THREE_AXIS)
    assert believed.third_rate_held
    law = three_axis_law(PAPER_THREE_AXIS, saturation_width=0.5, tilt_width=0.1)
    law = dataclasses.replace(law, internal_model=None)  # there is no disturbance
    held = RigidBody(held.spacecraft, held.orbit, NoDisturbance(), True)
    start = three_axis_start(PAPER_THREE_AXIS)
    times, method = jnp.linspace(0, 200, 21), adaptive(1e-12, 1e-13)
    expected = simulate(
        ContinuousLoop(held.with_effectors((actuators(),)), law), start, times, method=method
    )
    axes = np.eye(3)[:, :2]
    body = RigidBody(held.spacecraft, held.orbit, NoDisturbance(), effectors=(Wheels(axes),))
    balanced = -(held.spacecraft.inertia @ start.omega)[:2]
    start = PlantState(start.attitude, start.omega, (WheelMomenta(balanced),))
    loop = ContinuousLoop(body, law, WheelsFirst.of(axes, 2))
    found = simulate(loop, start, times, method=method).signals
    for name in ("w", "z", "omega", "torque"):
        np.testing.assert_allclose(  # relative: |w| is 12 where the third axes point apart
            getattr(found, name), getattr(expected.signals, name), rtol=1e-9, atol=1e-9
        )
    assert np.abs(found.omega[:, 2]).max() < 1e-15
    assert np.abs(found.w[-1]).max() < 0.3 * np.abs(found.w[0]).max()


class Push(AbstractFeedbackLaw):
    """A torque about x that reaches its wheel's limit, and turns round."""

    def torque(self, t, state):
        del state
        return jnp.stack([jnp.cos(0.5 * t), 0 * t, 0 * t])


@pytest.mark.slow
def test_continuous_saturation_ends_and_begins_where_the_command_says():
    """h' = -cos(t/2): at -1 from t = 2 arcsin(1/2) = π/3 until the command turns at t = π."""
    wheels = Wheels(np.eye(3), momentum_limit=1.0)
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(wheels,))
    loop = ContinuousLoop(body, Push(), WheelsFirst.of(np.eye(3), 3))
    assert not loop.is_smooth()
    start = PlantState(Quaternion([1.0, 0, 0, 0]), [0.0, 0.0, 0.0])
    times = np.array([0.0, 1.0, 2.0, np.pi, 4.0, 5.0])
    run = simulate(loop, start, times).signals
    exact = np.where(
        times < np.pi / 3,
        -2 * np.sin(times / 2),
        np.where(times < np.pi, -1, 1 - 2 * np.sin(times / 2)),
    )
    np.testing.assert_allclose(run.parts["wheel_momentum"][:, 0], exact, atol=1e-9)
    signs = loop.event_functions(jnp.array(2.0), loop.start(start)) > 0
    assert signs.shape == (3,)
    limited = WheelMomenta([-1.0 - 1e-12, 0.0, 0.0])
    state = loop.start(PlantState(start.attitude, start.omega, (limited,)))
    for t, stopped in ((2.0, True), (4.0, False)):
        signs = loop.event_functions(jnp.array(t), state) > 0
        assert bool(signs[0]) == stopped
        piece = loop.smooth_piece(signs).motion(jnp.array(t), state)
        np.testing.assert_allclose(piece.torque, loop.motion(jnp.array(t), state).torque)


def test_what_cannot_be_is_told():
    spacecraft, orbit = Spacecraft(INERTIA), ExactOrbit(0.0)
    wheels = Wheels(AXES, coulomb_friction=1e-3)
    with pytest.raises(ValueError, match="third rate"):
        RigidBody(spacecraft, orbit, third_rate_held=True, effectors=(wheels,))
    body = RigidBody(spacecraft, orbit, effectors=(wheels,))
    with pytest.raises(ValueError, match="Coulomb"):
        ContinuousLoop(body.with_effectors((Actuators.of(Thrusters(np.eye(3))), wheels)), Coast())
