"""The cone of the torques of thrusters, some of which are one-sided.

Torques of one sign add up with weights ≥ 0, so the attainable torques are a convex cone. Two
numbers give its shape: the dimension of its span, and that of the torques of both signs (the
largest subspace in the cone). The columns positively span R³ where both are 3.

The shape follows by facial reduction in well-conditioned steps: where zero is a convex
combination of the unit columns, these columns span torques of both signs; they are removed, the
others are projected onto the complement, and the search continues. Where zero is no such
combination, the point of the convex hull nearest to zero separates the cone from the direction
farthest from it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from jaxsat.controllability.layout import TOLERANCE
from jaxsat.core.once import once_property
from jaxsat.core.text import fixed_text


def nonnegative_least_squares(
    columns: Float[np.ndarray, "n k"],
    target: Float[np.ndarray, " n"],
    least_singular: float | None = None,
) -> tuple[Float[np.ndarray, " k"], float]:
    """Compute weights λ ≥ 0 that minimise |columns λ - target|, and that least distance.

    Columns are dependent by a singular value below `least_singular` of the largest, by default one
    that is round-off.

    The active set of Lawson and Hanson, *Solving Least Squares Problems* (1974), section 23.3, in
    NumPy: importing SciPy takes longer than all that a scenario needs of it.
    """
    count = columns.shape[1]
    weights, support = np.zeros(count), np.zeros(count, bool)
    futile = support.copy()  # columns that leave as soon as they enter: their slope is round-off
    norm = np.linalg.norm(columns, 1) if columns.size else 0.0
    rounding = 10 * max(columns.shape) * np.finfo(float).eps * norm
    for _ in range(200 * count):
        slope = np.where(support | futile, 0.0, columns.T @ (target - columns @ weights))
        steepest = int(np.argmax(slope))
        if slope[steepest] <= rounding:
            break
        support[steepest] = True
        weights, support = _least_squares_of(columns, target, weights, support, least_singular)
        futile = futile & ~support[steepest]
        futile[steepest] = not support[steepest]
    return weights, float(np.linalg.norm(columns @ weights - target))


def _least_squares_of(
    columns: Float[np.ndarray, "n k"],
    target: Float[np.ndarray, " n"],
    weights: Float[np.ndarray, " k"],
    support: Bool[np.ndarray, " k"],
    least_singular: float | None,
) -> tuple[Float[np.ndarray, " k"], Bool[np.ndarray, " k"]]:
    """Return the least squares of the support's columns, without those of negative weight."""
    while True:
        best = np.zeros_like(weights)
        best[support] = np.linalg.lstsq(columns[:, support], target, least_singular)[0]
        negative = support & (best <= 0)
        if not negative.any():
            return best, support
        shares = np.full(len(weights), np.inf)
        distance = np.maximum(weights - best, np.finfo(float).tiny)
        shares[negative] = weights[negative] / distance[negative]
        support = support & (shares > shares.min())
        weights = np.where(support, np.maximum(weights + shares.min() * (best - weights), 0.0), 0.0)


ROUNDING = 1e-9
"""Tolerance on sines, and on the length of columns relative to the longest."""

KINDS = {
    (3, 3): "space",
    (2, 3): "half space",
    (2, 2): "plane",
    (1, 3): "wedge",
    (1, 2): "half plane",
    (1, 1): "line",
    (0, 3): "pointed cone",
    (0, 2): "sector",
    (0, 1): "ray",
    (0, 0): "nothing",
}
"""Name of a cone by the dimensions of the subspace in it and of its span."""


@dataclass(frozen=True, eq=False)
class TorqueCone:
    """The torques that columns of one or both signs can make.

    - `rays`: unit generators, a column of both signs twice.
    - `both_signs`: orthonormal basis of the torques of both signs.
    - `span`: dimension of the span of all torques.
    - `opposed`: the unit vector in the span, across `both_signs`, that is farthest from every
      torque; None where there is none because the cone is a subspace.
    - `neither`: orthonormal basis of the directions without any torque component.
    - `borderline`: sines between `ROUNDING` and the tolerance decide; the shape is then the smaller
      one, with these taken as zero.
    """

    rays: Float[np.ndarray, "3 k"]
    both_signs: Float[np.ndarray, "3 l"]
    span: int
    opposed: Float[np.ndarray, "3"] | None
    neither: Float[np.ndarray, "3 e"]
    borderline: bool

    @property
    def two_sided(self) -> int:
        """Dimension of the torques of both signs, 0 to 3."""
        return self.both_signs.shape[1]

    @property
    def kind(self) -> str:
        """Shape of the cone, one of `KINDS`."""
        return KINDS[self.two_sided, self.span]

    @once_property
    def normal(self) -> Float[np.ndarray, "3"] | None:
        """Normal n of the plane of the torques of both signs, None where they are not a plane.

        In a half space it points to the side of the torques.
        """
        if self.two_sided != 2:
            return None
        if self.opposed is not None:
            return -self.opposed
        return _positive(self.neither[:, 0])

    def angle(self, torque: Float[np.ndarray, "3"]) -> float:
        """Return the angle (rad) between a nonzero torque and the nearest attainable torque."""
        direction = torque / np.linalg.norm(torque)
        if self.rays.shape[1] == 0:
            return np.pi
        _, distance = nonnegative_least_squares(self.rays, direction)
        if distance < 1 - 1e-9:
            return float(np.arcsin(distance))
        return float(np.arccos(np.clip(np.max(self.rays.T @ direction), -1.0, 0.0)))


