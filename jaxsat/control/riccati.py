"""Small dense linear-quadratic design, for use where a controller is made."""

import numpy as np
from jaxtyping import Float

NOISE = 1e-9
"""Tolerance relative to the largest singular values of A and B."""


def reachable_rank(
    a: Float[np.ndarray, "n n"], b: Float[np.ndarray, "n m"], noise: float
) -> tuple[int, float]:
    """Dimension of the space that x' = A x + B u can be steered in, and the shortest of the new
    directions that were counted.

    An orthonormal basis is grown by A; a new direction counts if it is longer than `noise`. Sounder
    than the rank of [B AB A²B ...], whose columns differ by many powers of ten.
    """
    basis, shortest = np.zeros((a.shape[0], 0)), np.inf
    front = b
    while front.size and basis.shape[1] < a.shape[0]:
        for _ in range(2):  # twice is enough for orthogonality to rounding
            front = front - basis @ (basis.T @ front)
        directions, lengths, _ = np.linalg.svd(front, full_matrices=False)
        found = lengths > noise
        shortest = min(shortest, float(np.min(lengths[found], initial=np.inf)))
        new = directions[:, found]
        basis = np.hstack([basis, new])
        front = a @ new
    return basis.shape[1], shortest


def regulator_gain(
    a: np.ndarray, b: np.ndarray, state_weight: np.ndarray, torque_weight: np.ndarray
) -> np.ndarray:
    """K of u = -K x that minimises ∫ xᵀQx + uᵀRu dt for x' = A x + B u.

    SciPy's solution of the Riccati equation starts Newton's iteration on it (Kleinman, IEEE Trans.
    Automatic Control 13, 1968), which gains three digits where the system is almost uncontrollable.
    Computed when a controller is made, never while a program is traced. Raises `ValueError` where
    no stabilising solution exists.
    """
    from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov  # takes its time

    n = a.shape[0]
    scale = np.sqrt(np.diag(state_weight))  # states of which each unit costs the same
    a, b = scale[:, None] * a / scale, scale[:, None] * b
    state_weight = state_weight / np.outer(scale, scale)
    rank, _ = reachable_rank(a / np.linalg.norm(a, 2), b / np.linalg.norm(b, 2), NOISE)
    if rank < n:
        raise ValueError(f"The linear system must be controllable, but its rank is {rank} of {n}.")
    unsolvable = ValueError("The Riccati equation has no stabilising solution for these weights.")
    try:
        cost = solve_continuous_are(a, b, state_weight, torque_weight)
    except np.linalg.LinAlgError as error:
        raise unsolvable from error
    gain = np.linalg.solve(torque_weight, b.T @ cost)
    for _ in range(10):
        closed = a - b @ gain
        if np.linalg.eigvals(closed).real.max() >= 0:
            raise unsolvable
        weight = state_weight + gain.T @ torque_weight @ gain
        cost = solve_continuous_lyapunov(closed.T, -weight)
        before, gain = gain, np.linalg.solve(torque_weight, b.T @ cost)
        if np.abs(gain - before).max() <= 1e-12 * np.abs(gain).max():
            break
    return gain * scale
