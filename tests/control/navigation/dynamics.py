"""Tumbling bodies under random torques, and a filter by the dynamics that watches them."""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from control.navigation.motion import ORBIT_RATE, relative
from jaxsat.control.navigation.dynamics_filter import DynamicsFilter, TorqueModel
from jaxsat.control.navigation.navigation import Navigation
from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels

PERIOD = 0.5
INERTIA = np.array([[10.0, 0.3, -0.2], [0.3, 12.0, 0.4], [-0.2, 0.4, 8.0]])
ATTITUDE_SIGMA, RATE_SIGMA = 0.01, 0.005
TORQUES = TorqueModel(noise=2e-4, sigma=5e-4, walk=2e-6)
AXES = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0] / np.sqrt(3)]).T


class Flights(NamedTuple):
    """Several flights: truth and commands at samples, (cases, samples, ...)."""

    omega: np.ndarray
    quaternion: np.ndarray
    torque: np.ndarray  # commanded, up to the sample
    unknown: np.ndarray
    momentum: np.ndarray  # of each wheel


def body(wheels=0):
    effectors = (Wheels(AXES[:, :wheels]),) if wheels else ()
    return RigidBody(Spacecraft(INERTIA), ExactOrbit(ORBIT_RATE), effectors=effectors)


def moved(omega, q, h, torque, spin_up, axes, length, steps=5):
    """Rates, inertial attitudes (scalar last) and momenta of all cases after `length` s, by RK4."""

    def rate(omega, q, h):
        total = omega @ INERTIA + h @ axes.T
        change = torque - spin_up @ axes.T - np.cross(omega, total)
        vector, scalar = q[:, :3], q[:, 3:]
        turn = np.concatenate(
            [scalar * omega + np.cross(vector, omega), -np.sum(vector * omega, 1)[:, None]], 1
        )
        return change @ np.linalg.inv(INERTIA), turn / 2, spin_up

    state, step = (omega, q, h), length / steps

    def after(state, rates, time):
        return tuple(x + time * dx for x, dx in zip(state, rates, strict=True))

    for _ in range(steps):
        a = rate(*state)
        b = rate(*after(state, a, step / 2))
        c = rate(*after(state, b, step / 2))
        d = rate(*after(state, c, step))
        for rates, share in ((a, 6), (b, 3), (c, 3), (d, 6)):
            state = after(state, rates, step / share)
    return state


def flights(cases, samples, wheels=0, torques=TORQUES, seed=1, size=0.01):
    """Flights from random rates, pushed by thrusters of 0.02 N m and by wheels."""
    rng = np.random.default_rng(seed)
    normal, axes = rng.normal, AXES[:, :wheels]
    times = PERIOD * np.arange(samples)
    q = np.tile(Rotation.from_rotvec([0.3, -0.5, 0.8]).as_quat(), (cases, 1))
    frame = Rotation.from_quat(q).inv().apply([0.0, -ORBIT_RATE, 0.0])
    omega = frame + RATE_SIGMA * normal(size=(cases, 3))
    h = 0.5 * normal(size=(cases, wheels))
    unknown = float(torques.sigma) * normal(size=(cases, 3))
    commanded = np.zeros((cases, 3))
    rows = []
    for _ in range(samples):
        rows.append((omega, q, commanded, unknown, h))
        commanded = 2 * size * rng.choice([-1, 0, 1], (cases, 3))
        noise = float(torques.noise) / np.sqrt(PERIOD) * normal(size=(cases, 3))
        spin_up = size * normal(size=(cases, wheels))
        total = commanded + unknown + noise
        omega, q, h = moved(omega, q, h, total, spin_up, axes, PERIOD)
        unknown = unknown + float(torques.walk) * np.sqrt(PERIOD) * normal(size=(cases, 3))
    found = [np.stack(one, 1) for one in zip(*rows, strict=True)]
    found[1] = np.stack([relative(Rotation.from_quat(one), times) for one in found[1]], 0)
    return Flights(*found)


def navigation_of(
    tracker=None,
    vectors=(),
    wheels=0,
    noise=0.0,
    torques=TORQUES,
    test=None,
    failures=None,
    gyro=None,
):
    model = body(wheels)
    latency = 0 if not vectors else max(one.latency for one in vectors)
    covariance = AXES[:, :wheels] @ AXES[:, :wheels].T * noise**2 if noise else None
    deviations = tuple(one.noise for one in vectors)
    estimator = DynamicsFilter(
        *(model, torques, RATE_SIGMA, tracker, deviations, latency, test, covariance),
        None if gyro is None else dataclasses.replace(gyro, failures=None),
    )
    return Navigation(
        gyro, tracker, estimator, ATTITUDE_SIGMA, body=model, failures=failures, vectors=vectors
    )


@eqx.filter_jit
def _watched(navigation, keys, flights):
    def one(key, flight):
        own = eqx.tree_at(lambda navigation: navigation.key, navigation, key)

        def state(number):
            wheels = (WheelMomenta(flight.momentum[number]),) if own.body.effectors else None
            return PlantState(Quaternion(flight.quaternion[number]), flight.omega[number], wheels)

        def sample(memory, number):
            memory = memory._replace(torque=flight.torque[number])
            estimate, after = own.step(number, jnp.array(PERIOD), state(number), memory)
            return after, (estimate, after.memory.belief, memory.bias)

        first = own.init(state(0))
        return jax.lax.scan(sample, first, jnp.arange(flight.omega.shape[0]))[1]

    return jax.vmap(one)(keys, flights)


def watched(navigation, flights, noise=0.0, seed=5):
    """Estimates, beliefs and biases of the gyro of a filter in these flights, with the noise of
    tachometers."""
    cases = len(flights.omega)
    keys = jnp.stack([jnp.arange(cases, dtype=jnp.uint32), jnp.full(cases, 7, jnp.uint32)], 1)
    drawn = noise * np.random.default_rng(seed).normal(size=flights.momentum.shape)
    measured = flights._replace(momentum=flights.momentum + drawn)
    return _watched(navigation, keys, jax.tree.map(jnp.asarray, measured))
