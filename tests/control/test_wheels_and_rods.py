"""Two wheels, and magnetorquers about the axis that they lack: against an independent program."""

import dataclasses
from types import SimpleNamespace
from typing import cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

from helpers.magnetic import document
from jaxsat.control.diagnosis.residual import Reading
from jaxsat.control.magnetic import MagneticMode
from jaxsat.control.reconfiguration import Rank
from jaxsat.control.tolerant_actuators import Sample, TolerantMode
from jaxsat.control.tolerant_magnetic import NOWHERE, TolerantMagnetic, TolerantMagneticMemory
from jaxsat.control.tolerant_rods import (
    BEARABLE,
    FULL_AT,
    HURRY,
    OVERLOAD,
    RELIEF,
    SHALLOW,
    RodMemory,
    TolerantRods,
    about,
)
from jaxsat.control.wheel_allocation import WheelsInUse
from jaxsat.core.attitude import Quaternion
from jaxsat.core.trees import Symmetric
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.magnetorquers import NEAREST
from jaxsat.spacecraft.spacecraft import PlantState
from jaxsat.spacecraft.wheels import WheelMomenta
from oracle import magnetic as oracle

RATE = 1.1e-3  # rad/s


@pytest.fixture(scope="module")
def cubesat():
    return build(load("cubesat-3w3m")).loop.controller


def mean_square(limit, orbit, count=8):
    """Of the largest torque about any axis, by its quadratic form: the field has few harmonics."""
    total = np.zeros((3, 3))
    for along in np.arange(count) * 2 * np.pi / count:
        for turn in np.arange(count) * 2 * np.pi / count:
            across = oracle.cross(oracle.field(0.0, (*orbit[:3], along, turn)))
            total += limit**2 * across.T @ across / count**2
    return total


@pytest.mark.parametrize("size", [1e-16, 1.0, 1e16])
def test_magnetorquers_turn_bodies_of_every_size_alike(size):
    """√(|τ| / (|Jn| θ)), and a torque whose part about n is another one."""
    inertia, axis = size * np.diag([2.0, 1.0, 3.0]), np.array([0.6, 0.0, 0.8])
    rods = cast(TolerantRods, SimpleNamespace(power=size**2 * 4e-8 * np.eye(3)))
    found = TolerantRods.natural_frequency(rods, jnp.array(inertia), jnp.array(axis))
    along = np.hypot(2.0 * 0.6, 3.0 * 0.8)
    assert found == pytest.approx(np.sqrt(2e-4 / along / FULL_AT), rel=1e-12)
    torques = size * np.array([0.1, -0.2, 0.3]), size * np.array([0.02, 0.05, -0.01])
    made = np.asarray(about(*map(jnp.array, (inertia, axis, *torques)))) / size
    assert axis @ made == pytest.approx(axis @ torques[1] / size, rel=1e-12)
    change = np.linalg.solve(inertia, size * made - torques[0])
    np.testing.assert_allclose(np.cross(change, inertia @ axis / size), 0, atol=1e-14)


def test_rods_that_are_left_have_the_mean_torque_of_their_projection(cubesat):
    """Of x and y, and of less than two nothing; studies ask with the rods of a case."""
    law, table = cubesat, load("cubesat-3w3m").orbit
    turn = table.ascending_node_rad
    orbit = (float(law.healthy.model.orbit.rate), np.deg2rad(51.6), turn)
    onto, total = np.diag([1.0, 1.0, 0.0]), np.zeros((3, 3))
    for along in np.arange(8) * 2 * np.pi / 8:
        for turn in np.arange(8) * 2 * np.pi / 8:
            across = onto @ oracle.cross(oracle.field(0.0, (*orbit, along, turn)))
            total += 0.2**2 * across.T @ across / 64
    left = law.rods.only(np.array([True, True, False]))
    np.testing.assert_allclose(left.power, total, atol=1e-9 * total.max())
    np.testing.assert_allclose(law.rods.only(np.ones(3, bool)).power, law.rods.power, rtol=1e-9)
    assert np.all(np.asarray(law.rods.only(np.array([False, True, False])).power) == 0)
    two = np.eye(3)[:, :2]
    assert law.holds_by_rods(two, np.array([True, True, False]))
    assert not law.holds_by_rods(two, np.array([True, False, False]))


