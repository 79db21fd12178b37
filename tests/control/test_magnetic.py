"""The law of magnetorquers: gains, damping and a flight, against SciPy."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are
from scipy.spatial.transform import Rotation

from jaxsat.control.magnetic import MagneticMode
from jaxsat.control.periodic_gain import (
    FLOOR,
    PHASES,
    STEPS,
    TURNS,
    floquet_multipliers,
    linear_motion,
    periodic_gain,
)
from jaxsat.core.attitude import Quaternion
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField
from jaxsat.spacecraft.spacecraft import PlantState
from oracle import magnetic as oracle
from oracle.orbital_torques import EARTH_ROTATION

INERTIA = np.array([0.13, 0.11, 0.05])
RATE = 1.1e-3
PLACE = (1.2, 0.4, 0.7, 2.0)
"""Inclination, node, argument of latitude and sidereal angle, rad."""


def motion_of(unmade=None, momentum=(0.0, 0.0, 0.0)):
    field = DipoleField(CircularOrbit(RATE, *PLACE))
    unmade = np.eye(3) if unmade is None else unmade
    return linear_motion(np.diag(INERTIA), field, unmade, np.array(momentum), gravity_gradient=True)


def motion(t, x, torque, momentum):
    """dθ/dt and dω_r/dt of a body with wheels near rest in the orbit frame, by hand."""
    turn, relative = x[:3], x[3:]
    c = np.eye(3) - oracle.cross(turn)
    frame, nadir = c @ [0, -RATE, 0], c @ [0, 0, 1]
    omega = relative + frame
    total = torque - np.cross(omega, INERTIA * omega + momentum)
    total = total + 3 * RATE**2 * np.cross(nadir, INERTIA * nadir)
    return np.concatenate([relative, total / INERTIA + np.cross(relative, frame)])


@pytest.mark.parametrize("wheel", [False, True])
def test_errors_fall_in_an_orbit_as_the_multipliers_tell(wheel):
    """The motion is differentiated numerically, and SciPy carries it over an orbit."""
    axis = np.array([0.0, 1.0, 0.0])
    unmade = np.eye(3) - wheel * np.outer(axis, axis)
    momentum = -5e-4 * wheel * axis
    linear = motion_of(unmade, momentum)
    gain = periodic_gain(linear, 0.3)
    turn, table = 3, np.asarray(gain.gains)[3]
    told = floquet_multipliers(linear, gain)
    step = np.array([1e-3] * 3 + [1e-3 * RATE] * 3)
    ends = [[motion(0, way * x, np.zeros(3), momentum) for x in np.diag(step)] for way in (1, -1)]
    free = (np.array(ends[0]) - np.array(ends[1])).T / 2 / step

    def rate(t, columns):
        angle = turn * 2 * np.pi / TURNS - EARTH_ROTATION * t
        field = oracle.field(t, (RATE, *PLACE[:3], PLACE[3] + angle))
        b = field / np.linalg.norm(field)
        made = np.eye(3) - unmade + unmade @ (np.eye(3) - np.outer(b, b)) @ unmade
        place = t * RATE * PHASES / (2 * np.pi)
        low, share = int(place) % PHASES, place % 1
        k = table[low] * (1 - share) + table[(low + 1) % PHASES] * share
        change = free.copy()
        change[3:] -= made @ k[:, :6] / INERTIA[:, None]
        return (change @ columns.reshape(6, 6)).ravel()

    x = np.diag(step).ravel()  # errors of these sizes
    for phase in range(PHASES):  # the gain has a corner at each
        span = np.array([phase, phase + 1]) * 2 * np.pi / (PHASES * RATE)
        span[1] *= 1 - 1e-14
        x = solve_ivp(rate, span, x, "DOP853", rtol=1e-8, atol=1e-16).y[:, -1]
    values = np.linalg.eigvals(x.reshape(6, 6) / step)
    values = values[np.argsort(-np.abs(values))]
    assert np.abs(values).max() < 0.5
    np.testing.assert_allclose(np.abs(values), np.abs(told[turn]), atol=1e-6)


def test_gains_of_a_field_that_stands_are_those_of_an_algebraic_riccati_equation():
    """K of angles and rates by SciPy, and what counters a constant torque by linear equations."""
    linear, weight = motion_of(), 0.2
    made = np.diag([0.8, 0.6, 0.9])
    reach = np.broadcast_to(made, (TURNS, 2 * PHASES * STEPS + 1, 3, 3))
    gain = periodic_gain(linear._replace(reach=reach), weight)
    inputs = np.concatenate([np.zeros((3, 3)), linear.inverse])
    into = inputs @ (made + FLOOR * np.eye(3)) @ inputs.T / weight
    half = np.linalg.cholesky(made + FLOOR * np.eye(3))
    riccati = solve_continuous_are(linear.state, inputs @ half, np.eye(6), weight * np.eye(3))
    held = np.linalg.solve((linear.state - into @ riccati).T, -riccati @ inputs)
    expected = linear.inverse @ np.concatenate([riccati[3:], held[3:]], axis=1) / weight
    units = linear.moment * RATE * np.repeat([RATE, 1.0, 1 / linear.moment / RATE], 3)
    found = np.asarray(gain.gains)[[0, 5], [3, 30]] / units
    np.testing.assert_allclose(found, np.stack([expected, expected]), rtol=2e-4, atol=1e-3)


@pytest.fixture(scope="module")
def law():
    return build(load("rods-only")).loop.controller


def test_a_tumble_is_damped_by_a_dipole_against_the_change_of_the_field(law):
    """In the loop with SciPy between samples: the energy falls as the dipole's torque tells."""
    law = dataclasses.replace(law, period=jnp.array(5.0))
    step = jax.jit(lambda t, q, omega, memory: law.step(t, state_of(q, omega), memory))
    q, omega = np.array([0.8, 0.6, 0.0, 0.0]), np.array([0.06, -0.05, 0.04])
    memory, rate = law.init(state_of(q, omega)), float(law.steering.field.orbit.rate)
    orbit = law.steering.field.orbit
    angles = [float(getattr(orbit, one)) for one in ("inclination", "node")]
    place = (rate, *angles, float(orbit.argument_of_latitude), float(orbit.sidereal_angle))
    least, energies = 2 * rate * INERTIA.min(), []
    for number in range(60):
        t = 5.0 * number
        torque, memory = step(t, q, omega, memory)
        assert int(memory.mode) == MagneticMode.DAMPING
        c = Rotation.from_quat(q, scalar_first=True).as_matrix().T
        field = c @ oracle.field(t, place)
        relative = omega - c @ [0, -rate, 0]
        dipole = np.cross(field, torque) / (field @ field)
        slope = -np.cross(relative, field)  # of the field in the body, but for the orbit's motion
        gain = -(dipole @ slope) / (slope @ slope)
        np.testing.assert_allclose(dipole, -gain * slope, rtol=1e-9, atol=1e-15)
        assert least < gain * (field @ field) < 2 * least

        def moved(_, y, torque):
            turn = Rotation.from_quat(y[:4] / np.linalg.norm(y[:4]), scalar_first=True)
            spin = y[4:] - turn.as_matrix().T @ [0, -rate, 0]
            w, v = y[0], y[1:4]
            change = np.concatenate([[-v @ spin], w * spin + np.cross(v, spin)]) / 2
            return np.concatenate([change, (torque - np.cross(y[4:], INERTIA * y[4:])) / INERTIA])

        made = np.cross(dipole, field)
        y = solve_ivp(moved, (0, 5), [*q, *omega], args=(made,), rtol=1e-8, atol=1e-12).y[:, -1]
        q, omega = y[:4] / np.linalg.norm(y[:4]), y[4:]
        energies.append(np.sum(INERTIA * omega**2) / 2)
    assert energies[-1] < 0.8 * energies[0]