def unit_rays(
    columns: Float[np.ndarray, "3 m"], two_sided: Bool[np.ndarray, " m"]
) -> Float[np.ndarray, "3 k"]:
    """Return unit generators of the cone of the columns, without those that are round-off."""
    lengths = np.linalg.norm(columns, axis=0)
    live = lengths > ROUNDING * np.max(lengths, initial=0.0)
    unit = columns[:, live] / lengths[live]
    return np.concatenate([unit, -unit[:, two_sided[live]]], axis=1)


def torque_cone(
    columns: Float[np.ndarray, "3 m"],
    two_sided: Bool[np.ndarray, " m"],
    tolerance: float = TOLERANCE,
) -> TorqueCone:
    """Return the cone of torque columns (3, m), `two_sided` (m,) of which have both signs.

    Columns have any lengths. Sines below `tolerance` are zero.
    """
    rays = unit_rays(columns, two_sided)
    both_signs, span, opposed = _shape(rays, tolerance)
    strict, strict_span, _ = _shape(rays, ROUNDING)
    basis = both_signs
    if span > both_signs.shape[1]:
        across = complement(both_signs)
        basis = np.concatenate([both_signs, across @ _basis(across.T @ rays, tolerance)], axis=1)
    return TorqueCone(
        rays=rays,
        both_signs=both_signs,
        span=span,
        opposed=opposed,
        neither=complement(basis),
        borderline=(strict.shape[1], strict_span) != (both_signs.shape[1], span),
    )


def _shape(
    rays: Float[np.ndarray, "3 k"], tolerance: float
) -> tuple[Float[np.ndarray, "3 l"], int, Float[np.ndarray, "3"] | None]:
    """Return the basis of torques of both signs, the dimension of the span, and `opposed`."""
    basis = np.zeros((3, 0))
    while True:
        free = complement(basis)
        across = free.T @ rays
        lengths = np.linalg.norm(across, axis=0)
        across = across[:, lengths > tolerance] / lengths[lengths > tolerance]
        if not across.shape[1]:
            return basis, basis.shape[1], None
        weights, nearest = _nearest_to_zero(across)
        distance = float(np.linalg.norm(nearest))
        if distance > tolerance:
            span = basis.shape[1] + _basis(across, tolerance).shape[1]
            return basis, span, free @ (-nearest / distance)
        # Moved by the remainder, the columns add up to zero exactly.
        balanced_columns = across[:, weights > tolerance] - nearest[:, None]
        basis = np.concatenate([basis, free @ _basis(balanced_columns, tolerance)], axis=1)


def _nearest_to_zero(
    points: Float[np.ndarray, "n k"],
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " n"]]:
    """Return the weights of the convex hull's point nearest to zero, and the point.

    Least squares for Σ x p = 0 and Σ x = 1 with x ≥ 0 gives the weights up to a factor.
    """
    rows = np.concatenate([points, np.ones((1, points.shape[1]))])
    target = np.zeros(len(rows))
    target[-1] = 1.0
    weights, _ = nonnegative_least_squares(rows, target)
    weights = weights / np.sum(weights)
    return weights, points @ weights


def _basis(vectors: Float[np.ndarray, "n k"], tolerance: float) -> Float[np.ndarray, "n r"]:
    """Return an orthonormal basis of the span of vectors of length about one."""
    directions, values, _ = np.linalg.svd(vectors, full_matrices=False)
    return directions[:, values > tolerance * np.sqrt(vectors.shape[1])]


def complement(basis: Float[np.ndarray, "3 r"]) -> Float[np.ndarray, "3 e"]:
    """Return an orthonormal basis of the complement of an orthonormal basis."""
    if not basis.shape[1]:
        return np.eye(3)
    return np.linalg.svd(basis)[0][:, basis.shape[1] :]


def _positive(direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    return direction * np.sign(direction[np.argmax(np.abs(direction))])


def direction_words(direction: Float[np.ndarray, "3"]) -> str:
    """Return a unit vector as text: "+x", or its entries."""
    k = int(np.argmax(np.abs(direction)))
    if abs(direction[k]) > 1.0 - 1e-9:
        return ("+" if direction[k] > 0 else "-") + "xyz"[k]
    return "(" + ", ".join(fixed_text(entry, 3) for entry in direction) + ")"
