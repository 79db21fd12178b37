"""The plant against Euler's equations written out, conservation laws, and SciPy."""

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from helpers.strategies import inertias, rotations, vectors
from jaxsat.control.controller import Coast
from jaxsat.core.attitude import DCM, WZ, Quaternion
from jaxsat.core.earth import circular_orbit_rate
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import fixed
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import (
    ConstantTorque,
    GravityGradient,
    NoDisturbance,
    PeriodicTorque,
    SumOfDisturbances,
)
from jaxsat.spacecraft.environment.orbit import ExactOrbit, SmallAngleOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters

ACTUATORS = Actuators.of(Thrusters(jnp.eye(3)).without([3]))
acceleration_of = eqx.filter_jit(
    lambda body, omega, torque: body.angular_acceleration(omega, torque)
)
relative_rate_of = eqx.filter_jit(lambda body, state: body.relative_rate(state))


@given(inertias(), vectors(3, 2.0), vectors(3, 20.0))
def test_euler_equation(inertia, omega, torque):
    """Equation (1): J dω/dt + ω × J ω is the torque."""
    body = RigidBody(Spacecraft(inertia), ExactOrbit(0.0011))
    rate = np.array(acceleration_of(body, jnp.array(omega), jnp.array(torque)))
    np.testing.assert_allclose(
        inertia @ rate + np.cross(omega, inertia @ omega), torque, atol=1e-10 * 4000
    )


@given(vectors(3, 2.0), vectors(3, 20.0))
def test_principal_axes_equation(omega, torque):
    """Equation (37), component by component."""
    j1, j2, j3 = 449.5, 264.6, 312.5
    body = RigidBody(Spacecraft([j1, j2, j3]), ExactOrbit(0.0011))
    w1, w2, w3 = omega
    expected = [
        ((j2 - j3) * w2 * w3 + torque[0]) / j1,
        ((j3 - j1) * w3 * w1 + torque[1]) / j2,
        ((j1 - j2) * w1 * w2 + torque[2]) / j3,
    ]
    rate = acceleration_of(body, jnp.array(omega), jnp.array(torque))
    np.testing.assert_allclose(rate, expected, atol=1e-13)


@given(inertias(), vectors(3, 2.0), vectors(3, 20.0))
def test_held_third_rate_needs_a_torque_about_the_third_axis_only(inertia, omega, torque):
    body = RigidBody(Spacecraft(inertia), ExactOrbit(0.0011), third_rate_held=True)
    rate = np.array(acceleration_of(body, jnp.array(omega), jnp.array(torque)))
    constraint = inertia @ rate + np.cross(omega, inertia @ omega) - torque
    assert rate[2] == 0
    np.testing.assert_allclose(constraint[:2], 0, atol=1e-9 * 4000)


@given(rotations(), vectors(3))
def test_relative_rate(rotation, omega):
    """Equation (11) exactly, and with C_bo replaced by the identity."""
    q = np.roll(rotation.as_quat(), 1)
    state = PlantState(Quaternion(q), omega)
    orbital = np.array([0, -0.0011, 0])
    exact = RigidBody(Spacecraft([1.0, 2.0, 2.5]), ExactOrbit(0.0011))
    np.testing.assert_allclose(
        relative_rate_of(exact, state), omega - rotation.inv().apply(orbital), atol=1e-16
    )
    approximate = RigidBody(Spacecraft([1.0, 2.0, 2.5]), SmallAngleOrbit(0.0011))
    np.testing.assert_allclose(
        relative_rate_of(approximate, state), [omega[0], omega[1] + 0.0011, omega[2]], atol=1e-16
    )


def test_orbit_rate_is_that_of_a_year_of_orbits():
    """400 km: 15.5 revolutions a day; geostationary: one a sidereal day."""
    assert abs(circular_orbit_rate(400e3) - 0.001131) < 1e-6
    assert abs(2 * np.pi / circular_orbit_rate(35_786e3) - 86_164) < 2
    with pytest.raises(ValueError, match="altitude"):
        circular_orbit_rate(-7e6)


def test_periodic_torque_is_equation_2():
    torque = PeriodicTorque([0.01, 0.02, 0.001], [0.7, 0.8, 0.1], [0.0, 0.5, -1.0])
    t = 12.3
    expected = [0.01 * np.sin(8.61), 0.02 * np.sin(9.84 + 0.5), 0.001 * np.sin(1.23 - 1)]
    attitude, inertia = WZ([0.0, 0.0], 0.0), jnp.eye(3)
    np.testing.assert_allclose(torque(jnp.array(t), attitude, inertia), expected, rtol=1e-14)
    both = SumOfDisturbances((torque, ConstantTorque([1.0, 2.0, 3.0]), NoDisturbance()))
    np.testing.assert_allclose(
        both(jnp.array(t), attitude, inertia), np.array(expected) + np.arange(1, 4), rtol=1e-14
    )


