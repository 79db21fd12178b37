"""How thrusters share a commanded torque: (5) and its like, by NumPy alone."""

import numpy as np
from jaxtyping import Float

NORMALISER_FLOOR = 1e-9
"""Below this the normalisation of (5) or (8) divides by what counts as zero (unit columns)."""


def unit_columns(torque_axes: Float[np.ndarray, "3 m"]) -> Float[np.ndarray, "3 m"]:
    """Torque axes scaled to unit length; raises `ValueError` for a zero column."""
    lengths = np.sqrt(np.sum(torque_axes**2, axis=0, keepdims=True))
    if not np.all(lengths > 0):
        raise ValueError("Argument `torque_axes` must have no zero column, but one is zero.")
    return torque_axes / lengths


def allocation_matrix(
    torque_axes: Float[np.ndarray, "3 m"], torques: int = 2
) -> Float[np.ndarray, "m torques"]:
    """Thrusts that make a torque commanded about the first two body axes, or about all three.

    `torque_axes` has a unit column for each thruster. With two torques and two thrusters the third
    torque is then b1 u1 + b2 u2, equation (5); with more thrusters it is zero. Raises `ValueError`
    where the thrusters cannot make the torques independently.
    """
    count = torque_axes.shape[1]
    rows = torque_axes[:2] if count == torques == 2 else torque_axes
    rank = np.linalg.matrix_rank(rows, tol=NORMALISER_FLOOR)
    if rank < rows.shape[0] or count < torques:
        which = "x and y" if torques == 2 else "x, y and z"
        raise ValueError(
            f"The thrusters left must make independent torques about body axes {which}, "
            f"but their torque axes are the columns of {torque_axes.round(6).tolist()}."
        )
    return np.linalg.pinv(rows)[:, :torques]


def torque_directions(torque_axes: Float[np.ndarray, "3 m"]) -> Float[np.ndarray, "3 2"]:
    """Two orthonormal directions about which the thrusters can make any torque.

    Of the plane of their torques, nearest to body axes: x and y, y and z, or z and x where the
    normal of the plane is nearest to the third. Thrusters that leave all three axes are asked for
    torques about x and y. `torque_axes` has a unit column for each thruster. Raises `ValueError`
    for torques about one axis alone.
    """
    if np.linalg.matrix_rank(torque_axes, tol=NORMALISER_FLOOR) == 3:
        return np.eye(3)[:, :2]
    columns = torque_axes.T
    crossed = np.array([np.cross(one, other) for one in columns for other in columns])
    lengths = np.sqrt(np.sum(crossed**2, axis=-1))
    if not np.max(lengths, initial=0.0) > NORMALISER_FLOOR:
        raise ValueError(
            "The thrusters left must make torques about two independent axes, "
            f"but their torque axes are the columns of {torque_axes.round(6).tolist()}."
        )
    normal = crossed[np.argmax(lengths)] / np.max(lengths)
    nearest = np.argmax(np.abs(normal))
    normal = normal * np.sign(normal[nearest])
    first = np.eye(3)[(nearest + 1) % 3]
    first = first - normal * (normal @ first)
    first = first / np.sqrt(first @ first)
    return np.stack([first, np.cross(normal, first)], axis=1)


def direction_matrix(
    torque_axes: Float[np.ndarray, "3 m"], directions: Float[np.ndarray, "3 2"]
) -> Float[np.ndarray, "m 2"]:
    """Thrusts that make torques about `directions` of `torque_directions`."""
    return np.linalg.pinv(torque_axes) @ directions
