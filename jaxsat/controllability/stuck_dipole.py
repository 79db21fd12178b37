"""Constant dipoles that magnetorquers and wheels oppose over an orbit, such as those of stuck ones.

The linear motion of attitude, rate and momentum of wheels about rest near the orbit frame must have
a periodic solution within limits. It may use any dipoles, and momentum of wheels, known a whole
orbit ahead: a linear programme finds the largest constant dipole.
"""

import pickle
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.linalg import expm
from scipy.sparse import block_array, csr_array

from jaxsat.control.linear_motion import reference_moment, small_motion
from jaxsat.controllability.orbit_rest import OrbitRest
from jaxsat.controllability.programme import OPTIMAL, UNBOUNDED, solve
from jaxsat.controllability.rods import RodSet
from jaxsat.core.once import latest

EVERY = 2
"""Instants of an orbit for each step of the motion, whose torques are their mean."""


class OrbitWheels(NamedTuple):
    """Wheels in use: unit `axes`, the largest momentum of each, `capacity` (N m s), and the
    momentum (N m s, body axes) of wheels that only coast."""

    axes: Float[np.ndarray, "3 m"]
    capacity: Float[np.ndarray, " m"]
    coasting: Float[np.ndarray, "3"]


class _Steps(NamedTuple):
    """Effect on the state, in a step, of the state itself, of a torque on the body (N m), and of
    the torques of wheels, in a unit of their own."""

    state: Float[np.ndarray, "x x"]
    torque: Float[np.ndarray, "x 3"]
    wheels: Float[np.ndarray, "x m"]


class _Bounds(NamedTuple):
    """Limits of turns (rad) and of dipoles (over theirs), and how much `less` and `more` momentum
    each wheel may have than at rest, over J0 ω0."""

    angle: float
    part: float
    less: Float[np.ndarray, " m"]
    more: Float[np.ndarray, " m"]


def largest_opposed(
    rods: RodSet,
    places: list[int],
    dipole: Float[np.ndarray, "3"],
    inertia: Float[np.ndarray, "3 3"],
    wheels: OrbitWheels,
    rest: OrbitRest,
    angle: float,
    part: float,
) -> float:
    """Return the largest multiple of a `dipole` (body axes) that the rods of these places oppose.

    They use at most this `part` of their limits, and wheels their capacity; the body, of this
    `inertia` (kg m²), turns from its `rest` by at most an `angle` (rad) about each axis. The least
    of all turns of the Earth counts; infinite where no limit is met. Raises `UnsolvedProgramme` as
    `solve` does.
    """
    rate, back = float(rods.field.circle.rate), rest.to_body.T
    steps = _steps(rods, back @ inertia @ back.T, back @ wheels.axes, back @ rest.momentum)
    own = np.linalg.pinv(wheels.axes) @ (rest.momentum * rate - wheels.coasting)
    torques = _means(rods.torques(places, rest.to_body))
    steady = _means(np.cross(back @ dipole, rods.fields))
    momentum = reference_moment(inertia) * rate
    stored = (wheels.capacity + own) / momentum, (wheels.capacity - own) / momentum
    return _least(pickle.dumps((steps, torques, steady, _Bounds(angle, part, *stored))))


def _means(torques: Float[np.ndarray, "turns instants ..."]) -> np.ndarray:
    """Return the mean torques in each step."""
    return torques.reshape(len(torques), -1, EVERY, *torques.shape[2:]).mean(axis=2)


def _steps(
    rods: RodSet,
    inertia: Float[np.ndarray, "3 3"],
    axes: Float[np.ndarray, "3 m"],
    momentum: Float[np.ndarray, "3"],
) -> _Steps:
    """Return the effects in a step, torques held; `momentum` of wheels at rest over ω0 (kg m²)."""
    rate, moment, count = float(rods.field.circle.rate), reference_moment(inertia), axes.shape[1]
    scaled, size = inertia / moment, 6 + count
    motion = np.zeros((size + 3 + count,) * 2)
    motion[:size, :size] = small_motion(
        scaled, axes, momentum / moment, gravity_gradient=rods.gravity_gradient
    )
    inverse = np.linalg.inv(scaled)
    motion[3:6, size : size + 3] = inverse / (moment * rate**2)
    motion[3:6, size + 3 :], motion[6:size, size + 3 :] = inverse @ axes, -np.eye(count)
    step = expm(motion * 2 * np.pi / (rods.fields.shape[1] // EVERY))
    return _Steps(step[:size, :size], step[:size, size : size + 3], step[:size, size + 3 :])


@latest(32)
def _least(design: bytes) -> float:
    """Return the least over turns of the Earth of `_largest`; pickled arguments, for all turns.

    Cases of a study in which one magnetorquer is stuck at different levels share it.
    """
    steps, torques, steady, bounds = pickle.loads(design)
    return min(
        _largest(steps, each, torque, bounds) for each, torque in zip(torques, steady, strict=True)
    )


def _largest(
    steps: _Steps,
    torques: Float[np.ndarray, "instants 3 k"],
    steady: Float[np.ndarray, "instants 3"],
    bounds: _Bounds,
) -> float:
    """Return the largest multiple of the torques `steady` (N m) at one turn of the Earth, with the
    torques `torques` at full dipoles."""
    instants, size, wheels = len(torques), len(steps.state), steps.wheels.shape[1]
    onwards = np.kron(np.roll(np.eye(instants), 1, axis=1), np.eye(size))
    onwards -= np.kron(np.eye(instants), steps.state)
    rods = np.zeros((instants * size, instants * torques.shape[2]))
    for instant, columns in enumerate(torques):
        rows, own = instant * size, instant * torques.shape[2]
        rods[rows : rows + size, own : own + torques.shape[2]] = steps.torque @ columns
    by_wheels = np.kron(np.eye(instants), steps.wheels)
    constant = (steady @ steps.torque.T).reshape(-1, 1)
    columns = [onwards, -rods, -by_wheels, -constant]
    free = np.full(3, np.inf)
    most = np.concatenate([np.full(3, bounds.angle), free, bounds.more])
    least = np.concatenate([np.full(3, bounds.angle), free, bounds.less])
    dipoles, of_wheels = np.full(rods.shape[1], bounds.part), np.full(instants * wheels, np.inf)
    high = np.concatenate([np.tile(most, instants), dipoles, of_wheels, [np.inf]])
    low = np.concatenate([-np.tile(least, instants), -dipoles, -of_wheels, [0.0]])
    aim = np.zeros(len(high))
    aim[-1] = -1.0
    solution = solve(
        aim,
        A_eq=block_array([[csr_array(one) for one in columns]]),
        b_eq=np.zeros(instants * size),
        bounds=np.stack([low, high], axis=1),
    )
    if solution.status == UNBOUNDED:
        return np.inf
    return -float(solution.fun) if solution.status == OPTIMAL else 0.0
