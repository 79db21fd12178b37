"""Pulses, wheels and the gravity gradient against Basilisk, where it is installed."""

import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float
from scipy.spatial.transform import Rotation

from helpers.basilisk import basilisk
from helpers.thruster_layouts import allocated, canted, thruster_set
from helpers.tools import needs
from jaxsat.control.controller import Coast
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import adaptive
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.distribution import WheelsFirst
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import GravityGradient
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.modulation import PulseWidth
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels

pytestmark = [
    pytest.mark.slow,
    needs("Basilisk"),
]

INERTIA = np.array([[0.30, 0.01, -0.02], [0.01, 0.55, 0.015], [-0.02, 0.015, 0.62]])
START = np.array([0.8, 0.1, -0.5, 0.3]) / np.linalg.norm([0.8, 0.1, -0.5, 0.3])
OMEGA = [0.02, -0.03, 0.01]


class Schedule(AbstractSampledController):
    """A row of torques (N m) for each period, whatever is measured."""

    rows: Float[Array, "periods 3"]
    period: Float[Array, ""]

    def init(self, state):
        return jnp.array(0)

    def step(self, t, state, memory):
        return self.rows[memory], memory + 1


def found(name, **given):
    """Quaternions from inertial to body axes and rates (rad/s) of a run of Basilisk."""
    mrp = START[1:] / (1 + START[0])
    given = {"sigma": mrp.tolist(), "omega": OMEGA, "inertia": INERTIA.tolist()} | given
    states = np.array(basilisk("basilisk_runs.py", name, given))
    sigma, omega = states[:, 0], states[:, 1]
    square = np.sum(sigma**2, axis=1, keepdims=True)
    return np.concatenate([1 - square, 2 * sigma], axis=1) / (1 + square), omega


def turn_between(one, other):
    """The angle between attitudes, rad."""
    return 2 * np.arccos(np.clip(np.abs(np.sum(one * other, axis=1)), 0, 1))


def commands(count, size, seed):
    return size * np.random.default_rng(seed).uniform(-1, 1, (count, 3))


def test_pulses():
    """Basilisk sees the end of a pulse at its own steps: each is off by less than one of them."""
    torque, forces = canted()
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    positions = np.array(corners) * (0.1, 0.1, 0.15)
    period, count, step = 0.2, 60, 2e-4
    law = Schedule(jnp.asarray(commands(count + 1, 3e-3, 1)), jnp.array(period))
    actuators = PulsedThrusters(thruster_set(torque, 0.01), allocated(torque), PulseWidth())
    loop = SampledLoop(
        RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0)).with_effectors((actuators,)), law
    )
    run = simulate(loop, PlantState(Quaternion(START), OMEGA), np.arange(count + 1) * period)
    on_times = np.asarray(run.signals.parts["thrust_level"])[:count] * period
    given = {"period": period, "step": step, "on_times": on_times.tolist()}
    given |= {"positions": positions.tolist(), "forces": forces.T.tolist()}
    attitude, omega = found("thrusters", **given)
    pulses = np.cumsum(np.count_nonzero(on_times, axis=1))[:, None]
    most = np.abs(np.linalg.inv(INERTIA) @ torque).max() * step * pulses
    moved = np.abs(np.asarray(run.signals.omega)[1:] - OMEGA).max()
    off = np.abs(np.asarray(run.signals.omega)[1:] - omega)
    assert np.all(off < most)
    assert off.max() < 0.02 * moved
    assert turn_between(attitude, np.asarray(run.signals.quaternion)[1:]).max() < 1e-3


@pytest.mark.parametrize("friction", [{}, {"fCoulomb": 2e-4, "cViscous": 3e-6}])
def test_wheels(friction):
    """In the variables of a user: inertia with the wheels locked, momenta relative to the body."""
    axes = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    rotor, speeds = 2e-2, np.array([20.0, -15.0, 9.0])
    period, count, step = 0.5, 80, 0.005
    motors = commands(count + 1, 2e-3, 2)
    coulomb, viscous = (friction.get(key, 0.0) for key in ("fCoulomb", "cViscous"))
    wheels = Wheels(
        axes, rotor_inertia=rotor, viscous_friction=viscous, coulomb_friction=coulomb or None
    )
    plant = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(wheels,))
    law = Schedule(jnp.asarray(-motors @ axes.T), jnp.array(period))
    loop = SampledLoop(plant, law, WheelsFirst.of(axes, 3), substeps=8)
    start = PlantState(Quaternion(START), OMEGA, (WheelMomenta(rotor * speeds),))
    run = simulate(loop, start, np.arange(count + 1) * period)
    given = {"period": period, "step": step, "torques": motors[:count].tolist()}
    given |= {"axes": axes.T.tolist(), "rotor": rotor, "speeds": speeds.tolist()}
    given["friction"] = friction | ({"useRWfriction": True} if friction else {})
    attitude, omega = found("wheels", **given)
    np.testing.assert_allclose(run.signals.omega[1:], omega, atol=1e-11)
    assert turn_between(attitude, np.asarray(run.signals.quaternion)[1:]).max() < 1e-7


def test_gravity_gradient():
    """Half an orbit of a spacecraft that nothing else turns."""
    rate, times = 0.0011, np.linspace(0, 2800, 15)
    orbit = ExactOrbit(rate)
    plant = RigidBody(Spacecraft(INERTIA), orbit, GravityGradient(jnp.array(rate)))
    still = Actuators.of(Thrusters(jnp.eye(3)))
    loop = ContinuousLoop(plant.with_effectors((still,)), Coast())
    at_start = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])  # orbit axes as rows
    inertial = Rotation.from_quat(START[[1, 2, 3, 0]])  # whose inverse turns components into body
    relative = (Rotation.from_matrix(at_start) * inertial).as_quat()[[3, 0, 1, 2]]
    omega = [0.001, -0.002, 0.0015]
    run = simulate(
        loop, PlantState(Quaternion(relative), omega), times, method=adaptive(1e-11, 1e-12)
    )
    attitude, rates = found(
        "gravity-gradient", rate=rate, times=times[1:].tolist(), step=0.5, omega=omega
    )
    np.testing.assert_allclose(run.signals.omega[1:], rates, atol=1e-11)
    turned = Rotation.from_rotvec(np.outer(-rate * times[1:], [0, 0, 1]))
    there = [
        (Rotation.from_matrix(at_start) * back * Rotation.from_quat(q[[1, 2, 3, 0]])).as_quat()
        for back, q in zip(turned, attitude, strict=True)
    ]
    ours = np.asarray(run.signals.quaternion)[1:]
    assert turn_between(np.array(there)[:, [3, 0, 1, 2]], ours).max() < 1e-6
    without = np.abs(rates - omega).max()
    assert without > 1e-4
