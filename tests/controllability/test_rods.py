"""Wheels and magnetorquers over an orbit, against a Gramian of a motion written here."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.failures import failure_table
from jaxsat.controllability.judging import judge
from jaxsat.controllability.layout import TOLERANCE
from jaxsat.controllability.orbit_rest import rest_near_frame
from jaxsat.controllability.rods import (
    RodSet,
    judge_with_rods,
    orbit_singular_values,
)
from jaxsat.controllability.wording import verdict_sentence
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField
from oracle import magnetic
from oracle import orbital_torques as earth

INERTIA = np.diag([0.04, 0.05, 0.02])
RATE = 1.1e-3
ANGLES = (1.1, 0.4, 0.7, 2.0)
BIAS = 3e-4  # N m s, several times the momentum of the body at the orbit's rate


def rods_of(angles=ANGLES, bias=0.0, gravity_gradient=True, axes=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
    columns = np.array(axes, float).T
    count = columns.shape[1]
    return RodSet(
        tuple("xyz"[:count]),
        columns,
        np.array([0.4, 0.3, 0.5])[:count],
        DipoleField(CircularOrbit(RATE, *angles)),
        bias,
        gravity_gradient,
    )


def motion(x, axis, stored, gravity_gradient):
    """Rates of the turn from the orbit frame, of ω (rad/s) and of a wheel's momentum at rest."""
    to_body = Rotation.from_rotvec(x[:3]).inv().as_matrix()
    frame = np.array([0, -RATE, 0])
    omega, nadir = x[3:6] + frame, to_body @ [0, 0, 1]
    pull = 3 * RATE**2 * np.cross(nadir, INERTIA @ nadir) * gravity_gradient
    spin = pull - np.cross(omega, INERTIA @ omega + stored + axis * x[6])
    return np.concatenate([omega - to_body @ frame, np.linalg.solve(INERTIA, spin), [0.0]])


@pytest.mark.parametrize("gravity_gradient", [True, False])
def test_singular_values_are_those_of_a_gramian_by_differences(gravity_gradient):
    axis, stored = np.array([0.0, -1.0, 0.0]), np.array([0.0, -BIAS, 0.0])

    def rate(x):
        return motion(x, axis, stored, gravity_gradient)

    step = 1e-6
    state = np.array([(rate(step * e) - rate(-step * e)) / (2 * step) for e in np.eye(7)]).T
    moment = np.cbrt(np.linalg.det(INERTIA))
    # Rods along the wheel's axis are offset by the wheel, which takes their momentum.
    inverse, across = np.linalg.inv(INERTIA), np.eye(3) - np.outer(axis, axis)
    to_state = np.concatenate([np.zeros((3, 3)), inverse @ across, axis[None]])
    wheel = np.concatenate([np.zeros(3), inverse @ axis, [-1.0]])
    units = np.array([1.0] * 3 + [1 / RATE] * 3 + [1 / (moment * RATE)])
    instants = (np.arange(128) + 0.5) * 2 * np.pi / RATE / 128
    orbits = [(RATE, *ANGLES[:3], ANGLES[3] - earth.EARTH_ROTATION * t) for t in instants]
    fields = [magnetic.field(t, orbit) for t, orbit in zip(instants, orbits, strict=True)]
    rods = np.array([np.cross(np.diag([0.4, 0.3, 0.5]), one).T for one in fields])
    rod_set = rods_of(bias=BIAS, gravity_gradient=gravity_gradient)
    torques = rod_set.torques((0, 1, 2))
    np.testing.assert_allclose(torques[0], rods, atol=1e-3 * np.abs(rods).max())
    largest = np.abs(torques).max()
    gramian = np.zeros((7, 7))
    for t, torque in zip(instants, rods, strict=True):
        inputs = np.concatenate([to_state @ torque / largest, wheel[:, None]], axis=1)
        blocks = units[:, None] * (expm(-state * t) @ inputs)
        gramian += blocks @ blocks.T / 128
    expected = np.sqrt(np.linalg.eigvalsh(gramian))[::-1]
    found = orbit_singular_values(INERTIA, axis[:, None], stored, rod_set, (0, 1, 2))[0]
    np.testing.assert_allclose(found / found[0], expected / expected[0], rtol=1e-3)


