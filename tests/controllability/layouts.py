"""Bodies and torque axes of every kind, in whole numbers."""

import itertools
import math

import numpy as np

X, Y, Z = [1, 0, 0], [0, 1, 0], [0, 0, 1]

MOMENTS = {
    "general": (9, 5, 7),
    "J1 = J2": (5, 5, 7),
    "J2 = J3": (9, 6, 6),
    "sphere": (4, 4, 4),
    "flat plate": (3, 4, 7),
    "rod": (1, 500, 500),
    "nearly a rod": (1, 500, 501),
}
AXES = {
    "none": [],
    "dead": [[0, 0, 0]],
    "x": [X],
    "z": [Z],
    "principal plane": [[2, 3, 0]],
    "general axis": [[1, 2, 3]],
    "x and y": [X, Y],
    "y and z": [Y, Z],
    "x and xz": [X, [1, 0, 1]],
    "two general": [[1, 2, 3], [3, -1, 2]],
    "parallel pair": [[1, 2, 3], [-2, -4, -6]],
    "with a dead one": [X, [0, 0, 0], [0, 3, 0]],
    "coplanar three": [X, Y, [1, 1, 0]],
    "three": [X, Y, Z],
    "three general": [[1, 2, 3], [3, -1, 2], [1, 1, 1]],
}
QUATERNIONS = [(1, 0, 0, 0), (1, 1, 1, 1), (1, 2, 0, 0), (3, 1, -2, 4)]


def columns(axes):
    return np.array(axes, dtype=float).reshape(-1, 3).T


def invariant_planes():
    """Torque pairs spanning the plane closed under ⟨:⟩ of a general body: a separatrix plane.

    ω·n = 0 is invariant for the free body when n = (√(J1(J1−J2)), 0, ±√(J3(J2−J3))), J1 > J2 > J3;
    the moments are chosen so that the roots are integers.
    """
    found = []
    for moments in itertools.product(range(1, 30), repeat=3):
        j1, j2, j3 = moments
        if j1 > j2 > j3 and j1 <= j2 + j3:
            a, b = j1 * (j1 - j2), j3 * (j2 - j3)
            if math.isqrt(a) ** 2 == a and math.isqrt(b) ** 2 == b:
                n = (math.isqrt(a), 0, math.isqrt(b))
                # Torques J x for x in the plane.
                found.append((moments, [[0, j2, 0], [j1 * n[2], 0, -j3 * n[0]]]))
    return found


PLANES = invariant_planes()


def random_rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)
