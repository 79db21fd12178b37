"""How thrusters share a commanded torque: (5) and its like, by NumPy alone."""

import numpy as np
from jaxtyping import Float

NORMALISER_FLOOR = 1e-9
"""Below this the normalisation of (5) or (8) divides by what counts as zero (unit columns)."""

LEFT_BY_ROUNDING = 1e-12
"""A part of a command, relative to it, that is as good as none."""


def unit_columns(torque_axes: Float[np.ndarray, "3 m"]) -> Float[np.ndarray, "3 m"]:
    """Torque axes scaled to unit length; raises `ValueError` for a zero column."""
    lengths = np.sqrt(np.sum(torque_axes**2, axis=0, keepdims=True))
    if not np.all(lengths > 0):
        raise ValueError("Argument `torque_axes` must have no zero column, but one is zero.")
    return torque_axes / lengths


def least_squares_map(
    axes: Float[np.ndarray, "3 m"], torques: int
) -> Float[np.ndarray, "m torques"]:
    """What actuators along unit `axes` make of a command, where they cannot make all of it the
    nearest.

    Two of them under two torques make these exactly, and about z what follows, as in equation (5).
    """
    if not axes.size:
        return np.zeros((axes.shape[1], torques))
    try:
        return allocation_matrix(axes, torques)
    except ValueError:
        return np.linalg.pinv(axes)[:, :torques]


def what_is_left(
    axes: Float[np.ndarray, "3 m"], shares: Float[np.ndarray, "m torques"]
) -> Float[np.ndarray, "torques torques"]:
    """The part of a command that actuators along unit `axes` with these shares do not make."""
    torques = shares.shape[1]
    left = np.eye(torques) - (axes @ shares)[:torques]
    return np.where(np.abs(left) < LEFT_BY_ROUNDING, 0.0, left)


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
