"""A checked layout: the inertia and the torque axes as given, in doubles and in exact integers."""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from jaxsat.controllability import exact
from jaxsat.controllability.closure import generator_names

# Run-time type checkers read NumPy's ArrayLike as excluding tuples.
Numbers = ArrayLike | Sequence

TOLERANCE = 5e-6
"""Threshold of the deciding singular value, below which a verdict is borderline; see `analyse`."""

# Round-off between intended and stored numbers (a cosine, two rotations of J, a division by the
# length: about ten units) times the largest slope of a generating vector with respect to its
# entries (about ten), in units of eps · cond(J).
ROUNDING_UNITS = 128.0


def finite(name: str, values: Numbers) -> tuple[Float[np.ndarray, "..."], float]:
    """Return an argument in doubles, and the relative round-off of its original precision.

    Raises TypeError or ValueError unless it holds finite real numbers.
    """
    numbers = np.asarray(values)
    small_float = numbers.dtype.kind == "V" and jnp.issubdtype(numbers.dtype, jnp.floating)
    if numbers.dtype.kind not in "iuf" and not small_float:
        raise TypeError(f"Argument `{name}` must hold real numbers, but got dtype {numbers.dtype}")
    eps = 0.0 if numbers.dtype.kind in "iu" else float(jnp.finfo(numbers.dtype).eps)
    array = numbers.astype(np.float64)
    if not np.all(np.isfinite(array)):
        raise ValueError(f"Argument `{name}` must be finite, but got {array.tolist()}")
    return array, max(eps, float(np.finfo(np.float64).eps))


def inertia_matrix(inertia: Numbers) -> tuple[Float[np.ndarray, "3 3"], float]:
    """Return the (3, 3) inertia of principal moments (3,) or a matrix, and its relative round-off.

    Raises ValueError unless the inertia is finite, symmetric (to 1e-6 of its largest entry) and
    positive definite. Moments of no real body (one larger than the sum of the others) are allowed.
    """
    array, eps = finite("inertia", inertia)
    if array.shape == (3,):
        array = np.diag(array)
    if array.shape != (3, 3):
        raise ValueError(
            f"Argument `inertia` must have shape (3,) or (3, 3), but got {array.shape}"
        )
    asymmetry = float(np.max(np.abs(array - array.T)))
    largest = float(np.max(np.abs(array)))
    if asymmetry > 1e-6 * largest:
        raise ValueError(f"Argument `inertia` must be symmetric, but got {array.tolist()}")
    if not exact.is_positive_definite(exact.symmetric_matrix(array)):
        raise ValueError(f"Argument `inertia` must be positive definite, but got {array.tolist()}")
    # Unequal products are known no better than their difference.
    return array, max(eps, asymmetry / largest)


@dataclass(frozen=True, eq=False)
class TorqueLayout:
    """Inertia and thrusters, checked once, with everything that all subsets of them share.

    `members[k]` names the thrusters that column k of the generating vectors needs; `alias[i]` is
    the first thruster on the same line as thruster i (−1 if its axis is zero).
    """

    inertia: Float[np.ndarray, "3 3"]
    torque_axes: Float[np.ndarray, "3 m"]
    labels: tuple[str, ...]
    integer_inertia: exact.Matrix
    integer_axes: tuple[exact.Vector, ...]
    alias: tuple[int, ...]
    vectors: Float[np.ndarray, "3 k"]
    names: tuple[str, ...]
    members: tuple[frozenset[int], ...]
    rounding: float

    def columns(self, thrusters: tuple[int, ...]) -> list[int]:
        """Return columns of the generating vectors that a subset of the thrusters can produce."""
        first = {}
        for i in thrusters:
            if self.alias[i] >= 0:
                first.setdefault(self.alias[i], i)
        representatives = set(first.values())
        return [k for k, makers in enumerate(self.members) if makers <= representatives]


def _generating_vectors(
    inertia: exact.Matrix, axes: tuple[exact.Vector, ...]
) -> tuple[list[Float[np.ndarray, "3"]], list[frozenset[int]]]:
    """Return the list of `closure.generating_vectors` from exact integers, and its thrusters."""
    adjoint = exact.adjugate(inertia)
    count = len(axes)
    live = [any(axis) for axis in axes]
    zero = np.zeros(3)
    columns = [exact.unit(axis) for axis in axes]
    members = [frozenset((i,)) for i in range(count)]
    for i in range(count):
        for j in range(i, count):
            both = live[i] and live[j]
            columns.append(exact.relative_product(adjoint, axes[i], axes[j]) if both else zero)
            members.append(frozenset((i, j)))
    second, third = [], []
    for i in range(count):
        h = exact.primitive(exact.torque_product(adjoint, axes[i], axes[i]))
        relative = exact.relative_product(adjoint, axes[i], axes[i]) if live[i] else zero
        size = float(np.linalg.norm(relative))
        second.append(size * exact.relative_product(adjoint, axes[i], h) if size else zero)
        third.append(size * exact.relative_product(adjoint, h, h) if size else zero)
    own = [frozenset((i,)) for i in range(count)]
    return columns + second + third, members + own + own


def make_layout(
    inertia: Numbers, torque_axes: Numbers, *, labels: Sequence[str] | None = None
) -> TorqueLayout:
    """Check the arguments and prepare the exact and the rounded generating vectors.

    Raises ValueError for wrong shapes, entries that are not finite, an inertia that is not
    symmetric positive definite, or labels that do not match the columns.
    """
    matrix, eps_inertia = inertia_matrix(inertia)
    axes, eps_axes = finite("torque_axes", torque_axes)
    if axes.ndim != 2 or axes.shape[0] != 3:
        raise ValueError(f"Argument `torque_axes` must have shape (3, m), but got {axes.shape}")
    count = axes.shape[1]
    if labels is not None and len(labels) != count:
        raise ValueError(f"Argument `labels` must hold {count} names, but got {len(labels)}")
    names = tuple(labels) if labels is not None else tuple(f"g{i + 1}" for i in range(count))
    integer_inertia = exact.symmetric_matrix(matrix)
    integer_axes = tuple(exact.primitive(exact.to_integers(column)) for column in axes.T)
    alias = []
    for i, axis in enumerate(integer_axes):
        same = (j for j in range(i) if alias[j] == j and exact.is_parallel(integer_axes[j], axis))
        alias.append(next(same, i) if any(axis) else -1)
    columns, members = _generating_vectors(integer_inertia, integer_axes)
    moments = np.linalg.eigvalsh(matrix / np.max(np.abs(matrix)))
    # The exact test has passed; a condition number beyond doubles shows here as a moment <= 0.
    condition = moments[2] / max(moments[0], np.finfo(float).eps * moments[2])
    return TorqueLayout(
        inertia=0.5 * (matrix + matrix.T),
        torque_axes=axes,
        labels=names,
        integer_inertia=integer_inertia,
        integer_axes=integer_axes,
        alias=tuple(alias),
        vectors=np.stack(columns, axis=1) if columns else np.zeros((3, 0)),
        names=generator_names(count, names),
        members=tuple(members),
        rounding=ROUNDING_UNITS * max(eps_inertia, eps_axes) * float(condition),
    )
