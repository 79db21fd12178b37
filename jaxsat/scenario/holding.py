"""Which attitudes can be held in orbit without a torque about one axis."""

import numpy as np
from jaxtyping import Float

GRAVITY_GRADIENT = 3.0
"""The torque of the gradient is this times ω0² o × J o, o the direction to the Earth's centre."""

STEP = 1e-6
"""Step of the differences, rad."""

BALANCED = 1e-12
"""Torque that counts as none, in parts of ω0² times the largest moment."""

ITERATIONS = 100

RAYS, RAY_STEP, BISECTIONS = 1000, 0.05, 40
"""Directions of turns that are looked along, the step (rad) and the halvings of a step."""


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
    """The least turn (rotation vector, rad) from the orbit frame to an attitude that can be held.

    It is the lesser of the turns that iteration finds from the orbit frame and from the nearest
    balance on rays in all directions; None where there is no balance on any ray.
    """
    near = _iterate(inertia, normal, gravity_gradient, np.zeros(3))
    if near is not None and np.sqrt(near @ near) < RAY_STEP:
        return near
    on_ray = _nearest_on_rays(inertia, normal, gravity_gradient)
    if on_ray is None:
        return near
    refinement = _iterate(inertia, normal, gravity_gradient, on_ray)
    turns = [one for one in (near, on_ray, refinement) if one is not None]
    return min(turns, key=lambda turn: round(float(np.sqrt(turn @ turn)), 6))


def _nearest_on_rays(
    inertia: Float[np.ndarray, "3 3"], normal: Float[np.ndarray, "3"], gravity_gradient: bool
) -> Float[np.ndarray, "3"] | None:
    """The least turn with a change of sign of `missing_torque` on rays of all directions."""
    count = np.arange(RAYS) + 0.5
    height, around = 1 - 2 * count / RAYS, count * np.pi * (1 + 5**0.5)
    across = np.sqrt(1 - height**2)
    rays = np.stack([across * np.cos(around), across * np.sin(around), height], axis=1)
    angles = np.arange(0.0, np.pi + RAY_STEP, RAY_STEP)

    def missing(turns: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
        return missing_torque(inertia, normal, turns, gravity_gradient)

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
    inertia: Float[np.ndarray, "3 3"],
    normal: Float[np.ndarray, "3"],
    gravity_gradient: bool,
    turn: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "3"] | None:
    """Lagrange's condition by iteration from a turn; None where it does not converge.

    Each step goes to the point of the linearised balance that is nearest to no turn.
    """
    scale = float(np.abs(inertia).max())
    for _ in range(ITERATIONS):
        missing = missing_torque(inertia, normal, turn, gravity_gradient)
        ahead, behind = (
            missing_torque(inertia, normal, turn + sign * STEP * np.eye(3), gravity_gradient)
            for sign in (1, -1)
        )
        slope = (ahead - behind) / (2 * STEP)
        following = turn
        if abs(missing) > BALANCED * scale or np.any(turn):
            steepness = float(slope @ slope)
            if steepness <= (BALANCED * scale) ** 2:
                return None
            following = slope * (float(slope @ turn) - missing) / steepness
        if np.abs(following - turn).max() < STEP:
            return following
        turn = (turn + following) / 2 if np.any(turn) else following
    return None