def test_momentum_beyond_what_magnetorquers_turn_with_the_orbit_frame_is_taken_out_first(cubesat):
    """Until it is small and the body near the target, also that of a body that turns about n."""
    rods, model, table = cubesat.rods, cubesat.healthy.model, load("cubesat-3w3m").orbit
    rate, inertia = float(model.orbit.rate), np.asarray(model.spacecraft.inertia)
    axis, way = np.array([0.0, 0.6, 0.8]), np.array([0.48, -0.64, 0.6])
    orbit = (rate, np.deg2rad(51.6), table.ascending_node_rad)
    most = np.sqrt(axis @ mean_square(0.2, orbit) @ axis) / rate

    def sample(turn, momentum):
        attitude = Quaternion(jnp.stack([jnp.cos(turn / 2), jnp.sin(turn / 2), 0.0, 0.0]))
        omega = model.orbit.frame_rate(attitude) + jnp.linalg.solve(inertia, momentum)
        return Sample(jnp.zeros(()), PlantState(attitude, omega), Reading(omega), cubesat.healthy)

    @eqx.filter_jit
    def judged(turn, body, axis, excess, coasting, before):
        memory = RodMemory.begin(3)._replace(overloaded=before)
        return rods.overloaded(sample(turn, body), axis, excess, coasting, memory)

    def overloaded(part, turn, before, of_body=0.3, axis=axis, idle=0.0):
        body = of_body * part * most * way
        given = (turn, body, axis, part * most * way - body, idle * most * way, before)
        return bool(judged(*map(jnp.array, given)))

    near, far = 0.98 * FULL_AT, 1.02 * FULL_AT
    for part, turn, expected in (
        (0.99 * OVERLOAD, far, (False, True)),
        (1.01 * OVERLOAD, near, (True, True)),
        (1.01 * BEARABLE, near, (False, True)),
        (0.99 * BEARABLE, near, (False, False)),
        (0.99 * BEARABLE, far, (False, True)),
    ):
        assert (overloaded(part, turn, False), overloaded(part, turn, True)) == expected
    assert overloaded(1.01 * OVERLOAD, near, False, of_body=1.0)
    assert not overloaded(2.0, far, True, axis=np.zeros(3))
    assert overloaded(2.0, far, True, idle=0.99 * BEARABLE)
    assert not overloaded(2.0, far, True, idle=1.01 * BEARABLE)
    excess, coasting = np.array([1e-3, 2e-3, -1e-3]), np.array([3e-4, 1e-4, -2e-4])
    relief = rods.relief(
        sample(0.0, np.zeros(3)), jnp.zeros(3), *map(jnp.array, (excess, coasting, True))
    )
    turned = np.cross([0.0, -rate, 0.0], coasting)
    frequency = float(cubesat.healthy.natural_frequency)
    np.testing.assert_allclose(relief, turned - HURRY * frequency * excess, rtol=1e-12)


def test_wheels_of_one_axis_are_judged_by_their_own_gains():
    """Sets without gains stand beside, as where a law of no wheel or of another axis fails."""
    own = build(load("wheel-and-rods")).loop.controller
    law = dataclasses.replace(own, wheel_axes=np.eye(3))
    members = np.vstack([np.zeros(3, bool), np.eye(3, dtype=bool)])
    one_set = cast(TolerantMagnetic, TolerantMagnetic.of([None, None, law, None], members))
    rods = np.ones(3, bool)
    held = [one_set.holds_with(np.eye(3)[:, [axis]], rods) for axis in range(3)]
    assert held == [False, True, False]
    assert not one_set.holds_with(np.zeros((3, 0)), rods)


