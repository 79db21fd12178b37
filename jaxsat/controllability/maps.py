"""Margin maps over all inertias of a body and over thruster directions."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxsat.compiler.llvm.mapped import compiled_over_cases
from jaxsat.controllability.barrier import separatrix_normals
from jaxsat.controllability.closure import controllability_margin
from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.once import latest


def physical_inertias(steps: int) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 3"]]:
    """Return a triangular grid over every shape of body: plane coordinates and principal moments.

    The second moments of mass p ≥ 0, Σp = 1 fill a triangle; J_i = 1 − p_i (so ΣJ = 2) are then
    exactly the moments with each at most the sum of the other two. Corners are rods, edges flat
    plates, the centre is a sphere. Bodies with a zero moment (the corners) are left out.
    `steps` divides each edge (at least 2, else ValueError); about steps²/2 points.
    """
    if steps < 2:
        raise ValueError(f"Argument `steps` must be at least 2, but got {steps}")
    i, j = np.meshgrid(np.arange(steps + 1), np.arange(steps + 1), indexing="ij")
    inside = (i + j <= steps) & (i < steps) & (j < steps) & (i + j > 0)
    p1, p2 = i[inside] / steps, j[inside] / steps
    second = np.stack([p1, p2, (steps - i[inside] - j[inside]) / steps], axis=1)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    return second @ corners, 1.0 - second


def margins_over_inertias(
    moments: Float[np.ndarray, "n 3"] | Float[Array, "n 3"],
    torque_axes: Float[np.ndarray, "3 m"] | Float[Array, "3 m"],
) -> Float[np.ndarray, " n"]:
    """Compute the margin of each row of principal moments (any unit), fixed torque axes.

    Compiled once for each number of axes; in the precision JAX is set to (64-bit for margins below
    1e-5).
    """

    def margin(moments: Vector, torque_axes: Float[Array, "3 m"]) -> RealScalar:
        return controllability_margin(jnp.diag(moments), torque_axes)

    return _over_cases(margin, jnp.asarray(moments), jnp.asarray(torque_axes))


def _over_cases(function: Callable, cases: PyTree, shared: PyTree) -> Float[np.ndarray, " n"]:
    cases, shared = jax.tree.map(np.asarray, (cases, shared))
    leaves, structure = jax.tree.flatten((jax.tree.map(lambda x: x[0], cases), shared))
    kinds = tuple((leaf.shape, leaf.dtype.char) for leaf in leaves)
    return np.asarray(_kernel(function, structure, kinds)(cases, shared))


@latest(32)
def _kernel(function: Callable, structure: Any, kinds: tuple[tuple, ...]) -> Callable:
    case, shared = jax.tree.unflatten(structure, [np.zeros(*kind) for kind in kinds])
    return compiled_over_cases(function, case, shared)


def direction(azimuth: RealScalar | float, elevation: RealScalar | float) -> Vector:
    """Return the unit vector at azimuth (from body x to y) and elevation (to z), rad."""
    return jnp.stack(
        [
            jnp.cos(elevation) * jnp.cos(azimuth),
            jnp.cos(elevation) * jnp.sin(azimuth),
            jnp.sin(elevation) * jnp.ones_like(azimuth),
        ]
    )


def angle_grid(
    azimuths: int, elevations: int
) -> tuple[Float[np.ndarray, " a"], Float[np.ndarray, " e"]]:
    """Return azimuths in [−π, π] and elevations in [−π/2, π/2], both ends included."""
    return np.linspace(-np.pi, np.pi, azimuths), np.linspace(-np.pi / 2, np.pi / 2, elevations)


def margins_over_angles(
    inertia: Float[np.ndarray, "3 3"] | Matrix,
    azimuths: Float[np.ndarray, " a"] | Float[Array, " a"],
    elevations: Float[np.ndarray, " e"] | Float[Array, " e"],
    other_axes: Float[np.ndarray, "3 k"] | Float[Array, "3 k"] | None = None,
) -> Float[np.ndarray, "e a"]:
    """Compute the margin with one thruster at each azimuth and elevation (rad), the others fixed.

    `inertia` (3, 3) in any unit; `other_axes` (3, k) or None for a single thruster.
    """
    others = None if other_axes is None or other_axes.shape[1] == 0 else jnp.asarray(other_axes)
    grid = np.meshgrid(elevations, azimuths, indexing="ij")
    cases = tuple([jnp.asarray(angles.reshape(-1)) for angles in grid])
    margins = _over_cases(_of_angles, cases, (jnp.asarray(inertia), others))
    return margins.reshape(grid[0].shape)


def _of_angles(
    angles: tuple[RealScalar, RealScalar], fixed: tuple[Matrix, Float[Array, "3 k"] | None]
) -> RealScalar:
    elevation, azimuth = angles
    inertia, others = fixed
    axes = direction(azimuth, elevation)[:, None]
    if others is not None:
        axes = jnp.concatenate([axes, others], axis=1)
    return controllability_margin(inertia, axes)


def uncontrollable_single_directions(
    inertia: Float[np.ndarray, "3 3"], count: int = 361
) -> tuple[Float[np.ndarray, "_ 2"], ...]:
    """Return curves and points (azimuth, elevation, rad) of uncontrollable single thrusters.

    With moments J1 > J2 > J3: the two separatrix planes, which the free body never leaves, seen as
    torques Jω (`separatrix_normals`; great circles, rank 5 along them), and both ends of the three
    principal axes (rank 2).
    Two equal moments merge both planes into the equator; a sphere has no curve to draw (every
    direction is uncontrollable).
    """
    curves = []
    planes = separatrix_normals(inertia)
    if planes is not None:
        normals, middle = planes
        for normal in normals:
            across = np.cross(normal, middle)
            angle = np.linspace(0.0, 2.0 * np.pi, count)[:, None]
            curves.append(np.cos(angle) * middle + np.sin(angle) * across)
    axes = np.linalg.eigh(inertia)[1].T
    curves += [end * axis[None, :] for axis in axes[::-1] for end in (1.0, -1.0)]
    return tuple(
        np.stack([np.arctan2(p[:, 1], p[:, 0]), np.arcsin(np.clip(p[:, 2], -1, 1))], axis=1)
        for p in curves
    )
