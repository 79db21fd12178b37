"""What a matrix of inertia must be, by NumPy alone."""

import numpy as np
from jaxtyping import Float

from jaxsat.errors import ArgumentError


def require_known_inertia(name: str, inertia: Float[np.ndarray, "3 3"]) -> None:
    """Raise `ArgumentError` unless the matrix is symmetric and positive definite."""
    if not np.all(np.isfinite(inertia)):
        raise ArgumentError(name, "must be finite", inertia.tolist())
    scale = np.abs(inertia).max()
    if np.abs(inertia - inertia.T).max() > 1e-6 * scale:
        raise ArgumentError(name, "must be symmetric", inertia.tolist())
    smallest = np.linalg.eigvalsh(inertia)[0]
    if not smallest > 0:
        found = f"one where its smallest principal moment is {smallest:.6g} kg m²"
        raise ArgumentError(name, "must be positive definite", found)
