"""Which attitudes can be held in orbit without a torque about one axis."""

import numpy as np
from jaxtyping import Float

GRAVITY_GRADIENT = 3.0
"""Its torque is this times ω0² o × J o, o the direction to the Earth's centre."""

STEP = 1e-6
"""Of the differences, rad."""

BALANCED = 1e-12
"""What counts as no torque, in parts of ω0² times the largest moment."""

ITERATIONS = 100


def rotation(turn: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """From the orbit frame to the axes of a body turned from it by a rotation vector (rad)."""
    angle = float(np.sqrt(turn @ turn))
    cross = np.cross(turn, np.eye(3))  # -skew(turn)
    share = (np.sinc(angle / np.pi), np.sinc(angle / 2 / np.pi) ** 2 / 2)
    return np.eye(3) + share[0] * cross + share[1] * cross @ cross


def missing_torque(
    inertia: Float[np.ndarray, "3 3"],
    normal: Float[np.ndarray, "3"],
    turn: Float[np.ndarray, "3"],
    gravity_gradient: bool,
) -> float:
    """n·(ω × Jω) less the gravity gradient about n, at rest in the orbit frame, over ω0² (kg m²).

    It is what no thruster can supply. The body is turned from the orbit frame by the rotation
    vector `turn` (rad); `inertia` (kg m²) and the unit vector `normal` are in body axes.
    """
    into_body = rotation(turn)
    across, nadir = into_body[:, 1], into_body[:, 2]
    needed = float(normal @ np.cross(across, inertia @ across))
    if gravity_gradient:
        needed -= GRAVITY_GRADIENT * float(normal @ np.cross(nadir, inertia @ nadir))
    return needed


def nearest_held(
    inertia: Float[np.ndarray, "3 3"], normal: Float[np.ndarray, "3"], gravity_gradient: bool
) -> Float[np.ndarray, "3"] | None:
    """The least turn (rotation vector, rad) from the orbit frame to an attitude that can be held.

    None where the search from the orbit frame finds none. Lagrange's condition by iteration: each
    step goes to the point of the linearised balance that is nearest to no turn.
    """
    turn, scale = np.zeros(3), float(np.abs(inertia).max())
    for _ in range(ITERATIONS):
        missing = missing_torque(inertia, normal, turn, gravity_gradient)
        ends = [
            [
                missing_torque(inertia, normal, turn + sign * step, gravity_gradient)
                for step in STEP * np.eye(3)
            ]
            for sign in (1, -1)
        ]
        slope = np.subtract(*ends) / (2 * STEP)
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