def test_rods_that_are_left_are_judged_beside_a_wheel_that_coasts():
    """Its momentum makes the body stiff, for which the gains are made: without it they diverge."""
    wheel = {"axis": [0, -1, 0], "torque_limit_N_m": 5e-3, "momentum_N_m_s": 0.06, "failed": True}
    chosen = load("wheel-and-rods").model_dump(
        exclude_none=True, exclude={"unloading", "dispersion"}
    )
    control = {"law": "fault-tolerant", "natural_frequency_rad_s": 0.02, "period_s": 2}
    law = build(
        Scenario.model_validate(chosen | {"wheel": [wheel], "control": control})
    ).loop.controller
    rods = np.array([True, True, False])
    assert law.holds_by_rods(np.zeros((3, 0)), rods)
    stopped = eqx.tree_at(lambda one: one.magnetic.laws.coasting, law, jnp.zeros(3))
    assert not stopped.holds_by_rods(np.zeros((3, 0)), rods)


def test_a_dipole_that_no_magnetorquer_opposes_is_turned_into_the_field(cubesat):
    """By the only dipole of two others whose sum with it makes no torque, where it is small."""
    steering, rng = cubesat.rods.steering, np.random.default_rng(4)
    for axis, field, body in zip(range(3), *rng.normal(size=(2, 3, 3)), strict=True):
        skew = np.delete(np.eye(3), axis, axis=1) @ np.array([[1.0, 0.6], [0.0, 0.8]])
        shares = np.linalg.pinv(skew)
        two = dataclasses.replace(steering, axes=skew, shares=shares, dipole_limit=np.ones(2))
        turned = np.asarray(two.turned(jnp.array(field), jnp.array(body)))
        dipoles = shares @ body - turned
        alone = body[axis] * np.eye(3)[axis]
        exact = np.linalg.lstsq(np.cross(skew.T, field).T, -np.cross(alone, field))[0]
        sine = field[axis] / np.linalg.norm(field)
        np.testing.assert_allclose(dipoles * (1 + (NEAREST / sine) ** 2), exact, rtol=1e-9)
        np.testing.assert_allclose(
            steering.turned(jnp.array(field), jnp.array(body)), body, rtol=0, atol=1e-15
        )


def test_two_magnetorquers_oppose_a_dipole_along_the_third_axis(cubesat):
    """Without wheels, at rest in the orbit frame: the body and they make no torque."""
    orbit, rate = load("cubesat-3w3m").orbit, float(cubesat.healthy.model.orbit.rate)
    steady = (rate, orbit.inclination_rad, orbit.ascending_node_rad)
    field = oracle.field(0.0, (*steady, orbit.argument_of_latitude_rad, orbit.sidereal_angle_rad))
    lost = int(np.argmax(np.abs(field)))
    shares = np.eye(3) * (np.arange(3) != lost)[:, None]
    magnetic = eqx.tree_at(lambda one: one.laws.steering.shares, cubesat.magnetic, shares)
    attitude, momenta = Quaternion(jnp.eye(4)[0]), WheelMomenta(jnp.zeros(3))
    state = PlantState(attitude, jnp.array([0.0, -rate, 0.0]), (momenta, None))
    body, memory = 0.005 * np.eye(3)[lost], magnetic.init(state)
    own = memory.own._replace(mode=jnp.array(int(MagneticMode.POINTING)), dipole=jnp.array(body))
    none = WheelsInUse(jnp.zeros(3), jnp.array(int(Rank.LESS)), jnp.zeros(3), jnp.zeros((3, 3)))

    @eqx.filter_jit
    def act(limit, state, usable, number, flows):
        law = eqx.tree_at(lambda one: one.laws.steering.dipole_limit, magnetic, limit)
        sample = Sample(jnp.array(0.0), state, Reading(state.omega), cubesat.healthy)
        wheeled, before = none._replace(usable=usable), memory._replace(own=own, number=number)
        flight = law.act(sample, jnp.array(True), flows, wheeled, before)
        return flight.dipoles, flight.torques, (flight.flies, flight.memory.number)

    nothing_flows = jnp.array(False)
    dipoles, *_ = act(jnp.ones(3), state, jnp.zeros(3), jnp.array(0), nothing_flows)
    alone, together = (np.linalg.norm(np.cross(one, field)) for one in (body, body + dipoles))
    assert dipoles[lost] == 0
    assert together < 3 * NEAREST**2 * alone
    # Off the target, beside a wheel about x, at limits that these dipoles nearly reach: the others
    # are all reduced by one factor, and the wheel makes up for their torque.
    turned = np.array([0.98, 0.1, -0.14, 0.1]) / np.linalg.norm([0.98, 0.1, -0.14, 0.1])
    state = dataclasses.replace(state, attitude=Quaternion(jnp.array(turned)))
    b = Rotation.from_quat(turned, scalar_first=True).inv().apply(field)
    sine = b[lost] / np.linalg.norm(b)
    first = (np.arange(3) != lost) * b * (body[lost] / b[lost]) / (1 + (NEAREST / sine) ** 2)
    one_wheel = jnp.array([5e-3, 0.0, 0.0]), jnp.array(1), nothing_flows
    dipoles, wheel = map(np.asarray, act(jnp.ones(3), state, *one_wheel)[:2])
    more = dipoles - first
    limit = np.abs(first).max() + 0.1 * np.abs(more).max()
    kept = np.arange(3) != lost
    part = np.min((np.copysign(limit, more) - first)[kept] / more[kept])
    assert 0.05 < part < 0.95
    found, made = map(np.asarray, act(limit * jnp.ones(3), state, *one_wheel)[:2])
    np.testing.assert_allclose(found, first + part * more, rtol=1e-9, atol=1e-15)
    lacking = (1 - part) * np.cross(more, b)
    np.testing.assert_allclose(made - wheel, [lacking[0], 0, 0], rtol=1e-9, atol=1e-18)
    found, *_ = act(0.5 * np.abs(first).max() * jnp.ones(3), state, *one_wheel)
    assert np.abs(found).max() <= (0.5 + 1e-12) * np.abs(first).max()
    # While a failed thruster flows, wheels and thrusters damp the rate, and magnetorquers do too,
    # beside what the first leave of the dipole of the body.
    found, _, (flies, number) = act(jnp.ones(3), state, *one_wheel[:2], jnp.array(True))
    frame = np.array([0, -rate, 0])
    relative = frame - Rotation.from_quat(turned, scalar_first=True).inv().apply(frame)
    against = -float(magnetic.laws.damping) * np.cross(b, relative) / (b @ b)
    against = against - (body + first) + b * (b @ (body + first)) / (b @ b)
    against = against - b * (against[lost] / b[lost]) / (1 + (NEAREST / sine) ** 2)
    np.testing.assert_allclose(found, first + kept * against, rtol=1e-9, atol=1e-15)
    assert not flies
    assert number == NOWHERE


