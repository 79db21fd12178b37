"""Rank, margin and turn time of any subset of the thrusters of a layout.

At rest without disturbance, the state of lowest rank, the brackets span S in the rates and the
closure of S under the vector product in the attitude, so the rank is 0, 2, 5 or 6 for
dim S = 0, 1, 2, 3. dim S is decided in exact integers on the numbers as given; the singular
values of the generating vectors say how far that decision can be trusted.

The margin is a matter of directions alone: for the paper's layout it is |J1 - J2| / (J1 + J2) for
any J3. The turn time knows the inertia. From rest, constant torques u make the rates

    ω = w t + ⟨w:w⟩ t³/6 + ⟨w:⟨w:w⟩⟩ t⁵/30 + …,    w = J⁻¹ Σ u_i g_i,

because dω/dt = w + ½⟨ω:ω⟩. So each bracket of the generating list turns the body by an angle that
grows with a power of the time; the turn time is when these angles span a radian in every direction.

The paper's closed conditions (25) and (35) ask for *some* λ or η. The determinant of the three
vectors is a quadratic form in that pair, so "some" means: the form is not zero, and its eigenvector
of the largest |eigenvalue| is the best pair. Whether the form is zero is decided in exact integers.
Equation numbers are those of Wang, Jia, Jin, Xu, Acta Astronautica 83 (2013) 44-53, with the J⁻¹ of
(14)-(15) restored.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from jaxsat.controllability import exact
from jaxsat.controllability.layout import TOLERANCE, Numbers, TorqueLayout, make_layout

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
    """Return `count` column indices by pivoted Gram-Schmidt; earlier, simpler brackets win ties."""
    rest, indices = vectors.copy(), []
    for _ in range(count):
        lengths = np.linalg.norm(rest, axis=0)
        k = int(np.argmax(lengths > 0.999 * lengths.max()))
        direction = rest[:, k] / lengths[k]
        indices.append(k)
        rest = rest - np.outer(direction, direction @ rest)
    return indices


def closure_growth(layout: TorqueLayout, thrusters: tuple[int, ...]) -> tuple[int, ...]:
    """Return the dimension of the exact closure per round; see `exact.closure_growth`."""
    axes = [layout.integer_axes[i] for i in thrusters]
    return exact.closure_growth(layout.integer_inertia, axes)


def _without_rounding_errors(layout: TorqueLayout, thrusters: tuple[int, ...]) -> tuple[int, ...]:
    """Return thrusters whose torque axis exceeds round-off of the longest of the set."""
    lengths = {i: float(np.max(np.abs(layout.torque_axes[:, i]))) for i in thrusters}
    longest = max(lengths.values(), default=0.0)
    return tuple(i for i in thrusters if lengths[i] > min(layout.rounding, 1e-9) * longest)


def _decide_set(layout: TorqueLayout, thrusters: tuple[int, ...], tolerance: float) -> RankDecision:
    columns = layout.columns(thrusters)
    vectors = layout.vectors[:, columns]
    limit = max(tolerance, layout.rounding)
    if not columns:
        return RankDecision(
            0, 0, 0, False, 0.0, np.zeros(3), limit, (), np.zeros((3, 0)), np.eye(3)
        )
    directions, values, _ = np.linalg.svd(vectors, full_matrices=True)
    values = np.concatenate([values, np.zeros(3 - len(values))])
    # Above the limit, far over all round-off, the singular values prove independence by themselves.
    dimension = 3 if values[2] > limit else closure_growth(layout, thrusters)[-1]
    values = np.where(np.arange(3) < dimension, values, 0.0)
    borderline = bool(values[dimension - 1] <= limit)
    apparent_dimension = max(1, int(np.sum(values > layout.rounding))) if borderline else dimension
    indices = _strongest(vectors, apparent_dimension)
    return RankDecision(
        rank=RANK_OF_DIMENSION[apparent_dimension],
        dimension=apparent_dimension,
        exact_rank=RANK_OF_DIMENSION[dimension],
        borderline=borderline,
        margin=float(values[2]),
        singular_values=values,
        tolerance=limit,
        generators=tuple(layout.names[columns[k]] for k in indices),
        reached=directions[:, :apparent_dimension],
        missing=directions[:, apparent_dimension:],
    )


def decide_rank(
    layout: TorqueLayout, thrusters: tuple[int, ...], tolerance: float = TOLERANCE
) -> RankDecision:
    """Decide rank and margin of a subset (column numbers) of the thrusters of a layout."""
    significant_thrusters = _without_rounding_errors(layout, thrusters)
    decision = _decide_set(layout, significant_thrusters, tolerance)
    if len(significant_thrusters) < len(thrusters):
        full = _decide_set(layout, thrusters, tolerance)
        if full.exact_rank != decision.exact_rank:
            return replace(decision, borderline=True, exact_rank=full.exact_rank)
    return decision


HALVINGS = 60

LARGEST = 200.0
"""Logarithm of the largest angle in the computation; larger ones are clipped."""


def turn_time(
    inertia: Float[np.ndarray, "3 3"], torque_axes: Float[np.ndarray, "3 m"], torque: float = 1.0
) -> float:
    """Compute the time (s) to turn by one radian about the axis hardest to reach, from rest.

    `inertia` in kg m²; `torque_axes` have any lengths, each thruster makes up to `torque` (N m) of
    either sign about its own. The result is the least t at which the angles that single brackets
    make, leading order in t, have no singular value below 1 rad; the other axes need not come to
    rest, so a manoeuvre takes longer. It falls as 1/√torque. Infinite where the brackets do not
    span.

    For principal axes and thrusters along x and y, with T the torque, it is the larger of
    √(2 max(J1, J2) / T) and (12 J1 J2 J3 / (|J1 - J2| T²))^¼. NaN where brackets overflow for
    extreme ratios of moments.
    """
    scale = float(np.max(np.abs(inertia)))
    with np.errstate(over="ignore", invalid="ignore"):
        accelerations, powers = _columns(inertia / scale, torque_axes)
        sizes = np.linalg.norm(accelerations, axis=0)
    if not np.isfinite(sizes).all():
        return np.nan
    accelerations, powers, sizes = (part[..., sizes > 0] for part in (accelerations, powers, sizes))
    if np.linalg.matrix_rank(accelerations) < 3:
        return np.inf

    def least(logarithm: float) -> float:
        log_sizes = np.minimum(np.log(sizes) + powers * logarithm, LARGEST)
        return float(np.linalg.svd(accelerations / sizes * np.exp(log_sizes), compute_uv=False)[-1])

    low, high = -2.0, 2.0
    while least(low) > 1:
        low -= 4.0
    while least(high) < 1 and high < 300:
        high += 4.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if least(middle) < 1 else (low, middle)
    return float(np.exp(high) * np.sqrt(scale / torque))


def decided_turn_time(
    decision: RankDecision, inertia: Float[np.ndarray, "3 3"], torque_axes: Float[np.ndarray, "3 m"]
) -> float:
    """Return the turn time (s) at 1 N m of a layout of rank 6, infinite for any other."""
    return turn_time(inertia, torque_axes) if decision.controllable else np.inf


def _columns(
    inertia: Float[np.ndarray, "3 3"], torque_axes: Float[np.ndarray, "3 m"]
) -> tuple[Float[np.ndarray, "3 k"], Float[np.ndarray, " k"]]:
    """Return angles (rad) after one unit of time, and the powers of time with which they grow."""
    largest = np.abs(torque_axes).max(axis=0, initial=0.0)
    axes = torque_axes[:, largest > 0] / largest[largest > 0]
    axes = axes / np.linalg.norm(axes, axis=0)
    directions = np.linalg.solve(inertia, axes).T

    def product(x, y):  # ⟨x:y⟩
        return -np.linalg.solve(inertia, np.cross(x, inertia @ y) + np.cross(y, inertia @ x))

    terms = [(v / 2, 2) for v in directions]
    terms += [(product(v, w) / 12, 4) for v, w in itertools.combinations(directions, 2)]
    for v in directions:
        h = product(v, v)
        terms += [(h / 24, 4), (product(v, h) / 180, 6), (product(h, h) / 4032, 8)]
    if not terms:
        return np.zeros((3, 0)), np.zeros(0)
    columns, powers = zip(*terms, strict=True)
    return np.stack(columns, axis=1), np.array(powers, float)


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """One closed condition: whether it holds, the best pair, and the resulting three vectors.

    `coefficients` (λ1, λ2) or (η1, η2) multiply the unit vectors of the first two columns of
    `vectors` (body torques: J times the vectors of the paper, unit or relative length); None if no
    pair exists. `margin` is the smallest singular value of `vectors`.
    """

    equation: str
    holds: bool
    coefficients: tuple[float, float] | None
    vectors: Float[np.ndarray, "3 3"]
    margin: float


def _evaluate(
    equation: str, layout: TorqueLayout, first: exact.Vector, second: exact.Vector
) -> ClosedForm:
    """Evaluate the condition rank{p, q, ⟨w:w⟩} = 3 for some w = c1 p + c2 q."""
    adjoint = exact.adjugate(layout.integer_inertia)
    normal = exact.cross(first, second)
    p, q = exact.unit(first), exact.unit(second)
    pairs = ((first, first), (first, second), (second, second))
    products = [exact.torque_product(adjoint, a, b) for a, b in pairs]
    holds = any(normal) and any(exact.dot(normal, product) for product in products)
    if not holds:
        return ClosedForm(equation, False, None, np.stack([p, q, np.zeros(3)], axis=1), 0.0)
    largest = max(abs(entry) for row in adjoint for entry in row)
    inverse = np.array([[entry / largest for entry in row] for row in adjoint])

    def product(a, b):
        return -np.cross(inverse @ a, b) - np.cross(inverse @ b, a)

    direction = exact.unit(normal)
    form = np.array(
        [
            [direction @ product(p, p), direction @ product(p, q)],
            [direction @ product(p, q), direction @ product(q, q)],
        ]
    )
    values, vectors = np.linalg.eigh(form)
    pair = vectors[:, np.argmax(np.abs(values))]
    pair = pair * np.sign(pair[np.argmax(np.abs(pair))])
    w = pair[0] * p + pair[1] * q
    size = 2.0 * np.linalg.norm(inverse @ w) * np.linalg.norm(w)
    matrix = np.stack([p, q, product(w, w) / size], axis=1)
    margin = float(np.linalg.svd(matrix, compute_uv=False)[2])
    return ClosedForm(equation, True, (float(pair[0]), float(pair[1])), matrix, margin)


def two_thruster_condition(inertia: Numbers, torque_axes: Numbers) -> ClosedForm:
    """Evaluate (25): span{g1, g2, g3} = R³ with g3 = J⁻¹(w^×Jw), w = λ1 g1 + λ2 g2.

    `inertia` (3,) or (3, 3) in kg m²; `torque_axes` (3, 2). Necessary and sufficient when the two
    axes are independent; for parallel axes it fails although (35) may hold.
    Raises ValueError unless there are two axes, neither zero.
    """
    layout = make_layout(inertia, torque_axes)
    if len(layout.integer_axes) != 2 or not all(map(any, layout.integer_axes)):
        raise ValueError(
            "Argument `torque_axes` must have two columns that are not zero for (25), "
            f"but got {np.asarray(torque_axes).tolist()}"
        )
    return _evaluate("(25)", layout, *layout.integer_axes)


def one_thruster_condition(inertia: Numbers, torque_axis: Numbers) -> ClosedForm:
    """Evaluate (35): span{h1, h2, h3} = R³ with h2 = ⟨h1:h1⟩, h3 = ⟨w:w⟩, w = η1 h1 + η2 h2.

    `inertia` (3,) or (3, 3) in kg m²; `torque_axis` (3,) or (3, 1), not zero (ValueError).
    """
    layout = make_layout(inertia, np.reshape(np.asarray(torque_axis), (3, -1)))
    if len(layout.integer_axes) != 1 or not any(layout.integer_axes[0]):
        raise ValueError(
            "Argument `torque_axis` must be one vector that is not zero for (35), "
            f"but got {np.asarray(torque_axis).tolist()}"
        )
    axis = layout.integer_axes[0]
    adjoint = exact.adjugate(layout.integer_inertia)
    h2 = exact.primitive(exact.torque_product(adjoint, axis, axis))
    return _evaluate("(35)", layout, axis, h2)
