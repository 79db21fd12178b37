"""The law of magnetorquers: gains, damping and a flight, against SciPy."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are
from scipy.spatial.transform import Rotation

from jaxsat.control.linear_motion import PHASES, TURNS, linear_motion
from jaxsat.control.magnetic import MagneticMode
from jaxsat.control.periodic_gain import FLOOR, floquet_multipliers, periodic_gain
from jaxsat.core.attitude import Quaternion
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField
from jaxsat.spacecraft.magnetorquers import NEAREST
from jaxsat.spacecraft.spacecraft import PlantState
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels, wheel_momentum
from oracle import magnetic as oracle
from oracle.orbital_torques import EARTH_ROTATION

INERTIA = np.array([0.13, 0.11, 0.05])
RATE = 1.1e-3
PLACE = (1.2, 0.4, 0.7, 2.0)
"""Inclination, node, argument of latitude and sidereal angle, rad."""


PITCH = np.array([0.0, 1.0, 0.0])
BIAS, UNLOADING = -5e-3 * PITCH, 3e-4
"""Momentum of a wheel, N m s, and 1/s."""


ALL = np.eye(3)
ACROSS = np.array([0.6, 0.0, 0.8])
TWO = ALL - np.outer(ACROSS, ACROSS)
X_AND_Z = np.diag([1.0, 0.0, 1.0])
"""What the axes of magnetorquers span."""


def motion_of(wheel, working=ALL, spanned=ALL):
    field = DipoleField(CircularOrbit(RATE, *PLACE))
    unmade = np.eye(3) - wheel * np.outer(PITCH, PITCH)
    momentum, unloading = wheel * BIAS, UNLOADING
    return linear_motion(
        np.diag(INERTIA),
        field,
        unmade,
        momentum,
        dipoles=working,
        missing=ALL - spanned,
        unloading=unloading,
        gravity_gradient=True,
    )


def motion(x, momentum):
    """dθ/dt and dω_r/dt of a body with wheels near rest in the orbit frame, by hand."""
    turn, relative = x[:3], x[3:]
    c = np.eye(3) - oracle.cross(turn)
    frame, nadir = c @ [0, -RATE, 0], c @ [0, 0, 1]
    omega = relative + frame
    total = -np.cross(omega, INERTIA * omega + momentum)
    total = total + 3 * RATE**2 * np.cross(nadir, INERTIA * nadir)
    return np.concatenate([relative, total / INERTIA + np.cross(relative, frame)])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wheel", "spanned", "working", "falls"),
    [(False, ALL, ALL, True), (True, TWO, TWO, True), (False, ALL, X_AND_Z, False)],
)
def test_errors_fall_in_an_orbit_as_the_multipliers_tell(wheel, spanned, working, falls):
    """The motion is differentiated numerically, and SciPy carries it over an orbit.

    The gains may be those of magnetorquers of which one has died since: gravity gradient wins.
    """
    linear, count = motion_of(wheel, working, spanned), 6 + wheel
    gain = periodic_gain(motion_of(wheel, spanned, spanned), 0.3, 0.01)
    turn, table = 3, np.asarray(gain.gains)[3]
    told = floquet_multipliers(linear, gain)
    step = np.array([1e-3] * 3 + [1e-3 * RATE] * 3 + [1e-6])[:count]
    axes = np.asarray(gain.basis)  # of the wheel, either way
    unmade = np.eye(3) - axes @ axes.T

    def free(x):
        return motion(x[:6], wheel * BIAS + axes @ x[6:])

    ends = [[free(way * x) for x in np.diag(step)] for way in (1, -1)]
    slope = np.zeros((count, count))
    slope[:6] = (np.array(ends[0]) - np.array(ends[1])).T / 2 / step

    def rate(t, columns):
        angle = turn * 2 * np.pi / TURNS - EARTH_ROTATION * t
        field = oracle.field(t, (RATE, *PLACE[:3], PLACE[3] + angle))
        b = field / np.linalg.norm(field)
        place = t * RATE * PHASES / (2 * np.pi)
        low, share = int(place) % PHASES, place % 1
        k = table[low] * (1 - share) + table[(low + 1) % PHASES] * share
        x = columns.reshape(count, count)
        wanted = -k[:, :count] @ x
        dipole = np.cross(b, (unmade @ wanted[:3] - UNLOADING * axes @ x[6:]).T).T
        if spanned is TWO:  # along the field nothing is made: that turns the rest into the plane
            sine = ACROSS @ b
            dipole = dipole - np.outer(b, ACROSS @ dipole) * (sine / (sine**2 + NEAREST**2))
        dipole = working @ dipole
        made = np.cross(dipole.T, b).T
        wheels = wanted[3:] - axes.T @ made
        change = slope @ x
        change[3:6] += (made + axes @ wheels) / INERTIA[:, None]
        change[6:] -= wheels
        return change.ravel()

    x = np.diag(step).ravel()  # errors of these sizes
    for phase in range(PHASES):  # the gain has a corner at each
        span = np.array([phase, phase + 1]) * 2 * np.pi / (PHASES * RATE)
        span[1] *= 1 - 1e-14
        x = solve_ivp(rate, span, x, "DOP853", rtol=1e-8, atol=1e-16).y[:, -1]
    values = np.linalg.eigvals(x.reshape(count, count) / step)
    values = values[np.argsort(-np.abs(values))]
    assert (np.abs(values).max() < 0.5) == (np.abs(values).max() < 1) == falls
    np.testing.assert_allclose(np.abs(values), np.abs(told[turn]), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("wheel", [False, True])
def test_gains_of_a_field_that_stands_are_those_of_an_algebraic_riccati_equation(wheel):
    """K of errors by SciPy, and what counters a constant torque by linear equations."""
    weight, wheel_weight, b = 0.2, 0.05, np.array([0.8, 0.36, 0.48])
    across = np.eye(3) - np.outer(b, b)
    linear = motion_of(wheel)
    linear = linear._replace(across=np.broadcast_to(across, linear.across.shape))
    gain = periodic_gain(linear, weight, wheel_weight)
    state, g = linear.free[0, 0], linear.stiffness
    count, axes, weight = len(state), linear.basis, weight / linear.stiffness**2
    by_dipoles, near = np.zeros((count, 3)), np.zeros((count, 3))
    near[3:6] = np.sqrt(FLOOR) * linear.inverse @ linear.unmade
    by_dipoles[3:6] = linear.inverse @ linear.unmade @ oracle.cross(b)
    inputs = np.concatenate([by_dipoles, near, linear.wheels], axis=1)
    weights = np.diag([weight] * 6 + [wheel_weight] * axes.shape[1])
    costs = np.diag([1.0] * 3 + [g**-2] * 3 + [0.0] * axes.shape[1])
    riccati = solve_continuous_are(state, inputs, costs, weights)
    torque = np.zeros((count, 3))
    torque[3:6] = linear.inverse
    closed = state - inputs @ np.linalg.solve(weights, inputs.T @ riccati)
    riccati = np.concatenate([riccati, np.linalg.solve(closed.T, -riccati @ torque)], axis=1)
    moment = linear.moment * RATE
    units = np.repeat([moment * RATE, moment, RATE, 1.0], [3, 3, axes.shape[1], 3])
    found = np.asarray(gain.gains)[5, 30] / units
    np.testing.assert_allclose(found, np.asarray(gain.gains)[0, 3] / units, rtol=1e-5, atol=1e-7)
    dipole = oracle.cross(b) @ found[:3]  # of what the law asks
    expected = -by_dipoles.T @ riccati / weight
    np.testing.assert_allclose(dipole, expected, rtol=2e-4, atol=1e-3)
    expected = linear.wheels.T @ riccati / wheel_weight
    np.testing.assert_allclose(found[3:], expected, rtol=2e-4, atol=1e-3)


@pytest.mark.parametrize("factor", [2.0, 2.0**6, 2.0**20, 2.0**-20])
def test_the_motion_is_the_same_in_every_unit_of_mass(factor):
    """Powers of two round nothing, so the gains that follow from it agree in the last bit."""
    field, unmade = DipoleField(CircularOrbit(RATE, *PLACE)), np.eye(3) - np.outer(PITCH, PITCH)
    one, other = (
        linear_motion(mass * np.diag(INERTIA), field, unmade, mass * BIAS, gravity_gradient=True)
        for mass in (1.0, factor)
    )
    assert other.moment == factor * one.moment
    assert one.moment == pytest.approx(np.prod(INERTIA) ** (1 / 3), rel=1e-14)
    for name in ("inverse", "state", "across", "stiffness"):
        np.testing.assert_array_equal(getattr(other, name), getattr(one, name))


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
    changes.append("spacecraft.inertia_kg_m2=[0.05, 0.12, 0.13]")
    table = 'control={law="fault-tolerant", natural_frequency_rad_s=0.02, period_s=2.0}'
    for own in ([], [table]):
        with pytest.raises(ScenarioError, match=r"can hold all axes by magnetorquers.*Floquet"):
            load("rods-only", [*changes, *own])
    with pytest.raises(ScenarioError, match='must have one that works under the law "magnetic"'):
        load("cubesat-12u", ["control={law='magnetic'}"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "samples", "degrees", "rate"),
    [("rods-only", 14250, 4.5, 2e-4), ("wheel-and-rods", 6000, 0.4, 2e-5)],
)
def test_a_tumble_is_stopped_and_three_axes_are_held(name, samples, degrees, rate):
    """Orbits of the scenario's body and disturbances, in one loop of Runge-Kutta steps by hand."""
    run = build(load(name))
    law, plant, start = run.loop.controller, run.loop.plant, run.start
    inertia, period = plant.spacecraft.inertia, float(law.period)
    limit = np.asarray(law.steering.dipole_limit)
    wheels = next((one for one in plant.effectors if isinstance(one, Wheels)), None)
    axes = np.zeros((3, 0)) if wheels is None else np.asarray(wheels.axes)

    def sample(carry, number):
        (q, omega, stored), memory = carry
        t = number * period
        state = PlantState(Quaternion(q), omega, (WheelMomenta(stored),))
        torque, memory = law.step(t, state, memory)
        field = law.steering.field.in_body(t, state.attitude)
        wanted = torque - axes @ (axes.T @ torque)
        wanted = wanted - law.steering.unloading * (axes @ stored - law.steering.bias)
        dipole = jnp.clip(jnp.cross(field, wanted) / jnp.sum(field**2), -limit, limit)
        wheel = axes.T @ (torque - jnp.cross(dipole, field))

        def slope(later, q, omega, stored):
            now = Quaternion(q)
            total = jnp.cross(dipole, law.steering.field.in_body(later, now)) + axes @ wheel
            total = total + plant.disturbance(later, now, inertia)
            total = total - jnp.cross(omega, inertia @ omega + axes @ stored)
            relative = omega - plant.orbit.frame_rate(now)
            return now.rate(relative).q, jnp.linalg.solve(inertia, total), -wheel

        half, y = period / 2, (q, omega, stored)
        first = slope(t, *y)
        second = slope(t + half, *jax.tree.map(lambda a, b: a + half * b, y, first))
        third = slope(t + half, *jax.tree.map(lambda a, b: a + half * b, y, second))
        last = slope(t + period, *jax.tree.map(lambda a, b: a + period * b, y, third))
        slopes = zip(first, second, third, last, strict=True)
        y = [
            a + period / 6 * (b + 2 * c + 2 * d + e)
            for a, (b, c, d, e) in zip(y, slopes, strict=True)
        ]
        y = (y[0] / jnp.sqrt(jnp.sum(y[0] ** 2)), *y[1:])
        return (y, memory), (*y, memory.mode)

    momenta = jnp.zeros(0) if wheels is None else wheel_momentum(start)
    begin = (start.attitude.q, start.omega, momenta)
    fly = jax.jit(
        lambda: jax.lax.scan(sample, (begin, law.init(start)), jnp.arange(float(samples)))[1]
    )
    quaternion, omega, stored, mode = (np.asarray(one) for one in fly())
    assert mode[0] == MagneticMode.DAMPING
    assert set(mode) == set(MagneticMode)
    last = slice(-2850, None)  # an orbit
    assert np.all(mode[last] == MagneticMode.POINTING)
    assert 2 * np.linalg.norm(quaternion[last, 1:], axis=1).max() < np.radians(degrees)
    assert np.abs(omega[last] - [0, -float(plant.orbit.rate), 0]).max() < rate
    if wheels is not None:
        bias = -float(law.steering.bias[1])
        np.testing.assert_allclose(stored[last], bias, rtol=0.2)
        assert np.abs(stored).max() < np.asarray(wheels.momentum_limit).min()
