"""Which attitudes can be held without a torque about one axis."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

GRAVITY_GRADIENT = 3.0
"""The torque of the gradient is this times ω0² o × J o, o the direction to the Earth's centre."""

STEP = 1e-6
"""Step of the differences, rad."""

BALANCED = 1e-12
"""Torque that counts as none, in parts of a scale: the largest moment times ω0² in orbit."""

ITERATIONS = 100

RAYS, RAY_STEP, BISECTIONS = 1000, 0.05, 40
"""Directions of turns that are looked along, the step (rad) and the halvings of a step."""


Missing = Callable[[Float[np.ndarray, "*n 3"]], Float[np.ndarray, "*n"]]
"""The torque that is missing about the axis, of bodies turned by rotation vectors (rad)."""


def rotation(turn: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """The matrix from the orbit frame to the axes of a body turned by a rotation vector (rad)."""
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

    It is what no thruster can supply. The body is turned from the orbit frame by the rotation
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
    """The least turn (rotation vector, rad) from the orbit frame to an attitude that can be held
    in orbit; None where `nearest_balance` finds none."""

    def missing(turn: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
        return missing_torque(inertia, normal, turn, gravity_gradient)

    return nearest_balance(missing, float(np.abs(inertia).max()))


def nearest_balance(missing: Missing, scale: float) -> Float[np.ndarray, "3"] | None:
    """The least turn (rotation vector, rad) to an attitude in which no torque is missing.

    It is the lesser of the turns that iteration finds from no turn and from the nearest balance on
    rays in all directions; None where there is no balance on any ray. Torques that are small
    against `scale` count as none.
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
    """The least turn with a change of sign of the missing torque on rays of all directions."""
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
    """Lagrange's condition by iteration from a turn; None where it does not converge.

    Each step goes to the point of the linearised balance that is nearest to no turn.
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