def test_a_dipole_that_the_diagnosis_knows_replaces_that_of_the_law(cubesat):
    """If it differs by four standard deviations; not below two; by half of the difference at three.

    The law's own is that of a body without one."""
    magnetic, rate = cubesat.magnetic, float(cubesat.healthy.model.orbit.rate)
    momenta = WheelMomenta(jnp.zeros(3))
    state = PlantState(Quaternion(jnp.eye(4)[0]), jnp.array([0.0, -rate, 0.0]), (momenta, None))
    none = WheelsInUse(jnp.zeros(3), jnp.array(int(Rank.LESS)), jnp.zeros(3), jnp.zeros((3, 3)))
    own = magnetic.init(state).own._replace(mode=jnp.array(int(MagneticMode.POINTING)))

    @eqx.filter_jit
    def act(dipole, found):
        sample = Sample(jnp.array(0.0), state, Reading(state.omega), cubesat.healthy)
        before = TolerantMagneticMemory(own._replace(dipole=dipole), jnp.array(0))
        calm = jnp.array(False)
        return magnetic.act(sample, jnp.array(True), calm, none, before, found).dipoles

    body, ways = 0.006 * jnp.array([0.7, -1.1, 0.5]), jnp.array([1.0, 2.0, 2.0])
    nothing, size = jnp.zeros(3), np.linalg.norm(body / ways)
    for sigmas, part in ((1.9, 0.0), (3.0, 0.5), (4.1, 1.0)):
        found = act(nothing, (body, ways * size / sigmas))
        expected = act(part * body, None)
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-18)
    assert np.abs(np.asarray(act(body, None) - act(nothing, None))).max() > 1e-3