def state_of(q, omega):
    return PlantState(Quaternion(jnp.asarray(q)), jnp.asarray(omega))


def test_it_is_told_where_magnetorquers_do_not_hold_a_body():
    """One that gravity gradient turns over, in an orbit that is at times the magnetic equator's."""
    changes = ["orbit.inclination_rad=0.1642", "orbit.ascending_node_rad=3.44"]
    with pytest.raises(ScenarioError, match=r"can hold all axes by magnetorquers.*Floquet"):
        load("rods-only", [*changes, "spacecraft.inertia_kg_m2=[0.05, 0.12, 0.13]"])
    with pytest.raises(ScenarioError, match='must have one that works under the law "magnetic"'):
        load("cubesat-12u", ["control={law='magnetic'}"])


@pytest.mark.slow
def test_a_tumble_is_stopped_and_three_axes_are_held(law):
    """Five orbits of the scenario's body and disturbances, in one loop of Runge-Kutta steps."""
    run = build(load("rods-only"))
    plant, limit, period = run.loop.plant, np.asarray(law.steering.dipole_limit), float(law.period)

    def sample(carry, number):
        (q, omega), memory = carry
        t, state = number * period, state_of(q, omega)
        torque, memory = law.step(t, state, memory)
        field = law.steering.field.in_body(t, state.attitude)
        dipole = jnp.clip(jnp.cross(field, torque) / jnp.sum(field**2), -limit, limit)

        def rate(later, q, omega):
            now = state_of(q, omega)
            made = jnp.cross(dipole, law.steering.field.in_body(later, now.attitude))
            moved = plant.rate(later, now, made)
            return moved.attitude.q, moved.omega

        half, y = period / 2, (q, omega)
        first = rate(t, *y)
        second = rate(t + half, *jax.tree.map(lambda a, b: a + half * b, y, first))
        third = rate(t + half, *jax.tree.map(lambda a, b: a + half * b, y, second))
        last = rate(t + period, *jax.tree.map(lambda a, b: a + period * b, y, third))
        slopes = zip(first, second, third, last, strict=True)
        y = [
            a + period / 6 * (b + 2 * c + 2 * d + e)
            for a, (b, c, d, e) in zip(y, slopes, strict=True)
        ]
        y = (y[0] / jnp.sqrt(jnp.sum(y[0] ** 2)), y[1])
        return (y, memory), (*y, memory.mode)

    start = run.start
    begin = (start.attitude.q, start.omega)
    fly = jax.jit(lambda: jax.lax.scan(sample, (begin, law.init(start)), jnp.arange(14250.0))[1])
    quaternion, omega, mode = (np.asarray(one) for one in fly())
    assert mode[0] == MagneticMode.DAMPING
    assert set(mode) == set(MagneticMode)
    last = slice(11400, None)
    assert np.all(mode[last] == MagneticMode.POINTING)
    assert 2 * np.linalg.norm(quaternion[last, 1:], axis=1).max() < np.radians(4.5)
    assert np.abs(omega[last] - [0, -1.0948e-3, 0]).max() < 2e-4
