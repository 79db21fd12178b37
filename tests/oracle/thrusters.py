"""Thruster torques (3)-(9), solved in exact rational arithmetic."""

from fractions import Fraction

import numpy as np


def _exact(matrix):
    return [[Fraction(float(x)) for x in row] for row in np.atleast_2d(matrix)]


def solve_exact(matrix, right):
    """Solve a square linear system by Gauss-Jordan in fractions; ZeroDivisionError if singular."""
    rows = [
        [*row, Fraction(float(b))] for row, b in zip(_exact(matrix), np.ravel(right), strict=True)
    ]
    size = len(rows)
    for k in range(size):
        pivot = next((i for i in range(k, size) if rows[i][k] != 0), None)
        if pivot is None:
            raise ZeroDivisionError("The matrix is singular.")
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(size):
            if i != k:
                rows[i] = [x - rows[i][k] * y for x, y in zip(rows[i], rows[k], strict=True)]
    return np.array([float(row[-1]) for row in rows])


def torque(direction_cosines, thrust):
    """Return the body torque (3) of the working thrusters; columns are the torque directions."""
    products = [
        sum((a * Fraction(float(t)) for a, t in zip(row, thrust, strict=True)), Fraction(0))
        for row in _exact(direction_cosines)
    ]
    return np.array([float(x) for x in products])


def two_thruster_coefficients(direction_cosines):
    """Return b1, b2 of (5) for a (3, 2) matrix.

    T_Z = b1 u1 + b2 u2 for every thrust says that the third row is b times the upper block.
    ZeroDivisionError where cos α1 cos β2 = cos α2 cos β1, and b does not exist.
    """
    cosines = np.asarray(direction_cosines, float)
    return solve_exact(cosines[:2].T, cosines[2])


def two_thruster_command(direction_cosines, thrust):
    """Return u1, u2 of (5), the upper block times the thrust."""
    return torque(np.asarray(direction_cosines)[:2], thrust)


def two_thruster_thrust(direction_cosines, command):
    """Return T1, T2 that make the commanded u1, u2 of (5)."""
    return solve_exact(np.asarray(direction_cosines)[:2], command)


def two_thruster_fields(direction_cosines):
    """Return g1, g2 of (6)."""
    b1, b2 = two_thruster_coefficients(direction_cosines)
    return np.array([1.0, 0.0, b1]), np.array([0.0, 1.0, b2])


def one_thruster_coefficients(direction_cosines):
    """Return c1, c2 of (8) for a (3,) column; ZeroDivisionError where cos α1 = 0."""
    first, second, third = (Fraction(float(x)) for x in np.ravel(direction_cosines))
    return np.array([float(second / first), float(third / first)])


def one_thruster_field(direction_cosines):
    """Return h1 of (9)."""
    return np.concatenate([[1.0], one_thruster_coefficients(direction_cosines)])