def table(rods, wheels):
    axes = np.array(wheels, float).reshape(-1, 3).T
    actuators = actuator_set(wheel_axes=axes)
    return {one.failed: one for one in failure_table(INERTIA, actuators, rods=rods)}


def test_the_table_counts_rods_alone_and_with_one_wheel_or_two():
    cases = table(rods_of(bias=BIAS), [(0, -1, 0), (1, 0, 0)])
    for failed, rank in (((), 8), (("w1",), 7), (("w2",), 7), (("w1", "w2"), 6)):
        found = cases[failed].judgement
        assert (found.verdict, found.laws) == ("controllable", "magnetic")
        assert (found.rank, found.dimension) == (rank, rank)
    assert cases["w1", "w2"].directions == 2
    assert cases["x", "y", "z"].judgement.verdict == "controllable"  # two wheels at rest
    assert cases["x", "y", "z"].judgement.laws == "two wheels"
    for failed in (("w1", "x", "y", "z"), ("w1", "w2", "x", "y", "z")):
        assert cases[failed].judgement.verdict == "uncontrollable"
    two, one = cases["w1", "x"].judgement, cases["w1", "w2", "x", "y"].judgement
    assert (two.verdict, two.laws) == ("controllable", "magnetic")
    assert (one.verdict, one.laws) == ("by drift", "none")
    # A rod along the orbit normal makes no torque about it, and neither does the field.
    alone = cases["w1", "w2", "x", "z"].judgement
    assert (alone.rank, alone.verdict) == (4, "uncontrollable")
    assert "do not control all axes: rank 4 of 6" in verdict_sentence(alone)


def test_three_wheels_need_no_rods():
    (found,) = (one for failed, one in table(rods_of(), np.eye(3)).items() if not failed)
    assert (found.judgement.laws, found.judgement.orbit) == ("three torques", None)


@pytest.mark.slow
def test_an_orbit_that_comes_to_the_magnetic_equator_is_borderline():
    """Its normal is along the dipole of the field at one of the turns of the Earth."""
    dipole = np.array([earth.G11, earth.H11, earth.G10])
    east = np.arctan2(dipole[1], dipole[0])
    tilt = np.arccos(-dipole[2] / np.linalg.norm(dipole))
    pitch = [(0, -1, 0)]
    for wheels, pull in (([], True), (pitch, False)):
        near = table(rods_of((tilt, east - np.pi / 2), gravity_gradient=pull), wheels)[()].judgement
        assert near.orbit.margin[0] < 1e-4 < 2e-3 < near.orbit.margin[1]
        assert near.verdict == "borderline"
        assert "at times of a day hardly" in verdict_sentence(near)
        polar = table(rods_of((1.5,), gravity_gradient=pull), wheels)[()].judgement
        assert polar.verdict == "controllable"
    # Gravity gradient takes momentum out of a pitch wheel as the body leans against it.
    assert table(rods_of((tilt, east - np.pi / 2)), pitch)[()].judgement.controllable


def test_a_body_that_rests_beside_the_orbit_frame_is_judged_there():
    """One turned from it as a whole is controlled as well as the one that is not."""
    turn = Rotation.from_euler("xyz", [0.3, -0.2, 0.1])
    back, expected = turn.as_matrix(), table(rods_of(), [])[()].judgement
    rods = dataclasses.replace(rods_of(), axes=back)
    (found, *_) = failure_table(back @ INERTIA @ back.T, actuator_set(), rods=rods)
    assert (found.judgement.verdict, found.judgement.laws) == ("controllable", "magnetic")
    np.testing.assert_allclose(found.judgement.orbit.margin, expected.orbit.margin)
    degrees = np.degrees(turn.magnitude())
    assert f"rests {degrees:.3g}° from" in verdict_sentence(found.judgement)
    assert "rests" not in verdict_sentence(expected)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("wheels", [0, 1, 2])
