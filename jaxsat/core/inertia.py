"""Checks and frames of inertia matrices in plain NumPy."""

import numpy as np
from jaxtyping import Float

from jaxsat.core.errors import ArgumentError


def require_known_inertia(name: str, inertia: Float[np.ndarray, "3 3"]) -> None:
    """Raise `ArgumentError` unless the matrix is symmetric and positive definite."""
    if not np.all(np.isfinite(inertia)):
        raise ArgumentError(name, "must be finite", inertia.tolist())
    scale = np.abs(inertia).max()
    if np.abs(inertia - inertia.T).max() > 1e-6 * scale:
        raise ArgumentError(name, "must be symmetric", inertia.tolist())
    smallest = np.linalg.eigvalsh(inertia)[0]
    if not smallest > 0:
        description = f"one where its smallest principal moment is {smallest:.6g} kg m²"
        raise ArgumentError(name, "must be positive definite", description)


def normal_axes(
    inertia: Float[np.ndarray, "3 3"], directions: Float[np.ndarray, "3 2"]
) -> tuple[Float[np.ndarray, "3 3"], tuple[float, float, float]]:
    """Return rows x, y, n of the frame of two torques, and S1 >= S2 and n·Jn (kg m²).

    The torques are about any two orthonormal `directions`, n is their cross product. The inertia
    reduced by h = n·Jω, J - Jn nᵀJ / (n·Jn), is diag(S1, S2) about x and y.
    """
    normal = np.cross(directions[:, 0], directions[:, 1])
    along = inertia @ normal
    block = directions.T @ (inertia - np.outer(along, along) / (normal @ along)) @ directions
    difference, twice = block[0, 0] - block[1, 1], 2 * block[0, 1]
    half = np.arctan2(twice, difference) / 2
    cosine, sine = np.cos(half), np.sin(half)
    if not twice:  # exact, as on the paper's spacecraft
        cosine, sine = (1.0, 0.0) if difference >= 0 else (0.0, 1.0)
    turn = np.array([[cosine, sine], [-sine, cosine]])
    axes = np.vstack([turn @ directions.T, normal])
    principal = turn @ block @ turn.T
    return axes, (float(principal[0, 0]), float(principal[1, 1]), float(normal @ along))


LEAST_TORQUE_TILT = 1e-3
"""Threshold on the tangent of the angle between a torque and its angular acceleration, below which
the torque axis is a principal axis."""


def torque_axis_frame(
    inertia: Float[np.ndarray, "3 3"], axis: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3 3"]]:
    """Return rows b, d, e of the frame of one torque about the unit vector b = `axis`, and its J⁻¹.

    d is along J⁻¹b × b and e = b × d, so that no entry couples b and d (1/(kg m²)). About a
    principal axis, where J⁻¹b × b vanishes, d is any direction across b.
    """
    inverse = np.linalg.inv(inertia)
    side = np.cross(inverse @ axis, axis)
    length = np.sqrt(side @ side)
    if not length > 1e-12 * np.abs(inverse).max():
        side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        length = np.sqrt(side @ side)
    side = side / length
    axes = np.stack([axis, side, np.cross(axis, side)])
    return axes, axes @ inverse @ axes.T
