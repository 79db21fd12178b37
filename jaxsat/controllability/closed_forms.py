"""The paper's closed conditions (25) and (35), with λ and η found instead of guessed.

Both ask for *some* λ or η. The determinant of the three vectors is a quadratic form in that pair,
so "some" means: the form is not zero, and its eigenvector of the largest |eigenvalue| is the best
pair. Whether the form is zero is decided in exact integers. Equation numbers are those of
Wang, Jia, Jin, Xu, Acta Astronautica 83 (2013) 44-53, with the J⁻¹ of (14)-(15) restored.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.controllability import exact
from jaxsat.controllability.layout import Numbers, TorqueLayout, make_layout


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """One closed condition: whether it holds, the pair found, and the three vectors it makes.

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
    """The condition rank{p, q, ⟨w:w⟩} = 3 for some w = c1 p + c2 q."""
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
    """Condition (25): span{g1, g2, g3} = R³ with g3 = J⁻¹(w^×Jw), w = λ1 g1 + λ2 g2.

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
    """Condition (35): span{h1, h2, h3} = R³ with h2 = ⟨h1:h1⟩, h3 = ⟨w:w⟩, w = η1 h1 + η2 h2.

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
