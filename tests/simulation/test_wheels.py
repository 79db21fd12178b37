"""Wheels under a sampled command: rest and limits located, against an independent program."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from helpers.thruster_layouts import allocated, pairs, thruster_set
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.simulation.divided_holds import through_hold
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.methods import fixed
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.distribution import WheelsFirst
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import ConstantTorque
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.held_effector import Hold
from jaxsat.spacecraft.modulation import IdealThrottle
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels
from oracle import gyrostat

INERTIA = np.array([[4.0, 0.3, -0.2], [0.3, 2.5, 0.1], [-0.2, 0.1, 3.2]])
AXES = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, -0.5], [0.1, 0.0, 0.7]])
AXES = AXES / np.linalg.norm(AXES, axis=0)
PERIOD, PERIODS = 0.5, 40
PUSH = np.array([0.002, -0.001, 0.003])
ROTOR, VISCOUS = 0.4, 0.012
WHEELS = [
    {"torque_limit": 0.25, "momentum_limit": limit, "inertia": ROTOR, "viscous": VISCOUS}
    | {"coulomb": coulomb}
    for limit, coulomb in ((0.15, 0.02), (0.2, 0.005), (np.inf, 0.05))
]
OMEGA, MOMENTA = [0.05, -0.03, 0.1], [0.1, -0.2, 0.0]


class Waves(AbstractSampledController):
    """A command of time alone."""

    period: Float[Array, ""] = eqx.field(converter=as_float)

    def init(self, state):
        return None

    def step(self, t, state, memory):
        return 0.25 * jnp.sin(jnp.array([0.9, 1.3, 0.5]) * t + jnp.arange(3.0)), memory


def body(rotor=ROTOR, viscous=VISCOUS, **changes):
    wheels = Wheels(AXES, 0.25, [0.15, 0.2, np.inf], rotor, viscous, [0.02, 0.005, 0.05])
    return RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(wheels,), **changes)


def start():
    return PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), OMEGA, (WheelMomenta(MOMENTA),))


def flown(loop, periods=PERIODS):
    method = fixed(PERIOD, diffrax.Dopri8())
    return simulate(loop, start(), np.arange(periods + 1) * PERIOD, method=method)


def asked(loop, periods=PERIODS):
    """What the law asks of each wheel in each period, shared by least squares."""
    instants = jnp.arange(periods) * PERIOD
    commands = np.asarray(jax.vmap(lambda t: loop.controller.step(t, None, None)[0])(instants))
    shares = commands @ np.linalg.inv(AXES).T
    return shares / np.maximum(np.abs(shares).max(axis=1, keepdims=True) / 0.25, 1)


def expected(commands, period=PERIOD, external=PUSH, wheels=WHEELS):
    return gyrostat.fly(
        np.eye(3),
        OMEGA,
        MOMENTA,
        commands,
        period,
        inertia=INERTIA,
        axes=AXES,
        wheels=wheels,
        external=lambda t: external,
    )


SHARED = WheelsFirst.of(AXES, 3, wheel_limit=0.25)


@pytest.mark.slow
@pytest.mark.parametrize(("rotor", "viscous"), [(None, None), (ROTOR, VISCOUS)])
def test_wheels_come_to_rest_and_to_their_limits_at_their_true_instants(rotor, viscous):
    plant = body(rotor, viscous, disturbance=ConstantTorque(PUSH))
    loop = SampledLoop(plant, Waves(PERIOD), SHARED, 4)
    found = flown(loop).signals
    given = {"inertia": rotor or 0.0, "viscous": viscous or 0.0}
    rows, edges = expected(asked(loop), wheels=[one | given for one in WHEELS])
    assert len(edges) > 15
    np.testing.assert_allclose(found.parts["wheel_momentum"], rows[:, 12:], atol=1e-12)
    np.testing.assert_allclose(found.omega, rows[:, 9:12], atol=1e-11)
    largest = np.abs(found.parts["wheel_momentum"]).max(axis=0)
    np.testing.assert_allclose(largest[:2], [0.15, 0.2], rtol=1e-12)
    # without a rotor inertia a wheel at rest, or at its limit and pushed on, makes no torque
    torque = np.asarray(found.torque) - np.asarray(found.parts["wheel_torque"]) @ AXES.T
    np.testing.assert_allclose(torque, 0, atol=1e-15)


@pytest.mark.parametrize(
    ("torque", "length", "parts"), [(-0.1, 0.5, 1), (0.1, 0.5, 2), (0.1, 0.0, 1)]
)
def test_a_hold_is_integrated_once_between_two_edges(torque, length, parts):
    """The torque accelerates the first wheel, or stops it after 0.01 / 0.12 s and turns it."""

    def counted(t, part, plant, carry):
        return plant, (carry[0] + 1, carry[1] + part.length)

    plant = PlantState(start().attitude, OMEGA, (WheelMomenta([0.01, 0.1, 0.0]),))
    commands, hold = (jnp.array([torque, 0.0, 0.0]),), Hold(jnp.array(0.0), jnp.array(length))
    carry = (jnp.array(0), jnp.array(0.0))
    _, (count, total) = through_hold(
        body(None, None), commands, jnp.array(0.0), hold, plant, counted, carry
    )
    assert (count, total) == (parts, length)


@pytest.mark.slow
def test_a_delay_shifts_what_wheels_are_asked():
    """Half a period late is the run whose commands change in the middle of each period."""
    loop = SampledLoop(body(), Waves(PERIOD), SHARED, 4, delay=PERIOD / 2)
    found = flown(loop).signals
    commands = asked(loop)
    before = np.vstack([np.zeros((1, 3)), commands[:-1]])
    halves = np.stack([before, commands], axis=1).reshape(-1, 3)
    rows, _ = expected(halves, PERIOD / 2, np.zeros(3))
    np.testing.assert_allclose(found.omega, rows[::2, 9:12], atol=1e-11)
    np.testing.assert_allclose(found.parts["wheel_momentum"], rows[::2, 12:], atol=1e-12)


@pytest.mark.slow
def test_wheels_beside_pulses_move_as_beside_held_torques():
    """A wheel about x and a throttle, which is the same torque held, for the rest; all late."""
    delay = 0.2
    torque, axis = pairs(), np.array([[1.0], [0.0], [0.0]])
    wheels = Wheels(axis, 0.1, 0.12, coulomb_friction=0.02)
    plant = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0))
    held = Actuators.of(Thrusters(np.eye(3)), torques=3)
    throttle = PulsedThrusters(
        thruster_set(torque, 0.0), allocated(torque), IdealThrottle(), late=True
    )
    shared = WheelsFirst.of(axis, 3, 0.1, others=True)
    begin = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), OMEGA, (None, WheelMomenta([0.05])))
    method, times = fixed(PERIOD, diffrax.Dopri8()), np.arange(13) * PERIOD
    found, expected = (
        simulate(
            SampledLoop(
                plant.with_effectors((thrusters, wheels)), Waves(PERIOD), shared, 4, delay=delay
            ),
            begin,
            times,
            method=method,
        )
        for thrusters in (throttle, held)
    )
    signals, throttled = found.signals, expected.signals
    np.testing.assert_allclose(signals.omega, throttled.omega, atol=1e-11)
    for name in ("wheel_momentum", "wheel_torque"):
        np.testing.assert_allclose(signals.parts[name], throttled.parts[name], atol=1e-11)
    assert np.abs(found.signals.parts["wheel_momentum"]).max() == pytest.approx(0.12, rel=1e-12)
    for name in ("effort", "settled_from"):
        np.testing.assert_allclose(
            getattr(found.assessment, name), getattr(expected.assessment, name), rtol=1e-3
        )


class Still(AbstractSampledController):
    """No command."""

    period: Float[Array, ""] = eqx.field(converter=as_float)

    def init(self, state):
        return None

    def step(self, t, state, memory):
        return jnp.zeros(3), memory


@pytest.mark.slow
def test_a_wheel_breaks_loose_where_the_body_turns_faster():
    """Three wheels at rest in a body that tumbles: Coulomb friction holds them up to its limit, in
    the middle of periods in which nothing is asked of them."""
    omega, coulomb = np.array([0.5, 1.1, -0.4]), np.array([0.02, 0.05, 9.0])
    plant = RigidBody(
        Spacecraft(INERTIA),
        ExactOrbit(0.0),
        effectors=(Wheels(AXES, rotor_inertia=ROTOR, coulomb_friction=coulomb),),
    )
    loop = SampledLoop(plant, Still(PERIOD), SHARED, 4)
    state = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), omega)
    method, times = fixed(PERIOD, diffrax.Dopri8()), np.arange(9) * PERIOD
    found = simulate(loop, state, times, method=method).signals
    free = {"torque_limit": 1.0, "momentum_limit": np.inf, "inertia": ROTOR, "viscous": 0.0}
    rows, edges = gyrostat.fly(
        np.eye(3),
        omega,
        np.zeros(3),
        np.zeros((8, 3)),
        PERIOD,
        inertia=INERTIA,
        axes=AXES,
        wheels=[free | {"coulomb": one} for one in coulomb],
        external=lambda t: np.zeros(3),
    )
    inside = [time for time, wheel in edges if wheel < 2 and 0.01 < time % PERIOD < PERIOD - 0.01]
    assert len(inside) > 1
    np.testing.assert_allclose(found.omega, rows[:, 9:12], atol=1e-12)
    np.testing.assert_allclose(found.parts["wheel_momentum"], rows[:, 12:], atol=1e-12)
    assert not np.any(np.asarray(found.parts["wheel_momentum"])[:, 2])
    held = np.asarray(found.parts["wheel_torque"])[:, 2]  # what turns the rotor with the body
    assert np.abs(held).max() > 0.01
