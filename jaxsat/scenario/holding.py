"""Attitudes that can be held without a torque about one axis, and the drift of all others."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxsat.core.declaration.settling import LEAST_ROUNDNESS
from jaxsat.core.inertia import normal_axes

GRAVITY_GRADIENT = 3.0
"""Factor of the gravity-gradient torque ω0² o × J o, o the direction to the Earth's centre."""

STEP = 1e-6
"""Step of the finite differences, rad."""

BALANCED = 1e-12
"""Torque that is treated as zero, relative to a scale: the largest moment times ω0² in orbit."""

DRIFT_STEP = 1e-4
"""Step of the finite differences of a drift, rad."""

ITERATIONS = 100

RAYS, RAY_STEP, BISECTIONS = 1000, 0.05, 40
"""Number of directions of rotation, step along them (rad), and bisections of a step."""


Missing = Callable[[Float[np.ndarray, "*n 3"]], Float[np.ndarray, "*n"]]
"""Function from rotation vectors (rad) of the body to the missing torque about the axis."""


def rotation(turn: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """Matrix from the orbit frame to the axes of a body turned by a rotation vector (rad)."""
    angle = np.sqrt(np.sum(turn**2, axis=-1))[..., None, None]
    cross = np.cross(turn[..., None, :], np.eye(3))  # -skew(turn)
    share = (np.sinc(angle / np.pi), np.sinc(angle / 2 / np.pi) ** 2 / 2)
    return np.eye(3) + share[0] * cross + share[1] * cross @ cross


def missing_torque(
    inertia: Float[np.ndarray, "3 3"],
    normal: Float[np.ndarray, "3"],
    turn: Float[np.ndarray, "*n 3"],
    gravity_gradient: bool,
) -> Float[np.ndarray, "*n"]:
    """n·(ω × Jω) less the gravity gradient about n, at rest in the orbit frame, over ω0² (kg m²).

    No thruster can supply this torque. The body is turned from the orbit frame by the rotation
    vector `turn` (rad); `inertia` (kg m²) and the unit vector `normal` are in body axes.
    """
    into_body = rotation(turn)
    across, nadir = into_body[..., 1], into_body[..., 2]
    torque = np.cross(across, across @ inertia.T) @ normal
    if gravity_gradient:
        torque = torque - GRAVITY_GRADIENT * (np.cross(nadir, nadir @ inertia.T) @ normal)
    return np.asarray(torque)


def nearest_held(
    inertia: Float[np.ndarray, "3 3"], normal: Float[np.ndarray, "3"], gravity_gradient: bool
) -> Float[np.ndarray, "3"] | None:
    """Smallest rotation vector (rad) from the orbit frame to an attitude that can be held in orbit,
    or None, see `nearest_balance`."""

    def missing(turn: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
        return missing_torque(inertia, normal, turn, gravity_gradient)

    return nearest_balance(missing, float(np.abs(inertia).max()))


def nearest_balance(missing: Missing, scale: float) -> Float[np.ndarray, "3"] | None:
    """Smallest rotation vector (rad) to an attitude in which no torque is missing.

    The smaller of the rotations to which iteration converges from zero and from the nearest balance
    on rays in all directions; None without a balance on any ray. Torques that are small relative to
    `scale` are treated as zero.
    """
    near = _iterate(missing, scale, np.zeros(3))
    if near is not None and np.sqrt(near @ near) < RAY_STEP:
        return near
    on_ray = _nearest_on_rays(missing)
    if on_ray is None:
        return near
    refinement = _iterate(missing, scale, on_ray)
    turns = [one for one in (near, on_ray, refinement) if one is not None]
    return min(turns, key=lambda turn: round(float(np.sqrt(turn @ turn)), 6))


def _nearest_on_rays(missing: Missing) -> Float[np.ndarray, "3"] | None:
    """Smallest rotation with a sign change of the missing torque on rays in all directions."""
    count = np.arange(RAYS) + 0.5
    height, around = 1 - 2 * count / RAYS, count * np.pi * (1 + 5**0.5)
    across = np.sqrt(1 - height**2)
    rays = np.stack([across * np.cos(around), across * np.sin(around), height], axis=1)
    angles = np.arange(0.0, np.pi + RAY_STEP, RAY_STEP)
    signs = np.sign(missing(rays[:, None] * angles[:, None]))
    changes = signs[:, :-1] * signs[:, 1:] <= 0
    has_crossing = changes.any(axis=1)
    if not has_crossing.any():
        return None
    rays, first = rays[has_crossing], np.argmax(changes[has_crossing], axis=1)
    low, high = angles[first], angles[first + 1]
    before = missing(rays * low[:, None])
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        after = missing(rays * middle[:, None]) * before <= 0
        low, high = np.where(after, low, middle), np.where(after, middle, high)
    least = np.argmin(high)
    return rays[least] * high[least]


def _iterate(
    missing: Missing, scale: float, turn: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3"] | None:
    """Solve Lagrange's condition by iteration from `turn`; None without convergence.

    Each step goes to the point of the linearised balance that is nearest to the origin.
    """
    for _ in range(ITERATIONS):
        torque = float(missing(turn))
        ahead, behind = (missing(turn + sign * STEP * np.eye(3)) for sign in (1, -1))
        slope = (ahead - behind) / (2 * STEP)
        following = turn
        if abs(torque) > BALANCED * scale or np.any(turn):
            steepness = float(slope @ slope)
            if steepness <= (BALANCED * scale) ** 2:
                return None
            following = slope * (float(slope @ turn) - torque) / steepness
        if np.abs(following - turn).max() < STEP:
            return following
        turn = (turn + following) / 2 if np.any(turn) else following
    return None


class RestDrift(NamedTuple):
    """ds/dt at rest in orbit, s = n·Jω / n·Jn about the axis n without a torque, in rad/s².

    `drift` is the value at the target attitude, `attitude` the reduction by attitudes within the
    tolerances to first order, and `oscillation` the reduction by two in-phase rates with the norm
    of the rate tolerance ω, sines: c ω²/4. Square waves give c ω²/2, the largest value of all
    periodic rates; the flattest waves of the laws give `waves` times `oscillation`.
    """

    drift: float
    attitude: float
    oscillation: float
    waves: float

    @property
    def balanced(self) -> float:
        """Largest drift against which a law can hold an attitude within the tolerances, at best."""
        return self.attitude + self.waves * self.oscillation

    @property
    def most_balanced(self) -> float:
        """Largest drift that attitudes and any periodic rates balance: square waves give c ω²/2."""
        return self.attitude + 2 * self.oscillation


def rest_drift(
    inertia: Float[np.ndarray, "3 3"],
    directions: Float[np.ndarray, "3 2"],
    orbit_rate: float,
    gravity_gradient: bool,
    tolerances: tuple[float, float, float],
) -> RestDrift:
    """Drift of a body (kg m²) with torques about two orthonormal `directions`.

    `tolerances` are on the tilt of the body's third axis, the turn about it (rad) and the rate
    (rad/s); `orbit_rate` is in rad/s.
    """
    frame, (first, second, third) = normal_axes(inertia, directions)
    turns = DRIFT_STEP * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    missing = missing_torque(inertia, frame[2], turns, gravity_gradient) * orbit_rate**2 / third
    one, other, about_third = (missing[1:4] - missing[4:]) / (2 * DRIFT_STEP)
    tilt, turn, rate = tolerances
    return RestDrift(
        -float(missing[0]),
        tilt * math.hypot(one, other) + turn * abs(float(about_third)),
        (first - second) / third * rate**2 / 4,
        2 / (1 + LEAST_ROUNDNESS) if gravity_gradient else 1.0,
    )
