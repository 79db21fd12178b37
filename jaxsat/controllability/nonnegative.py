"""Least squares with weights that are not negative."""

import numpy as np
from jaxtyping import Float


def nonnegative_least_squares(
    columns: Float[np.ndarray, "n k"], target: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " k"], float]:
    """Weights λ ≥ 0 that minimise |columns λ - target|, and that least distance."""
    from scipy.optimize import nnls  # takes its time, and most studies have no use for it

    return nnls(columns, target, maxiter=200 * columns.shape[1])
