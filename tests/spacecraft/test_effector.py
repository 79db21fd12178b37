"""The interface of effectors: any number of them on one body, and one of a user's own."""

from typing import ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float
from scipy.integrate import solve_ivp

from jaxsat.control.controller import Coast
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import adaptive
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.effector import AbstractEffector, Effect
from jaxsat.spacecraft.environment.disturbances import ConstantTorque
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.steering import Steered
from jaxsat.spacecraft.wheel_failures import WheelFailures
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels

INERTIA = np.array([[5.0, 0.2, -0.1], [0.2, 4.0, 0.3], [-0.1, 0.3, 3.0]])
AXES = np.array([[1.0, 0.3, 0.0], [0.0, 1.0, 0.4], [0.2, 0.0, 1.0]])
MOMENTA = np.array([0.4, 0.0, -0.6])
OMEGA = np.array([0.3, -0.5, 0.2])
LIMITS, ROTORS, FRICTION = np.array([0.5, 0.5, 0.6]), np.array([0.1, 0.2, 0.15]), 0.02


def wheels(numbers, stops):
    """Some of three wheels, of which number `stops` seizes."""
    here = [numbers.index(stops)] if stops in numbers else []
    kinds = [WheelFailureKind.STOPPED] * len(here)
    failures = WheelFailures(here, [1.0] * len(here), kinds, [0.0] * len(here)) if here else None
    chosen = (AXES[:, numbers], 0.3, LIMITS[numbers], ROTORS[numbers], 1e-3, FRICTION)
    return Wheels(*chosen, failures)


@jax.jit
def told(bodies, states, commands, struck):
    """What a body does after failures have struck: its state, modes and rates."""
    t, found = jnp.array(0.0), []
    for body, state, command, those in zip(bodies, states, commands, struck, strict=True):
        after = body.after_failures(state, those)
        left, asked = body.driven(after, command, those)
        pieces = left.pieces(left.modes(t, after, asked), asked)
        rate, _, made = left.motion(t, after, pieces=pieces)
        own = [jnp.concatenate([x.momentum for x in y.of_each]) for y in (after, rate)]
        found.append((after.omega, rate.omega, left.total_momentum(after), made, *own))
    return found


def test_wheels_in_two_effectors_are_the_same_wheels_in_one():
    """One rests, one is at its limit, one seizes, and each drags the others through the body."""
    orbit, attitude = ExactOrbit(0.0), Quaternion([1.0, 0.0, 0.0, 0.0])
    command = jnp.array([-0.2, 0.015, 0.25])
    for strikes in (True, False):
        bodies, states, commands, struck = [], [], [], []
        for parts in ([[0, 1, 2]], [[0], [1, 2]]):
            effectors = tuple(wheels(numbers, stops=0) for numbers in parts)
            push = ConstantTorque([0.05, -0.02, 0.01])
            bodies.append(RigidBody(Spacecraft(INERTIA), orbit, push, effectors=effectors))
            momenta = tuple(WheelMomenta(MOMENTA[numbers]) for numbers in parts)
            states.append(PlantState(attitude, OMEGA, momenta))
            commands.append(tuple(command[np.array(numbers)] for numbers in parts))
            struck.append(tuple(jnp.full(one.failure_times.shape, strikes) for one in effectors))
        one, two = told(bodies, states, commands, struck)
        for first, second in zip(one, two, strict=True):
            np.testing.assert_allclose(second, first, rtol=1e-13, atol=1e-15)
        assert (np.asarray(one[4])[0] == 0.0) == strikes
        np.testing.assert_array_equal(np.asarray(one[5])[2], 0.0)  # held at its limit


class BallDamper(AbstractEffector):
    """A ball in a viscous fluid: D = -I 1, τ = c h / I + ω × h, dh/dt = -τ - I dω/dt."""

    kind: ClassVar[str] = "damper"

    inertia: Float[Array, ""] = eqx.field(converter=as_float)
    friction: Float[Array, ""] = eqx.field(converter=as_float)
    failures: None = None

    @property
    def count(self):
        return 1

    def init(self):
        return jnp.zeros(3)

    def momentum(self, state):
        return state

    def free_inertia(self):
        return -self.inertia * jnp.eye(3)

    def driven(self, state, command, struck):
        return self, command

    def piece(self, mode, command):
        return None

    def effect(self, piece, t, plant, state):
        torque = self.friction / self.inertia * state + jnp.cross(plant.omega, state)
        return Effect(torque, self.free_inertia())

    def derivative(self, piece, plant, state, acceleration):
        return -self.effect(piece, None, plant, state).torque - self.inertia * acceleration


def test_what_devices_store_is_their_rotors_and_limits():
    rotors, capacity = wheels([0, 2], 0).storage()
    np.testing.assert_array_equal(rotors, ROTORS[[0, 2]])
    np.testing.assert_array_equal(capacity, LIMITS[[0, 2]])
    rotors, capacity = Wheels(AXES).storage()
    assert (list(rotors), list(capacity)) == ([0.0] * 3, [np.inf] * 3)


@pytest.mark.slow
def test_an_effector_of_a_users_own_flies():
    """Against SciPy, which integrates body and ball each with its own angular momentum."""
    ball, friction = 0.4, 0.3
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(BallDamper(ball, friction),))
    start = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), OMEGA)
    times = np.linspace(0.0, 20.0, 6)
    loop = ContinuousLoop(body, Coast(), Steered())
    found = simulate(loop, start, times, method=adaptive(1e-11, 1e-12, diffrax.Dopri8()))
    assert int(found.code) == 0

    def rate(t, y):
        omega, spun = y[:3], y[3:]
        torque = friction * (spun - omega)  # of the fluid on the body
        shell = INERTIA - ball * np.eye(3)
        alone = np.linalg.solve(shell, torque - np.cross(omega, shell @ omega))
        return np.concatenate([alone, -torque / ball - np.cross(omega, spun)])

    exact = solve_ivp(rate, (0, 20), [*OMEGA, *OMEGA], "DOP853", times, rtol=1e-12, atol=1e-13).y
    np.testing.assert_allclose(found.signals.omega, exact[:3].T, atol=1e-9)
    stored = ball * (exact[3:] - exact[:3])[:, -1]
    np.testing.assert_allclose(found.final.plant.effectors[0], stored, atol=1e-9)
