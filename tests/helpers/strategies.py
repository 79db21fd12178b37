"""Random bodies, attitudes and rates for hypothesis."""

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation


def vectors(size: int, bound: float = 1.0):
    return st.lists(st.floats(-bound, bound), min_size=size, max_size=size).map(np.array)


def rotations():
    """SciPy rotations, spread over the sphere, never degenerate."""
    return (
        vectors(4)
        .filter(lambda q: np.linalg.norm(q) > 1e-3)
        .map(lambda q: Rotation.from_quat(q / np.linalg.norm(q)))
    )


def inertias():
    """Symmetric positive-definite matrices with principal moments of 10 to 1000 kg m²."""
    moments = st.lists(st.floats(10, 1000), min_size=3, max_size=3).map(np.array)

    def assemble(pair):
        turn = pair[0].as_matrix()
        matrix = turn @ np.diag(pair[1]) @ turn.T
        return (matrix + matrix.T) / 2

    return st.tuples(rotations(), moments).map(assemble)