@eqx.filter_jit
def _beside_wheels(law, memory, state, part, dipole, variance):
    """Commands, mode and torque of the body's dipole, by what a fit of these parts believes."""
    size, own = jnp.arange(15), memory.rods.fit
    estimate = own.estimate.at[3:6].set(dipole / law.rods.fit.dipole)
    covariance = Symmetric(jnp.diag(jnp.where((size >= 3) & (size < 6), variance, 1.0)))
    own = own._replace(estimate=estimate, covariance=covariance, part=part, sense=jnp.array(0.0))
    memory = memory._replace(rods=memory.rods._replace(fit=own))
    command, after = law.step(jnp.array(0.0), state, memory)
    return command, after.mode, after.rods.pulled


@pytest.mark.parametrize("lost", [None, 2])
@pytest.mark.parametrize("part", [[1.0, 1.0, 1.0], [1.0, 1.0, 0.0]])
def test_a_known_dipole_of_the_body_is_opposed_beside_wheels(cubesat, lost, part):
    """By magnetorquers, and by wheels where these cannot: the torque on the body stays the same."""
    known = jnp.arange(3) == (-1 if lost is None else lost)
    law = eqx.tree_at(lambda one: one.actuators[0].failed_at_start, cubesat, known)
    turned = np.array([0.999, 0.01, -0.02, 0.015])
    attitude = Quaternion(jnp.array(turned / np.linalg.norm(turned)))
    momenta = WheelMomenta(jnp.array([2e-4, -3e-4, 0.0]))
    state = PlantState(attitude, jnp.array([1e-4, -1e-3, 2e-4]), (momenta, None))
    memory = law.init(state)

    def flown(dipole, variance):
        given = (np.array(part), dipole, np.array(variance))
        return _beside_wheels(law, memory, state, *map(jnp.asarray, given))

    body, b = (
        np.array([0.004, -0.006, 0.003]),
        np.asarray(law.rods.steering.field.in_body(jnp.array(0.0), attitude)),
    )
    own, mode, _ = flown(np.zeros(3), 1e-8)
    command, _, pulled = flown(body, 1e-8)
    assert mode == (TolerantMode.THREE_AXES if lost is None else TolerantMode.RODS)
    np.testing.assert_allclose(pulled, np.cross(body, b), rtol=1e-9)
    added = np.asarray(command - own)
    wheels, rods = (added[:3], added[3:]) if lost is None else (added[:3] * [1, 1, 0], added[3:])
    torque = wheels + np.cross(rods + body, b)
    np.testing.assert_allclose(torque, 0, atol=1e-6 * np.linalg.norm(np.cross(body, b)))
    if part[2]:
        np.testing.assert_allclose(np.cross(rods, b), -np.cross(body, b), rtol=1e-9)
    unsure, _, none = flown(body, 1.0)
    np.testing.assert_array_equal(unsure, own)
    np.testing.assert_array_equal(none, 0)


def test_a_dipole_beyond_the_limits_is_reduced_with_what_takes_momentum_out(cubesat):
    """Along y, where nothing works: x and z make a part of what opposes it and unloads wheels."""
    q = np.array([0.999, 0.01, -0.02, 0.015])
    attitude, stored = Quaternion(jnp.array(q / np.linalg.norm(q))), np.array([2e-3, -3e-3, 1e-3])
    momenta = WheelMomenta(jnp.array(stored))
    state = PlantState(attitude, jnp.array([1e-4, -1e-3, 2e-4]), (momenta, None))
    memory, field = cubesat.init(state), cubesat.rods.steering.field
    body, part = np.array([0.0, 0.6, 0.0]), jnp.array([1.0, 0.0, 1.0])

    def flown(dipole):
        return _beside_wheels(cubesat, memory, state, part, jnp.asarray(dipole), jnp.array(1e-8))

    (own, *_), (command, *_) = flown(0 * body), flown(body)
    b, rods = np.asarray(field.in_body(jnp.array(0.0), attitude)), np.asarray(command[3:])
    assert np.abs(rods).max() == pytest.approx(0.2, rel=1e-9)
    assert rods[1] == 0
    wanted = np.cross(b, np.cross(-stored / 300 - np.cross(body, b), b)) / (b @ b)
    made = np.cross(rods, b)
    assert 0.1 < made @ wanted / (wanted @ wanted) < 0.9
    np.testing.assert_allclose(np.cross(made, wanted), 0, atol=0.01 * np.linalg.norm(wanted) ** 2)
    torque = np.asarray(command - own)[:3] + np.cross(rods - np.asarray(own[3:]) + body, b)
    np.testing.assert_allclose(torque, 0, atol=1e-6 * np.linalg.norm(wanted))


