"""What a matrix of inertia must be, by NumPy alone."""

import numpy as np
from jaxtyping import Float


def require_known_inertia(name: str, inertia: Float[np.ndarray, "3 3"]) -> None:
    """Raise `ValueError` unless the matrix is symmetric and positive definite."""
    if not np.all(np.isfinite(inertia)):
        raise ValueError(f"Argument `{name}` must be finite, but got {inertia.tolist()}.")
    scale = np.abs(inertia).max()
    if np.abs(inertia - inertia.T).max() > 1e-6 * scale:
        raise ValueError(f"Argument `{name}` must be symmetric, but got {inertia.tolist()}.")
    smallest = np.linalg.eigvalsh(inertia)[0]
    if not smallest > 0:
        raise ValueError(
            f"Argument `{name}` must be positive definite, but its smallest principal moment is "
            f"{smallest:.6g} kg m²."
        )