def test_no_torque_is_left_at_the_rest(seed, wheels):
    """By the motion above, in orbits with gravity gradient and without."""
    rng = np.random.default_rng(seed)
    axes = np.eye(3)[:, 1 : 1 + wheels]
    turned = Rotation.from_rotvec(rng.normal(size=3) * 0.05).as_matrix()
    inertia, stored = turned @ INERTIA @ turned.T, -axes[:, :1].sum(axis=1) * BIAS
    for pull in (True, False):
        found = rest_near_frame(inertia, stored / RATE, axes, gravity_gradient=pull)
        frame, nadir = found.to_body @ [0, -RATE, 0], found.to_body @ [0, 0, 1]
        torque = 3 * RATE**2 * np.cross(nadir, inertia @ nadir) * pull
        torque -= np.cross(frame, inertia @ frame + found.momentum * RATE)
        np.testing.assert_allclose(torque, 0, atol=1e-11 * RATE**2)
        np.testing.assert_allclose(found.momentum @ [1, 0, 0], 0, atol=1e-15)
        assert 0 < found.turn < 0.2


def judged(inertia, strength=1.0, places=(0, 1, 2)):
    """By magnetorquers alone, some of them, `strength` times as strong."""
    rods = dataclasses.replace(rods_of(), limits=strength * rods_of().limits)
    return judge_with_rods(judge(inertia, actuator_set()), rods, places, TOLERANCE)


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_a_body_without_a_near_rest_is_judged_in_the_orbit_frame(size):
    """With equal moments about x and z a product of both turns its rest by 45°. The least dipoles
    that oppose it on the mean of an orbit are those of a least-squares problem of all instants."""
    product, strength = 1e-4 * size, 0.01 * size
    inertia = size * np.diag([0.04, 0.05, 0.04])
    inertia[0, 2] = inertia[2, 0] = product
    assert rest_near_frame(inertia, np.zeros(3), np.zeros((3, 0)), gravity_gradient=True) is None
    torque = 3 * RATE**2 * np.array([0.0, product, 0.0])
    instants, parts = (np.arange(128) + 0.5) * 2 * np.pi / RATE / 128, []
    for turn in ANGLES[3] + 2 * np.pi * np.arange(8) / 8:
        orbits = [(RATE, *ANGLES[:3], turn - earth.EARTH_ROTATION * t) for t in instants]
        fields = [magnetic.field(t, orbit) for t, orbit in zip(instants, orbits, strict=True)]
        rods = [np.cross(strength * np.diag([0.4, 0.3, 0.5]), one).T for one in fields]
        parts.append(np.abs(np.linalg.lstsq(np.hstack(rods) / 128, torque)[0]).max())
    found, weak = judged(inertia, strength), judged(inertia, strength * max(parts))
    assert (found.verdict, found.laws) == ("controllable", "magnetic")
    assert found.orbit.turn == 0
    assert found.orbit.opposing == pytest.approx(max(parts), rel=2e-3)
    assert f"up to {100 * max(parts):.2g} % of their limits" in verdict_sentence(found)
    assert weak.verdict == "not decided"
    inertia[0, 2] = inertia[2, 0] = 100 * product  # turns the body faster than the field turns
    assert judged(inertia, 1e6 * strength).verdict == "not decided"


def test_the_least_product_of_inertia_leaves_the_margin_as_it_is():
    exact = np.diag([0.04, 0.05, 0.04])
    near = exact + 1e-12 * np.eye(3)[[2, 1, 0]]
    found = judged(near)
    np.testing.assert_allclose(found.orbit.margin, judged(exact).orbit.margin)
    assert "less than 0.1 %" in verdict_sentence(found)
    # A rod along the orbit normal cannot oppose a torque about it.
    assert judged(near, places=(1,)).verdict == "not decided"


def test_rods_are_not_judged_where_no_attitude_near_the_orbit_frame_is_a_rest():
    # A wheel that coasts across the orbit normal leaves no rest, until friction has stopped it.
    spinning = actuator_set(wheel_axes=np.eye(3)[:, :1], stored=[0.01], momentum=[0.01, 0, 0])
    lost = next(
        one for one in failure_table(INERTIA, spinning, rods=rods_of()) if one.failed == ("w1",)
    )
    assert (lost.judgement.verdict, lost.once_stopped) == ("not decided", "controllable")