def feedback(c, omega, inertia, rate, frequency, most):
    """The acceleration of quaternion feedback with critical damping, rad/s²."""
    frame = c @ [0, -rate, 0]
    relative = omega - frame
    x, y, z, w = Rotation.from_matrix(c.T).as_quat()
    wanted = -frequency * np.sign(w) * np.array([x, y, z])
    wanted *= min(1.0, most / np.linalg.norm(wanted))
    return np.cross(frame, relative) - 2 * frequency * (relative - wanted)


def commands(c, omega, h, b, *, inertia, rate, spun, normal, power, frequency, relief):
    """Torques of the wheels along `spun`, of which the last is lost, and dipoles along x, y, z."""
    along = inertia @ normal
    strength = np.sqrt(normal @ power @ normal)
    slow = min(np.sqrt(strength / np.linalg.norm(along) / FULL_AT), frequency)
    momentum = inertia @ omega + spun @ h
    across = momentum - normal * (normal @ momentum)
    most = strength / np.linalg.norm(across)
    fast = feedback(c, omega, inertia, rate, frequency, most)
    slower = feedback(c, omega, inertia, rate, slow, min(most, slow * FULL_AT))
    e = along / np.linalg.norm(along)
    torque = np.cross(omega, momentum) + inertia @ (fast + e * (e @ (slower - fast)))
    used, coasting = spun[:, :-1], spun[:, -1] * h[-1]
    wanted = np.cross(c @ [0, -rate, 0], coasting)
    wanted = wanted - max(relief, RELIEF * slow) * used @ h[:-1]
    way = np.cross(b, normal)
    square = max(way @ way, SHALLOW**2 * b @ b)
    dipole = way * (normal @ torque) / square
    other = np.cross(b, wanted) / (b @ b)
    dipole = dipole + other - way * (way @ other) / square
    return np.linalg.pinv(used) @ (torque - np.cross(dipole, b)), dipole


@pytest.mark.slow
def test_a_flight_is_that_of_an_independent_program():
    data = document(wheels=3, tolerant=True)
    data["magnetorquer"] = [{"axis": a, "dipole_limit_A_m2": 1.0} for a in np.eye(3).tolist()]
    for wheel, momentum in zip(data["wheel"], (1e-4, -2e-4, 5e-5), strict=True):
        wheel["momentum_N_m_s"] = momentum
    data["failure"] = [{"of": "wheel 3", "at_s": 0, "kind": "dead"}]
    data["control"] |= {"natural_frequency_rad_s": 0.1, "damping": 1.0}
    data["initial"] = {
        "quaternion": [0.9998, 0.01, -0.012, 0.012488395],
        "omega_rad_s": [1e-3, -2e-3, 1e-3],
    }
    chosen = Scenario.model_validate(data)
    run = build(chosen)
    loop = eqx.tree_at(
        lambda one: one.controller.actuators[0].failed_at_start,
        run.loop,
        jnp.array([False, False, True]),
    )
    found = dataclasses.replace(run, loop=loop).simulate()
    assert set(np.asarray(found.signals.mode)) == {TolerantMode.RODS}
    table, inertia = chosen.orbit, np.array(data["spacecraft"]["inertia_kg_m2"])
    orbit = (
        float(run.loop.plant.orbit.rate),
        table.inclination_rad,
        table.ascending_node_rad,
        table.argument_of_latitude_rad,
        table.sidereal_angle_rad,
    )
    spun = np.array([one["axis"] for one in data["wheel"]]).T
    spun = spun / np.linalg.norm(spun, axis=0)
    normal, period = null_space(spun[:, :2].T)[:, 0], chosen.control.period_s
    known = {
        "inertia": inertia,
        "rate": orbit[0],
        "spun": spun,
        "normal": normal,
        "power": mean_square(1.0, orbit),
        "frequency": 0.1,
        "relief": 2e-3,
    }
    w, x, y, z = chosen.initial.quaternion
    c = Rotation.from_quat([x, y, z, w]).as_matrix().T
    y = np.concatenate([c.ravel(), chosen.initial.omega_rad_s, [1e-4, -2e-4, 5e-5]])
    dipoles = np.asarray(found.signals.parts["dipole"])
    assert np.abs(dipoles).max() < 0.99  # no limit is met
    for number in range(len(found.times) - 1):
        t = number * period
        c, omega, h = y[:9].reshape(3, 3), y[9:12], y[12:]
        np.testing.assert_allclose(found.signals.omega[number], omega, rtol=0, atol=1e-10)
        np.testing.assert_allclose(
            found.signals.parts["wheel_momentum"][number], h, rtol=0, atol=1e-11
        )
        b, m = c @ oracle.field(t, orbit), dipoles[number]
        torques, expected = commands(c, omega, h, b, **known)
        made = np.cross(m, b)  # a part along the field makes nothing
        np.testing.assert_allclose(made, np.cross(expected, b), rtol=0, atol=1e-11)

        def motion(now, y, m=m, torques=torques):
            c, omega, h = y[:9].reshape(3, 3), y[9:12], y[12:]
            total = np.cross(m, c @ oracle.field(now, orbit)) + spun[:, :2] @ torques
            total = total - np.cross(omega, inertia @ omega + spun @ h)
            turning = oracle.cross(omega - c @ [0, -orbit[0], 0])
            rates = [(-turning @ c).ravel(), np.linalg.solve(inertia, total), -torques, [0.0]]
            return np.concatenate(rates)

        y = solve_ivp(motion, (t, t + period), y, method="DOP853", rtol=1e-11, atol=1e-15).y[:, -1]