@given(inertias(), rotations())
def test_gravity_gradient_does_the_work_of_its_potential(inertia, rotation):
    """The torque is minus the slope of (3/2) ω0² nᵀ J n under small rotations of the body."""
    rate, h = 0.0011, 1e-5
    torque = GravityGradient(rate)(jnp.array(0.0), DCM(rotation.as_matrix().T), jnp.array(inertia))

    def potential(angle):
        nadir = (rotation * Rotation.from_rotvec(angle)).inv().apply([0, 0, 1])
        return 1.5 * rate**2 * nadir @ inertia @ nadir

    slope = [(potential(h * e) - potential(-h * e)) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(torque, -np.array(slope), atol=1e-11)


def coast(inertia, attitude, omega, orbit_rate=0.0):
    body = RigidBody(Spacecraft(inertia), ExactOrbit(orbit_rate))
    return ContinuousLoop(body.with_effectors((ACTUATORS,)), Coast()), PlantState(attitude, omega)


INERTIA = np.array([[400.0, 30.0, -20.0], [30.0, 250.0, 15.0], [-20.0, 15.0, 320.0]])
OMEGA = np.array([0.3, -0.5, 0.8])


def drift_of_invariants(solver, step):
    """Largest relative change of energy and of inertial angular momentum over 60 s."""
    loop, start = coast(INERTIA, Quaternion([1.0, 0, 0, 0]), OMEGA)
    run = simulate(loop, start, jnp.linspace(0, 60, 7), method=fixed(step, solver)).signals
    omega, q = np.array(run.omega), np.roll(np.array(run.quaternion), -1, axis=1)
    energy = np.einsum("ti,ij,tj->t", omega, INERTIA, omega)
    momentum = Rotation.from_quat(q).apply(omega @ INERTIA)
    return (
        np.abs(energy / energy[0] - 1).max(),
        np.abs(momentum - momentum[0]).max() / np.linalg.norm(momentum[0]),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solver", "order", "step"),
    [
        (diffrax.Heun(), 2, 0.02),
        (diffrax.Bosh3(), 3, 0.05),
        (diffrax.Dopri5(), 5, 0.2),
        (diffrax.Dopri8(), 8, 1.0),
    ],
)
def test_energy_and_momentum_drift_at_solver_order(solver, order, step):
    coarse, fine = drift_of_invariants(solver, step), drift_of_invariants(solver, step / 2)
    for large, small in zip(coarse, fine, strict=True):
        assert np.log2(large / small) > order - 0.5
    assert max(drift_of_invariants(solver, step / 16)) < 1e-6


@pytest.mark.slow
def test_symmetric_body_precesses_as_solved_by_hand():
    """J1 = J2: ω3 is constant and (ω1, ω2) turns at (J3 - J1) ω3 / J1."""
    loop, start = coast([200.0, 200.0, 300.0], Quaternion([1.0, 0, 0, 0]), [0.1, 0.0, 0.4])
    times = jnp.linspace(0, 100, 101)
    omega = simulate(loop, start, times).signals.omega
    turned = 0.5 * 0.4 * np.array(times)
    expected = np.stack([0.1 * np.cos(turned), 0.1 * np.sin(turned), np.full(101, 0.4)], axis=1)
    np.testing.assert_allclose(omega, expected, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("orbit", "held", "parameterisation"),
    [
        (ExactOrbit(0.0011), False, "as_wz"),
        (ExactOrbit(0.0011), False, "as_quaternion"),
        (ExactOrbit(0.0011), False, "as_dcm"),
        (ExactOrbit(0.0011), True, "as_quaternion"),
        (SmallAngleOrbit(0.0011), True, "as_wz"),
    ],
)
def test_attitude_parameterisations_agree_with_scipy_on_so3(orbit, held, parameterisation):
    """A driven body in orbit: (w, z), quaternion and DCM against DOP853 on the rotation matrix."""
    body = RigidBody(
        Spacecraft(INERTIA), orbit, ConstantTorque([0.3, -0.2, 0.1]), third_rate_held=held
    )
    loop = ContinuousLoop(body.with_effectors((ACTUATORS,)), Coast())
    omega0 = np.array([0.02, -0.03, 0.0 if held else 0.01])
    wz0 = WZ([0.2, -0.3], 0.4)
    times = np.linspace(0, 40, 41)

    def right_hand_side(t, y):
        c, omega = y[:9].reshape(3, 3), y[9:]
        frame = c[:, 1] if isinstance(orbit, ExactOrbit) else np.array([0, 1, 0])
        relative = omega + 0.0011 * frame
        cross = np.array(
            [
                [0, -relative[2], relative[1]],
                [relative[2], 0, -relative[0]],
                [-relative[1], relative[0], 0],
            ]
        )
        load = np.array([0.3, -0.2, 0.1]) - np.cross(omega, INERTIA @ omega)
        if held:  # unknowns: two accelerations and the constraint torque
            system = np.column_stack([INERTIA[:, :2], [0, 0, -1]])
            rate = np.array([*np.linalg.solve(system, load)[:2], 0.0])
        else:
            rate = np.linalg.solve(INERTIA, load)
        return np.concatenate([(-cross @ c).ravel(), rate])

    y0 = np.concatenate([np.array(wz0.as_dcm().matrix).ravel(), omega0])
    exact = solve_ivp(right_hand_side, (0, 40), y0, "DOP853", times, rtol=1e-12, atol=1e-13).y.T
    start = PlantState(getattr(wz0, parameterisation)(), omega0)
    run = simulate(loop, start, jnp.array(times)).signals
    np.testing.assert_allclose(run.omega, exact[:, 9:], atol=1e-12)
    matrices = Rotation.from_quat(np.roll(run.quaternion, -1, axis=1)).as_matrix()
    found = matrices.transpose(0, 2, 1).reshape(-1, 9)
    np.testing.assert_allclose(found, exact[:, :9], atol=1e-11)
