"""Small dense linear-quadratic design, in NumPy, for use where a controller is made."""

import numpy as np
from jaxtyping import Float

NOISE = 1e-9
"""What counts as nothing beside the largest singular values of A and B."""


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

    The stable subspace of the Hamiltonian matrix gives a start that Newton's iteration on the
    Riccati equation (Kleinman, IEEE Trans. Automatic Control 13, 1968) brings to full precision.
    Raises `ValueError` where no stabilising solution exists.
    """
    n = a.shape[0]
    rank, _ = reachable_rank(a / np.linalg.norm(a, 2), b / np.linalg.norm(b, 2), NOISE)
    if rank < n:
        raise ValueError(f"The linear system must be controllable, but its rank is {rank} of {n}.")
    gain = _hamiltonian_start(a, b, state_weight, torque_weight)
    for _ in range(10):
        closed = a - b @ gain
        if np.linalg.eigvals(closed).real.max() >= 0:
            raise ValueError("The Riccati equation has no stabilising solution for these weights.")
        cost = _lyapunov(closed, state_weight + gain.T @ torque_weight @ gain)
        following = np.linalg.solve(torque_weight, b.T @ cost)
        if np.abs(following - gain).max() <= 1e-12 * np.abs(following).max():
            return following
        gain = following
    return gain


def _hamiltonian_start(a, b, state_weight, torque_weight) -> np.ndarray:
    # Scaled by the square roots of the weights, so that eigenvectors mix numbers of like size.
    root = np.sqrt(np.diag(state_weight))
    scaled_a = root[:, None] * a / root[None, :]
    scaled_b = root[:, None] * b
    scaled_q = state_weight / np.outer(root, root)
    by_torque = scaled_b @ np.linalg.solve(torque_weight, scaled_b.T)
    hamiltonian = np.block([[scaled_a, -by_torque], [-scaled_q, -scaled_a.T]])
    values, vectors = np.linalg.eig(hamiltonian)
    stable = vectors[:, np.argsort(np.real(values))[: a.shape[0]]]
    upper, lower = np.split(stable, 2)
    cost = np.real(lower @ np.linalg.inv(upper)) * np.outer(root, root)
    return np.linalg.solve(torque_weight, b.T @ (cost + cost.T) / 2)


def _lyapunov(closed: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """X of closedᵀ X + X closed + weight = 0."""
    identity = np.eye(closed.shape[0])
    operator = np.kron(closed.T, identity) + np.kron(identity, closed.T)
    solution = np.linalg.solve(operator, -weight.reshape(-1)).reshape(weight.shape)
    return (solution + solution.T) / 2