def orbit_map(lost, inclination, turn, steps=48):
    """What an orbit makes of small (turn, rate, momenta) about a lost axis, wheels quick."""
    inertia, normal, rate = np.diag([0.13, 0.11, 0.05]), np.eye(3)[lost], RATE
    plane, down = np.delete(np.eye(3), lost, axis=1), np.array([0.0, -1.0, 0.0])
    orbit = (rate, np.deg2rad(inclination), 0.0)
    power = normal @ mean_square(0.2, orbit) @ normal
    moment = inertia[lost, lost]
    slow = np.sqrt(np.sqrt(power) / moment / FULL_AT)

    def motion(x, b):
        h = plane @ x[2:]
        omega = rate * (down - x[0] * np.cross(normal, down)) + x[1] * normal
        gyroscopic = np.cross(omega, inertia @ omega + h)
        wanted = normal @ gyroscopic - moment * (2 * slow * x[1] + slow**2 * x[0])
        way = np.cross(b, normal)
        square = max(way @ way, SHALLOW**2 * b @ b)
        other = np.cross(b, -RELIEF * slow * h) / (b @ b)
        m = way * wanted / square + other - way * (way @ other) / square
        torque = np.cross(m, b) - gyroscopic
        return np.concatenate([[x[1], normal @ torque / moment], plane.T @ torque])

    total, small = np.eye(4), np.diag([1e-4, 1e-6, 1e-6, 1e-6])
    for along in np.arange(steps) * 2 * np.pi / steps:
        b = oracle.field(0.0, (*orbit, along, turn))
        columns = [(motion(d, b) - motion(-d, b)) / 2 for d in small]
        generator = np.stack(columns, axis=1) / np.diag(small)
        step = solve_ivp(
            lambda _, y, a=generator: (a @ y.reshape(4, 4)).ravel(),
            (0.0, 2 * np.pi / steps / rate),
            total.ravel(),
            method="LSODA",
            rtol=1e-7,
            atol=1e-12,
        )
        total = step.y[:, -1].reshape(4, 4)
    return total


@pytest.mark.parametrize("lost", [0, 1, 2])
@pytest.mark.parametrize(("inclination", "turn"), [(51.6, 0.0), (79.0, np.pi), (97.4, 0.0)])
def test_errors_decrease_in_every_orbit(lost, inclination, turn):
    """The Floquet multipliers of the loop about rest, at the worst turn of the Earth."""
    assert np.abs(np.linalg.eigvals(orbit_map(lost, inclination, turn))).max() < 0.75


