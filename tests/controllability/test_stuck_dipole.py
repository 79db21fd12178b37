"""The largest dipole that is opposed over an orbit, by a programme of a motion written here."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.judging import judge
from jaxsat.controllability.orbit_rest import OrbitRest
from jaxsat.controllability.rods import RodSet, rest_with_rods
from jaxsat.controllability.stuck_dipole import OrbitWheels, largest_opposed
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField
from oracle import magnetic
from oracle.orbital_torques import EARTH_ROTATION

INERTIA = np.diag([0.04, 0.05, 0.02])
RATE, ANGLES = 1.1e-3, (1.1, 0.4, 0.7, 2.0)
BIAS, ROOM = 3e-4, 5e-4  # N m s
LIMITS, FOUR = np.array([0.4, 0.3, 0.5]), np.array([0.4, 0.3, 0.5, 0.2])
ANGLE, PART, STEPS = 0.03, 0.5, 64
STEP = 2 * np.pi / RATE / STEPS


def rods_of(bias):
    field = DipoleField(CircularOrbit(RATE, *ANGLES))
    return RodSet(tuple("xyz"), np.eye(3), LIMITS, field, bias, gravity_gradient=True)


def opposed(stuck, wheels, bias):
    rods = rods_of(bias)
    places = [one for one in range(3) if not np.eye(3)[one] @ stuck]
    judged = judge(INERTIA, actuator_set(wheel_axes=wheels, target_turns=True))
    rest = rest_with_rods(judged, rods, places)
    assert rest is not None
    own = OrbitWheels(wheels, np.full(wheels.shape[1], bias + ROOM), np.zeros(3))
    return largest_opposed(rods, places, stuck, INERTIA, own, rest, ANGLE, PART)


def motion(x, torque, spin, wheels, bias):
    """Rates of the turn from the orbit frame, of ω (rad/s) and of wheels beyond their bias."""
    to_body = Rotation.from_rotvec(x[:3]).inv().as_matrix()
    frame = np.array([0, -RATE, 0])
    omega, nadir = x[3:6] + to_body @ frame, to_body @ [0, 0, 1]
    stored = wheels @ x[6:] + bias * np.array([0.0, -1.0, 0.0])
    total = torque + wheels @ spin + 3 * RATE**2 * np.cross(nadir, INERTIA @ nadir)
    change = np.linalg.solve(INERTIA, total - np.cross(omega, INERTIA @ omega + stored))
    turning = x[3:6] + np.cross(x[:3], x[3:6]) / 2  # of a small rotation vector
    return np.concatenate([turning, change + np.cross(x[3:6], to_body @ frame), -spin])


def matrices(wheels, bias):
    """Of a step: of the state, the torque and wheels, in rad, rad/s and N m s, by differences."""
    count = wheels.shape[1]
    sizes = np.concatenate(
        [np.full(3, 1e-4), np.full(3, 1e-7), np.full(count, 1e-7), np.full(3 + count, 1e-9)]
    )

    def rate(z):
        x, torque, spin = np.split(z, [6 + count, 9 + count])
        return motion(x, torque, spin, wheels, bias)

    each = [
        (rate(s * e) - rate(-s * e)) / 2 / s for s, e in zip(sizes, np.eye(len(sizes)), strict=True)
    ]
    whole = np.zeros((len(sizes),) * 2)
    whole[: 6 + count] = np.array(each).T
    moved = expm(whole * STEP)
    return np.split(moved[: 6 + count], [6 + count, 9 + count], axis=1)


def field(t, turn):
    """Of an Earth that does not turn meanwhile."""
    turn = ANGLES[3] + turn - EARTH_ROTATION * t
    return magnetic.field(t, (RATE, *ANGLES[:3], turn))


def programme(stuck, wheels, bias, turn):
    """The largest dipole (A m²) at a turn of the Earth."""
    state, torque, spin = matrices(wheels, bias)
    left = np.flatnonzero(np.eye(3) @ stuck == 0)
    size, count, rods = len(state), wheels.shape[1], len(left)
    units = np.concatenate([np.full(3, 1e-2), np.full(3, 1e-5), np.full(count, 1e-4)])
    each = size + rods + count
    rows, most = np.zeros((STEPS * size, STEPS * each + 1)), np.zeros(each)
    for number in range(STEPS):
        b = field((number + 0.5) * STEP, turn)
        place, own = number * size, number * each
        after = (number + 1) % STEPS * each
        made = np.cross((LIMITS * np.eye(3))[left], b).T
        rows[place : place + size, after : after + size] += np.diag(units)
        rows[place : place + size, own : own + each] -= np.hstack(
            [state * units, torque @ made, spin * 1e-6]
        )
        rows[place : place + size, -1] = -torque @ np.cross(stuck, b)
    most[:] = np.inf
    most[:3], most[size : size + rods] = ANGLE / 1e-2, PART
    least = -most
    own = wheels.T @ [0.0, -bias, 0.0]
    most[6:size] = (bias + ROOM - own) / 1e-4
    least[6:size] = (-bias - ROOM - own) / 1e-4
    bounds = [*np.tile(np.stack([least, most], axis=1), (STEPS, 1)), (0, None)]
    rows /= np.tile(units, STEPS)[:, None]
    found = linprog(-np.eye(STEPS * each + 1)[-1], A_eq=rows, b_eq=0 * rows[:, 0], bounds=bounds)
    return found.x[-1]


PITCH = np.array([[0.0], [-1.0], [0.0]])
TWO = np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 0.0]])


@pytest.mark.parametrize(
    ("stuck", "wheels", "bias"),
    [((0, 0, 1), PITCH, BIAS), ((1, 0, 0), np.zeros((3, 0)), 0.0), ((0, 1, 0), TWO, 0.0)],
)
def test_the_largest_dipole_is_that_of_a_programme_of_another_motion(stuck, wheels, bias):
    stuck = np.array(stuck, float)
    least = min(programme(stuck, wheels, bias, turn) for turn in np.arange(8) * np.pi / 4)
    assert opposed(stuck, wheels, bias) == pytest.approx(least, rel=2e-3)


def test_a_dipole_along_a_rod_that_works_is_cancelled_up_to_its_limit():
    """By a rod alone, to which others may only add."""
    rods = dataclasses.replace(rods_of(0.0), axes=np.eye(3)[:, [0, 1, 2, 2]], limits=FOUR)
    rest = OrbitRest(np.eye(3), np.zeros(3), 0.0)
    none = OrbitWheels(np.zeros((3, 0)), np.zeros(0), np.zeros(3))
    stuck = (FOUR[3] * np.eye(3)[2], INERTIA, none, rest)
    alone = largest_opposed(rods, [2], *stuck, 1e-6, PART)
    assert alone == pytest.approx(PART * FOUR[2] / FOUR[3], rel=0.01)
    assert largest_opposed(rods, [0, 1, 2], *stuck, 1e-6, PART) > alone
