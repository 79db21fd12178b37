"""The decision itself: rank and margin of any subset of the thrusters of a layout.

At rest without disturbance, the state of lowest rank, the brackets span S in the rates and the
closure of S under the vector product in the attitude, so the rank is 0, 2, 5 or 6 for
dim S = 0, 1, 2, 3. dim S is decided in exact integers on the numbers as given; the singular
values of the generating vectors say how far that decision can be trusted.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from jaxsat.controllability import exact
from jaxsat.controllability.layout import TOLERANCE, Layout

RANK_OF_DIMENSION = (0, 2, 5, 6)


@dataclass(frozen=True, eq=False)
class RankDecision:
    """Rank and margin of one set of thrusters; see `Analysis` for the fields."""

    rank: int
    dimension: int
    exact_rank: int
    borderline: bool
    margin: float
    singular_values: Float[np.ndarray, "3"]
    tolerance: float
    generators: tuple[str, ...]
    reached: Float[np.ndarray, "3 d"]
    missing: Float[np.ndarray, "3 e"]

    @property
    def controllable(self) -> bool:
        """Whether the rank is 6."""
        return self.rank == 6


def _strongest(vectors: Float[np.ndarray, "3 k"], count: int) -> list[int]:
    """Indices of `count` columns by pivoted Gram-Schmidt; earlier, simpler brackets win ties."""
    rest, chosen = vectors.copy(), []
    for _ in range(count):
        lengths = np.linalg.norm(rest, axis=0)
        k = int(np.argmax(lengths > 0.999 * lengths.max()))
        direction = rest[:, k] / lengths[k]
        chosen.append(k)
        rest = rest - np.outer(direction, direction @ rest)
    return chosen


def closure_growth(layout: Layout, thrusters: tuple[int, ...]) -> tuple[int, ...]:
    """Dimension of the exact closure after each round; see `exact.closure_growth`."""
    axes = [layout.integer_axes[i] for i in thrusters]
    return exact.closure_growth(layout.integer_inertia, axes)


def _without_rounding_errors(layout: Layout, thrusters: tuple[int, ...]) -> tuple[int, ...]:
    """Thrusters whose torque axis is more than rounding beside the longest of the set."""
    lengths = {i: float(np.max(np.abs(layout.torque_axes[:, i]))) for i in thrusters}
    longest = max(lengths.values(), default=0.0)
    return tuple(i for i in thrusters if lengths[i] > min(layout.rounding, 1e-9) * longest)


def _decide_set(layout: Layout, thrusters: tuple[int, ...], tolerance: float) -> RankDecision:
    columns = layout.columns(thrusters)
    vectors = layout.vectors[:, columns]
    limit = max(tolerance, layout.rounding)
    if not columns:
        return RankDecision(
            0, 0, 0, False, 0.0, np.zeros(3), limit, (), np.zeros((3, 0)), np.eye(3)
        )
    directions, values, _ = np.linalg.svd(vectors, full_matrices=True)
    values = np.concatenate([values, np.zeros(3 - len(values))])
    # Above the limit, far over all rounding, the singular values prove independence by themselves.
    dimension = 3 if values[2] > limit else closure_growth(layout, thrusters)[-1]
    values = np.where(np.arange(3) < dimension, values, 0.0)
    borderline = bool(values[dimension - 1] <= limit)
    seen = max(1, int(np.sum(values > layout.rounding))) if borderline else dimension
    chosen = _strongest(vectors, seen)
    return RankDecision(
        rank=RANK_OF_DIMENSION[seen],
        dimension=seen,
        exact_rank=RANK_OF_DIMENSION[dimension],
        borderline=borderline,
        margin=float(values[2]),
        singular_values=values,
        tolerance=limit,
        generators=tuple(layout.names[columns[k]] for k in chosen),
        reached=directions[:, :seen],
        missing=directions[:, seen:],
    )


def decide_rank(
    layout: Layout, thrusters: tuple[int, ...], tolerance: float = TOLERANCE
) -> RankDecision:
    """Rank and margin of a subset (column numbers) of the thrusters of a layout."""
    kept = _without_rounding_errors(layout, thrusters)
    decision = _decide_set(layout, kept, tolerance)
    if len(kept) < len(thrusters):
        full = _decide_set(layout, thrusters, tolerance)
        if full.exact_rank != decision.exact_rank:
            return replace(decision, borderline=True, exact_rank=full.exact_rank)
    return decision