@pytest.mark.slow
def test_a_cubesat_that_loses_a_wheel_keeps_three_axes_and_then_flies_by_what_is_left():
    lost = ", ".join(
        f'{{of="wheel {name}", at_s={at}, kind="dead"}}' for name, at in (("x", 600), ("y", 3000))
    )
    changes = ["simulation.duration_s=6000", f"failure=[{lost}]", "dispersion={}"]
    found = build(load("cubesat-3w3m", changes)).simulate()
    mode, times = np.asarray(found.signals.mode), np.asarray(found.times)
    assert TolerantMode.RODS not in mode[times < 600]
    assert set(mode[(times > 900) & (times < 3000)]) == {TolerantMode.RODS}
    settled = (times > 2000) & (times < 3000)
    turn = 2 * np.linalg.norm(np.asarray(found.signals.quaternion)[:, 1:], axis=1)
    assert np.max(turn[settled]) < 0.05
    assert mode[-1] == TolerantMode.MAGNETIC_POINTING


STATES = (
    ((0.5, 0.5, -0.5, 0.5), (0.02, -0.01, 0.01)),
    ((0.5, 0.5, -0.5, 0.5), (1e-3, -2e-3, 1e-3)),
    ((1.0, 0.05, -0.1, 0.02), (1e-4, -1e-3, 2e-4)),
    ((1.0, 0.04, -0.1, 0.02), (1e-4, -1e-3, 1e-4)),
)
"""Attitudes and rates (rad/s) of a tumble, of a slew, and near the orbit frame."""


@eqx.filter_jit
def _both_laws(laws, wheeled, t, state, memories):
    """What both command, in one program for all."""
    law, controller, steering = laws
    sample = Sample(t, state, Reading(state.omega), law.healthy)
    flight = law.magnetic.act(sample, jnp.array(True), jnp.array(False), wheeled, memories[0])
    torque, own_memory = controller.step(t, state, memories[1])
    return flight, steering(t, state, torque), flight.mode, own_memory


@pytest.mark.slow
@pytest.mark.parametrize("failed", ["false", "true"])
def test_one_wheel_or_none_flies_as_under_the_law_magnetic(failed):
    """Dipoles and the torque of the wheel are those of that law and of what steers it."""
    wheel = f"axis=[0, -1, 0], torque_limit_N_m=5e-3, momentum_N_m_s=0.06, failed={failed}"
    bias = 0.0 if failed == "true" else 0.06
    changes = [f"wheel=[{{{wheel}}}]", f"unloading.bias_N_m_s={bias}"]
    own = build(load("wheel-and-rods", changes)).loop
    table = 'control={law="fault-tolerant", natural_frequency_rad_s=0.02, period_s=2.0}'
    law = build(load("wheel-and-rods", [*changes, table])).loop.controller
    steering, axis = own.distribution.steering[0], np.array([0.0, -1.0, 0.0])
    usable = jnp.array([0.0 if failed == "true" else 5e-3])
    wheeled = WheelsInUse(usable, jnp.array(int(Rank.LESS)), jnp.zeros(3), jnp.zeros((1, 3)))

    memory = own_memory = None
    for number, (quaternion, omega) in enumerate(STATES):
        attitude = Quaternion(jnp.array(quaternion) / np.linalg.norm(quaternion))
        state = PlantState(attitude, jnp.array(omega), (WheelMomenta(jnp.array([0.07])), None))
        if memory is None:
            memory, own_memory = law.magnetic.init(state), own.controller.init(state)
        flight, (dipoles, rest), mode, own_memory = _both_laws(
            (law, own.controller, steering),
            wheeled,
            jnp.array(2.0 * number),
            state,
            (memory, own_memory),
        )
        memory = flight.memory
        wheel = 0.0 if failed == "true" else axis @ np.asarray(rest)
        np.testing.assert_allclose(flight.dipoles, dipoles, rtol=1e-9)
        np.testing.assert_allclose(flight.torques, [wheel], rtol=1e-9, atol=1e-15)
        np.testing.assert_allclose(memory.own.torque, own_memory.torque, rtol=1e-9)
        assert mode == 10 + own_memory.mode
    assert own_memory.mode == MagneticMode.POINTING
    assert np.any(memory.own.torque != 0)
