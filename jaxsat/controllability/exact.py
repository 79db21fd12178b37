"""The bracket closure in exact integer arithmetic.

A double is a rational number, so controllability of a layout *as given* can be decided without any
round-off. All vectors here are body torques: with p = Jx and q = Jy the symmetric product
⟨x:y⟩ = J⁻¹(x^×Jy + y^×Jx) becomes J⟨x:y⟩ = −(J⁻¹p × q + J⁻¹q × p), and replacing J⁻¹ by the
adjugate of J only scales it. Common factors never matter: every vector stands for its line.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

Vector = tuple[int, int, int]
Matrix = tuple[Vector, Vector, Vector]


def to_integers(values: Float[np.ndarray, " n"]) -> list[int]:
    """Return integers exactly proportional to finite doubles (common factor: a power of two)."""
    parts = [math.frexp(float(value)) for value in values]
    exponents = [exponent for mantissa, exponent in parts if mantissa]
    lowest = min(exponents, default=0)
    return [
        int(math.ldexp(mantissa, 53)) << (exponent - lowest) if mantissa else 0
        for mantissa, exponent in parts
    ]


def primitive(vector: Sequence[int]) -> Vector:
    """Return the vector divided by its entries' greatest common divisor."""
    divisor = math.gcd(*vector) or 1
    return (vector[0] // divisor, vector[1] // divisor, vector[2] // divisor)


def symmetric_matrix(inertia: Float[np.ndarray, "3 3"]) -> Matrix:
    """Return integers exactly proportional to the symmetric part of a matrix."""
    flat = to_integers(inertia.reshape(9))
    total = [flat[3 * i + j] + flat[3 * j + i] for i in range(3) for j in range(3)]
    divisor = math.gcd(*total) or 1
    total = [entry // divisor for entry in total]
    return (
        (total[0], total[1], total[2]),
        (total[3], total[4], total[5]),
        (total[6], total[7], total[8]),
    )


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a: Vector, b: Vector) -> int:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def adjugate(matrix: Matrix) -> Matrix:
    """Return the adjugate of a symmetric matrix, det(J) J⁻¹."""
    a, b, c = matrix
    return (cross(b, c), cross(c, a), cross(a, b))


def apply(matrix: Matrix, vector: Vector) -> Vector:
    """Return matrix times vector."""
    return (dot(matrix[0], vector), dot(matrix[1], vector), dot(matrix[2], vector))


def is_positive_definite(matrix: Matrix) -> bool:
    """Whether a matrix is positive definite, exactly, by Sylvester's criterion."""
    adjoint = adjugate(matrix)
    determinant = dot(matrix[0], adjoint[0])
    return matrix[0][0] > 0 and adjoint[2][2] > 0 and determinant > 0


def torque_product(adjoint: Matrix, p: Vector, q: Vector) -> Vector:
    """Return det(J) J⟨J⁻¹p : J⁻¹q⟩ for torques p and q (not reduced)."""
    a = cross(apply(adjoint, p), q)
    b = cross(apply(adjoint, q), p)
    return (-a[0] - b[0], -a[1] - b[1], -a[2] - b[2])


def is_parallel(a: Vector, b: Vector) -> bool:
    """Whether two vectors are on one line."""
    return not any(cross(a, b))


def independent(vectors: Sequence[Vector]) -> list[Vector]:
    """Return the first vectors of the list that span all of them."""
    basis: list[Vector] = []
    for vector in vectors:
        if not any(vector):
            continue
        if (
            not basis
            or (len(basis) == 1 and not is_parallel(basis[0], vector))
            or (len(basis) == 2 and dot(cross(basis[0], basis[1]), vector))
        ):
            basis.append(vector)
    return basis


def closure_growth(inertia: Matrix, torques: Sequence[Vector]) -> tuple[int, ...]:
    """Return the dimension of the span after 0, 1, … rounds of ⟨:⟩, until a round adds nothing.

    The last entry is dim S. A round multiplies *every* pair of the span, so a round without growth
    proves that the closure is reached (nested brackets counted by depth give no such proof).
    """
    adjoint = adjugate(inertia)
    basis = independent(torques)
    growth = [len(basis)]
    while 0 < len(basis) < 3:
        products = [
            primitive(torque_product(adjoint, basis[i], basis[j]))
            for i in range(len(basis))
            for j in range(i, len(basis))
        ]
        basis = independent([*basis, *products])
        growth.append(len(basis))
        if growth[-1] == growth[-2]:
            break
    return tuple(growth)


def mantissa(vector: Vector) -> tuple[Float[np.ndarray, "3"], int]:
    """Return doubles of size about one and the power of two that scales them back."""
    exponent = max(abs(entry).bit_length() for entry in vector)
    scale = 1 << exponent
    return np.array([entry / scale for entry in vector]), exponent


def unit(vector: Vector) -> Float[np.ndarray, "3"]:
    """Return the unit vector in doubles (zero for a zero vector)."""
    values, _ = mantissa(vector)
    length = float(np.linalg.norm(values))
    return values / length if length else values


def relative_product(adjoint: Matrix, p: Vector, q: Vector) -> Float[np.ndarray, "3"]:
    """Return J⟨J⁻¹p : J⁻¹q⟩ / (|J⁻¹p||q| + |J⁻¹q||p|), of length at most 1, correctly rounded.

    The divisor is the size of the two terms before they cancel, so the length is the relative
    remainder: |J1 − J2|/(J1 + J2) for torques along two principal axes.
    """
    numerator, top = mantissa(torque_product(adjoint, p, q))
    terms = []
    for a, b in ((p, q), (q, p)):
        rate, e1 = mantissa(apply(adjoint, a))
        torque, e2 = mantissa(b)
        terms.append((float(np.linalg.norm(rate) * np.linalg.norm(torque)), e1 + e2))
    high = max(exponent for _, exponent in terms)
    divisor = sum(math.ldexp(size, exponent - high) for size, exponent in terms)
    ratio = numerator / divisor
    return np.ldexp(ratio, max(top - high, -2000))
